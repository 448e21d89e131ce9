# cmake -D HEADERS=<include/prolate> -D OBJECTS=<list> -P headers_check.cmake
#
# Fails unless each header in the folder has an object file that the compiler made from it alone. So a header that was
# added, or a list that came out empty, cannot slip through.
cmake_minimum_required(VERSION 3.25)

file(GLOB_RECURSE headers RELATIVE ${HEADERS} ${HEADERS}/*)
set(compiled "")
foreach(object IN LISTS OBJECTS)
  if(EXISTS ${object} AND object MATCHES ".*/headers/(.+)\\.cpp\\.o(bj)?$")
    list(APPEND compiled ${CMAKE_MATCH_1})
  endif()
endforeach()
list(SORT headers)
list(SORT compiled)
if(NOT headers OR NOT headers STREQUAL compiled)
  message(FATAL_ERROR "public headers: ${headers}\ncompiled alone: ${compiled}")
endif()
list(LENGTH headers count)
message(STATUS "${count} public headers, each compiled alone")

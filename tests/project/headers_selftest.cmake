# cmake -D CXX=<compiler> -D WORK=<scratch folder> -P headers_selftest.cmake
#
# The header test must refuse a header that forgets an include, one without a guard, and one that nobody compiled.
# Headers in folders count.
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/headers.cmake)

file(REMOVE_RECURSE ${WORK})
file(WRITE ${WORK}/prolate/detail/good.hpp "#pragma once\n#include <vector>\ninline std::vector<int> f() { return {}; }\n")
file(WRITE ${WORK}/prolate/forgets.hpp "#pragma once\ninline std::vector<int> f() { return {}; }\n")
file(WRITE ${WORK}/prolate/unguarded.hpp "inline int f() { return 1; }\n")
foreach(header detail/good forgets unguarded)
  header_source(source ${header}.hpp ${WORK})
  execute_process(COMMAND ${CXX} -std=c++20 -I ${WORK} -c ${source} -o ${source}.o RESULT_VARIABLE result ERROR_QUIET)
  if(header STREQUAL "detail/good" AND NOT result EQUAL 0)
    message(SEND_ERROR "a sound header was refused")
  elseif(NOT header STREQUAL "detail/good" AND result EQUAL 0)
    message(SEND_ERROR "${header}.hpp passed")
  endif()
endforeach()

# Only the good one has an object now, so the folder must be refused until the other two are gone.
function(check objects result_out)
  execute_process(COMMAND ${CMAKE_COMMAND} -D HEADERS=${WORK}/prolate "-D OBJECTS=${objects}"
    -P ${CMAKE_CURRENT_LIST_DIR}/headers_check.cmake RESULT_VARIABLE result OUTPUT_QUIET ERROR_QUIET)
  set(${result_out} ${result} PARENT_SCOPE)
endfunction()
set(all ${WORK}/detail/good.hpp.cpp.o ${WORK}/forgets.hpp.cpp.o ${WORK}/unguarded.hpp.cpp.o)
check("${all}" result)
if(result EQUAL 0)
  message(SEND_ERROR "headers that were not compiled passed")
endif()
file(REMOVE ${WORK}/prolate/forgets.hpp ${WORK}/prolate/unguarded.hpp)
check("${all}" result)
if(NOT result EQUAL 0)
  message(SEND_ERROR "a compiled header was refused")
endif()
check("" result)
if(result EQUAL 0)
  message(SEND_ERROR "an empty list passed")
endif()
file(REMOVE_RECURSE ${WORK})

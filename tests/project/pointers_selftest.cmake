# cmake -D WORK=<scratch folder> -P pointers_selftest.cmake
#
# In a small tree, pointers.cmake must find each name of a file that does not exist, and must leave the others alone.
cmake_minimum_required(VERSION 3.25)

# expect(VERDICT FILE TEXT): TEXT as line 2 of FILE must be found (bad) or not (good).
function(expect verdict file text)
  file(REMOVE_RECURSE "${WORK}")
  file(WRITE "${WORK}/query/collide/search.cpp" "// A source; query/collide/search.cpp is its name.\n")
  file(WRITE "${WORK}/include/prolate/tree.hpp" "#pragma once\n")
  file(WRITE "${WORK}/builder/grow.cpp" "\n")
  file(WRITE "${WORK}/${file}" "\n${text}\n")
  execute_process(COMMAND ${CMAKE_COMMAND} -D ROOT=${WORK} -P ${CMAKE_CURRENT_LIST_DIR}/pointers.cmake
    RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE output)
  string(FIND "\n${output}" "\n${file}:2: " at)
  if(verdict STREQUAL "bad" AND (result EQUAL 0 OR at EQUAL -1))
    message(SEND_ERROR "not found in ${file}: ${text}\n${output}")
  elseif(verdict STREQUAL "good" AND NOT result EQUAL 0)
    message(SEND_ERROR "wrongly refused in ${file}: ${text}\n${output}")
  endif()
endfunction()

foreach(file query/a.cpp include/prolate/a.hpp viewer/a.js)
  expect(good ${file} "int x; // as search.cpp, collide/search.cpp, prolate/tree.hpp, query/collide and query/ do")
  expect(good ${file} "#include \"query/lost.hpp\" // the compiler judges what is no comment")
  expect(bad ${file} "/// told in lost.cpp")
  expect(bad ${file} "int x; // told in query/collide/lost.cpp, 4")
  expect(bad ${file} "// told in query/search.cpp.")
  expect(bad ${file} "// told in (query/lost)")
  expect(bad ${file} "// earch.cpp is a part of a name")
endforeach()
expect(bad query/a.cpp "// as in grow.cpp, which queries do not know")
expect(good builder/a.cpp "// as in grow.cpp")
expect(good docs/a.md "See [search](../query/collide/search.cpp) and ../../elsewhere/data.")
expect(bad docs/a.md "See [search](../query/search.cpp).")
foreach(file README.md docs/a.md)
  expect(good ${file} "See [search](query/collide/search.cpp), tests/<unit>_test.cpp, query/*.hpp and assets.json.")
  expect(bad ${file} "See [search](query/search.cpp).")
  expect(bad ${file} "    query/     start at lost.hpp")
endforeach()
set(hash "#") # apart, or the check would take these lines for comments
foreach(file CMakeLists.txt cmake/a.cmake run bench/a.py)
  expect(good ${file} "add(lost.cpp) ${hash} with search.cpp")
  expect(bad ${file} "add(search.cpp) ${hash} with lost.cpp")
endforeach()
expect(good CHANGELOG.md "- lost.cpp is gone")

# A check that finds nothing to look at says so.
file(REMOVE_RECURSE "${WORK}")
file(WRITE "${WORK}/README.md" "No names.\n")
execute_process(COMMAND ${CMAKE_COMMAND} -D ROOT=${WORK} -P ${CMAKE_CURRENT_LIST_DIR}/pointers.cmake
  RESULT_VARIABLE result OUTPUT_QUIET ERROR_QUIET)
if(result EQUAL 0)
  message(SEND_ERROR "a tree without names passed")
endif()
file(REMOVE_RECURSE "${WORK}")

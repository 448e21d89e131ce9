# cmake -D ROOT=<source tree> -D WORK=<scratch folder> -P include_graph_selftest.cmake
#
# Plants in a copy of query/ what include_graph.cmake is to find, and demands that it does: a cycle of two units, one
# that leads through an -inl.hpp, one of two folders, one level too many, and no units at all. What is allowed must pass.
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${WORK}")
file(COPY "${ROOT}/query" DESTINATION "${WORK}")

# check(EXPECT WHAT): the copy must pass (EXPECT empty), or fail with a message that matches.
function(check expect what)
  execute_process(COMMAND ${CMAKE_COMMAND} -D ROOT=${WORK} -P ${CMAKE_CURRENT_LIST_DIR}/include_graph.cmake
    RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  string(REGEX REPLACE "[ \n]+" " " output "${output}")
  if(expect STREQUAL "" AND NOT result EQUAL 0)
    message(SEND_ERROR "${what} does not pass:\n${output}")
  elseif(NOT expect STREQUAL "" AND (result EQUAL 0 OR NOT output MATCHES "${expect}"))
    message(SEND_ERROR "${what} is not found:\n${output}")
  endif()
endfunction()

check("" "the tree itself")

file(WRITE "${WORK}/query/planted/one.hpp" "#include \"query/planted/two.hpp\"\n")
file(WRITE "${WORK}/query/planted/two.cpp" "#include \"query/planted/two.hpp\"\n") # its own header is no edge
check("" "an include of a lower level")
file(WRITE "${WORK}/query/planted/two-inl.hpp" "  #  include \"query/planted/one.hpp\"\n")
check("include each other.* planted/one planted/two" "a cycle through an -inl.hpp")
file(WRITE "${WORK}/query/planted/two-inl.hpp" "")
file(WRITE "${WORK}/query/planted/two.hpp" "#include \"query/planted/one.hpp\"\n")
check("include each other.* planted/one planted/two" "a cycle of two headers")
file(REMOVE_RECURSE "${WORK}/query/planted")

file(WRITE "${WORK}/query/planted/one.hpp" "#include \"query/other/two.hpp\"\n")
file(WRITE "${WORK}/query/planted/two.hpp" "")
file(WRITE "${WORK}/query/other/one.hpp" "#include \"query/planted/two.hpp\"\n")
file(WRITE "${WORK}/query/other/two.hpp" "")
check("folders that include each other.* (planted other|other planted)" "a cycle of two folders")
file(REMOVE_RECURSE "${WORK}/query/planted" "${WORK}/query/other")

foreach(i RANGE 1 40)
  math(EXPR next "${i} + 1")
  file(WRITE "${WORK}/query/planted/u${i}.hpp" "#include \"query/planted/u${next}.hpp\"\n")
endforeach()
file(WRITE "${WORK}/query/planted/u41.hpp" "")
check("more than [0-9]+ levels" "a chain of 41 levels")

file(REMOVE_RECURSE "${WORK}/query")
check("no units found" "an empty tree")
file(REMOVE_RECURSE "${WORK}")

# cmake -D EXAMPLES=<examples> -D WORK=<scratch folder> -P readme_selftest.cmake
#
# readme.cmake must accept a README with both programs, and refuse one that lacks a program, a letter or the fence.
cmake_minimum_required(VERSION 3.25)

file(READ ${EXAMPLES}/bake.cpp bake)
file(READ ${EXAMPLES}/query.cpp query)
set(whole "# Title\n\n```cpp\n${bake}```\n\ntext\n\n```cpp\n${query}```\n")

function(expect verdict text)
  file(WRITE ${WORK}/README.md "${text}")
  execute_process(COMMAND ${CMAKE_COMMAND} -D README=${WORK}/README.md -D EXAMPLES=${EXAMPLES}
    -P ${CMAKE_CURRENT_LIST_DIR}/readme.cmake RESULT_VARIABLE result ERROR_QUIET)
  if(verdict STREQUAL "good" AND NOT result EQUAL 0 OR verdict STREQUAL "bad" AND result EQUAL 0)
    message(SEND_ERROR "expected ${verdict}, got status ${result} for:\n${text}")
  endif()
endfunction()

expect(good "${whole}")
expect(bad "# Title\n\n```cpp\n${bake}```\n")
expect(bad "# Title\n\n```cpp\n${query}```\n")
string(REPLACE "overlapping" "overlaping" misspelt "${whole}")
expect(bad "${misspelt}")
string(REPLACE "```cpp" "" unfenced "${whole}")
expect(bad "${unfenced}")
file(REMOVE_RECURSE ${WORK})

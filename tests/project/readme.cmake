# cmake -D README=<README.md> -D EXAMPLES=<examples> -P readme.cmake
#
# The README's two programs are examples/bake.cpp and examples/query.cpp, letter by letter, in C++ code fences. Those
# files are compiled and run by tests/project/consumer.cmake, so what the README shows works.
cmake_minimum_required(VERSION 3.25)

file(READ ${README} readme)
foreach(name bake query)
  file(READ ${EXAMPLES}/${name}.cpp program)
  string(FIND "${readme}" "\n```cpp\n${program}```\n" at)
  if(at EQUAL -1)
    message(SEND_ERROR "${README} does not hold examples/${name}.cpp, unchanged, as a ```cpp block of its own")
  endif()
endforeach()

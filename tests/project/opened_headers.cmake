# cmake -D BUILD=<ninja build folder> -P opened_headers.cmake
#
# Asks Ninja which files the compiler really opened, and fails if one belongs to Eigen, pugixml, oneTBB or the builder.
# The tests also run it on a build that has the builder, where it must fail.
cmake_minimum_required(VERSION 3.25)

find_program(ninja NAMES ninja ninja-build REQUIRED)
execute_process(COMMAND ${ninja} -C ${BUILD} -t deps OUTPUT_VARIABLE opened COMMAND_ERROR_IS_FATAL ANY)
if(NOT opened MATCHES "query/[a-z_/]+\\.cpp" OR NOT opened MATCHES "/glm/")
  message(FATAL_ERROR "${BUILD}: Ninja lists no files of the query library, so there is nothing to judge")
endif()
if(opened MATCHES "[^\n]*(/Eigen/|/pugixml|/tbb/|/builder/|prolate/(build|mesh|verify|eigen)\\.hpp)[^\n]*")
  string(STRIP "${CMAKE_MATCH_0}" file)
  message(FATAL_ERROR "the compiler opened ${file}")
endif()
message(STATUS "the compiler opened no header of the builder's libraries")

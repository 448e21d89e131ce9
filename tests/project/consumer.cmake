# cmake -D HOW=installed|subdirectory|query_only -D ROOT=... -D BUILD=... -D WORK=... -D CXX=... -P consumer.cmake
#
# Uses prolate as its users do: builds tests/project/consumer, bakes a cube and queries it.
#   installed     installs BUILD, a finished build, and finds the package
#   subdirectory  adds ROOT with add_subdirectory()
#   query_only    builds and installs ROOT where Eigen, pugixml and oneTBB cannot be found, proves that the compiler
#                 opened none of their headers, and finds the package there; needs the trees that `installed` baked
# What is installed is compared with include/prolate: a header that was added cannot be forgotten. Each is compiled
# alone, and each that README's table names is used.
cmake_minimum_required(VERSION 3.25)

# run(STATUS OUTPUT COMMAND...): runs it, demands the exit status and, as a regular expression, the output.
function(run status expected)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  string(REPLACE ";" " " command "${ARGN}")
  if(NOT result EQUAL status OR NOT output MATCHES "${expected}")
    message(NOTICE "${output}")
    message(FATAL_ERROR "${command}\nexit status ${result}; expected ${status}, and output like \"${expected}\"")
  endif()
  message(STATUS "as expected: ${command}")
endfunction()

# What is tested is the package: one instruction set, hardly optimised, takes a third of the time; not optimised, the
# bakes take longer than that saves.
function(configure_and_build source build)
  run(0 "" ${CMAKE_COMMAND} -S ${source} -B ${build} -G Ninja -D CMAKE_CXX_COMPILER=${CXX} -D CMAKE_BUILD_TYPE=Release
    "-D CMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG -DHWY_COMPILE_ONLY_STATIC" ${ARGN})
  run(0 "" ${CMAKE_COMMAND} --build ${build})
endfunction()

# expect_headers(FOLDER HEADERS...): the folder holds all public headers but for those named.
function(expect_headers folder)
  file(GLOB_RECURSE expected RELATIVE ${ROOT}/include/prolate ${ROOT}/include/prolate/*)
  if(ARGN)
    list(REMOVE_ITEM expected ${ARGN})
  endif()
  file(GLOB_RECURSE found RELATIVE ${folder} ${folder}/*)
  if(NOT found STREQUAL expected)
    message(FATAL_ERROR "installed: ${found}\nexpected: ${expected}")
  endif()
endfunction()

# README's table of headers: those that it names, in all columns.
file(STRINGS ${ROOT}/README.md table REGEX "^\\| `[a-z_]+\\.hpp` \\|")
string(REGEX MATCHALL "[a-z_]+\\.hpp" in_table "${table}")
list(SORT in_table)

# use_rows(TREE HEADERS...): the answers of all rows are right, and no header of the table is left out but those named.
function(use_rows tree)
  execute_process(COMMAND ${programs}/rows ${tree} OUTPUT_VARIABLE output COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[^\n]+" used "${output}")
  list(SORT used)
  set(expected ${in_table})
  if(ARGN)
    list(REMOVE_ITEM expected ${ARGN})
  endif()
  if(NOT expected OR NOT used STREQUAL expected)
    message(FATAL_ERROR "used: ${used}\nREADME's table: ${expected}")
  endif()
endfunction()

set(consumer ${CMAKE_CURRENT_LIST_DIR}/consumer)
set(programs ${WORK}/${HOW})
set(prefix ${WORK}/${HOW}-prefix)
set(baked ${WORK}/baked)
set(without_builder_libraries -D CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON -D CMAKE_DISABLE_FIND_PACKAGE_pugixml=ON
  -D CMAKE_DISABLE_FIND_PACKAGE_TBB=ON)
file(REMOVE_RECURSE ${prefix}) # files of an earlier install must not help

if(HOW STREQUAL "installed")
  run(0 "" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
  foreach(file LICENSE LICENSE-APACHE LICENSE-MIT)
    if(NOT EXISTS ${prefix}/share/doc/prolate/${file})
      message(FATAL_ERROR "${file} is not installed")
    endif()
  endforeach()
  expect_headers(${prefix}/include/prolate)
  configure_and_build(${consumer} ${programs} -D CMAKE_PREFIX_PATH=${prefix}
    -D INSTALLED_HEADERS=${prefix}/include/prolate)
elseif(HOW STREQUAL "subdirectory")
  configure_and_build(${consumer} ${programs} -D PROLATE_SOURCE=${ROOT})
elseif(HOW STREQUAL "query_only")
  configure_and_build(${ROOT} ${WORK}/query_only-library -D PROLATE_BUILD_BUILDER=OFF -D PROLATE_BUILD_TESTS=OFF
    ${without_builder_libraries})
  run(0 "opened no header of the builder's libraries" ${CMAKE_COMMAND} -D BUILD=${WORK}/query_only-library
    -P ${CMAKE_CURRENT_LIST_DIR}/opened_headers.cmake)
  run(0 "" ${CMAKE_COMMAND} --install ${WORK}/query_only-library --prefix ${prefix})
  expect_headers(${prefix}/include/prolate build.hpp mesh.hpp modes.hpp rig.hpp verify.hpp)
  configure_and_build(${consumer} ${programs} -D CMAKE_PREFIX_PATH=${prefix} -D USE_BUILDER=OFF
    -D INSTALLED_HEADERS=${prefix}/include/prolate ${without_builder_libraries})
  # A runtime-only package must say so when asked for the builder.
  run(1 "installed without its builder" ${CMAKE_COMMAND} -S ${consumer} -B ${programs}-refused -G Ninja -D CMAKE_CXX_COMPILER=${CXX}
    -D CMAKE_PREFIX_PATH=${prefix} -D USE_BUILDER=ON)
endif()

if(NOT HOW STREQUAL "query_only")
  file(MAKE_DIRECTORY ${baked})
  set(cube ${baked}/cube-${HOW}.etree)
  run(0 "^1 ellipsoids.*[0-9]+ ellipsoids" ${programs}/bake ${consumer}/cube.obj ${cube})
  run(1 "^bake: " ${programs}/bake ${WORK}/no-such-mesh.obj ${cube})
  run(2 "^usage: " ${programs}/bake)
else()
  set(cube ${baked}/cube-installed.etree)
endif()
run(0 "^overlapping after [1-9]" ${programs}/query ${cube} ${cube} 0.5)
run(0 "^separated after [1-9]" ${programs}/query ${cube} ${cube} 10)
run(1 "^query: " ${programs}/query ${cube} ${consumer}/cube.obj 0)
run(2 "^usage: " ${programs}/query ${cube} ${cube})
run(0 "pose +1 of 100.*separated.*overlapping.*100 poses" ${programs}/approach ${cube} ${cube})
if(HOW STREQUAL "query_only")
  use_rows(${cube} tbb.hpp) # oneTBB is not there
else()
  use_rows(${cube})
endif()

# Tests of the project's own rules: who includes and links whom, headers, README, and the package as users meet it.
# Each rule's check has a twin that breaks the rule and demands a failure.

function(script_test name script)
  cmake_parse_arguments(arg "" "" "PROPERTIES" ${ARGN})
  add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} ${arg_UNPARSED_ARGUMENTS} -P ${CMAKE_CURRENT_SOURCE_DIR}/project/${script})
  set_tests_properties(${name} PROPERTIES TIMEOUT 900 ${arg_PROPERTIES})
endfunction()
set(scratch ${CMAKE_CURRENT_BINARY_DIR}/scratch)

# Includes.
script_test(project.layering layering.cmake -D ROOT=${PROJECT_SOURCE_DIR})
script_test(project.layering_selftest layering_selftest.cmake -D ROOT=${PROJECT_SOURCE_DIR} -D WORK=${scratch}/layering)
script_test(project.include_graph include_graph.cmake -D ROOT=${PROJECT_SOURCE_DIR})
script_test(project.include_graph_selftest include_graph_selftest.cmake -D ROOT=${PROJECT_SOURCE_DIR}
  -D WORK=${scratch}/include_graph)

# Links.
include(project/links.cmake)
test_links(project.links_core prolate_core "Threads::Threads")
test_links(project.links_query prolate_query "prolate::core|hwy::hwy|Threads::Threads")
add_library(links_planted INTERFACE)
target_link_libraries(links_planted INTERFACE prolate::query $<BUILD_INTERFACE:Planted::Eigen>)
test_links(project.links_selftest links_planted "prolate::core|prolate::query|hwy::hwy|Threads::Threads"
  PASS_REGULAR_EXPRESSION "links_planted may not link: Planted::Eigen")

# Public headers. Three of them are gateways to a library; the others must do without.
include(project/headers.cmake)
file(GLOB_RECURSE public_headers RELATIVE ${PROJECT_SOURCE_DIR}/include/prolate CONFIGURE_DEPENDS
  ${PROJECT_SOURCE_DIR}/include/prolate/*)
if(NOT PROLATE_BUILD_BUILDER)
  list(REMOVE_ITEM public_headers eigen.hpp tbb.hpp) # Eigen and oneTBB need not be there
endif()
set(header_sources "")
foreach(header IN LISTS public_headers)
  header_source(source ${header} ${CMAKE_CURRENT_BINARY_DIR}/headers)
  list(APPEND header_sources ${source})
endforeach()
add_library(headers_alone OBJECT ${header_sources})
prolate_target(headers_alone)
set_target_properties(headers_alone PROPERTIES UNITY_BUILD OFF)
target_include_directories(headers_alone PRIVATE ${PROJECT_SOURCE_DIR}/include)
if(PROLATE_BUILD_BUILDER)
  find_package(Eigen3 3.4 REQUIRED NO_MODULE)
  set_source_files_properties(${CMAKE_CURRENT_BINARY_DIR}/headers/eigen.hpp.cpp PROPERTIES
    COMPILE_OPTIONS "-isystem;$<JOIN:$<TARGET_PROPERTY:Eigen3::Eigen,INTERFACE_INCLUDE_DIRECTORIES>,;-isystem;>")
  script_test(project.headers headers_check.cmake -D HEADERS=${PROJECT_SOURCE_DIR}/include/prolate
    "-D OBJECTS=$<TARGET_OBJECTS:headers_alone>")
endif()
script_test(project.headers_selftest headers_selftest.cmake -D CXX=${CMAKE_CXX_COMPILER} -D WORK=${scratch}/headers)

# Names local to a .cpp that hide those of headers.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  add_test(NAME project.hidden_names COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/project/hidden_names.py
    ${PROJECT_SOURCE_DIR})
  add_test(NAME project.hidden_names_selftest COMMAND ${Python3_EXECUTABLE} -B
    ${CMAKE_CURRENT_SOURCE_DIR}/project/hidden_names_selftest.py ${PROJECT_SOURCE_DIR})
endif()

# Names of files in comments and documents.
script_test(project.pointers pointers.cmake -D ROOT=${PROJECT_SOURCE_DIR})
script_test(project.pointers_selftest pointers_selftest.cmake -D WORK=${scratch}/pointers)

# Machines and options that are refused.
script_test(project.host host.cmake -D ROOT=${PROJECT_SOURCE_DIR} -D CXX=${CMAKE_CXX_COMPILER}
  -D COMPILER=${CMAKE_CXX_COMPILER_ID} -D PROCESSOR=${CMAKE_SYSTEM_PROCESSOR})

# README.
script_test(project.readme readme.cmake -D README=${PROJECT_SOURCE_DIR}/README.md
  -D EXAMPLES=${PROJECT_SOURCE_DIR}/examples)
script_test(project.readme_selftest readme_selftest.cmake -D EXAMPLES=${PROJECT_SOURCE_DIR}/examples
  -D WORK=${scratch}/readme)

# The package.
if(PROLATE_BUILD_BUILDER)
  foreach(how installed subdirectory query_only)
    script_test(package.${how} consumer.cmake -D HOW=${how} -D ROOT=${PROJECT_SOURCE_DIR} -D BUILD=${PROJECT_BINARY_DIR}
      -D WORK=${scratch}/package -D CXX=${CMAKE_CXX_COMPILER} PROPERTIES LABELS package)
  endforeach()
  set_tests_properties(package.installed PROPERTIES FIXTURES_SETUP baked_trees)
  set_tests_properties(package.query_only PROPERTIES FIXTURES_REQUIRED baked_trees)
  if(CMAKE_GENERATOR STREQUAL "Ninja")
    script_test(package.opened_headers_selftest opened_headers.cmake -D BUILD=${PROJECT_BINARY_DIR} PROPERTIES
      LABELS package PASS_REGULAR_EXPRESSION "the compiler opened.*(Eigen|pugixml|tbb|builder|prolate)/")
  endif()
endif()

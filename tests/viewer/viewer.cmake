# What `prolate view` writes, in a browser, and the runtime as its pages have it. Skipped, with the reason, where there
# is no browser. Not in sanitized builds: a page's script is the same, and cli_test has the command.
find_package(Python3 COMPONENTS Interpreter)
if(NOT Python3_FOUND OR PROLATE_SANITIZE)
  return()
endif()
set(viewer_scratch ${CMAKE_CURRENT_BINARY_DIR}/viewer)

function(viewer_test name) # "slow": with one compiler only
  add_test(NAME viewer.${name} COMMAND ${ARGN})
  set_tests_properties(viewer.${name} PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 900 LABELS "viewer;slow")
endfunction()

viewer_test(page ${Python3_EXECUTABLE} ${CMAKE_CURRENT_LIST_DIR}/view_test.py
  $<TARGET_FILE:prolate_cli> ${viewer_scratch}/page)

if(TARGET prolate_query_module)
  viewer_test(queries ${Python3_EXECUTABLE} ${CMAKE_CURRENT_LIST_DIR}/queries_test.py
    $<TARGET_FILE:prolate_cli> ${viewer_scratch}/queries)

  add_executable(query_bits ${CMAKE_CURRENT_LIST_DIR}/query_bits.cpp ${PROJECT_SOURCE_DIR}/viewer/query_module.cpp)
  prolate_target(query_bits)
  target_include_directories(query_bits PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(query_bits PRIVATE prolate::query)
  find_program(PROLATE_NODE NAMES node nodejs) # emscripten depends on it
  if(PROLATE_NODE)
    viewer_test(bits ${CMAKE_COMMAND} -D PROLATE=$<TARGET_FILE:prolate_cli>
      -D NATIVE=$<TARGET_FILE:query_bits> -D NODE=${PROLATE_NODE} -D MODULE=${prolate_query_module}
      -D WORK=${viewer_scratch}/bits -P ${CMAKE_CURRENT_LIST_DIR}/query_bits.cmake)
  endif()
endif()

# cmake -D ROOT=<source tree> -D WORK=<scratch folder> -P layering_selftest.cmake
#
# Breaks each rule of layering.cmake once, in a copy of the tree, and demands that the check fails and names the place.
# Also plants includes that are allowed, which must pass: a check that refuses everything would be no check.
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${WORK}")
foreach(folder include src query builder cli)
  file(COPY "${ROOT}/${folder}" DESTINATION "${WORK}")
endforeach()

function(check result_out message_out)
  execute_process(COMMAND ${CMAKE_COMMAND} -D ROOT=${WORK} -P ${CMAKE_CURRENT_LIST_DIR}/layering.cmake
    RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  set(${result_out} "${result}" PARENT_SCOPE)
  set(${message_out} "${output}" PARENT_SCOPE)
endfunction()

# plant(EXPECT FILE TEXT): TEXT becomes line 2 of FILE, which then must be found (EXPECT bad) or not (EXPECT good).
function(plant expect file text)
  set(path "${WORK}/${file}")
  set(original "")
  if(EXISTS "${path}")
    file(READ "${path}" original)
  endif()
  file(WRITE "${path}" "// first line\n${text}\n${original}")
  check(result message)
  string(FIND "\n${message}" "\n${file}:2: " at)
  if(expect STREQUAL "bad" AND (result EQUAL 0 OR at EQUAL -1))
    message(SEND_ERROR "not found in ${file}: ${text}\n${message}")
  elseif(expect STREQUAL "good" AND NOT result EQUAL 0)
    message(SEND_ERROR "wrongly refused in ${file}: ${text}\n${message}")
  endif()
  if(original STREQUAL "")
    file(REMOVE "${path}")
  else()
    file(WRITE "${path}" "${original}")
  endif()
endfunction()

check(result message)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the tree itself breaks a rule:\n${message}")
endif()

# query knows neither the builder nor its libraries, in either form of include.
plant(bad query/planted.cpp "#include <prolate/build.hpp>")
plant(bad query/planted.hpp "#include \"prolate/mesh.hpp\"")
plant(bad query/planted.cpp "#include \"builder/winding.hpp\"")
plant(bad query/planted.cpp "#include <builder/winding.hpp>")
plant(bad query/planted.cpp "#include \"../builder/winding.hpp\"")
plant(bad query/deeper/planted.cpp "#include <Eigen/Dense>")
plant(bad query/planted.cpp "#include <prolate/eigen.hpp>")
plant(bad query/planted.cpp "  #  include <assimp/scene.h>")
plant(bad query/planted.cpp "#include <tbb/parallel_for.h>")
plant(bad query/planted.cpp "#include \"cli/common.hpp\"")
plant(bad query/planted.cpp "#include \"src/../builder/winding.hpp\"")
plant(good query/planted.cpp "#include <glm/vec3.hpp>")
plant(good query/planted.cpp "#include <prolate/query.hpp>")
plant(good query/planted.cpp "#include \"src/symmetric3.hpp\"")
# builder knows neither query nor GLM; Assimp only in import.cpp.
plant(bad builder/planted.cpp "#include <prolate/query.hpp>")
plant(bad builder/planted.cpp "#include \"query/separation.hpp\"")
plant(bad builder/planted.cpp "#include <glm/vec3.hpp>")
plant(bad builder/planted.cpp "#include <prolate/glm.hpp>")
plant(bad builder/planted.cpp "#include <assimp/scene.h>")
plant(good builder/import.cpp "#include <assimp/scene.h>")
plant(good builder/planted.cpp "#include <Eigen/Dense>")
plant(good builder/planted.cpp "#include <prolate/verify.hpp>")
# src knows neither side.
plant(bad src/planted.cpp "#include <prolate/query.hpp>")
plant(bad src/planted.cpp "#include <prolate/build.hpp>")
plant(bad src/planted.cpp "#include \"query/separation.hpp\"")
plant(bad src/planted.cpp "#include <glm/vec3.hpp>")
plant(good src/planted.cpp "#include <prolate/tree.hpp>")
# Public headers include public headers and the standard library.
plant(bad include/prolate/planted.hpp "#include \"src/format.hpp\"")
plant(bad include/prolate/planted.hpp "#include <glm/vec3.hpp>")
plant(bad include/prolate/types.hpp "#include <Eigen/Core>")
plant(good include/prolate/planted.hpp "#include <prolate/types.hpp>")
# Includes that a reader of text cannot judge.
plant(bad src/planted.cpp "#include HEADER")
plant(bad src/planted.cpp "%:include <glm/vec3.hpp>")
plant(bad src/planted.cpp "/* hidden */ #include <glm/vec3.hpp>")
plant(bad src/planted.cpp "#include/**/<glm/vec3.hpp>")
plant(bad src/planted.cpp "#include \\")

# A layer that has vanished must not pass in silence.
file(REMOVE_RECURSE "${WORK}/query")
check(result message)
if(result EQUAL 0)
  message(SEND_ERROR "an empty layer passed")
endif()
file(REMOVE_RECURSE "${WORK}")

# cmake -D WORK=<scratch folder> -P layering_selftest.cmake
#
# Breaks each rule of layering.cmake once, in a tree of one file a layer, and demands that the check fails and names the
# place.
# Also plants includes that are allowed, which must pass: a check that refuses everything would be no check.
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${WORK}")
foreach(layer include/prolate src query builder capi viewer cli python)
  file(WRITE "${WORK}/${layer}/first.hpp" "#pragma once\n#include <cstdint>\n")
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
  file(WRITE "${path}" "// first line\n${text}\n")
  check(result message)
  string(FIND "\n${message}" "\n${file}:2: " at)
  if(expect STREQUAL "bad" AND (result EQUAL 0 OR at EQUAL -1))
    message(SEND_ERROR "not found in ${file}: ${text}\n${message}")
  elseif(expect STREQUAL "good" AND NOT result EQUAL 0)
    message(SEND_ERROR "wrongly refused in ${file}: ${text}\n${message}")
  endif()
  file(REMOVE "${path}")
endfunction()

check(result message)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "wrongly refused, as it stands:\n${message}")
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
plant(bad viewer/planted.cpp "#include \"query/node/lanes.hpp\"")
plant(good viewer/planted.cpp "#include <prolate/distance.hpp>")
plant(bad capi/planted.cpp "#include \"query/node/lanes.hpp\"")
plant(good capi/planted.cpp "#include <prolate/prolate.h>")
plant(bad query/planted.cpp "#include \"src/../builder/winding.hpp\"")
plant(good query/planted.cpp "#include <glm/vec3.hpp>")
plant(good query/planted.cpp "#include <prolate/query.hpp>")
plant(good query/planted.cpp "#include \"src/symmetric3.hpp\"")
# Inside query/ folders know those below them, and queries not each other.
plant(bad query/node/planted.hpp "#include \"query/collide/search.hpp\"")
plant(bad query/ellipsoid/planted.cpp "#include \"query/node/lanes.hpp\"")
plant(bad query/triangle/planted.cpp "#include \"query/node/lanes.hpp\"")
plant(bad query/distance/planted.cpp "#include \"query/collide/search.hpp\"")
plant(bad query/collide/planted.cpp "#include \"query/contacts/manifold.hpp\"")
plant(bad query/unknown/planted.cpp "#include \"query/simd/targets.hpp\"")
plant(good query/contacts/planted.cpp "#include \"query/collide/search.hpp\"")
plant(good query/distance/planted.cpp "#include \"query/distance/search.hpp\"")
plant(good query/world/planted.cpp "#include \"query/inside/inside.hpp\"")
# builder knows neither query nor GLM; pugixml is for the reader of DAE only.
plant(bad builder/planted.cpp "#include <prolate/query.hpp>")
plant(bad builder/planted.cpp "#include \"query/ellipsoid/separation.hpp\"")
plant(bad builder/planted.cpp "#include <glm/vec3.hpp>")
plant(bad builder/planted.cpp "#include <prolate/glm.hpp>")
plant(bad builder/planted.cpp "#include <pugixml.hpp>")
plant(good builder/collada_document.hpp "#include <pugixml.hpp>")
plant(good builder/planted.cpp "#include <Eigen/Dense>")
plant(good builder/planted.cpp "#include <prolate/verify.hpp>")
# src knows neither side.
plant(bad src/planted.cpp "#include <prolate/query.hpp>")
plant(bad src/planted.cpp "#include <prolate/build.hpp>")
plant(bad src/planted.cpp "#include \"query/ellipsoid/separation.hpp\"")
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

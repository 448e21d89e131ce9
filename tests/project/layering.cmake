# cmake -D ROOT=<source tree> -P layering.cmake
#
# Who may include whom. Reads every #include below the folders of the table and fails, naming file and line, on one that
# its folder may not have. What is not allowed is forbidden: an unknown library is an offence too. It reads text and
# does not preprocess, so an include hidden behind a macro counts as an offence. layering_selftest.cmake plants
# offences to show that this check finds them.
#
#        builder ──► src ◄── query          include/prolate is open to all; cli may know both sides
cmake_minimum_required(VERSION 3.25)

# Regular expressions. *_headers: public headers <prolate/NAME.hpp>. *_folders: internal headers "FOLDER/...".
# *_libraries: other people's headers. The C++ standard library is always allowed.
set(layers include/prolate src query builder capi viewer cli python)
set(core_headers "types|error|mass|primitives|bake_info|deformation|skin|detail/tree_bytes|tree|matrix|version")
set(posix "fcntl\\.h|unistd\\.h|sys/[a-z]+\\.h")

set(include/prolate_headers ".*")
set(include/prolate_folders "none")
set(include/prolate_libraries "none")

set(src_headers "${core_headers}")
set(src_folders "src")
set(src_libraries "xxhash\\.h|${posix}")

set(query_headers "${core_headers}|query|collide|deform|distance|contacts|sweep|raycast|shapes|half_space|points|pairs|poses|bounds|jobs|solids|world|world_queries|tools|glm")
set(query_folders "src|query")
set(query_libraries "glm/.*|hwy/.*")
# Inside query/: each folder may include itself and these, so queries do not know each other.
set(query_geometry "simd ellipsoid triangle node inside")
set(query/simd_knows "")
set(query/ellipsoid_knows "simd")
set(query/triangle_knows "simd ellipsoid")
set(query/node_knows "simd ellipsoid")
set(query/inside_knows "simd ellipsoid triangle node")
foreach(folder collide distance sweep raycast shapes points)
  set(query/${folder}_knows "${query_geometry}")
endforeach()
set(query/half_space_knows "${query_geometry} collide contacts distance shapes sweep")
set(query/solids_knows "${query_geometry} collide")
set(query/deform_knows "${query_geometry} raycast")
set(query/contacts_knows "${query_geometry} collide")
set(query/world_knows "${query_geometry} collide contacts distance sweep raycast shapes")

set(builder_headers "${core_headers}|mesh|build|verify|modes|rig")
set(builder_folders "src|builder")
set(builder_libraries "Eigen/.*|tbb/.*|oneapi/tbb/.*|xxhash\\.h|${posix}")

set(capi_headers "${core_headers}|query|collide|deform|distance|contacts|sweep|raycast|shapes|half_space|points|pairs|bounds|poses|jobs|solids|world|world_queries")
set(capi_folders "capi")
set(capi_libraries "prolate/prolate\\.h")

set(viewer_headers "${core_headers}|query|collide|distance|solids")
set(viewer_folders "viewer")
set(viewer_libraries "none")

set(cli_headers ".*")
set(cli_folders "src|builder|query|cli")
set(cli_libraries
  "CLI/.*|fmt/.*|nlohmann/.*|png\\.h|embree3/.*|glm/.*|tbb/.*|oneapi/tbb/.*|freetype/.*|fontconfig/.*|${posix}")

set(python_headers ".*")
set(python_folders "python")
set(python_libraries "nanobind/.*|oneapi/tbb/.*")

# Single files that may have one library more: the gateways.
set(extra_include/prolate/prolate.h "std[a-z]+\\.h")
set(extra_include/prolate/eigen.hpp "Eigen/.*")
set(extra_include/prolate/glm.hpp "glm/.*")
set(extra_include/prolate/tbb.hpp "oneapi/tbb/.*")
set(extra_builder/collada_document.hpp "pugixml\\.hpp")
set(extra_builder/gltf_document.hpp "nlohmann/.*")
set(extra_builder/import_3mf.cpp "Model/COM/.*")
set(extra_cli/bake/modes_file.cpp "minizip/.*")
set(extra_cli/compare/hull.cpp "libqhull_r/.*")

# allowed(OUT file layer form target): may `file` of `layer` include <target> (form "<") or "target" (form ")?
function(allowed out file layer form target)
  set(${out} FALSE PARENT_SCOPE)
  if(target MATCHES "\\.\\." OR target MATCHES "^/")
    return() # paths that leave a folder are never needed, and could reach anything
  elseif(target MATCHES "^prolate/(.*)\\.hpp$")
    set(pattern "${${layer}_headers}")
    set(subject "${CMAKE_MATCH_1}")
  elseif(target MATCHES "^(src|query|builder|capi|viewer|cli|python|tests|bench|examples)/")
    set(pattern "${${layer}_folders}")
    set(subject "${CMAKE_MATCH_1}")
  elseif(form STREQUAL "<" AND target MATCHES "^[a-z_0-9]+$")
    set(pattern ".*") # the standard library
    set(subject "")
  elseif(form STREQUAL "<")
    set(pattern "${${layer}_libraries}|${extra_${file}}")
    set(subject "${target}")
  else()
    return() # a name without its folder
  endif()
  if(NOT "${subject}" MATCHES "^(${pattern})$")
    return()
  endif()
  if(layer STREQUAL "query" AND target MATCHES "^query/([^/]+)/")
    set(to "${CMAKE_MATCH_1}")
    string(REGEX MATCH "^query/[^/]+" from "${file}")
    string(REPLACE " " ";" known "${${from}_knows}")
    if(NOT from STREQUAL "query/${to}" AND NOT to IN_LIST known)
      return()
    endif()
  endif()
  set(${out} TRUE PARENT_SCOPE)
endfunction()

set(offences "")
set(include_count 0)
foreach(layer IN LISTS layers)
  file(GLOB_RECURSE files RELATIVE "${ROOT}" "${ROOT}/${layer}/*.[chi]*")
  list(FILTER files INCLUDE REGEX "\\.(c|cc|cpp|cxx|h|hh|hpp|hxx|inc|inl|ipp)$")
  if(NOT files)
    string(APPEND offences "${layer}: no sources found; is the layout still what this check believes?\n")
  endif()
  foreach(file IN LISTS files)
    # CMake lists give meaning to these characters; none of them can make an include legal.
    file(READ "${ROOT}/${file}" text)
    string(REGEX REPLACE "[][;\\]" "?" text "${text}")
    string(REPLACE "\n" ";" lines "${text}")
    set(number 0)
    foreach(line IN LISTS lines)
      math(EXPR number "${number} + 1")
      if(NOT line MATCHES "^[ \t]*(/\\*.*\\*/)?[ \t]*(#|%:|\\?\\?=)[ \t]*(include|import)")
        continue()
      endif()
      math(EXPR include_count "${include_count} + 1")
      set(is_allowed FALSE)
      if(line MATCHES "^[ \t]*#[ \t]*include[ \t]*([<\"])([^>\"]+)[>\"]")
        allowed(is_allowed "${file}" "${layer}" "${CMAKE_MATCH_1}" "${CMAKE_MATCH_2}")
      endif()
      if(NOT is_allowed)
        string(STRIP "${line}" line)
        string(APPEND offences "${file}:${number}: ${layer} may not have: ${line}\n")
      endif()
    endforeach()
  endforeach()
endforeach()

if(offences)
  message(NOTICE "${offences}")
  message(FATAL_ERROR "forbidden includes; the rules are in tests/project/layering.cmake")
endif()
message(STATUS "layering: ${include_count} includes, all allowed")

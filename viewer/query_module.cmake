# Builds ${query_module}: prolate::core and prolate::query with viewer/query_module.cpp, by emscripten. One command for
# each source, so that they compile side by side and again only when they have changed.
#
# Without SIMD: Highway 1.0 has no doubles in WebAssembly's, and our kernels need some. So this is Highway's scalar
# target, which runs in every browser. Contraction is off as everywhere, and WebAssembly's arithmetic is IEEE 754, so
# answers have the same bits as native ones: tests/viewer compares them.
set(wasm ${CMAKE_CURRENT_BINARY_DIR}/wasm)
set(query_module ${wasm}/query.wasm)

# Headers that do not depend on the machine, apart from those of the machine's own C library beside them.
find_path(PROLATE_HWY_INCLUDE hwy/highway.h REQUIRED)
find_path(PROLATE_GLM_INCLUDE glm/glm.hpp REQUIRED)
find_path(PROLATE_XXHASH_INCLUDE xxhash.h REQUIRED)
file(MAKE_DIRECTORY ${wasm}/include)
file(CREATE_LINK ${PROLATE_HWY_INCLUDE}/hwy ${wasm}/include/hwy SYMBOLIC)
file(CREATE_LINK ${PROLATE_GLM_INCLUDE}/glm ${wasm}/include/glm SYMBOLIC)
file(GLOB xxhash ${PROLATE_XXHASH_INCLUDE}/xxh*.h)
foreach(header IN LISTS xxhash)
  get_filename_component(name ${header} NAME)
  file(CREATE_LINK ${header} ${wasm}/include/${name} SYMBOLIC)
endforeach()

set(sources ${CMAKE_CURRENT_SOURCE_DIR}/query_module.cpp)
foreach(layer core query)
  get_target_property(names prolate_${layer} SOURCES)
  get_target_property(folder prolate_${layer} SOURCE_DIR)
  list(TRANSFORM names PREPEND ${folder}/)
  list(APPEND sources ${names})
endforeach()
# What no page calls: worlds, batches, points, rays, shapes, sweeps, writing.
set(not_called "query/(half_space|points|raycast|shapes|sweep|world)/[a-z_]+"
  "query/ellipsoid/(collide_pairs|distance_pairs|pairs)" "src/(file|format|mass|matrix|primitives)")
list(JOIN not_called "|" not_called)
list(FILTER sources EXCLUDE REGEX "/(${not_called})\\.cpp$")

set(flags -std=c++20 -O2 -DNDEBUG -ffp-contract=off -fno-exceptions -fno-rtti -DHWY_COMPILE_ONLY_STATIC
  -include ${CMAKE_CURRENT_SOURCE_DIR}/missing_std.hpp
  -I${PROJECT_SOURCE_DIR} -I${PROJECT_SOURCE_DIR}/include -isystem ${wasm}/include)
set(objects "")
foreach(source IN LISTS sources)
  file(RELATIVE_PATH name ${PROJECT_SOURCE_DIR} ${source})
  string(REPLACE "/" "_" name ${name})
  set(object ${wasm}/${name}.o)
  add_custom_command(OUTPUT ${object}
    COMMAND ${PROLATE_EMXX} ${flags} -MD -MF ${object}.d -MT ${object} -c ${source} -o ${object}
    DEPENDS ${source} DEPFILE ${object}.d
    COMMENT "Compiling ${name} to WebAssembly" VERBATIM)
  list(APPEND objects ${object})
endforeach()
add_custom_command(OUTPUT ${query_module}
  COMMAND ${PROLATE_EMXX} -O2 -fno-exceptions ${objects} -o ${query_module}
    --no-entry -sSTANDALONE_WASM -sALLOW_MEMORY_GROWTH
    -sEXPORTED_FUNCTIONS=_viewer_allocate,_viewer_open,_viewer_pose,_viewer_query,_viewer_pairs,_viewer_collide
  DEPENDS ${objects}
  COMMENT "Linking query.wasm" VERBATIM)
add_custom_target(prolate_query_module DEPENDS ${query_module})
set(prolate_query_module ${query_module} CACHE INTERNAL "the runtime as WebAssembly")

# prolate_target(TARGET): what every target of this project is built with.
#
# Floating point is pinned, because baked bytes and query results must not depend on the compiler: no contraction into
# fused multiply-adds, and never -march=native (README, "Determinism").
# No SLP vectorisation with GCC: version 12 at -O2 drops the rounding of a double to float when the float is used as a
# double again in the same function ({(float)(a * b), ...} keeps the double products), which breaks proofs about floats.
function(prolate_target target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE
    -ffp-contract=off $<$<CXX_COMPILER_ID:GNU>:-fno-tree-slp-vectorize> -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
  # 32-bit x86: by SSE2, since the x87 rounds to other widths than types say. src/host.hpp refuses to compile for that.
  if(CMAKE_SIZEOF_VOID_P EQUAL 4 AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(i.86|x86|amd64)")
    target_compile_options(${target} PRIVATE -msse2 -mfpmath=sse)
  endif()
  if(PROLATE_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(PROLATE_SANITIZE)
    # PUBLIC link: whoever links an instrumented library needs the runtime.
    string(REPLACE address address,undefined sanitizers ${PROLATE_SANITIZE})
    target_compile_options(${target} PRIVATE -fsanitize=${sanitizers} -fno-sanitize-recover=all
      -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${sanitizers})
  endif()
  if(PROLATE_BUILD_FUZZ)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link) # coverage, which guides the fuzzer
  endif()
endfunction()

# prolate_library(NAME SOURCES...): the static library prolate_NAME, alias and export name prolate::NAME.
function(prolate_library name)
  add_library(prolate_${name} STATIC ${ARGN})
  add_library(prolate::${name} ALIAS prolate_${name})
  set_target_properties(prolate_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(prolate_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  # Sources name internal headers by folder: "src/symmetric3.hpp". tests/project/layering.cmake checks who may name whom.
  target_include_directories(prolate_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  prolate_target(prolate_${name})
endfunction()

# prolate_fuzzer(NAME SOURCES... LIBS targets...): a libFuzzer program; clang only.
function(prolate_fuzzer name)
  cmake_parse_arguments(arg "" "" "LIBS" ${ARGN})
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  prolate_target(${name})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${arg_LIBS})
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
endfunction()

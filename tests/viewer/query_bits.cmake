# cmake -D PROLATE=... -D NATIVE=... -D NODE=... -D MODULE=<query.wasm> -D WORK=<folder> -P query_bits.cmake
#
# The runtime gives the same bits natively and as WebAssembly: for ellipsoid trees, exact trees, and one of each. And
# the comparison finds a difference: answers in which a bit is changed are refused.
cmake_minimum_required(VERSION 3.25)
file(MAKE_DIRECTORY ${WORK})

function(must_run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# A tetrahedron and a bent strip: closed, and small enough to bake in a moment.
file(WRITE ${WORK}/a.obj "v 0 0 0\nv 1 0 0\nv 0 1.2 0\nv 0.1 0.1 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
file(WRITE ${WORK}/b.obj "v 0 0 0\nv 2 0 0.4\nv 2 0.3 0.4\nv 0 0.3 0\nv 0 0 0.3\nv 2 0 0.7\nv 2 0.3 0.7\nv 0 0.3 0.3
v 1 0.1 -0.5\nf 1 4 9\nf 4 3 9\nf 3 2 9\nf 2 1 9\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 4 8 7\nf 4 7 3\nf 1 5 8\nf 1 8 4
f 2 3 7\nf 2 7 6\n")
foreach(name a b)
  must_run(${PROLATE} bake ${WORK}/${name}.obj -o ${WORK}/${name}.etree --rebake
    --quality fast --levels 2 OUTPUT_QUIET ERROR_QUIET)
  must_run(${PROLATE} bake ${WORK}/${name}.obj -o ${WORK}/${name}_exact.etree --rebake
    --exact --leaf-triangles 1 OUTPUT_QUIET ERROR_QUIET)
endforeach()
foreach(pair "a;b" "a_exact;b_exact" "a_exact;b")
  list(TRANSFORM pair PREPEND ${WORK}/ OUTPUT_VARIABLE trees)
  list(TRANSFORM trees APPEND .etree)
  must_run(${NATIVE} ${trees} ${WORK}/answers)
  must_run(${NODE} ${CMAKE_CURRENT_LIST_DIR}/query_bits.mjs ${MODULE} ${trees} ${WORK}/answers)
endforeach()

must_run(${NODE} -e "const fs = require('fs'), answers = fs.readFileSync('${WORK}/answers')
answers[100] ^= 1
fs.writeFileSync('${WORK}/spoilt', answers)")
execute_process(COMMAND ${NODE} ${CMAKE_CURRENT_LIST_DIR}/query_bits.mjs ${MODULE} ${trees} ${WORK}/spoilt
  RESULT_VARIABLE result ERROR_QUIET)
if(result EQUAL 0)
  message(FATAL_ERROR "a changed bit was not found")
endif()

# cmake -D ROOT=<source tree> -D CXX=<compiler> -D COMPILER=<GNU or Clang> -D PROCESSOR=<CMAKE_SYSTEM_PROCESSOR> -P host.cmake
#
# src/host.hpp compiles with the project's own options, and refuses, by name, arithmetic that proofs do not hold for.
cmake_minimum_required(VERSION 3.25)

# compiles(EXPECTED OPTION...): "yes", or what its error has to say.
function(compiles expected)
  execute_process(COMMAND ${CXX} -std=c++20 -I${ROOT} ${ARGN} -fsyntax-only -include src/host.hpp -x c++ /dev/null
    RESULT_VARIABLE failed ERROR_VARIABLE errors OUTPUT_VARIABLE ignored)
  if(expected STREQUAL "yes")
    if(failed)
      message(SEND_ERROR "src/host.hpp does not compile with \"${ARGN}\": ${errors}")
    endif()
  elseif(NOT failed OR NOT errors MATCHES "${expected}")
    message(SEND_ERROR "src/host.hpp with \"${ARGN}\" should fail and say \"${expected}\", but said: ${errors}")
  endif()
endfunction()

compiles(yes -O2 -ffp-contract=off)
compiles("prolate cannot be compiled with -ffast-math" -O2 -ffast-math)
if(COMPILER STREQUAL "GNU" AND PROCESSOR MATCHES "^(x86_64|i.86)$")
  compiles("compile with -msse2 -mfpmath=sse" -mfpmath=387)
endif()

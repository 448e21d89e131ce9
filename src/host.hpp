// What prolate asks of a compiler and a machine: proofs and known answers rest on it, so anything else is refused here
// instead of giving other answers. Either byte order will do (src/bytes.hpp).
#pragma once

#include <cfloat>
#include <limits>

static_assert(std::numeric_limits<float>::is_iec559 && std::numeric_limits<double>::is_iec559,
              "prolate needs the float and double of IEEE 754");

// Every operation is to be rounded to its own type.
#if FLT_EVAL_METHOD != 0
#error                                                                                                                 \
    "prolate needs FLT_EVAL_METHOD 0: compile with -msse2 -mfpmath=sse on 32-bit x86, elsewhere with -fexcess-precision=fast"
#endif
#ifdef __FAST_MATH__
#error "prolate cannot be compiled with -ffast-math: it drops the rounding that proofs rest on"
#endif

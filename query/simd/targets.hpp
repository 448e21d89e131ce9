// Instruction sets that the kernels are compiled for. Include this first, before any header of Google Highway, in
// every file that has or tests kernels; the best of the sets that the machine has is chosen at run time.
//
// x86: SSE4, AVX2 and AVX-512 (HWY_AVX3). SSSE3 and the Ice Lake set would double what is compiled and win nothing
// here; Highway 1.0 has no target for SSE2 alone, so machines before SSE4.2 (2008) run its scalar one. Vectors whose
// length is not known when compiling (SVE, RVV) cannot lie in arrays as our 8 lanes do; ARM then has NEON.
//
// In kernels, structs of vectors begin with braces, `LaneNodes out{}`: GCC compiles the constructor that it makes up
// for `LaneNodes out` without the kernel's instruction set, and then may not inline what Highway's NEON vectors do in
// it. Large structs have a HWY_INLINE constructor instead: GCC may really store the zeros that braces give them.
#pragma once

// Expanded by Highway's own headers, which define the names.
#define HWY_DISABLED_TARGETS                                                                                           \
    (HWY_SSSE3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV | HWY_WASM_EMU256)
// GCC before 12.3 miscompiles Highway's other fallback; take the scalar one with every compiler.
#define HWY_BROKEN_EMU128 1

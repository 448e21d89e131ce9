// Eight numbers at a time, in the vector types of GCC and Clang: configurations of a robot, or cells of a body.
//
// Functions marked PROLATE_ROBOT_CLONES are compiled twice for x86, and the loader takes the version for AVX2 where the
// machine has it. Nothing is contracted or reordered, so both give the same bits.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

// Sanitizers run before their own initialisation what the loader asks to choose a version.
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) &&    \
    defined(__GNUC__) && !defined(__clang__)
#define PROLATE_ROBOT_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define PROLATE_ROBOT_CLONES
#endif
#define PROLATE_ROBOT_INLINE [[gnu::always_inline]] inline

namespace prolate::python {

inline constexpr size_t kLanes = 8;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
using Floats [[gnu::vector_size(32)]] = float;
using Ints [[gnu::vector_size(32)]] = int32_t;
using Doubles [[gnu::vector_size(64)]] = double;

// The alignment of a vector type depends on the instruction set that a function is compiled for. So whatever lies in
// memory is a struct of a stated one.
template <class Lanes> struct alignas(sizeof(Lanes)) Lanes3 { Lanes x, y, z; };
struct alignas(32) OneFloats {
    Floats lanes;
};
using Floats3 = Lanes3<Floats>;
using Doubles3 = Lanes3<Doubles>;

template <class L> PROLATE_ROBOT_INLINE Lanes3<L> operator+(const Lanes3<L>& a, const Lanes3<L>& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class L> PROLATE_ROBOT_INLINE Lanes3<L> operator-(const Lanes3<L>& a, const Lanes3<L>& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class L, class S> PROLATE_ROBOT_INLINE Lanes3<L> operator*(const Lanes3<L>& a, const S& s) {
    return {a.x * s, a.y * s, a.z * s};
}
template <class L> PROLATE_ROBOT_INLINE Lanes3<L> cross(const Lanes3<L>& a, const Lanes3<L>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class L> PROLATE_ROBOT_INLINE L dot(const Lanes3<L>& a, const Lanes3<L>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

PROLATE_ROBOT_INLINE Floats absolute(const Floats& x) {
    return x < 0 ? -x : x;
}
PROLATE_ROBOT_INLINE Floats greater(const Floats& a, const Floats& b) {
    return a > b ? a : b;
}
PROLATE_ROBOT_INLINE Floats at_least_0(const Floats& x) {
    return x > 0 ? x : Floats{};
}
PROLATE_ROBOT_INLINE Floats narrowed(const Doubles& x) {
    return __builtin_convertvector(x, Floats);
}
PROLATE_ROBOT_INLINE Floats3 narrowed(const Doubles3& v) {
    return {narrowed(v.x), narrowed(v.y), narrowed(v.z)};
}
template <class L> PROLATE_ROBOT_INLINE L square_root(L x) {
    for (size_t i = 0; i < kLanes; ++i) x[i] = std::sqrt(x[i]);
    return x;
}

/// Bit i: lane i is true.
PROLATE_ROBOT_INLINE uint32_t bits(const Ints& mask) {
    constexpr Ints kBit = {1, 2, 4, 8, 16, 32, 64, 128};
    const Ints lanes = mask & kBit;
    uint64_t word[4];
    std::memcpy(word, &lanes, sizeof word);
    const uint64_t all = word[0] | word[1] | word[2] | word[3];
    return static_cast<uint32_t>(all | all >> 32);
}

} // namespace prolate::python

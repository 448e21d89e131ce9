// The vocabulary of kernels gives, on every instruction set, the bits of the same formula in plain C++.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/query/simd/vector_test.cpp"
#include "query/simd/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/simd/vector-inl.hpp"

#include "src/bytes.hpp"
#include "tests/scenes.hpp"
#include "tests/targets.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#ifndef PROLATE_TESTS_VECTOR_ONCE
#define PROLATE_TESTS_VECTOR_ONCE
namespace prolate::query {

// Eight lanes of twelve inputs, and what comes of them.
using Lane8 = float[8];
struct VectorInputs {
    alignas(64) Lane8 number[12];
};
constexpr size_t kResults = 40;
struct VectorResults {
    alignas(64) Lane8 number[kResults];
    uint32_t less, both, either, one, none;
};

} // namespace prolate::query
#endif

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

void compute(const VectorInputs& in, VectorResults& out) {
    out.less = out.both = out.either = out.one = out.none = 0;
    for (size_t i = 0; i < 8; i += kFloatLanes) {
        const auto at = [&](size_t k) { return load(in.number[k] + i); };
        const Float3 u{at(0), at(1), at(2)}, v{at(3), at(4), at(5)};
        const Lower3 l{at(6), at(7), at(8), at(9), at(10), at(11)};
        const Sym3 q = shape_of(l), adj = adjugate(q), mix = plus_diagonal(at(0) * q + at(1) * adj, at(2));
        const Mask less = at(0)<at(3), greater_too = at(1)> 0.25f;
        size_t n = 0;
        const auto put = [&](Float x) { store(x, out.number[n++] + i); };
        const auto put3 = [&](const Float3& x) { put(x.x), put(x.y), put(x.z); };
        put(dot(u, v)), put(length(u)), put(one_norm(u)), put(max_norm(u));
        put3(cross(u, v)), put3(u + v * at(6)), put3(-(u - v)), put3(choose(less, u, v));
        put3(l * u), put3(transposed_times(l, u)), put3(mix * v);
        put(adj.xx), put(adj.xy), put(adj.yy), put(adj.xz), put(adj.yz), put(adj.zz);
        put(determinant(q, adj)), put(trace(q));
        put(lesser(at(0), at(3))), put(greater(at(0), at(3))), put(choose_or_zero(less, at(1)));
        put(2 - at(0) / at(3)), put(3 * at(1) + 1), put(1 / at(2)), put(sqrt(abs(at(4))));
        out.less |= bits(less) << i, out.both |= bits(less & greater_too) << i;
        out.either |= bits(less | greater_too) << i, out.one |= bits(less ^ greater_too) << i;
        out.none |= bits(!less) << i;
    }
}

// All four kinds of integers, at an address of any alignment.
void convert(const std::byte* from, float (&out)[4][8]) {
    for (size_t i = 0; i < 8; i += kFloatLanes) {
        store_unaligned(load_integers<uint8_t>(from + i), out[0] + i);
        store_unaligned(load_integers<int8_t>(from + i), out[1] + i);
        store_unaligned(load_integers<uint16_t>(from + 2 * i), out[2] + i);
        store_unaligned(load_integers<int16_t>(from + 2 * i), out[3] + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(compute);
HWY_EXPORT(convert);

namespace {

using scenes::Random;

// compute() for one lane.
std::vector<float> expected(const std::array<float, 12>& x) {
    const float *const u = x.data(), *const v = u + 3;
    const float l11 = x[6], l21 = x[7], l22 = x[8], l31 = x[9], l32 = x[10], l33 = x[11];
    const float xx = l11 * l11, xy = l21 * l11, yy = l21 * l21 + l22 * l22, xz = l31 * l11;
    const float yz = l31 * l21 + l32 * l22, zz = l31 * l31 + l32 * l32 + l33 * l33;
    const float axx = yy * zz - yz * yz, axy = xz * yz - xy * zz, ayy = xx * zz - xz * xz;
    const float axz = xy * yz - xz * yy, ayz = xy * xz - xx * yz, azz = xx * yy - xy * xy;
    const auto mix = [&](float q, float adj) { return u[0] * q + u[1] * adj; };
    const float mxx = mix(xx, axx) + u[2], myy = mix(yy, ayy) + u[2], mzz = mix(zz, azz) + u[2];
    const float mxy = mix(xy, axy), mxz = mix(xz, axz), myz = mix(yz, ayz);
    const bool less = u[0] < v[0];
    std::vector<float> out{u[0] * v[0] + u[1] * v[1] + u[2] * v[2],
                           std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]),
                           std::abs(u[0]) + std::abs(u[1]) + std::abs(u[2]),
                           std::max({std::abs(u[0]), std::abs(u[1]), std::abs(u[2])}),
                           u[1] * v[2] - u[2] * v[1],
                           u[2] * v[0] - u[0] * v[2],
                           u[0] * v[1] - u[1] * v[0]};
    for (size_t k = 0; k < 3; ++k) out.push_back(u[k] + v[k] * l11);
    for (size_t k = 0; k < 3; ++k) out.push_back(-(u[k] - v[k]));
    for (size_t k = 0; k < 3; ++k) out.push_back(less ? u[k] : v[k]);
    for (const float y : {l11 * u[0],
                          l21 * u[0] + l22 * u[1],
                          l31 * u[0] + l32 * u[1] + l33 * u[2],
                          l11 * u[0] + l21 * u[1] + l31 * u[2],
                          l22 * u[1] + l32 * u[2],
                          l33 * u[2],
                          mxx * v[0] + mxy * v[1] + mxz * v[2],
                          mxy * v[0] + myy * v[1] + myz * v[2],
                          mxz * v[0] + myz * v[1] + mzz * v[2],
                          axx,
                          axy,
                          ayy,
                          axz,
                          ayz,
                          azz,
                          xx * axx + xy * axy + xz * axz,
                          xx + yy + zz,
                          v[0] < u[0] ? v[0] : u[0],
                          v[0] > u[0] ? v[0] : u[0],
                          less ? u[1] : 0,
                          2 - u[0] / v[0],
                          3 * u[1] + 1,
                          1 / u[2],
                          std::sqrt(std::abs(v[1]))})
        out.push_back(y);
    return out;
}

TEST(Vector, GivesTheBitsOfPlainCodeOnEveryTarget) {
    Random random(31);
    for (uint32_t n = 0; n < 500; ++n) {
        VectorInputs in;
        for (auto& row : in.number)
            for (float& x : row) x = static_cast<float>(random.in(-1, 1) * random.log_in(1e-3, 1e3));
        if (n % 8 == 0) in.number[n % 6][n / 8 % 8] = std::numeric_limits<float>::quiet_NaN();
        if (n % 4 == 0) in.number[3][n / 4 % 8] = in.number[0][n / 4 % 8];
        targets::for_each([&](const char* target) {
            VectorResults out;
            HWY_DYNAMIC_DISPATCH(compute)(in, out);
            for (size_t lane = 0; lane < 8; ++lane) {
                std::array<float, 12> x;
                for (size_t k = 0; k < 12; ++k) x[k] = in.number[k][lane];
                const std::vector<float> truth = expected(x);
                ASSERT_EQ(truth.size(), kResults);
                for (size_t k = 0; k < kResults; ++k) {
                    const float y = out.number[k][lane];
                    if (k == 3 && (x[0] != x[0] || x[1] != x[1] || x[2] != x[2])) continue; // max() of a NaN
                    ASSERT_TRUE(std::bit_cast<uint32_t>(truth[k]) == std::bit_cast<uint32_t>(y) ||
                                (std::isnan(truth[k]) && std::isnan(y)))
                        << target << ' ' << n << " result " << k << ": " << truth[k] << ' ' << y;
                }
                const bool less = x[0]<x[3], greater = x[1]> 0.25f;
                ASSERT_EQ(out.less >> lane & 1, uint32_t{less}) << target;
                ASSERT_EQ(out.both >> lane & 1, uint32_t{less && greater}) << target;
                ASSERT_EQ(out.either >> lane & 1, uint32_t{less || greater}) << target;
                ASSERT_EQ(out.one >> lane & 1, uint32_t{less != greater}) << target;
                ASSERT_EQ(out.none >> lane & 1, uint32_t{!less}) << target;
            }
        });
    }
}

TEST(Vector, ReadsIntegersAtAnyAddress) {
    std::array<std::byte, 64> bytes;
    for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(37 * i + 11);
    targets::for_each([&](const char* target) {
        for (size_t begin = 0; begin < 16; ++begin) {
            const std::byte* const from = bytes.data() + begin;
            float out[4][8];
            HWY_DYNAMIC_DISPATCH(convert)(from, out);
            for (size_t i = 0; i < 8; ++i) {
                EXPECT_EQ(out[0][i], load_le<uint8_t>(from + i)) << target;
                EXPECT_EQ(out[1][i], load_le<int8_t>(from + i)) << target;
                EXPECT_EQ(out[2][i], load_le<uint16_t>(from + 2 * i)) << target;
                EXPECT_EQ(out[3][i], load_le<int16_t>(from + 2 * i)) << target;
            }
        }
    });
}

} // namespace
} // namespace prolate::query
#endif // HWY_ONCE

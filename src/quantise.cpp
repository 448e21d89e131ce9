// Numbers of a node: from doubles to the integers of the file, and from these to floats, exactly (format.hpp).
#include "src/format.hpp"

#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/power_of_two.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace prolate::format {

Lattice lattice_for(const double low[3], const double high[3], double size) noexcept {
    double extent = 0, reach = 0;
    for (int i = 0; i < 3; ++i) {
        extent = std::max(extent, high[i] - low[i]);
        reach = std::max({reach, std::abs(low[i]), std::abs(high[i])});
    }
    // The smallest step for which the box spans fewer than 2^16 - 2 steps and lies within 2^24 - 2^17 steps of zero.
    const double needed =
        std::max({extent / (UINT16_MAX - 2.0), reach / (kMaxCoordinate - 2.0 * UINT16_MAX), size * 0x1p-20});
    int exponent = kMinStepExponent;
    if (needed > 0) exponent = std::clamp(std::ilogb(needed) + 1, kMinStepExponent, kMaxStepExponent);
    Lattice lattice;
    lattice.step_exponent = exponent;
    for (int i = 0; i < 3; ++i) // the clamp acts only beyond the coarsest step, where nothing fits anyway
        lattice.origin[i] = static_cast<int32_t>(std::clamp(std::floor(std::ldexp(low[i], -exponent)),
                                                            1.0 - kMaxCoordinate, kMaxCoordinate - UINT16_MAX - 1.0));
    return lattice;
}

int fraction_bits(int32_t origin) noexcept {
    const auto farthest = static_cast<uint32_t>(std::max(std::abs(origin), std::abs(origin + UINT16_MAX)));
    return std::min(kCenterBits - static_cast<int>(std::bit_width(farthest - 1)), kFractionBits);
}

void quantise(PackedNode& node, const Lattice& lattice, const double center[3], const double factor[6]) noexcept {
    for (size_t i = 0; i < 3; ++i) {
        const int bits = fraction_bits(lattice.origin[i]);
        const double nearest = std::nearbyint(std::ldexp(center[i], bits - lattice.step_exponent));
        const double q = std::ldexp(nearest, -bits) - lattice.origin[i];
        const auto stored = static_cast<int32_t>(std::clamp(q, 0.0, double{UINT16_MAX}) * kCenterUnits);
        node.center[i] = static_cast<uint16_t>(stored / kCenterUnits);
        node.fraction[i] = static_cast<uint8_t>(stored % kCenterUnits);
    }
    const double diagonal[3] = {factor[0], factor[2], factor[5]};
    const double off[3] = {factor[1], factor[3], factor[4]};
    double largest = 0; // an entry of the diagonal may be four times as large
    for (int i = 0; i < 3; ++i) largest = std::max({largest, diagonal[i] / 4, std::abs(off[i])});
    // The smallest exponent at which all entries fit after rounding.
    const int lowest = std::max(kMinNodeExponent, lattice.step_exponent + kMinNodeSize);
    int exponent = std::clamp(largest > 0 ? std::ilogb(largest) + 1 : lowest, lowest, kMaxNodeExponent);
    constexpr double kFull = INT16_MAX * double{INT16_MAX} * 0x1p-30;
    if (std::ldexp(largest, -exponent) > kFull && exponent < kMaxNodeExponent) ++exponent;
    node.exponent = static_cast<int8_t>(exponent);
    for (size_t i = 0; i < 3; ++i) {
        node.diagonal[i] = static_cast<uint16_t>(std::clamp(nearest_entry(diagonal[i], exponent), 1, UINT16_MAX));
        node.off_diagonal[i] = static_cast<int16_t>(std::clamp(nearest_entry(off[i], exponent), INT16_MIN, INT16_MAX));
    }
}

void store_boxes(std::byte* block, std::span<const PackedNode> siblings, const Lattice& lattice) noexcept {
    assert(siblings.size() <= kBlockLanes);
    constexpr double kSlack = 0x1p-16;             // far above the rounding of a lattice coordinate
    constexpr double kLargest = kMaxBoxOrigin - 1; // no node that open() admits reaches it
    double low[kBlockLanes][3], high[kBlockLanes][3];
    for (size_t lane = 0; lane < siblings.size(); ++lane) {
        const PackedNode& node = siblings[lane];
        const Ellipsoid e = decode(node, lattice);
        const double center[3] = {e.center.x, e.center.y, e.center.z};
        const double half[3] = {e.l11, std::hypot(e.l21, e.l22), std::hypot(e.l31, e.l32, e.l33)};
        for (size_t i = 0; i < 3; ++i) {
            const bool given = node.box_low[i] <= node.box_high[i];
            const double from = given ? node.box_low[i] : center[i] - half[i] * (1 + 0x1p-40);
            const double to = given ? node.box_high[i] : center[i] + half[i] * (1 + 0x1p-40);
            const auto steps = [&](double x) { return std::ldexp(x, -lattice.step_exponent) - lattice.origin[i]; };
            low[lane][i] = std::max(std::floor(steps(from) - kSlack), -kLargest);
            high[lane][i] = std::min(std::ceil(steps(to) + kSlack), kLargest);
        }
    }
    for (size_t i = 0; i < 3; ++i) {
        double first = kLargest, last = -kLargest;
        for (size_t lane = 0; lane < siblings.size(); ++lane)
            first = std::min(first, low[lane][i]), last = std::max(last, high[lane][i]);
        uint8_t exponent = 0;
        while (std::ceil(std::ldexp(last - first, -exponent)) > UINT8_MAX) ++exponent;
        store_le(block + kBlockBoxOrigin + 4 * i, static_cast<int32_t>(first));
        store_le(block + kBlockBoxExponent + i, exponent);
        for (size_t lane = 0; lane < siblings.size(); ++lane) {
            const auto store = [&](size_t array, double x) {
                store_le(block + array + kBlockLanes * i + lane, static_cast<uint8_t>(x));
            };
            store(kBlockBoxLow, std::floor(std::ldexp(low[lane][i] - first, -exponent)));
            store(kBlockBoxHigh, std::ceil(std::ldexp(high[lane][i] - first, -exponent)));
        }
    }
}

Ellipsoid decode(const PackedNode& node, const Lattice& lattice) noexcept {
    const auto unit = static_cast<float>(power_of_two(lattice.step_exponent) / kCenterUnits);
    const auto coordinate = [&](size_t i) {
        const int64_t steps = lattice.origin[i] + int32_t{node.center[i]};
        return static_cast<float>(steps * kCenterUnits + node.fraction[i]) * unit;
    };
    const auto diagonal = [&](size_t i) { return static_cast<float>(entry(node.diagonal[i], node.exponent)); };
    const auto off = [&](size_t i) { return static_cast<float>(entry(node.off_diagonal[i], node.exponent)); };
    return {.center = {coordinate(0), coordinate(1), coordinate(2)},
            .l11 = diagonal(0),
            .l21 = off(0),
            .l22 = diagonal(1),
            .l31 = off(1),
            .l32 = off(2),
            .l33 = diagonal(2)};
}

} // namespace prolate::format

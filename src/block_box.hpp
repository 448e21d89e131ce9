// The boxes of a block (src/block.hpp), one around the node of each lane.
#pragma once

#include "src/block.hpp"
#include "src/bytes.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>

namespace prolate {

/// Decodes them. On axis i, a side at s box steps lies at origin(i) + s step(i), in lattice coordinates; all of these
/// numbers are exact.
class BlockBoxes {
public:
    explicit BlockBoxes(const std::byte* block) : block_(block) {}
    int32_t origin(size_t axis) const { return load_le<int32_t>(block_ + kBlockBoxOrigin + 4 * axis); }
    int32_t exponent(size_t axis) const { return load_le<uint8_t>(block_ + kBlockBoxExponent + axis); }
    float step(size_t axis) const { return power(exponent(axis)); }
    float half_step(size_t axis) const { return power(exponent(axis) - 1); }
    float per_step(size_t axis) const { return power(-exponent(axis)); }
    /// The sides of a lane's box, 0 to 255 box steps.
    int32_t low(size_t axis, size_t lane) const { return side(kBlockBoxLow, axis, lane); }
    int32_t high(size_t axis, size_t lane) const { return side(kBlockBoxHigh, axis, lane); }

private:
    static float power(int32_t exponent) { return std::bit_cast<float>((127 + exponent) << 23); }
    int32_t side(size_t array, size_t axis, size_t lane) const {
        return load_le<uint8_t>(block_ + array + kBlockLanes * axis + lane);
    }

    const std::byte* block_;
};

} // namespace prolate

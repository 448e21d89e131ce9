// The boxes of a block (src/block_box.hpp) in vectors: of all lanes along one axis, or of one lane along all axes.
// Compiled once for each instruction set; include it below <hwy/foreach_target.h>.
#include "query/simd/vector-inl.hpp"
#include "src/block_box.hpp"

// clang-format off
#if defined(PROLATE_QUERY_BLOCK_BOX_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_BLOCK_BOX_INL_HPP
#undef PROLATE_QUERY_BLOCK_BOX_INL_HPP
#else
#define PROLATE_QUERY_BLOCK_BOX_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Sides of the boxes of the lanes from `first` on, box steps; `array` is kBlockBoxLow or kBlockBoxHigh.
HWY_INLINE Float box_sides(const std::byte* block, size_t array, size_t axis, size_t first) {
    return load_integers<uint8_t>(block + array + kBlockLanes * axis + first);
}

#if HWY_TARGET != HWY_SCALAR
// Vectors of four, whose components are x, y and z, and one that means nothing.
using QuadIntegerTag = hn::FixedTag<int32_t, 4>;
using QuadInteger = hn::Vec<QuadIntegerTag>;
using QuadByteTag = hn::FixedTag<uint8_t, 16>;

HWY_INLINE hn::Vec<QuadByteTag> load_quad_bytes(const std::byte* from) {
    return hn::LoadU(QuadByteTag(), reinterpret_cast<const uint8_t*>(from));
}
/// 2^exponent of each
HWY_INLINE Quad powers_of_two(QuadInteger exponent) {
    return hn::BitCast(QuadTag(), hn::ShiftLeft<23>(exponent + hn::Set(QuadIntegerTag(), 127)));
}
/// Where box coordinates begin, lattice coordinates.
HWY_INLINE Quad box_origin(const std::byte* block) {
    return hn::ConvertTo(QuadTag(), hn::BitCast(QuadIntegerTag(), load_quad_bytes(block + kBlockBoxOrigin)));
}
/// A box step is 2^exponent lattice steps.
HWY_INLINE QuadInteger box_exponent(const std::byte* block) {
    const hn::Rebind<uint8_t, QuadIntegerTag> four;
    return hn::PromoteTo(QuadIntegerTag(),
                         hn::LoadU(four, reinterpret_cast<const uint8_t*>(block + kBlockBoxExponent)));
}
/// The lower or upper corner of a lane's box, box steps. Its bytes stand eight apart in a row.
HWY_INLINE QuadInteger box_corner(const std::byte* block, size_t array, uint32_t lane) {
    constexpr uint8_t o = 0x80; // gives a zero
    alignas(16) static constexpr uint8_t kTwoRows[] = {0, o, o, o, 8, o, o, o, o, o, o, o, o, o, o, o};
    alignas(16) static constexpr uint8_t kLastRow[] = {o, o, o, o, o, o, o, o, 8, o, o, o, o, o, o, o};
    const QuadByteTag bytes;
    const auto move_on = hn::Set(bytes, static_cast<uint8_t>(lane));
    const auto two_rows = hn::TableLookupBytesOr0(load_quad_bytes(block + array), hn::Load(bytes, kTwoRows) + move_on);
    const auto last_row =
        hn::TableLookupBytesOr0(load_quad_bytes(block + array + kBlockLanes), hn::Load(bytes, kLastRow) + move_on);
    return hn::BitCast(QuadIntegerTag(), hn::Or(two_rows, last_row));
}
#endif

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_BLOCK_BOX_INL_HPP

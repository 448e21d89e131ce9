// A node where queries compare it with a block: place() of lanes.hpp, in vectors of four that hold x, y, z. Compiled
// once for each instruction set; include it below <hwy/foreach_target.h>.
#include "query/node/block_box-inl.hpp"
#include "query/node/lanes.hpp"

// clang-format off
#if defined(PROLATE_QUERY_PLACE_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_PLACE_INL_HPP
#undef PROLATE_QUERY_PLACE_INL_HPP
#else
#define PROLATE_QUERY_PLACE_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR
using Quad3 = Vector3<Quad>; // three vectors of four, such as the columns of a matrix

// v.x, v.y and v.z, each in all four components.
HWY_INLINE Quad3 spread(Quad v) {
    return {hn::Broadcast<0>(v), hn::Broadcast<1>(v), hn::Broadcast<2>(v)};
}
// x + y + z, in the first component.
HWY_INLINE Quad sum_of_three(Quad v) {
    return v + hn::Shuffle0321(v) + hn::Shuffle1032(v);
}

// A node as stored, lattice steps of its own tree.
struct QuadNode {
    Quad center;
    Quad l11, l21, l22, l31, l32, l33; // each in all four components
};
HWY_INLINE QuadNode load_quad_node(const std::byte* block, uint32_t lane, int32_t step_exponent) {
    const QuadIntegerTag d32;
    const Quad unit = broadcast<Quad>(factor_unit(load_le<int8_t>(block + kBlockExponent + lane), step_exponent));
    const auto diagonal = [&](size_t row) {
        const auto twice =
            hn::Set(hn::FixedTag<uint16_t, 8>(), load_le<uint16_t>(block + block_offset(kBlockDiagonal, row, lane)));
        const auto stored = hn::ShiftRight<16>(hn::BitCast(hn::FixedTag<uint32_t, 4>(), twice));
        const Quad q = hn::ConvertTo(QuadTag(), hn::BitCast(d32, stored));
        return q * unit * q;
    };
    const auto off_diagonal = [&](size_t row) {
        const auto twice =
            hn::Set(hn::FixedTag<int16_t, 8>(), load_le<int16_t>(block + block_offset(kBlockOffDiagonal, row, lane)));
        const Quad q = hn::ConvertTo(QuadTag(), hn::ShiftRight<16>(hn::BitCast(d32, twice)));
        return q * unit * abs(q);
    };
    const auto steps = [&](size_t row) { return load_le<uint16_t>(block + block_offset(kBlockCenter, row, lane)); };
    const auto whole = hn::InsertLane(
        hn::InsertLane(hn::InsertLane(hn::Zero(hn::FixedTag<uint16_t, 8>()), 0, steps(0)), 2, steps(1)), 4, steps(2));
    alignas(16) static constexpr int32_t kMasks[] = {fraction_mask(0), fraction_mask(1), fraction_mask(2), 0};
    alignas(16) static constexpr float kUnits[] = {fraction_unit(0), fraction_unit(1), fraction_unit(2), 0};
    const QuadInteger fractions = hn::Set(d32, load_le<uint16_t>(block + kBlockFraction + 2 * lane));
    const Quad fraction = hn::ConvertTo(QuadTag(), hn::And(fractions, hn::Load(d32, kMasks)));
    return {.center = hn::MulAdd(fraction, load<Quad>(kUnits), hn::ConvertTo(QuadTag(), hn::BitCast(d32, whole))),
            .l11 = diagonal(0),
            .l21 = off_diagonal(0),
            .l22 = diagonal(1),
            .l31 = off_diagonal(1),
            .l32 = off_diagonal(2),
            .l33 = diagonal(2)};
}

// Its center, in the lattice that it is placed in.
HWY_INLINE void place_center(const QuadNode& e, const LatticePose& pose, Single& s) {
    const hn::CappedTag<double, 4> d64;
    const hn::Rebind<float, decltype(d64)> rounded;
    const auto wide = [d64](auto component) {
        if constexpr (hn::MaxLanes(d64) == 4)
            return hn::PromoteTo(d64, component);
        else
            return hn::PromoteTo(d64, hn::LowerHalf(component));
    };
    const Quad3 stored = spread(e.center);
    const auto x = wide(stored.x), y = wide(stored.y), z = wide(stored.z);
    for (size_t i = 0; i < 4; i += hn::Lanes(d64)) {
        const auto column = [&](size_t c) { return hn::Load(d64, pose.linear[c] + i); };
        const auto exact = (column(0) * x + column(1) * y) + (column(2) * z + hn::Load(d64, pose.offset + i));
        hn::Store(exact, d64, s.exact + i), hn::StoreU(hn::DemoteTo(rounded, exact), rounded, s.center + i);
    }
}

// What a node's box says, in lattice coordinates of its own tree: center, and half the sides.
struct QuadBox {
    Quad center, half;
};
HWY_INLINE QuadBox box_of(const std::byte* block, uint32_t lane) {
    const QuadInteger low = box_corner(block, kBlockBoxLow, lane), high = box_corner(block, kBlockBoxHigh, lane);
    const Quad half_step = powers_of_two(box_exponent(block) - hn::Set(QuadIntegerTag(), 1));
    const Quad center = box_origin(block) + hn::ConvertTo(QuadTag(), low + high) * half_step;
    return {center, hn::ConvertTo(QuadTag(), high - low) * half_step + (kBoxMargin * abs(center) + kBoxSlack)};
}
#endif

/// place() of lanes.hpp, which has the same operations.
HWY_INLINE Single place_here(const std::byte* block, uint32_t lane, const LatticePose& pose, PlacedBox* box = nullptr) {
#if HWY_TARGET == HWY_SCALAR
    return place(block, lane, pose, box);
#else
    const QuadNode e = load_quad_node(block, lane, pose.exponent_from);
    Single s;
    place_center(e, pose, s);
    const Quad center = load<Quad>(s.center);
    const Quad3 turn{load<Quad>(pose.linear_rounded[0]), load<Quad>(pose.linear_rounded[1]),
                     load<Quad>(pose.linear_rounded[2])};
    const Quad3 f{dot(turn, Quad3{e.l11, e.l21, e.l31}), turn.y * e.l22 + turn.z * e.l32, turn.z * e.l33};
    store(f.x, s.factor[0]), store(f.y, s.factor[1]), store(f.z, s.factor[2]);
    const Quad squares = dot(f, f);
    store(squares, s.diagonal);
    store(dot(f, Quad3{hn::Shuffle0321(f.x), hn::Shuffle0321(f.y), hn::Shuffle0321(f.z)}), s.off_diagonal);

    const Quad size = sqrt(sum_of_three(squares));
    s.size = hn::GetLane(size), s.weight = hn::GetLane(1 / size);
    const Quad slack = hn::Broadcast<0>(kLaneMargin * (sum_of_three(abs(center)) + size) + common_slack(pose.reach));
    s.slack = hn::GetLane(slack), s.reach = pose.reach;
    const Quad half_ellipsoid = sqrt(squares) + slack;
    const Quad low = center - half_ellipsoid, high = center + half_ellipsoid;

    // Cut with the box around the node's own box, as it lies in these coordinates.
    const QuadBox own = box_of(block, lane);
    const Quad3 half = spread(own.half);
    const Quad turned = dot(turn, spread(own.center - e.center)); // the box's center
    const Quad around = dot(Quad3{abs(turn.x), abs(turn.y), abs(turn.z)}, half);
    const Quad at = center + turned, half_box = slack + around;
    store(greater(low, at - half_box), s.low), store(lesser(high, at + half_box), s.high);
    if (box != nullptr) {
        store(turned, box->center);
        store(turn.x * half.x, box->axis[0]), store(turn.y * half.y, box->axis[1]);
        store(turn.z * half.z, box->axis[2]);
        box->slack = kLaneMargin * hn::GetLane(sum_of_three(abs(turned) + around));
    }
    return s;
#endif
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_PLACE_INL_HPP

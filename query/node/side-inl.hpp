// One of the two trees of a traversal, as that whose children are tested, a block at a time, against single nodes of
// the other. Per SIMD target; include it below hwy/foreach_target.h.
#include "query/node/place-inl.hpp"
#include "query/node/tree_side.hpp"

// clang-format off
#if defined(PROLATE_QUERY_SIDE_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_SIDE_INL_HPP
#undef PROLATE_QUERY_SIDE_INL_HPP
#else
#define PROLATE_QUERY_SIDE_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// A node of the other tree in the lattice of this one.
struct PlacedNode {
    uint32_t node = UINT32_MAX;
    Single single;

    static constexpr PlacedBox* box_to_place() { return nullptr; }
};
/// With the box that holds it.
struct PlacedNodeWithBox {
    uint32_t node = UINT32_MAX;
    Single single;
    PlacedBox box;

    PlacedBox* box_to_place() { return &box; }
};

template <class Placed> class Side : public TreeSide {
public:
    /// `other_to_here` must outlive the side.
    Side(const TreeSide& side, const LatticePose& other_to_here) : TreeSide(side), other_to_here_(other_to_here) {}

    /// A node of the other tree in this one's lattice.
    HWY_INLINE const Placed& place(const TreeSide& other, uint32_t node) {
        Placed& placed = placed_[node % kPlaced];
        if (placed.node != node) {
            placed.single = place_here(other.block(node), node % kBlockLanes, other_to_here_, placed.box_to_place());
            placed.node = node;
        }
        return placed;
    }

private:
    // Nodes that were placed before: every third or so is tested against another block soon.
    static constexpr uint32_t kPlaced = 8;
    const LatticePose& other_to_here_;
    Placed placed_[kPlaced];
};

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_SIDE_INL_HPP

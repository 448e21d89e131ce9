// Counting the crossings of a ray along an axis: eight nodes at a time, depth first.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/inside/inside.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/inside/axis_lanes-inl.hpp"
#include "query/inside/crossing.hpp"
#include "query/inside/inside.hpp"
#include "query/node/limits.hpp"
#include "src/bytes.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

class WindingTraversal {
public:
    WindingTraversal(const TreeView& tree, const PlacedPoint& point, QueryStats& stats, uint64_t most_tests)
        : tree_(tree), point_(point), at_(lattice_point(point, tree.raw().lattice())), stats_(stats),
          most_tests_(most_tests), step_exponent_(tree.raw().lattice().step_exponent) {}

    std::optional<int64_t> run() {
        if (tree_.is_leaf(0)) return add_crossings(tree_.triangles(0), {}) ? std::optional(winding_) : std::nullopt;
        const std::optional<Start> start = shortest();
        if (!start) return {};
        const bool finished = start->direction.axis == 0   ? walk<0>(*start)
                              : start->direction.axis == 1 ? walk<1>(*start)
                                                           : walk<2>(*start);
        return finished ? std::optional(winding_) : std::nullopt;
    }

private:
    struct Family {
        uint32_t block, left, mask; // the block looked at, siblings beyond it, lanes of it still to be opened
    };
    struct Start {
        AxisDirection direction;
        Family family; // the children of the root
    };

    uint64_t left() const { return tests_left(most_tests_, stats_.tests()); }
    bool take(uint32_t count) {
        if (count > left()) return false;
        stats_.pair_tests += count, ++stats_.block_tests;
        return true;
    }

    // The direction in which the fewest children of the root are met.
    std::optional<Start> shortest() {
        const ChildRange children = tree_.children(0);
        const uint32_t first = children.first / kBlockLanes;
        int met[6] = {};
        uint32_t lanes[6] = {}; // of the first block
        for (uint32_t i = 0; i < children.count; i += kBlockLanes) {
            const uint32_t count = std::min(children.count - i, kBlockLanes), used = (1u << count) - 1;
            if (!take(count)) return {};
            const std::byte* const block = tree_.raw().block(first + i / kBlockLanes);
            const AxisMask masks[3] = {axis_block<0>(block, step_exponent_, at_),
                                       axis_block<1>(block, step_exponent_, at_),
                                       axis_block<2>(block, step_exponent_, at_)};
            for (size_t k = 0; k < 6; ++k) {
                const uint32_t mask = (k % 2 == 0 ? masks[k / 2].ahead : masks[k / 2].behind) & used;
                met[k] += std::popcount(mask);
                if (i == 0) lanes[k] = mask;
            }
        }
        const auto least = static_cast<uint32_t>(std::min_element(met, met + 6) - met);
        const uint32_t left = children.count - std::min(children.count, kBlockLanes);
        return Start{{least / 2, least % 2 != 0}, {first, left, lanes[least]}};
    }

    // False if the tests run out.
    template <size_t kAxis> bool walk(const Start& start) {
        Family stack[kMaxLevels];
        stack[0] = start.family;
        const auto look = [&](Family& family) {
            const uint32_t count = std::min(family.left, kBlockLanes);
            if (!take(count)) return false;
            const AxisMask mask = axis_block<kAxis>(tree_.raw().block(family.block), step_exponent_, at_);
            family.mask = (start.direction.negative ? mask.behind : mask.ahead) & ((1u << count) - 1);
            family.left -= count;
            return true;
        };
        for (uint32_t depth = 0;;) {
            Family& family = stack[depth];
            if (family.mask == 0) {
                if (family.left > 0) {
                    ++family.block;
                    if (!look(family)) return false;
                } else if (depth-- == 0) {
                    return true;
                }
                continue;
            }
            const auto lane = static_cast<uint32_t>(std::countr_zero(family.mask));
            family.mask &= family.mask - 1;
            const std::byte* const block = tree_.raw().block(family.block);
            const uint32_t count = load_le<uint8_t>(block + kBlockCount + lane);
            if (count >= kTriangleLeaf) {
                if (!add_crossings({first_triangle(block, lane), count - kTriangleLeaf}, start.direction)) return false;
                continue;
            }
            stack[++depth] = {first_child(block, lane) / kBlockLanes, count, 0};
            if (!look(stack[depth])) return false;
        }
    }

    // A leaf's crossings. False if the tests run out.
    bool add_crossings(const TriangleRange& triangles, const AxisDirection& direction) {
        if (triangles.count > left()) return false;
        stats_.triangle_tests += triangles.count;
        winding_ += crossings(tree_, triangles, point_.position, direction);
        return true;
    }

    const TreeView& tree_;
    const PlacedPoint& point_;
    const LatticePoint at_;
    QueryStats& stats_;
    const uint64_t most_tests_;
    const int32_t step_exponent_;
    int64_t winding_ = 0;
};

std::optional<int64_t> winding_number_target(const TreeView& tree, const PlacedPoint& point, QueryStats& stats,
                                             uint64_t most_tests) {
    return WindingTraversal(tree, point, stats, most_tests).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {

HWY_EXPORT(winding_number_target);
std::optional<int64_t> winding_number(const TreeView& tree, const PlacedPoint& point, QueryStats& stats,
                                      uint64_t most_tests) noexcept {
    return HWY_DYNAMIC_DISPATCH(winding_number_target)(tree, point, stats, most_tests);
}

} // namespace prolate::query
#endif // HWY_ONCE

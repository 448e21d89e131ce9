// Two patches, that is the triangles of a leaf or of all children of a node, if there are few and they are leaves:
// which pairs matter, and how far are these apart? All pairs at once is sooner than a block test for each child, and a
// test for each pair of leaves: a patch is placed once and kept for the pairs of nodes that share it, and each of its
// triangles meets eight of the other patch in a dozen instructions a pair. Per SIMD target; include it below
// hwy/foreach_target.h.
//
// Triangles are floats from the patch's own origin, the first corner, in A's frame; their unit is the power of two that
// makes S (query/triangle/support.hpp) less than 1. First, whatever is so far from the other patch along the normal of
// the nearest pair that was found that no pair of it matters is left out. A bound of the rest is the greatest of three:
// the gaps along both triangles' normals, and that of spheres around them. What that leaves open takes the direction
// between the nearest points of edges (query/triangle/distance_lanes-inl.hpp), and then the exact test, the nearest of
// eight first.
//
// Rounding, u = 2^-24. With r the radius of a patch around its origin (A's r1, B's r2), and d the way from A's origin
// to B's, for a direction n with |n| <= 1 + 6 u:
//   corners      a difference, and times a scale          2 u r1
//                turned, with the rounded matrix          9 u r2
//   d            rounded, after 80 * 2^-53 S              u |d|
//   n.x          of both, and of d: 3 u each              3 u (r1 + r2 + |d|)
//   a gap        of three terms                           3 u (r1 + r2 + |d|), and 6 u of it for |n|
// so that it is wrong by less than 21 u (r1 + r2 + |d|) and 80 * 2^-53 S. kPatchMargin (r1 + r2 + |d|), 24 u, and
// kSeparationMargin S are taken off, also from the gap of two spheres: center and radius are computed from the corners,
// and wrong by 12 u r each.
#include "query/distance/state.hpp"
#include "query/node/tree_side.hpp"
#include "query/triangle/distance_lanes-inl.hpp"
#include "query/triangle/fours-inl.hpp"
#include "query/triangle/support.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

// clang-format off
#if defined(PROLATE_QUERY_DISTANCE_PATCH_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_DISTANCE_PATCH_INL_HPP
#undef PROLATE_QUERY_DISTANCE_PATCH_INL_HPP
#else
#define PROLATE_QUERY_DISTANCE_PATCH_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline constexpr uint32_t kPatchTriangles = 24; // at most
inline constexpr float kPatchMargin = 0x1.8p-20f;

/// The triangles of a leaf, or of a node with leaves only; none if there are more than a patch has.
inline TriangleRange patch_at(const TreeSide& side, uint32_t node) {
    const std::byte* const block = side.block(node);
    const uint32_t lane = node % kBlockLanes, count = load_le<uint8_t>(block + kBlockCount + lane);
    if (count > kTriangleLeaf) {
        const uint32_t triangles = count - kTriangleLeaf;
        return {first_triangle(block, lane), triangles <= kPatchTriangles ? triangles : 0};
    }
    if (count == 0 || count > kBlockLanes) return {0, 0};
    constexpr uint64_t kTop = 0x8080808080808080, kMany = 0x6060606060606060; // more than eight sums of a byte hold
    const std::byte* const children = side.block(first_child(block, lane));
    const uint64_t all = ~uint64_t{0} >> (64 - 8 * count), counts = load_le<uint64_t>(children + kBlockCount) & all;
    if ((counts & kTop) != (all & kTop) || (counts & kMany) != 0) return {0, 0};
    const auto triangles = static_cast<uint32_t>((counts & ~kTop) * 0x0101010101010101 >> 56);
    return {first_triangle(children, 0), triangles <= kPatchTriangles ? triangles : 0};
}

struct Patch {
    TriangleRange range{0, 0};
    glm::dvec3 origin;                               // A's frame, metres
    float radius;                                    // of a ball around the origin that holds the triangles
    alignas(32) float corner[3][3][kPatchTriangles]; // of corner i, coordinate k
    alignas(32) float normal[3][kPatchTriangles];    // of length 1, or less
    alignas(32) float low[kPatchTriangles], high[kPatchTriangles]; // along it
    alignas(32) float center[3][kPatchTriangles], size[kPatchTriangles];

    /// Places it by rotation x + translation, with `unit` a unit of length in a metre.
    void place(const TreeView& tree, const TriangleRange& triangles, const glm::dmat3& rotation,
               const glm::dvec3& translation, double unit) {
        range = triangles;
        if (tree.vertex_count() <= 0x10000)
            gather<uint16_t>(tree);
        else
            gather<uint32_t>(tree);
        const uint32_t middle = range.count / 2;
        const float first[3] = {corner[0][0][middle], corner[0][1][middle], corner[0][2][middle]};
        origin = rotation * (glm::dvec3(first[0], first[1], first[2]) * double{tree.scale()}) + translation;
        float turn[3][3];
        for (glm::length_t i = 0; i < 3; ++i)
            for (glm::length_t k = 0; k < 3; ++k)
                turn[i][k] = static_cast<float>(rotation[k][i] * (double{tree.scale()} * unit));
        Float most = set(0);
        for (size_t lane = 0; lane < padded(); lane += kFloatLanes) {
            Float3 at[3];
            for (size_t i = 0; i < 3; ++i) {
                const Float x = load(corner[i][0] + lane) - first[0], y = load(corner[i][1] + lane) - first[1],
                            z = load(corner[i][2] + lane) - first[2];
                const auto row = [&](size_t k) { return turn[k][0] * x + turn[k][1] * y + turn[k][2] * z; };
                at[i] = {row(0), row(1), row(2)};
                most = max(most, dot(at[i], at[i]));
                store(at[i], corner[i], lane);
            }
            Float3 n = cross(at[1] - at[0], at[2] - at[0]);
            n = n * (1 / sqrt(dot(n, n) + kProductUnderflow));
            const Float heights[3] = {dot(n, at[0]), dot(n, at[1]), dot(n, at[2])};
            store(n, normal, lane);
            store(min(heights[0], heights[1], heights[2]), low + lane);
            store(max(heights[0], heights[1], heights[2]), high + lane);
            const Float3 mean = (at[0] + at[1] + at[2]) * (1.0f / 3);
            const auto from_mean = [&](const Float3& x) { return dot(x - mean, x - mean); };
            store(mean, center, lane);
            store(sqrt(max(from_mean(at[0]), from_mean(at[1]), from_mean(at[2]))), size + lane);
        }
        radius = rounded_up(std::sqrt(hn::GetLane(hn::MaxOfLanes(FloatTag(), most))));
    }
    /// Lanes that are filled: behind the last triangle there are copies of it.
    size_t padded() const { return (range.count + kLanes - 1) / kLanes * kLanes; }
    TriangleLanes triangle(size_t i) const {
        return {{broadcast3(corner[0], i), broadcast3(corner[1], i), broadcast3(corner[2], i)}};
    }
    glm::vec3 center_of(size_t i) const { return {center[0][i], center[1][i], center[2][i]}; }
    static Float3 broadcast3(const float (&rows)[3][kPatchTriangles], size_t i) {
        return {set(rows[0][i]), set(rows[1][i]), set(rows[2][i])};
    }

private:
    // As they stand in the file, four triangles at a time, the last one again where there are fewer.
    template <class Index> void gather(const TreeView& tree) {
        const std::byte* const first = tree.raw().triangles() + size_t{range.first} * 3 * sizeof(Index);
        alignas(16) float at[3][kFour][4];
        for (uint32_t t = 0; t < padded(); t += kFour) {
            for (uint32_t i = 0; i < kFour; ++i) {
                const std::byte* const index = first + size_t{std::min(t + i, range.count - 1)} * 3 * sizeof(Index);
                for (size_t c = 0; c < 3; ++c) load_vertex(tree, load_le<Index>(index + c * sizeof(Index)), at[c][i]);
            }
            for (size_t c = 0; c < 3; ++c) transpose(at[c], corner[c][0] + t, corner[c][1] + t, corner[c][2] + t);
        }
    }
};

/// Of a search between exact trees.
class Patches {
public:
    explicit Patches(DistanceSearch& search) : s_(search), unit_(unit_scale(rounded_up(search.reach_of_triangles()))) {}

    /// Decides all pairs of triangles of two patches, below the nodes of an entry, of which none is nearer than
    /// `bound`: see DistanceSearch::decide().
    HWY_NOINLINE bool decide(const Scratch::Entry& e, const TriangleRange& in_a, const TriangleRange& in_b,
                             double bound) {
        begin(e, in_a, in_b, bound);
        if (limit_ < DistanceSearch::kInfinity) {
            look_along_normal();
        } else { // the first pair that the search comes to: two triangles give it a limit and a normal
            if (s_.left() < 1) return false;
            ++s_.stats.triangle_tests;
            decide_centers();
            if (s_.overlapping) return true;
        }
        const auto count = static_cast<uint32_t>(std::popcount(left_[0]) * std::popcount(left_[1]));
        if (count > s_.left()) return false;
        s_.stats.triangle_tests += count;
        decide_rest();
        return true;
    }

private:
    static constexpr uint32_t kPlaced = 2;

    void begin(const Scratch::Entry& e, const TriangleRange& in_a, const TriangleRange& in_b, double bound) {
        entry_ = &e, bound_ = bound, set_limit(s_.enough());
        patch_[0] = &placed(0, s_.a.tree, in_a), patch_[1] = &placed(1, s_.b.tree, in_b);
        between_ = (patch_[1]->origin - patch_[0]->origin) * unit_;
        for (size_t k = 0; k < 3; ++k) {
            way_[0][k] = static_cast<float>(between_[static_cast<glm::length_t>(k)]);
            way_[1][k] = -way_[0][k];
        }
        lengths_ = patch_[0]->radius + patch_[1]->radius + static_cast<float>(glm::length(between_));
        margin_ = rounded_up(double{kPatchMargin * lengths_} + kSeparationMargin);
        left_[0] = (1u << in_a.count) - 1, left_[1] = (1u << in_b.count) - 1;
        turn_ = 0, room_ = nearly_ = -HUGE_VALF;
    }

    const Patch& placed(size_t side, const TreeView& tree, const TriangleRange& range) {
        Patch& patch = placed_[side][range.first / 4 % kPlaced];
        if (patch.range.first != range.first || patch.range.count != range.count) {
            if (side == 0)
                patch.place(tree, range, glm::dmat3(1), glm::dvec3(0), unit_);
            else
                patch.place(tree, range, s_.b_to_a.rotation, s_.b_to_a.translation, unit_);
        }
        return patch;
    }
    void set_limit(double metres) {
        limit_ = metres, limit_in_lanes_ = rounded_up(std::min(metres * unit_, double{kFarLimit}));
    }
    void note_skipped() { s_.skipped = std::min(s_.skipped, std::max(limit_, bound_)); }

    // Two triangles whose centers are about the nearest.
    void decide_centers() {
        const auto nearest = [](const Patch& patch, const glm::vec3& to) {
            uint32_t best = 0;
            float least = HUGE_VALF;
            for (uint32_t t = 0; t < patch.range.count; ++t) {
                const glm::vec3 way = patch.center_of(t) - to;
                const float square = glm::dot(way, way);
                if (square < least) best = t, least = square;
            }
            return best;
        };
        const glm::vec3 way(way_[0][0], way_[0][1], way_[0][2]);
        const Patch &a = *patch_[0], &b = *patch_[1];
        uint32_t i = 0, j = 0;
        for (int turn = 0; turn < 2; ++turn) j = nearest(b, a.center_of(i) - way), i = nearest(a, b.center_of(j) + way);
        decide_pair(i, j);
    }

    // Along the normal of the nearest pair found: how far A's triangles reach, from A's origin, and B's, the other way,
    // from B's. Those that are far enough from all of the other patch are left no more.
    void look_along_normal() {
        turn_ = s_.normals_found;
        for (size_t side = 0; side < 2; ++side)
            std::fill(exact_reach_[side], exact_reach_[side] + patch_[side]->range.count, kUnknown);
        if (turn_ == 0 || !(limit_ < DistanceSearch::kInfinity)) return;
        const float n[3] = {static_cast<float>(s_.normal.x), static_cast<float>(s_.normal.y),
                            static_cast<float>(s_.normal.z)};
        const glm::dvec3 exact(n[0], n[1], n[2]);
        const Float most[2] = {reaches(0, set(n)), reaches(1, -set(n))};
        const double margin = double{kPatchMargin * (patch_[0]->radius + patch_[1]->radius)} + kSeparationMargin;
        const double enough = limit_ * unit_ * glm::length(exact) * (1 + 0x1p-50) + margin;
        room_ = static_cast<float>(glm::dot(between_, exact) - enough);
        nearly_ = static_cast<float>(glm::dot(between_, exact) - enough + 2 * margin);
        leave_out(0, most[1]), leave_out(1, most[0]);
    }
    // Returns the most, in all lanes.
    Float reaches(size_t side, const Float3& n) {
        const Patch& patch = *patch_[side];
        Float most = set(-HUGE_VALF);
        for (size_t lane = 0; lane < patch.padded(); lane += kFloatLanes) {
            const auto along = [&](size_t k) { return dot(n, load(patch.corner[k], lane)); };
            const Float reach = max(along(0), along(1), along(2));
            store(reach, reach_[side] + lane);
            most = max(most, reach);
        }
        return hn::MaxOfLanes(FloatTag(), most);
    }
    void leave_out(size_t side, Float others) {
        const uint32_t before = left_[side];
        for (size_t lane = 0; lane < patch_[side]->padded(); lane += kFloatLanes)
            left_[side] &= ~(bits(others + load(reach_[side] + lane) <= room_) << lane);
        if (left_[side] != before) note_skipped();
    }

    void decide_rest() {
        waiting_ = 0;
        const size_t one = std::popcount(left_[1]) < std::popcount(left_[0]) ? 1 : 0, other = 1 - one;
        for (uint32_t done = 0; (left_[one] & ~done) != 0;) { // less is left as nearer ones are found
            uint32_t pair[2];
            pair[one] = static_cast<uint32_t>(std::countr_zero(left_[one] & ~done));
            done |= (2u << pair[one]) - 1;
            for (uint32_t near = near_to(one, pair[one]); near != 0; near &= near - 1) {
                pair[other] = static_cast<uint32_t>(std::countr_zero(near));
                if (apart_along_normal(pair)) continue;
                std::copy_n(pair, 2, pair_[waiting_]);
                if (++waiting_ == kLanes) decide_waiting();
                if (s_.overlapping) return;
            }
        }
        if (waiting_ > 0) decide_waiting();
    }
    // Which triangles of the other patch may matter to the i-th of this side's, a bit each.
    uint32_t near_to(size_t side, uint32_t i) {
        const size_t other = 1 - side, end = patch_[other]->padded();
        uint32_t near = left_[other];
        if (turn_ != 0)
            for (size_t lane = 0; lane < end; lane += kFloatLanes)
                near &= ~(bits(load(reach_[other] + lane) + reach_[side][i] <= room_) << lane);
        for (size_t lane = 0; lane < end; lane += kFloatLanes)
            if ((near >> lane & kAllLanes) != 0)
                near &= ~(far_from(*patch_[side], i, set(way_[side]), *patch_[other], lane) << lane);
        if (near != left_[other]) note_skipped();
        return near;
    }
    // Which triangles of y from `lane` on are far enough from the i-th of x by their own directions? y's origin is
    // `way` from x's.
    HWY_INLINE uint32_t far_from(const Patch& x, uint32_t i, const Float3& way, const Patch& y, size_t lane) const {
        const Float3 n = Patch::broadcast3(x.normal, i), m = load(y.normal, lane);
        const Float way_n = dot(n, way), way_m = dot(m, way);
        const auto corner_x = [&](size_t k) { return dot(m, Patch::broadcast3(x.corner[k], i)); };
        const auto corner_y = [&](size_t k) { return dot(n, load(y.corner[k], lane)); };
        const Float a[3] = {corner_x(0), corner_x(1), corner_x(2)}, b[3] = {corner_y(0), corner_y(1), corner_y(2)};
        const Float along_n =
            max(min(b[0], b[1], b[2]) + (way_n - set(x.high[i])), (set(x.low[i]) - way_n) - max(b[0], b[1], b[2]));
        const Float along_m = max((load(y.low + lane) + way_m) - max(a[0], a[1], a[2]),
                                  min(a[0], a[1], a[2]) - (load(y.high + lane) + way_m));
        const Float3 between = load(y.center, lane) + (way - Patch::broadcast3(x.center, i));
        const Float spheres = sqrt(dot(between, between)) - (load(y.size + lane) + x.size[i]);
        return bits(max(along_n, along_m, spheres) - margin_ >= limit_in_lanes_);
    }
    // The last word on the normal, in double precision: where faces are flat and parallel, much is equally near.
    HWY_INLINE bool apart_along_normal(const uint32_t (&pair)[2]) {
        return turn_ != 0 && reach_[0][pair[0]] + reach_[1][pair[1]] <= nearly_ && exactly_apart_along_normal(pair);
    }
    bool exactly_apart_along_normal(const uint32_t (&pair)[2]) {
        double &a = exact_reach_[0][pair[0]], &b = exact_reach_[1][pair[1]];
        if (a == kUnknown) a = triangle_support(s_.a.tree, {patch_[0]->range.first + pair[0], 1}, s_.normal);
        if (b == kUnknown) b = triangle_support(s_.b.tree, {patch_[1]->range.first + pair[1], 1}, -s_.normal_b);
        const double along = glm::dot(s_.normal, s_.b_to_a.translation);
        const double gap = ((along - b) - a) - kSeparationMargin * s_.reach_of_triangles();
        if (!(gap * (1 - 0x1p-50) >= limit_)) return false;
        note_skipped();
        return true;
    }
    // The pairs that wait, the nearest first.
    void decide_waiting() {
        alignas(32) float lower[kLanes];
        bound_waiting(lower);
        for (uint32_t left = (1u << waiting_) - 1; left != 0 && !s_.overlapping;) {
            auto lane = static_cast<uint32_t>(std::countr_zero(left));
            for (uint32_t rest = left & (left - 1); rest != 0; rest &= rest - 1) {
                const auto other = static_cast<uint32_t>(std::countr_zero(rest));
                if (lower[other] < lower[lane]) lane = other;
            }
            left &= ~(1u << lane);
            if (lower[lane] > 0 && lower[lane] >= limit_in_lanes_) { // so are the rest
                note_skipped();
                break;
            }
            decide_pair(pair_[lane][0], pair_[lane][1]);
        }
        waiting_ = 0;
    }
    void bound_waiting(float (&lower)[kLanes]) const {
        TriangleRows rows[2] = {};
        for (uint32_t w = 0; w < waiting_; ++w)
            for (size_t c = 0; c < 3; ++c)
                for (size_t k = 0; k < 3; ++k) {
                    rows[0].row[3 * c + k][w] = patch_[0]->corner[c][k][pair_[w][0]];
                    rows[1].row[3 * c + k][w] = patch_[1]->corner[c][k][pair_[w][1]] + way_[0][k];
                }
        const LaneMargins margins{.direction =
                                      rounded_up(double{LaneMarginFactors().direction * lengths_} + kSeparationMargin),
                                  .corner_error = 0,
                                  .distance = 0};
        for (size_t lane = 0; lane < kLanes; lane += kFloatLanes) {
            const TrianglePairLanes pair(load_triangles(rows[0], lane), load_triangles(rows[1], lane));
            store(lower_bound(pair, between_edges(pair), margins), lower + lane);
        }
    }
    void decide_pair(uint32_t in_a, uint32_t in_b) {
        s_.decide_triangles(pair_at(in_a, in_b), limit_, bound_);
        set_limit(std::min(limit_, s_.enough()));
        if (turn_ != s_.normals_found) look_along_normal();
    }
    MeetingPair pair_at(uint32_t in_a, uint32_t in_b) const {
        const uint32_t a = patch_[0]->range.first + in_a, b = patch_[1]->range.first + in_b;
        return {leaf_with(s_.a, entry_->node_a, a), leaf_with(s_.b, entry_->node_b, b), a, b};
    }
    static uint32_t leaf_with(const TreeSide& side, uint32_t node, uint32_t triangle) {
        const ChildRange children = children_in(side.block(node), node % kBlockLanes);
        if (children.count > kTriangleLeaf) return node;
        const std::byte* const leaves = side.block(children.first);
        uint32_t lane = children.count - 1;
        while (first_triangle(leaves, lane) > triangle) --lane;
        return children.first + lane;
    }

    static constexpr double kUnknown = HUGE_VAL;
    static constexpr uint32_t kAllLanes = (1u << kFloatLanes) - 1;

    DistanceSearch& s_;
    const double unit_;
    Patch placed_[2][kPlaced];
    // The pair of patches:
    const Patch* patch_[2] = {};
    const Scratch::Entry* entry_ = nullptr;
    double bound_ = 0, limit_ = 0; // metres
    float limit_in_lanes_ = 0;
    glm::dvec3 between_{0}; // from A's origin to B's, units
    float way_[2][3] = {};  // rounded, and back
    float margin_ = 0;
    float lengths_ = 0;     // r1 + r2 + |d|
    uint32_t left_[2] = {}; // triangles, a bit each
    uint32_t turn_ = 0;     // along which normal these reach; 0: none
    alignas(32) float reach_[2][kPatchTriangles];
    double exact_reach_[2][kPatchTriangles]; // the same, metres from the bodies' origins, if known
    float room_ = 0, nearly_ = 0; // two that reach no farther than this in all are far enough from each other
    uint32_t waiting_ = 0, pair_[kLanes][2];
};

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_DISTANCE_PATCH_INL_HPP

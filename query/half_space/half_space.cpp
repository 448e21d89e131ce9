// distance() and contacts() of a body and a half-space: the traversal (search.cpp) finds what is lowest, or all that
// lies in the half-space; corners and ellipsoids are placed in double precision, and separated() of query/shapes
// decides.
//
// Of contacts, a node is passed over if nothing in it lies deeper than what is known, or farther out along the longest
// line between two known points and across it. The search begins with the points of the last query, which most often
// are the answer: a body at rest costs a few nodes more than the verdict. If it finds others, it goes on from these for
// what lies only a little farther out, so that what rests has the corners of its outline. Of a body of few corners, all
// are looked at, without the tree.
#include <prolate/half_space.hpp>

#include "query/contacts/last_contacts.hpp"
#include "query/contacts/manifold.hpp"
#include "query/distance/rounded.hpp"
#include "query/half_space/lowest.hpp"
#include "query/half_space/search.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/placed.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

namespace prolate {
namespace query {
namespace {

using glm::dvec3;

PlacedHalfSpace moved(PlacedHalfSpace h, double margin) {
    h.offset += margin, h.reach += margin;
    return h;
}

constexpr double kSamePoint = 1e-4;  // of the body: what is nearer is one point
constexpr uint32_t kFewCorners = 64; // all of which cost less than the blocks of nodes above them
// Shares of the extent that is known: what lies farther out by less is not looked for, at first and if something new
// was found.
constexpr double kCoarseShare = 0x1p-4, kFineShare = 0x1p-6;

// What a point counts as farther out for each metre that it is lower: what is level with the lowest corner counts as it
// lies, and of what is higher that which a body that rolls soon comes down on, not what is far away. Steeper than
// 1 : 16 a body does not turn in a step of a simulator.
constexpr double kLean = 16;

dvec3 beside(const dvec3& n) {
    return glm::cross(n, std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0));
}

// Ids name a vertex or a node, and say which: so the corners of the last query are known at once.
constexpr uint64_t kVertexId = uint64_t{1} << 32, kNodeId = uint64_t{2} << 32;

// All corners and ellipsoids that touch, sieved.
class Touching {
public:
    Touching(HeightSearch& search, double margin, const LastContacts& last)
        : s_(search), last_(last), margin_(margin), touched_(moved(search.shape, margin)),
          surely_(kSeparationMargin * touched_.reach),
          highest_(kSeparationMargin *
                   (2 * place(search.side.tree.root_bound(), search.side.tree.scale()).reach + touched_.reach)),
          same_point(kSamePoint * place(search.side.tree.root(), search.side.tree.scale()).size),
          patch(-search.shape.normal, beside(search.shape.normal), kLean) {}

    void find() {
        if (take_all()) return;
        s_.user = this;
        s_.leaf = [](void* self, uint32_t slot) { return static_cast<Touching*>(self)->leaf(slot); };
        s_.wanted = [](void* self, uint32_t slot, double bound) {
            return static_cast<Touching*>(self)->wanted(slot, bound);
        };
        s_.outline = &outline_;
        s_.limit = margin_ + 2 * highest_; // corners that are higher do not touch
        take_known();
        news_ = false;
        search();
        if (!news_ || s_.open < HUGE_VAL) return;
        const uint64_t once = found;
        farther_ = kFineShare;
        search();
        found = once;
    }

private:
    HeightSearch& s_;
    const LastContacts& last_;
    const double margin_;
    const PlacedHalfSpace touched_; // blown up by the margin
    // A triangle touches if a corner is no higher than kSeparationMargin (reach of the triangle, and of the plane): up
    // to here all do, whatever the triangle, and above this none.
    const double surely_, highest_;

public:
    const double same_point;
    Patch patch;
    uint64_t found = 0;
    bool meets = false;

private:
    // All of them, if the body is a mesh of few corners. False, and nothing is done, if it is not, the budget does not
    // suffice, or rounding leaves open which corners touch.
    bool take_all() {
        const TreeView& tree = s_.side.tree;
        const uint32_t corners = tree.vertex_count(), triangles = tree.triangle_count();
        if (corners == 0 || corners > kFewCorners || triangles > 2 * kFewCorners || s_.side.limit_from != UINT32_MAX ||
            triangles > s_.left())
            return false;
        dvec3 at[kFewCorners];
        uint64_t touch = 0, used = 0; // bits of corners; used by triangles
        for (uint32_t v = 0; v < corners; ++v) {
            at[v] = position(tree, v);
            const double over = height(at[v], touched_);
            if (over > surely_ && over <= highest_) return false;
            touch |= uint64_t{over <= surely_} << v;
        }
        s_.stats.triangle_tests += triangles;
        for (uint32_t t = 0; t < triangles && (touch & ~used) != 0; ++t)
            for (const uint32_t v : tree.triangle(t)) used |= uint64_t{1} << v;
        for (touch &= used; touch != 0; touch &= touch - 1) {
            const auto v = static_cast<uint32_t>(std::countr_zero(touch));
            add(at[v], kVertexId | v);
        }
        return true;
    }
    // The corners that touched in the last query, if they still do: most are what would be found.
    void take_known() {
        const TreeView& tree = s_.side.tree;
        if (s_.side.limit_from != UINT32_MAX) return; // nodes stand for corners
        last_.for_each_id([&](uint64_t id) {
            const auto v = static_cast<uint32_t>(id);
            if (v >= tree.vertex_count() || id != (kVertexId | v)) return;
            const dvec3 p = position(tree, v);
            if (height(p, touched_) <= surely_) add(p, id);
        });
    }
    // Looks for what lies deeper, or farther out along the longest line between two points and across it.
    void search() {
        turn();
        if (!patch.empty()) know();
        std::fill(std::begin(seen_), std::end(seen_), kNoTriangle);
        traverse(s_);
    }
    void turn() {
        const Candidate* all[Patch::kSieve];
        const uint32_t count = patch.empty() ? 0 : patch.kept(all);
        dvec3 longest(0);
        for (uint32_t i = 0; i < count; ++i)
            for (uint32_t k = 0; k < i; ++k)
                if (const dvec3 line = all[i]->middle - all[k]->middle;
                    glm::dot(line, line) > glm::dot(longest, longest))
                    longest = line;
        if (!(glm::length(longest) > same_point)) return;
        Patch turned(-s_.shape.normal, longest, kLean);
        for (uint32_t i = 0; i < count; ++i) turned.add(all[i]->normal, *all[i], 1, all[i]->depth, same_point);
        patch = turned;
    }
    bool leaf(uint32_t slot) {
        const TreeView& tree = s_.side.tree;
        const TriangleRange range = tree.triangles(slot);
        if (std::max(range.count, 1u) > s_.left()) return false;
        s_.stats.triangle_tests += std::max(range.count, 1u);
        if (range.count == 0) {
            const PlacedEllipsoid e = place(tree.bound(slot), tree.scale());
            if (!separated(e, touched_)) add(lowest_point(e, s_.shape.normal), kNodeId | slot);
        }
        for (uint32_t t = range.first; t < range.first + range.count; ++t) {
            const Triangle corners = tree.triangle(t);
            std::optional<double> rounding; // of the triangle, if it matters
            for (const uint32_t v : corners) {
                uint32_t& seen = seen_[v % std::size(seen_)];
                if (seen == v) continue;
                const dvec3 p = position(tree, v);
                const double over = height(p, touched_);
                if (over > highest_) continue;
                if (over > surely_) {
                    if (!rounding) rounding = kSeparationMargin * (place(tree, t).reach + touched_.reach);
                    if (over > *rounding) continue;
                }
                seen = v;
                add(p, kVertexId | v);
            }
        }
        return true;
    }
    void add(const dvec3& p, uint64_t id) {
        const double depth = -height(p, s_.shape);
        ++found, meets = true;
        if (!patch.may_take(p, depth, same_point)) return;
        const dvec3 n = -s_.shape.normal;
        const bool takes = patch.add(n,
                                     {.middle = p - 0.5 * depth * n,
                                      .depth = depth,
                                      .id = id,
                                      .known = last_.knows(id, n),
                                      .normal = n,
                                      .pair = {}},
                                     1, depth, same_point);
        if (takes && s_.outline != nullptr) news_ = true, know();
    }
    // Tells the traversal what the patch has.
    void know() {
        const LatticeInfo& lattice = s_.side.lattice;
        const double per_step = steps_per_metre(lattice);
        const std::array<dvec3, 4> directions = patch.directions();
        below_ = patch.depth() + std::max(kSameDepth * std::abs(patch.depth()), same_point);
        outline_.below = static_cast<float>(below_ * per_step);
        for (uint32_t i = 0; i < 2; ++i) {
            const dvec3& d = ways_[i] = directions[i];
            const Extent known = patch.extent(i);
            const double same = std::max(same_point, farther_ * (known.high - known.low - 2 * kLean * patch.depth()));
            beyond_[i] = known.high + same, beyond_[2 + i] = same - known.low;
            const double origin = d.x * lattice.origin[0] + d.y * lattice.origin[1] + d.z * lattice.origin[2];
            for (glm::length_t k = 0; k < 3; ++k) outline_.directions[i][k] = static_cast<float>(d[k]);
            outline_.beyond[i] = static_cast<float>(beyond_[i] * per_step - origin);
            outline_.beyond[2 + i] = static_cast<float>(beyond_[2 + i] * per_step + origin);
        }
        outline_.lean = kLean;
        ++outline_.version;
    }
    bool wanted(uint32_t slot, double bound) const {
        if (patch.empty() || -bound > below_) return true;
        const PlacedEllipsoid e = place(s_.side.tree.bound(slot), s_.side.tree.scale());
        for (uint32_t i = 0; i < 2; ++i) {
            const double middle = glm::dot(ways_[i], e.center), half = glm::length(ways_[i] * e.factor);
            if (std::max(middle + half - beyond_[i], half - middle - beyond_[2 + i]) - kLean * bound > 0) return true;
        }
        return false;
    }

    double farther_ = kCoarseShare;
    bool news_ = false; // since the known
    // What is of interest lies deeper, or along ways_ and against them farther out than this.
    double below_ = 0, beyond_[4] = {};
    dvec3 ways_[2];
    HeightOutline outline_;
    uint32_t seen_[16]; // corners that were added last: most belong to several triangles
};

} // namespace
} // namespace query

namespace {

DistanceResult of_core(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                       const DistanceOptions& options) {
    DistanceResult out;
    const query::RelativePose to_world = query::world_pose(pose);
    const query::PlacedHalfSpace shape = query::place(half_space, to_world, 0);
    if (!query::is_finite(shape)) return out;
    query::HeightSearch search(tree, shape, context, {.max_pair_tests = options.max_pair_tests});
    search.limit = query::sound_length(options.max_distance);
    query::Lowest lowest(search);
    query::traverse(search);
    out.stats = search.stats;
    out.stats.deepest_level = search.side.deepest_level();
    const double cut = std::min(lowest.lower, query::sound_length(options.max_distance));
    out.lower = std::max(0.0, std::min(cut, search.open));
    if (lowest.height < HUGE_VAL)
        out.upper = std::max(0.0, lowest.meets ? lowest.height : lowest.height + lowest.slack);
    if (lowest.meets)
        out.verdict = Verdict::overlapping, out.lower = 0;
    else if (out.lower > 0)
        out.verdict = Verdict::separated;
    const auto world = [&](const glm::dvec3& p) {
        return query::to_float(to_world.rotation * p + to_world.translation);
    };
    out.pair = lowest.pair;
    out.point_a = world(lowest.point);
    out.point_b = world(lowest.point - std::max(0.0, lowest.height) * shape.normal);
    if (out.upper > 0) out.normal = query::to_float(to_world.rotation * -shape.normal);
    return out;
}

} // namespace

DistanceResult distance(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                        const DistanceOptions& options) noexcept {
    if (!query::suffices(context, tree)) return {};
    const double radius = tree.radius();
    if (!(radius > 0)) return of_core(tree, pose, half_space, context, options);
    DistanceOptions limits = options;
    limits.max_distance = query::sound_length(options.max_distance) + radius;
    DistanceResult out = of_core(tree, pose, half_space, context, limits);
    query::round_distance(out, tree.radius(), 0, options,
                          [&](const QueryOptions& o) { return overlap(tree, pose, half_space, context, o); });
    return out;
}

ContactResult contacts(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, ContactManifolds& manifolds,
                       Scratch context, const QueryOptions& query_options) noexcept {
    QueryOptions options = query::sound(query_options);
    options.margin = query::with_radius(options.margin, tree.radius());
    const query::RelativePose to_world = query::world_pose(pose);
    const query::PlacedHalfSpace shape = query::place(half_space, to_world, 0);
    const query::LastContacts last(manifolds, false, to_world);
    std::fill_n(manifolds.manifolds, std::min(manifolds.count, kManifolds), Manifold{});
    manifolds.count = 0;
    ContactResult out;
    if (!query::suffices(context, tree)) return out;
    if (!query::is_finite(shape) || !std::isfinite(options.margin)) {
        out.verdict = Verdict::overlapping; // as overlap() has it; there is no place for points
        return out;
    }
    query::HeightSearch search(tree, shape, context, options);
    query::Touching touching(search, options.margin, last);
    touching.find();
    out.found = touching.found;
    out.stats = search.stats;
    out.stats.deepest_level = search.side.deepest_level();
    if (touching.meets)
        out.verdict = Verdict::overlapping;
    else if (!(search.open < HUGE_VAL))
        out.verdict = Verdict::separated;
    if (touching.patch.empty()) return out;
    manifolds.count = 1;
    manifolds.manifolds[0] = query::manifold_of(touching.patch, touching.same_point, false, to_world);
    last.hand_on(manifolds.manifolds[0]);
    if (tree.radius() > 0) query::round_contacts(manifolds, tree.radius(), 0);
    return out;
}

} // namespace prolate

// contacts() of a body and a half-space: the traversal (search.cpp) finds all that lies in the half-space; corners and
// ellipsoids are placed in double precision, and are told apart from the plane as separated() of query/shapes does.
//
// Of a body of few corners, all are looked at, without the tree.
//
// Else a node is passed over if nothing in it lies deeper than what is known, or farther out along the longest line
// between two known points and across it. The search begins with the points of the last query, which most often are the
// answer: a body at rest costs a few nodes more than the verdict. If it finds others, it goes on from these for what
// lies only a little farther out, so that what rests has the corners of its outline.
#include <prolate/half_space.hpp>

#include "query/contacts/manifold.hpp"
#include "query/half_space/lowest.hpp"
#include "query/half_space/search.hpp"
#include "query/node/scratch.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

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
constexpr int kFewTouch = 8;         // of more, the search finds the outermost sooner, from those of the last query
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

// What the last query knew: ids of points, with their ages and impulses.
class KnownPoints {
public:
    // Copies the points of manifolds that have about this normal, in the world.
    KnownPoints(const ContactManifolds& last, const glm::dvec3& normal) noexcept {
        constexpr double kSameNormal = 0.8; // cosine
        for (uint32_t i = 0; i < std::min(last.count, kManifolds); ++i) {
            const Manifold& manifold = last.manifolds[i];
            if (!(glm::dot(to_double(manifold.normal), normal) > kSameNormal)) continue;
            for (uint32_t k = 0; k < std::min(manifold.count, kManifoldPoints); ++k) {
                const ContactPoint& p = manifold.points[k];
                points_[count_++] = {p.id, p.age, {p.impulse[0], p.impulse[1], p.impulse[2]}};
            }
        }
    }

    bool has(uint64_t id) const noexcept {
        return std::any_of(points_, points_ + count_, [&](const Point& p) { return p.id == id; });
    }
    // Calls visit(id) for each point.
    template <class Visit> void for_each_id(Visit&& visit) const {
        for (uint32_t i = 0; i < count_; ++i) visit(points_[i].id);
    }
    // Gives a point that was known the age and the impulse that it had.
    void hand_on(ContactPoint& to) const noexcept {
        const Point* const p = std::find_if(points_, points_ + count_, [&](const Point& q) { return q.id == to.id; });
        if (p == points_ + count_) return;
        to.age = p->age + 1;
        std::copy_n(p->impulse, 3, to.impulse);
    }

private:
    struct Point {
        uint64_t id;
        uint32_t age;
        float impulse[3];
    };
    uint32_t count_ = 0;
    Point points_[kManifolds * kManifoldPoints];
};

// What is asked, in the tree's frame.
struct Ground {
    const TreeView& tree;
    const PlacedHalfSpace plane, touched; // touched: blown up by the margin
    const KnownPoints& known;
    // A triangle touches if a corner is no higher than kSeparationMargin (reach of the triangle, and of the plane): up
    // to here over `touched` all do, whatever the triangle.
    const double surely = kSeparationMargin * touched.reach;

    double same_point() const { return kSamePoint * place(tree.root(), tree.scale()).size; }
};

// The points of the manifold.
struct Footprint {
    struct Point {
        dvec3 at; // of the body
        double depth;
        uint64_t id;
    };
    Point points[kManifoldPoints];
    uint32_t count = 0;

    void add(const Point& p) { points[count++] = p; }
};

// All points that touch, sieved.
class Touching {
public:
    explicit Touching(const Ground& ground)
        : ground_(ground), same_point(ground.same_point()),
          patch(-ground.plane.normal, beside(ground.plane.normal), kLean) {}

    // True if the point is kept.
    bool add(const dvec3& p, uint64_t id) {
        const double depth = -height(p, ground_.plane);
        ++found;
        if (!patch.may_take(p, depth, same_point)) return false;
        const dvec3 n = -ground_.plane.normal;
        return patch.add(n,
                         {.middle = p - 0.5 * depth * n,
                          .depth = depth,
                          .id = id,
                          .known = ground_.known.has(id),
                          .normal = n,
                          .pair = {}},
                         1, depth, same_point);
    }
    // Measures from now on along the longest line between two points, and across it.
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
        Patch turned(-ground_.plane.normal, longest, kLean);
        for (uint32_t i = 0; i < count; ++i) turned.add(all[i]->normal, *all[i], 1, all[i]->depth, same_point);
        patch = turned;
    }
    Footprint reduced() const {
        Footprint out;
        if (patch.empty()) return out;
        const Candidate* best[kManifoldPoints];
        const dvec3 n = -ground_.plane.normal;
        const uint32_t count = patch.reduce(n, same_point, best);
        for (uint32_t i = 0; i < count; ++i)
            out.add({best[i]->middle + 0.5 * best[i]->depth * n, best[i]->depth, best[i]->id});
        return out;
    }

private:
    const Ground& ground_;

public:
    const double same_point;
    Patch patch;
    uint64_t found = 0;
};

// All that touches of a mesh of few corners: if there are four or fewer, they are the manifold. False, and nothing is
// done, if the body is none, many touch, the budget does not suffice, or rounding leaves open which corners do.
bool touch_few(const Ground& ground, const QueryOptions& options, Footprint& out, ContactResult& result) {
    const TreeView& tree = ground.tree;
    const uint32_t corners = tree.vertex_count(), triangles = tree.triangle_count();
    if (corners == 0 || corners > kFewCorners || triangles > 2 * kFewCorners ||
        options.max_level < tree.level_count() - 1 || triangles > options.max_pair_tests)
        return false;
    dvec3 at[kFewCorners];
    uint64_t touch = 0, used = 0;        // bits of corners; used by triangles
    double lowest = HUGE_VAL, reach = 0; // of what does not surely touch; squared
    for (uint32_t v = 0; v < corners; ++v) {
        at[v] = position(tree, v);
        reach = std::max(reach, glm::dot(at[v], at[v]));
        const double over = height(at[v], ground.touched);
        if (over > ground.surely)
            lowest = std::min(lowest, over);
        else
            touch |= uint64_t{1} << v;
    }
    if (lowest <= kSeparationMargin * (2 * std::sqrt(reach) + ground.touched.reach)) return false;
    if (std::popcount(touch) > kFewTouch) return false;
    for (uint32_t t = 0; t < triangles && (touch & ~used) != 0; ++t)
        for (const uint32_t v : tree.triangle(t)) used |= uint64_t{1} << v;
    touch &= used;
    result.stats.triangle_tests = triangles;
    result.found = static_cast<uint64_t>(std::popcount(touch));
    result.verdict = touch != 0 ? Verdict::overlapping : Verdict::separated;
    const auto for_each = [&](auto&& visit) {
        for (; touch != 0; touch &= touch - 1) {
            const auto v = static_cast<uint32_t>(std::countr_zero(touch));
            visit(at[v], kVertexId | v);
        }
    };
    if (result.found <= kManifoldPoints) {
        for_each([&](const dvec3& p, uint64_t id) { out.add({p, -height(p, ground.plane), id}); });
        return true;
    }
    Touching touching(ground);
    for_each([&](const dvec3& p, uint64_t id) { touching.add(p, id); });
    out = touching.reduced();
    return true;
}

// Looks for what touches in the tree.
class TouchSearch {
public:
    TouchSearch(const Ground& ground, Scratch context, const QueryOptions& options)
        : ground_(ground), s_(ground.tree, ground.plane, context, options), touching_(ground),
          highest_(kSeparationMargin *
                   (2 * place(ground.tree.root_bound(), ground.tree.scale()).reach + ground.touched.reach)) {
        s_.user = this;
        s_.leaf = [](void* self, uint32_t slot) { return static_cast<TouchSearch*>(self)->leaf(slot); };
        s_.wanted = [](void* self, uint32_t slot, double bound) {
            return static_cast<TouchSearch*>(self)->wanted(slot, bound);
        };
        s_.outline = &outline_;
        s_.limit = double{options.margin} + 2 * highest_; // corners that are higher do not touch
    }

    Footprint run(ContactResult& result) {
        take_known();
        news_ = false;
        search();
        result.found = touching_.found;
        if (news_ && s_.passed_over && s_.open == HUGE_VAL) {
            farther_ = kFineShare;
            search();
        }
        result.stats = s_.stats;
        result.stats.deepest_level = s_.side.deepest_level();
        if (touching_.found > 0)
            result.verdict = Verdict::overlapping;
        else if (!(s_.open < HUGE_VAL))
            result.verdict = Verdict::separated;
        return touching_.reduced();
    }

private:
    // The corners that touched in the last query, if they still do: most are what would be found.
    void take_known() {
        const TreeView& tree = s_.side.tree;
        if (s_.side.limit_from != UINT32_MAX) return; // nodes stand for corners
        ground_.known.for_each_id([&](uint64_t id) {
            const auto v = static_cast<uint32_t>(id);
            if (v >= tree.vertex_count() || id != (kVertexId | v)) return;
            const dvec3 p = position(tree, v);
            if (height(p, ground_.touched) <= ground_.surely) touching_.add(p, id);
        });
    }
    // Looks for what lies deeper, or farther out along the longest line between two points and across it.
    void search() {
        touching_.turn();
        if (!touching_.patch.empty()) know();
        std::fill(std::begin(seen_), std::end(seen_), kNoTriangle);
        traverse(s_);
    }
    bool leaf(uint32_t slot) {
        const TreeView& tree = s_.side.tree;
        const TriangleRange range = tree.triangles(slot);
        if (std::max(range.count, 1u) > s_.left()) return false;
        s_.stats.triangle_tests += std::max(range.count, 1u);
        if (range.count == 0) {
            const PlacedEllipsoid e = place(tree.bound(slot), tree.scale());
            if (!separated(e, ground_.touched)) add(lowest_point(e, s_.shape.normal), kNodeId | slot);
        }
        for (uint32_t t = range.first; t < range.first + range.count; ++t) {
            std::optional<double> rounding; // of the triangle, if it matters
            for (const uint32_t v : tree.triangle(t)) {
                uint32_t& seen = seen_[v % std::size(seen_)];
                if (seen == v) continue;
                const dvec3 p = position(tree, v);
                const double over = height(p, ground_.touched);
                if (over > ground_.surely && over <= highest_) {
                    if (!rounding) rounding = kSeparationMargin * (place(tree, t).reach + ground_.touched.reach);
                    if (over > *rounding) continue; // another triangle of the corner may touch
                }
                seen = v;
                if (!(over > highest_)) add(p, kVertexId | v);
            }
        }
        return true;
    }
    void add(const dvec3& p, uint64_t id) {
        if (touching_.add(p, id)) news_ = true, know();
    }
    // Tells the traversal what the patch has.
    void know() {
        const LatticeInfo& lattice = s_.side.lattice;
        const Patch& patch = touching_.patch;
        const double per_step = steps_per_metre(lattice);
        const std::array<dvec3, 4> directions = patch.directions();
        below_ = patch.depth() + std::max(kSameDepth * std::abs(patch.depth()), touching_.same_point);
        outline_.below = static_cast<float>(below_ * per_step);
        for (uint32_t i = 0; i < 2; ++i) {
            const dvec3& d = ways_[i] = directions[i];
            const Extent known = patch.extent(i);
            const double same =
                std::max(touching_.same_point, farther_ * (known.high - known.low - 2 * kLean * patch.depth()));
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
        if (touching_.patch.empty() || -bound > below_) return true;
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
    uint32_t seen_[64]; // corners that were added last: most belong to several triangles
    const Ground& ground_;
    HeightSearch s_;
    Touching touching_;
    const double highest_; // over `touched`: above this no corner touches, whatever its triangle
};

Manifold to_manifold(Footprint& footprint, const Ground& ground, const RelativePose& to_world) {
    Footprint::Point* const points = footprint.points;
    for (uint32_t k = 1; k < footprint.count; ++k) // by id
        for (uint32_t at = k; at > 0 && points[at].id < points[at - 1].id; --at) std::swap(points[at], points[at - 1]);
    const dvec3 normal = -(to_world.rotation * ground.plane.normal);
    Manifold out;
    out.normal = to_float(normal);
    out.count = footprint.count;
    for (uint32_t k = 0; k < footprint.count; ++k) {
        const dvec3 at = to_world.rotation * points[k].at + to_world.translation;
        ContactPoint& p = out.points[k];
        p.point_a = to_float(at), p.point_b = to_float(at - points[k].depth * normal);
        p.depth = static_cast<float>(points[k].depth);
        p.id = points[k].id;
        ground.known.hand_on(p);
    }
    return out;
}

} // namespace
} // namespace query

ContactResult contacts(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, ContactManifolds& manifolds,
                       Scratch context, const QueryOptions& query_options) noexcept {
    QueryOptions options = query::sound(query_options);
    options.margin = query::with_radius(options.margin, tree.radius());
    const query::RelativePose to_world = query::world_pose(pose);
    const query::PlacedHalfSpace plane = query::place(half_space, to_world, 0);
    const query::KnownPoints known(manifolds, -(to_world.rotation * plane.normal));
    std::fill_n(manifolds.manifolds, std::min(manifolds.count, kManifolds), Manifold{});
    manifolds.count = 0;
    ContactResult out;
    if (!query::suffices(context, tree)) return out;
    if (!query::is_finite(plane) || !std::isfinite(options.margin)) {
        out.verdict = Verdict::overlapping; // as overlap() has it; there is no place for points
        return out;
    }
    const query::Ground ground{tree, plane, query::moved(plane, options.margin), known};
    query::Footprint footprint;
    if (!query::touch_few(ground, options, footprint, out))
        footprint = query::TouchSearch(ground, context, options).run(out);
    if (footprint.count == 0) return out;
    manifolds.count = 1;
    manifolds.manifolds[0] = query::to_manifold(footprint, ground, to_world);
    if (tree.radius() > 0) query::round_contacts(manifolds, tree.radius(), 0);
    return out;
}

} // namespace prolate

// Shapes against leaves, placed to touch or nearly so; against the lanes of blocks; against trees and all their leaves.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/query/shapes/shapes_test.cpp"
#include "query/simd/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/shapes/lanes-inl.hpp"

#include "query/inside/inside.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/query/blocks.hpp"
#include "tests/query/lane_references.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/shapes.hpp>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

template <class Shape>
void block_gaps(const std::byte* block, int32_t step_exponent, const Shape& shape, ShapeGap* out) {
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneGaps gaps = shape_gaps(load_nodes(block, i, step_exponent), shape);
        float gap[kBlockLanes], key[kBlockLanes];
        store_unaligned(gaps.gap, gap), store_unaligned(gaps.key, key);
        for (size_t k = 0; k < kFloatLanes; ++k) out[i + k] = {gap[k], key[k]};
    }
}
void box_gaps(const std::byte* block, int32_t step_exponent, const LaneRoundedBox& box, ShapeGap* out) {
    block_gaps(block, step_exponent, box, out);
}
void half_space_gaps(const std::byte* block, int32_t step_exponent, const LaneHalfSpace& half_space, ShapeGap* out) {
    block_gaps(block, step_exponent, half_space, out);
}
uint32_t boxes_met(const std::byte* block, const LaneRoundedBox& box) {
    return boxes_meet_shape(block, box);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(box_gaps);
HWY_EXPORT(half_space_gaps);
HWY_EXPORT(boxes_met);
} // namespace prolate::query

namespace prolate {
namespace {

using glm::dmat3;
using glm::dvec3;
using query::PlacedHalfSpace;
using query::RoundedBox;
using reference::along;
using reference::Matrix;
using reference::Real;
using reference::Vector;
using reference::operator*;
using reference::operator-;
using scenes::Point;
using scenes::Random;

Vector unit(const Vector& v) {
    const Real length = std::sqrt(reference::dot(v, v));
    return {v[0] / length, v[1] / length, v[2] / length};
}
Vector vector(const dvec3& v) {
    return {v.x, v.y, v.z};
}
dvec3 rounded(const Vector& v) {
    return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}
Vector direction(Random& random) {
    const Point d = random.direction();
    return {d[0], d[1], d[2]};
}

Real distance(const RoundedBox& box, const Vector& p) { // of a point from the box's surface, negative inside the radius
    const Vector r = p - vector(box.center);
    Real sum = 0;
    for (glm::length_t i = 0; i < 3; ++i) {
        const Real out = std::abs(reference::dot(vector(box.axes[i]), r)) - box.half[i];
        if (out > 0) sum += out * out;
    }
    return std::sqrt(sum) - box.radius;
}

// A sphere, capsule, box or rounded box of about `size`, turned anyhow, or so that a face or an edge looks along n.
RoundedBox shape(Random& random, double size, const Vector& n) {
    RoundedBox box{};
    const uint32_t kind = random.below(4);
    box.radius = kind == 2 ? 0 : size * random.log_in(1e-3, 1);
    for (glm::length_t i = 0; i < 3; ++i) box.half[i] = size * random.log_in(1e-3, 1);
    if (kind == 0) box.half = dvec3(0);
    if (kind == 1) box.half.y = box.half.z = 0;
    const Vector other = direction(random);
    const Vector u = random.below(2) == 0 ? n : direction(random), v = unit(reference::cross(u, other)),
                 w = reference::cross(u, v);
    const auto i = static_cast<glm::length_t>(random.below(3));
    box.axes[i] = rounded(u), box.axes[(i + 1) % 3] = rounded(v), box.axes[(i + 2) % 3] = rounded(w);
    return box;
}
// Moves the box so that it begins, along n, at the point: its first point along n there (or another of a face).
void begin_at(RoundedBox& box, Random& random, const Vector& point, const Vector& n) {
    Vector first{};
    for (glm::length_t i = 0; i < 3; ++i) {
        const Vector axis = vector(box.axes[i]);
        const Real slope = reference::dot(axis, n);
        const Real at = std::abs(slope) < 1e-12L ? random.in(-1, 1) : slope > 0 ? -1 : 1;
        first = along(first, at * box.half[i], axis);
    }
    first = along(first, -box.radius, n);
    box.center = rounded(point - first);
    box.reach = glm::length(box.center) + box.half.x + box.half.y + box.half.z + box.radius;
}

struct Counts {
    int cases = 0, apart = 0, meet = 0, wrong = 0, missed = 0;
};

// Gaps +-1e-2 ... 1e-13 of the size; what is farther apart than `tolerance` sizes must be told.
Counts hunt_ellipsoids(uint64_t seed, int count, double ratio, double tolerance, double margin) {
    Random random(seed);
    Counts counts;
    for (int k = 0; k < count; ++k) {
        const Ellipsoid e = scenes::ellipsoid(random.in_ball(), scenes::radii(random, ratio), random.rotation());
        const Matrix l = scenes::factor_of(e);
        const Vector n = direction(random), m = reference::transposed(l) * n,
                     x = along({e.center.x, e.center.y, e.center.z}, 1, l * unit(m));
        const Real gap = random.log_in(1e-13, 1e-2) * (random.below(2) == 0 ? 1 : -1);
        RoundedBox box = shape(random, random.log_in(1e-2, 10), n);
        const Vector touch = along(x, gap, n);
        begin_at(box, random, touch, n);
        const Vector y = reference::inverse(l) * (touch - Vector{e.center.x, e.center.y, e.center.z});
        const bool meets = reference::dot(y, y) < 1 - 1e-17L && distance(box, touch) <= 1e-15L;
        const bool apart = query::separated(query::place(e), box, margin);
        ++counts.cases, counts.apart += apart, counts.meet += meets;
        counts.wrong += apart && (meets || distance(box, x) < 0);
        counts.missed += !apart && gap > tolerance;
    }
    return counts;
}

TEST(RoundedBoxes, AgainstEllipsoids) {
    for (const auto& [ratio, tolerance] : {std::pair{3.0, 1e-10}, {50.0, 1e-9}, {1000.0, 1e-8}}) {
        const Counts c = hunt_ellipsoids(1, 20'000, ratio, tolerance, query::kSeparationMargin);
        EXPECT_EQ(c.wrong, 0) << ratio;
        EXPECT_EQ(c.missed, 0) << ratio;
        EXPECT_GT(c.apart, c.cases / 4) << ratio;
        EXPECT_GT(c.meet, c.cases / 10) << ratio;
    }
    EXPECT_GT(hunt_ellipsoids(1, 20'000, 3, 1, -64 * query::kSeparationMargin).wrong, 0);
}

Counts hunt_triangles(uint64_t seed, int count, double tolerance, double margin) {
    Random random(seed);
    Counts counts;
    for (int k = 0; k < count; ++k) {
        Vec3 corner[3];
        Vector c[3];
        query::PlacedTriangle triangle{};
        const double sliver = random.below(2) == 0 ? 1 : random.log_in(1e-6, 1);
        const Point a = random.in_ball(), b = random.in_ball(), x = random.in_ball();
        for (size_t i = 0; i < 3; ++i) {
            const double t = i == 1 ? 1 : i == 2 ? 0.5 : 0, u = i == 2 ? sliver : 0;
            corner[i] = scenes::to_float({a[0] + t * (b[0] - a[0]) + u * x[0], a[1] + t * (b[1] - a[1]) + u * x[1],
                                          a[2] + t * (b[2] - a[2]) + u * x[2]});
            triangle.corner[i] = {corner[i].x, corner[i].y, corner[i].z};
            triangle.reach = std::max(triangle.reach, glm::length(triangle.corner[i]));
            c[i] = vector(triangle.corner[i]);
        }
        // A corner, an edge or the face farthest along n, and a point of it.
        Vector n = direction(random);
        const uint32_t kind = random.below(3);
        if (kind == 0) n = unit(reference::cross(c[1] - c[0], c[2] - c[0]));
        if (kind == 1) n = unit(reference::cross(c[1] - c[0], n));
        if (kind == 1 && reference::dot(n, c[2] - c[0]) > 0) n = {-n[0], -n[1], -n[2]};
        Vector at = c[0];
        for (size_t i = 1; i < 3; ++i)
            if (kind == 2 && reference::dot(n, c[i] - at) > 0) at = c[i];
        if (kind < 2) at = along(at, random.in(0, kind == 0 ? 0.5 : 1), c[1] - c[0]);
        if (kind == 0) at = along(at, random.in(0, 0.5), c[2] - c[0]);
        const Real gap = random.log_in(1e-13, 1e-2) * (random.below(2) == 0 ? 1 : -1);
        RoundedBox box = shape(random, random.log_in(1e-2, 10), n);
        begin_at(box, random, along(at, gap, n), n);
        const bool meets = distance(box, at) < 0, apart = query::separated(triangle, box, margin);
        ++counts.cases, counts.apart += apart, counts.meet += meets;
        counts.wrong += apart && meets;
        counts.missed += !apart && gap > tolerance;
    }
    return counts;
}

TEST(RoundedBoxes, AgainstTriangles) {
    const Counts c = hunt_triangles(2, 50'000, 1e-11, query::kSeparationMargin);
    EXPECT_EQ(c.wrong, 0);
    EXPECT_EQ(c.missed, 0);
    EXPECT_GT(c.apart, c.cases / 4);
    EXPECT_GT(c.meet, c.cases / 10);
    EXPECT_GT(hunt_triangles(2, 20'000, 1, -64 * query::kSeparationMargin).wrong, 0);
}

// ---- lanes ----

Counts hunt_lanes(uint64_t seed, int count, double ratio, double slack_factor) {
    Random random(seed);
    Counts counts;
    for (int k = 0; k < count; ++k) {
        const scenes::Block block = scenes::block(random, ratio);
        const uint32_t lane = random.below(kBlockLanes);
        const Ellipsoid& e = block.ellipsoids[lane];
        const Matrix l = scenes::factor_of(e);
        const Vector n = direction(random), m = reference::transposed(l) * n,
                     center{e.center.x, e.center.y, e.center.z}, x = along(center, 1, l * unit(m));
        const double size = std::ldexp(65536, block.lattice.step_exponent);
        const Real gap = size * random.log_in(1e-9, 1e-2) * (random.below(2) == 0 ? 1 : -1);
        RoundedBox box = shape(random, size * random.log_in(1e-3, 1), n);
        const Vector touch = along(x, gap, n);
        begin_at(box, random, touch, n);
        const Vector y = reference::inverse(l) * (touch - center);
        const bool meets = (reference::dot(y, y) < 1 && distance(box, touch) < 1e-15L * size) || distance(box, x) < 0;
        query::LaneRoundedBox lanes = query::lane_rounded_box(box, block.lattice);
        lanes.slack *= static_cast<float>(slack_factor);
        query::ShapeGap gaps[kBlockLanes];
        const std::byte* const bytes = block.bytes.data();
        {
            using namespace query;
            HWY_DYNAMIC_DISPATCH(box_gaps)(bytes, block.lattice.step_exponent, lanes, gaps);
        }
        uint32_t boxes = 0;
        {
            using namespace query;
            boxes = HWY_DYNAMIC_DISPATCH(boxes_met)(bytes, lanes);
        }
        ++counts.cases, counts.meet += meets, counts.apart += gaps[lane].gap > 0;
        counts.wrong += meets && (gaps[lane].gap > 0 || (boxes >> lane & 1) == 0);

        // The half-space that begins at the same point.
        const PlacedHalfSpace half_space{rounded({-n[0], -n[1], -n[2]}), static_cast<double>(-reference::dot(n, touch)),
                                         static_cast<double>(std::sqrt(reference::dot(touch, touch)))};
        query::LaneHalfSpace plane = query::lane_half_space(half_space, block.lattice);
        plane.slack *= static_cast<float>(slack_factor);
        {
            using namespace query;
            HWY_DYNAMIC_DISPATCH(half_space_gaps)(bytes, block.lattice.step_exponent, plane, gaps);
        }
        counts.wrong += gap < 0 && gaps[lane].gap > 0;
        counts.missed += gap > 1e-4 * size && !(gaps[lane].gap > 0);
    }
    return counts;
}

TEST(ShapeLanes, NeverPartWhatMeets) {
    for (const double ratio : {3.0, 50.0, 1000.0}) {
        const Counts c = hunt_lanes(3, 20'000, ratio, 1);
        EXPECT_EQ(c.wrong, 0) << ratio;
        EXPECT_EQ(c.missed, 0) << ratio;
        EXPECT_GT(c.meet, c.cases / 10) << ratio;
        EXPECT_GT(c.apart, c.cases / 20) << ratio;
    }
    EXPECT_GT(hunt_lanes(3, 5'000, 50, -1).wrong, 0);
    EXPECT_GT(hunt_lanes(3, 5'000, 50, -8).wrong, 10);
}

TEST(ShapeLanes, SameBitsOnEveryTargetAndInPlainCode) {
    using namespace query;
    targets::for_each([&](const char* name) {
        Random random(4);
        for (int k = 0; k < 2'000; ++k) {
            scenes::Block block = scenes::block(random, 100);
            const double size = std::ldexp(65536, block.lattice.step_exponent);
            RoundedBox box = shape(random, size, direction(random));
            const Vec3 at = block.ellipsoids[random.below(kBlockLanes)].center;
            begin_at(box, random, {at.x, at.y, at.z}, direction(random));
            if (k % 4 == 0) // also what no builder writes: any bytes at all
                for (std::byte& x : block.bytes) x = static_cast<std::byte>(random.next());
            const LaneRoundedBox lanes = lane_rounded_box(box, block.lattice);
            const LaneHalfSpace plane = lane_half_space({box.axes[0], box.center.x, box.reach}, block.lattice);
            ShapeGap gaps[kBlockLanes], plane_gaps[kBlockLanes];
            const int32_t step = block.lattice.step_exponent;
            HWY_DYNAMIC_DISPATCH(box_gaps)(block.bytes.data(), step, lanes, gaps);
            HWY_DYNAMIC_DISPATCH(half_space_gaps)(block.bytes.data(), step, plane, plane_gaps);
            const auto same = [](float x, float y) {
                return std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(y) || (std::isnan(x) && std::isnan(y));
            };
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const ShapeGap expected = shape_gap(block.bytes.data(), lane, step, lanes);
                ASSERT_TRUE(same(expected.gap, gaps[lane].gap) && same(expected.key, gaps[lane].key))
                    << name << ' ' << k;
                const ShapeGap plane_expected = shape_gap(block.bytes.data(), lane, step, plane);
                ASSERT_TRUE(same(plane_expected.gap, plane_gaps[lane].gap) &&
                            same(plane_expected.key, plane_gaps[lane].key))
                    << name << ' ' << k;
            }
        }
    });
}

// ---- trees ----

QueryContext& context() {
    static const auto one = std::make_unique<QueryContext>();
    return *one;
}

struct AnyShape {
    std::function<OverlapResult(const TreeView&, const Pose&, const QueryOptions&)> ask;
    std::function<bool(const query::PlacedTriangle&, const Pose&, double)> misses_triangle;
    std::function<bool(const query::PlacedEllipsoid&, const Pose&, double)> misses_ellipsoid;
    bool bounded;
    std::function<RoundedBox(const Pose&, double)> place;
};
template <class Shape> AnyShape any(const Shape& s) {
    AnyShape out;
    out.ask = [s](const TreeView& tree, const Pose& pose, const QueryOptions& options) {
        return overlap(tree, pose, s, context(), options);
    };
    out.misses_triangle = [s](const query::PlacedTriangle& t, const Pose& pose, double margin) {
        return query::separated(t, query::place(s, pose, margin));
    };
    out.misses_ellipsoid = [s](const query::PlacedEllipsoid& e, const Pose& pose, double margin) {
        return query::separated(e, query::place(s, pose, margin));
    };
    out.bounded = !std::is_same_v<Shape, HalfSpace>;
    if constexpr (!std::is_same_v<Shape, HalfSpace>)
        out.place = [s](const Pose& pose, double margin) { return query::place(s, pose, margin); };
    return out;
}

// A shape of about `size`, somewhere around the body at `pose`, whose points lie within 1.5 `extent` of its origin.
AnyShape random_shape(Random& random, const Pose& pose, double extent) {
    const Vec3 t = pose.translation;
    const auto point = [&] {
        const Point p = random.in_ball();
        return scenes::to_float({t.x + 1.5 * extent * p[0], t.y + 1.5 * extent * p[1], t.z + 1.5 * extent * p[2]});
    };
    const auto length = [&] { return static_cast<float>(extent * random.log_in(1e-3, 0.5)); };
    switch (random.below(4)) {
    case 0:
        return any(Sphere{point(), length()});
    case 1:
        return any(Capsule{point(), point(), length()});
    case 2:
        return any(Box{{point(), random.rotation()}, {length(), length(), length()}});
    default: {
        const Vec3 n = scenes::to_float(random.direction());
        const double height = double{n.x} * t.x + double{n.y} * t.y + double{n.z} * t.z;
        return any(HalfSpace{n, static_cast<float>(height + extent * random.in(-1.5, 0.5))});
    }
    }
}

TEST(Shapes, ExactTreesAnswerAsAllTheirTrianglesDo) {
    const std::pair<Mesh, double> meshes[] = {{shapes::torus(1, 0.3f, 30, 12), 1.3},
                                              {shapes::moved(shapes::box(2, 2, 2), {-1, -1, -1}), 1.7},
                                              {shapes::icosphere(2), 1.0},
                                              {shapes::moved(shapes::icosphere(2), {}, 1e-12f), 1e-12},
                                              {shapes::moved(shapes::icosphere(2), {}, 1e8f), 1e8}};
    for (const auto& [mesh, extent] : meshes) {
        const auto scene = scenes::exact_tree(mesh);
        const auto tree = *TreeView::open(scene.bytes);
        Random random(5);
        int overlapping = 0, enclosed = 0, undecided = 0;
        const int count = 600;
        for (int k = 0; k < count; ++k) {
            const Pose pose = scenes::pose_at(random, k % 2 == 0 ? 0 : 100 * extent);
            const AnyShape s = random_shape(random, pose, extent);
            QueryOptions options;
            if (k % 3 == 0) options.margin = static_cast<float>(extent * random.log_in(1e-3, 0.3));
            bool met = false;
            for (uint32_t t = 0; t < tree.triangle_count() && !met; ++t)
                met = !s.misses_triangle(query::place(tree, t), pose, options.margin);
            bool held = false;
            if (!met && s.bounded) {
                const RoundedBox box = s.place(pose, options.margin);
                QueryStats stats;
                held = *query::winding_number(tree, {box.center, box.reach}, stats, UINT64_MAX) != 0;
            }
            const OverlapResult result = s.ask(tree, pose, options);
            ASSERT_EQ(result.verdict, met || held ? Verdict::overlapping : Verdict::separated) << k << ' ' << extent;
            ASSERT_EQ(result.enclosed, held);
            if (met) {
                ASSERT_LT(result.triangle, tree.triangle_count());
                ASSERT_FALSE(s.misses_triangle(query::place(tree, result.triangle), pose, options.margin));
            }
            overlapping += met, enclosed += held;
            for (const uint64_t most : {0, 1, 9, 17}) {
                options.max_pair_tests = most;
                const OverlapResult some = s.ask(tree, pose, options);
                ASSERT_LE(some.stats.tests(), most);
                ASSERT_TRUE(some.verdict == Verdict::undecided || some.verdict == result.verdict);
                undecided += some.verdict == Verdict::undecided;
            }
        }
        EXPECT_GT(overlapping, count / 5) << extent;
        EXPECT_LT(overlapping, count * 4 / 5) << extent;
        EXPECT_GT(enclosed, 3) << extent;
        EXPECT_GT(undecided, count) << extent;
    }
}

TEST(Shapes, ProxyTreesAnswerAsTheirLeavesDo) {
    Random random(6);
    int overlapping = 0, separated = 0, shallow = 0;
    for (int scene_number = 0; scene_number < 5; ++scene_number) {
        const scenes::Scene scene =
            scenes::tree(random, scenes::cloud(random, 2'000), {.levels = 5, .stop_probability = 0.1});
        const auto tree = *TreeView::open(scene.bytes);
        for (int k = 0; k < 200; ++k) {
            const Pose pose = scenes::pose_at(random, 10);
            const AnyShape s = random_shape(random, pose, 1);
            const OverlapResult result = s.ask(tree, pose, {});
            // All leaves: what the shape may meet. Those whose ancestors it meets as well: what it surely does.
            bool surely = false, maybe = false;
            std::vector<bool> reached(tree.slot_count());
            reached[0] = true;
            tree.for_each_node([&](uint32_t node) {
                const bool met = !s.misses_ellipsoid(query::place(tree.ellipsoid(node)), pose, 0);
                const ChildRange children = tree.children(node);
                for (uint32_t i = 0; i < children.count; ++i) reached[children.first + i] = reached[node] && met;
                if (children.count > 0 || !met) return;
                maybe = true, surely = surely || reached[node];
            });
            if (surely) {
                ASSERT_EQ(result.verdict, Verdict::overlapping) << k;
            }
            if (!maybe) {
                ASSERT_EQ(result.verdict, Verdict::separated) << k;
            }
            overlapping += result.verdict == Verdict::overlapping, separated += result.verdict == Verdict::separated;
            for (uint32_t level = 0; level < 5; ++level) {
                const OverlapResult coarse = s.ask(tree, pose, {.max_level = level});
                ASSERT_LE(coarse.stats.deepest_level, level);
                if (coarse.verdict == Verdict::separated) {
                    ASSERT_EQ(result.verdict, Verdict::separated) << "a shallow verdict that deeper ones contradict";
                    ++shallow;
                }
            }
        }
    }
    EXPECT_GT(overlapping, 200);
    EXPECT_GT(separated, 200);
    EXPECT_GT(shallow, 200);
}

TEST(Shapes, TouchingAndNearlySo) {
    const auto scene = scenes::exact_tree(shapes::moved(shapes::box(2, 2, 2), {-1, -1, -1}));
    const auto tree = *TreeView::open(scene.bytes);
    const auto verdict = [&](const auto& s, float margin = 0) {
        return overlap(tree, {}, s, context(), {.margin = margin}).verdict;
    };
    constexpr auto yes = Verdict::overlapping, no = Verdict::separated;
    EXPECT_EQ(verdict(Sphere{{3, 0, 0}, 2}), yes);
    EXPECT_EQ(verdict(Sphere{{3.000001f, 0, 0}, 2}), no);
    EXPECT_EQ(verdict(Sphere{{3.000001f, 0, 0}, 1.5f}, 0.5f), no);
    EXPECT_EQ(verdict(Sphere{{3, 0, 0}, 1.5f}, 0.5f), yes);
    EXPECT_EQ(verdict(Capsule{{-5, 0, 2}, {5, 0, 2}, 1}), yes);
    EXPECT_EQ(verdict(Capsule{{-5, 0, 2.0000005f}, {5, 0, 2.0000005f}, 1}), no);
    EXPECT_EQ(verdict(Capsule{{-5, 2, 0}, {5, 2, 0}, 0}), no);  // a segment
    EXPECT_EQ(verdict(Capsule{{-5, 1, 0}, {5, 1, 0}, 0}), yes); // in a face
    EXPECT_EQ(verdict(Box{{{2, 0, 0}, {}}, {1, 1, 1}}), yes);   // face to face
    EXPECT_EQ(verdict(Box{{{2.0000005f, 0, 0}, {}}, {1, 1, 1}}), no);
    EXPECT_EQ(verdict(Box{{{2, 2, 2}, {}}, {1, 1, 1}}), yes); // corner to corner
    EXPECT_EQ(verdict(Box{{{}, {}}, {9, 9, 9}}), yes);        // around it
    EXPECT_EQ(verdict(HalfSpace{{0, 0, 5}, -1}), yes);        // any length
    EXPECT_EQ(verdict(HalfSpace{{0, 0, 5}, -1.0000002f}), no);
    EXPECT_EQ(verdict(HalfSpace{{0, 0, 5}, -1.5f}, 0.5f), yes);
    const OverlapResult inside = overlap(tree, {}, Sphere{{0.1f, 0, 0}, 0}, context());
    EXPECT_EQ(inside.verdict, yes);
    EXPECT_TRUE(inside.enclosed);
}

TEST(Shapes, ABadPoseNeverSeparates) {
    const auto scene = scenes::exact_tree(shapes::box());
    const auto tree = *TreeView::open(scene.bytes);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const Pose& pose : {Pose{{nan, 0, 0}, {}}, Pose{{}, {0, 0, 0, 0}}}) {
        EXPECT_NE(overlap(tree, pose, Sphere{{9, 9, 9}, 1}, context()).verdict, Verdict::separated);
        EXPECT_NE(overlap(tree, pose, Capsule{{9, 9, 9}, {8, 8, 8}, 1}, context()).verdict, Verdict::separated);
        EXPECT_NE(overlap(tree, pose, Box{{{9, 9, 9}, {}}, {1, 1, 1}}, context()).verdict, Verdict::separated);
        EXPECT_NE(overlap(tree, pose, HalfSpace{{0, 0, 1}, -9}, context()).verdict, Verdict::separated);
    }
    EXPECT_NE(overlap(tree, {}, Sphere{{9, 9, 9}, nan}, context()).verdict, Verdict::separated);
    EXPECT_NE(overlap(tree, {}, HalfSpace{{0, 0, 0}, -9}, context()).verdict, Verdict::separated);
    EXPECT_NE(overlap(tree, {}, Box{{{9, 9, 9}, {}}, {nan, 1, 1}}, context()).verdict, Verdict::separated);
}

} // namespace
} // namespace prolate
#endif // HWY_ONCE

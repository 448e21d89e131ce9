// What a body is, all queries say alike: a tree without triangles is the union of its leaf ellipsoids, an exact tree
// its triangles and what they enclose. Verdicts are compared to the bit, with each other and with all pairs of leaves
// or triangles, at poses near contact; and with every budget, bounds only tighten.
#include "query/ellipsoid/gap.hpp"
#include "query/node/order.hpp"
#include "query/raycast/ray.hpp"
#include "query/shapes/rounded_box.hpp"
#include "query/triangle/ellipsoid_distance.hpp"
#include "query/triangle/separation.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

namespace prolate {
namespace {

using query::PlacedEllipsoid;
using query::PlacedTriangle;
using scenes::Point;
using scenes::Random;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Body {
    std::vector<std::byte> bytes;
    TreeView view() const { return *TreeView::open(bytes, {.check_hash = false}); }
};
std::vector<Body> covers() {
    Random random(11);
    std::vector<Body> out;
    for (const scenes::TreeOptions& options :
         {scenes::TreeOptions{.degree = 8, .levels = 3, .leaf_points = 12},
          scenes::TreeOptions{.degree = 3, .levels = 4, .leaf_points = 4, .stop_probability = 0.3},
          scenes::TreeOptions{.degree = 12, .levels = 3, .leaf_points = 30}, scenes::TreeOptions{.levels = 1}}) {
        auto points = scenes::cloud(random, 300);
        out.push_back({scenes::tree(random, std::move(points), options).bytes});
    }
    return out;
}
std::vector<Body> solids() {
    std::vector<Body> out;
    for (const Mesh& mesh :
         {shapes::icosphere(1), shapes::torus(0.8f, 0.25f, 12, 6), shapes::hollow_ball(), shapes::box(1, 0.3f, 0.02f)})
        out.push_back({scenes::exact_tree(mesh).bytes});
    out.push_back({scenes::exact_tree(shapes::sheet(1, 1, 4), {.closed = false}).bytes});
    return out;
}

struct Query {
    Pose a, b;
};
Motion at_rest(const Pose& pose) {
    return {pose, {}, {}, {}};
}

// All that one pose has to say, leaf by leaf, with the bodies in the queries' order.
struct Truth {
    bool meet = false;                           // two leaves, or triangles
    double lower = kInfinity, upper = kInfinity; // of their distance
    double reach = 0;                            // S of separation.hpp

    Truth(const TreeView& a, const TreeView& b, const Query& q) {
        const auto bodies = query::in_canonical_order(a, q.a, b, q.b);
        look(bodies.a, bodies.b, query::relative_pose(bodies.place_a, bodies.place_b));
    }

private:
    struct Part {
        PlacedEllipsoid ellipsoid;
        std::optional<PlacedTriangle> triangle;
        glm::dvec3 center{}; // of a ball around it
        double radius = 0;

        Part(const PlacedEllipsoid& e, const std::optional<PlacedTriangle>& t)
            : ellipsoid(e), triangle(t), center(e.center), radius(e.size) {
            if (!t) return;
            center = (t->corner[0] + t->corner[1] + t->corner[2]) / 3.0, radius = 0;
            for (const glm::dvec3& corner : t->corner) radius = std::max(radius, glm::distance(corner, center));
        }
    };
    static std::vector<Part> parts(const TreeView& tree, const query::RelativePose* to_a) {
        std::vector<Part> out;
        tree.for_each_node([&](uint32_t n) {
            if (!tree.is_leaf(n)) return;
            const Ellipsoid e = tree.ellipsoid(n);
            const PlacedEllipsoid placed = to_a ? query::place(e, *to_a) : query::place(e);
            const TriangleRange range = tree.triangles(n);
            if (range.count == 0) out.emplace_back(placed, std::nullopt);
            for (uint32_t t = range.first; t < range.first + range.count; ++t)
                out.emplace_back(placed, to_a ? query::place(tree, t, *to_a) : query::place(tree, t));
        });
        return out;
    }
    void look(const TreeView& a, const TreeView& b, const query::RelativePose& b_to_a) {
        const auto in_a = parts(a, nullptr), in_b = parts(b, &b_to_a);
        for (const Part& x : in_a)
            for (const Part& y : in_b) {
                reach = std::max(reach, x.ellipsoid.reach + y.ellipsoid.reach);
                const double apart = glm::distance(x.center, y.center) - x.radius - y.radius;
                if (apart > 1e-6 && apart > upper) continue; // beyond doubt
                if (!x.triangle && !y.triangle) {
                    meet = meet || !query::separated(x.ellipsoid, y.ellipsoid);
                    const query::Gap gap = query::distance_of(x.ellipsoid, y.ellipsoid, 0);
                    note(std::max(gap.lower, 0.0), std::max(gap.upper, 0.0));
                } else if (x.triangle && y.triangle) {
                    meet = meet || !query::separated(*x.triangle, *y.triangle);
                    const query::TriangleDistance d = query::distance(*x.triangle, *y.triangle);
                    note(d.lower, d.upper);
                } else {
                    const PlacedTriangle& t = x.triangle ? *x.triangle : *y.triangle;
                    const PlacedEllipsoid& e = x.triangle ? y.ellipsoid : x.ellipsoid;
                    meet = meet || !query::separated(t, e);
                    const query::TriangleDistance d = query::distance(t, e);
                    note(d.lower, d.upper);
                }
            }
    }
    void note(double low, double high) { lower = std::min(lower, low), upper = std::min(upper, high); }
};

// Poses near contact: on both sides of it, as near as floats allow and farther.
class Near {
public:
    Near(const TreeView& a, const TreeView& b, uint64_t seed) : a_(a), b_(b), random_(seed) {}
    Query next() {
        if (left_ == 0) place();
        --left_;
        const double sign = random_.below(2) ? 1 : -1, t = contact_ * (1 + sign * random_.log_in(1e-8, 1e-2));
        return left_ == 0 ? at(contact_) : at(t);
    }

private:
    Query at(double t) const {
        return {a_pose_, {scenes::to_float({t * way_[0], t * way_[1], t * way_[2]}), rotation_}};
    }
    void place() {
        a_pose_ = {{}, random_.rotation()}, rotation_ = random_.rotation(), way_ = random_.direction();
        double low = 0, high = 8;
        for (int i = 0; i < 40; ++i) {
            const double middle = 0.5 * (low + high);
            const Query q = at(middle);
            (collide(a_, q.a, b_, q.b, *context_).verdict == Verdict::separated ? high : low) = middle;
        }
        contact_ = high, left_ = 8;
    }
    const TreeView a_, b_;
    Random random_;
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    Pose a_pose_;
    Quat rotation_;
    Point way_{};
    double contact_ = 0;
    int left_ = 0;
};

struct Counts {
    int poses = 0, meet = 0, enclosed = 0;
};
void expect_agreement(const Body& body_a, const Body& body_b, int poses, uint64_t seed, Counts& counts) {
    const TreeView a = body_a.view(), b = body_b.view();
    const auto context = std::make_unique<QueryContext>();
    Near near(a, b, seed);
    for (int i = 0; i < poses; ++i) {
        const Query q = near.next();
        const Truth truth(a, b, q);
        const CollideResult one = collide(a, q.a, b, q.b, *context);
        ASSERT_EQ(one.verdict == Verdict::overlapping && !one.enclosed, truth.meet);
        const CollideAllResult all = collide_all(a, q.a, b, q.b, {}, *context);
        ASSERT_EQ(all.verdict, one.verdict);
        ASSERT_EQ(all.found > 0, truth.meet);
        ASSERT_EQ(all.enclosed, one.enclosed);
        ContactManifolds manifolds;
        const ContactResult touch = contacts(a, q.a, b, q.b, manifolds, *context);
        ASSERT_EQ(touch.verdict, one.verdict);
        ASSERT_EQ(manifolds.count > 0, truth.meet);

        const DistanceResult d = distance(a, q.a, b, q.b, *context);
        ASSERT_EQ(d.verdict, one.verdict) << d.lower << " " << d.upper << " " << truth.lower;
        ASSERT_EQ(d.enclosed, one.enclosed);
        ASSERT_EQ(d.lower > 0, d.verdict == Verdict::separated);
        if (!d.enclosed) {
            ASSERT_LE(d.lower, truth.upper);
            ASSERT_GE(d.upper, truth.lower * (1 - 1e-15));
            const double rounding = (d.verdict == Verdict::separated ? 4e-9 : 1e-7) * truth.reach;
            ASSERT_LE(d.upper - d.lower, std::max(1e-6 * d.upper, rounding)) << d.lower << " " << d.upper;
        }

        const SweepResult s = sweep(a, at_rest(q.a), b, at_rest(q.b), *context);
        ASSERT_NE(s.verdict, Verdict::undecided);
        ASSERT_TRUE(s.verdict == Verdict::overlapping || one.verdict == Verdict::separated);
        if (one.verdict == Verdict::overlapping) {
            ASSERT_EQ(s.time_lower, 0);
        }
        if (s.verdict == Verdict::overlapping && s.distance == 0) {
            ASSERT_EQ(one.verdict, Verdict::overlapping);
        }
        ++counts.poses, counts.meet += truth.meet, counts.enclosed += one.enclosed;
    }
}
void expect_agreement(const std::vector<Body>& first, const std::vector<Body>& second, int poses) {
    Counts counts;
    for (size_t i = 0; i < first.size(); ++i)
        for (size_t j = 0; j < second.size(); ++j) {
            expect_agreement(first[i], second[j], poses, 100 * i + j, counts);
            if (testing::Test::HasFatalFailure()) FAIL() << i << ' ' << j;
        }
    EXPECT_GT(counts.meet, counts.poses / 4);
    EXPECT_LT(counts.meet, counts.poses * 3 / 4);
}

TEST(Agreement, OfTreesOfEllipsoids) {
    expect_agreement(covers(), covers(), 800);
}
TEST(Agreement, OfExactTrees) {
    expect_agreement(solids(), solids(), 40);
}
TEST(Agreement, OfOneOfEach) {
    expect_agreement(covers(), solids(), 60);
}

// Bodies that a plane keeps apart: there, most pairs are passed over along one direction, the nearest pair's.
TEST(Agreement, OfDistancesFarApart) {
    Random random(5);
    const auto dented = [&](Mesh mesh) {
        for (Vec3& v : mesh.vertices) {
            const auto scale = static_cast<float>(random.in(0.97, 1));
            v = {scale * v.x, scale * v.y, scale * v.z};
        }
        return scenes::exact_tree(mesh).bytes;
    };
    const Body bodies[] = {{dented(shapes::icosphere(3))}, {dented(shapes::torus(0.8f, 0.25f, 40, 20))}, covers()[0]};
    const auto context = std::make_unique<QueryContext>();
    for (const Body& body_a : bodies)
        for (const Body& body_b : bodies)
            for (int i = 0; i < 12; ++i) {
                const TreeView a = body_a.view(), b = body_b.view();
                const Query q{scenes::pose_at(random, 0), scenes::pose_at(random, random.in(1.5, 6))};
                const Truth truth(a, b, q);
                const DistanceResult d = distance(a, q.a, b, q.b, *context);
                if (truth.meet || d.enclosed) continue;
                EXPECT_EQ(d.verdict, Verdict::separated);
                EXPECT_LE(d.lower, truth.upper);
                EXPECT_GE(d.upper, truth.lower * (1 - 1e-15));
                EXPECT_LE(d.upper - d.lower, std::max(1e-6 * d.upper, 4e-9 * truth.reach));
                DistanceCache cache{.valid = true, .pair = d.pair}; // a direction from the beginning
                const DistanceResult again = distance(a, q.a, b, q.b, *context, {}, &cache);
                EXPECT_LE(again.lower, truth.upper);
                EXPECT_GE(again.upper, truth.lower * (1 - 1e-15));
            }
}

// A prefix of a tree is one of its own: its leaves are its last level.
// Within a tolerance of the nearest pair found, others of the same leaves may still meet: needles in plates.
TEST(Agreement, OfDistancesWithLargeTolerances) {
    Mesh needle = shapes::icosphere(2);
    for (Vec3& v : needle.vertices) v.x *= 0.01f, v.y *= 0.01f;
    const scenes::ExactScene of_a = scenes::exact_tree(needle),
                             of_b = scenes::exact_tree(shapes::moved(shapes::box(2, 2, 0.05f), {-1, -1, -0.025f}));
    const TreeView a = *TreeView::open(of_a.bytes), b = *TreeView::open(of_b.bytes);
    scenes::Random random(19);
    const auto context = std::make_unique<QueryContext>();
    int meeting = 0;
    for (int i = 0; i < 2000; ++i) {
        const Pose pose_a = scenes::pose_at(random, random.in(0, 1.5)), pose_b = scenes::pose_at(random, 0);
        const Verdict truth = collide(a, pose_a, b, pose_b, *context).verdict;
        meeting += truth == Verdict::overlapping;
        for (const DistanceOptions& options :
             {DistanceOptions{.tolerance_absolute = 0.02}, DistanceOptions{.tolerance_absolute = 10},
              DistanceOptions{.tolerance_relative = 1}})
            ASSERT_EQ(distance(a, pose_a, b, pose_b, *context, options).verdict, truth) << i;
    }
    EXPECT_GT(meeting, 500);
    EXPECT_LT(meeting, 1500);
}

TEST(Agreement, OfPrefixes) {
    std::vector<Body> cut;
    for (const Body& whole : covers()) {
        const TreeView tree = whole.view();
        for (uint32_t l = 0; l + 1 < tree.level_count(); ++l)
            cut.push_back(
                {{whole.bytes.begin(), whole.bytes.begin() + static_cast<ptrdiff_t>(tree.level(l).end_byte)}});
    }
    expect_agreement(cut, {covers()[1]}, 100);
}

// Shallow looks never contradict deep ones.
TEST(Agreement, OfLevels) {
    const auto bodies = covers();
    const auto context = std::make_unique<QueryContext>();
    int shallow = 0;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const TreeView a = bodies[i].view(), b = bodies[j].view();
            Random random(i + 10 * j);
            for (int k = 0; k < 120; ++k) {
                const Point d = random.direction();
                const double t = random.in(0.5, 4);
                const Query q{{{}, random.rotation()},
                              {scenes::to_float({t * d[0], t * d[1], t * d[2]}), random.rotation()}};
                const Truth truth(a, b, q);
                const Ray ray{scenes::to_float({3 * d[0], 3 * d[1], 3 * d[2]}),
                              scenes::to_float({random.in(-1, 1) - 3 * d[0], random.in(-1, 1) - 3 * d[1],
                                                random.in(-1, 1) - 3 * d[2]})};
                const Sphere ball{scenes::to_float({t * d[0] / 2, t * d[1] / 2, t * d[2] / 2}), 0.3f};
                const HalfSpace ground{scenes::to_float(d), static_cast<float>(-t / 2)};
                for (uint32_t l = 0; l < 4; ++l) {
                    const QueryOptions options{.max_level = l};
                    if (collide(a, q.a, b, q.b, *context, options).verdict == Verdict::separated) {
                        ASSERT_FALSE(truth.meet);
                        ++shallow;
                    }
                    const DistanceResult bounds = distance(a, q.a, b, q.b, *context, {.max_level = l});
                    ASSERT_LE(bounds.lower, truth.upper);
                    ASSERT_GE(bounds.upper, truth.lower * (1 - 1e-15));
                    const Motion turning{q.b, scenes::to_float({-d[0], -d[1], -d[2]}), {0, 1, 1}, {}};
                    if (k % 8 == 0) {
                        const SweepResult coarse = sweep(a, at_rest(q.a), b, turning, *context, {.max_level = l});
                        const SweepResult fine = sweep(a, at_rest(q.a), b, turning, *context, {.tolerance = 1e-7});
                        if (fine.verdict == Verdict::overlapping) {
                            ASSERT_LE(coarse.time_lower, fine.time_upper);
                        }
                    }
                    const RaycastResult coarse = raycast(a, q.a, ray, *context, options),
                                        fine = raycast(a, q.a, ray, *context);
                    ASSERT_LE(coarse.t, fine.t + 1e-9);
                    if (overlap(a, q.a, ball, *context).verdict == Verdict::overlapping) {
                        ASSERT_EQ(overlap(a, q.a, ball, *context, options).verdict, Verdict::overlapping);
                    }
                    if (overlap(a, q.a, ground, *context).verdict == Verdict::overlapping) {
                        ASSERT_EQ(overlap(a, q.a, ground, *context, options).verdict, Verdict::overlapping);
                    }
                }
            }
        }
    EXPECT_GT(shallow, 300);
}

// Rays and shapes against all leaves.
TEST(Agreement, OfRaysAndShapes) {
    const auto context = std::make_unique<QueryContext>();
    int hits = 0, touched = 0, asked = 0;
    for (const Body& body : covers()) {
        const TreeView tree = body.view();
        std::vector<Ellipsoid> leaves;
        tree.for_each_node([&](uint32_t n) {
            if (tree.is_leaf(n)) leaves.push_back(tree.ellipsoid(n));
        });
        Random random(5);
        for (int i = 0; i < 3000; ++i, ++asked) {
            const Pose pose{scenes::to_float(random.in_ball()), random.rotation()};
            const Point o = random.direction(), to = random.in_ball();
            const Ray ray{scenes::to_float({3 * o[0], 3 * o[1], 3 * o[2]}),
                          scenes::to_float({1.4 * to[0] - 3 * o[0], 1.4 * to[1] - 3 * o[1], 1.4 * to[2] - 3 * o[2]})};
            const query::RelativePose to_frame = query::relative_pose(pose, {ray.origin, {}});
            const query::PlacedRay placed =
                query::place(ray, to_frame.rotation, to_frame.translation, to_frame.distance, query::ray_bound(tree));
            double first = kInfinity;
            if (!placed.empty)
                for (const Ellipsoid& e : leaves)
                    if (const auto hit = query::hit(placed, query::place(e)))
                        first = std::min(first, placed.begin + hit->t);
            const RaycastResult found = raycast(tree, pose, ray, *context);
            ASSERT_EQ(found.t, first);
            ASSERT_EQ(raycast_any(tree, pose, ray, *context).verdict, found.verdict);
            hits += found.verdict == Verdict::overlapping;

            const Sphere ball{scenes::to_float({1.5 * o[0], 1.5 * o[1], 1.5 * o[2]}),
                              static_cast<float>(random.in(0, 0.8))};
            const Box box{{ball.center, random.rotation()}, {0.3f, 0.1f, 0.5f}};
            const HalfSpace ground{scenes::to_float(o), static_cast<float>(random.in(-2, 0))};
            const auto any = [&](const auto& shape) {
                return std::ranges::any_of(leaves,
                                           [&](const Ellipsoid& e) { return !separated(query::place(e), shape); });
            };
            const auto meets = [&](const auto& shape) {
                return overlap(tree, pose, shape, *context).verdict == Verdict::overlapping;
            };
            ASSERT_EQ(meets(ball), any(query::place(ball, pose, 0)));
            ASSERT_EQ(meets(box), any(query::place(box, pose, 0)));
            ASSERT_EQ(meets(ground), any(query::place(ground, pose, 0)));
            touched += meets(ball);
        }
    }
    EXPECT_GT(hits, asked / 8);
    EXPECT_GT(touched, asked / 12);
    EXPECT_LT(touched, asked / 2);
}

// ---- budgets ----

// Tests that two leaves may need, which must be left for them, though they may take fewer.
constexpr uint64_t kMostOfLeaves = 16;

template <class Ask> void expect_tightening(Ask&& ask) {
    const auto whole = ask(UINT64_MAX);
    auto last = ask(0);
    EXPECT_EQ(last.stats.tests(), 0u);
    const uint64_t most = whole.stats.tests() + kMostOfLeaves;
    for (uint64_t budget = 1; budget <= most; budget += budget < 300 || most - budget < 30 ? 1 : 7) {
        const auto now = ask(budget);
        ASSERT_LE(now.stats.tests(), budget);
        ASSERT_GE(now.low, last.low) << budget;
        ASSERT_LE(now.high, last.high) << budget;
        ASSERT_TRUE(last.verdict == Verdict::undecided || now.verdict == last.verdict) << budget;
        last = now;
    }
    ASSERT_EQ(last.verdict, whole.verdict);
    ASSERT_EQ(last.low, whole.low);
    ASSERT_EQ(last.high, whole.high);
}
struct Tightening {
    Verdict verdict;
    double low, high;
    QueryStats stats;
};

TEST(Agreement, LargerBudgetsOnlyTighten) {
    const auto of_ellipsoids = covers(), exact = solids();
    std::vector<Body> bodies{of_ellipsoids[0], of_ellipsoids[1], exact[0], exact[1], exact[2]};
    const auto context = std::make_unique<QueryContext>();
    int enclosed = 0;
    for (size_t i = 0; i < bodies.size(); ++i)
        for (size_t j = i; j < bodies.size(); ++j)
            for (int k = 0; k < 2; ++k) {
                const TreeView a = bodies[i].view(), b = bodies[j].view();
                Near near(a, b, 10 * i + j + 1000 * static_cast<uint64_t>(k));
                Query q = near.next();
                if (k == 1) q.b.translation = {0.1f, 0, 0}; // deep, or within
                if (k == 0 && i == 0) q.b.translation = {3, 0.1f, 0};
                DistanceCache cache;
                const DistanceResult first = distance(a, q.a, b, q.b, *context, {}, &cache);
                enclosed += first.enclosed;
                for (const bool cached : {false, true}) {
                    expect_tightening([&](uint64_t budget) {
                        DistanceCache copy = cache;
                        const DistanceResult d =
                            distance(a, q.a, b, q.b, *context, {.max_pair_tests = budget}, cached ? &copy : nullptr);
                        return Tightening{d.verdict, d.lower, d.upper, d.stats};
                    });
                    if (testing::Test::HasFatalFailure()) FAIL() << i << ' ' << j << ' ' << k << ' ' << cached;
                }
                const Motion motion{q.b, {-0.3f, 0.1f, 0}, {0.3f, 0, 0.5f}, {}};
                expect_tightening([&](uint64_t budget) {
                    const SweepResult s =
                        sweep(a, at_rest(q.a), b, motion, *context, {.tolerance = 1e-3, .max_pair_tests = budget});
                    return Tightening{s.verdict, s.time_lower, s.time_upper, s.stats};
                });
                if (testing::Test::HasFatalFailure()) FAIL() << i << ' ' << j << ' ' << k << " sweep";
            }
    EXPECT_GT(enclosed, 0);
}

// Children stick out of their parent's ellipsoid: where the parent is separated, they stay so.
TEST(Agreement, WhatALevelSeparatesStaysSeparatedBelow) {
    const scenes::ExactScene ring = scenes::exact_tree(shapes::torus(1, 0.3f, 16, 8)),
                             sheet = scenes::exact_tree(shapes::sheet(2, 0.4f, 8), {.closed = false}),
                             ball = scenes::exact_tree(shapes::icosphere(2), {.degree = 4});
    const TreeView bodies[] = {*TreeView::open(ring.bytes), *TreeView::open(sheet.bytes), *TreeView::open(ball.bytes)};
    const auto context = std::make_unique<QueryContext>();
    Random random(79);
    int separated_above = 0;
    for (int i = 0; i < 20'000; ++i) {
        const TreeView a = bodies[random.below(3)],
                       b = *bodies[random.below(3)].scaled(static_cast<float>(random.log_in(0.02, 2)));
        const Pose p = scenes::pose_at(random, 0), q = scenes::pose_at(random, random.in(0.5, 3));
        bool separated = false;
        for (uint32_t level = 0; level < std::max(a.level_count(), b.level_count()); ++level) {
            const Verdict verdict = collide(a, p, b, q, *context, {.max_level = level}).verdict;
            if (separated) {
                ASSERT_EQ(verdict, Verdict::separated) << i << ' ' << level;
                ++separated_above;
            }
            separated = verdict == Verdict::separated;
        }
    }
    EXPECT_GT(separated_above, 1'000);
}

// ---- one within the other ----

// Where no node of either meets what is at the surface of the other: only the boxes around all of them do.
TEST(Agreement, WhatIsWellWithinABodyIsEnclosed) {
    const scenes::ExactScene ball = scenes::exact_tree(shapes::icosphere(3)),
                             ring = scenes::exact_tree(shapes::torus(1, 0.3f, 16, 8)),
                             box = scenes::exact_tree(shapes::box(1, 2, 0.5f));
    const TreeView large = *TreeView::open(ball.bytes),
                   small[] = {*TreeView::open(ring.bytes), *TreeView::open(box.bytes), large};
    Random random(77);
    const auto context = std::make_unique<QueryContext>();
    std::vector<MeetingPair> pairs(1);
    for (int i = 0; i < 3000; ++i) {
        const float scale = static_cast<float>(random.log_in(1e-3, 0.2));
        const TreeView inner = *small[i % 3].scaled(scale);
        Pose pose_a = scenes::pose_at(random, random.in(0, 3)), pose_b = pose_a;
        pose_b.rotation = random.rotation();
        const Point d = random.in_ball(); // the ball's faces are 0.98 off its center, all of `inner` within 2.3 scale
        const double most = 0.97 - 2.4 * double{scale};
        pose_b.translation.x += static_cast<float>(most * d[0]);
        pose_b.translation.y += static_cast<float>(most * d[1]);
        pose_b.translation.z += static_cast<float>(most * d[2]);
        for (const bool exchanged : {false, true}) {
            const TreeView &a = exchanged ? inner : large, &b = exchanged ? large : inner;
            const Pose &p = exchanged ? pose_b : pose_a, &q = exchanged ? pose_a : pose_b;
            const CollideResult one = collide(a, p, b, q, *context);
            ASSERT_EQ(one.verdict, Verdict::overlapping) << i;
            EXPECT_TRUE(one.enclosed);
            EXPECT_TRUE(collide_all(a, p, b, q, pairs, *context).enclosed);
            PairCache cache;
            EXPECT_EQ(collide(a, p, b, q, *context, {.margin = 1e-3f}, &cache).verdict, Verdict::overlapping);
            ContactManifolds manifolds;
            EXPECT_EQ(contacts(a, p, b, q, manifolds, *context).verdict, Verdict::overlapping);
        }
    }
}

// ---- numbers that no length can be ----

TEST(Agreement, MarginsThatAreNoLengths) {
    const auto of_ellipsoids = covers(), exact = solids();
    const auto context = std::make_unique<QueryContext>();
    constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kFar = std::numeric_limits<float>::infinity();
    for (const Body* body : {&of_ellipsoids[0], &exact[0]}) {
        const TreeView a = body->view(), b = of_ellipsoids[1].view();
        for (const float x : {1.0f, 1.6f, 2.2f, 9.0f}) {
            const Pose pose_b{{x, 0, 0}, {}};
            const auto verdict = [&](float margin) {
                return collide(a, {}, b, pose_b, *context, {.margin = margin}).verdict;
            };
            EXPECT_EQ(verdict(-1), verdict(0));
            EXPECT_EQ(verdict(-kFar), verdict(0));
            EXPECT_EQ(verdict(kFar), Verdict::overlapping);
            EXPECT_EQ(verdict(kNaN), Verdict::overlapping);
            for (const float margin : {kFar, kNaN}) {
                EXPECT_EQ(collide_all(a, {}, b, pose_b, {}, *context, {.margin = margin}).verdict,
                          Verdict::overlapping);
                const SweepResult s = sweep(a, {}, b, at_rest(pose_b), *context, {.margin = margin});
                EXPECT_EQ(s.verdict, Verdict::overlapping);
                EXPECT_EQ(s.time_upper, 0);
                const Ray ray{{20, 0, 0}, {0, 0, 1}};
                const RaycastResult hit = raycast(a, {}, ray, *context, {.margin = margin});
                EXPECT_EQ(hit.verdict, Verdict::overlapping);
                EXPECT_EQ(hit.t, 0);
                EXPECT_EQ(overlap(a, {}, Sphere{{20, 0, 0}, 1}, *context, {.margin = margin}).verdict,
                          Verdict::overlapping);
                EXPECT_EQ(overlap(a, {}, HalfSpace{{0, 0, 1}, -20}, *context, {.margin = margin}).verdict,
                          Verdict::overlapping);
            }
            const SweepResult still = sweep(a, {}, b, at_rest(pose_b), *context);
            for (const double tolerance : {-1.0, double{kNaN}})
                EXPECT_EQ(sweep(a, {}, b, at_rest(pose_b), *context, {.tolerance = tolerance}).verdict, still.verdict);
            EXPECT_EQ(sweep(a, {}, b, at_rest(pose_b), *context, {.tolerance = kInfinity}).verdict,
                      Verdict::overlapping);

            const DistanceResult d = distance(a, {}, b, pose_b, *context, {.tolerance_relative = 0});
            for (const double tolerance : {-1.0, double{kNaN}}) {
                const DistanceResult same =
                    distance(a, {}, b, pose_b, *context,
                             {.tolerance_absolute = tolerance, .tolerance_relative = tolerance, .max_distance = kNaN});
                EXPECT_EQ(same.lower, d.lower);
                EXPECT_EQ(same.upper, d.upper);
            }
            EXPECT_EQ(distance(a, {}, b, pose_b, *context, {.tolerance_absolute = kInfinity}).verdict, d.verdict);
            EXPECT_EQ(distance(a, {}, b, pose_b, *context, {.tolerance_relative = kInfinity}).verdict, d.verdict);
            const DistanceResult near = distance(a, {}, b, pose_b, *context, {.max_distance = -1});
            EXPECT_EQ(near.verdict, d.verdict);
            EXPECT_LE(near.lower, d.upper);
        }
        const Ray ray{{20, 0, 0}, {-1, 0, 0}};
        const double t = raycast(a, {}, ray, *context).t;
        EXPECT_LT(t, 25);
        EXPECT_EQ(raycast(a, {}, ray, *context, {.margin = -1}).t, t);
        EXPECT_EQ(raycast(a, {}, {ray.origin, ray.direction, kNaN}, *context).verdict, Verdict::undecided);
        EXPECT_EQ(raycast(a, {}, {ray.origin, ray.direction, -1}, *context).verdict, Verdict::separated);
        const Vec3 apart{3, 0, 0};
        EXPECT_EQ(overlap(a, {}, Sphere{apart, -9}, *context).verdict, Verdict::separated);
        EXPECT_EQ(overlap(a, {}, Sphere{apart, kNaN}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, Sphere{apart, kFar}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, Capsule{apart, {3, 1, 0}, -9}, *context).verdict, Verdict::separated);
        EXPECT_EQ(overlap(a, {}, Capsule{apart, {3, 1, 0}, kNaN}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, Box{{apart, {}}, {-9, -9, -9}}, *context).verdict, Verdict::separated);
        EXPECT_EQ(overlap(a, {}, Box{{apart, {}}, {kNaN, 1, 1}}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, Box{{apart, {}}, {kFar, 1, 1}}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, HalfSpace{{0, 0, 1}, kNaN}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, HalfSpace{{0, 0, 1}, kFar}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, HalfSpace{{0, 0, 1}, -kFar}, *context).verdict, Verdict::overlapping);
        EXPECT_EQ(overlap(a, {}, HalfSpace{{0, 0, 0}, -9}, *context).verdict, Verdict::overlapping);
    }
}

} // namespace
} // namespace prolate

// Bodies that deform: bounds hold wherever vertices move, and queries miss nothing that the deformed triangles meet.
#include "query/ellipsoid/nearest_direction.hpp"
#include "query/triangle/separation.hpp"
#include "src/deformation.hpp"
#include "tests/query/deform/moving_bodies.hpp"
#include "tests/shapes.hpp"

#include <prolate/deform.hpp>
#include <prolate/modes.hpp>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using moving::ball, moving::ball_cover, moving::ball_exact, moving::Moving, moving::near_pose, moving::placed;
using moving::torus, moving::torus_cover, moving::torus_exact;
using scenes::Point, scenes::Random;

// Does the bound hold x, as q moves and enlarges it, by the words of deformation.hpp? (Along the direction of the
// distance, the gap is the distance.)
bool holds(const TreeView& tree, uint32_t node, const std::vector<float>& q, const Point& x) {
    constexpr double kRounding = 1e-12;
    const Ellipsoid e = tree.bound(node);
    glm::dvec3 center(e.center.x, e.center.y, e.center.z);
    double grown = 1, radius = kRounding;
    for (uint32_t m = 0; m < q.size(); ++m) {
        const Deformation::Motion motion = tree.deformation()->motion(node, m);
        center += double{q[m]} * glm::dvec3(motion.shift[0], motion.shift[1], motion.shift[2]);
        grown += std::abs(double{q[m]}) * motion.growth;
        radius += std::abs(double{q[m]}) * motion.radius;
    }
    const glm::dvec3 r = glm::dvec3(x[0], x[1], x[2]) - center;
    const double u = r.x / e.l11, v = (r.y - e.l21 * u) / e.l22, w = (r.z - e.l31 * u - e.l32 * v) / e.l33;
    if (std::sqrt(u * u + v * v + w * w) <= grown + kRounding) return true;
    const glm::dmat3 factor = grown * glm::dmat3({e.l11, e.l21, e.l31}, {0, e.l22, e.l32}, {0, 0, e.l33});
    const glm::dvec3 n = glm::normalize(query::nearest_direction(factor, factor * glm::transpose(factor), r));
    return glm::dot(n, r) - glm::length(n * factor) <= radius;
}

// The slots on the way from the root to each leaf whose ellipsoid at rest holds x.
bool held_at_every_level(const TreeView& tree, uint32_t node, const std::vector<float>& q, const Point& rest,
                         const Point& x, bool& any) {
    const std::vector<float> zero(q.size());
    const ChildRange children = tree.children(node);
    bool below = false, all = true;
    for (uint32_t c = children.first; c < children.first + children.count; ++c) {
        bool here = false;
        all = held_at_every_level(tree, c, q, rest, x, here) && all;
        below = below || here;
    }
    any = children.count == 0 ? holds(tree, node, zero, rest) : below;
    return all && (!any || holds(tree, node, q, x));
}

class Deform : public testing::Test {
protected:
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    QueryContext& context() { return *context_; }
};

TEST_F(Deform, PointsStayInTheNodesThatStandForThem) {
    Random random(3);
    const struct {
        const Moving& body;
        const Tree& tree;
    } cases[] = {{torus(), torus_cover()}, {ball(), ball_cover()}};
    for (const auto& [body, tree] : cases)
        for (int i = 0; i < 10000; ++i) {
            const auto q = body.random_q(random);
            const std::vector<float> zero(q.size());
            const Triangle& t = body.mesh.triangles[random.below(static_cast<uint32_t>(body.mesh.triangles.size()))];
            const double s = i % 2 == 0 ? 1 : random.unit(), r = i % 2 == 0 ? 0 : random.in(0, 1 - s);
            Point rest{}, moved{};
            for (size_t k = 0; k < 3; ++k) {
                rest[k] = s * body.moved(t[0], zero)[k] + r * body.moved(t[1], zero)[k] +
                          (1 - s - r) * body.moved(t[2], zero)[k];
                moved[k] =
                    s * body.moved(t[0], q)[k] + r * body.moved(t[1], q)[k] + (1 - s - r) * body.moved(t[2], q)[k];
            }
            bool any = false;
            ASSERT_TRUE(held_at_every_level(tree.view(), 0, q, rest, moved, any)) << i;
            EXPECT_TRUE(any) << i; // in some leaf
        }
}

TEST_F(Deform, TrianglesOfExactTreesStayInAllNodesAboveThem) {
    Random random(4);
    const TreeView tree = torus_exact().view();
    std::vector<uint32_t> parent(tree.slot_count());
    tree.for_each_node([&](uint32_t node) {
        const ChildRange children = tree.children(node);
        for (uint32_t c = 0; c < children.count; ++c) parent[children.first + c] = node;
    });
    for (int i = 0; i < 300; ++i) {
        const auto q = torus().random_q(random);
        tree.for_each_node([&](uint32_t leaf) {
            const TriangleRange triangles = tree.triangles(leaf);
            for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t)
                for (const uint32_t v : tree.triangle(t)) {
                    const Vec3 at = tree.vertex(v);
                    Point x{at.x, at.y, at.z};
                    for (uint32_t m = 0; m < q.size(); ++m) {
                        const Vec3 u = tree.deformation()->displacement(v, m);
                        x[0] += double{q[m]} * u.x, x[1] += double{q[m]} * u.y, x[2] += double{q[m]} * u.z;
                    }
                    for (uint32_t node = leaf;; node = parent[node]) {
                        ASSERT_TRUE(holds(tree, node, q, x));
                        if (node == 0) break;
                    }
                }
        });
    }
}

bool meet(const std::vector<query::PlacedTriangle>& a, const std::vector<query::PlacedTriangle>& b) {
    for (const auto& x : a)
        for (const auto& y : b) {
            const auto low = [](const query::PlacedTriangle& t) {
                return glm::min(t.corner[0], glm::min(t.corner[1], t.corner[2]));
            };
            const auto high = [](const query::PlacedTriangle& t) {
                return glm::max(t.corner[0], glm::max(t.corner[1], t.corner[2]));
            };
            if (glm::any(glm::greaterThan(low(x), high(y))) || glm::any(glm::greaterThan(low(y), high(x)))) continue;
            if (!query::separated(x, y)) return true;
        }
    return false;
}

TEST_F(Deform, BoxesHoldDeformedTriangles) {
    Random random(12);
    for (int i = 0; i < 300; ++i) {
        const auto q = torus().random_q(random);
        const Pose pose = near_pose(random, i % 2 ? 3 : 1e4);
        const auto triangles = placed(torus(), q, pose);
        for (const TreeView& tree : {torus_cover().view(), torus_exact().view()}) {
            const Bounds box = bounds(DeformedBody{tree, pose, q}), wide = bounds(DeformedBody{tree, pose, q}, 0.5f);
            double least = HUGE_VAL;
            for (const query::PlacedTriangle& t : triangles)
                for (const glm::dvec3& x : t.corner) {
                    ASSERT_TRUE(x.x >= double{box.lower.x} && x.y >= double{box.lower.y} && x.z >= double{box.lower.z});
                    ASSERT_TRUE(x.x <= double{box.upper.x} && x.y <= double{box.upper.y} && x.z <= double{box.upper.z});
                    least = std::min(least, x.x - double{box.lower.x});
                }
            EXPECT_LT(least, 2.5); // no more than the body is large
            EXPECT_NEAR(double{wide.lower.x}, double{box.lower.x} - 0.5, 1e-2);
        }
    }
    EXPECT_EQ(bounds(DeformedBody{torus_cover().view(), {}, torus().displacements}).upper.y, HUGE_VALF);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(bounds(DeformedBody{torus_cover().view(), {{nan, 0, 0}, {}}}).lower.x, -HUGE_VALF);
}

TEST_F(Deform, CollideMissesNothingThatDeformedTrianglesMeet) {
    Random random(5);
    int counts[2] = {}, sure = 0, enclosed = 0;
    for (int i = 0; i < 400; ++i) {
        const auto q_a = torus().random_q(random), q_b = ball().random_q(random);
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 3.2);
        const bool truth = meet(placed(torus(), q_a, pose_a), placed(ball(), q_b, pose_b));
        ++counts[truth];
        for (const bool exact_a : {false, true})
            for (const bool exact_b : {false, true}) {
                const DeformedBody a{(exact_a ? torus_exact() : torus_cover()).view(), pose_a, q_a},
                    b{(exact_b ? ball_exact() : ball_cover()).view(), pose_b, q_b};
                const DeformedCollideResult found = collide(a, b, context());
                ASSERT_EQ(found.reason, Undecided::no);
                if (truth) {
                    ASSERT_EQ(found.verdict, Verdict::overlapping) << i;
                    EXPECT_FALSE(found.enclosed);
                }
                sure += found.verdict == Verdict::separated && !exact_a && !exact_b;
                enclosed += found.enclosed;
                if (exact_a && exact_b && !truth && !found.enclosed) {
                    EXPECT_EQ(found.verdict, Verdict::separated) << i;
                }
                EXPECT_EQ(collide(b, a, context()).verdict, found.verdict);
                const auto shallow = collide(a, b, context(), {.max_level = static_cast<uint32_t>(i) % 3u}).verdict;
                EXPECT_NE(shallow, Verdict::undecided);
                if (truth) {
                    EXPECT_EQ(shallow, Verdict::overlapping);
                }
            }
    }
    EXPECT_GT(counts[0], 100);
    EXPECT_GT(counts[1], 100);
    EXPECT_GT(sure, counts[0] / 2); // and covers are not useless
    RecordProperty("enclosed", enclosed);
}

TEST_F(Deform, RigidBodiesAreThoseOfOtherQueries) {
    Random random(6);
    const Build rigid = must_build(shapes::box(0.5f, 0.6f, 0.7f), quick(1));
    for (int i = 0; i < 500; ++i) {
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 3);
        for (const TreeView& other : {rigid.tree.view(), ball_cover().view(), ball_exact().view()}) {
            const auto known = collide(torus_exact().view(), pose_a, other, pose_b, context());
            const auto found = collide(DeformedBody{torus_exact().view(), pose_a}, {other, pose_b}, context());
            if (!found.enclosed) {
                EXPECT_EQ(found.verdict, known.verdict) << i;
            }
        }
        const Ray ray{pose_b.translation, scenes::to_float(random.direction())};
        for (const TreeView& tree : {torus_cover().view(), torus_exact().view()}) {
            const auto known = raycast(tree, pose_a, ray, context());
            const auto found = raycast(DeformedBody{tree, pose_a}, ray, context());
            ASSERT_EQ(found.verdict, known.verdict);
            if (known.verdict == Verdict::overlapping) {
                EXPECT_NEAR(found.t, known.t, 1e-9);
            }
        }
    }
}

TEST_F(Deform, RaysHitWhatIsDeformed) {
    Random random(7);
    int hits = 0;
    for (int i = 0; i < 400; ++i) {
        const auto q = torus().random_q(random);
        // Towards a point of a deformed triangle, in the world's frame.
        const Triangle& t = torus().mesh.triangles[random.below(static_cast<uint32_t>(torus().mesh.triangles.size()))];
        const Point a = torus().moved(t[0], q), b = torus().moved(t[1], q), c = torus().moved(t[2], q);
        Vec3 origin = scenes::to_float(random.direction());
        origin = {4 * origin.x, 4 * origin.y, 4 * origin.z};
        const Point to{(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3};
        const Ray ray{origin, scenes::to_float({to[0] - origin.x, to[1] - origin.y, to[2] - origin.z})};
        const auto exact = raycast({torus_exact().view(), {}, q}, ray, context());
        ASSERT_EQ(exact.verdict, Verdict::overlapping);
        EXPECT_LE(exact.t, 1 + 1e-5);
        const auto cover = raycast({torus_cover().view(), {}, q}, ray, context());
        ASSERT_EQ(cover.verdict, Verdict::overlapping);
        EXPECT_LE(cover.t, exact.t + 1e-9);
        const Ray away{origin, origin};
        EXPECT_EQ(raycast({torus_cover().view(), {}, q}, away, context()).verdict, Verdict::separated);
        hits += exact.t > 0.9;
    }
    EXPECT_GT(hits, 100);
}

TEST_F(Deform, WhatLiesInsideIsNotSeparated) {
    const Moving hollow(shapes::hollow_ball(), 2, 0.02, 8);
    const Moving small(shapes::moved(shapes::icosphere(1), {}, 0.05f), 2, 0.02, 9);
    const Tree hollow_exact = hollow.bake(true), small_cover = small.bake(false, 1), small_exact = small.bake(true);
    const Build rigid = must_build(shapes::moved(shapes::icosphere(1), {}, 0.05f), quick(1));
    for (const TreeView& outer : {hollow_exact.view(), ball_cover().view(), ball_exact().view()})
        for (const TreeView& inner : {small_cover.view(), small_exact.view(), rigid.tree.view()}) {
            const DeformedBody a{outer}, b{inner};
            EXPECT_EQ(collide(a, b, context()).verdict, Verdict::overlapping);
            EXPECT_EQ(collide(b, a, context()).verdict, Verdict::overlapping);
            const DeformedBody beside{inner, {{0.95f, 0.95f, 0.95f}, {}}};
            EXPECT_EQ(collide(a, beside, context()).verdict, Verdict::separated);
        }
    // Of a cover at rest, leaves hold all that is inside: what no leaf meets lies outside, if in a hollow.
    const Tree hollow_cover = hollow.bake(false, 64);
    const DeformedBody at_rest{hollow_cover.view()}, within{small_exact.view()};
    EXPECT_EQ(collide(hollow_cover.view(), {}, small_exact.view(), {}, context()).verdict, Verdict::separated);
    EXPECT_EQ(collide(at_rest, within, context()).verdict, Verdict::separated);
    EXPECT_EQ(collide(within, at_rest, context()).verdict, Verdict::separated);
    const std::vector<float> q(2);
    const DeformedBody moved{hollow_cover.view(), {}, q};
    EXPECT_TRUE(collide(moved, within, context()).enclosed);
    // In the hole of a ring, it is not inside.
    for (const TreeView& ring : {torus_exact().view(), torus_cover().view()})
        EXPECT_EQ(collide(DeformedBody{ring}, {small_cover.view(), {}}, context()).verdict, Verdict::separated);
}

TEST_F(Deform, CoordinatesThatNoBoundHoldsForAreUndecided) {
    const TreeView tree = torus_cover().view();
    const Pose far{{100, 0, 0}, {}};
    const auto reason = [&](std::vector<float> q) {
        const auto found = collide({tree, {}, q}, {ball_cover().view(), far}, context());
        EXPECT_EQ(found.verdict, found.reason == Undecided::no ? Verdict::separated : Verdict::undecided);
        EXPECT_EQ(raycast({tree, {}, q}, Ray{}, context()).reason == Undecided::no, found.reason == Undecided::no);
        return found.reason;
    };
    std::vector<float> q = torus().ranges;
    EXPECT_EQ(reason(q), Undecided::no);
    EXPECT_EQ(reason({}), Undecided::no);
    for (const float bad : {std::nextafter(q[1], 100.0f), -std::nextafter(q[1], 100.0f), HUGE_VALF,
                            std::numeric_limits<float>::quiet_NaN()}) {
        std::vector<float> other = q;
        other[1] = bad;
        EXPECT_EQ(reason(other), Undecided::coordinates);
    }
    EXPECT_EQ(reason({q[0], q[1]}), Undecided::coordinates);
    const Pose nowhere{{std::numeric_limits<float>::quiet_NaN(), 0, 0}, {}};
    EXPECT_EQ(collide({tree, nowhere, q}, {tree, {}, q}, context()).reason, Undecided::input);
    const auto out_of_budget = collide({tree, {}, q}, {tree, {}, q}, context(), {.max_pair_tests = 0});
    EXPECT_EQ(out_of_budget.verdict, Verdict::undecided);
    EXPECT_EQ(out_of_budget.reason, Undecided::budget);
    EXPECT_EQ(collide({tree, {}, q}, {tree, {}, q}, Scratch(std::span<std::byte>())).reason, Undecided::input);
}

TEST_F(Deform, MarginsAndScalesAreTakenLikeThoseOfRigidBodies) {
    const TreeView tree = ball_cover().view();
    const std::vector<float> q = ball().ranges;
    const TreeView large = *tree.scaled(2);
    Random random(10);
    for (int i = 0; i < 200; ++i) {
        const Pose pose = near_pose(random, 4),
                   doubled{{2 * pose.translation.x, 2 * pose.translation.y, 2 * pose.translation.z}, pose.rotation};
        const auto one = collide({tree, {}, q}, {tree, pose, q}, context());
        EXPECT_EQ(collide({large, {}, q}, {large, doubled, q}, context()).verdict, one.verdict);
        const auto wide = collide({tree, {}, q}, {tree, pose, q}, context(), {.margin = 0.5f});
        const auto rounded = collide({*tree.rounded(0.25f), {}, q}, {*tree.rounded(0.25f), pose, q}, context());
        if (wide.verdict == Verdict::separated) {
            EXPECT_EQ(one.verdict, Verdict::separated);
        }
        EXPECT_EQ(rounded.verdict, wide.verdict);
    }
}

TEST_F(Deform, ProofNoticesBoundsThatAreTooSmall) {
    const TreeView tree = torus_cover().view();
    const auto proof = verify_modes(tree, torus().mesh.view(), torus().modes());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->proved);
    const auto section = tree.section(0);
    ASSERT_EQ(std::memcmp(section.kind, kDeformationKind, 4), 0);
    const auto begin = static_cast<size_t>(section.content.data() - tree.bytes().data());
    uint32_t tight = 0, planted = 0;
    tree.for_each_node([&](uint32_t node) {
        std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
        const uint32_t mode = node % 4;
        std::byte* const growth =
            bytes.data() + begin + motions_begin(4) + (size_t{node} * 4 + mode) * kMotionBytes + kGrowth;
        uint16_t value;
        std::memcpy(&value, growth, 2);
        const uint16_t kind = value & kIsRadius;
        value &= kMostMotionSteps;
        if (value < 100) return;
        ++planted;
        value = static_cast<uint16_t>(value * 0.98);
        value |= kind;
        std::memcpy(growth, &value, 2);
        const auto planted_tree = TreeView::open(bytes, {.check_hash = false});
        ASSERT_TRUE(planted_tree);
        const auto found = verify_modes(*planted_tree, torus().mesh.view(), torus().modes());
        ASSERT_TRUE(found);
        tight += !found->proved && found->node == node && found->mode == mode;
    });
    EXPECT_GT(planted, 10u);
    EXPECT_EQ(tight, planted); // growths are no larger than they need be, but for 2 %
}

TEST(Modes, BadOnesAreRefused) {
    const Moving& body = ball();
    BuildOptions options = quick(1);
    const Build built = must_build(body.mesh, options);
    const auto code = [&](const std::vector<float>& u, const std::vector<float>& ranges) {
        const auto tree = add_modes(built.tree.view(), body.mesh.view(), {u, ranges});
        return tree ? "" : std::string(tree.error().what);
    };
    const auto mentions = [](const std::string& text, const char* word) {
        return text.find(word) != std::string::npos;
    };
    EXPECT_EQ(code(body.displacements, body.ranges), "");
    EXPECT_TRUE(mentions(code({}, {}), "1 to 64"));
    auto u = body.displacements;
    u.pop_back();
    EXPECT_TRUE(mentions(code(u, body.ranges), "number of vertices"));
    u = body.displacements, u[7] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_TRUE(mentions(code(u, body.ranges), "not finite"));
    for (const float bad : {0.0f, -1.0f, HUGE_VALF, std::numeric_limits<float>::quiet_NaN()})
        EXPECT_TRUE(mentions(code(body.displacements, {1, bad, 1}), "range of a mode"));
    EXPECT_TRUE(mentions(code(body.displacements, {1, 1e6f, 1}), "thousandfold"));
    EXPECT_TRUE(mentions(code(body.displacements, {1, 3e38f, 1}), "2^74"));
    const auto other = add_modes(built.tree.view(), torus().mesh.view(), torus().modes());
    ASSERT_FALSE(other);
    EXPECT_TRUE(mentions(other.error().what, "another mesh"));
    EXPECT_FALSE(add_modes(ball_cover().view(), body.mesh.view(), body.modes())); // has some already
    // Vertices in one place are joined, and must move alike.
    Mesh doubled = body.mesh;
    doubled.vertices.push_back(doubled.vertices[doubled.triangles[0][0]]);
    doubled.triangles[0][0] = static_cast<uint32_t>(doubled.vertices.size()) - 1;
    Moving seam(doubled, 2, 0.1, 3);
    EXPECT_TRUE(add_modes(built.tree.view(), doubled.view(), seam.modes()));
    seam.displacements.back() += 1;
    const auto torn = add_modes(built.tree.view(), doubled.view(), seam.modes());
    ASSERT_FALSE(torn);
    EXPECT_TRUE(mentions(torn.error().what, "one place"));
    EXPECT_EQ(torn.error().where, doubled.vertices.size() - 1);
}

// Every byte that is damaged is found, with hashes; and without, what is opened answers without harm.
TEST_F(Deform, DamagedSectionsAreRefusedOrHarmless) {
    const TreeView tree = ball_cover().view();
    const auto content = tree.section(0).content;
    const auto begin = static_cast<size_t>(content.data() - tree.bytes().data());
    Random random(11);
    int opened = 0;
    for (int i = 0; i < 3000; ++i) {
        std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
        const size_t at = begin + (i % 2 == 0 ? random.below(80) : random.below(static_cast<uint32_t>(content.size())));
        bytes[at] ^= static_cast<std::byte>(1 + random.below(255));
        EXPECT_FALSE(TreeView::open(bytes));
        const auto view = TreeView::open(bytes, {.check_hash = false});
        if (!view) continue;
        ++opened;
        const std::vector<float> q = ball().ranges;
        const auto found = collide({*view, {}, q}, {*view, {{2, 0, 0}, {}}, {}}, context());
        EXPECT_TRUE(found.verdict != Verdict::undecided || found.reason == Undecided::coordinates);
        raycast({*view, {}, q}, Ray{{-4, 0, 0}, {1, 0, 0}}, context());
    }
    EXPECT_GT(opened, 100);
}

} // namespace
} // namespace prolate

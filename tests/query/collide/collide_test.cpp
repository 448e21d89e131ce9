// Tree against tree: what the traversal promises, on synthetic trees over point clouds.
#include "query/collide/search.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/collide.hpp>
#include <prolate/pairs.hpp>

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <numbers>
#include <type_traits>
#include <vector>

namespace {
// Counts every allocation of the program, so that a query that allocates is seen.
uint64_t g_allocations = 0;
} // namespace

// noinline: g++ otherwise sees half of a pair and warns of a mismatch.
[[gnu::noinline]] void* operator new(size_t size) {
    ++g_allocations;
    if (void* p = std::malloc(size ? size : 1)) return p;
    throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(size_t size, const std::nothrow_t&) noexcept { // std::stable_sort's
    ++g_allocations;
    return std::malloc(size ? size : 1);
}
[[gnu::noinline]] void operator delete(void* p) noexcept {
    std::free(p);
}
[[gnu::noinline]] void operator delete(void* p, size_t) noexcept {
    std::free(p);
}

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;
using scenes::Scene;
using scenes::TreeOptions;

static_assert(noexcept(collide(std::declval<TreeView>(), Pose{}, std::declval<TreeView>(), Pose{},
                               std::declval<QueryContext&>())));
static_assert(noexcept(collide(Ellipsoid{}, Pose{}, Ellipsoid{}, Pose{})));
static_assert(std::is_trivially_default_constructible_v<QueryContext>);

Scene make(Random& random, const TreeOptions& options = {}, uint32_t points = 600) {
    return scenes::tree(random, scenes::cloud(random, points), options);
}
TreeView view(const Scene& scene) {
    return *TreeView::open(scene.bytes);
}

struct Query {
    Pose a, b;
};
// Two bodies whose centers are up to `reach` apart.
Query poses(Random& random, double reach, double unit = 1) {
    const Point d = random.direction();
    const double t = reach * random.unit() * unit;
    return {{{}, random.rotation()}, {scenes::to_float({t * d[0], t * d[1], t * d[2]}), random.rotation()}};
}
// Two bodies placed so that a point of one lies on a point of the other.
Query sharing_a_point(Random& random, const Scene& a, const Scene& b) {
    Query q{{{}, random.rotation()}, {{}, random.rotation()}};
    const auto pick = [&](const Scene& s) { return s.points[random.below(static_cast<uint32_t>(s.points.size()))]; };
    const Point p = scenes::rotate(q.a.rotation, pick(a)), r = scenes::rotate(q.b.rotation, pick(b));
    q.b.translation = scenes::to_float({p[0] - r[0], p[1] - r[1], p[2] - r[2]});
    return q;
}

CollideResult ask(const Scene& a, const Scene& b, const Query& q, const QueryOptions& options = {}) {
    QueryContext context;
    std::memset(&context, 0xee, sizeof context); // nothing may depend on what it holds
    return collide(view(a), q.a, view(b), q.b, context, options);
}
bool same(const CollideResult& x, const CollideResult& y) {
    return x.verdict == y.verdict && x.pair.node_a == y.pair.node_a && x.pair.node_b == y.pair.node_b &&
           x.stats.pair_tests == y.stats.pair_tests && x.stats.block_tests == y.stats.block_tests &&
           x.stats.deepest_level == y.stats.deepest_level;
}

// A zoo of trees: several degrees, depths, even and uneven.
std::vector<Scene> zoo(double shrink = 1) {
    Random random(2);
    std::vector<Scene> trees;
    for (const uint32_t degree : {2u, 3u, 8u, 16u, 64u})
        for (const double stop : {0.0, 0.3}) {
            const uint32_t levels = degree == 2 ? 8 : degree < 16 ? 4 : 3;
            trees.push_back(make(
                random,
                {.degree = degree, .levels = levels, .leaf_points = 4, .stop_probability = stop, .shrink = shrink}));
        }
    trees.push_back(make(random, {.levels = 1}, 50)); // a root only
    return trees;
}

TEST(Collide, ZooIsWhatItSays) {
    uint32_t uneven = 0;
    uint32_t widest = 0;
    for (const Scene& scene : zoo()) {
        const TreeView tree = view(scene);
        const LevelInfo last = tree.level(tree.level_count() - 1);
        bool early_leaf = false;
        tree.for_each_node([&](uint32_t n) {
            widest = std::max(widest, tree.children(n).count);
            early_leaf |= n < last.first_slot && tree.is_leaf(n);
        });
        uneven += early_leaf;
    }
    EXPECT_EQ(widest, 64u);
    EXPECT_GE(uneven, 5u);
}

// Number of false `separated` among placements where two points of the solids coincide.
uint32_t false_separations(const std::vector<Scene>& trees, uint32_t placements) {
    Random random(3);
    uint32_t wrong = 0;
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (uint32_t i = 0; i < placements; ++i)
                wrong += ask(a, b, sharing_a_point(random, a, b)).verdict == Verdict::separated;
    return wrong;
}

TEST(Collide, NeverSeparatesSolidsThatShareAPoint) {
    EXPECT_EQ(false_separations(zoo(), 40), 0u);
}
TEST(Collide, TheCheckAboveNoticesTreesThatDoNotCover) {
    EXPECT_GT(false_separations(zoo(0.7), 5), 0u);
}

// The traversal as query/collide/search.cpp's header words it, recursive and in the opposite order, on single-pair
// tests.
class BruteForce {
public:
    BruteForce(const Scene& a, const Scene& b, const Query& q, uint32_t max_level)
        : a_(view(a)), b_(view(b)), q_(q), max_level_(max_level) {}
    bool meets() { return !apart(0, 0) && descend(0, 0, 0); }

private:
    bool apart(uint32_t i, uint32_t j) { return collide(a_.bound(i), q_.a, b_.bound(j), q_.b) == Verdict::separated; }
    std::vector<uint32_t> below(const TreeView& tree, uint32_t node, uint32_t level) const {
        const ChildRange children = level >= max_level_ ? ChildRange{} : tree.children(node);
        std::vector<uint32_t> out;
        for (uint32_t i = children.count; i-- > 0;) out.push_back(children.first + i);
        return out;
    }
    bool descend(uint32_t i, uint32_t j, uint32_t level) { // the pair is known to meet
        auto children_a = below(a_, i, level), children_b = below(b_, j, level);
        if (children_a.empty() && children_b.empty()) return true;
        const bool both = !children_a.empty() && !children_b.empty();
        std::erase_if(children_b, [&](uint32_t c) { return apart(i, c); });
        std::erase_if(children_a, [&](uint32_t c) { return apart(c, j); });
        if (below(a_, i, level).empty()) children_a = {i};
        if (below(b_, j, level).empty()) children_b = {j};
        bool found = false;
        for (const uint32_t cb : children_b)
            for (const uint32_t ca : children_a)
                found = ((!both || !apart(ca, cb)) && descend(ca, cb, level + 1)) || found;
        return found;
    }
    TreeView a_, b_;
    Query q_;
    uint32_t max_level_;
};

TEST(Collide, EqualsBruteForce) {
    const auto trees = zoo();
    Random random(5);
    uint32_t queries = 0, apart = 0;
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (int i = 0; i < 4; ++i) {
                const Query q = poses(random, 2.5);
                const uint32_t max_level = random.below(4) ? kMaxLevels : random.below(5);
                const CollideResult result = ask(a, b, q, {.max_level = max_level});
                const bool meet = BruteForce(a, b, q, max_level).meets();
                if (max_level == kMaxLevels) {
                    ASSERT_EQ(result.verdict == Verdict::overlapping, meet);
                } else if (result.verdict == Verdict::overlapping) { // boxes, which it leaves out, may part more
                    ASSERT_TRUE(meet);
                }
                ++queries, apart += result.verdict == Verdict::separated;
            }
    EXPECT_GT(apart, queries / 4);
    EXPECT_LT(apart, queries * 3 / 4);
}

TEST(Collide, NamesAPairOfLeavesThatMeet) {
    const auto trees = zoo();
    Random random(7);
    uint32_t hits = 0;
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (int i = 0; i < 10; ++i) {
                const Query q = poses(random, 2);
                const CollideResult result = ask(a, b, q);
                if (result.verdict != Verdict::overlapping) continue;
                ++hits;
                ASSERT_TRUE(view(a).is_leaf(result.pair.node_a) && view(b).is_leaf(result.pair.node_b));
                const reference::Pair pair(view(a).ellipsoid(result.pair.node_a), q.a,
                                           view(b).ellipsoid(result.pair.node_b), q.b);
                ASSERT_LT(reference::contact(pair), 1 + 1e-9L);
            }
    EXPECT_GT(hits, 300u);
}

TEST(Collide, SwappingTheBodiesChangesNothing) {
    const auto trees = zoo();
    Random random(11);
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (int i = 0; i < 12; ++i) {
                Query q = poses(random, 2.5);
                if (i == 0) q.b = q.a; // equal poses
                if (i == 1) q.b.rotation = q.a.rotation;
                QueryOptions options;
                if (i % 2) options.max_pair_tests = random.below(100);
                if (i % 3 == 0) options.max_level = random.below(5);
                const CollideResult ab = ask(a, b, q, options);
                CollideResult ba = ask(b, a, {q.b, q.a}, options);
                if (&a != &b || i > 0) std::swap(ba.pair.node_a, ba.pair.node_b); // else the same question
                ASSERT_TRUE(same(ab, ba));
            }
}

TEST(Collide, EqualTreesAtEqualPosesOverlap) {
    for (const Scene& a : zoo()) {
        const Scene copy = a;
        const Query q{{{1, 2, 3}, {1, 2, 3, 4}}, {{1, 2, 3}, {1, 2, 3, 4}}};
        EXPECT_EQ(ask(a, a, q).verdict, Verdict::overlapping);
        EXPECT_TRUE(same(ask(a, a, q), ask(a, copy, q)));
        EXPECT_TRUE(same(ask(a, copy, q), ask(copy, a, q)));
    }
}

TEST(Collide, IsInvariantUnderACommonRigidMotion) {
    // Quarter turns and whole steps are exact in floats, so that verdicts may differ by double rounding at most:
    // pairs that near to contact do not occur among random ones.
    const auto trees = zoo();
    Random random(13);
    const float h = 0.5f;
    const Quat turns[] = {{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, -1, 1}, {h, h, h, h}, {1, 0, 0, 0}};
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (const Quat& turn : turns) {
                Query q = poses(random, 2.5);
                for (Vec3* t : {&q.a.translation, &q.b.translation}) // multiples of 2^-12
                    for (float* x : {&t->x, &t->y, &t->z}) *x = std::nearbyint(*x * 0x1p12f) * 0x1p-12f;
                const auto moved = [&](const Pose& pose) {
                    const Point t = scenes::rotate(turn, {pose.translation.x, pose.translation.y, pose.translation.z});
                    const Quat& r = pose.rotation;
                    return Pose{scenes::to_float({t[0] + 100, t[1] - 30, t[2] + 7}),
                                {turn.w * r.x + turn.x * r.w + turn.y * r.z - turn.z * r.y,
                                 turn.w * r.y - turn.x * r.z + turn.y * r.w + turn.z * r.x,
                                 turn.w * r.z + turn.x * r.y - turn.y * r.x + turn.z * r.w,
                                 turn.w * r.w - turn.x * r.x - turn.y * r.y - turn.z * r.z}};
                };
                ASSERT_EQ(ask(a, b, q).verdict, ask(a, b, {moved(q.a), moved(q.b)}).verdict);
            }
}

TEST(Collide, IsExactlyInvariantUnderPowersOfTwo) {
    for (const double unit : {0x1p-20, 0x1p-3, 0x1p20}) {
        Random one(17), other(17), random(19);
        const Scene a = make(one), b = make(one, {.degree = 4});
        const Scene scaled_a = make(other, {.unit = unit}), scaled_b = make(other, {.degree = 4, .unit = unit});
        for (int i = 0; i < 200; ++i) {
            const Query q = poses(random, 2.5);
            Query scaled = q;
            for (Vec3* t : {&scaled.a.translation, &scaled.b.translation})
                for (float* x : {&t->x, &t->y, &t->z}) *x *= static_cast<float>(unit);
            ASSERT_TRUE(same(ask(a, b, q), ask(scaled_a, scaled_b, scaled)));
        }
    }
}

TEST(Collide, DeeperNeverRevokesSeparated) {
    const auto trees = zoo();
    Random random(23);
    uint32_t gained = 0; // queries where depth made the difference
    for (const Scene& a : trees)
        for (const Scene& b : trees)
            for (int i = 0; i < 8; ++i) {
                const Query q = poses(random, 2.5);
                Verdict before = ask(a, b, q, {.max_level = 0}).verdict;
                const Verdict shallow = before;
                for (uint32_t level = 1; level <= 9; ++level) {
                    const CollideResult result = ask(a, b, q, {.max_level = level});
                    ASSERT_LE(result.stats.deepest_level, level);
                    ASSERT_FALSE(before == Verdict::separated && result.verdict != Verdict::separated);
                    before = result.verdict;
                }
                ASSERT_EQ(before, ask(a, b, q).verdict);
                gained += shallow != before;
            }
    EXPECT_GT(gained, 50u);
}

TEST(Collide, ABudgetIsKeptAndNeverLies) {
    const auto trees = zoo();
    Random random(31);
    for (const Scene& a : trees)
        for (const Scene& b : trees) {
            const Query q = poses(random, 2);
            const CollideResult full = ask(a, b, q);
            const uint64_t need = full.stats.pair_tests;
            for (uint64_t budget = 0; budget <= need + 2; budget += 1 + budget / 8) {
                const CollideResult result = ask(a, b, q, {.max_pair_tests = budget});
                if (budget < need) {
                    ASSERT_EQ(result.verdict, Verdict::undecided);
                    ASSERT_LE(result.stats.pair_tests, budget);
                } else {
                    ASSERT_TRUE(same(result, full));
                }
            }
            ASSERT_TRUE(same(full, ask(a, b, q, {.max_pair_tests = need})));
            ASSERT_EQ(ask(a, b, q, {.max_pair_tests = need - 1}).verdict, Verdict::undecided);
        }
}

TEST(Collide, RepeatsItsBitsAndAllocatesNothing) {
    const auto trees = zoo();
    Random random(37);
    QueryContext context;
    for (const Scene& a : trees)
        for (const Scene& b : trees) {
            const Query q = poses(random, 2);
            const TreeView view_a = view(a), view_b = view(b);
            const uint64_t before = g_allocations;
            const CollideResult first = collide(view_a, q.a, view_b, q.b, context);
            const CollideResult second = collide(view_a, q.a, view_b, q.b, context);
            ASSERT_EQ(g_allocations, before);
            ASSERT_TRUE(same(first, second));
            ASSERT_TRUE(same(first, ask(a, b, q)));
        }
    EXPECT_GT(g_allocations, 0u) << "the counter does not count";
}

TEST(Collide, OpenAllocatesNothing) {
    const auto trees = zoo();
    const uint64_t before = g_allocations;
    for (const Scene& scene : trees) ASSERT_TRUE(TreeView::open(scene.bytes));
    EXPECT_EQ(g_allocations, before);
}

// What queries ask of a tree first, but for rounding: ball and box hold what is below the root, and little else.
TEST(Collide, RootVolumesAreTight) {
    constexpr double kOne = 1 + 1e-12;
    for (const Scene& scene : zoo()) {
        const TreeView tree = view(scene);
        const detail::RootVolume& root = tree.raw().root();
        const Ellipsoid& e = tree.root_bound();
        const double longest = principal_axes(e).radii[0];
        ASSERT_GE(root.radius * kOne, longest);
        ASSERT_LE(root.radius, 1.036 * longest);
        ASSERT_EQ(Point({root.center[0], root.center[1], root.center[2]}), Point({e.center.x, e.center.y, e.center.z}));
        ASSERT_DOUBLE_EQ(root.half[0], e.l11);
        ASSERT_DOUBLE_EQ(root.half[1], std::hypot(double{e.l21}, double{e.l22}));
        ASSERT_DOUBLE_EQ(root.half[2], std::hypot(double{e.l31}, double{e.l32}, double{e.l33}));
    }
    for (const Vec3 offset : {Vec3{}, Vec3{3, -50, 0.1f}}) {
        const scenes::ExactScene scene = scenes::exact_tree(shapes::moved(shapes::torus(1, 0.3f, 16, 8), offset));
        const detail::RootVolume root = TreeView::open(scene.bytes)->raw().root();
        double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}, farthest = 0;
        for (const Vec3& v : scene.mesh.vertices) {
            const double p[] = {v.x, v.y, v.z};
            for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
            farthest =
                std::max(farthest, std::hypot(p[0] - root.center[0], p[1] - root.center[1], p[2] - root.center[2]));
        }
        for (size_t i = 0; i < 3; ++i) {
            ASSERT_EQ(root.center[i] - root.half[i], low[i]);
            ASSERT_EQ(root.center[i] + root.half[i], high[i]);
        }
        ASSERT_DOUBLE_EQ(root.radius, farthest);
    }
}

// Two cubes, each turned by 15 degrees, edge over crossed edge: no side of either tells them apart.
TEST(Collide, BoxesOfRootsAreApartAlongAnAxisAcrossTheirEdges) {
    const scenes::ExactScene cube = scenes::exact_tree(shapes::box());
    const TreeView tree = *TreeView::open(cube.bytes), smaller = *tree.scaled(0.75f);
    const detail::RootVolume& root = tree.raw().root();
    constexpr double kTurn = std::numbers::pi / 12;
    const double top = (std::sin(kTurn) + std::cos(kTurn)) * root.half[0]; // of an edge over the center
    const float s = static_cast<float>(std::sin(kTurn / 2)), c = static_cast<float>(std::cos(kTurn / 2));
    const auto gap_at = [&](double distance) { // of centers, along z
        Pose a{{}, {s, 0, 0, c}}, b{{}, {0, s, 0, c}};
        for (Pose* const p : {&a, &b}) {
            const float scale = p == &a ? 1 : 0.75f;
            const Point at =
                scenes::rotate(p->rotation, {scale * root.center[0], scale * root.center[1], scale * root.center[2]});
            p->translation = scenes::to_float({-at[0], -at[1], (p == &a ? 0 : distance) - at[2]});
        }
        return query::gap_of_boxes(tree, smaller, query::relative_pose(a, b));
    };
    for (const double gap : {1e-4, 1e-3, 5e-3}) { // beyond, sides tell
        EXPECT_NEAR(gap_at(1.75 * top + gap), gap, 1e-6);
        EXPECT_LT(gap_at(1.75 * top - gap), 0);
    }
}

// Boxes whose edges cross, or all but do not, within rounding of contact: collide_all() does not ask the roots.
TEST(Collide, RootsSayNoMoreThanTriangles) {
    Random random(45);
    QueryContext context;
    uint32_t apart = 0, at_once = 0;
    for (int i = 0; i < 300; ++i) {
        const auto side = [&] { return static_cast<float>(random.log_in(0.01, 1)); };
        const scenes::ExactScene a = scenes::exact_tree(shapes::box(side(), side(), side())),
                                 b = scenes::exact_tree(shapes::box(side(), side(), side()));
        const TreeView tree_a = *TreeView::open(a.bytes), tree_b = *TreeView::open(b.bytes);
        const Quat turn = random.rotation();
        const auto nearly = [&](float x) { return x + static_cast<float>(random.log_in(1e-9, 1e-2)); };
        const Quat other =
            i % 3 == 0 ? random.rotation() : Quat{nearly(turn.x), nearly(turn.y), nearly(turn.z), turn.w};
        const Point d = random.direction();
        const auto ask_at = [&](double distance, bool all) {
            Pose pose_a{{}, turn}, pose_b{{}, other};
            float* const to_a[] = {&pose_a.translation.x, &pose_a.translation.y, &pose_a.translation.z};
            float* const to_b[] = {&pose_b.translation.x, &pose_b.translation.y, &pose_b.translation.z};
            for (size_t k = 0; k < 3; ++k) { // 48 bits
                *to_b[k] = static_cast<float>(distance * d[k]);
                *to_a[k] = static_cast<float>(*to_b[k] - distance * d[k]);
            }
            if (all) return collide_all(tree_a, pose_a, tree_b, pose_b, {}, context).verdict;
            const CollideResult result = collide(tree_a, pose_a, tree_b, pose_b, context);
            at_once += result.verdict == Verdict::separated && result.stats.pair_tests == 1;
            return result.verdict;
        };
        double low = 0, high = 5;
        for (int k = 0; k < 60; ++k) {
            const double middle = (low + high) / 2;
            (ask_at(middle, true) == Verdict::separated ? high : low) = middle;
        }
        for (int k = 0; k < 10; ++k) {
            const double distance = high + (k % 2 == 0 ? 1 : -1) * random.log_in(1e-17, 1e-12);
            const Verdict verdict = ask_at(distance, true);
            ASSERT_EQ(ask_at(distance, false), verdict) << i;
            apart += verdict == Verdict::separated;
        }
    }
    EXPECT_GT(apart, 1000u);
    EXPECT_GT(at_once, 500u);
}

TEST(Collide, CountsItsWork) {
    Random random(41);
    const Scene a = make(random), b = make(random);
    const CollideResult far = ask(a, b, {{}, {{50, 0, 0}, {}}});
    EXPECT_EQ(far.verdict, Verdict::separated);
    EXPECT_EQ(far.stats.pair_tests, 1u);
    EXPECT_EQ(far.stats.block_tests, 0u); // spheres told
    EXPECT_EQ(far.stats.deepest_level, 0u);
    const CollideResult near = ask(a, b, sharing_a_point(random, a, b));
    EXPECT_GE(near.stats.pair_tests, 17u); // the roots, then 8 + 8
    EXPECT_GE(near.stats.pair_tests, near.stats.block_tests);
    EXPECT_LE(near.stats.pair_tests, 8 * near.stats.block_tests);
    EXPECT_EQ(near.stats.deepest_level, 3u);
}

TEST(Collide, ChangedBytesThatOpenStillAnswer) {
    Random random(47);
    Scene scene = make(random, {.degree = 3, .levels = 3}, 60);
    const Scene other = make(random, {.degree = 3, .levels = 3}, 60);
    uint32_t answered = 0;
    QueryContext context;
    for (size_t at = 0; at < scene.bytes.size(); ++at)
        for (const unsigned flip : {1u, 0x10u, 0x80u, 0xffu}) {
            scene.bytes[at] ^= std::byte(flip);
            if (const auto tree = TreeView::open(scene.bytes, {.check_hash = false})) {
                const Query q = poses(random, 1);
                const CollideResult result = collide(*tree, q.a, view(other), q.b, context);
                ASSERT_NE(result.verdict, Verdict::undecided);
                ASSERT_TRUE(result.pair.node_a < tree->slot_count() && tree->is_node(result.pair.node_a));
                ++answered;
            }
            scene.bytes[at] ^= std::byte(flip);
        }
    EXPECT_GT(answered, 500u);
}

TEST(Collide, NoDistanceIsSoLargeThatACacheTakesItForInfinite) {
    Random random(44);
    const Scene scene = make(random);
    const TreeView tree = view(scene);
    const Pose left{{-3e38f, 0, 0}, {}}, right{{3e38f, 0, 0}, {}};
    QueryContext context;
    PairCache cache;
    ASSERT_EQ(collide(tree, left, tree, right, context, {}, &cache).verdict, Verdict::separated);
    EXPECT_EQ(cache.distance, std::numeric_limits<float>::max());
    EXPECT_EQ(collide(tree, {}, tree, {}, context, {}, &cache).verdict, Verdict::overlapping);
}

TEST(Collide, ABadPoseNeverSeparates) {
    Random random(43);
    const Scene a = make(random), b = make(random);
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    const Pose good{{50, 0, 0}, {}};
    std::vector<Pose> bad(6, good);
    bad[0].translation.x = kNan, bad[1].translation.y = kInf, bad[2].rotation.z = kNan, bad[3].rotation.w = kInf;
    bad[4].rotation = {0, 0, 0, 0}, bad[5].translation.x = -kInf;
    for (const Pose& pose : bad) {
        EXPECT_EQ(ask(a, b, {{}, pose}).verdict, Verdict::overlapping);
        EXPECT_EQ(ask(a, b, {pose, {}}).verdict, Verdict::overlapping);
        EXPECT_LT(ask(a, b, {{}, pose}).stats.pair_tests, 100u); // straight down, no search
    }
}

} // namespace
} // namespace prolate

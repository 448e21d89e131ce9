// Bodies in motion: what sweep() promises, against positions in long double at many times.
#include "query/sweep/motion.hpp"
#include "query/sweep/search.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/distance.hpp>
#include <prolate/sweep.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using reference::Matrix;
using reference::Real;
using reference::vector;
using reference::Vector;
using reference::operator*;
using reference::operator+;
using reference::operator-;
using scenes::Point;
using scenes::Random;

static_assert(noexcept(sweep(std::declval<TreeView>(), Motion{}, std::declval<TreeView>(), Motion{},
                             std::declval<QueryContext&>())));
static_assert(sizeof(Motion) == 16 * sizeof(float));

Vector scaled(Real s, const Vector& v) {
    return {s * v[0], s * v[1], s * v[2]};
}

// The motion as sweep.hpp words it: Rodrigues' formula in long double.
class Path {
public:
    explicit Path(const Motion& m)
        : start_(reference::rotation(m.start.rotation)), from_(vector(m.start.translation)), linear_(vector(m.linear)),
          angular_(vector(m.angular)), center_(vector(m.center)) {}
    Matrix rotation(Real t) const {
        const Real angle = std::sqrt(reference::dot(angular_, angular_));
        if (!(angle > 0)) return start_;
        const Vector k = scaled(1 / angle, angular_);
        const Real s = std::sin(t * angle), c = std::cos(t * angle);
        Matrix turn;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) turn[i][j] = (i == j ? c : 0) + (1 - c) * k[i] * k[j];
        turn[0][1] -= s * k[2], turn[1][0] += s * k[2], turn[0][2] += s * k[1], turn[2][0] -= s * k[1];
        turn[1][2] -= s * k[0], turn[2][1] += s * k[0];
        return turn * start_;
    }
    Vector operator()(const Vec3& x, Real t) const {
        return rotation(t) * (vector(x) - center_) + (start_ * center_ + from_ + scaled(t, linear_));
    }

private:
    Matrix start_;
    Vector from_, linear_, angular_, center_;
};

// A body and the slow truth about it.
struct Solid {
    std::vector<std::byte> bytes;
    Mesh mesh; // empty: one ellipsoid
    TreeView view() const { return *TreeView::open(bytes); }
};
Solid exact(const Mesh& mesh, uint32_t leaf_triangles = 2) {
    auto scene = scenes::exact_tree(mesh, {.degree = 4, .leaf_triangles = leaf_triangles});
    return {std::move(scene.bytes), std::move(scene.mesh)};
}
Solid single(Random& random) {
    const Point r = scenes::radii(random, 30);
    std::vector<Point> points;
    const Quat turn = random.rotation();
    for (int i = 0; i < 60; ++i) {
        const Point d = random.direction();
        points.push_back(scenes::rotate(turn, {r[0] * d[0], r[1] * d[1], r[2] * d[2]}));
    }
    return {scenes::tree(random, points, {.levels = 1}).bytes, {}};
}

double length(const Vector& v) {
    return static_cast<double>(std::sqrt(reference::dot(v, v)));
}

Real true_distance(const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Real t) {
    const Path pa(ma), pb(mb);
    const auto place = [&](const Solid& s, const Path& path) {
        std::vector<Vector> out;
        for (const Vec3& v : s.mesh.vertices) out.push_back(path(v, t));
        return out;
    };
    const auto va = place(a, pa), vb = place(b, pb);
    Real least = HUGE_VALL;
    for (const Triangle& x : a.mesh.triangles)
        for (const Triangle& y : b.mesh.triangles)
            least =
                std::min(least, reference::distance({va[x[0]], va[x[1]], va[x[2]]}, {vb[y[0]], vb[y[1]], vb[y[2]]}));
    return least;
}
// Of single ellipsoids: by what factor they must grow to touch; above 1 apart.
Real true_contact(const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Real t) {
    const Ellipsoid x = a.view().ellipsoid(0), y = b.view().ellipsoid(0);
    const Path pa(ma), pb(mb);
    reference::Pair pair(x, {}, y, {});
    pair.r = pb(y.center, t) - pa(x.center, t);
    pair.l1 = pa.rotation(t) * pair.l1, pair.l2 = pb.rotation(t) * pair.l2;
    pair.q1 = pair.l1 * reference::transposed(pair.l1), pair.q2 = pair.l2 * reference::transposed(pair.l2);
    return reference::contact(pair);
}

SweepResult ask(const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, const SweepOptions& options = {}) {
    QueryContext context;
    std::memset(&context, 0xee, sizeof context);
    return sweep(a.view(), ma, b.view(), mb, context, options);
}

std::vector<Solid> exact_zoo() {
    return {exact(shapes::tetrahedron()), exact(shapes::moved(shapes::box(2, 1, 0.5f), {-1, -0.5f, -0.25f})),
            exact(shapes::moved(shapes::box(3, 3, 1e-3f), {-1.5f, -1.5f, 0})),  // plate
            exact(shapes::moved(shapes::box(1e-3f, 1e-3f, 3), {0, 0, -1}), 12), // needle
            exact(shapes::moved(shapes::tetrahedron(), {4, 0, 0}, 0.5f))};      // far from its origin
}

// Motions of all kinds that bring bodies of about this size near each other.
std::pair<Motion, Motion> motions(Random& random, double size) {
    const auto vec = [&](double length) {
        const Point d = random.direction();
        return scenes::to_float({length * d[0], length * d[1], length * d[2]});
    };
    const Vec3 offset = random.below(3) == 0 ? vec(1000 * size) : Vec3{};
    const auto moved = [&](const Vec3& v) { return Vec3{offset.x + v.x, offset.y + v.y, offset.z + v.z}; };
    const auto motion = [&] {
        Motion m;
        m.start = {moved(vec(size * random.in(0, 6))), random.rotation()};
        if (random.below(4) != 0) m.linear = vec(size * random.log_in(0.1, 100));
        if (random.below(4) != 0) m.angular = vec(random.log_in(0.1, 20));
        if (random.below(2) != 0) m.center = vec(size * random.in(0, 2));
        return m;
    };
    Motion a = motion(), b = motion();
    if (random.below(4) != 0) { // aim: B flies at where A starts
        const Vec3 to = a.start.translation, from = b.start.translation;
        const auto aim = [&](float x, float y) {
            return static_cast<float>((x - y) * random.in(1, 2) + size * random.in(-1, 1));
        };
        b.linear = {aim(to.x, from.x), aim(to.y, from.y), aim(to.z, from.z)};
        a.linear = {};
    }
    return {a, b};
}

// Times before `end`, denser towards it.
template <class Visit> void sample_before(Random& random, double end, int count, Visit&& visit) {
    for (int i = 0; i < count; ++i) {
        const double u = random.unit();
        const double t = i % 3 == 0 ? end * (1 - std::ldexp(1.0, -i / 3)) : end * u;
        if (t < end) visit(t);
    }
}

struct Tally {
    int queries = 0, hits = 0, free = 0, at_start = 0, violations = 0;
};

SweepResult overshooting(const Solid& a, const Motion& ma, const Solid& b, const Motion& mb,
                         const SweepOptions& options, double overshoot) {
    QueryContext context;
    const TreeView x = a.view(), y = b.view();
    query::SweepSearch search(query::OrderedBodies<Motion>{x, y, ma, mb, false}, context, options);
    search.overshoot = overshoot;
    query::traverse(search);
    SweepResult out;
    out.verdict = search.found ? Verdict::overlapping : Verdict::separated;
    out.time_lower = out.time_upper = search.horizon;
    return out;
}

Tally hunt_exact(int rounds, int samples, double overshoot = 0) {
    const auto zoo = exact_zoo();
    Random random(1);
    Tally tally;
    for (int i = 0; i < rounds; ++i) {
        const Solid &a = zoo[random.below(static_cast<uint32_t>(zoo.size()))],
                    &b = zoo[random.below(static_cast<uint32_t>(zoo.size()))];
        const auto both = motions(random, 1);
        const Motion &ma = both.first, &mb = both.second;
        const SweepOptions options{.tolerance = random.log_in(1e-4, 1e-2),
                                   .margin = random.below(2) ? 0.0f : static_cast<float>(random.log_in(1e-3, 0.3))};
        const SweepResult r =
            overshoot > 0 ? overshooting(a, ma, b, mb, options, overshoot) : ask(a, ma, b, mb, options);
        ++tally.queries;
        sample_before(random, r.time_lower, samples,
                      [&](double t) { tally.violations += !(true_distance(a, ma, b, mb, t) > options.margin); });
        if (overshoot > 0) continue;
        EXPECT_NE(r.verdict, Verdict::undecided);
        if (r.verdict == Verdict::separated) {
            ++tally.free;
            EXPECT_EQ(r.time_lower, 1);
            continue;
        }
        tally.at_start += r.time_upper == 0;
        if (r.enclosed) continue;
        ++tally.hits;
        EXPECT_EQ(r.time_lower, r.time_upper);
        const Real d = true_distance(a, ma, b, mb, r.time_upper);
        EXPECT_LE(d, options.margin + options.tolerance + 1e-10);
        EXPECT_LE(d, r.distance + 1e-10);
        if (r.time_upper == 0) continue;
        // The witness: points of the bodies, that far apart along the normal.
        const Vector between = vector(r.point_b) - vector(r.point_a);
        const double rounding = 2e-7 * (1 + length(vector(r.point_a)));
        EXPECT_NEAR(length(between), r.distance, 8 * rounding);
        EXPECT_NEAR(static_cast<double>(reference::dot(between, vector(r.normal))), r.distance, 8 * rounding);
        const Triangle x = a.view().triangle(r.pair.triangle_a), y = b.view().triangle(r.pair.triangle_b);
        const Path pa(ma), pb(mb);
        const auto corners = [&](const TreeView& tree, const Triangle& t, const Path& path) {
            return reference::Corners{path(tree.vertex(t[0]), r.time_upper), path(tree.vertex(t[1]), r.time_upper),
                                      path(tree.vertex(t[2]), r.time_upper)};
        };
        const auto point = [](const Vec3& p) { return reference::Corners{vector(p), vector(p), vector(p)}; };
        EXPECT_LE(reference::distance(corners(a.view(), x, pa), point(r.point_a)), 4 * rounding);
        EXPECT_LE(reference::distance(corners(b.view(), y, pb), point(r.point_b)), 4 * rounding);
    }
    return tally;
}

TEST(Sweep, ExactBodiesNeverMeetBeforeTheCertifiedTime) {
    const Tally tally = hunt_exact(160, 16);
    EXPECT_EQ(tally.violations, 0);
    EXPECT_GT(tally.hits - tally.at_start, 40);
    EXPECT_GT(tally.free, 20);
    EXPECT_GT(tally.at_start, 2);
}
TEST(Sweep, TheCheckAboveNoticesStepsThatAreTooLong) {
    EXPECT_GT(hunt_exact(40, 16, 1.5).violations, 0);
}

TEST(Sweep, EllipsoidsNeverMeetBeforeTheCertifiedTime) {
    Random random(2);
    std::vector<Solid> zoo;
    for (int i = 0; i < 8; ++i) zoo.push_back(single(random));
    Tally tally;
    for (int i = 0; i < 200; ++i) {
        const Solid &a = zoo[random.below(8)], &b = zoo[random.below(8)];
        const auto both = motions(random, 1);
        const Motion &ma = both.first, &mb = both.second;
        const SweepOptions options{.tolerance = random.log_in(1e-5, 1e-2)};
        const SweepResult r = ask(a, ma, b, mb, options);
        ++tally.queries, tally.free += r.verdict == Verdict::separated, tally.at_start += r.time_upper == 0;
        sample_before(random, r.time_lower, 20,
                      [&](double t) { tally.violations += !(true_contact(a, ma, b, mb, t) > 1); });
        if (r.verdict != Verdict::overlapping || r.time_upper == 0) continue;
        ++tally.hits;
        ASSERT_LE(r.distance, options.tolerance);
        // Grown by a ball each of more than half of the distance, they meet.
        ASSERT_LT(true_contact(a, ma, b, mb, r.time_upper), 1 + 40 * options.tolerance);
    }
    EXPECT_EQ(tally.violations, 0);
    EXPECT_GT(tally.hits, 50);
    EXPECT_GT(tally.free, 30);
}

// What proxy trees promise is about the solids, here clouds of points, that they cover.
TEST(Sweep, SolidsOfProxyTreesNeverMeetBeforeTheCertifiedTime) {
    Random random(3);
    int hits = 0, free = 0, violations = 0;
    for (int i = 0; i < 60; ++i) {
        const auto scene = [&] {
            return scenes::tree(
                random, scenes::cloud(random, 200),
                {.degree = 2 + random.below(9), .levels = 4, .leaf_points = 4, .stop_probability = 0.2});
        };
        const scenes::Scene a = scene(), b = scene();
        auto [ma, mb] = motions(random, 1);
        // Two points of the solids meet at a time.
        const double t = random.unit();
        const Vec3 p = scenes::to_float(a.points[random.below(200)]), q = scenes::to_float(b.points[random.below(200)]);
        const Vector gap = Path(ma)(p, t) - Path(mb)(q, t);
        mb.start.translation.x += static_cast<float>(gap[0]), mb.start.translation.y += static_cast<float>(gap[1]);
        mb.start.translation.z += static_cast<float>(gap[2]);
        QueryContext context;
        const SweepResult r = sweep(*TreeView::open(a.bytes), ma, *TreeView::open(b.bytes), mb, context);
        ++(r.verdict == Verdict::overlapping ? hits : free);
        violations += r.time_lower > t;
    }
    EXPECT_EQ(violations, 0);
    EXPECT_EQ(free, 0);
    EXPECT_EQ(hits, 60);
}

// ---- tunnels ----

TEST(Sweep, ABulletDoesNotPassAPlate) {
    const Solid plate = exact(shapes::moved(shapes::box(2, 2, 1e-4f), {-1, -1, 0}));
    const Solid bullet = exact(shapes::moved(shapes::icosphere(1), {}, 0.01f));
    Random random(4);
    for (const float speed : {1.0f, 1e2f, 1e4f, 1e6f}) {
        for (int i = 0; i < 20; ++i) {
            Motion fly;
            fly.start.translation = {static_cast<float>(random.in(-0.9, 0.9)), static_cast<float>(random.in(-0.9, 0.9)),
                                     0.3f * speed};
            fly.linear = {0, 0, -speed};
            if (i % 2) fly.angular = {100, 30, 7};
            const SweepResult hit = ask(plate, {}, bullet, fly);
            ASSERT_EQ(hit.verdict, Verdict::overlapping);
            EXPECT_NEAR(hit.time_upper, 0.3 - 0.01 / speed, 0.003 / speed + 1e-7);
            EXPECT_NEAR(hit.normal.z, 1, 1e-3f);
            fly.start.translation.x = 1.02f; // just beside it
            EXPECT_EQ(ask(plate, {}, bullet, fly).verdict, Verdict::separated);
        }
    }
}

TEST(Sweep, AProxyBulletDoesNotPassAProxyPlate) {
    Random random(5);
    std::vector<Point> flat, round;
    for (int i = 0; i < 4000; ++i) flat.push_back({random.in(-1, 1), random.in(-1, 1), random.in(-1e-3, 1e-3)});
    for (int i = 0; i < 100; ++i) {
        const Point d = random.direction();
        round.push_back({0.05 * d[0], 0.05 * d[1], 0.05 * d[2]});
    }
    const auto plate = scenes::tree(random, flat, {.levels = 4}), bullet = scenes::tree(random, round, {.levels = 2});
    for (int i = 0; i < 50; ++i) {
        Motion fly;
        fly.start.translation = {static_cast<float>(random.in(-0.9, 0.9)), static_cast<float>(random.in(-0.9, 0.9)),
                                 300};
        fly.linear = {0, 0, -1000}, fly.angular = {static_cast<float>(random.in(0, 50)), 3, 0};
        QueryContext context;
        const SweepResult r = sweep(*TreeView::open(plate.bytes), {}, *TreeView::open(bullet.bytes), fly, context);
        ASSERT_EQ(r.verdict, Verdict::overlapping);
        EXPECT_NEAR(r.time_upper, 0.3, 1e-3);
        EXPECT_LT(r.stats.block_tests, 500u);
    }
}

TEST(Sweep, ASpinningRodDoesNotPassAPlate) {
    const Solid rod = exact(shapes::moved(shapes::box(2, 1e-3f, 1e-3f), {0, 0, 0}));
    const Solid plate = exact(shapes::moved(shapes::box(1e-3f, 0.5f, 1), {0, 1.2f, -0.5f}));
    for (const float turns : {1.0f, 8.0f, 32.0f}) {
        Motion spin;
        spin.angular = {0, 0, 2 * std::numbers::pi_v<float> * turns};
        const SweepResult r = ask(rod, spin, plate, {});
        ASSERT_EQ(r.verdict, Verdict::overlapping);
        EXPECT_NEAR(r.time_upper, 0.25 / turns, 0.01 / turns);
        EXPECT_LT(r.stats.pair_tests, 2000u);
        spin.start.translation.y = -0.81f; // reaches up to 1.19
        EXPECT_EQ(ask(rod, spin, plate, {}).verdict, Verdict::separated);
    }
}

TEST(Sweep, ABoxThatTipsOverAnEdgeIsNotHeldByIt) {
    // Its edge rests 1.5 tolerances above the floor.
    const Solid floor = exact(shapes::moved(shapes::box(20, 20, 1), {-10, -10, -1})), box = exact(shapes::box());
    Motion tip;
    tip.start = {{0, 0, 1.5e-3f}, {0, -0.2f, 0, 1}};
    tip.angular = {0, 2 * std::atan(0.2f), 0};
    const SweepResult r = ask(floor, {}, box, tip, {.tolerance = 1e-3});
    EXPECT_GT(r.time_lower, 0.99);
    EXPECT_LT(r.stats.pair_tests, 3000u);
}

// ---- starts ----

TEST(Sweep, BodiesThatOverlapAtTheStartMeetAtTimeZero) {
    const auto zoo = exact_zoo();
    Random random(6);
    for (const Solid& a : zoo)
        for (const Solid& b : zoo) {
            auto [ma, mb] = motions(random, 1);
            const Vector gap = Path(ma)(a.mesh.vertices[0], 0) - Path(mb)(b.mesh.vertices[0], 0);
            mb.start.translation.x += static_cast<float>(gap[0]), mb.start.translation.y += static_cast<float>(gap[1]);
            mb.start.translation.z += static_cast<float>(gap[2]);
            const SweepResult r = ask(a, ma, b, mb, {.tolerance = 1e-3});
            EXPECT_EQ(r.verdict, Verdict::overlapping);
            EXPECT_EQ(r.time_lower, 0);
            EXPECT_EQ(r.time_upper, 0);
        }
}
TEST(Sweep, ABodyInsideAnotherMeetsItAtTimeZero) {
    const Solid outer = exact(shapes::icosphere(3)), inner = exact(shapes::moved(shapes::tetrahedron(), {}, 0.1f));
    Motion fly;
    fly.linear = {3, 0, 0};
    for (const bool swap : {false, true}) {
        const SweepResult r = swap ? ask(inner, fly, outer, {}) : ask(outer, {}, inner, fly);
        EXPECT_EQ(r.verdict, Verdict::overlapping);
        EXPECT_TRUE(r.enclosed);
        EXPECT_EQ(r.time_lower, 0);
        EXPECT_EQ(r.time_upper, 0);
    }
    const Solid hollow = exact(shapes::hollow_ball()); // its cavity is outside
    fly.start.translation = {0, 0, 0};
    const SweepResult r = ask(hollow, {}, inner, fly);
    EXPECT_EQ(r.verdict, Verdict::overlapping);
    EXPECT_FALSE(r.enclosed);
    EXPECT_GT(r.time_lower, 0.05);
}
TEST(Sweep, BodiesAtRestAreAskedAboutOnce) {
    const Solid a = exact(shapes::torus(1, 0.3f, 40, 20)), b = a;
    Motion still;
    still.start.translation = {0.7f, 0, 1};
    const SweepResult r = ask(a, {}, b, still);
    EXPECT_EQ(r.verdict, Verdict::separated);
    EXPECT_EQ(r.time_lower, 1);
}

// More pairs of triangles near each other than the scratch has room for: a ball in a ball.
TEST(Sweep, ManyPairsNearEachOther) {
    Mesh shell = shapes::moved(shapes::icosphere(4), {}, 1.3f);
    shapes::append(shell, shapes::inverted(shapes::icosphere(4)));
    const Solid outer = exact(shell, 4), inner = exact(shapes::moved(shapes::icosphere(4), {}, 0.97f), 4);
    Motion turn;
    turn.angular = {0, 0.02f, 0.02f};
    const SweepResult free = ask(outer, {}, inner, turn, {.tolerance = 1e-3});
    EXPECT_EQ(free.verdict, Verdict::separated);
    EXPECT_GT(free.stats.pair_tests, 2 * QueryContext::kEntries);
    turn.linear = {0, 0, 0.06f};
    const SweepResult hit = ask(outer, {}, inner, turn, {.tolerance = 1e-3});
    EXPECT_EQ(hit.verdict, Verdict::overlapping);
    EXPECT_NEAR(hit.time_upper, 0.5, 0.07);
    QueryContext context;
    const DistanceResult d =
        distance(outer.view(), pose_at({}, hit.time_upper), inner.view(), pose_at(turn, hit.time_upper), context);
    EXPECT_LT(d.upper, 1.001e-3);
    EXPECT_GT(d.lower, 0.499e-3);
}

// ---- what holds for all queries ----

bool same(const SweepResult& x, const SweepResult& y) {
    return x.verdict == y.verdict && x.enclosed == y.enclosed && x.time_lower == y.time_lower &&
           x.time_upper == y.time_upper && x.distance == y.distance && x.point_a == y.point_a &&
           x.point_b == y.point_b && x.normal == y.normal && x.pair == y.pair &&
           x.stats.pair_tests == y.stats.pair_tests && x.stats.block_tests == y.stats.block_tests &&
           x.stats.triangle_tests == y.stats.triangle_tests && x.stats.deepest_level == y.stats.deepest_level;
}

template <class Check> void for_each_query(int rounds, Check&& check) {
    std::vector<Solid> zoo = exact_zoo();
    Random random(7);
    zoo.push_back(single(random));
    zoo.push_back(exact(shapes::torus(1, 0.3f, 40, 20), 4));
    zoo.push_back({scenes::tree(random, scenes::cloud(random, 400), {}).bytes, {}});
    for (int i = 0; i < rounds; ++i) {
        const Solid &a = zoo[random.below(static_cast<uint32_t>(zoo.size()))],
                    &b = zoo[random.below(static_cast<uint32_t>(zoo.size()))];
        const auto [ma, mb] = motions(random, 1);
        check(a, ma, b, mb, random);
    }
}

TEST(Sweep, SwappingTheBodiesSwapsTheAnswer) {
    for_each_query(150, [](const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Random&) {
        SweepResult ba = ask(b, mb, a, ma);
        std::swap(ba.point_a, ba.point_b);
        std::swap(ba.pair.node_a, ba.pair.node_b), std::swap(ba.pair.triangle_a, ba.pair.triangle_b);
        const auto flip = [](float x) { return x == 0 ? x : -x; };
        ba.normal = {flip(ba.normal.x), flip(ba.normal.y), flip(ba.normal.z)};
        EXPECT_TRUE(same(ask(a, ma, b, mb), ba));
    });
}

TEST(Sweep, EveryInstructionSetGivesTheSameBits) {
    std::vector<SweepResult> first;
    targets::for_each([&](const char* name) {
        size_t i = 0;
        for_each_query(60, [&](const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Random&) {
            const SweepResult r = ask(a, ma, b, mb);
            if (i == first.size()) first.push_back(r);
            EXPECT_TRUE(same(first[i++], r)) << name;
        });
    });
}

TEST(Sweep, ABudgetCostsTightnessOnly) {
    int undecided = 0;
    for_each_query(80, [&](const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Random& random) {
        const SweepResult whole = ask(a, ma, b, mb);
        double before = 0;
        uint64_t budget = 0;
        for (int i = 0; i < 12; ++i) {
            budget += random.below(1 + static_cast<uint32_t>(whole.stats.pair_tests / 4));
            const SweepResult r = ask(a, ma, b, mb, {.max_pair_tests = budget});
            EXPECT_LE(r.stats.pair_tests, budget);
            EXPECT_GE(r.time_lower, before);
            EXPECT_LE(r.time_lower, whole.time_lower);
            EXPECT_TRUE(r.verdict == Verdict::undecided || r.verdict == whole.verdict);
            undecided += r.verdict == Verdict::undecided;
            before = r.time_lower;
        }
    });
    EXPECT_GT(undecided, 200);
}

TEST(Sweep, CoarserCoversMeetNoLater) {
    int shallow_free = 0;
    for_each_query(80, [&](const Solid& a, const Motion& ma, const Solid& b, const Motion& mb, Random&) {
        const SweepResult whole = ask(a, ma, b, mb);
        if (whole.enclosed) return;
        for (uint32_t level = 0; level < 3; ++level) {
            const SweepResult r = ask(a, ma, b, mb, {.max_level = level});
            EXPECT_LE(r.stats.deepest_level, level + 1);
            EXPECT_TRUE(r.verdict != Verdict::separated || whole.verdict == Verdict::separated);
            shallow_free += r.verdict == Verdict::separated;
            // But for the tolerance, within which the covers may be met.
            EXPECT_FALSE(r.time_lower > whole.time_lower + 0.01 && whole.distance == 0);
        }
    });
    EXPECT_GT(shallow_free, 30);
}

TEST(Sweep, WhatIsNotFiniteLeavesEverythingOpen) {
    const Solid a = exact(shapes::box());
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    Motion still, bad[6];
    still.start.translation = {5, 0, 0};
    bad[0].start.translation.x = nan, bad[1].start.rotation = {0, 0, 0, 0}, bad[2].linear.y = inf;
    bad[3].angular.z = nan, bad[4].center.x = inf, bad[5].angular.x = 2e6f;
    for (const Motion& m : bad) {
        const SweepResult r = ask(a, m, a, still);
        EXPECT_EQ(r.verdict, Verdict::undecided);
        EXPECT_EQ(r.time_lower, 0);
        EXPECT_EQ(r.time_upper, std::numeric_limits<double>::infinity());
    }
    still.linear = {3e38f, 0, 0}; // large but finite: answered, or left open, but not wrong
    still.start.translation = {-2e38f, 0, 0};
    EXPECT_LT(ask(a, {}, a, still).time_lower, 0.67);
}

// ---- motions ----

TEST(Motion, SinesAndCosinesAreAccurate) {
    Random random(8);
    for (int i = 0; i < 100000; ++i) {
        const double x = random.log_in(1e-9, kMaxTurn) * (i % 2 ? 1 : -1);
        const auto [sine, cosine] = query::sine_cosine(x);
        ASSERT_NEAR(sine, static_cast<double>(std::sin(static_cast<Real>(x))), 0x1p-52);
        ASSERT_NEAR(cosine, static_cast<double>(std::cos(static_cast<Real>(x))), 0x1p-52);
    }
}

TEST(Motion, RelativePosesAreWithinTheirSlack) {
    Random random(9);
    double worst = 0;
    for (int i = 0; i < 3000; ++i) {
        const auto [ma, mb] = motions(random, random.log_in(1e-3, 1e3));
        const query::PairMotion motion(ma, mb);
        const double t = random.unit();
        const query::Instant now = motion.at(t);
        const Point d = random.direction();
        const Vec3 x = scenes::to_float(d);
        const Path pa(ma), pb(mb);
        const Vector world = pb(x, t) - pa({}, t), seen = reference::transposed(pa.rotation(t)) * world;
        const glm::dvec3 got = now.b_to_a.rotation * glm::dvec3(x.x, x.y, x.z) + now.b_to_a.translation;
        const Vector error = seen - Vector{got.x, got.y, got.z};
        worst = std::max(worst, length(error) / (now.slack * (now.b_to_a.distance + 1)));
    }
    EXPECT_LT(worst, 0.5);
    EXPECT_GT(worst, 1e-3);
}

TEST(Motion, PoseAtFollowsTheMotion) {
    Random random(10);
    for (int i = 0; i < 1000; ++i) {
        const Motion m = motions(random, 1).first;
        const double t = random.unit();
        const Pose p = pose_at(m, t);
        const Vec3 x = scenes::to_float(random.direction());
        const Vector expected = Path(m)(x, t),
                     got = reference::rotation(p.rotation) * vector(x) + vector(p.translation);
        ASSERT_LT(length(got - expected), 1e-6 * (1 + length(expected)));
    }
}

TEST(Motion, BetweenTwoPosesIsTheSmallerTurn) {
    Random random(11);
    for (int i = 0; i < 1000; ++i) {
        Pose start{scenes::to_float(random.direction()), random.rotation()},
            end{scenes::to_float(random.direction()), random.rotation()};
        if (i % 10 == 0) end.rotation = start.rotation;
        if (i % 10 == 1) { // half a turn
            const Quat& r = start.rotation;
            end.rotation = {r.w, -r.z, r.y, -r.x};
        }
        if (i % 10 == 2) start.rotation.x += 1e-6f, end.rotation = random.rotation(), end.rotation = start.rotation;
        const Motion m = motion_between(start, end, scenes::to_float(random.direction()));
        EXPECT_EQ(m.start, start);
        const Vector angular = vector(m.angular);
        EXPECT_LE(length(angular), std::numbers::pi + 1e-6);
        const Pose got = pose_at(m, 1);
        const Vec3 x = scenes::to_float(random.direction());
        const Vector p = reference::rotation(got.rotation) * vector(x) + vector(got.translation),
                     q = reference::rotation(end.rotation) * vector(x) + vector(end.translation);
        ASSERT_LT(length(p - q), 2e-6);
    }
}

// However small the tolerance, and however ill the closest points of nearly parallel edges are defined: what is
// reported to meet is as near as the least tolerance.
TEST(Sweep, SliversComeAsNearAsTheLeastTolerance) {
    Random random(3);
    const auto context = std::make_unique<QueryContext>();
    int found = 0;
    for (int i = 0; i < 20'000; ++i) {
        const auto sliver = [&] {
            Mesh mesh;
            const double thin = random.log_in(1e-9, 1);
            const Point u = random.direction(), v = random.direction();
            for (int k = 0; k < 3; ++k) {
                const double along = k == 2 ? random.in(-1, 1) : 2 * k - 1;
                const double across = k == 2 ? thin : thin * random.in(-0.1, 0.1);
                Point p{};
                for (size_t c = 0; c < 3; ++c) p[c] = along * u[c] + across * v[c];
                mesh.vertices.push_back(scenes::to_float(p));
            }
            mesh.triangles = {{0, 1, 2}};
            return scenes::exact_tree(mesh, {.closed = false}).bytes;
        };
        const auto bytes_a = sliver(), other = sliver();
        const auto& bytes_b = i % 2 ? bytes_a : other; // itself, turned by little
        const TreeView a = *TreeView::open(bytes_a), b = *TreeView::open(bytes_b);
        const Point d = random.direction();
        const auto far = [&d](double t) { return scenes::to_float({t * d[0], t * d[1], t * d[2]}); };
        Pose start{far(2.5), random.rotation()};
        if (i % 2) start.rotation = {0, static_cast<float>(random.log_in(1e-9, 1e-3)), 0, 1};
        const SweepResult r = sweep(a, {}, b, {start, far(-2.5), {}, {}}, *context, {.tolerance = 1e-12});
        if (r.verdict != Verdict::overlapping) continue;
        ++found;
        const auto x = query::place(a.root()), y = query::place(b.root(), query::relative_pose({}, start));
        ASSERT_LE(r.distance, std::max(0x1p-24 * (x.size + y.size), 0x1p-27 * (x.reach + y.reach)));
    }
    EXPECT_GT(found, 15'000);
}

} // namespace
} // namespace prolate

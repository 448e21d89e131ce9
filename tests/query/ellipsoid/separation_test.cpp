// The pair test against the slow reference: a million seeded pairs in families, most of them nasty.
//
// What must hold for every pair: `separated` only if the reference says apart, certified `overlapping` only if it says
// overlapping, and a decision in favour of separation wherever the gap is above kDecided. The same harness is run on
// deliberately wrong tests and must catch them.
#include "query/ellipsoid/separation.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/pairs.hpp>
#include <prolate/query.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <string>
#include <string_view>

namespace prolate {
namespace {

using query::PairResult;
using query::PairVerdict;
using scenes::Point;
using scenes::Random;

#ifdef PROLATE_SANITIZED
constexpr uint32_t kShare = 20; // the sanitizers look for errors of another kind
#else
constexpr uint32_t kShare = 1;
#endif

// Gaps are measured as contact() - 1: the relative growth of both bodies that makes them touch.
constexpr double kDecided = 1e-9;

struct Bodies {
    Ellipsoid a, b;
    Pose pose_a, pose_b;
};
using PairTest = std::function<PairResult(const Bodies&)>;

PairResult shipped(const Bodies& p) {
    return query::test_pair(query::place(p.a), query::place(p.b, query::relative_pose(p.pose_a, p.pose_b)));
}

double contact(const Bodies& p) {
    return static_cast<double>(reference::contact({p.a, p.pose_a, p.b, p.pose_b}));
}

Ellipsoid centered(const Point& radii, Random& random) {
    return scenes::ellipsoid({0, 0, 0}, radii, random.rotation());
}

// Two bodies with centers on a random line, moved along it until contact() is `target` (up to float rounding).
Bodies at_contact(Random& random, const Ellipsoid& a, const Ellipsoid& b, double target) {
    Bodies p{a, b, {{}, random.rotation()}, {{}, random.rotation()}};
    const Point d = random.direction();
    p.pose_b.translation = scenes::to_float({2 * d[0], 2 * d[1], 2 * d[2]});
    const double t = 2 * target / contact(p);
    p.pose_b.translation = scenes::to_float({t * d[0], t * d[1], t * d[2]});
    return p;
}

Bodies random_pair(Random& random, double ratio, double size_ratio) {
    const double s = random.log_in(1 / size_ratio, size_ratio);
    const Point r = scenes::radii(random, ratio);
    return at_contact(random, centered(scenes::radii(random, ratio), random),
                      centered({s * r[0], s * r[1], s * r[2]}, random), random.log_in(0.2, 5));
}

void scale(Ellipsoid& e, float s) {
    for (float* x : {&e.center.x, &e.center.y, &e.center.z, &e.l11, &e.l21, &e.l22, &e.l31, &e.l32, &e.l33}) *x *= s;
}
void scale(Bodies& p, float s) {
    scale(p.a, s), scale(p.b, s);
    for (Vec3* t : {&p.pose_a.translation, &p.pose_b.translation}) t->x *= s, t->y *= s, t->z *= s;
}

struct Family {
    const char* name;
    uint32_t count;
    double least_apart, most_apart; // share of `separated` that keeps the family honest
    Bodies (*make)(Random&);
};
std::ostream& operator<<(std::ostream& out, const Family& family) {
    return out << family.name;
}

constexpr double kLargestRatio = 16384; // of axes, that bakes make

Point needle(Random& random) {
    const double thin = 1 / random.log_in(1e3, kLargestRatio);
    return {1, thin * random.in(1, 2), thin * random.in(1, 2)};
}
Point disc(Random& random) {
    return {1, random.in(0.5, 1), 1 / random.log_in(1e3, kLargestRatio)};
}

const Family kFamilies[] = {
    {"round", 200'000, 0.4, 0.6, [](Random& r) { return random_pair(r, 5, 2); }},
    {"ratio_100", 200'000, 0.4, 0.6, [](Random& r) { return random_pair(r, 100, 10); }},
    {"ratio_16384_sizes_1e4", 100'000, 0.4, 0.6, [](Random& r) { return random_pair(r, kLargestRatio, 1e4); }},
    {"needles", 80'000, 0.4, 0.6,
     [](Random& r) { return at_contact(r, centered(needle(r), r), centered(needle(r), r), r.log_in(0.5, 2)); }},
    {"parallel_needles", 40'000, 0.4, 0.6,
     [](Random& r) {
         Bodies p = at_contact(r, centered(needle(r), r), centered(needle(r), r), 1);
         p.b = p.a, p.pose_b.rotation = p.pose_a.rotation;
         p.pose_b.rotation.x += static_cast<float>(r.log_in(1e-7, 1e-2));
         const double c = contact(p), t = r.log_in(0.5, 2) / c;
         p.pose_b.translation.x = static_cast<float>(t * p.pose_b.translation.x);
         p.pose_b.translation.y = static_cast<float>(t * p.pose_b.translation.y);
         p.pose_b.translation.z = static_cast<float>(t * p.pose_b.translation.z);
         return p;
     }},
    {"discs", 80'000, 0.4, 0.6,
     [](Random& r) { return at_contact(r, centered(disc(r), r), centered(disc(r), r), r.log_in(0.5, 2)); }},
    {"needle_disc_near", 40'000, 0.4, 0.6,
     [](Random& r) { return at_contact(r, centered(needle(r), r), centered(disc(r), r), r.in(0.999, 1.001)); }},
    {"tangent_outside", 60'000, 0.99, 1,
     [](Random& r) {
         return at_contact(r, centered(scenes::radii(r, 30), r), centered(scenes::radii(r, 30), r), 1 + 1e-6);
     }},
    {"tangent_inside", 60'000, 0, 0,
     [](Random& r) {
         return at_contact(r, centered(scenes::radii(r, 30), r), centered(scenes::radii(r, 30), r), 1 - 1e-6);
     }},
    {"tangent_needles", 40'000, 0.25, 0.75,
     [](Random& r) {
         const double side = r.below(2) ? 1e-6 : -1e-6;
         return at_contact(r, centered(needle(r), r), centered(needle(r), r), 1 + side);
     }},
    {"nested", 20'000, 0, 0,
     [](Random& r) {
         const Point small = scenes::radii(r, kLargestRatio);
         return at_contact(r, centered(scenes::radii(r, kLargestRatio), r),
                           centered({1e-4 * small[0], 1e-4 * small[1], 1e-4 * small[2]}, r), r.in(0.0, 0.9));
     }},
    {"concentric", 10'000, 0, 0,
     [](Random& r) {
         Bodies p = random_pair(r, kLargestRatio, 100);
         p.pose_b.translation = p.pose_a.translation;
         return p;
     }},
    {"far_from_origin", 50'000, 0.35, 0.65,
     [](Random& r) {
         Bodies p = random_pair(r, 100, 3);
         const Point d = r.direction();
         const double far = r.log_in(1e2, 1e4);
         for (Vec3* t : {&p.pose_a.translation, &p.pose_b.translation}) {
             t->x += static_cast<float>(far * d[0]), t->y += static_cast<float>(far * d[1]);
             t->z += static_cast<float>(far * d[2]);
         }
         return p;
     }},
    {"far_from_own_origin", 50'000, 0.3, 0.7,
     [](Random& r) { // local centers up to 1e4 sizes away, taken back by the translation
         Bodies p = random_pair(r, 100, 3);
         const auto shift = [&](Ellipsoid& e, Pose& pose) {
             const Point d = r.direction();
             const double far = r.log_in(1e2, 1e4);
             e.center = scenes::to_float({far * d[0], far * d[1], far * d[2]});
             const Point back = scenes::rotate(pose.rotation, {e.center.x, e.center.y, e.center.z});
             pose.translation.x -= static_cast<float>(back[0]), pose.translation.y -= static_cast<float>(back[1]);
             pose.translation.z -= static_cast<float>(back[2]);
         };
         shift(p.a, p.pose_a), shift(p.b, p.pose_b);
         return p;
     }},
    {"units", 50'000, 0.4, 0.6,
     [](Random& r) {
         Bodies p = random_pair(r, 100, 10);
         scale(p, static_cast<float>(r.log_in(1e-6, 1e6)));
         return p;
     }},
};

struct Tally {
    uint32_t pairs = 0, apart = 0, overlapping = 0, unresolved = 0;
    uint64_t evaluations = 0;
    uint32_t false_separated = 0, false_overlapping = 0, missed = 0;
    double widest_missed = 0; // largest gap not recognised
    uint32_t violations() const { return false_separated + false_overlapping + missed; }
};

Tally run(const Family& family, uint32_t count, const PairTest& test) {
    Random random(0x5eed);
    Tally t;
    for (; t.pairs < count; ++t.pairs) {
        const Bodies p = family.make(random);
        const PairResult result = test(p);
        const double gap = contact(p) - 1;
        t.evaluations += result.evaluations;
        if (result.verdict == PairVerdict::separated) {
            ++t.apart;
            if (!(gap > 0)) ++t.false_separated;
        } else {
            ++(result.verdict == PairVerdict::overlapping ? t.overlapping : t.unresolved);
            if (result.verdict == PairVerdict::overlapping && !(gap < 0)) ++t.false_overlapping;
            if (gap > kDecided) ++t.missed;
            t.widest_missed = std::max(t.widest_missed, gap);
        }
    }
    return t;
}

class SeparationFamily : public testing::TestWithParam<Family> {};

TEST_P(SeparationFamily, AgreesWithTheReference) {
    const Family& family = GetParam();
    const Tally t = run(family, family.count / kShare, shipped);
    const auto share = [&](uint32_t n) { return static_cast<double>(n) / t.pairs; };
    RecordProperty("apart", std::to_string(share(t.apart)));
    RecordProperty("unresolved", std::to_string(share(t.unresolved)));
    RecordProperty("evaluations", std::to_string(static_cast<double>(t.evaluations) / t.pairs));
    RecordProperty("widest_missed", std::to_string(t.widest_missed * 1e9) + "e-9");
    EXPECT_EQ(t.false_separated, 0u);
    EXPECT_EQ(t.false_overlapping, 0u);
    EXPECT_EQ(t.missed, 0u) << "widest gap not recognised: " << t.widest_missed;
    EXPECT_GE(share(t.apart), family.least_apart);
    EXPECT_LE(share(t.apart), family.most_apart);
}

INSTANTIATE_TEST_SUITE_P(All, SeparationFamily, testing::ValuesIn(kFamilies),
                         [](const auto& family) { return std::string(family.param.name); });

const Family& family(std::string_view name) {
    return *std::ranges::find_if(kFamilies, [&](const Family& f) { return f.name == name; });
}

// The harness itself: wrong tests must not pass it.
TEST(SeparationHarness, CatchesAMarginThatIsTooSmall) {
    const auto wrong = [](const Bodies& p) {
        return query::test_pair(query::place(p.a), query::place(p.b, query::relative_pose(p.pose_a, p.pose_b)), -1e-5);
    };
    EXPECT_GT(run(family("tangent_inside"), 2000, wrong).false_separated, 1000u);
}

TEST(SeparationHarness, CatchesShrunkRadii) {
    const auto wrong = [](Bodies p) {
        const Vec3 center = p.a.center;
        scale(p.a, 1 - 1e-4f);
        p.a.center = center;
        return shipped(p);
    };
    EXPECT_GT(run(family("tangent_inside"), 2000, wrong).false_separated, 1000u);
    EXPECT_GT(run(family("tangent_needles"), 2000, wrong).false_separated, 100u);
}

TEST(SeparationHarness, CatchesGrownRadii) {
    const auto wrong = [](Bodies p) {
        const Vec3 center = p.a.center;
        scale(p.a, 1 + 1e-4f);
        p.a.center = center;
        return shipped(p);
    };
    EXPECT_GT(run(family("tangent_outside"), 2000, wrong).false_overlapping, 1000u);
}

TEST(SeparationHarness, CatchesATestThatGivesUpEarly) {
    const auto wrong = [](const Bodies& p) {
        const PairResult result = shipped(p);
        return result.evaluations > 1 ? PairResult{PairVerdict::unresolved, 1} : result;
    };
    EXPECT_GT(run(family("needle_disc_near"), 2000, wrong).missed, 100u);
}

TEST(SeparationHarness, CatchesTheWrongRotation) {
    const auto wrong = [](Bodies p) {
        p.pose_b.rotation.w = -p.pose_b.rotation.w;
        return shipped(p);
    };
    const Tally t = run(family("ratio_100"), 2000, wrong);
    EXPECT_GT(t.false_separated, 20u);
    EXPECT_GT(t.missed, 20u);
}

TEST(SeparationHarness, TwoReferencesAgree) {
    Random random(7);
    uint32_t apart = 0;
    for (int i = 0; i < 5000; ++i) {
        const Bodies p = random_pair(random, 30, 10);
        const reference::Pair pair(p.a, p.pose_a, p.b, p.pose_b);
        const auto c = reference::contact(pair), d = reference::projected(pair);
        if (std::abs(c - 1) < 1e-9) continue;
        EXPECT_EQ(c > 1, d > 1) << "contact " << static_cast<double>(c) << ", projected " << static_cast<double>(d);
        apart += c > 1;
    }
    EXPECT_GT(apart, 2000u);
    EXPECT_LT(apart, 3000u);
}

// Bodies that touch in exactly one point have it in common. Spheres of integer radius at Pythagorean distance, all
// sheared alike, turned alike, anywhere: every input is exact.
Bodies exact_contact(Random& random) {
    constexpr float kQuadruples[][4] = {{1, 2, 2, 3}, {2, 3, 6, 7},  {1, 4, 8, 9},
                                        {4, 4, 7, 9}, {2, 6, 9, 11}, {6, 6, 7, 11}};
    const auto& q = kQuadruples[random.below(6)];
    const auto integer = [&](uint32_t most) { return static_cast<float>(1 + random.below(most)); };
    const auto sign = [&] { return random.below(2) ? 1.0f : -1.0f; };
    const float ra = 1 + static_cast<float>(random.below(static_cast<uint32_t>(q[3]) - 1)), rb = q[3] - ra;
    const float m[6] = {integer(64),          sign() * integer(64), integer(64),
                        sign() * integer(64), sign() * integer(64), integer(64)};
    const float c[3] = {sign() * q[0], sign() * q[1], sign() * q[2]};
    const auto image = [&](float r) {
        return Ellipsoid{{}, m[0] * r, m[1] * r, m[2] * r, m[3] * r, m[4] * r, m[5] * r};
    };
    Bodies p{image(ra), image(rb), {}, {}};
    p.b.center = {m[0] * c[0], m[1] * c[0] + m[2] * c[1], m[3] * c[0] + m[4] * c[1] + m[5] * c[2]};
    const Vec3 move{sign() * integer(1 << 16), sign() * integer(1 << 16), sign() * integer(1 << 16)};
    p.pose_a = p.pose_b = {move, random.rotation()};
    if (random.below(2)) std::swap(p.a, p.b);
    scale(p, std::ldexp(1.0f, static_cast<int>(random.below(60)) - 30));
    return p;
}

TEST(Separation, NeverSeparatesBodiesThatShareOnePoint) {
    Random random(11);
    uint32_t without_margin = 0;
    for (int i = 0; i < 100'000; ++i) {
        const Bodies p = exact_contact(random);
        ASSERT_NE(shipped(p).verdict, PairVerdict::separated) << i;
        const auto bare =
            query::test_pair(query::place(p.a), query::place(p.b, query::relative_pose(p.pose_a, p.pose_b)), 0);
        without_margin += bare.verdict == PairVerdict::separated;
    }
    EXPECT_GT(without_margin, 1000u) << "the margin is not exercised";
}

TEST(Separation, SwappingTheBodiesChangesNothing) {
    Random random(13);
    for (int i = 0; i < 50'000; ++i) {
        const Bodies p = i % 2 ? random_pair(random, 100, 10) : exact_contact(random);
        ASSERT_EQ(collide(p.a, p.pose_a, p.b, p.pose_b), collide(p.b, p.pose_b, p.a, p.pose_a)) << i;
    }
}

// The test proper, without the fixed order that collide() puts the bodies in.
TEST(Separation, SwappingTheBodiesChangesNothingEvenInTheOtherFrame) {
    Random random(14);
    for (int i = 0; i < 50'000; ++i) {
        const Bodies p = random_pair(random, 100, 10);
        ASSERT_EQ(shipped(p).verdict, shipped({p.b, p.a, p.pose_b, p.pose_a}).verdict) << i;
    }
}

TEST(Separation, IsInvariantUnderACommonRigidMotion) {
    Random random(17);
    uint32_t apart = 0;
    for (int i = 0; i < 50'000; ++i) {
        const Bodies p = random_pair(random, 100, 10);
        const double gap = contact(p) - 1;
        if (std::abs(gap) < 1e-4) continue; // float poses cannot express the motion better
        const Quat turn = random.rotation();
        const Point shift{random.in(-5, 5), random.in(-5, 5), random.in(-5, 5)};
        const auto moved = [&](const Pose& pose) {
            const Point t = scenes::rotate(turn, {pose.translation.x, pose.translation.y, pose.translation.z});
            const Quat& q = pose.rotation;
            return Pose{scenes::to_float({t[0] + shift[0], t[1] + shift[1], t[2] + shift[2]}),
                        {turn.w * q.x + turn.x * q.w + turn.y * q.z - turn.z * q.y,
                         turn.w * q.y - turn.x * q.z + turn.y * q.w + turn.z * q.x,
                         turn.w * q.z + turn.x * q.y - turn.y * q.x + turn.z * q.w,
                         turn.w * q.w - turn.x * q.x - turn.y * q.y - turn.z * q.z}};
        };
        const Verdict before = collide(p.a, p.pose_a, p.b, p.pose_b);
        ASSERT_EQ(before, collide(p.a, moved(p.pose_a), p.b, moved(p.pose_b))) << i << ", gap " << gap;
        apart += before == Verdict::separated;
    }
    EXPECT_GT(apart, 20'000u);
    EXPECT_LT(apart, 30'000u);
}

TEST(Separation, IsExactlyInvariantUnderPowersOfTwo) {
    Random random(19);
    for (int i = 0; i < 20'000; ++i) {
        const Bodies p = i % 2 ? random_pair(random, 1000, 10) : exact_contact(random);
        const PairResult before = shipped(p);
        for (const int exponent : {-80, -20, 1, 20, 70}) {
            Bodies q = p;
            scale(q, std::ldexp(1.0f, exponent));
            const PairResult after = shipped(q);
            ASSERT_EQ(before.verdict, after.verdict) << i;
            ASSERT_EQ(before.evaluations, after.evaluations) << i;
        }
    }
}

TEST(Separation, TheLengthOfAQuaternionDoesNotMatter) {
    Random random(23);
    for (int i = 0; i < 10'000; ++i) {
        const Bodies p = random_pair(random, 100, 10);
        Bodies q = p;
        for (float* x : {&q.pose_b.rotation.x, &q.pose_b.rotation.y, &q.pose_b.rotation.z, &q.pose_b.rotation.w})
            *x *= -0x1p40f;
        ASSERT_EQ(shipped(p).verdict, shipped(q).verdict);
    }
}

TEST(Separation, BadInputNeverSeparates) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    const Ellipsoid ball;
    const Pose far{{100, 0, 0}, {}};
    ASSERT_EQ(collide(ball, {}, ball, far), Verdict::separated);
    const auto spoil = [&](auto&& change) {
        Bodies p{ball, ball, {}, far};
        change(p);
        EXPECT_NE(collide(p.a, p.pose_a, p.b, p.pose_b), Verdict::separated);
        EXPECT_NE(collide(p.b, p.pose_b, p.a, p.pose_a), Verdict::separated);
    };
    for (const float bad : {kNan, kInf, -kInf}) {
        spoil([&](Bodies& p) { p.pose_b.translation.x = bad; });
        spoil([&](Bodies& p) { p.pose_b.translation.z = bad; });
        spoil([&](Bodies& p) { p.pose_a.translation.y = p.pose_b.translation.y = bad; });
        spoil([&](Bodies& p) { p.pose_a.rotation.x = bad; });
        spoil([&](Bodies& p) { p.pose_b.rotation.y = bad; });
        spoil([&](Bodies& p) { p.pose_b.rotation.z = bad; });
        spoil([&](Bodies& p) { p.pose_b.rotation.w = bad; });
        spoil([&](Bodies& p) { p.a.center.y = bad; });
        spoil([&](Bodies& p) { p.b.l22 = bad; });
        spoil([&](Bodies& p) { p.b.l31 = bad; });
    }
    spoil([](Bodies& p) { p.pose_a.rotation = {0, 0, 0, 0}; });
    spoil([](Bodies& p) { p.pose_b.rotation = {0, 0, 0, 0}; });
}

// In long double, by forward substitution. (g++ 12 -O2 can drop a rounding to float when doubles go through floats and
// back in one function; long double is out of its vectoriser's reach.)
bool inside(const Ellipsoid& e, const Vec3& p) {
    const reference::Real y1 = p.x / reference::Real{e.l11};
    const reference::Real y2 = (p.y - e.l21 * y1) / e.l22;
    const reference::Real y3 = (p.z - e.l31 * y1 - e.l32 * y2) / e.l33;
    return y1 * y1 + y2 * y2 + y3 * y3 < 0.99L;
}

TEST(Separation, ExtremeFloatsStayHonest) {
    const Pose far{{3, 0, 0}, {}};
    for (const float unit : {0x1p-140f, 0x1p-126f, 0x1p-100f, 0x1p100f, 0x1p125f}) {
        Bodies apart{{}, {}, {}, far}, meet{{}, {}, {}, {{1.5f, 0, 0}, {}}};
        scale(apart, unit), scale(meet, unit);
        EXPECT_EQ(shipped(apart).verdict, PairVerdict::separated) << unit;
        EXPECT_EQ(shipped(meet).verdict, PairVerdict::overlapping) << unit;
    }
    // Axis ratios that no bake makes: undecided is fine, wrong is not. B's center lies in A, so no plane separates
    // them.
    Random random(29);
    uint32_t tried = 0;
    for (int i = 0; i < 20'000; ++i) {
        const auto wild = [&] { return static_cast<float>(random.log_in(1e-30, 1e30)); };
        Bodies p{{{}, wild(), wild(), wild(), wild(), wild(), wild()},
                 {{}, wild(), wild(), wild(), wild(), wild(), wild()},
                 {},
                 {{}, random.rotation()}};
        const Point u = random.in_ball();
        p.pose_b.translation = scenes::to_float(
            {p.a.l11 * u[0], p.a.l21 * u[0] + p.a.l22 * u[1], p.a.l31 * u[0] + p.a.l32 * u[1] + p.a.l33 * u[2]});
        if (!inside(p.a, p.pose_b.translation)) continue; // the float translation moved it out of a flat A
        ++tried;
        ASSERT_NE(shipped(p).verdict, PairVerdict::separated) << i;
        ASSERT_NE(shipped({p.b, p.a, p.pose_b, p.pose_a}).verdict, PairVerdict::separated) << i;
    }
    EXPECT_GT(tried, 1000u);
}

} // namespace
} // namespace prolate

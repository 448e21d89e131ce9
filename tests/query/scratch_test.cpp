// Scratch of the caller's size: with scratch_size() bytes all queries certify what they certify with 80 KiB and write
// nowhere else; with less they say nothing. And all of them run on a fibre's stack of 64 KiB.
#include "tests/exact_scenes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/contacts.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/raycast.hpp>
#include <prolate/sweep.hpp>

#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using scenes::Random;

constexpr HalfSpace kGround{{0, 0, 1}, -0.5f};

struct Trees {
    std::vector<std::vector<std::byte>> bytes;
    std::vector<TreeView> all;
    Trees() {
        Random random(3);
        bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.3f, 64, 32)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::box(0.5f, 0.7f, 0.4f)).bytes);
        for (const uint32_t degree : {2u, 8u, 64u})
            bytes.push_back(
                scenes::tree(random, scenes::cloud(random, 600), {.degree = degree, .levels = degree == 2 ? 8u : 3u})
                    .bytes);
        for (const auto& b : bytes) all.push_back(*TreeView::open(b));
    }
};
const Trees& trees() {
    static const Trees made;
    return made;
}

struct Answers {
    Verdict collide, contacts, sweep, ray, overlap, ground, inside, ground_contacts, ground_sweep;
    DistanceResult distance;
    SweepResult swept;
    SignedDistance signed_distance;
    uint64_t found = 0, tests = 0;
};
// Every query of two trees, and of the first alone.
Answers ask(const TreeView& a, const Pose& p, const TreeView& b, const Pose& q, Scratch scratch) {
    Answers out{};
    ContactManifolds manifolds;
    Motion rest, flight;
    rest.start = p, flight.start = q, flight.start.translation.x += 4, flight.linear = {-8, 0, 0};
    out.collide = collide(a, p, b, q, scratch).verdict;
    const CollideAllResult all = collide_all(a, p, b, q, {}, scratch);
    out.found = all.found, out.tests = all.stats.tests();
    out.distance = distance(a, p, b, q, scratch);
    out.contacts = contacts(a, p, b, q, manifolds, scratch).verdict;
    out.swept = sweep(a, rest, b, flight, scratch);
    out.sweep = out.swept.verdict;
    out.ray = raycast(a, p, {{-5, 0.1f, 0.2f}, {1, 0, 0}}, scratch).verdict;
    out.overlap = overlap(a, p, Box{q, {0.3f, 0.2f, 0.5f}}, scratch).verdict;
    out.ground = distance(a, p, kGround, scratch).verdict;
    out.ground_contacts = contacts(a, p, kGround, manifolds, scratch).verdict;
    out.ground_sweep = sweep(a, flight, kGround, scratch).verdict;
    out.signed_distance = signed_distance(a, p, q.translation, scratch);
    out.inside = contains(a, p, q.translation, scratch);
    return out;
}

TEST(Scratch, TheLeastCertifiesTheSame) {
    Random random(1);
    const auto context = std::make_unique<QueryContext>();
    uint32_t meeting = 0, apart = 0;
    size_t largest = 0;
    for (uint32_t i = 0; i < 400; ++i) {
        const TreeView a = trees().all[i % 5], b = trees().all[i / 5 % 5];
        const Pose p = scenes::pose_at(random, 0.1), q = scenes::pose_at(random, random.in(0, 3));
        const size_t size = scratch_size(a, b);
        largest = std::max(largest, size);
        ASSERT_LE(size, sizeof(QueryContext));
        // Guarded on both sides, and at an odd address.
        constexpr size_t kGuard = 64;
        std::vector<std::byte> memory(size + 2 * kGuard + 1, std::byte{0x5a});
        const Answers small = ask(a, p, b, q, Scratch({memory.data() + kGuard + 1, size}));
        const auto untouched = [](std::byte x) { return x == std::byte{0x5a}; };
        EXPECT_TRUE(std::all_of(memory.begin(), memory.begin() + kGuard + 1, untouched));
        EXPECT_TRUE(std::all_of(memory.end() - kGuard, memory.end(), untouched));
        const Answers large = ask(a, p, b, q, *context);
        EXPECT_EQ(small.collide, large.collide);
        EXPECT_EQ(small.contacts, large.contacts);
        EXPECT_EQ(small.found, large.found);
        EXPECT_EQ(small.tests, large.tests);
        EXPECT_EQ(small.sweep, large.sweep);
        EXPECT_EQ(small.ray, large.ray);
        EXPECT_EQ(small.overlap, large.overlap);
        EXPECT_EQ(small.ground, large.ground);
        EXPECT_EQ(small.ground_contacts, large.ground_contacts);
        EXPECT_EQ(small.ground_sweep, large.ground_sweep);
        EXPECT_EQ(small.inside, large.inside);
        EXPECT_EQ(small.signed_distance.upper, large.signed_distance.upper);
        EXPECT_EQ(small.distance.verdict, large.distance.verdict);
        EXPECT_LE(small.distance.lower, large.distance.upper);
        EXPECT_LE(large.distance.lower, small.distance.upper);
        EXPECT_LE(small.distance.upper - small.distance.lower, 2e-6 * small.distance.upper + 1e-7);
        EXPECT_NEAR(std::min(1.0, small.swept.time_upper), std::min(1.0, large.swept.time_upper), 1e-3);
        meeting += large.collide == Verdict::overlapping, apart += large.collide == Verdict::separated;
    }
    EXPECT_GT(meeting, 100u);
    EXPECT_GT(apart, 100u);
    // Of degree 8, a few KiB.
    EXPECT_LT(scratch_size(trees().all[0], trees().all[0]), 5000u);
    EXPECT_GT(largest, 5000u);
}

TEST(Scratch, WithLessNothingIsSaid) {
    const TreeView a = trees().all[0], b = trees().all[3];
    const Pose far{{100, 0, 0}, {}};
    for (const size_t size : {size_t{0}, size_t{15}, size_t{100}, scratch_size(a) - 32}) {
        std::vector<std::byte> memory(size + 1);
        const Answers x = ask(a, {}, b, far, Scratch({memory.data(), size}));
        for (const Verdict v : {x.collide, x.contacts, x.sweep, x.ray, x.overlap, x.ground, x.inside, x.ground_contacts,
                                x.ground_sweep, x.distance.verdict, x.signed_distance.verdict})
            EXPECT_EQ(v, Verdict::undecided) << size;
        EXPECT_EQ(x.tests, 0u);
        EXPECT_EQ(x.distance.lower, 0);
        EXPECT_TRUE(std::isinf(x.distance.upper));
        EXPECT_EQ(x.swept.time_lower, 0);
    }
    EXPECT_EQ(Scratch(std::span<std::byte>{}).count(), 0u);
}

// On a stack of our own, whose bytes tell afterwards how far it was used.
TEST(Scratch, QueriesRunOnAFibresStack) {
#if defined(PROLATE_SANITIZED) || !defined(__OPTIMIZE__)
    GTEST_SKIP() << "frames are larger there";
#endif
    constexpr size_t kFibre = size_t{64} * 1024, kStack = 2 * kFibre, kPage = 4096;
    static_assert(kFibre <= sizeof(QueryContext)); // such a stack could not hold a whole one
    struct Work {
        static void* run(void*) {
            Random random(2);
            alignas(16) std::byte memory[6 * 1024];
            for (uint32_t i = 0; i < 50; ++i) {
                const TreeView &a = trees().all[i % 4], &b = trees().all[i / 4 % 4];
                (void)ask(a, scenes::pose_at(random, 0.1), b, scenes::pose_at(random, 0.9), Scratch(memory));
            }
            return nullptr;
        }
    };
    ASSERT_LE(scratch_size(trees().all[0], trees().all[3]), 6u * 1024);
    (void)trees();
    void* const stack = std::aligned_alloc(kPage, kStack);
    ASSERT_TRUE(stack != nullptr);
    std::memset(stack, 0x5a, kStack);
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    ASSERT_EQ(pthread_attr_setstack(&attributes, stack, kStack), 0);
    pthread_t thread{};
    ASSERT_EQ(pthread_create(&thread, &attributes, Work::run, nullptr), 0);
    pthread_join(thread, nullptr);
    pthread_attr_destroy(&attributes);
    const auto* const bytes = static_cast<const unsigned char*>(stack);
    const auto used =
        kStack -
        static_cast<size_t>(std::find_if(bytes, bytes + kStack, [](unsigned char x) { return x != 0x5a; }) - bytes);
    RecordProperty("stack_bytes", static_cast<int>(used));
    EXPECT_LE(used, kFibre); // with the scratch, the thread's own data, and this test's
    std::free(stack);
}

} // namespace
} // namespace prolate

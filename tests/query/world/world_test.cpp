// Worlds: no pair is missed, lists do not depend on threads, and everything refuses what it should.
#include "query/world/bounds.hpp"
#include "query/world/root_bounds.hpp"
#include "tests/scenes.hpp"
#include "tests/targets.hpp"
#include "tests/threads.hpp"

#include <prolate/pairs.hpp>
#include <prolate/poses.hpp>
#include <prolate/world.hpp>
#include <prolate/world_queries.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <new>
#include <set>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

static_assert(noexcept(std::declval<World&>().update_pairs()));
static_assert(std::is_nothrow_move_constructible_v<World> && !std::is_copy_constructible_v<World>);

// Memory that counts, and runs out after `limit` allocations.
class Memory : public std::pmr::memory_resource {
public:
    uint64_t allocations = 0, limit = UINT64_MAX;
    int64_t bytes = 0;

private:
    void* do_allocate(size_t size, size_t alignment) override {
        if (allocations >= limit) throw std::bad_alloc();
        ++allocations, bytes += static_cast<int64_t>(size);
        return ::operator new (size, std::align_val_t{alignment});
    }
    void do_deallocate(void* p, size_t size, size_t alignment) override {
        bytes -= static_cast<int64_t>(size);
        ::operator delete (p, std::align_val_t{alignment});
    }
    bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
};

// A few solids that all tests share.
const std::vector<scenes::Scene>& solids() {
    static const auto made = [] {
        Random random(1);
        std::vector<scenes::Scene> out;
        for (const uint32_t levels : {1u, 2u, 3u, 4u})
            out.push_back(
                scenes::tree(random, scenes::cloud(random, 200),
                             {.degree = levels == 3 ? 3u : 8u, .levels = levels, .unit = levels == 4 ? 0.25 : 1}));
        return out;
    }();
    return made;
}
TreeView tree(uint32_t i) {
    return *TreeView::open(solids()[i % solids().size()].bytes);
}

Pose random_pose(Random& random, double spread) {
    const Point p = random.in_ball();
    return {scenes::to_float({spread * p[0], spread * p[1], spread * p[2]}), random.rotation()};
}
Pose nudged(Random& random, Pose pose, double by) {
    const Point d = random.in_ball();
    pose.translation.x += static_cast<float>(by * d[0]);
    pose.translation.y += static_cast<float>(by * d[1]);
    pose.translation.z += static_cast<float>(by * d[2]);
    pose.rotation.x += static_cast<float>(by * random.in(-1, 1));
    pose.rotation.w += static_cast<float>(by * random.in(-1, 1));
    return pose;
}
bool admitted(const Body& a, const Body& b) {
    return (a.layers & b.mask) != 0 && (b.layers & a.mask) != 0;
}

using Indices = std::pair<uint32_t, uint32_t>;
std::set<Indices> listed(std::span<const BodyPair> pairs) {
    std::set<Indices> out;
    for (const BodyPair& p : pairs) out.insert({p.a.index, p.b.index});
    EXPECT_EQ(out.size(), pairs.size());
    return out;
}

// A world, and beside it what it should hold.
struct Twin {
    World world;
    std::map<uint32_t, BodyId> ids; // by index

    explicit Twin(const WorldOptions& options = {}, std::pmr::memory_resource* memory = nullptr)
        : world(*World::create(options, memory)) {}

    BodyId insert(const Body& body) {
        const BodyId id = *world.insert(body);
        EXPECT_FALSE(ids.contains(id.index));
        return ids[id.index] = id;
    }
    BodyId some(Random& random) const {
        return std::next(ids.begin(), random.below(static_cast<uint32_t>(ids.size())))->second;
    }
    void remove(BodyId id) {
        EXPECT_TRUE(world.remove(id));
        ids.erase(id.index);
    }
    const Body& body(BodyId id) const { return *world.find(id); }

    // Pairs that must be there: boxes that overlap as tightly as they are known.
    std::set<Indices> brute_force() const {
        std::vector<std::pair<BodyId, Bounds>> boxes;
        for (const auto& [index, id] : ids) {
            const Body& b = body(id);
            boxes.emplace_back(id, bounds(*b.tree(), b.pose, b.margin));
        }
        std::set<Indices> out;
        for (size_t i = 0; i < boxes.size(); ++i)
            for (size_t j = i + 1; j < boxes.size(); ++j)
                if (overlap(boxes[i].second, boxes[j].second) && admitted(body(boxes[i].first), body(boxes[j].first)))
                    out.insert({boxes[i].first.index, boxes[j].first.index});
        return out;
    }

    // Some random steps of a world's life.
    void live(Random& random, uint32_t most, double spread, uint32_t changes) {
        for (uint32_t i = 0; i < changes; ++i) {
            const uint32_t what = random.below(16);
            if (ids.size() < 2 || (what < 2 && ids.size() < most)) {
                Body body{.shape = tree(random.below(8)), .pose = random_pose(random, spread)};
                if (random.below(4) == 0) body.margin = static_cast<float>(0.3 * random.unit());
                if (random.below(4) == 0) body.layers = 2, body.mask = ~2u; // of these, no two meet
                if (random.below(64) == 0) body.pose.translation.y = kNan;
                insert(body);
            } else if (what == 2) {
                remove(some(random));
            } else if (what == 3) {
                const BodyId id =
                    some(random); // one draw a statement: the order of arguments differs between compilers
                const uint32_t layers = random.below(4), mask = random.below(4);
                EXPECT_TRUE(world.refilter(id, layers, mask));
            } else if (what == 4) {
                const BodyId id = some(random);
                EXPECT_TRUE(world.move(id, random_pose(random, spread)));
            } else if (what == 5 && random.below(8) == 0) {
                EXPECT_TRUE(world.move(some(random), {{}, {0, 0, 0, 0}})); // no rotation: no box
            } else {
                const BodyId id = some(random);
                EXPECT_TRUE(world.move(id, nudged(random, body(id).pose, 0.02)));
            }
        }
    }
};

TEST(World, MissesNoPair) {
    for (const float slack : {0.0f, 0.05f, 0.5f}) {
        Random random(2);
        Twin twin({.slack = slack});
        uint64_t needed = 0, given = 0;
        for (uint32_t step = 0; step < 400; ++step) {
            twin.live(random, 120, 4, 1 + random.below(40));
            const auto found = listed(*twin.world.update_pairs());
            const auto truth = twin.brute_force();
            ASSERT_TRUE(std::ranges::includes(found, truth)) << step;
            needed += truth.size(), given += found.size();
            EXPECT_EQ(twin.world.body_count(), twin.ids.size());
        }
        EXPECT_GT(needed, 20000u);
        EXPECT_LE(given, needed / 50 + needed * (slack == 0     ? 1
                                                 : slack < 0.1f ? 2
                                                                : 6)); // without slack, nothing but what must be there
    }
}

TEST(World, PairsEverythingThatCollides) {
    Random random(3);
    Twin twin;
    QueryContext context;
    uint64_t meeting = 0, candidates = 0;
    for (uint32_t round = 0; round < 30; ++round) {
        twin.live(random, 60, 2, 200);
        const auto found = listed(*twin.world.update_pairs());
        candidates += found.size();
        for (const auto& [i, a] : twin.ids)
            for (const auto& [j, b] : twin.ids) {
                if (i >= j || !admitted(twin.body(a), twin.body(b))) continue;
                const Body &x = twin.body(a), &y = twin.body(b);
                if (collide(*x.tree(), x.pose, *y.tree(), y.pose, context).verdict == Verdict::separated) continue;
                ++meeting;
                EXPECT_TRUE(found.contains({i, j}));
            }
    }
    EXPECT_GT(meeting, 1000u);
    EXPECT_LT(candidates, 5 * meeting);
}

TEST(World, MarginsAddUp) {
    // Two bodies side by side; they are a pair exactly as long as the gap is at most both margins.
    const TreeView solid = tree(0);
    const Bounds box = bounds(solid, {});
    for (const float gap : {0.1f, 0.5f, 1.0f})
        for (const float sum : {0.0f, 0.09f, 0.11f, 0.49f, 0.51f, 0.99f, 1.01f}) {
            Twin twin({.slack = 0});
            twin.insert({.shape = solid, .pose = {}, .margin = 0.25f * sum});
            twin.insert({.shape = solid, .pose = {{box.upper.x - box.lower.x + gap, 0, 0}, {}}, .margin = 0.75f * sum});
            EXPECT_EQ(twin.world.update_pairs()->size(), sum > gap ? 1u : 0u) << gap << ' ' << sum;
        }
}

TEST(World, FarFromTheOriginToo) {
    Random random(4);
    for (const double far : {1e3, 1e6, 1e9, 1e20}) {
        Twin twin;
        uint32_t shared = 0;
        for (uint32_t i = 0; i < 60; ++i) { // two bodies that share a point, as nearly as floats can say there
            const auto& scene = solids()[i % 4];
            const Point d = random.direction(), p = scene.points[random.below(200)],
                        q = scene.points[random.below(200)];
            Pose a{scenes::to_float({far * d[0], far * d[1], far * d[2]}), random.rotation()}, b{{}, random.rotation()};
            const Point pa = scenes::rotate(a.rotation, p), qb = scenes::rotate(b.rotation, q);
            b.translation = scenes::to_float(
                {a.translation.x + pa[0] - qb[0], a.translation.y + pa[1] - qb[1], a.translation.z + pa[2] - qb[2]});
            QueryContext context;
            if (collide(tree(i), a, tree(i), b, context).verdict == Verdict::separated) continue;
            const BodyId first = twin.insert({.shape = tree(i), .pose = a}),
                         second = twin.insert({.shape = tree(i), .pose = b});
            EXPECT_TRUE(listed(*twin.world.update_pairs()).contains({first.index, second.index})) << far;
            ++shared;
        }
        EXPECT_GE(shared, 20u);
    }
}

TEST(World, WhatHasNoBoxMeetsAll) {
    Twin twin;
    std::vector<BodyId> ids;
    for (uint32_t i = 0; i < 20; ++i)
        ids.push_back(twin.insert({.shape = tree(i), .pose = {{100.0f * static_cast<float>(i), 0, 0}, {}}}));
    EXPECT_TRUE(twin.world.update_pairs()->empty());
    const auto with = [&](uint32_t i) {
        const auto pairs = *twin.world.update_pairs();
        return std::ranges::count_if(pairs, [&](const BodyPair& p) { return p.a == ids[i] || p.b == ids[i]; });
    };
    const Pose nowhere[] = {{{kNan, 0, 0}, {}},
                            {{0, std::numeric_limits<float>::infinity(), 0}, {}},
                            {{}, {0, 0, 0, 0}},
                            {{0, 0, -std::numeric_limits<float>::max()}, {}}};
    for (const Pose& pose : nowhere) {
        EXPECT_TRUE(twin.world.move(ids[7], pose));
        EXPECT_EQ(with(7), 19);
        EXPECT_EQ(twin.world.stats().unbounded, 1u);
        EXPECT_TRUE(twin.world.move(ids[3], {{1e6f, 0, 0}, {}})); // what moves later still meets it
        EXPECT_EQ(with(7), 19);
        EXPECT_EQ(with(3), 1);
        uint32_t seen = 0;
        twin.world.visit({{-9, -9, -9}, {-8, -8, -8}}, [&](BodyId id) { return seen += id == ids[7], true; });
        twin.world.cast({{-9, -9, -9}, {-9, -9, -9}}, {0, 0, 1}, 1.0f,
                        [&](BodyId id, float t) { return seen += id == ids[7], t; });
        EXPECT_EQ(seen, 2u);
        EXPECT_TRUE(twin.world.move(ids[7], {{1e7f, 0, 0}, {}}));
        EXPECT_EQ(with(7), 0);
        EXPECT_TRUE(twin.world.move(ids[3], {{300, 0, 0}, {}}));
        EXPECT_EQ(with(3), 0);
    }
    EXPECT_TRUE(twin.world.move(ids[4], nowhere[0]) && twin.world.move(ids[5], nowhere[0]));
    twin.remove(ids[4]);
    EXPECT_EQ(with(5), 18);
    EXPECT_EQ(twin.world.stats().unbounded, 1u);
}

TEST(World, RefusesIdsOfRemovedBodies) {
    Twin twin;
    const BodyId a = twin.insert({.shape = tree(0), .pose = {}}), b = twin.insert({.shape = tree(1), .pose = {}});
    ASSERT_EQ(twin.world.update_pairs()->size(), 1u);
    const std::vector<BodyPair> pairs(twin.world.pairs().begin(), twin.world.pairs().end());
    twin.remove(a);
    const BodyId c = twin.insert({.shape = tree(2), .pose = {}}); // in a's place
    EXPECT_EQ(c.index, a.index);
    EXPECT_NE(c.generation, a.generation);
    for (const BodyId id : {a, BodyId{}, BodyId{7, 1}, BodyId{c.index, c.generation + 1}}) {
        EXPECT_EQ(twin.world.find(id), nullptr);
        EXPECT_EQ(twin.world.remove(id).error().code, ErrorCode::bad_id);
        EXPECT_EQ(twin.world.move(id, {}).error().code, ErrorCode::bad_id);
        EXPECT_EQ(twin.world.refilter(id, 1, 1).error().code, ErrorCode::bad_id);
        const BodyId many[] = {b, id};
        const Pose poses[] = {{{1, 0, 0}, {}}, {}};
        const auto moved = twin.world.move(many, poses);
        EXPECT_EQ(moved.error().code, ErrorCode::bad_id);
        EXPECT_EQ(moved.error().where, 1u);
        EXPECT_EQ(twin.body(b).pose, Pose{});
    }
    QueryContext context;
    CollideResult result;
    EXPECT_EQ(collide(twin.world, pairs, {&result, 1}, {{&context, 1}}).error().code, ErrorCode::bad_id);
    ASSERT_EQ(twin.world.update_pairs()->size(), 1u);
    EXPECT_TRUE(twin.world.pairs()[0].begins); // c's, not a's
    EXPECT_EQ(twin.world.pairs()[0].a, c);
}

TEST(World, RefusesBadArguments) {
    for (const float slack : {-0.1f, 1.1f, kNan})
        EXPECT_EQ(World::create({.slack = slack}).error().code, ErrorCode::bad_options);
    Twin twin;
    for (const float margin : {-1.0f, kNan, std::numeric_limits<float>::infinity()})
        EXPECT_EQ(twin.world.insert({.shape = tree(0), .pose = {}, .margin = margin}).error().code,
                  ErrorCode::bad_options);
    const BodyId a = twin.insert({.shape = tree(0), .pose = {}}), b = twin.insert({.shape = tree(0), .pose = {}});
    const BodyId twice[] = {a, b, a};
    const Pose poses[] = {{{1, 0, 0}, {}}, {}, {}};
    EXPECT_EQ(twin.world.move(twice, poses).error().where, 2u);
    EXPECT_EQ(twin.world.move(twice, std::span(poses).first(2)).error().code, ErrorCode::bad_options);
    EXPECT_EQ(twin.body(a).pose, Pose{});
    QueryContext contexts[2];
    CollideResult results[3];
    const auto pairs = *twin.world.update_pairs();
    ASSERT_EQ(pairs.size(), 1u);
    EXPECT_FALSE(collide(twin.world, pairs, std::span<CollideResult>{}, {contexts}));
    EXPECT_FALSE(collide(twin.world, pairs, results, {}));
    EXPECT_FALSE(collide(twin.world, pairs, results, {contexts, thread_jobs(3)}));
    EXPECT_TRUE(collide(twin.world, pairs, results, {contexts, thread_jobs(2)}));
    const auto at = [&](size_t m, size_t n, size_t k) {
        return collide_poses(tree(0), std::span(poses).first(m), tree(1), std::span(poses).first(n),
                             std::span(results).first(k), contexts)
            .has_value();
    };
    EXPECT_TRUE(at(3, 3, 3) && at(1, 3, 3) && at(3, 1, 3) && at(1, 1, 1) && at(0, 1, 0) && at(0, 0, 0) && at(1, 0, 0));
    EXPECT_FALSE(at(3, 2, 3) || at(2, 3, 3) || at(3, 3, 2) || at(0, 3, 3) || at(3, 0, 3) || at(1, 1, 3));
}

// Everything that a world tells, in words.
struct Story {
    std::vector<BodyPair> pairs;
    std::vector<Verdict> verdicts;
    std::vector<uint64_t> work;
    bool operator==(const Story&) const = default;
};
Story story(const Jobs& jobs, uint32_t found_at_first) {
    Random random(5);
    Twin twin;
    EXPECT_TRUE(twin.world.reserve(0, found_at_first));
    std::vector<QueryContext> contexts(jobs.workers);
    Story out;
    for (uint32_t step = 0; step < 12; ++step) {
        twin.live(random, 300, 4, step == 0 ? 3000 : 100);
        std::vector<BodyId> ids;
        std::vector<Pose> poses;
        for (const auto& [index, id] : twin.ids) {
            if (random.below(3) == 0) continue;
            ids.push_back(id), poses.push_back(nudged(random, twin.body(id).pose, 0.05));
        }
        EXPECT_TRUE(twin.world.move(ids, poses, jobs));
        const auto pairs = *twin.world.update_pairs(jobs);
        std::vector<CollideResult> results(pairs.size());
        EXPECT_TRUE(collide(twin.world, pairs, results, {contexts, jobs}, {.max_level = 2}));
        out.pairs.insert(out.pairs.end(), pairs.begin(), pairs.end());
        for (const CollideResult& r : results)
            out.verdicts.push_back(r.verdict), out.work.push_back(r.stats.pair_tests);
        out.work.push_back(twin.world.stats().box_tests);
    }
    return out;
}

TEST(World, IsTheSameForAnyNumberOfThreads) {
    const Story serial = story({}, 0);
    EXPECT_GT(serial.pairs.size(), 10000u);
    EXPECT_GT(std::ranges::count(serial.verdicts, Verdict::overlapping), 1000);
    EXPECT_GT(std::ranges::count(serial.verdicts, Verdict::separated), 1000);
    EXPECT_TRUE(std::ranges::any_of(serial.pairs, &BodyPair::begins));
    for (uint32_t workers = 1; workers <= 8; ++workers)
        EXPECT_EQ(story(thread_jobs(workers), 10000), serial) << workers;
}

TEST(World, CollidesAsCollideDoes) {
    Random random(6);
    Twin twin;
    twin.live(random, 60, 2, 600);
    const auto pairs = *twin.world.update_pairs();
    std::vector<CollideResult> results(pairs.size());
    std::vector<QueryContext> contexts(3);
    std::memset(contexts.data(), 0xee, contexts.size() * sizeof(QueryContext));
    ASSERT_TRUE(collide(twin.world, pairs, results, {contexts, thread_jobs(3)}));
    for (size_t i = 0; i < pairs.size(); ++i) {
        const Body &a = twin.body(pairs[i].a), &b = twin.body(pairs[i].b);
        const auto one = collide(*a.tree(), a.pose, *b.tree(), b.pose, contexts[0]);
        EXPECT_EQ(results[i].verdict, one.verdict);
        EXPECT_EQ(results[i].stats.pair_tests, one.stats.pair_tests);
    }

    std::vector<Pose> poses;
    for (uint32_t i = 0; i < 500; ++i) poses.push_back(random_pose(random, i % 4 == 0 ? 4 : 1.5));
    poses[17].translation.y = std::numeric_limits<float>::quiet_NaN(), poses[18].rotation = {0, 0, 0, 0};
    poses[19].translation.x = std::numeric_limits<float>::infinity();
    results.resize(500);
    const Pose still = random_pose(random, 1);
    for (const bool a_moves : {false, true}) {
        const std::span<const Pose> many(poses), one(&still, 1);
        ASSERT_TRUE(collide_poses(tree(2), a_moves ? many : one, tree(3), a_moves ? one : many, results, contexts,
                                  thread_jobs(3)));
        uint32_t meeting = 0, by_roots = 0;
        for (uint32_t i = 0; i < 500; ++i) {
            const auto single =
                collide(tree(2), a_moves ? poses[i] : still, tree(3), a_moves ? still : poses[i], contexts[0]);
            EXPECT_EQ(results[i].verdict, single.verdict);
            EXPECT_EQ(results[i].enclosed, single.enclosed);
            EXPECT_LE(results[i].stats.tests(), single.stats.tests());
            meeting += single.verdict == Verdict::overlapping;
            by_roots += single.stats.block_tests > 0 && results[i].stats.block_tests == 0;
        }
        EXPECT_GT(by_roots, 20u);
        EXPECT_GT(meeting, 20u);
        EXPECT_LT(meeting, 480u);
    }
}

// A body is moved along a line to where the ellipsoids of the roots just come apart, and there around.
TEST(World, RootsAreApartOnlyWhereEllipsoidsAre) {
    Random random(16);
    QueryContext context;
    int apart = 0, near = 0;
    targets::for_each([&](const char* name) {
        for (int n = 0; n < 60; ++n) {
            const TreeView &a = tree(n % 4), &b = tree(n % 3);
            const Pose still = random_pose(random, n % 3 == 0 ? 1e3 : 1), turned = random_pose(random, 1);
            const auto margin = static_cast<float>(n % 5 == 0 ? 0.25 : 0);
            const auto at = [&](double x) {
                Pose out = turned;
                out.translation = still.translation;
                out.translation.x += static_cast<float>(x);
                return out;
            };
            const auto separated = [&](const Pose& pose) {
                return collide(a.root_bound(), still, b.root_bound(), pose, margin) == Verdict::separated;
            };
            double low = 0, high = 20;
            std::vector<Pose> poses;
            for (int k = 0; k < 40; ++k) {
                const double middle = 0.5 * (low + high);
                poses.push_back(at(middle));
                (separated(poses.back()) ? high : low) = middle;
            }
            std::vector<CollideResult> results(poses.size());
            ASSERT_TRUE(collide_poses(a, {&still, 1}, b, poses, results, {&context, 1}, {}, {.margin = margin}));
            for (size_t i = 0; i < poses.size(); ++i) {
                const auto single = collide(a, still, b, poses[i], context, {.margin = margin});
                ASSERT_EQ(results[i].verdict, single.verdict) << name;
                const auto k = static_cast<uint32_t>(i);
                const bool by_roots =
                    query::roots_apart(query::root_bounds(a, b, margin), {&still, 1}, poses, k, 1) != 0;
                ASSERT_TRUE(!by_roots || separated(poses[i])) << name << ' ' << n << ' ' << i;
                apart += by_roots, near += !by_roots && separated(poses[i]);
            }
        }
    });
    EXPECT_GT(apart, 2000);
    EXPECT_GT(near, 1000); // too near for it; of random poses there are next to none
}

TEST(World, SlotsLastAsLongAsPairs) {
    Random random(7);
    Twin twin;
    std::map<uint32_t, BodyPair> held; // by slot
    uint32_t began = 0, lasted = 0, still = 0;
    size_t most = 0, ended = 0;
    for (uint32_t step = 0; step < 300; ++step) {
        std::map<uint32_t, Pose> before;
        for (const auto& [index, id] : twin.ids) before[index] = twin.body(id).pose;
        twin.live(random, 80, 3, 20);
        const auto pairs = *twin.world.update_pairs();
        EXPECT_TRUE(std::ranges::is_sorted(pairs, {}, [](const BodyPair& p) { return Indices{p.a.index, p.b.index}; }));
        std::map<uint32_t, BodyPair> now;
        for (const BodyPair& p : pairs) {
            EXPECT_LT(p.a.index, p.b.index);
            EXPECT_LT(p.slot, twin.world.slot_count());
            EXPECT_TRUE(now.emplace(p.slot, p).second);
            const auto old = held.find(p.slot);
            const bool same = old != held.end() && old->second.a == p.a && old->second.b == p.b;
            EXPECT_EQ(p.begins, !same); // a pair that was there before keeps its slot, another's slot is said to be new
            ++(p.begins ? began : lasted);
            const auto untouched = [&](BodyId id) { // to the bit: some poses are NaN
                const auto old_pose = before.find(id.index);
                return old_pose != before.end() &&
                       std::memcmp(&old_pose->second, &twin.body(id).pose, sizeof(Pose)) == 0;
            };
            if (p.moved) continue;
            EXPECT_TRUE(untouched(p.a) && untouched(p.b));
            ++still;
        }
        for (const BodyPair& p : pairs)
            for (const auto& [slot, old] : held) EXPECT_TRUE(old.a != p.a || old.b != p.b || slot == p.slot);
        held = std::move(now);
        ended = twin.world.ended_pairs().size(), most = std::max(most, pairs.size() + ended);
    }
    EXPECT_EQ(twin.world.slot_count(), most); // no more than were ever needed at once, those just ended included
    EXPECT_GT(began, 500u);
    EXPECT_GT(lasted, 10000u);
    EXPECT_GT(still, 3000u);
}

TEST(World, AsksTheFilter) {
    struct Asked {
        uint32_t count = 0;
    } asked;
    const auto filter = [](void* user, const Body& a, const Body& b) {
        ++static_cast<Asked*>(user)->count;
        EXPECT_LT(a.user, b.user); // inserted in that order, so the lower index is first
        return a.user % 2 == b.user % 2;
    };
    Twin twin({.filter = filter, .filter_user = &asked});
    ASSERT_TRUE(twin.world.reserve(10, 45)); // or the pairs would be counted first, and then found again
    std::vector<BodyId> ids;
    for (uint32_t i = 0; i < 10; ++i) ids.push_back(twin.insert({.shape = tree(0), .pose = {}, .user = i}));
    EXPECT_EQ(twin.world.update_pairs()->size(), 20u);
    EXPECT_EQ(asked.count, 45u);
    EXPECT_EQ(twin.world.update_pairs()->size(), 20u); // nothing has changed, nobody is asked
    EXPECT_EQ(asked.count, 45u);
    EXPECT_TRUE(twin.world.refilter(ids[0], 1, ~1u));
    EXPECT_EQ(twin.world.update_pairs()->size(), 16u);
    EXPECT_EQ(asked.count, 45u); // the masks refuse
    EXPECT_TRUE(twin.world.refilter(ids[0], 1, 1));
    EXPECT_EQ(twin.world.update_pairs()->size(), 20u);
    EXPECT_EQ(asked.count, 54u);
}

TEST(World, VisitsAndCastsFindAllThatABoxOrRayMeets) {
    Random random(8);
    Twin twin;
    twin.live(random, 200, 6, 4000);
    struct Placed {
        uint32_t index, layers;
        Bounds box;
    };
    std::vector<Placed> bodies;
    for (const auto& [index, id] : twin.ids) {
        const Body& b = twin.body(id);
        bodies.push_back({index, b.layers, bounds(*b.tree(), b.pose, b.margin)});
    }
    uint64_t hits = 0, shown = 0, cast_hits = 0, cast_shown = 0;
    for (uint32_t i = 0; i < 2000; ++i) {
        const Point c = random.in_ball(), d = random.direction();
        const double size = i % 3 == 0 ? 0 : random.unit();
        const Vec3 lower = scenes::to_float({6 * c[0], 6 * c[1], 6 * c[2]});
        const Bounds box{lower,
                         {lower.x + static_cast<float>(size), lower.y + static_cast<float>(size),
                          lower.z + static_cast<float>(size)}};
        const uint32_t mask = i % 4 == 0 ? 2u : ~0u;
        std::set<uint32_t> seen;
        twin.world.visit(
            box,
            [&](BodyId id) {
                EXPECT_TRUE(seen.insert(id.index).second);
                return true;
            },
            mask);
        shown += seen.size();
        for (const auto& [index, layers, other] : bodies) {
            const bool meets = (layers & mask) != 0 && overlap(box, other);
            hits += meets;
            EXPECT_TRUE(!meets || seen.contains(index));
            EXPECT_TRUE(!seen.contains(index) || (layers & mask) != 0);
        }

        // Along a path, in exact steps: a box that overlaps at any of them has to be seen.
        Vec3 direction = scenes::to_float(d);
        if (i % 5 == 0) direction.y = 0;
        if (i % 10 == 0) direction.z = 0;
        seen.clear();
        twin.world.cast(
            box, direction, 4,
            [&](BodyId id, float t) {
                EXPECT_TRUE(seen.insert(id.index).second);
                return t;
            },
            mask);
        cast_shown += seen.size();
        for (const auto& [index, layers, other] : bodies) {
            bool meets = false;
            for (int k = 0; k <= 64 && !meets; ++k) {
                const double t = k / 16.0;
                const auto apart = [&](float low, float high, float other_low, float other_high, float along) {
                    return low + t * along > other_high || high + t * along < other_low;
                };
                meets = !apart(box.lower.x, box.upper.x, other.lower.x, other.upper.x, direction.x) &&
                        !apart(box.lower.y, box.upper.y, other.lower.y, other.upper.y, direction.y) &&
                        !apart(box.lower.z, box.upper.z, other.lower.z, other.upper.z, direction.z);
            }
            meets &= (layers & mask) != 0;
            cast_hits += meets;
            EXPECT_TRUE(!meets || seen.contains(index)) << i;
        }
    }
    EXPECT_GT(hits, 1000u);
    EXPECT_LT(shown, 3 * hits);
    EXPECT_GT(cast_hits, 3000u);
    EXPECT_LT(cast_shown, 2 * cast_hits);
}

// Rays that just graze: aimed at an edge of a body's own box, from far away and along odd directions.
TEST(World, CastsDoNotMissWhatTheyGraze) {
    Random random(9);
    Twin twin({.slack = 0});
    const BodyId only = twin.insert({.shape = tree(1), .pose = random_pose(random, 1)});
    const Bounds box = bounds(tree(1), twin.body(only).pose);
    uint32_t seen = 0;
    for (uint32_t i = 0; i < 20000; ++i) {
        // The start is the corner plus an exact multiple of a short direction: the ray goes through the corner exactly.
        const auto step = [&] { return 0x1p-7f * static_cast<float>(static_cast<int>(random.below(255)) - 127); };
        const Vec3 d{step(), step(), step()};
        const Vec3 corner{random.below(2) ? box.lower.x : box.upper.x, random.below(2) ? box.lower.y : box.upper.y,
                          random.below(2) ? box.lower.z : box.upper.z};
        const float times = static_cast<float>(1 + random.below(7)) * 0x1p-3f;
        const Vec3 start{corner.x - times * d.x, corner.y - times * d.y, corner.z - times * d.z};
        const bool exact = double{start.x} + double{times} * d.x == corner.x &&
                           double{start.y} + double{times} * d.y == corner.y &&
                           double{start.z} + double{times} * d.z == corner.z;
        if (!exact) continue;
        uint32_t hits = 0;
        twin.world.cast({start, start}, d, times, [&](BodyId, float t) { return ++hits, t; }); // ends there exactly
        EXPECT_EQ(hits, 1u);
        seen += hits;
    }
    EXPECT_GT(seen, 100u);
}

TEST(World, CastsStopAtWhatTheyAreTold) {
    Twin twin;
    std::vector<BodyId> ids;
    for (uint32_t i = 0; i < 50; ++i)
        ids.push_back(twin.insert({.shape = tree(0), .pose = {{10.0f * static_cast<float>(i), 0, 0}, {}}}));
    const Bounds point{{-10, 0, 0}, {-10, 0, 0}};
    std::vector<uint32_t> order;
    twin.world.cast(point, {1, 0, 0}, 1000, [&](BodyId id, float t) { return order.push_back(id.index), t; });
    EXPECT_EQ(order.size(), 50u);
    EXPECT_TRUE(std::ranges::is_sorted(order)); // nearer ones first, for boxes in a row
    order.clear();
    twin.world.cast(point, {1, 0, 0}, 1000, [&](BodyId id, float) { return order.push_back(id.index), 35.0f; });
    EXPECT_LE(order.size(), 4u);
    order.clear();
    twin.world.cast(point, {1, 0, 0}, 1000, [&](BodyId id, float) { return order.push_back(id.index), -1.0f; });
    EXPECT_EQ(order.size(), 1u);
    twin.world.cast(point, {1, 0, 0}, kNan, [&](BodyId id, float t) { return order.push_back(id.index), t; });
    EXPECT_EQ(order.size(), 51u); // a NaN excludes nothing
    uint32_t visits = 0;
    twin.world.visit(query::kEverything, [&](BodyId) { return ++visits < 5; });
    EXPECT_EQ(visits, 5u);
}

TEST(World, AllocatesNothingBeyondWhatWasReserved) {
    Memory memory;
    {
        Random random(10);
        Twin twin({}, &memory);
        ASSERT_TRUE(twin.world.reserve(200, 20000));
        const uint64_t before = memory.allocations;
        for (uint32_t step = 0; step < 200; ++step) {
            twin.live(random, 200, 3, 50);
            ASSERT_LE(twin.world.update_pairs()->size(), 20000u);
        }
        const uint32_t count = twin.world.body_count();
        EXPECT_GT(count, 180u);
        EXPECT_GT(twin.world.slot_count(), 500u);
        EXPECT_EQ(memory.allocations, before);
        World other = std::move(twin.world);
        EXPECT_EQ(other.body_count(), count);
        twin.world = std::move(other);
    }
    EXPECT_EQ(memory.bytes, 0);
}

TEST(World, SurvivesWhenMemoryRunsOut) {
    for (uint64_t limit = 0; limit < 60; ++limit) {
        Memory memory;
        memory.limit = limit;
        auto made = World::create({}, &memory);
        if (limit == 0) {
            EXPECT_EQ(made.error().code, ErrorCode::out_of_memory);
            continue;
        }
        World world = std::move(*made);
        std::vector<BodyId> ids;
        uint32_t refused = 0;
        for (uint32_t i = 0; i < 100; ++i) { // all in one place: many pairs
            const auto id = world.insert({.shape = tree(i), .pose = {}});
            if (id)
                ids.push_back(*id);
            else
                refused += id.error().code == ErrorCode::out_of_memory;
            if (i % 10 == 9) {
                const size_t before = world.pairs().size();
                const auto pairs = world.update_pairs();
                if (!pairs) {
                    EXPECT_EQ(pairs.error().code, ErrorCode::out_of_memory);
                    EXPECT_EQ(world.pairs().size(), before);
                    ++refused;
                }
            }
        }
        EXPECT_EQ(world.body_count(), ids.size());
        EXPECT_TRUE(limit >= 20 || refused > 0);
        memory.limit = UINT64_MAX; // with memory again, nothing has been lost
        EXPECT_EQ(world.update_pairs()->size(), ids.size() * (ids.size() - 1) / 2);
        for (const BodyId id : ids) EXPECT_TRUE(world.remove(id));
        EXPECT_TRUE(world.update_pairs()->empty());
    }
}

} // namespace
} // namespace prolate

// Queries of a whole World, beside the queries of two bodies that they stand for; compounds, ground, events, and what
// functions of the caller's may do to the world that calls them.
#include "tests/exact_scenes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/threads.hpp"

#include <prolate/half_space.hpp>
#include <prolate/primitives.hpp>
#include <prolate/world_queries.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

constexpr float kInfinity = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();

struct Trees {
    std::vector<std::vector<std::byte>> bytes;
    std::vector<TreeView> all;
    Trees() {
        Random random(5);
        bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.3f, 32, 16)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::box(0.5f, 0.7f, 0.4f)).bytes);
        bytes.push_back(scenes::tree(random, scenes::cloud(random, 200), {.degree = 8, .levels = 3}).bytes);
        for (const auto& b : bytes) all.push_back(*TreeView::open(b));
    }
};
TreeView tree(uint32_t i) {
    static const Trees trees;
    return trees.all[i % trees.all.size()];
}

Pose random_pose(Random& random, double spread) {
    const Point p = random.in_ball();
    return {scenes::to_float({spread * p[0], spread * p[1], spread * p[2]}), random.rotation()};
}
constexpr HalfSpace kGround{{0, 0, 2}, -2};

// Bodies, compounds of three parts and a piece of ground among each other.
struct Scene {
    World world = *World::create();
    std::vector<BodyId> bodies;
    std::vector<QueryContext> contexts = std::vector<QueryContext>(3);

    Scene(Random& random, uint32_t count, double spread) {
        for (uint32_t i = 0; i < count; ++i) {
            const Body body{.shape = tree(i), .pose = random_pose(random, spread), .user = i};
            const Part parts[] = {{tree(i + 1), random_pose(random, 1)}, {tree(i + 2), random_pose(random, 2)}};
            bodies.push_back(*world.insert(body, i % 3 == 0 ? std::span<const Part>(parts) : std::span<const Part>()));
            if (i != count / 2) continue;
            EXPECT_TRUE(world.insert({.shape = kGround, .pose = {}, .layers = 2}));
        }
        EXPECT_TRUE(world.update_pairs());
    }
    std::span<const BodyPair> pairs() const { return world.pairs(); }
    const Body& at(BodyId id) const { return *world.find(id); }
    std::vector<BodyId> all() const { // with parts and ground
        std::vector<BodyId> out;
        world.visit({{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}},
                    [&](BodyId id) { return out.push_back(id), true; });
        std::ranges::sort(out, {}, &BodyId::index);
        return out;
    }
    // With one worker and with three.
    template <class Ask> void both_ways(Ask&& ask) {
        ask(Workers{contexts});
        ask(Workers{contexts, thread_jobs(3)});
    }
};

Verdict verdict_of_two(const Body& a, const Body& b, QueryContext& context, float margin = 0) {
    const QueryOptions options{.margin = margin};
    if (a.tree() && b.tree()) return collide(*a.tree(), a.pose, *b.tree(), b.pose, context, options).verdict;
    const Body &body = a.tree() ? a : b, &ground = a.tree() ? b : a;
    return overlap(*body.tree(), body.pose, *ground.half_space(), context, options).verdict;
}

TEST(WorldQueries, PairsAreAnsweredAsTwoBodiesAre) {
    Random random(1);
    Scene scene(random, 60, 4);
    const auto pairs = scene.pairs();
    ASSERT_GT(pairs.size(), 200u);
    QueryContext context;
    scene.both_ways([&](const Workers& workers) {
        std::vector<CollideResult> results(pairs.size());
        std::vector<Verdict> verdicts(pairs.size());
        std::vector<DistanceResult> distances(pairs.size());
        std::vector<OfPair<DistanceCache>> near(scene.world.slot_count());
        ASSERT_TRUE(collide(scene.world, pairs, results, workers));
        ASSERT_TRUE(collide(scene.world, pairs, verdicts, workers));
        ASSERT_TRUE(distance(scene.world, pairs, distances, workers, {}, near));
        ASSERT_TRUE(distance(scene.world, pairs, distances, workers, {}, near)); // warm
        uint32_t overlapping = 0, ground = 0;
        for (size_t i = 0; i < pairs.size(); ++i) {
            const Body &a = scene.at(pairs[i].a), &b = scene.at(pairs[i].b);
            const Verdict verdict = verdict_of_two(a, b, context);
            EXPECT_EQ(results[i].verdict, verdict);
            EXPECT_EQ(verdicts[i], verdict);
            EXPECT_EQ(distances[i].verdict, verdict);
            overlapping += verdict == Verdict::overlapping, ground += !a.tree() || !b.tree();
            const DistanceResult d = a.tree() && b.tree() ? distance(*a.tree(), a.pose, *b.tree(), b.pose, context)
                                     : a.tree()           ? distance(*a.tree(), a.pose, *b.half_space(), context)
                                                          : distance(*b.tree(), b.pose, *a.half_space(), context);
            EXPECT_NEAR(d.upper, distances[i].upper, 2e-6 * d.upper + 1e-12);
            if (verdict != Verdict::separated) continue;
            const Vec3 p = distances[i].point_a, q = distances[i].point_b, n = distances[i].normal;
            // The normal leads from a to b.
            EXPECT_GT((q.x - p.x) * n.x + (q.y - p.y) * n.y + (q.z - p.z) * n.z, 0.99 * distances[i].upper - 1e-5);
        }
        EXPECT_GT(overlapping, 50u);
        EXPECT_LT(overlapping, pairs.size() - 50);
        EXPECT_GT(ground, 10u);
    });
}

TEST(WorldQueries, ContactsArePointsOfBothAndKeepWhatTheSolverLeft) {
    Random random(2);
    Scene scene(random, 40, 3);
    std::vector<PairContacts> serial, parallel;
    scene.both_ways([&](const Workers& workers) {
        auto& records = workers.jobs.workers > 1 ? parallel : serial;
        records.resize(scene.world.slot_count());
        for (uint32_t step = 0; step < 3; ++step) {
            ASSERT_TRUE(contacts(scene.world, scene.pairs(), records, workers, {.margin = 0.01f}));
            uint32_t points = 0, kept = 0, on_ground = 0;
            for (const BodyPair& pair : scene.pairs()) {
                PairContacts& record = records[pair.slot];
                ASSERT_TRUE(record.a == pair.a && record.b == pair.b);
                EXPECT_EQ(record.touching, record.result.verdict == Verdict::overlapping);
                for (uint32_t i = 0; i < record.manifolds.count; ++i) {
                    Manifold& m = record.manifolds.manifolds[i];
                    const bool is_ground_a = !scene.at(pair.a).tree(), is_ground_b = !scene.at(pair.b).tree();
                    EXPECT_TRUE(!is_ground_b || m.normal.z < -0.999f);
                    EXPECT_TRUE(!is_ground_a || m.normal.z > 0.999f);
                    on_ground += is_ground_a || is_ground_b;
                    for (uint32_t k = 0; k < m.count; ++k) {
                        ContactPoint& p = m.points[k];
                        EXPECT_LE(p.age, step);
                        EXPECT_EQ(p.impulse[1], p.age == 0 ? 0 : static_cast<float>(p.id % 1000));
                        kept += p.age == step;
                        p.impulse[1] = static_cast<float>(p.id % 1000);
                        const float along = (p.point_a.x - p.point_b.x) * m.normal.x +
                                            (p.point_a.y - p.point_b.y) * m.normal.y +
                                            (p.point_a.z - p.point_b.z) * m.normal.z;
                        EXPECT_NEAR(along, p.depth, 1e-4);
                        ++points;
                    }
                }
            }
            EXPECT_GT(points, 100u);
            EXPECT_GT(kept, points - points / 4); // in deep overlaps, other points may stand for all
            EXPECT_GT(on_ground, 5u);
        }
    });
    for (size_t i = 0; i < serial.size(); ++i) {
        EXPECT_EQ(serial[i].manifolds.count, parallel[i].manifolds.count);
        EXPECT_EQ(serial[i].result.found, parallel[i].result.found);
    }
}

TEST(WorldQueries, GroundIsAPairWithAllThatIsNearIt) {
    Random random(3);
    QueryContext context;
    uint32_t near = 0, listed = 0, far = 0;
    for (uint32_t round = 0; round < 60; ++round) {
        World world = *World::create({.slack = round % 2 == 0 ? 0 : 0.1f});
        const Point n = random.direction();
        const double length = random.log_in(0.01, 100), scale = random.log_in(1, 1000);
        const float margin = round % 3 == 0 ? 0 : static_cast<float>(0.3 * random.unit());
        const HalfSpace ground{scenes::to_float({length * n[0], length * n[1], length * n[2]}),
                               static_cast<float>(scale * random.in(-1, 1))};
        std::vector<BodyId> ids;
        BodyId floor{};
        for (uint32_t i = 0; i < 40; ++i) {
            if (i == round % 40) floor = *world.insert({.shape = ground, .pose = {}, .margin = margin});
            Pose pose = random_pose(random, 2);
            const double height = ground.offset + random.in(-2, 2);
            pose.translation.x += static_cast<float>(height * n[0]);
            pose.translation.y += static_cast<float>(height * n[1]);
            pose.translation.z += static_cast<float>(height * n[2]);
            ids.push_back(*world.insert({.shape = tree(i), .pose = random_pose(random, 1e3)}));
            ASSERT_TRUE(world.move(ids.back(), pose));
        }
        for (uint32_t step = 0; step < 5; ++step) {
            std::set<uint32_t> partners;
            ASSERT_TRUE(world.update_pairs());
            for (const BodyPair& p : world.pairs()) {
                if (p.a == floor) partners.insert(p.b.index);
                if (p.b == floor) partners.insert(p.a.index);
            }
            listed += static_cast<uint32_t>(partners.size());
            for (const BodyId id : ids) {
                const Body& body = *world.find(id);
                const bool meets =
                    overlap(*body.tree(), body.pose, ground, context, {.margin = margin}).verdict != Verdict::separated;
                EXPECT_TRUE(!meets || partners.contains(id.index));
                near += meets, far += !meets;
                Pose pose = body.pose;
                pose.translation.z += static_cast<float>(random.in(-0.3, 0.3));
                ASSERT_TRUE(world.move(id, pose));
            }
        }
    }
    EXPECT_GT(near, 3000u);
    EXPECT_GT(far, 3000u);
    EXPECT_LT(listed, near + far / 2);
}

TEST(WorldQueries, GroundStaysAndHasNoParts) {
    World world = *World::create();
    const BodyId ground = *world.insert({.shape = kGround, .pose = {}});
    EXPECT_EQ(world.move(ground, {}).error().code, ErrorCode::bad_options);
    const Pose pose;
    EXPECT_EQ(world.move({&ground, 1}, {&pose, 1}).error().code, ErrorCode::bad_options);
    const Part part{tree(0), {}};
    EXPECT_EQ(world.insert({.shape = kGround, .pose = {}}, {&part, 1}).error().code, ErrorCode::bad_options);
    EXPECT_TRUE(world.insert({.shape = HalfSpace{{0, 0, -1}, 0}, .pose = {}}));
    EXPECT_TRUE(world.update_pairs()->empty()); // two half-spaces are no pair
    const BodyId body = *world.insert({.shape = tree(0), .pose = {{0, 0, 1000}, {}}});
    EXPECT_EQ(world.update_pairs()->size(), 1u); // with the one that it is deep in
    EXPECT_TRUE(world.remove(ground));
    EXPECT_TRUE(world.remove(body));
    EXPECT_EQ(world.stats().unbounded, 1u);
    for (const HalfSpace& odd :
         {HalfSpace{{0, 0, 0}, 0}, HalfSpace{{kNan, 0, 0}, 0}, HalfSpace{{1, 0, 0}, kInfinity}}) {
        World other = *World::create();
        ASSERT_TRUE(other.insert({.shape = odd, .pose = {}}));
        ASSERT_TRUE(other.insert({.shape = tree(0), .pose = {{1e6f, 0, 0}, {}}}));
        EXPECT_EQ(other.update_pairs()->size(), 1u);
    }
}

TEST(WorldQueries, CompoundsMoveAsOneAndNeverMeetThemselves) {
    Random random(4);
    World world = *World::create();
    std::vector<BodyId> ids;
    std::map<uint32_t, std::vector<Pose>> locals;
    for (uint32_t i = 0; i < 20; ++i) {
        std::vector<Part> parts;
        for (uint32_t k = 0; k < i % 4; ++k) parts.push_back({tree(i + k), random_pose(random, 1)});
        const BodyId id = *world.insert({.shape = tree(i), .pose = random_pose(random, 3), .user = i}, parts);
        for (const Part& part : parts) locals[id.index].push_back(part.pose);
        ids.push_back(id);
    }
    EXPECT_EQ(world.body_count(), 20u + 5 * (0 + 1 + 2 + 3));
    std::vector<Pose> poses(ids.size());
    for (uint32_t step = 0; step < 20; ++step) {
        for (Pose& pose : poses) pose = random_pose(random, 3);
        ASSERT_TRUE(world.move(ids, poses, step % 2 == 0 ? Jobs{} : thread_jobs(3)));
        for (size_t i = 0; i < ids.size() && step % 3 == 0; ++i) ASSERT_TRUE(world.move(ids[i], poses[i]));
        for (size_t i = 0; i < ids.size(); ++i) {
            EXPECT_EQ(world.find(ids[i])->pose, poses[i]);
            EXPECT_EQ(world.part(ids[i], 0), ids[i]);
            const auto& own = locals[ids[i].index];
            for (uint32_t k = 0; k < own.size(); ++k) {
                const BodyId part = world.part(ids[i], k + 1);
                EXPECT_EQ(world.body_of(part), ids[i]);
                EXPECT_EQ(world.find(part)->pose, part_pose(poses[i], own[k]));
                EXPECT_EQ(world.find(part)->user, i);
                const Point p = scenes::rotate(poses[i].rotation,
                                               {own[k].translation.x, own[k].translation.y, own[k].translation.z});
                EXPECT_NEAR(world.find(part)->pose.translation.x, poses[i].translation.x + p[0], 1e-6);
                // Both rotations, one after the other.
                const Point q{0.3, -0.2, 0.9};
                const Point both = scenes::rotate(poses[i].rotation, scenes::rotate(own[k].rotation, q)),
                            at_once = scenes::rotate(world.find(part)->pose.rotation, q);
                for (size_t j = 0; j < 3; ++j) EXPECT_NEAR(both[j], at_once[j], 1e-6);
                EXPECT_FALSE(world.move(part, {}));
                EXPECT_FALSE(world.remove(part));
                EXPECT_FALSE(world.refilter(part, 1, 1));
            }
            EXPECT_EQ(world.part(ids[i], static_cast<uint32_t>(own.size()) + 1), BodyId{});
        }
        uint32_t between_parts = 0;
        ASSERT_TRUE(world.update_pairs());
        for (const BodyPair& pair : world.pairs()) {
            EXPECT_NE(world.body_of(pair.a), world.body_of(pair.b));
            between_parts += world.body_of(pair.a) != pair.a;
        }
        EXPECT_GT(between_parts, 10u);
    }
    ASSERT_TRUE(world.refilter(ids[3], 4, 0));
    ASSERT_TRUE(world.update_pairs());
    for (const BodyPair& pair : world.pairs())
        EXPECT_TRUE(world.body_of(pair.a) != ids[3] && world.body_of(pair.b) != ids[3]);
    const BodyId part = world.part(ids[3], 2);
    ASSERT_TRUE(world.remove(ids[3]));
    EXPECT_EQ(world.find(part), nullptr);
    EXPECT_EQ(world.body_of(part), BodyId{});
    EXPECT_EQ(world.body_count(), 50u - 4);
    const Pose broken = part_pose({{}, {0, 0, 0, 0}}, {});
    EXPECT_TRUE(std::isnan(broken.rotation.x));
}

// What events ought to be, from the verdicts alone.
TEST(WorldQueries, EventsTellWhatBeganStaysAndEnded) {
    Random random(5);
    Scene scene(random, 40, 4);
    World& world = scene.world;
    using Key = std::pair<std::pair<uint32_t, uint32_t>, std::pair<uint32_t, uint32_t>>; // both ids
    const auto key = [](BodyId a, BodyId b) { return Key{{a.index, a.generation}, {b.index, b.generation}}; };
    std::set<Key> touched;
    std::vector<PairContacts> records;
    std::vector<ContactEvent> events;
    uint32_t counts[3] = {}, removed = 0;
    for (uint32_t step = 0; step < 60; ++step) {
        for (size_t i = 0; i < scene.bodies.size(); ++i) {
            if (random.below(3) == 0) continue;
            Pose pose = scene.at(scene.bodies[i]).pose;
            pose.translation.x += static_cast<float>(random.in(-0.2, 0.2));
            ASSERT_TRUE(world.move(scene.bodies[i], pose));
        }
        if (step % 5 == 4) {
            ASSERT_TRUE(world.remove(scene.bodies[step / 5]));
            scene.bodies[step / 5] = *world.insert({.shape = tree(step), .pose = random_pose(random, 4)});
            ++removed;
        }
        ASSERT_TRUE(world.update_pairs());
        records.resize(world.slot_count());
        events.resize(world.pairs().size() + world.ended_pairs().size());
        // Only what has moved; the others keep what they had.
        std::vector<BodyPair> moved;
        std::ranges::copy_if(world.pairs(), std::back_inserter(moved),
                             [&](const BodyPair& pair) { return pair.moved || step == 0; });
        ASSERT_TRUE(contacts(world, moved, records, {scene.contexts, thread_jobs(3)}));
        const auto count = contact_events(world, records, events);
        ASSERT_TRUE(count);
        std::map<Key, ContactEvent::Kind> found;
        for (size_t i = 0; i < *count; ++i) {
            EXPECT_TRUE(found.emplace(key(events[i].a, events[i].b), events[i].kind).second);
            ++counts[static_cast<size_t>(events[i].kind)];
        }
        std::set<Key> touching;
        for (const BodyPair& pair : world.pairs())
            if (verdict_of_two(scene.at(pair.a), scene.at(pair.b), scene.contexts[0]) == Verdict::overlapping)
                touching.insert(key(pair.a, pair.b));
        std::map<Key, ContactEvent::Kind> expected;
        for (const Key& k : touching)
            expected[k] = touched.contains(k) ? ContactEvent::Kind::stays : ContactEvent::Kind::began;
        for (const Key& k : touched)
            if (!touching.contains(k)) expected[k] = ContactEvent::Kind::ended;
        EXPECT_EQ(found, expected) << step;
        touched = std::move(touching);
    }
    EXPECT_GT(counts[0], 100u);
    EXPECT_GT(counts[1], 1000u);
    EXPECT_GT(counts[2], 100u);
    EXPECT_EQ(removed, 12u);
    EXPECT_EQ(contact_events(world, records, std::span(events).first(1)).error().code, ErrorCode::bad_options);
    EXPECT_EQ(contact_events(world, std::span(records).first(1), events).error().code, ErrorCode::bad_options);
}

TEST(WorldQueries, EventsOutliveTheBodiesRemovedAmongThem) {
    World world = *World::create();
    std::vector<BodyId> ids;
    ids.reserve(5);
    for (int i = 0; i < 5; ++i) ids.push_back(*world.insert({.shape = tree(1), .pose = {}}));
    ASSERT_EQ(world.update_pairs()->size(), 10u);
    QueryContext context;
    std::vector<PairContacts> records(world.slot_count());
    ASSERT_TRUE(contacts(world, world.pairs(), records, {{&context, 1}}));
    std::vector<ContactEvent> events(10);
    ASSERT_EQ(*contact_events(world, records, events), 10u);
    for (const ContactEvent& event : events) { // a bullet goes with the first thing that it touches
        EXPECT_EQ(event.kind, ContactEvent::Kind::began);
        if (event.a == ids[0]) (void)world.remove(ids[0]);
    }
    EXPECT_EQ(world.pairs().size(), 10u);
    const auto stale = contacts(world, world.pairs(), records, {{&context, 1}}); // named, not answered
    EXPECT_EQ(stale.error().code, ErrorCode::bad_id);
    EXPECT_EQ(stale.error().where, 0u);
    ASSERT_EQ(world.update_pairs()->size(), 6u);
    EXPECT_EQ(world.ended_pairs().size(), 4u);
    ASSERT_TRUE(contacts(world, world.pairs(), records, {{&context, 1}}));
    ASSERT_EQ(*contact_events(world, records, events), 10u);
    for (size_t i = 0; i < 10; ++i)
        EXPECT_EQ(events[i].kind, i < 4 ? ContactEvent::Kind::ended : ContactEvent::Kind::stays);
}

TEST(WorldQueries, NothingChangesWhileTheCallersFunctionsRun) {
    struct Caller {
        World* world = nullptr;
        BodyId id;
        uint32_t refused = 0;
        void try_all() {
            const Pose pose;
            const auto refuses = [&](const auto& result) {
                refused += !result && result.error().code == ErrorCode::busy;
            };
            refuses(world->remove(id)), refuses(world->move(id, pose)), refuses(world->refilter(id, 1, 1));
            refuses(world->move({&id, 1}, {&pose, 1})), refuses(world->insert({.shape = tree(0), .pose = {}}));
            refuses(world->update_pairs()), refuses(world->reserve(1000, 1000));
        }
    } caller;
    const auto filter = [](void* user, const Body&, const Body&) {
        static_cast<Caller*>(user)->try_all();
        return true;
    };
    World world = *World::create({.filter = filter, .filter_user = &caller});
    ASSERT_TRUE(world.reserve(4, 4));
    caller.world = &world, caller.id = *world.insert({.shape = tree(0), .pose = {{0, 0, 0}, {}}});
    ASSERT_TRUE(world.insert({.shape = tree(1), .pose = {}}));
    EXPECT_EQ(world.update_pairs()->size(), 1u);
    EXPECT_EQ(caller.refused, 7u);
    const Bounds all{{-9, -9, -9}, {9, 9, 9}};
    uint32_t seen = 0;
    world.visit(all, [&](BodyId) { return caller.try_all(), ++seen, true; });
    world.cast(all, {1, 0, 0}, 1, [&](BodyId, float until) { return caller.try_all(), ++seen, until; });
    EXPECT_EQ(seen, 4u);
    EXPECT_EQ(caller.refused, 7u * 5);
    EXPECT_EQ(world.body_count(), 2u);
    EXPECT_TRUE(world.remove(caller.id)); // and afterwards it does
}

TEST(WorldQueries, CachesAreOnlyUsedForTheirOwnPair) {
    // Slots are handed from pair to pair, and the caller takes no care at all.
    Random random(6);
    Scene scene(random, 30, 3);
    World& world = scene.world;
    std::vector<OfPair<PairCache>> caches;
    uint32_t reused = 0, compared = 0;
    for (uint32_t step = 0; step < 100; ++step) {
        const size_t which = random.below(static_cast<uint32_t>(scene.bodies.size()));
        if (step % 2 == 0) {
            ASSERT_TRUE(world.remove(scene.bodies[which]));
            scene.bodies[which] = *world.insert({.shape = tree(step), .pose = random_pose(random, 3)});
        } else {
            ASSERT_TRUE(world.move(scene.bodies[which], random_pose(random, 3)));
        }
        ASSERT_TRUE(world.update_pairs());
        if (step % 3 == 0) continue; // nothing is asked: pairs come and go unseen
        caches.resize(world.slot_count());
        std::vector<Verdict> cold(world.pairs().size()), warm(cold.size());
        for (const BodyPair& pair : world.pairs())
            reused += caches[pair.slot].a != BodyId{} && caches[pair.slot].a != pair.a;
        ASSERT_TRUE(collide(world, world.pairs(), warm, {scene.contexts, thread_jobs(3)}, {}, caches));
        ASSERT_TRUE(collide(world, world.pairs(), cold, {scene.contexts}));
        EXPECT_EQ(cold, warm);
        compared += static_cast<uint32_t>(cold.size());
    }
    EXPECT_GT(reused, 100u);
    EXPECT_GT(compared, 5000u);
}

TEST(WorldQueries, SweepsOfPairsAreThoseOfTwoBodies) {
    Random random(7);
    Scene scene(random, 40, 4);
    const auto pairs = scene.pairs();
    std::vector<Motion> motions(scene.world.body_count());
    for (const BodyId id : scene.all()) {
        Motion& m = motions[id.index];
        const Point v = random.in_ball(), w = random.in_ball();
        m.start = scene.at(id).pose, m.linear = scenes::to_float(v), m.angular = scenes::to_float(w);
    }
    uint32_t hits = 0;
    QueryContext context;
    scene.both_ways([&](const Workers& workers) {
        std::vector<SweepResult> results(pairs.size());
        ASSERT_TRUE(sweep(scene.world, pairs, motions, results, workers));
        for (size_t i = 0; i < pairs.size(); ++i) {
            const Body &a = scene.at(pairs[i].a), &b = scene.at(pairs[i].b);
            const Motion &ma = motions[pairs[i].a.index], &mb = motions[pairs[i].b.index];
            const SweepResult one = a.tree() && b.tree() ? sweep(*a.tree(), ma, *b.tree(), mb, context)
                                    : a.tree()           ? sweep(*a.tree(), ma, *b.half_space(), context)
                                                         : sweep(*b.tree(), mb, *a.half_space(), context);
            EXPECT_EQ(results[i].verdict, one.verdict);
            EXPECT_EQ(results[i].time_lower, one.time_lower);
            hits += one.verdict == Verdict::overlapping;
        }
        EXPECT_FALSE(sweep(scene.world, pairs, std::span(motions).first(1), results, workers));
    });
    EXPECT_GT(hits, 100u);
}

TEST(WorldQueries, RaysHitWhatIsFirst) {
    Random random(8);
    Scene scene(random, 60, 6);
    const auto all = scene.all();
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < 600; ++i) {
        const Point o = random.in_ball(), d = random.direction();
        rays.push_back({scenes::to_float({8 * o[0], 8 * o[1], 8 * o[2]}), scenes::to_float(d),
                        i % 5 == 0 ? static_cast<float>(random.in(0, 5)) : kInfinity});
    }
    rays.push_back({{0, 0, 50}, {1, 0, 0}});    // level with the ground, above all
    rays.push_back({{0, 0, 50}, {0, 0, 0}});    // no ray
    rays.push_back({{0, 0, 50}, {0, 0, kNan}}); // not finite
    rays.push_back({{0, 0, 50}, {0, 0, -1}, -1});
    QueryContext context;
    for (const float margin : {0.0f, 0.2f}) {
        std::vector<RayHit> hits(rays.size()), others(rays.size());
        ASSERT_TRUE(raycast(scene.world, rays, hits, {scene.contexts}, {.margin = margin}));
        ASSERT_TRUE(raycast(scene.world, rays, others, {scene.contexts, thread_jobs(3)}, {.margin = margin}));
        uint32_t found = 0, same = 0, ground = 0;
        for (size_t i = 0; i < 600; ++i) {
            RaycastResult best;
            BodyId body;
            for (const BodyId id : all) {
                if (!scene.at(id).tree()) continue;
                const RaycastResult r =
                    raycast(*scene.at(id).tree(), scene.at(id).pose, rays[i], context, {.margin = margin});
                if (r.verdict == Verdict::overlapping && r.t < best.t) best = r, body = id;
            }
            // The ground, z <= -1 of a normal of length 2.
            const double slope = rays[i].direction.z, height = rays[i].origin.z + 2.0 - double{margin};
            const double t = height <= 0 ? 0 : slope < 0 ? height / -slope : kInfinity;
            if (t < best.t && t <= rays[i].max_t) {
                EXPECT_EQ(scene.at(hits[i].body).tree(), nullptr);
                EXPECT_NEAR(hits[i].result.t, t, 1e-9 * (1 + t));
                EXPECT_EQ(hits[i].result.verdict, Verdict::overlapping);
                ++ground;
            } else {
                EXPECT_EQ(hits[i].body == BodyId{}, body == BodyId{});
                EXPECT_EQ(hits[i].result.verdict, body == BodyId{} ? Verdict::separated : Verdict::overlapping);
                if (body != BodyId{}) {
                    // Cut short by what was hit before, the ray is placed a little otherwise: of two bodies that are
                    // hit at once, either may seem the first.
                    const TreeView* const first = scene.at(hits[i].body).tree(); // null: in the ground, too
                    const double own =
                        first ? raycast(*first, scene.at(hits[i].body).pose, rays[i], context, {.margin = margin}).t
                              : t;
                    EXPECT_NEAR(own, best.t, 1e-9);
                    same += hits[i].body == body;
                    EXPECT_NEAR(hits[i].result.t, best.t, 1e-9) << i << ' ' << margin;
                    ++found;
                    EXPECT_EQ(hits[i].result.clear, hits[i].result.t);
                } else {
                    EXPECT_EQ(hits[i].result.clear, double{rays[i].max_t});
                }
            }
            EXPECT_EQ(hits[i].body, others[i].body);
            EXPECT_EQ(hits[i].result.t, others[i].result.t);
        }
        EXPECT_GT(found, 60u);
        EXPECT_GE(same + 5, found);
        EXPECT_GT(ground, 50u);
        EXPECT_EQ(hits[600].result.verdict, Verdict::separated);
        EXPECT_EQ(hits[601].result.verdict, Verdict::undecided);
        EXPECT_EQ(hits[602].result.verdict, Verdict::undecided);
        EXPECT_EQ(hits[603].result.verdict, Verdict::separated);
        ASSERT_TRUE(raycast(scene.world, rays, hits, {scene.contexts}, {.margin = margin}, 2));
        for (const RayHit& hit : hits) EXPECT_TRUE(hit.body == BodyId{} || !scene.at(hit.body).tree());
    }
}

TEST(WorldQueries, RaysAreAnsweredTogetherAsAlone) {
    Random random(9);
    Scene scene(random, 60, 6);
    std::vector<Ray> rays; // of a picture, then random ones among them, then only those
    for (uint32_t i = 0; i < 1500; ++i) {
        const Point o = random.in_ball(), d = random.direction();
        if (i < 1000 && i % 20 != 7)
            rays.push_back({{0.2f * static_cast<float>(i % 40) - 4, 0.3f * static_cast<float>(i / 40) - 4, 9},
                            {0, 0, -1},
                            i % 9 == 4 ? 8.0f : kInfinity});
        else
            rays.push_back({scenes::to_float({8 * o[0], 8 * o[1], 8 * o[2]}), scenes::to_float(d)});
    }
    rays[3].direction = {}, rays[70].max_t = -1, rays[71].origin.x = kNan;
    for (const QueryOptions& options :
         {QueryOptions{}, QueryOptions{.margin = 0.1f}, QueryOptions{.max_pair_tests = 40}}) {
        std::vector<RayHit> hits(rays.size());
        ASSERT_TRUE(raycast(scene.world, rays, hits, {scene.contexts}, options));
        std::array<uint32_t, 3> of_verdict{};
        for (size_t i = 0; i < rays.size(); ++i) {
            RayHit alone;
            ASSERT_TRUE(raycast(scene.world, {&rays[i], 1}, {&alone, 1}, {scene.contexts}, options));
            const RaycastResult &a = hits[i].result, &b = alone.result;
            ASSERT_EQ(hits[i].body, alone.body) << i;
            ASSERT_EQ(a.verdict, b.verdict) << i;
            EXPECT_EQ(a.t, b.t) << i;
            EXPECT_EQ(a.clear, b.clear) << i;
            EXPECT_EQ(a.node, b.node) << i;
            EXPECT_EQ(a.triangle, b.triangle) << i;
            EXPECT_EQ(a.stats.tests(), b.stats.tests()) << i;
            EXPECT_EQ(a.stats.block_tests, b.stats.block_tests) << i;
            if (a.verdict == Verdict::overlapping) {
                EXPECT_EQ(a.point.z, b.point.z) << i;
                EXPECT_EQ(a.normal.x, b.normal.x) << i;
            }
            ++of_verdict[static_cast<size_t>(a.verdict)];
        }
        EXPECT_GT(of_verdict[0], 50u);
        EXPECT_GT(of_verdict[1], 300u);
        EXPECT_GE(of_verdict[2], 2u);
    }
}

TEST(WorldQueries, ProbesFindAllThatMeetsThem) {
    Random random(9);
    Scene scene(random, 60, 5);
    const auto all = scene.all();
    std::vector<Probe> probes;
    for (uint32_t i = 0; i < 200; ++i) {
        const Pose at = random_pose(random, 5);
        const auto size = static_cast<float>(2 * random.unit());
        const Vec3 other = random_pose(random, 5).translation;
        if (i % 4 == 0) probes.emplace_back(Sphere{at.translation, size});
        if (i % 4 == 1) probes.emplace_back(Capsule{at.translation, other, 0.3f * size});
        if (i % 4 == 2) probes.emplace_back(Box{at, {size, 0.5f * size, 0.2f}});
        if (i % 4 == 3) probes.emplace_back(PlacedTree{tree(i), at});
    }
    probes.emplace_back(Sphere{{0, 0, kNan}, 1}); // meets all
    QueryContext context;
    for (const float margin : {0.0f, 0.3f}) {
        const QueryOptions options{.margin = margin};
        constexpr size_t kMost = 4;
        std::vector<BodyId> few(kMost * probes.size()), many(all.size() * probes.size());
        std::vector<uint32_t> counts(probes.size()), others(probes.size());
        ASSERT_TRUE(overlap(scene.world, probes, many, counts, {scene.contexts}, options));
        ASSERT_TRUE(overlap(scene.world, probes, few, others, {scene.contexts, thread_jobs(3)}, options));
        EXPECT_EQ(counts, others);
        uint32_t found = 0, ground = 0;
        for (size_t i = 0; i < probes.size(); ++i) {
            std::vector<BodyId> expected;
            for (const BodyId id : all) {
                const Body& body = scene.at(id);
                const bool meets = std::visit(
                    [&](const auto& p) {
                        if constexpr (std::is_same_v<decltype(p), const PlacedTree&>) {
                            return verdict_of_two({.shape = p.tree, .pose = p.pose}, body, context, margin) !=
                                   Verdict::separated;
                        } else if (body.tree()) {
                            return overlap(*body.tree(), body.pose, p, context, options).verdict != Verdict::separated;
                        } else { // the lowest point of the shape, by hand
                            double low = 0;
                            if constexpr (std::is_same_v<decltype(p), const Sphere&>) {
                                low = double{p.center.z} - p.radius;
                            } else if constexpr (std::is_same_v<decltype(p), const Capsule&>) {
                                low = std::min(p.a.z, p.b.z) - double{p.radius};
                            } else {
                                const auto rows = scenes::rotation_rows(p.pose.rotation);
                                low = p.pose.translation.z - std::abs(rows[2][0]) * p.half.x -
                                      std::abs(rows[2][1]) * p.half.y - std::abs(rows[2][2]) * p.half.z;
                            }
                            ground += low - margin <= -2;
                            return !(low - margin > -2);
                        }
                    },
                    probes[i]);
                if (meets) expected.push_back(id);
            }
            const auto at = many.begin() + static_cast<std::ptrdiff_t>(i * all.size());
            EXPECT_EQ(std::vector<BodyId>(at, at + counts[i]), expected);
            for (size_t k = 0; k < std::min<size_t>(kMost, expected.size()); ++k)
                EXPECT_EQ(few[kMost * i + k], expected[k]);
            found += counts[i];
        }
        EXPECT_GT(found, 500u);
        EXPECT_GT(ground, 30u);
        EXPECT_EQ(counts.back(), all.size());
    }
}

TEST(WorldQueries, SweptTreesStopAtWhatTheyHitFirst) {
    Random random(10);
    Scene scene(random, 40, 6);
    const auto all = scene.all();
    std::vector<MovingTree> moving;
    for (uint32_t i = 0; i < 80; ++i) {
        Motion m;
        const Point v = random.direction(), w = random.in_ball(), c = random.in_ball();
        m.start = random_pose(random, 9), m.start.translation.z += 6;
        m.linear = scenes::to_float({8 * v[0], 8 * v[1], 8 * v[2]}), m.angular = scenes::to_float(w);
        m.center = scenes::to_float(c);
        moving.push_back({tree(i), m});
    }
    QueryContext context;
    std::vector<SweepHit> hits(moving.size()), others(moving.size());
    ASSERT_TRUE(sweep(scene.world, moving, hits, {scene.contexts}));
    ASSERT_TRUE(sweep(scene.world, moving, others, {scene.contexts, thread_jobs(3)}));
    uint32_t found = 0, missed = 0, ground = 0;
    for (size_t i = 0; i < moving.size(); ++i) {
        double best = kInfinity;
        BodyId body;
        for (const BodyId id : all) {
            Motion rest;
            rest.start = scene.at(id).pose;
            const SweepResult r = scene.at(id).tree()
                                      ? sweep(moving[i].tree, moving[i].motion, *scene.at(id).tree(), rest, context)
                                      : sweep(moving[i].tree, moving[i].motion, kGround, context);
            if (r.time_upper < best) best = r.time_upper, body = id;
        }
        EXPECT_EQ(hits[i].body, body);
        EXPECT_EQ(hits[i].result.time_upper, best);
        EXPECT_EQ(hits[i].result.verdict, body == BodyId{} ? Verdict::separated : Verdict::overlapping);
        EXPECT_EQ(hits[i].result.time_lower, std::min(1.0, best));
        EXPECT_EQ(others[i].body, body);
        found += body != BodyId{}, missed += body == BodyId{};
        ground += body != BodyId{} && !scene.at(body).tree();
    }
    EXPECT_GT(found, 20u);
    EXPECT_GT(missed, 10u);
    EXPECT_GT(ground, 3u);
}

TEST(WorldQueries, RefuseSpansThatAreTooShort) {
    Random random(11);
    Scene scene(random, 20, 2);
    const auto pairs = scene.pairs();
    ASSERT_GT(pairs.size(), 2u);
    std::vector<Verdict> verdicts(pairs.size());
    std::vector<OfPair<PairCache>> caches(1);
    std::vector<PairContacts> records(1);
    const Workers good{scene.contexts}, none{}, too_many{scene.contexts, thread_jobs(4)};
    const auto refused = [](const Result<void>& r) { return !r && r.error().code == ErrorCode::bad_options; };
    EXPECT_TRUE(refused(collide(scene.world, pairs, std::span(verdicts).first(1), good)));
    EXPECT_TRUE(refused(collide(scene.world, pairs, verdicts, none)));
    EXPECT_TRUE(refused(collide(scene.world, pairs, verdicts, too_many)));
    EXPECT_TRUE(refused(collide(scene.world, pairs, verdicts, good, {}, caches)));
    EXPECT_TRUE(refused(contacts(scene.world, pairs, records, good)));
    const Ray rays[2] = {};
    RayHit hit;
    EXPECT_TRUE(refused(raycast(scene.world, rays, {&hit, 1}, good)));
    EXPECT_TRUE(refused(raycast(scene.world, std::span(rays).first(1), {&hit, 1}, none)));
    EXPECT_TRUE(raycast(scene.world, {}, {}, good));
}

} // namespace
} // namespace prolate

// A step of a world of many bodies, few of which move, beside Bullet:  bench_crowd [MESH] [BODIES] [MOVING %]
//
// Bodies of one mesh, of diagonal 1, stand in a grid, each turned at random, so near that neighbours touch here and
// there. In each step some move by half a hundredth. A step is: these moves, pairs, and the contacts of all pairs in
// which a body moved. Bullet does the same by performDiscreteCollisionDetection(), with the others asleep.
//
// Four ways: proxies of 8 ellipsoids beside convex hulls as Bullet makes them (btShapeHull, at most 42 corners), and
// exact trees beside GImpact. What they answer differs, of course: touching pairs are printed with the time.
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/world_queries.hpp>

#include <BulletCollision/CollisionShapes/btShapeHull.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <btBulletCollisionCommon.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <time.h>

namespace prolate {
namespace {

constexpr uint32_t kSteps = 64, kRounds = 4; // there and back again, so that all steps are alike

// Of this thread: whatever else the machine does is not counted.
double cpu_ms() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Crowd {
    std::vector<Pose> start;
    std::vector<uint32_t> moving;
    std::vector<std::vector<Pose>> poses; // of those, at each step

    Crowd(uint32_t count, double share, double spacing) : poses(kSteps) {
        scenes::Random random(7);
        const auto side = static_cast<uint32_t>(std::ceil(std::cbrt(count)));
        for (uint32_t i = 0; i < count; ++i) {
            const auto at = [&](uint32_t k) { return static_cast<float>(spacing * (k + random.in(-0.1, 0.1))); };
            start.push_back({{at(i % side), at(i / side % side), at(i / side / side)}, random.rotation()});
            if (random.in(0, 1) < share) moving.push_back(i);
        }
        for (const uint32_t i : moving) {
            Pose pose = start[i];
            const auto d = random.direction(), spin = random.in_ball();
            for (uint32_t step = 0; step < kSteps; ++step) {
                poses[step].push_back(pose);
                pose.translation.x += static_cast<float>(0.005 * d[0]);
                pose.translation.y += static_cast<float>(0.005 * d[1]);
                pose.translation.z += static_cast<float>(0.005 * d[2]);
                pose.rotation.x += static_cast<float>(0.01 * spin[0]);
                pose.rotation.y += static_cast<float>(0.01 * spin[1]);
            }
        }
    }
};

// Calls step(k) for the steps there and back again. Returns the median time, ms.
template <class Step> double median_ms(Step&& step) {
    std::vector<double> times;
    for (uint32_t round = 0; round < kRounds; ++round)
        for (uint32_t i = 1; i < 2 * kSteps - 1; ++i) {
            const double before = cpu_ms();
            step(i < kSteps ? i : 2 * kSteps - 2 - i);
            times.push_back(cpu_ms() - before);
        }
    std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
    return times[times.size() / 2];
}

struct Outcome {
    double ms;
    size_t pairs, touching; // at the start, of all bodies
};
void print(const char* name, const Outcome& o) {
    std::printf("  %-28s %9.3f ms a step  %7zu pairs, of which %6zu touch\n", name, o.ms, o.pairs, o.touching);
}

Outcome run(const Crowd& crowd, const TreeView& tree) {
    World world = *World::create();
    std::vector<BodyId> ids, moving;
    for (const Pose& pose : crowd.start) ids.push_back(*world.insert({.shape = tree, .pose = pose}));
    for (const uint32_t i : crowd.moving) moving.push_back(ids[i]);
    std::vector<QueryContext> contexts(1);
    std::vector<PairContacts> records;
    std::vector<BodyPair> moved;
    const auto step = [&] {
        const auto pairs = *world.update_pairs();
        moved.clear();
        std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(moved), [](const BodyPair& p) { return p.moved; });
        records.resize(world.slot_count());
        (void)contacts(world, moved, records, {.contexts = contexts});
    };
    step();
    const size_t touching = static_cast<size_t>(
        std::count_if(records.begin(), records.end(), [](const PairContacts& p) { return p.touching; }));
    const size_t pairs = world.pairs().size();
    const double ms = median_ms([&](uint32_t k) {
        (void)world.move(moving, crowd.poses[k]);
        step();
    });
    return {ms, pairs, touching};
}

btTransform to_bullet(const Pose& pose) {
    const Quat& q = pose.rotation;
    const Vec3& t = pose.translation;
    return btTransform(btQuaternion(q.x, q.y, q.z, q.w).normalized(), {t.x, t.y, t.z});
}

Outcome run(const Crowd& crowd, btCollisionShape& shape) {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher);
    btDbvtBroadphase broadphase;
    btCollisionWorld world(&dispatcher, &broadphase, &configuration);
    world.setForceUpdateAllAabbs(false);
    std::vector<std::unique_ptr<btCollisionObject>> objects;
    for (const Pose& pose : crowd.start) {
        objects.push_back(std::make_unique<btCollisionObject>());
        objects.back()->setCollisionShape(&shape);
        objects.back()->setCollisionFlags(0); // neither static nor kinematic
        objects.back()->setWorldTransform(to_bullet(pose));
        world.addCollisionObject(objects.back().get());
    }
    world.performDiscreteCollisionDetection();
    size_t touching = 0;
    for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
        const btPersistentManifold& m = *dispatcher.getManifoldByIndexInternal(i);
        bool meets = false;
        for (int k = 0; k < m.getNumContacts(); ++k) meets = meets || m.getContactPoint(k).getDistance() <= 0;
        touching += meets;
    }
    const auto pairs = static_cast<size_t>(broadphase.getOverlappingPairCache()->getNumOverlappingPairs());
    for (const auto& object : objects) object->forceActivationState(ISLAND_SLEEPING);
    for (const uint32_t i : crowd.moving) objects[i]->forceActivationState(DISABLE_DEACTIVATION);
    const double ms = median_ms([&](uint32_t k) {
        for (size_t i = 0; i < crowd.moving.size(); ++i)
            objects[crowd.moving[i]]->setWorldTransform(to_bullet(crowd.poses[k][i]));
        world.performDiscreteCollisionDetection();
    });
    for (const auto& object : objects) world.removeCollisionObject(object.get());
    return {ms, pairs, touching};
}

// Of diagonal 1, around the origin.
void normalise(Mesh& mesh) {
    Vec3 low = mesh.vertices[0], high = low;
    for (const Vec3& v : mesh.vertices) {
        low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
        high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    const float x = high.x - low.x, y = high.y - low.y, z = high.z - low.z;
    const float scale = 1 / std::sqrt(x * x + y * y + z * z);
    for (Vec3& v : mesh.vertices)
        v = {scale * (v.x - low.x - x / 2), scale * (v.y - low.y - y / 2), scale * (v.z - low.z - z / 2)};
}

Outcome run_hull(const Crowd& crowd, const Mesh& mesh) {
    btConvexHullShape all(&mesh.vertices[0].x, static_cast<int>(mesh.vertices.size()), sizeof(Vec3));
    btShapeHull hull(&all);
    hull.buildHull(0);
    btConvexHullShape shape(&hull.getVertexPointer()->x(), hull.numVertices(), sizeof(btVector3));
    shape.setMargin(0);
    return run(crowd, shape);
}

Outcome run_gimpact(const Crowd& crowd, Mesh mesh) {
    btTriangleIndexVertexArray array(
        static_cast<int>(mesh.triangles.size()), reinterpret_cast<int*>(mesh.triangles.data()), sizeof(Triangle),
        static_cast<int>(mesh.vertices.size()), reinterpret_cast<btScalar*>(mesh.vertices.data()), sizeof(Vec3));
    btGImpactMeshShape shape(&array);
    shape.setMargin(0);
    shape.updateBound();
    return run(crowd, shape);
}

int main(const std::string& file, uint32_t bodies, double percent) {
    Mesh mesh = shapes::torus(0.35f, 0.15f, 24, 12);
    if (!file.empty() && file != "torus") {
        auto read = load_mesh(file.c_str());
        if (!read) return std::fprintf(stderr, "bench_crowd: %s: %s\n", file.c_str(), read.error().what), 1;
        mesh = std::move(*read);
    }
    normalise(mesh);
    const auto proxy = build(mesh.view(), {.ellipsoids = 8}), exact = build(mesh.view(), {.exact = true});
    if (!proxy || !exact) return std::fputs("bench_crowd: the mesh cannot be baked\n", stderr), 1;
    const Crowd crowd(bodies, percent / 100, 0.72);
    std::printf("%u bodies of %zu triangles, %zu moving, one thread (its own CPU time), median of %u steps\n", bodies,
                mesh.triangles.size(), crowd.moving.size(), kRounds * (2 * kSteps - 2));
    const Outcome ours = run(crowd, proxy->tree.view()), hulls = run_hull(crowd, mesh);
    print("proxies of 8 ellipsoids", ours), print("Bullet, convex hulls", hulls);
    const Outcome trees = run(crowd, exact->tree.view()), meshes = run_gimpact(crowd, mesh);
    print("exact trees", trees), print("Bullet, GImpact", meshes);
    std::printf("  time of hulls over proxies: %.2f; of GImpact over exact trees: %.2f\n", hulls.ms / ours.ms,
                meshes.ms / trees.ms);
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    return prolate::main(argc > 1 ? argv[1] : "", argc > 2 ? static_cast<uint32_t>(std::atoi(argv[2])) : 10000,
                         argc > 3 ? std::atof(argv[3]) : 5);
}

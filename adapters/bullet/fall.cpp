// Bodies fall on a plane in Bullet, as prolate trees and as Bullet's own GImpact meshes:  bullet_fall [BODIES] [HERTZ]
//
// Fails if a body of trees does not come to rest, or sinks into the plane by more than 1 % of its diagonal, or if the
// energy rises. Prints for both: contacts, the median time of a step in which something moves, the deepest that a body
// sank.
#include "adapters/bullet/prolate_bullet.hpp"

#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/half_space.hpp>

#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include <time.h>

namespace {

// Of this thread: whatever else the machine does is not counted.
double cpu_ms() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

constexpr btScalar kGravity = 9.81f;
constexpr int kSeconds = 10;

struct Outcome {
    double energy = 0, median_ms = 0, sunk = 0, rest_speed = 0, energy_gain = 0, contacts = 0;
};

// A world with a plane, and bodies of one shape in a loose stack.
class Scene {
public:
    Scene(btCollisionShape& shape, const btVector3& inertia, int bodies, int hertz)
        : hertz_(hertz), dispatcher_(&configuration_) {
        world_.setGravity({0, 0, -kGravity});
        world_.getDispatchInfo().m_useContinuous = false;
        world_.getSolverInfo().m_numIterations = 30;
        plane_.setMargin(0);
        add(plane_, 0, {0, 0, 0}, btTransform::getIdentity());
        const int side = static_cast<int>(std::ceil(std::cbrt(bodies)));
        for (int i = 0; i < bodies; ++i) {
            const auto at = [](int k) { return static_cast<btScalar>(k); };
            const int x = i % side, y = i / side % side, z = i / side / side;
            const btVector3 origin(1.3f * at(x) + 0.05f * at(z), 1.3f * at(y) - 0.03f * at(z), 1 + 1.3f * at(z));
            add(shape, 1, inertia, btTransform(btQuaternion({1, at(1 + x), at(2 + y)}, 0.7f * at(i)), origin));
        }
    }
    btCollisionDispatcher& dispatcher() { return dispatcher_; }
    const std::vector<std::unique_ptr<btRigidBody>>& bodies() const { return bodies_; } // the plane first
    int steps() const { return hertz_ * kSeconds; }
    void step() {
        const btScalar length = btScalar{1} / static_cast<btScalar>(hertz_);
        world_.stepSimulation(length, 0, length);
    }
    int contacts() const {
        int out = 0;
        for (int i = 0; i < dispatcher_.getNumManifolds(); ++i)
            out += dispatcher_.getManifoldByIndexInternal(i)->getNumContacts();
        return out;
    }
    double energy() const {
        double out = 0;
        for (size_t i = 1; i < bodies_.size(); ++i) {
            const btRigidBody& b = *bodies_[i];
            const btVector3 spin = b.getWorldTransform().getBasis().transpose() * b.getAngularVelocity();
            const btVector3 inertia = b.getLocalInertia();
            out += double{kGravity * b.getWorldTransform().getOrigin().z() + 0.5f * b.getLinearVelocity().length2() +
                          0.5f * (spin * spin).dot(inertia)};
        }
        return out;
    }
    double fastest() const {
        double out = 0;
        for (size_t i = 1; i < bodies_.size(); ++i)
            out = std::max(out, double{bodies_[i]->getLinearVelocity().length()});
        return out;
    }

private:
    void add(btCollisionShape& shape, btScalar mass, const btVector3& inertia, const btTransform& at) {
        btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, &shape, inertia);
        info.m_startWorldTransform = at;
        info.m_friction = 0.6f;
        info.m_restitution = 0;
        info.m_rollingFriction = 0.02f;
        info.m_linearDamping = 0.02f, info.m_angularDamping = 0.05f;
        world_.addRigidBody(bodies_.emplace_back(std::make_unique<btRigidBody>(info)).get());
    }

    const int hertz_;
    btDefaultCollisionConfiguration configuration_;
    btCollisionDispatcher dispatcher_;
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;
    btDiscreteDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
    btStaticPlaneShape plane_{{0, 0, 1}, 0};
    std::vector<std::unique_ptr<btRigidBody>> bodies_;

public:
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;
    ~Scene() {
        for (const auto& body : bodies_) world_.removeRigidBody(body.get());
    }
};

// Depth is measured by the library, of the tree at the pose that a body has, whatever its shape is in Bullet.
Outcome run(Scene& scene, const prolate_bullet::TreeShape& frame) {
    Outcome out;
    const auto context = std::make_unique<prolate::QueryContext>();
    std::vector<double> times;
    double contacts = 0, energy = scene.energy();
    out.energy = energy;
    for (int i = 0; i < scene.steps(); ++i) {
        const double start = cpu_ms();
        scene.step();
        const double taken = cpu_ms() - start;
        if (scene.fastest() > 0.05) times.push_back(taken); // until all is at rest
        contacts += scene.contacts();
        const double now = scene.energy();
        out.energy_gain = std::max(out.energy_gain, now - energy);
        energy = std::min(energy, now);
        for (size_t k = 1; k < scene.bodies().size(); ++k) {
            prolate::ContactManifolds manifolds;
            prolate::contacts(frame.tree(), frame.pose_of(scene.bodies()[k]->getWorldTransform()), {{0, 0, 1}, 0},
                              manifolds, *context);
            if (manifolds.count > 0)
                for (uint32_t p = 0; p < manifolds.manifolds[0].count; ++p)
                    out.sunk = std::max(out.sunk, double{manifolds.manifolds[0].points[p].depth});
        }
    }
    std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
    out.median_ms = times[times.size() / 2], out.contacts = contacts / scene.steps(), out.rest_speed = scene.fastest();
    return out;
}

void print(const char* name, const Outcome& o, double diagonal) {
    std::printf(
        "%-8s  %8.3f ms a step (median)  %6.0f contacts  sunk %.2f %% of the diagonal  at rest %.4f m/s  gain %.3g J\n",
        name, o.median_ms, o.contacts, 100 * o.sunk / diagonal, o.rest_speed, o.energy_gain);
}

} // namespace

int main(int argc, char** argv) {
    const int bodies = argc > 1 ? std::atoi(argv[1]) : 100, hertz = argc > 2 ? std::atoi(argv[2]) : 240;
    prolate::Mesh mesh = prolate::shapes::torus(0.35f, 0.15f, 24, 12);
    const auto built = prolate::build(mesh.view(), {.exact = true});
    if (!built) return std::fprintf(stderr, "bullet_fall: %s\n", built.error().what), 1;
    prolate_bullet::TreeShape shape(built->tree.view());
    shape.setMargin(10.0f / static_cast<btScalar>(hertz)); // 10 m/s
    btVector3 inertia;
    shape.calculateLocalInertia(1, inertia);

    Outcome ours, theirs;
    {
        Scene scene(shape, inertia, bodies, hertz);
        const prolate_bullet::Trees trees(scene.dispatcher());
        ours = run(scene, shape);
    }
    // The same mesh, in the same frame of its centre of mass.
    for (prolate::Vec3& v : mesh.vertices) {
        const btVector3 p = shape.body_of({}).inverse() * btVector3(v.x, v.y, v.z);
        v = {p.x(), p.y(), p.z()};
    }
    btTriangleIndexVertexArray array(static_cast<int>(mesh.triangles.size()),
                                     reinterpret_cast<int*>(mesh.triangles.data()), sizeof(prolate::Triangle),
                                     static_cast<int>(mesh.vertices.size()),
                                     reinterpret_cast<btScalar*>(mesh.vertices.data()), sizeof(prolate::Vec3));
    btGImpactMeshShape gimpact(&array);
    gimpact.setMargin(0.01f);
    gimpact.updateBound();
    {
        Scene scene(gimpact, inertia, bodies, hertz);
        btGImpactCollisionAlgorithm::registerAlgorithm(&scene.dispatcher());
        theirs = run(scene, shape);
    }
    std::printf("%d tori of %zu triangles, %d s in steps of 1/%d s\n", bodies, mesh.triangles.size(), kSeconds, hertz);
    print("prolate", ours, built->diagonal), print("GImpact", theirs, built->diagonal);
    std::printf("time of GImpact over prolate: %.2f\n", theirs.median_ms / ours.median_ms);
    const bool good =
        ours.rest_speed < 0.05 && ours.sunk < 0.01 * built->diagonal && ours.energy_gain < 1e-3 * ours.energy;
    if (!good) std::puts("FAILED: trees should come to rest, and sink by less than 1 %");
    return good ? 0 : 1;
}

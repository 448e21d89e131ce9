// Bullet's GImpact: trees of quantised axis-parallel boxes around the triangles. And its compounds of convex hulls,
// into which V-HACD decomposes a mesh: what games use. Neither has a query that stops at the first contact: what is
// timed is the collision algorithm as a simulation runs it, with contacts that are counted and not kept.
#include "bench/peers/library.hpp"

#include <prolate/mesh.hpp>

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>

#include <unistd.h>

namespace prolate::bench::peers {
namespace {

constexpr int kHulls = 32;

btTransform placed(const Pose& pose) {
    const Quat& q = pose.rotation;
    const Vec3& t = pose.translation;
    return btTransform(btQuaternion(q.x, q.y, q.z, q.w).normalized(), btVector3(t.x, t.y, t.z));
}

class BulletShape : public Shape {
public:
    virtual btCollisionShape* shape() const = 0;
};

class GImpactShape final : public BulletShape {
public:
    explicit GImpactShape(const Model& model) : mesh_(model.mesh) {
        array_ = std::make_unique<btTriangleIndexVertexArray>(
            static_cast<int>(mesh_.triangles.size()), reinterpret_cast<int*>(mesh_.triangles.data()),
            static_cast<int>(sizeof(Triangle)), static_cast<int>(mesh_.vertices.size()),
            reinterpret_cast<btScalar*>(mesh_.vertices.data()), static_cast<int>(sizeof(Vec3)));
        shape_ = std::make_unique<btGImpactMeshShape>(array_.get());
        shape_->setMargin(0); // by default surfaces meet when they are 0.04 apart
        shape_->updateBound();
    }
    btCollisionShape* shape() const override { return shape_.get(); }

private:
    static_assert(sizeof(btScalar) == sizeof(float));
    Mesh mesh_; // which the array borrows
    std::unique_ptr<btTriangleIndexVertexArray> array_;
    std::unique_ptr<btGImpactMeshShape> shape_;
};

class HullsShape final : public BulletShape {
public:
    explicit HullsShape(const std::vector<std::vector<btVector3>>& hulls) {
        for (const auto& points : hulls) {
            btConvexHullShape& hull = hulls_.emplace_back();
            for (const btVector3& p : points) hull.addPoint(p, false);
            hull.setMargin(0);
            hull.recalcLocalAabb();
            shape_.addChildShape(btTransform::getIdentity(), &hull);
        }
        shape_.setMargin(0);
    }
    btCollisionShape* shape() const override { return &shape_; }

private:
    std::deque<btConvexHullShape> hulls_; // which do not move
    mutable btCompoundShape shape_;
};

// V-HACD's hulls of a model; empty if it could not be run.
std::vector<std::vector<btVector3>> decompose(const Model& model, const std::string& python) {
    const std::filesystem::path folder = std::filesystem::temp_directory_path();
    const std::string in = folder / fmt::format("prolate-{}-{}.obj", model.name, getpid()), out = in + ".hulls";
    {
        std::ofstream file(in);
        for (const Vec3& v : model.mesh.vertices) file << fmt::format("v {} {} {}\n", v.x, v.y, v.z);
        for (const Triangle& t : model.mesh.triangles)
            file << fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
    const std::string command = fmt::format("'{}' '{}' V-HACD {} 600 '{}' '{}' >/dev/null 2>&1", python,
                                            PROLATE_BENCH_DECOMPOSE, kHulls, in, out);
    std::vector<std::vector<btVector3>> hulls;
    if (std::system(command.c_str()) == 0) {
        std::ifstream file(out);
        for (std::string word; file >> word; std::getline(file, word)) {
            if (word == "o") hulls.emplace_back();
            float x, y, z;
            if (word == "v" && file >> x >> y >> z) hulls.back().emplace_back(x, y, z);
        }
    }
    std::filesystem::remove(in), std::filesystem::remove(out);
    return hulls;
}

class Counter final : public btManifoldResult {
public:
    using btManifoldResult::btManifoldResult;
    void addContactPoint(const btVector3&, const btVector3&, btScalar depth) override { contacts += depth <= 0; }
    int contacts = 0;
};

class BulletScene final : public Scene {
public:
    BulletScene(const BulletShape& a, const BulletShape& b, std::span<const Placement> poses)
        : dispatcher_(&configuration_) {
        btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher_); // compounds' are there from the start
        for (const Placement& p : poses) a_at_.push_back(placed(p.a)), b_at_.push_back(placed(p.b));
        a_.setCollisionShape(a.shape()), b_.setCollisionShape(b.shape());
        const btCollisionObjectWrapper wa(nullptr, a.shape(), &a_, a_.getWorldTransform(), -1, -1);
        const btCollisionObjectWrapper wb(nullptr, b.shape(), &b_, b_.getWorldTransform(), -1, -1);
        algorithm_ = dispatcher_.findAlgorithm(&wa, &wb, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    }
    BulletScene(const BulletScene&) = delete;
    ~BulletScene() override {
        algorithm_->~btCollisionAlgorithm();
        dispatcher_.freeCollisionAlgorithm(algorithm_);
    }
    Contact collide(size_t i) override {
        a_.setWorldTransform(a_at_[i]), b_.setWorldTransform(b_at_[i]);
        const btCollisionObjectWrapper wa(nullptr, a_.getCollisionShape(), &a_, a_.getWorldTransform(), -1, -1);
        const btCollisionObjectWrapper wb(nullptr, b_.getCollisionShape(), &b_, b_.getWorldTransform(), -1, -1);
        Counter counter(&wa, &wb);
        algorithm_->processCollision(&wa, &wb, info_, &counter);
        return counter.contacts > 0 ? Contact::meeting : Contact::separated;
    }

private:
    btDefaultCollisionConfiguration configuration_;
    btCollisionDispatcher dispatcher_;
    btDispatcherInfo info_;
    btCollisionObject a_, b_;
    std::vector<btTransform> a_at_, b_at_;
    btCollisionAlgorithm* algorithm_ = nullptr;
};

std::string compiled() {
    return fmt::format("Bullet {}.{} as Debian compiles it (-O2, SSE2), single precision, margin 0, all contacts",
                       BT_BULLET_VERSION / 100, BT_BULLET_VERSION % 100);
}

class Bullet : public Library {
public:
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<BulletScene>(static_cast<const BulletShape&>(a), static_cast<const BulletShape&>(b),
                                             poses);
    }
};

class GImpact final : public Bullet {
public:
    std::string name() const override { return "bullet-gimpact"; }
    std::string about() const override { return compiled(); }
    std::unique_ptr<Shape> build(const Model& model) const override { return std::make_unique<GImpactShape>(model); }
};

class Hulls final : public Bullet {
public:
    explicit Hulls(std::string python) : python_(std::move(python)) {}
    std::string name() const override { return "bullet-vhacd"; }
    std::string about() const override { return fmt::format("{}, at most {} hulls by V-HACD", compiled(), kHulls); }
    bool answers(Query query) const override { return query == Query::proxy; }
    std::unique_ptr<Shape> build(const Model& model) const override {
        const auto hulls = decompose(model, python_);
        if (hulls.empty()) return nullptr;
        return std::make_unique<HullsShape>(hulls);
    }

private:
    std::string python_;
};

} // namespace

void add_bullet(Libraries& libraries) {
    libraries.push_back(std::make_unique<GImpact>());
}

void add_bullet_hulls(Libraries& libraries, const std::string& python) {
    if (std::filesystem::exists(python)) libraries.push_back(std::make_unique<Hulls>(python));
}

} // namespace prolate::bench::peers

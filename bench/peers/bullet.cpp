// Bullet's GImpact: trees of quantised axis-parallel boxes around the triangles. It has no query that stops at the
// first contact: what is timed is the collision algorithm as a simulation runs it, with contacts that are counted and
// not kept.
#include "bench/peers/library.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>

namespace prolate::bench::peers {
namespace {

btTransform placed(const Pose& pose) {
    const Quat& q = pose.rotation;
    const Vec3& t = pose.translation;
    return btTransform(btQuaternion(q.x, q.y, q.z, q.w).normalized(), btVector3(t.x, t.y, t.z));
}

class BulletShape final : public Shape {
public:
    explicit BulletShape(const Model& model) : mesh_(model.mesh) {
        array_ = std::make_unique<btTriangleIndexVertexArray>(
            static_cast<int>(mesh_.triangles.size()), reinterpret_cast<int*>(mesh_.triangles.data()),
            static_cast<int>(sizeof(Triangle)), static_cast<int>(mesh_.vertices.size()),
            reinterpret_cast<btScalar*>(mesh_.vertices.data()), static_cast<int>(sizeof(Vec3)));
        shape_ = std::make_unique<btGImpactMeshShape>(array_.get());
        shape_->setMargin(0); // by default surfaces meet when they are 0.04 apart
        shape_->updateBound();
    }
    size_t bytes() const override {
        size_t nodes = 0;
        for (int i = 0; i < shape_->getMeshPartCount(); ++i)
            nodes += static_cast<size_t>(shape_->getMeshPart(i)->getBoxSet()->getNodeCount());
        return nodes * sizeof(BT_QUANTIZED_BVH_NODE) + mesh_.vertices.size() * sizeof(Vec3) +
               mesh_.triangles.size() * sizeof(Triangle);
    }
    btGImpactMeshShape* shape() const { return shape_.get(); }

private:
    static_assert(sizeof(btScalar) == sizeof(float));
    Mesh mesh_; // which the array borrows
    std::unique_ptr<btTriangleIndexVertexArray> array_;
    std::unique_ptr<btGImpactMeshShape> shape_;
};

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
        btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher_);
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
        return counter.contacts > 0 ? Contact::meeting : Contact::apart;
    }

private:
    btDefaultCollisionConfiguration configuration_;
    btCollisionDispatcher dispatcher_;
    btDispatcherInfo info_;
    btCollisionObject a_, b_;
    std::vector<btTransform> a_at_, b_at_;
    btCollisionAlgorithm* algorithm_ = nullptr;
};

class Bullet final : public Library {
public:
    std::string name() const override { return "bullet-gimpact"; }
    std::string about() const override {
        return "Bullet " + std::to_string(BT_BULLET_VERSION / 100) + "." + std::to_string(BT_BULLET_VERSION % 100) +
               " as Debian compiles it (-O2, SSE2), single precision, margin 0, all contacts";
    }
    std::unique_ptr<Shape> build(const Model& model) const override { return std::make_unique<BulletShape>(model); }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<BulletScene>(static_cast<const BulletShape&>(a), static_cast<const BulletShape&>(b),
                                             poses);
    }
};

} // namespace

void add_bullet(Libraries& libraries) {
    libraries.push_back(std::make_unique<Bullet>());
}

} // namespace prolate::bench::peers

#include "adapters/bullet/prolate_bullet.hpp"

#include <prolate/bounds.hpp>
#include <prolate/half_space.hpp>
#include <prolate/mass.hpp>
#include <prolate/primitives.hpp>

#include <BulletCollision/CollisionDispatch/btActivatingCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <BulletCollision/CollisionShapes/btShapeHull.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btAabbUtil2.h>

#include <algorithm>
#include <new>
#include <optional>
#include <utility>
#include <vector>

namespace prolate_bullet {
namespace {

using prolate::Pose;
using prolate::Tree;
using prolate::TreeView;
using prolate::Vec3;

Vec3 to_prolate(const btVector3& v) {
    return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
btVector3 to_bullet(const Vec3& v) {
    return {v.x, v.y, v.z};
}
Pose to_prolate(const btTransform& t) {
    const btQuaternion q = t.getRotation();
    return {
        to_prolate(t.getOrigin()),
        {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())}};
}
btTransform to_bullet(const Pose& pose) {
    const prolate::Quat& q = pose.rotation;
    return btTransform(btQuaternion(q.x, q.y, q.z, q.w).normalized(), to_bullet(pose.translation));
}

// What stands in for one of Bullet's convex shapes: an exact box, ball or capsule, else a polyhedron of its corners, or
// of 42 points of its surface. Empty if it has no volume.
std::optional<Tree> tree_of(const btCollisionShape& shape) {
    const auto take = [](auto made) { return made ? std::optional<Tree>(std::move(*made)) : std::nullopt; };
    if (shape.getShapeType() == BOX_SHAPE_PROXYTYPE)
        return take(prolate::box_tree(to_prolate(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin())));
    if (shape.getShapeType() == SPHERE_SHAPE_PROXYTYPE)
        return take(
            prolate::capsule_tree({}, {}, static_cast<float>(static_cast<const btSphereShape&>(shape).getRadius())));
    if (shape.getShapeType() == CAPSULE_SHAPE_PROXYTYPE) {
        const auto& capsule = static_cast<const btCapsuleShape&>(shape);
        btVector3 end(0, 0, 0);
        end[capsule.getUpAxis()] = capsule.getHalfHeight();
        return take(prolate::capsule_tree(to_prolate(-end), to_prolate(end), static_cast<float>(capsule.getRadius())));
    }
    if (!shape.isConvex()) return {};
    btShapeHull hull(static_cast<const btConvexShape*>(&shape));
    if (!hull.buildHull(shape.getMargin())) return {};
    std::vector<Vec3> points;
    for (int i = 0; i < hull.numVertices(); ++i) points.push_back(to_prolate(hull.getVertexPointer()[i]));
    std::vector<prolate::Triangle> triangles;
    const unsigned int* const index = hull.getIndexPointer();
    for (int i = 0; i < hull.numTriangles(); ++i)
        triangles.push_back({index[3 * i], index[3 * i + 1], index[3 * i + 2]});
    auto made = prolate::convex_tree(points, triangles);
    if (made) return take(std::move(made));
    for (prolate::Triangle& t : triangles) std::swap(t[1], t[2]);
    return take(prolate::convex_tree(points, triangles));
}

// What the algorithm keeps of a pair; on the heap, because Bullet's pool has small places.
struct PairState {
    prolate::ContactManifolds manifolds;
    std::optional<Tree> other; // for a convex shape of Bullet's
    btPersistentManifold* bullet[prolate::kManifolds] = {};
};

class TreeAlgorithm final : public btActivatingCollisionAlgorithm {
public:
    TreeAlgorithm(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* a,
                  const btCollisionObjectWrapper* b, prolate::QueryContext& context)
        : btActivatingCollisionAlgorithm(info, a, b), context_(context), state_(std::make_unique<PairState>()) {
        for (const btCollisionObjectWrapper* body : {a, b})
            if (const int type = body->getCollisionShape()->getShapeType();
                type != CUSTOM_CONCAVE_SHAPE_TYPE && type != STATIC_PLANE_PROXYTYPE)
                state_->other = tree_of(*body->getCollisionShape());
    }
    TreeAlgorithm(const TreeAlgorithm&) = delete;
    TreeAlgorithm& operator=(const TreeAlgorithm&) = delete;
    ~TreeAlgorithm() override {
        for (btPersistentManifold* const m : state_->bullet)
            if (m != nullptr) m_dispatcher->releaseManifold(m);
    }

    void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                          const btDispatcherInfo& info, btManifoldResult*) override {
        const bool plane_a = is_plane(a), plane_b = is_plane(b);
        prolate::QueryOptions options;
        options.margin = static_cast<float>(margin(*a, *b, info.m_timeStep));
        prolate::ContactManifolds& found = state_->manifolds;
        take_impulses();
        if (plane_a || plane_b) {
            const btCollisionObjectWrapper *const body = plane_a ? b : a, *const plane = plane_a ? a : b;
            const auto placed = place(body);
            if (!placed) return;
            prolate::contacts(placed->tree, placed->pose, half_space(*plane), found, context_, options);
        } else {
            const auto first = place(a), second = place(b);
            if (!first || !second) return;
            prolate::contacts(first->tree, first->pose, second->tree, second->pose, found, context_, options);
        }
        give_contacts(a, b, plane_a);
    }
    btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                   btManifoldResult*) override {
        return 1;
    }
    void getAllContactManifolds(btManifoldArray& out) override {
        for (btPersistentManifold* const m : state_->bullet)
            if (m != nullptr) out.push_back(m);
    }

private:
    struct Placed {
        TreeView tree;
        Pose pose;
    };

    // As far as the bodies may come in a step, within what their shapes allow. At rest, a fifth of what Bullet keeps is
    // enough: every pair of triangles within the margin is looked at.
    static btScalar margin(const btCollisionObjectWrapper& a, const btCollisionObjectWrapper& b, btScalar time) {
        btVector3 velocity(0, 0, 0);
        btScalar turning = 0, most = 0;
        for (const btCollisionObjectWrapper* body : {&a, &b}) {
            const btCollisionShape& shape = *body->getCollisionShape();
            if (shape.getShapeType() == CUSTOM_CONCAVE_SHAPE_TYPE) most += shape.getMargin();
            const btRigidBody* const rigid = btRigidBody::upcast(body->getCollisionObject());
            if (rigid == nullptr || is_plane(body)) continue;
            velocity = rigid->getLinearVelocity() - velocity;
            btVector3 middle;
            btScalar radius;
            shape.getBoundingSphere(middle, radius);
            turning += rigid->getAngularVelocity().length() * (middle.length() + radius);
        }
        return 0.2f * gContactBreakingThreshold + btMin(time * (velocity.length() + turning), most);
    }
    static bool is_plane(const btCollisionObjectWrapper* body) {
        return body->getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE;
    }
    static prolate::HalfSpace half_space(const btCollisionObjectWrapper& body) {
        const auto* const plane = static_cast<const btStaticPlaneShape*>(body.getCollisionShape());
        const btTransform& t = body.getWorldTransform();
        const btVector3 normal = t.getBasis() * plane->getPlaneNormal();
        return {to_prolate(normal), static_cast<float>(plane->getPlaneConstant() + normal.dot(t.getOrigin()))};
    }
    std::optional<Placed> place(const btCollisionObjectWrapper* body) const {
        if (body->getCollisionShape()->getShapeType() == CUSTOM_CONCAVE_SHAPE_TYPE) {
            const auto* const shape = static_cast<const TreeShape*>(body->getCollisionShape());
            return Placed{shape->tree(), shape->pose_of(body->getWorldTransform())};
        }
        if (!state_->other) return {};
        return Placed{state_->other->view(), to_prolate(body->getWorldTransform())};
    }
    // What the solver found goes to our points, which hand it on to those that stay (contacts.hpp, ids).
    void take_impulses() {
        for (uint32_t i = 0; i < state_->manifolds.count; ++i)
            for (int k = 0; state_->bullet[i] != nullptr && k < state_->bullet[i]->getNumContacts(); ++k)
                state_->manifolds.manifolds[i].points[k].impulse[0] =
                    static_cast<float>(state_->bullet[i]->getContactPoint(k).m_appliedImpulse);
    }
    void give_contacts(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, bool plane_a) {
        for (uint32_t i = 0; i < prolate::kManifolds; ++i) {
            btPersistentManifold*& to = state_->bullet[i];
            const prolate::Manifold& from = state_->manifolds.manifolds[i];
            const uint32_t count = i < state_->manifolds.count ? from.count : 0;
            if (to == nullptr && count == 0) continue;
            if (to == nullptr) to = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
            to->clearManifold();
            for (uint32_t k = 0; k < count; ++k)
                to->addManifoldPoint(point_of(from.points[k], to_bullet(from.normal), *to, plane_a));
        }
    }
    // Bullet's normals point from its body B to its body A; ours from a to b, and from a body to a plane.
    static btManifoldPoint point_of(const prolate::ContactPoint& p, const btVector3& normal,
                                    const btPersistentManifold& manifold, bool plane_a) {
        const btCollisionObject *const a = manifold.getBody0(), *const b = manifold.getBody1();
        const btVector3 on_a = to_bullet(plane_a ? p.point_b : p.point_a),
                        on_b = to_bullet(plane_a ? p.point_a : p.point_b);
        btManifoldPoint out(a->getWorldTransform().invXform(on_a), b->getWorldTransform().invXform(on_b),
                            plane_a ? normal : -normal, -p.depth);
        out.m_positionWorldOnA = on_a, out.m_positionWorldOnB = on_b;
        out.m_combinedFriction = btManifoldResult::calculateCombinedFriction(a, b);
        out.m_combinedRestitution = btManifoldResult::calculateCombinedRestitution(a, b);
        out.m_combinedRollingFriction = btManifoldResult::calculateCombinedRollingFriction(a, b);
        out.m_appliedImpulse = p.impulse[0];
        return out;
    }

    prolate::QueryContext& context_;
    const std::unique_ptr<PairState> state_;
};

} // namespace

TreeShape::TreeShape(const TreeView& tree) : tree_(tree), tree_in_body_(btTransform::getIdentity()) {
    m_shapeType = CUSTOM_CONCAVE_SHAPE_TYPE;
    const prolate::MassProperties mass = tree.bake_info().mass;
    const prolate::PrincipalInertia principal = prolate::principal_inertia(mass);
    if (mass.volume > 0) tree_in_body_ = to_bullet(principal.frame).inverse();
    const prolate::Bounds box = prolate::bounds(tree, pose_of(btTransform::getIdentity()));
    low_ = to_bullet(box.lower), high_ = to_bullet(box.upper);
    if (mass.volume > 0) {
        for (int i = 0; i < 3; ++i)
            inertia_[i] = static_cast<btScalar>(principal.moments[static_cast<size_t>(i)] / mass.volume);
        return;
    }
    const btVector3 size = high_ - low_;
    const btVector3 squares = size * size / 12;
    inertia_ = {squares.y() + squares.z(), squares.x() + squares.z(), squares.x() + squares.y()};
}

Pose TreeShape::pose_of(const btTransform& body) const {
    return to_prolate(body * tree_in_body_);
}
btTransform TreeShape::body_of(const Pose& pose) const {
    return to_bullet(pose) * tree_in_body_.inverse();
}

// The box around the turned box: a little larger than prolate::bounds(), and much cheaper.
void TreeShape::getAabb(const btTransform& t, btVector3& low, btVector3& high) const {
    btTransformAabb(low_, high_, margin_, t, low, high);
}

void TreeShape::calculateLocalInertia(btScalar mass, btVector3& inertia) const {
    inertia = mass * inertia_;
}

void TreeShape::setLocalScaling(const btVector3& scaling) {
    btAssert(scaling == btVector3(1, 1, 1));
    scaling_ = scaling;
}

btCollisionAlgorithm* Trees::CreateFunc::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                  const btCollisionObjectWrapper* a,
                                                                  const btCollisionObjectWrapper* b) {
    void* const place = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(TreeAlgorithm));
    return new (place) TreeAlgorithm(info, a, b, *context);
}

Trees::Trees(btCollisionDispatcher& dispatcher) : context_(std::make_unique<prolate::QueryContext>()) {
    create_.context = context_.get();
    for (int type = 0; type < MAX_BROADPHASE_COLLISION_TYPES; ++type) {
        const bool served = type < CONCAVE_SHAPES_START_HERE || type == STATIC_PLANE_PROXYTYPE ||
                            type == CUSTOM_CONCAVE_SHAPE_TYPE; // convex shapes, planes, trees
        if (!served) continue;
        dispatcher.registerCollisionCreateFunc(CUSTOM_CONCAVE_SHAPE_TYPE, type, &create_);
        dispatcher.registerCollisionCreateFunc(type, CUSTOM_CONCAVE_SHAPE_TYPE, &create_);
    }
}

} // namespace prolate_bullet

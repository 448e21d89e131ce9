// prolate in Bullet: trees as collision shapes, against each other and against Bullet's own shapes.
//
//     prolate_bullet::Trees trees(dispatcher);                      // once, before the world is used
//     prolate_bullet::TreeShape shape(tree.view());                 // for any number of bodies
//     btVector3 inertia;
//     shape.calculateLocalInertia(mass, inertia);
//     btRigidBody body({mass, &motion_state, &shape, inertia});
//     ... shape.body_of(pose) and shape.pose_of(transform) convert
//
// A body's origin is the solid's centre of mass and its axes are the principal ones, as Bullet's solver wants it; of a
// tree that does not know its mass, the tree's own frame. One thread: Bullet's multithreaded dispatcher is not served.
#pragma once

#include <prolate/contacts.hpp>
#include <prolate/tree.hpp>

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include <memory>

namespace prolate_bullet {

/// A tree as a shape. The tree's bytes must outlive it.
class TreeShape final : public btCollisionShape {
public:
    explicit TreeShape(const prolate::TreeView& tree);

    const prolate::TreeView& tree() const { return tree_; }
    /// Where the tree is if the body is at `body`, and the other way round.
    prolate::Pose pose_of(const btTransform& body) const;
    btTransform body_of(const prolate::Pose& pose) const;

    void getAabb(const btTransform& t, btVector3& low, btVector3& high) const override;
    /// From BakeInfo::mass; of a tree that does not know it, that of its box.
    void calculateLocalInertia(btScalar mass, btVector3& inertia) const override;
    /// A tree cannot be scaled: bake it at the size that it has.
    void setLocalScaling(const btVector3& scaling) override;
    const btVector3& getLocalScaling() const override { return scaling_; }
    /// Contacts are made at most this far ahead, metres, if the bodies are fast enough to meet in the step, so that
    /// they do not sink in: let it be the way of a fast body in a step. It does not round the shape.
    void setMargin(btScalar margin) override { margin_ = margin; }
    btScalar getMargin() const override { return margin_; }
    const char* getName() const override { return "ProlateTree"; }

private:
    prolate::TreeView tree_;
    btTransform tree_in_body_;
    btVector3 low_, high_; // of the body's box in its own frame
    btVector3 inertia_;    // of a body of mass 1
    btVector3 scaling_{1, 1, 1};
    btScalar margin_ = 0;
};

/// Tells a dispatcher how trees collide. Must outlive its use.
class Trees {
public:
    explicit Trees(btCollisionDispatcher& dispatcher);

private:
    struct CreateFunc final : btCollisionAlgorithmCreateFunc {
        btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                       const btCollisionObjectWrapper* a,
                                                       const btCollisionObjectWrapper* b) override;
        prolate::QueryContext* context = nullptr;
    };
    std::unique_ptr<prolate::QueryContext> context_;
    CreateFunc create_;
};

} // namespace prolate_bullet

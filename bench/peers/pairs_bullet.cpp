// Bullet on two ellipsoids: the detector of its simulations (GJK, and EPA once they overlap), and btGjkEpaSolver2.
// It has no ellipsoid; this one gives exact points of support and has no margin.
#include "bench/peers/pairs.hpp"

#include <BulletCollision/CollisionShapes/btConvexInternalShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpa2.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <deque>

namespace prolate::bench::peers {
namespace {

class BulletEllipsoid final : public btConvexInternalShape {
public:
    explicit BulletEllipsoid(const btVector3& radii) : radii_(radii) {
        m_shapeType = CUSTOM_CONVEX_SHAPE_TYPE;
        m_collisionMargin = 0;
    }
    btVector3 localGetSupportingVertexWithoutMargin(const btVector3& direction) const override {
        const btVector3 scaled = radii_ * direction;
        const btScalar length = scaled.length();
        return length > 0 ? radii_ * scaled / length : btVector3(0, 0, 0);
    }
    btVector3 localGetSupportingVertex(const btVector3& direction) const override {
        return localGetSupportingVertexWithoutMargin(direction);
    }
    void batchedUnitVectorGetSupportingVertexWithoutMargin(const btVector3* directions, btVector3* points,
                                                           int count) const override {
        for (int i = 0; i < count; ++i) points[i] = localGetSupportingVertexWithoutMargin(directions[i]);
    }
    void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setZero(); }
    const char* getName() const override { return "ellipsoid"; }

private:
    btVector3 radii_;
};

struct Body {
    BulletEllipsoid shape;
    btTransform at;
    Body(const std::array<float, 3>& r, const Pose& pose)
        : shape(btVector3(r[0], r[1], r[2])),
          at(btQuaternion(pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w).normalized(),
             btVector3(pose.translation.x, pose.translation.y, pose.translation.z)) {}
};

class BulletPairs : public PairScene {
public:
    explicit BulletPairs(std::span<const EllipsoidPair> pairs) {
        for (const EllipsoidPair& p : pairs) a_.emplace_back(p.radii_a, p.a), b_.emplace_back(p.radii_b, p.b);
    }
    void meet(std::span<uint8_t> out) override {
        for (size_t i = 0; i < out.size(); ++i) out[i] = gap(i) <= 0;
    }
    void distance(std::span<double> out) override {
        for (size_t i = 0; i < out.size(); ++i) out[i] = static_cast<double>(gap(i));
    }

protected:
    virtual btScalar gap(size_t i) = 0; // 0 or below if they meet
    std::deque<Body> a_, b_;            // which do not move
};

class DetectorPairs final : public BulletPairs {
    using BulletPairs::BulletPairs;
    btScalar gap(size_t i) override {
        btGjkPairDetector detector(&a_[i].shape, &b_[i].shape, &simplex_, &depth_);
        btGjkPairDetector::ClosestPointInput input;
        input.m_transformA = a_[i].at, input.m_transformB = b_[i].at;
        btPointCollector result;
        detector.getClosestPoints(input, result, nullptr);
        return result.m_hasResult ? result.m_distance : BT_LARGE_FLOAT;
    }
    btVoronoiSimplexSolver simplex_;
    btGjkEpaPenetrationDepthSolver depth_;
};

class EpaPairs final : public BulletPairs {
    using BulletPairs::BulletPairs;
    btScalar gap(size_t i) override {
        btGjkEpaSolver2::sResults result;
        const btVector3 guess = b_[i].at.getOrigin() - a_[i].at.getOrigin();
        const bool apart = btGjkEpaSolver2::Distance(&a_[i].shape, a_[i].at, &b_[i].shape, b_[i].at, guess, result);
        return apart ? result.distance : 0;
    }
};

template <class Pairs> class BulletPairLibrary final : public PairLibrary {
public:
    explicit BulletPairLibrary(const char* name) : name_(name) {}
    std::string name() const override { return name_; }
    std::string about() const override { return "Bullet as Debian compiles it, single precision"; }
    bool has_distance() const override { return true; }
    std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const override {
        return std::make_unique<Pairs>(pairs);
    }

private:
    const char* name_;
};

} // namespace

void add_bullet(PairLibraries& libraries) {
    libraries.push_back(std::make_unique<BulletPairLibrary<DetectorPairs>>("bullet-detector"));
    libraries.push_back(std::make_unique<BulletPairLibrary<EpaPairs>>("bullet-gjkepa2"));
}

} // namespace prolate::bench::peers

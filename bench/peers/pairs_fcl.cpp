// FCL on two ellipsoids: its public calls, which end in its copy of libccd's algorithms.
#include "bench/peers/pairs.hpp"

#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <deque>

namespace prolate::bench::peers {
namespace {

using Transform = fcl::Transform3<double>;

struct Body {
    fcl::Ellipsoid<double> shape;
    Transform at;
    Body(const std::array<float, 3>& r, const Pose& pose) : shape(r[0], r[1], r[2]), at(Transform::Identity()) {
        const Quat& q = pose.rotation;
        at.linear() = fcl::Quaternion<double>(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
        at.translation() = fcl::Vector3<double>(pose.translation.x, pose.translation.y, pose.translation.z);
    }
};

class FclPairs final : public PairScene {
public:
    explicit FclPairs(std::span<const EllipsoidPair> pairs) {
        for (const EllipsoidPair& p : pairs) a_.emplace_back(p.radii_a, p.a), b_.emplace_back(p.radii_b, p.b);
        distance_request_.enable_nearest_points = true;
    }
    void meet(std::span<uint8_t> out) override {
        for (size_t i = 0; i < out.size(); ++i) {
            fcl::CollisionResult<double> result;
            out[i] = fcl::collide(&a_[i].shape, a_[i].at, &b_[i].shape, b_[i].at, request_, result) > 0;
        }
    }
    void distance(std::span<double> out) override {
        for (size_t i = 0; i < out.size(); ++i) {
            fcl::DistanceResult<double> result;
            out[i] = fcl::distance(&a_[i].shape, a_[i].at, &b_[i].shape, b_[i].at, distance_request_, result);
        }
    }

private:
    std::deque<Body> a_, b_; // which do not move
    fcl::CollisionRequest<double> request_;
    fcl::DistanceRequest<double> distance_request_;
};

class FclPairLibrary final : public PairLibrary {
public:
    std::string name() const override { return "fcl"; }
    std::string about() const override { return "FCL " FCL_VERSION " as Debian compiles it, double precision"; }
    bool has_distance() const override { return true; }
    std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const override {
        return std::make_unique<FclPairs>(pairs);
    }
};

} // namespace

void add_fcl(PairLibraries& libraries) {
    libraries.push_back(std::make_unique<FclPairLibrary>());
}

} // namespace prolate::bench::peers

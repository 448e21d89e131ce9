// Coal on two ellipsoids: its public calls, GJK with the default tolerance of 1e-6.
#include "bench/peers/pairs.hpp"

#include <coal/collision.h>
#include <coal/distance.h>
#include <coal/shape/geometric_shapes.h>

#include <deque>

namespace prolate::bench::peers {
namespace {

struct Body {
    coal::Ellipsoid shape;
    coal::Transform3s at;
    Body(const std::array<float, 3>& r, const Pose& pose)
        : shape(r[0], r[1], r[2]),
          at(coal::Quatf(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z).normalized(),
             coal::Vec3s(pose.translation.x, pose.translation.y, pose.translation.z)) {}
};

class CoalPairs final : public PairScene {
public:
    explicit CoalPairs(std::span<const EllipsoidPair> pairs) {
        for (const EllipsoidPair& p : pairs) a_.emplace_back(p.radii_a, p.a), b_.emplace_back(p.radii_b, p.b);
    }
    void meet(std::span<uint8_t> out) override {
        for (size_t i = 0; i < out.size(); ++i) {
            coal::CollisionResult result;
            out[i] = coal::collide(&a_[i].shape, a_[i].at, &b_[i].shape, b_[i].at, request_, result) > 0;
        }
    }
    void distance(std::span<double> out) override {
        for (size_t i = 0; i < out.size(); ++i) {
            coal::DistanceResult result;
            out[i] = coal::distance(&a_[i].shape, a_[i].at, &b_[i].shape, b_[i].at, distance_request_, result);
        }
    }

private:
    std::deque<Body> a_, b_; // which do not move
    coal::CollisionRequest request_{coal::NO_REQUEST, 1};
    coal::DistanceRequest distance_request_{true, false};
};

class CoalPairLibrary final : public PairLibrary {
public:
    std::string name() const override { return "coal"; }
    std::string about() const override { return "Coal " COAL_VERSION " of PyPI, double precision"; }
    bool has_distance() const override { return true; }
    std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const override {
        return std::make_unique<CoalPairs>(pairs);
    }
};

} // namespace

// What main.cpp looks for in the module.
extern "C" void add_coal_pairs(PairLibraries& libraries) {
    libraries.push_back(std::make_unique<CoalPairLibrary>());
}

} // namespace prolate::bench::peers

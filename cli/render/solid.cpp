#include "cli/render/solid.hpp"
#include "cli/render/scene.hpp"

#include "builder/hausdorff.hpp"
#include "builder/winding.hpp"

#include <cmath>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kTolerance = 1e-3; // of closeness().max, in diagonals: what quality "fast" has

Vec to_vec(const dvec3& p) {
    return {p.x, p.y, p.z};
}

} // namespace

Solid::Solid(MeshView mesh, bool closed) : winding_(std::make_unique<Winding>(mesh)), closed_(closed) {
    cli::Box box;
    box.add(mesh);
    low_ = box.low;
    high_ = box.high;
}

Solid::~Solid() = default;

bool Solid::holds(const dvec3& p) const {
    if (glm::any(glm::lessThan(p, low_)) || glm::any(glm::greaterThan(p, high_))) return false;
    return std::abs((*winding_)(to_vec(p))) >= 0.5;
}

double Solid::distance(const dvec3& p) const {
    return winding_->tree().distance(to_vec(p));
}

Solid::Closeness Solid::closeness(std::span<const Ellipsoid> ellipsoids) const {
    const HausdorffDistance found = hausdorff_distance(ellipsoids, *winding_, closed_, kTolerance * diagonal());
    return {found.max + found.max_error, found.mean, found.p99};
}

} // namespace prolate::cli

// Cost: one search of the tracer's tree a ray, O(log n).
#include "cli/render/scene_mesh.hpp"

#include <algorithm>
#include <limits>

namespace prolate::cli {
namespace {

using glm::dvec3;

// Rays start this far from where they must not hit again, in a scene of radius 1.
constexpr double kNear = 1e-5;

Reach clear(const Reach& reach) {
    return {std::max(kNear, reach.from), reach.to};
}
dvec3 to_double(const Vec3& v) {
    return {v.x, v.y, v.z};
}

} // namespace

MeshScene::MeshScene(MeshView mesh, const Frame& frame, const Solid* solid) : frame_(frame), solid_(solid) {
    vertices_.reserve(mesh.vertices.size());
    for (const Vec3& p : mesh.vertices) {
        const glm::vec3 shown(frame(p));
        vertices_.push_back({shown.x, shown.y, shown.z});
    }
    tracer_ = make_tracer(vertices_, mesh.triangles);
}

Hit MeshScene::first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    return tracer_->first_hit(origin, direction, clear(reach));
}

bool MeshScene::blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    return tracer_->blocked(origin, direction, clear(reach));
}

Place MeshScene::place_of(const dvec3& p) const {
    if (!solid_) return {};
    const dvec3 model = p / frame_.scale + frame_.center;
    return {solid_->holds(model) ? kMeshId : kNothing, solid_->distance(model) * frame_.scale};
}

Window MeshScene::window(const Camera& camera) const {
    Window window;
    for (const Vec3& p : vertices_) {
        const dvec3 d = to_double(p) - camera.eye;
        const double depth = glm::dot(d, camera.forward);
        const double u = glm::dot(d, camera.right) / depth, v = glm::dot(d, camera.up) / depth;
        window.add({u, u, v, v});
    }
    return window;
}

double MeshScene::extent(const dvec3& direction) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const Vec3& p : vertices_) most = std::max(most, glm::dot(direction, to_double(p)));
    return most;
}

} // namespace prolate::cli

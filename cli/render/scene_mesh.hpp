// The triangles of a mesh, as a picture shows them.
#pragma once

#include "cli/render/scene.hpp"
#include "cli/render/solid.hpp"
#include "cli/render/tracer.hpp"

#include <memory>
#include <vector>

namespace prolate::cli {

class MeshScene final : public Scene {
public:
    /// All triangles, with flat normals. Indices must be in range and coordinates finite (clean() sees to it). `solid`,
    /// which must live as long as the scene, tells what they enclose; without it place_of() finds nothing.
    MeshScene(MeshView mesh, const Frame& frame, const Solid* solid = nullptr);

    Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    Place place_of(const glm::dvec3& p) const override;
    Window window(const Camera& camera) const override;
    double extent(const glm::dvec3& direction) const override;

private:
    std::vector<Vec3> vertices_; // in the frame
    Frame frame_;
    const Solid* solid_;
    std::unique_ptr<Tracer> tracer_;
};

} // namespace prolate::cli

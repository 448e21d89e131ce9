// The triangles of a mesh, traced by Embree.
#pragma once

#include "cli/render/scene.hpp"
#include "cli/render/solid.hpp"

#include <memory>
#include <vector>

#include <embree3/rtcore.h>

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
    struct Release {
        void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
        void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    };
    std::vector<glm::vec3> vertices_;
    Frame frame_;
    const Solid* solid_;
    std::unique_ptr<RTCDeviceTy, Release> device_; // destroyed after the scene
    std::unique_ptr<RTCSceneTy, Release> scene_;
};

} // namespace prolate::cli

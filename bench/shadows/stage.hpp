// Where a model stands when its shadow is looked at: the ground below it, a lamp, a camera.
#pragma once

#include "bench/shadows/shadow.hpp"
#include "cli/render/camera.hpp"

namespace prolate::bench {

/// A model's own size and place decide, so that all covers of it are seen alike.
class Stage {
public:
    Stage(MeshView mesh, const cli::View& view);

    /// The lamp, `turn` degrees around the vertical from where the pictures have it: 45 degrees high, 5 radii away, its
    /// sides half a radius long.
    Lamp lamp(double turn) const;
    /// The camera of the pictures; its eye is not where it stands for them.
    const cli::Camera& camera() const { return camera_; }
    /// That place: the nearest from where the model and the rectangle `shown` of `ground` are in the picture, whose
    /// borders are seen at these slopes to the right and upwards.
    glm::dvec3 eye(const Ground& ground, const Extent& shown, const glm::dvec2& slopes) const;
    glm::dvec3 center() const { return center_; }
    /// Of a ball around the mesh.
    double radius() const { return radius_; }
    glm::dvec3 up() const { return up_; }
    /// The ground plane is all points whose product with up() is this: the mesh stands on it.
    double ground_height() const { return height_; }
    /// The ground as seen from above by a viewer who faces as the camera does, cut into pixels of `pitch`; no window
    /// yet.
    Ground ground(double pitch) const;
    /// The same, with a window that holds `extent` and a border.
    static Ground window(const Ground& ground, const Extent& extent, int border);

private:
    glm::dvec3 up_, low_, high_, center_; // low and high: of the mesh's box
    double radius_ = 0, height_ = 0;
    cli::Camera camera_;
};

} // namespace prolate::bench

// One cut of a tree that deforms, at some coordinates: of each node the bound as it has moved and grown
// (include/prolate/deformation.hpp), and if there is a radius around it, an ellipsoid that just holds that.
#pragma once

#include "cli/render/scene_cut.hpp"

#include <span>
#include <vector>

namespace prolate::cli {

/// What holds node `node` at the coordinates `q`, as many as the tree's deformation has modes.
Ellipsoid moved_ellipsoid(const TreeView& tree, uint32_t node, std::span<const float> q);

class MovedScene final : public Scene {
public:
    /// The cut of `tree` at `level`, at the coordinates `q`. The frame must be one of a box that holds it.
    MovedScene(const TreeView& tree, uint32_t level, std::span<const float> q, const Frame& frame);

    Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    /// Of several, the one that holds the point deepest, as CutScene has it.
    Place place_of(const glm::dvec3& p) const override;
    Window window(const Camera& camera) const override;
    double extent(const glm::dvec3& direction) const override;

private:
    struct Body {
        uint32_t node;
        FramedEllipsoid ellipsoid;
        double radius; // of a ball around it
    };
    std::vector<Body> bodies_;
};

} // namespace prolate::cli

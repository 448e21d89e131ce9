// The ellipsoids of one cut of a tree, traced by the runtime's own ray query.
#pragma once

#include "cli/render/scene.hpp"

#include <span>
#include <vector>

namespace prolate::cli {

class CutScene final : public Scene {
public:
    /// The cut of `tree` at `level`. `growth` is what node_growth() found; it must live as long as the scene, and so
    /// must the tree's bytes. The frame must be one of a box that holds the cut.
    CutScene(const TreeView& tree, uint32_t level, std::span<const float> growth, const Frame& frame);

    /// Ellipsoids of the cut.
    size_t size() const { return cut_.size(); }

    Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const override;
    /// Of several, the one that holds the point deepest, by its radial coordinate: on a section plane two of them then
    /// meet along a curve through the points where their outlines cross.
    Place place_of(const glm::dvec3& p) const override;
    Window window(const Camera& camera) const override;
    double extent(const glm::dvec3& direction) const override;

private:
    /// An ellipsoid {center + L u, |u| <= 1}, where L is lower-triangular, and so is its inverse M.
    struct Body {
        explicit Body(const Ellipsoid& e, const Frame& frame);
        glm::dvec3 center;
        double l11, l21, l22, l31, l32, l33;
        double m11, m21, m22, m31, m32, m33;
        /// transpose(L) n
        glm::dvec3 transposed(const glm::dvec3& n) const {
            return {l11 * n.x + l21 * n.y + l31 * n.z, l22 * n.y + l32 * n.z, l33 * n.z};
        }
        /// Square of the radial coordinate: 1 on the surface.
        double radial_squared(const glm::dvec3& p) const {
            const glm::dvec3 d = p - center;
            const double x = m11 * d.x, y = m21 * d.x + m22 * d.y, z = m31 * d.x + m32 * d.y + m33 * d.z;
            return x * x + y * y + z * z;
        }
    };
    bool is_in_cut(uint32_t node) const { return node >= tree_.first_slot(level_) || tree_.is_leaf(node); }

    TreeView tree_;
    uint32_t level_;
    std::span<const float> growth_;
    Frame frame_;
    std::vector<Body> bodies_;  // by slot; of empty slots anything
    std::vector<uint32_t> cut_; // nodes
};

} // namespace prolate::cli

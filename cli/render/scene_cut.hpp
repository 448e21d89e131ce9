// The ellipsoids of one cut of a tree, traced by the runtime's own ray query.
#pragma once

#include "cli/render/scene.hpp"

#include <span>
#include <vector>

namespace prolate::cli {

/// In a frame, an ellipsoid {center + L u, |u| <= 1}, where L is lower-triangular, and so is its inverse M.
struct FramedEllipsoid {
    FramedEllipsoid(const Ellipsoid& e, const Frame& frame);
    glm::dvec3 center;
    double l11, l21, l22, l31, l32, l33;
    double m11, m21, m22, m31, m32, m33;
    /// transpose(L) n
    glm::dvec3 transposed(const glm::dvec3& n) const {
        return {l11 * n.x + l21 * n.y + l31 * n.z, l22 * n.y + l32 * n.z, l33 * n.z};
    }
    /// M v, and transpose(M) v
    glm::dvec3 inverse(const glm::dvec3& v) const {
        return {m11 * v.x, m21 * v.x + m22 * v.y, m31 * v.x + m32 * v.y + m33 * v.z};
    }
    glm::dvec3 inverse_transposed(const glm::dvec3& v) const {
        return {m11 * v.x + m21 * v.y + m31 * v.z, m22 * v.y + m32 * v.z, m33 * v.z};
    }
    /// Square of the radial coordinate: 1 on the surface.
    double radial_squared(const glm::dvec3& p) const {
        const glm::dvec3 y = inverse(p - center);
        return glm::dot(y, y);
    }
    /// Exact bounds of its image (Scene::window()), added to `window`.
    void add_to(Window& window, const Camera& camera) const;
    /// Largest value of dot(n, p) in it.
    double extent(const glm::dvec3& n) const { return glm::dot(n, center) + glm::length(transposed(n)); }
};

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
    bool is_in_cut(uint32_t node) const { return node >= tree_.first_slot(level_) || tree_.is_leaf(node); }

    TreeView tree_;
    uint32_t level_;
    std::span<const float> growth_;
    Frame frame_;
    std::vector<FramedEllipsoid> bodies_; // by slot; of empty slots anything
    std::vector<uint32_t> cut_;           // nodes
};

} // namespace prolate::cli

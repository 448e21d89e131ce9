// Shadows on a ground plane, by projection from points of light.
#pragma once

#include <prolate/mesh.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/glm.hpp>

namespace prolate::bench {

/// A window of the ground, cut into square pixels. Pixel (x, y) has its center at corner + (x + 1/2) right +
/// (y + 1/2) down.
struct Ground {
    glm::dvec3 up;          ///< unit vector
    glm::dvec3 right, down; ///< perpendicular to `up` and to each other, as long as a pixel
    glm::dvec3 corner;
    int columns = 0, rows = 0;
};

/// A square area light: its center, and two vectors along its sides, as long as these.
struct Lamp {
    glm::dvec3 center, side, other_side;
    /// The middle of part (i, j) of n x n equal squares.
    glm::dvec3 point(int i, int j, int n) const;
};

/// For each pixel, row by row, whether the straight line from its center to a point of light is blocked.
using Mask = std::vector<uint8_t>;

/// Adds the shadow of the triangles to `mask`. They lie above the ground and below the light. O(triangles + pixels).
void cast_shadow(MeshView mesh, const glm::dvec3& light, const Ground& ground, Mask& mask);

/// The same for the union of ellipsoids, which lie below the light. What of them is below the ground casts nothing.
void cast_shadow(std::span<const Ellipsoid> cover, const glm::dvec3& light, const Ground& ground, Mask& mask);

/// A rectangle of the ground, in pixels from its corner.
struct Extent {
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
    void add(const Extent& e);
};
/// That holds the shadow.
Extent shadow_extent(MeshView mesh, const glm::dvec3& light, const Ground& ground);
Extent shadow_extent(std::span<const Ellipsoid> cover, const glm::dvec3& light, const Ground& ground);

/// Part of the lamp that is hidden from each pixel, 0 ... 1, from n x n points of it; and the mask of its center alone.
/// n is odd.
struct Shadow {
    std::vector<float> darkness;
    Mask from_center;
};
template <class Caster> Shadow shadow_of(const Caster& caster, const Lamp& lamp, const Ground& ground, int n) {
    Shadow out;
    out.darkness.resize(static_cast<size_t>(ground.columns) * ground.rows);
    Mask mask;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            mask.assign(out.darkness.size(), 0);
            cast_shadow(caster, lamp.point(i, j, n), ground, mask);
            for (size_t k = 0; k < mask.size(); ++k) out.darkness[k] += mask[k];
            if (2 * i + 1 == n && 2 * j + 1 == n) out.from_center = mask;
        }
    for (float& d : out.darkness) d /= static_cast<float>(n * n);
    return out;
}

/// How alike two shadows are.
struct Likeness {
    double iou = 0;        ///< intersection over union of the masks from the lamp's center
    double difference = 0; ///< mean of |difference of darkness| over the ground where either is not 0
};
Likeness likeness(const Shadow& a, const Shadow& b);

} // namespace prolate::bench

// Bodies, points and ellipsoids in the frame of one body, in double precision. What their rounding costs is worked out
// in separation.hpp, whose S the `reach` of each adds up to.
#pragma once

#include <prolate/types.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace prolate::query {

inline glm::dvec3 to_double(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 to_float(const glm::dvec3& v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

/// Rotation of a quaternion of any length but 0.
glm::dmat3 rotation_matrix(const Quat& q) noexcept;

/// Body B as seen from body A's frame: x_a = rotation x_b + translation. All NaN if a pose is not finite or a
/// quaternion zero, so that nothing separates.
struct RelativePose {
    glm::dmat3 rotation;
    glm::dvec3 translation;
    double distance; // |t2 - t1|
};
RelativePose relative_pose(const Pose& a, const Pose& b) noexcept;
/// As seen from the world's frame: relative_pose(Pose{}, pose), sooner.
RelativePose world_pose(const Pose& pose) noexcept;
/// Body A as seen from body B's frame. The translation is rounded three times more, by 3 u |d| in all.
RelativePose inverse(const RelativePose& pose) noexcept;

/// An ellipsoid placed in A's frame.
struct PlacedEllipsoid {
    glm::dvec3 center;
    glm::dmat3 factor; // L
    double size;       // |L|
    double reach;      // |L| and all lengths that went into center: this body's share of S
};
PlacedEllipsoid place(const Ellipsoid& e) noexcept;                             // of body A
PlacedEllipsoid place(const Ellipsoid& e, const RelativePose& b_to_a) noexcept; // of body B
/// The same, of a tree of this scale, a float: the products are exact.
PlacedEllipsoid place(const Ellipsoid& e, double scale) noexcept;
PlacedEllipsoid place(const Ellipsoid& e, double scale, const RelativePose& b_to_a) noexcept;
/// The greatest n.x of its points x.
double support(const PlacedEllipsoid& e, const glm::dvec3& n) noexcept;

/// A point in the tree's frame.
struct PlacedPoint {
    glm::dvec3 position;
    double reach; // all lengths that went into it: its share of S
};
PlacedPoint place(const glm::dvec3& p, const RelativePose& to_frame) noexcept;
inline PlacedPoint place(const Vec3& p, const RelativePose& to_frame) noexcept {
    return place(to_double(p), to_frame);
}

} // namespace prolate::query

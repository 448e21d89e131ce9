// What a picture shows, ready for ray tracing: the triangles of a mesh (scene_mesh.hpp) or the ellipsoids of one cut of
// a tree (scene_cut.hpp).
//
// Coordinates are moved and scaled by a Frame so that everything shown fits a unit ball around the origin. Tolerances
// then do not depend on the unit of length, and single precision is used where it is best.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <limits>

#include <glm/glm.hpp>

namespace prolate::cli {

/// shown = (model - center) * scale; the center's coordinates are floats.
struct Frame {
    glm::dvec3 center{0.0};
    double scale = 1;
    glm::dvec3 operator()(const Vec3& p) const { return (glm::dvec3(p.x, p.y, p.z) - center) * scale; }
};

/// Axis-aligned box, model coordinates.
struct Box {
    glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};
    void add(const glm::dvec3& a, const glm::dvec3& b);
    void add(MeshView mesh);
    void add(const Ellipsoid& e);
    /// The frame that maps this box into the unit ball. The box must hold something of finite, positive size.
    Frame frame() const;
};

/// A pinhole camera. A ray is forward + u * right + v * up from the eye; (u, v) are slopes, the coordinates in which
/// images are measured.
struct Camera {
    glm::dvec3 eye, right, up, forward;
    glm::dvec3 direction(double u, double v) const { return forward + u * right + v * up; }
};

/// Rectangle in slopes.
struct Window {
    double u0 = std::numeric_limits<double>::infinity(), u1 = -u0, v0 = u0, v1 = -u0;
    void add(const Window& other);
};

/// The part of a ray that counts, in lengths of its direction.
struct Reach {
    double from = 0, to = std::numeric_limits<double>::infinity();
    bool empty() const { return !(from < to); }
};

/// What a section keeps: where dot(normal, p) <= offset. The normal is a unit vector.
struct HalfSpace {
    glm::dvec3 normal{0.0};
    double offset = 0;
    /// The part of a ray in it.
    Reach clip(const glm::dvec3& origin, const glm::dvec3& direction) const;
};

inline constexpr uint32_t kNothing = UINT32_MAX;
inline constexpr uint32_t kMeshId = UINT32_MAX - 1;
inline constexpr uint32_t kInnerId = UINT32_MAX - 2;

/// Where a ray first meets the scene.
struct Hit {
    double distance = std::numeric_limits<double>::infinity(); ///< in lengths of the ray's direction
    uint32_t id = kNothing;                                    ///< the ellipsoid's node, or kMeshId, or kInnerId
    bool in_section = false;                                   ///< within a body, where a section plane cuts it
    glm::dvec3 normal{0.0};                                    ///< unit, towards where the ray came from
    /// Equal for hits between which no outline is drawn.
    uint64_t part() const { return uint64_t{id} * 2 + in_section; }
};

/// What a point is in.
struct Place {
    uint32_t id = kNothing; ///< of a body that holds it
    double clear = 0;       ///< the same holds for all points nearer to it than that
};

/// Immutable once made; every function is thread-safe.
class Scene {
public:
    virtual ~Scene() = default;

    virtual Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const = 0;
    virtual bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const = 0;

    /// Which body holds the point?
    virtual Place place_of(const glm::dvec3& p) const = 0;

    /// Exact bounds of the image as `camera` sees it. The eye must be outside of every ellipsoid's tangent planes
    /// that contain right or up; an eye twice the unit ball's radius away is.
    virtual Window window(const Camera& camera) const = 0;
    /// Largest value of dot(direction, p) over the scene.
    virtual double extent(const glm::dvec3& direction) const = 0;
};

} // namespace prolate::cli

// What a picture shows: the triangles of a mesh or the ellipsoids of one cut, ready for ray tracing with Embree.
//
// Coordinates are moved and scaled by a Frame so that everything shown fits a unit ball around the origin. Tolerances
// then do not depend on the unit of length, and Embree's single precision is used where it is best.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <embree3/rtcore.h>
#include <glm/glm.hpp>

namespace prolate::cli {

/// shown = (model - center) * scale
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

inline constexpr uint32_t kNothing = ~0u;

/// Where a ray first meets the scene.
struct Hit {
    double distance = std::numeric_limits<double>::infinity(); ///< in lengths of the ray's direction
    uint32_t id = kNothing;                                    ///< index of the ellipsoid in the cut; 0 for a mesh
    glm::dvec3 normal{0.0};                                    ///< unit, towards where the ray came from
};

/// Immutable once made; tracing is thread-safe.
class Scene {
public:
    /// All triangles, with flat normals. Indices must be in range and coordinates finite (clean() sees to it).
    Scene(MeshView mesh, const Frame& frame);
    /// The ellipsoids of `nodes`, in that order.
    Scene(const TreeView& tree, const std::vector<uint32_t>& nodes, const Frame& frame);

    Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction) const;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& direction) const;

    /// Exact bounds of the image as `camera` sees it. The eye must be outside of every ellipsoid's tangent planes
    /// that contain right or up; an eye twice the unit ball's radius away is.
    Window window(const Camera& camera) const;
    /// Largest value of dot(direction, p) over the scene.
    double extent(const glm::dvec3& direction) const;

    /// An ellipsoid {c + L u}; L is lower-triangular, and so is its inverse.
    struct Body {
        glm::dvec3 center;
        double l11, l21, l22, l31, l32, l33;
        double m11, m21, m22, m31, m32, m33;
        /// transpose(L) n
        glm::dvec3 transposed(const glm::dvec3& n) const {
            return {l11 * n.x + l21 * n.y + l31 * n.z, l22 * n.y + l32 * n.z, l33 * n.z};
        }
        /// L^-1 p
        glm::dvec3 whiten(const glm::dvec3& p) const {
            return {m11 * p.x, m21 * p.x + m22 * p.y, m31 * p.x + m32 * p.y + m33 * p.z};
        }
        /// transpose(L^-1) y
        glm::dvec3 normal(const glm::dvec3& y) const {
            return {m11 * y.x + m21 * y.y + m31 * y.z, m22 * y.y + m32 * y.z, m33 * y.z};
        }
    };

private:
    struct Release {
        void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
        void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    };
    void open_device();
    void commit(RTCGeometry geometry);

    std::vector<glm::vec3> vertices_;
    std::vector<Triangle> triangles_;
    std::vector<Body> bodies_;
    std::unique_ptr<RTCDeviceTy, Release> device_; // destroyed after the scene
    std::unique_ptr<RTCSceneTy, Release> scene_;
};

} // namespace prolate::cli

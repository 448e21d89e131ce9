// The solid that a mesh bounds, as pictures ask for it: what lies in it, and how far from it is a point, or a cover?
// The builder's definitions, so that pictures agree with the figures in the files.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/types.hpp>

#include <memory>
#include <span>

#include <glm/glm.hpp>

namespace prolate {
class Winding;
}

namespace prolate::cli {

/// Model coordinates. Immutable once made; thread-safe.
class Solid {
public:
    /// `mesh` must be clean; `closed` is what clean() found. The triangles are copied.
    Solid(MeshView mesh, bool closed);
    ~Solid();
    Solid(const Solid&) = delete;
    Solid& operator=(const Solid&) = delete;

    /// Is the point inside: the winding number of a closed mesh is not 0, of an open one nearer to 1 or -1 than to 0?
    bool holds(const glm::dvec3& p) const;
    /// Distance to the triangles.
    double distance(const glm::dvec3& p) const;
    /// The same; 0 if holds(p).
    double outside_distance(const glm::dvec3& p) const { return holds(p) ? 0 : distance(p); }

    /// How far a union of ellipsoids sticks out, as LevelFigures have it.
    struct Closeness {
        double max = 0, mean = 0, p99 = 0;
    };
    Closeness closeness(std::span<const Ellipsoid> ellipsoids) const;

    /// For the builder's other measures.
    const Winding& winding() const { return *winding_; }
    /// Of the mesh's bounding box.
    double diagonal() const { return glm::length(high_ - low_); }

private:
    std::unique_ptr<const Winding> winding_;
    glm::dvec3 low_, high_;
    bool closed_;
};

} // namespace prolate::cli

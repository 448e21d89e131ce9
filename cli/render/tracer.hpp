// Rays against triangles, for pictures: by Embree, or by the runtime where Embree is too large a library to ship
// (PROLATE_EMBREE, tracer_embree.cpp and tracer_runtime.cpp).
#pragma once

#include "cli/render/scene.hpp"

#include <prolate/types.hpp>

#include <memory>
#include <span>

namespace prolate::cli {

/// Immutable once made; every function is thread-safe.
class Tracer {
public:
    virtual ~Tracer() = default;
    /// The first triangle that the part `reach` of the ray meets, from either side.
    virtual Hit first_hit(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const = 0;
    virtual bool blocked(const glm::dvec3& origin, const glm::dvec3& direction, const Reach& reach) const = 0;
};

/// Of triangles within the unit ball; indices must be in range and coordinates finite. Throws std::bad_alloc.
std::unique_ptr<Tracer> make_tracer(std::span<const Vec3> vertices, std::span<const Triangle> triangles);

} // namespace prolate::cli

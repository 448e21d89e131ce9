// The unit sphere as a mesh, for formats that have no ellipsoids.
#pragma once

#include <prolate/types.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace prolate::cli {

/// Where the triangles of a mesh are that stands for an ellipsoid.
enum class Facets : uint8_t {
    inscribed, ///< corners on the ellipsoid: the mesh lies in it, and looks like it
    outer,     ///< no triangle enters it: the mesh, as read in single precision, holds it
};

/// Triangles are counter-clockwise seen from outside.
struct SphereMesh {
    std::vector<std::array<double, 3>> vertices;
    std::vector<std::array<uint32_t, 3>> triangles;
};

/// A refined octahedron whose edges follow the three coordinate circles, `segments` to each: at least 4, rounded up to
/// n = a multiple of 4. It has n^2 / 4 + 2 vertices and n^2 / 2 triangles.
/// As outer facets, each vertex lies so far outside, along its radius, that no point of a triangle is nearer to the
/// center than 1.
SphereMesh sphere_mesh(uint32_t segments, Facets facets = Facets::inscribed);

/// By how much an ellipsoid must grow about its center so that the mesh, mapped to it, still holds it after each
/// coordinate has moved by up to 2^-`bits` of the largest one: 1 or a little more.
double growth_for_rounding(const Ellipsoid& e, const SphereMesh& sphere, int bits);

} // namespace prolate::cli

// The unit sphere as a mesh, for formats that have no ellipsoids.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace prolate::cli {

/// Triangles are counter-clockwise seen from outside.
struct SphereMesh {
    std::vector<std::array<double, 3>> vertices;
    std::vector<std::array<uint32_t, 3>> triangles;
};

/// A refined octahedron whose edges follow the three coordinate circles, `segments` to each: at least 4, rounded up to
/// n = a multiple of 4. It has n^2 / 4 + 2 vertices and n^2 / 2 triangles.
SphereMesh sphere_mesh(uint32_t segments);

} // namespace prolate::cli

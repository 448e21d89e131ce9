// ply and obj: each ellipsoid as a mesh of its own.
#include "cli/export/formats.hpp"
#include "cli/export/little_endian.hpp"
#include "cli/export/sphere.hpp"
#include "cli/render/palette.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <vector>

namespace prolate::cli {
namespace {

constexpr int kFloatBits = 24;

// The corners of an ellipsoid's mesh.
std::vector<std::array<float, 3>> corners(const Ellipsoid& e, const SphereMesh& sphere, Facets facets) {
    const double growth = facets == Facets::outer ? growth_for_rounding(e, sphere, kFloatBits) : 1;
    std::vector<std::array<float, 3>> out;
    out.reserve(sphere.vertices.size());
    for (const auto& vertex : sphere.vertices) {
        const double u[] = {growth * vertex[0], growth * vertex[1], growth * vertex[2]};
        out.push_back({static_cast<float>(e.center.x + e.l11 * u[0]),
                       static_cast<float>(e.center.y + e.l21 * u[0] + e.l22 * u[1]),
                       static_cast<float>(e.center.z + e.l31 * u[0] + e.l32 * u[1] + e.l33 * u[2])});
    }
    return out;
}

} // namespace

std::string as_ply(std::span<const Piece> pieces, uint32_t segments, Facets facets) {
    const SphereMesh sphere = sphere_mesh(segments, facets);
    std::string out = fmt::format("ply\nformat binary_little_endian 1.0\ncomment prolate export\n"
                                  "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
                                  "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                  "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                                  pieces.size() * sphere.vertices.size(), pieces.size() * sphere.triangles.size());
    for (const Piece& piece : pieces)
        for (const auto& corner : corners(piece.shape, sphere, facets)) {
            for (const float x : corner) append_little_endian(out, x);
            for (int i = 0; i < 3; ++i) out += static_cast<char>(std::lround(255 * srgb_encode(piece.colour[i])));
        }
    for (size_t i = 0; i < pieces.size(); ++i)
        for (const auto& triangle : sphere.triangles) {
            out += char{3};
            for (const uint32_t corner : triangle)
                append_little_endian(out, static_cast<uint32_t>(i * sphere.vertices.size()) + corner);
        }
    return out;
}

std::string as_obj(std::span<const Piece> pieces, uint32_t segments, Facets facets) {
    const SphereMesh sphere = sphere_mesh(segments, facets);
    const bool named = facets == Facets::inscribed;
    std::string out = "# prolate export\n";
    const auto to = std::back_inserter(out);
    size_t first = 1; // obj counts from 1
    for (const Piece& piece : pieces) {
        fmt::format_to(to, "{} node_{}\n", named ? "o" : "#", piece.node);
        const auto& colour = piece.colour;
        const std::string shade = !named ? std::string()
                                         : fmt::format(" {:.3f} {:.3f} {:.3f}", srgb_encode(colour.x),
                                                       srgb_encode(colour.y), srgb_encode(colour.z));
        for (const auto& [x, y, z] : corners(piece.shape, sphere, facets))
            fmt::format_to(to, "v {} {} {}{}\n", x, y, z, shade);
        if (named) out += "s 1\n"; // smooth
        for (const auto& [a, b, c] : sphere.triangles)
            fmt::format_to(to, "f {} {} {}\n", first + a, first + b, first + c);
        first += sphere.vertices.size();
    }
    return out;
}

} // namespace prolate::cli

// The formats of "prolate export", each a function from what is selected to the whole content of a file. csv and json
// hold the nodes in full precision; ply, obj, glb and pov hold shapes.
//
// What covers: a tree's ellipsoids, as decoded, and what holds these. Centers and factors are floats, of which shortest
// digits are exact; all else is rounded so that it holds the decoded ellipsoid.
#pragma once

#include "cli/export/sphere.hpp"
#include "cli/render/camera.hpp"

#include <prolate/tree.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <glm/glm.hpp>

namespace prolate::cli {

/// The nodes to export with the level to give for each.
struct Selection {
    std::vector<uint32_t> nodes, levels;
};

/// An ellipsoid made of the radii and the rotation in double precision holds the decoded one.
std::string as_csv(const TreeView& tree, const Selection& selection);
/// The same, and the factor, which is exact.
std::string as_json(const TreeView& tree, const Selection& selection);

/// One ellipsoid of a picture.
struct Piece {
    uint32_t node = 0; ///< its slot, for a name
    Ellipsoid shape;
    glm::dvec3 colour{}; ///< linear sRGB, as node_colours() has it
};

/// The pieces of the cut at `level`.
std::vector<Piece> pieces_of(const TreeView& tree, uint32_t level);

inline constexpr uint32_t kMaxSegments = 256;

/// Meshes of the ellipsoids, one after the other, with a colour for each corner: `segments` along each principal
/// section, 4 ... kMaxSegments, rounded up to a multiple of 4. Coordinates are floats exactly.
std::string as_ply(std::span<const Piece> pieces, uint32_t segments, Facets facets);
/// The same meshes. Inscribed, each is an object named after its node, and colours follow the coordinates, as many
/// readers know it. As outer facets, which are for collision, they are one object without colours: simulators drop
/// triangles of others.
std::string as_obj(std::span<const Piece> pieces, uint32_t segments, Facets facets);

/// Binary glTF 2.0: the sphere's corners once, a material for each colour, and a node for each ellipsoid that moves,
/// turns and stretches the sphere. As outer facets it holds the ellipsoid also where a reader places it in single
/// precision.
std::string as_glb(std::span<const Piece> pieces, uint32_t segments, Facets facets);

/// A POV-Ray scene: each ellipsoid a unit sphere with a matrix, all of them the union "Cover"; and, unless the scene
/// that includes this one has declared "Only_Cover", a camera, lights and the ground that the cover stands on.
std::string as_pov(std::span<const Piece> pieces, const View& view);

} // namespace prolate::cli

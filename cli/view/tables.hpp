// What `prolate view` puts into its page about a tree and its mesh: figures of single nodes, and where space lies
// against the solid. Display only: nothing here is certified, and no query depends on it.
#pragma once

#include "cli/render/solid.hpp"

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <glm/glm.hpp>

namespace prolate::cli {

/// Signed distance from the solid (of an open mesh: from where the generalized winding number puts it) on a lattice
/// that holds every ellipsoid below the root. Negative inside. Exact at the lattice's nodes up to rounding; in between
/// it is to be interpolated linearly.
struct DistanceLattice {
    glm::dvec3 origin{0.0}; ///< of node (0, 0, 0)
    double pitch = 0;
    std::array<uint32_t, 3> size{};
    std::vector<float> distance; ///< [(k * size[1] + j) * size[0] + i], as textures are laid out
};

/// One value a node, in order of slots; cubic units of the mesh.
struct NodeFigures {
    std::vector<double> outside_volume; ///< of the node's ellipsoid, outside the solid
    /// The solid's volume is shared out among a node's children, each point to the child whose ellipsoid holds it
    /// deepest (least radial coordinate): an estimate on the lattice of what of the solid the node stands for. The file
    /// does not hold the partition that the bake used.
    std::vector<double> sub_volume;
};

/// `solid` is that of the mesh. About `nodes` lattice nodes. In parallel. `progress`, called with the fraction done,
/// may return false to stop; then there is no answer.
std::optional<DistanceLattice> distance_lattice(const TreeView& tree, const CleanMesh& mesh, const Solid& solid,
                                                uint32_t nodes, const std::function<bool(double)>& progress);

NodeFigures node_figures(const TreeView& tree, const CleanMesh& mesh, const Solid& solid,
                         const DistanceLattice& lattice);

} // namespace prolate::cli

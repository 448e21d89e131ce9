// How the mesh of a tree that deforms moves.
#pragma once

#include "cli/bake/modes_file.hpp"
#include "cli/failure.hpp"

#include <prolate/mesh.hpp>
#include <prolate/modes.hpp>
#include <prolate/tree.hpp>

#include <string>
#include <vector>

namespace prolate::cli {

/// The modes of a file, in the ranges that the tree has, and what verify_modes() makes of them. `as_read` is the mesh
/// that the tree was baked from, before it was cleaned. Fails where the tree has no deformation, or another number of
/// modes.
struct ProvedModes {
    ModesFile file;
    ModesProof proof;
};
Outcome<ProvedModes> prove_modes(const TreeView& tree, const Mesh& as_read, const std::string& modes_path);

/// For each of `vertices`, which lie where some of `as_read` lie that triangles use, the number of one of these.
std::vector<uint32_t> sources_of(const Mesh& as_read, const std::vector<Vec3>& vertices);

/// Displacements, M by V by 3, of other vertices: those of the sources.
std::vector<float> displacements_at(const std::vector<uint32_t>& sources, const Modes& modes);

/// What a unit of each mode adds to each vertex of an exact tree that deforms: M by V by 3, metres.
std::vector<float> displacements_of(const TreeView& exact_tree);

/// The same of `vertices`, those of the mesh that the tree was baked from, cleaned; after verify_modes() has proved
/// that the tree holds them. `as_read` is the mesh before it was cleaned. Fails where the tree has no deformation, or
/// that of other modes.
Outcome<std::vector<float>> displacements_of(const TreeView& tree, const Mesh& as_read,
                                             const std::vector<Vec3>& vertices, const std::string& modes_path);

} // namespace prolate::cli

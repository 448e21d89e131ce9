// What the commands read: files, meshes, trees, each also from standard input.
#pragma once

#include "cli/failure.hpp"

#include <prolate/mesh.hpp>
#include <prolate/rig.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <string>

namespace prolate::cli {

/// True for "-" and "/dev/stdin".
bool is_standard_input(const std::string& path);

/// The first `most` bytes of a file, or of standard input. Fails with io, also for a folder.
Result<std::string> read_file(const std::string& path, size_t most = SIZE_MAX);

/// Reads a mesh or a tree, also from standard input, which can be only one of the inputs. What is to be known of the
/// import is noted.
Outcome<Mesh> read_mesh(const std::string& path, const ImportOptions& options = {});
/// Reads a glTF file with its skins and morph targets; what there is to note, read_mesh() has noted.
Outcome<RiggedMesh> read_rigged_mesh(const std::string& path, const ImportOptions& options = {});
Outcome<Tree> read_tree(const std::string& path);

} // namespace prolate::cli

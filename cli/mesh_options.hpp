// How a command takes its mesh from the file: the options for it, and what it says of the mesh.
#pragma once

#include "cli/failure.hpp"

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace prolate::cli {

/// What the command line, or a manifest's entry, says.
struct MeshOptions {
    std::string unit;
    std::vector<double> scale; ///< none, one for all axes, or three
    bool recentre = false;
    std::optional<float> weld;
};

/// Declares --unit, --scale and --recentre. Of a command that reads a tree beside the mesh, `tree` is true: then the
/// tree says what these do not.
void declare_mesh_options(CLI::App& app, MeshOptions& options, bool tree = false);

/// The options as the library takes them, or those of the tree's `placement`, if they say nothing.
Outcome<ImportOptions> import_options(const MeshOptions& options, const std::optional<Placement>& placement = {});

/// The mesh beside a tree.
struct MeshOfTree {
    Mesh as_read;
    CleanMesh cleaned;
    bool own; ///< it is the one that the tree was baked from
};

/// Reads the mesh as it was read when the tree was baked, unless `options` say otherwise.
Outcome<MeshOfTree> read_mesh_of(const TreeView& tree, const std::string& path, const MeshOptions& options);

struct TreeKind {
    bool exact = false;
    bool filled = false; ///< it covers the filled solid, which is closed
};
/// What the user should know of the mesh that a tree is of, a line each on stderr.
void describe_mesh(const std::string& path, const MeshReport& report, TreeKind tree);

/// "1 x 2 x 0.5 m"
std::string size_text(const MeshReport& report);

} // namespace prolate::cli

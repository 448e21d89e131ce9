// Covers that experiments share: baked once, kept in a folder.
#pragma once

#include "bench/covers/measure.hpp"

#include <prolate/build.hpp>

#include <optional>
#include <string>

namespace prolate::bench {

/// The file that cover_of() keeps: "FOLDER/horse-ellipsoid-voxel-32-normal.etree".
std::string cover_file(const std::string& folder, const std::string& model, const BuildOptions& options);

/// The tree of `model` with `options`, whose leaves are the cover. It is read from its file if that was baked from this
/// mesh with these options by this version of the builder; else it is baked and written there. Prints the reason if it
/// cannot.
std::optional<Tree> cover_of(const Model& model, const BuildOptions& options, const std::string& folder);

/// Ellipsoids of the finest cut.
std::vector<Ellipsoid> leaves_of(const TreeView& tree);

} // namespace prolate::bench

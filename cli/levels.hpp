// The levels of a tree as people and programs want to see them: the same figures for bake and info.
#pragma once

#include <prolate/tree.hpp>

#include <nlohmann/json.hpp>

#include <span>
#include <string>

namespace prolate::cli {

/// Nodes of the cut at `level`.
uint32_t cut_size(const TreeView& tree, uint32_t level);

/// What the file spends on a node, empty lanes of its blocks included.
double bytes_per_node(const TreeView& tree);

/// One row a level, two lines of heading, at most 100 columns. `seconds` by level, if known.
std::string level_table(const TreeView& tree, std::span<const double> seconds = {});

/// What the columns of level_table() mean, for --help.
extern const char* const kLevelTableHelp;

/// The figures of one level's cut. Lengths as in the file, and in percent of the diagonal; null where unknown.
nlohmann::ordered_json level_json(const TreeView& tree, uint32_t level);

/// The inner cover in one line, or as JSON; "" or null if there is none.
std::string inner_text(const TreeView& tree);
nlohmann::ordered_json inner_json(const TreeView& tree);

/// How modes and bones move the body, a line each; "" if nothing does.
std::string motion_text(const TreeView& tree);

/// All that the header says, and the inner cover.
nlohmann::ordered_json header_json(const TreeView& tree);

/// Indented, with a line's end, and first of all who wrote it. A file name that is no UTF-8 is no reason to fail.
std::string text_of(const nlohmann::ordered_json& json);

/// The names that the command line has for them.
const char* name_of(Method method);
const char* name_of(Primitive primitive);
const char* name_of(Quality quality);

} // namespace prolate::cli

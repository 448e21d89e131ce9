#include "cli/export/formats.hpp"
#include "cli/render/palette.hpp"

namespace prolate::cli {

std::vector<Piece> pieces_of(const TreeView& tree, uint32_t level) {
    const std::vector<Oklch> colours = node_colours(tree);
    std::vector<Piece> pieces;
    tree.for_each_in_cut(level, [&](uint32_t node) {
        pieces.push_back({node, tree.ellipsoid(node), to_linear_rgb(colours[node])});
    });
    return pieces;
}

} // namespace prolate::cli

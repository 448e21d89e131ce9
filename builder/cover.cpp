#include "builder/cover.hpp"

#include <algorithm>

namespace prolate {

std::optional<format::PackedNode> covering_node(const Fit& fit, const Voxels& voxels, std::span<const uint32_t> cells,
                                                const format::Lattice& lattice) {
    constexpr int kRounds = 64;
    double scale = 1;
    for (int round = 0; round < kRounds; ++round) {
        const Mat l = fit.factor * scale;
        const double factor[6] = {l(0, 0), l(1, 0), l(1, 1), l(2, 0), l(2, 1), l(2, 2)};
        format::PackedNode node;
        format::quantise(node, lattice, fit.center.data(), factor);
        const Fit decoded(format::decode(node, lattice));
        double reach = 0;
        for (const uint32_t cell : cells) reach = std::max(reach, decoded.reach(voxels.points(cell)));
        if (reach <= 1 - kSlack) return node;
        // Rounding may undo a tiny enlargement: enlarge a little more each round.
        scale *= reach / (1 - kSlack) * (1 + 1e-6 * (1 << std::min(round, 12)));
    }
    return std::nullopt;
}

} // namespace prolate

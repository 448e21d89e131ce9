#include "builder/cover.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {

std::optional<format::PackedNode> covering_node(const Fit& fit, const format::Lattice& lattice,
                                                const std::function<double(const Fit&)>& reach_of) {
    constexpr int kRounds = 64;
    double scale = 1;
    for (int round = 0; round < kRounds; ++round) {
        const Mat l = fit.factor * scale;
        const double factor[6] = {l(0, 0), l(1, 0), l(1, 1), l(2, 0), l(2, 1), l(2, 2)};
        format::PackedNode node;
        format::quantise(node, lattice, fit.center.data(), factor);
        const Fit decoded(format::decode(node, lattice));
        const double reach = reach_of(decoded);
        if (reach <= 1 - kSlack) return node;
        // Rounding may undo a tiny enlargement: enlarge a little more each round.
        scale *= reach / (1 - kSlack) * (1 + 1e-6 * (1 << std::min(round, 12)));
    }
    return std::nullopt;
}

std::optional<format::PackedNode> covering_node(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members,
                                                const format::Lattice& lattice, double margin) {
    return covering_node(fit, lattice, [&](const Fit& decoded) {
        return reach_of(decoded, pieces, members) + radial_margin(decoded, margin);
    });
}

double radial_margin(const Fit& fit, double margin) {
    return margin * fit.inverse.norm();
}

double surface_error(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members) {
    double largest = 0;
    for (const uint32_t piece : members)
        pieces.for_each_surface_point(piece, [&](const Vec& p) {
            const double radial = std::sqrt(fit.radial_squared(p));
            // At the very center every direction is radial; the shortest way out is the smallest semi-axis.
            if (radial > 1e-12) largest = std::max(largest, std::abs(1 - 1 / radial) * (p - fit.center).norm());
        });
    return largest;
}

} // namespace prolate

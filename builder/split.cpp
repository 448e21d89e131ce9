#include "builder/split.hpp"

#include <algorithm>
#include <numeric>

namespace prolate {

Fit fit_cells(const Voxels& voxels, std::span<const uint32_t> all, double min_radius) {
    const std::vector<uint32_t> cells = voxels.hull_cells(all);
    Sketch sketch;
    for (const uint32_t cell : cells) sketch.add(voxels.points(cell));
    const auto less = [](const Vec& a, const Vec& b) {
        return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
    };
    std::vector<Vec> core(sketch.points().begin(), sketch.points().end());
    std::sort(core.begin(), core.end(), less);
    core.erase(std::unique(core.begin(), core.end()), core.end());

    constexpr int kRounds = 6;
    Fit fit;
    double reach = 1;
    for (int round = 0; round < kRounds; ++round) {
        fit = enclosing_ellipsoid(core, min_radius, 1e-3);
        // The points that stick out most join the core, at most one per cell.
        std::vector<std::pair<double, Vec>> out;
        reach = 1;
        for (const uint32_t cell : cells) {
            const double r = std::sqrt(fit.radial_squared(voxels.center(cell)));
            if (r + voxels.radius(cell) * fit.inverse.norm() <= 1) continue;
            double worst = 1;
            const Vec* at = nullptr;
            for (const Vec& p : voxels.points(cell))
                if (const double squared = fit.radial_squared(p); squared > worst) worst = squared, at = &p;
            if (at) out.emplace_back(std::sqrt(worst), *at), reach = std::max(reach, out.back().first);
        }
        if (reach <= 1 + 1e-3 || round + 1 == kRounds) break;
        std::sort(out.begin(), out.end(), [&](const auto& a, const auto& b) {
            return a.first != b.first ? a.first > b.first : less(a.second, b.second);
        });
        for (size_t i = 0; i < std::min<size_t>(out.size(), 12); ++i) core.push_back(out[i].second);
    }
    return fit.scaled(reach);
}

Split split(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k, const SplitOptions& options) {
    const std::vector<Cluster> merged = merge_pieces(voxels, cells, k, options);
    std::vector<uint32_t> everything(cells.size());
    std::iota(everything.begin(), everything.end(), 0u);
    Split out = optimise(voxels, cells, merged, std::vector<Domain>(merged.size(), everything), options);
    std::erase_if(out.clusters, [](const Cluster& cluster) { return cluster.cells.empty(); });
    return out;
}

} // namespace prolate

#include "builder/split.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
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
    constexpr uint32_t kPiecesPerChild[] = {16, 8, 32, 12};
    std::vector<uint32_t> everything(cells.size());
    std::iota(everything.begin(), everything.end(), 0u);
    std::vector<Split> tries(static_cast<size_t>(options.starts));
    tbb::parallel_for(size_t{0}, tries.size(), [&](size_t start) {
        SplitOptions own = options;
        own.seed += start;
        const std::vector<Cluster> merged =
            merge_pieces(voxels, cells, k, kPiecesPerChild[start % std::size(kPiecesPerChild)], own);
        tries[start] = optimise(voxels, cells, merged, std::vector<Domain>(merged.size(), everything), own);
    });
    Split best = std::move(*std::min_element(tries.begin(), tries.end(),
                                             [](const Split& a, const Split& b) { return a.error < b.error; }));
    std::erase_if(best.clusters, [](const Cluster& cluster) { return cluster.cells.empty(); });
    return best;
}

} // namespace prolate

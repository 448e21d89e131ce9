#include "builder/resolution.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr uint32_t kMaxResolution = 320;
constexpr uint32_t kMaxFieldResolution = 256;
constexpr double kFieldResolution = 1.25; // of the distance field, against the pieces'
constexpr double kPiecesPerLeaf = 40;     // fewer, and leaves follow the grid instead of the shape
constexpr double kCellsPerLeaf = 24;      // of the coarser grid
constexpr uint32_t kLeastCells = 48;      // of that grid, along the longest side
constexpr double kLeavesOfLimits = 1000;  // of a tolerance or a distance, which say nothing of their number
constexpr double kMostLeaves = 65536;

// A resolution that gives about `times` as many cells: they grow with its square (surface) to its cube (volume).
uint32_t finer(uint32_t resolution, double times) {
    const double grown = std::ceil(resolution * std::clamp(std::sqrt(times), 1.05, 2.0));
    return std::min(kMaxResolution, static_cast<uint32_t>(grown));
}

} // namespace

double expected_leaves(const BuildOptions& options) {
    const bool has_limit =
        options.tolerance > 0 || options.distance > 0 || options.clearance > 0 || options.keep_holes > 0;
    if (options.ellipsoids)
        return has_limit ? std::min<double>(options.ellipsoids, kLeavesOfLimits) : options.ellipsoids;
    if (has_limit) return kLeavesOfLimits;
    return std::min(std::pow(double(options.degree), options.levels ? options.levels : 3u), kMostLeaves);
}

Pieces cut_pieces(MeshView mesh, bool closed, const Winding& winding, double leaves, uint32_t& resolution,
                  const std::function<void()>& again) {
    for (;;) {
        again();
        Pieces pieces(mesh, closed, winding, resolution);
        if (pieces.size() >= kPiecesPerLeaf * leaves || resolution == kMaxResolution) return pieces;
        resolution = finer(resolution, kPiecesPerLeaf * leaves / pieces.size());
    }
}

Voxels start_cells(MeshView mesh, bool closed, const Winding& winding, double leaves, uint32_t resolution) {
    for (uint32_t coarser = std::min(kLeastCells, resolution);;) {
        Voxels cells(mesh, closed, winding, coarser);
        if (cells.cell_count() >= kCellsPerLeaf * leaves || coarser == resolution) return cells;
        coarser = std::min(resolution, finer(coarser, kCellsPerLeaf * leaves / cells.cell_count()));
    }
}

uint32_t field_resolution(uint32_t resolution) {
    return std::min(static_cast<uint32_t>(kFieldResolution * resolution), kMaxFieldResolution);
}

} // namespace prolate

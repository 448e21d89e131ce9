// Greedy merging of connected blocks of cells (paper, Algorithm 1, step 6, the "Ellipsoids Merge Algorithm" of its
// reference [16], whose text gives no details; m, the cost and the neighbourhood below are ours).
//
// Start: the connected parts of the sub-volume in each block of b x b x b cells, b as small as keeps m below
// pieces_per_child * k. Merging: always the pair of touching pieces whose union adds least error. A piece keeps a
// support sketch, so that an ellipsoid around a union costs the same whatever its size. When no two touching pieces are
// left (several components), any two pieces may merge.
#include "builder/split.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <queue>
#include <set>

namespace prolate {
namespace {

constexpr size_t kSamplesPerPiece = 64; // for E_sur while merging
constexpr double kFitTolerance = 2e-2;  // merging ranks pairs; the result is refitted
constexpr size_t kAllPairsLimit = 400;  // pieces up to which components may pair up freely

struct Piece {
    std::vector<uint32_t> cells;
    Sketch sketch;
    std::vector<Vec> samples;
    std::set<uint32_t> neighbours;
    double error = 0;
    bool alive = true;
    uint32_t version = 0;
};

uint32_t find_root(std::vector<uint32_t>& parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

// Which cells of a set touch each other.
class Neighbourhood {
public:
    Neighbourhood(const Voxels& voxels, std::span<const uint32_t> cells)
        : voxels_(voxels), cells_(cells), position_(voxels.cell_count(), Voxels::kNoCell) {
        for (uint32_t i = 0; i < cells.size(); ++i) position_[cells[i]] = i;
    }
    // Visits the positions in the set of the cells that touch cells[position], by half of the 26 around it: over all
    // positions, each pair once.
    template <class Visit> void later(uint32_t position, Visit&& visit) const {
        const auto& [i, j, k] = voxels_.coordinates(cells_[position]);
        for (int n = 14; n < 27; ++n) {
            const uint32_t cell = voxels_.cell_at(i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1);
            if (cell != Voxels::kNoCell && position_[cell] != Voxels::kNoCell) visit(position_[cell]);
        }
    }

private:
    const Voxels& voxels_;
    std::span<const uint32_t> cells_;
    std::vector<uint32_t> position_; // of each cell of the grid in the set
};

// Connected parts in blocks of b cells: for each cell, the number of its part; returns how many there are.
uint32_t label_blocks(const Voxels& voxels, std::span<const uint32_t> cells, const Neighbourhood& neighbourhood, int b,
                      bool connected, std::vector<uint32_t>& label) {
    const auto block = [&](uint32_t position) {
        const auto& c = voxels.coordinates(cells[position]);
        return std::array<int, 3>{c[0] / b, c[1] / b, c[2] / b};
    };
    std::vector<uint32_t> parent(cells.size());
    std::iota(parent.begin(), parent.end(), 0u);
    if (connected) {
        for (uint32_t p = 0; p < cells.size(); ++p)
            neighbourhood.later(p, [&](uint32_t q) {
                if (block(p) == block(q)) parent[find_root(parent, q)] = find_root(parent, p);
            });
    } else {
        std::map<std::array<int, 3>, uint32_t> first;
        for (uint32_t p = 0; p < cells.size(); ++p) parent[p] = first.try_emplace(block(p), p).first->second;
    }
    label.assign(cells.size(), UINT32_MAX);
    uint32_t count = 0;
    for (uint32_t p = 0; p < cells.size(); ++p) {
        const uint32_t root = find_root(parent, p);
        if (label[root] == UINT32_MAX) label[root] = count++;
        label[p] = label[root];
    }
    return count;
}

class Merger {
public:
    Merger(const Voxels& voxels, const SplitOptions& options) : voxels_(voxels), options_(options) {}

    std::vector<Piece> pieces;

    double error(const Sketch& sketch, std::span<const Vec> a, std::span<const Vec> b) const {
        const Fit fit = enclosing_ellipsoid(sketch.points(), options_.min_radius, kFitTolerance);
        double surface = 0;
        for (const auto& samples : {a, b})
            for (const Vec& p : samples) surface = std::max(surface, radial_distance(fit, p));
        return options_.error(surface, outside_volume(fit, voxels_));
    }

    void offer(uint32_t a, uint32_t b) {
        if (a > b) std::swap(a, b);
        Sketch both = pieces[a].sketch;
        both.add(pieces[b].sketch);
        const double growth = error(both, pieces[a].samples, pieces[b].samples) - pieces[a].error - pieces[b].error;
        queue_.push({growth, a, b, pieces[a].version, pieces[b].version});
    }

    // Merges the cheapest pair that is still current; false if there is none.
    bool merge_one() {
        while (!queue_.empty()) {
            const Pair pair = queue_.top();
            queue_.pop();
            Piece &a = pieces[pair.a], &b = pieces[pair.b];
            if (!a.alive || !b.alive || a.version != pair.version_a || b.version != pair.version_b) continue;
            a.sketch.add(b.sketch);
            a.cells.insert(a.cells.end(), b.cells.begin(), b.cells.end());
            a.samples.insert(a.samples.end(), b.samples.begin(), b.samples.end());
            thin(a.samples);
            a.error = error(a.sketch, a.samples, {});
            ++a.version;
            b.alive = false;
            for (const uint32_t n : b.neighbours) {
                pieces[n].neighbours.erase(pair.b);
                if (n != pair.a) pieces[n].neighbours.insert(pair.a), a.neighbours.insert(n);
            }
            a.neighbours.erase(pair.b);
            for (const uint32_t n : a.neighbours) offer(pair.a, n);
            return true;
        }
        return false;
    }

    // Keeps every second sample of too many.
    static void thin(std::vector<Vec>& samples) {
        while (samples.size() > 2 * kSamplesPerPiece) {
            for (size_t i = 0; i < samples.size() / 2; ++i) samples[i] = samples[2 * i];
            samples.resize(samples.size() / 2);
        }
    }

private:
    struct Pair {
        double growth;
        uint32_t a, b, version_a, version_b;
        bool operator<(const Pair& other) const { // std::priority_queue takes the largest: invert
            if (growth != other.growth) return growth > other.growth;
            return std::pair(a, b) > std::pair(other.a, other.b);
        }
    };
    const Voxels& voxels_;
    const SplitOptions& options_;
    std::priority_queue<Pair> queue_;
};

} // namespace

std::vector<Cluster> merge_pieces(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k,
                                  uint32_t pieces_per_child, const SplitOptions& options) {
    const Neighbourhood neighbourhood(voxels, cells);
    const size_t most = size_t{pieces_per_child} * k;
    std::vector<uint32_t> label;
    uint32_t count = 0;
    const int longest = *std::max_element(voxels.size().begin(), voxels.size().end());
    // A block holds at most b^3 cells, so smaller ones need not be tried.
    int side = std::max(1, static_cast<int>(std::cbrt(static_cast<double>(cells.size()) / static_cast<double>(most))));
    for (;; side = side < 4 ? side + 1 : side * 5 / 4) {
        count = label_blocks(voxels, cells, neighbourhood, side, true, label);
        if (count <= most) break;
        if (side > longest) { // dust: more separate parts than pieces; group them by place
            for (int block = longest;; block = std::max(1, block / 2)) {
                std::vector<uint32_t> finer;
                const uint32_t finer_count = label_blocks(voxels, cells, neighbourhood, block, false, finer);
                if (finer_count > most) break;
                label.swap(finer);
                count = finer_count;
                if (block == 1) break;
            }
            break;
        }
    }

    Merger merger(voxels, options);
    merger.pieces.resize(count);
    for (uint32_t p = 0; p < cells.size(); ++p) {
        Piece& piece = merger.pieces[label[p]];
        piece.cells.push_back(cells[p]);
        const auto samples = voxels.samples(cells[p]);
        piece.samples.insert(piece.samples.end(), samples.begin(), samples.end());
        neighbourhood.later(p, [&](uint32_t q) {
            if (label[p] == label[q]) return;
            piece.neighbours.insert(label[q]);
            merger.pieces[label[q]].neighbours.insert(label[p]);
        });
    }
    for (Piece& piece : merger.pieces) {
        Merger::thin(piece.samples);
        for (const uint32_t cell : voxels.hull_cells(piece.cells)) piece.sketch.add(voxels.points(cell));
        piece.error = merger.error(piece.sketch, piece.samples, {});
    }
    uint32_t left = count;
    if (left > k)
        for (uint32_t a = 0; a < count; ++a)
            for (const uint32_t b : merger.pieces[a].neighbours)
                if (a < b) merger.offer(a, b);
    while (left > k) {
        if (merger.merge_one()) {
            --left;
            continue;
        }
        // Separate components: let every piece see every other, or, among very many, the next few.
        std::vector<uint32_t> alive;
        for (uint32_t a = 0; a < count; ++a)
            if (merger.pieces[a].alive) alive.push_back(a);
        const size_t reach = alive.size() <= kAllPairsLimit ? alive.size() : 8;
        for (size_t i = 0; i < alive.size(); ++i)
            for (size_t j = i + 1; j < std::min(alive.size(), i + 1 + reach); ++j) {
                merger.pieces[alive[i]].neighbours.insert(alive[j]);
                merger.pieces[alive[j]].neighbours.insert(alive[i]);
                merger.offer(alive[i], alive[j]);
            }
    }

    std::vector<Cluster> clusters;
    for (Piece& piece : merger.pieces) {
        if (!piece.alive) continue;
        std::sort(piece.cells.begin(), piece.cells.end());
        clusters.push_back({fit_cells(voxels, piece.cells, options.min_radius), std::move(piece.cells)});
    }
    return clusters;
}

} // namespace prolate

#include "builder/start.hpp"

#include "builder/border.hpp"
#include "builder/divide.hpp"
#include "builder/gradient_descent.hpp"
#include "builder/job.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <queue>
#include <set>

namespace prolate {
namespace {

constexpr double kFitTolerance = 2e-2; // merging ranks pairs; the result is refitted
constexpr size_t kAllPairsLimit = 400; // pieces up to which components may pair up freely
constexpr int kVolumeSamples = 192;    // of an ellipsoid, for its outside volume
constexpr int kLloydRounds = 8;
constexpr uint32_t kDirectLimit = 64; // clusters found at once; for more, the cells are halved first

struct Piece {
    std::vector<uint32_t> members;
    Sketch sketch;
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
    Neighbourhood(const Voxels& voxels, std::span<const uint32_t> cells) : voxels_(voxels), cells_(cells) {}
    // Visits the positions in the set of the cells that touch cells[position], by half of the 26 around it: over all
    // positions, each pair once.
    template <class Visit> void later(uint32_t position, Visit&& visit) const {
        const auto& [i, j, k] = voxels_.coordinates(cells_[position]);
        for (int n = 14; n < 27; ++n) {
            const uint32_t cell = voxels_.cell_at(i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1);
            if (cell == Voxels::kNoCell) continue;
            const auto found = std::lower_bound(cells_.begin(), cells_.end(), cell);
            if (found != cells_.end() && *found == cell) visit(static_cast<uint32_t>(found - cells_.begin()));
        }
    }

private:
    const Voxels& voxels_;
    std::span<const uint32_t> cells_; // rising
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

// Greedy merging of pieces by the least growth of E_vol.
class Merger {
public:
    Merger(std::span<const Sketch> sketches, double min_radius, const std::function<double(const Fit&)>& outside)
        : min_radius_(min_radius), outside_(outside), pieces_(sketches.size()) {
        for (uint32_t i = 0; i < pieces_.size(); ++i) {
            pieces_[i].members = {i};
            pieces_[i].sketch = sketches[i];
            pieces_[i].error = error(sketches[i]);
        }
    }

    void connect(uint32_t a, uint32_t b) {
        pieces_[a].neighbours.insert(b);
        pieces_[b].neighbours.insert(a);
    }

    // Until there are `k`, of at most `most` members each as far as that is possible. Returns what each is made of.
    std::vector<std::vector<uint32_t>> run(uint32_t k, size_t most) {
        most_ = most;
        for (size_t left = pieces_.size(); left > k; --left) {
            if (left == pieces_.size()) offer_all();
            while (!merge_one()) connect_more();
        }
        std::vector<std::vector<uint32_t>> out;
        for (Piece& piece : pieces_) {
            if (!piece.alive) continue;
            std::sort(piece.members.begin(), piece.members.end());
            out.push_back(std::move(piece.members));
        }
        return out;
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

    double error(const Sketch& sketch) const {
        checkpoint();
        return outside_(enclosing_ellipsoid(sketch.points(), min_radius_, kFitTolerance));
    }

    void offer(uint32_t a, uint32_t b) {
        if (a > b) std::swap(a, b);
        if (pieces_[a].members.size() + pieces_[b].members.size() > most_) return;
        Sketch both = pieces_[a].sketch;
        both.add(pieces_[b].sketch);
        const double growth = error(both) - pieces_[a].error - pieces_[b].error;
        queue_.push({growth, a, b, pieces_[a].version, pieces_[b].version});
    }
    void offer_all() {
        for (uint32_t a = 0; a < pieces_.size(); ++a)
            if (pieces_[a].alive)
                for (const uint32_t b : pieces_[a].neighbours)
                    if (a < b) offer(a, b);
    }

    // Merges the cheapest pair that is still current; false if there is none.
    bool merge_one() {
        while (!queue_.empty()) {
            const Pair pair = queue_.top();
            queue_.pop();
            Piece &a = pieces_[pair.a], &b = pieces_[pair.b];
            if (!a.alive || !b.alive || a.version != pair.version_a || b.version != pair.version_b) continue;
            a.sketch.add(b.sketch);
            a.members.insert(a.members.end(), b.members.begin(), b.members.end());
            a.error = error(a.sketch);
            ++a.version;
            b.alive = false;
            for (const uint32_t n : b.neighbours) {
                pieces_[n].neighbours.erase(pair.b);
                if (n != pair.a) connect(n, pair.a);
            }
            for (const uint32_t n : a.neighbours) offer(pair.a, n);
            return true;
        }
        return false;
    }

    // No touching pieces are left, or none that are small enough: every piece may see every other, or, of very many,
    // the next few. If they do already, the limit of the size was too strict.
    void connect_more() {
        std::vector<uint32_t> alive;
        for (uint32_t a = 0; a < pieces_.size(); ++a)
            if (pieces_[a].alive) alive.push_back(a);
        const size_t reach = alive.size() <= kAllPairsLimit ? alive.size() : 8;
        bool news = false;
        for (size_t i = 0; i < alive.size(); ++i)
            for (size_t j = i + 1; j < std::min(alive.size(), i + 1 + reach); ++j)
                if (!pieces_[alive[i]].neighbours.contains(alive[j])) {
                    news = true;
                    connect(alive[i], alive[j]);
                    offer(alive[i], alive[j]);
                }
        if (news) return;
        most_ *= 2;
        offer_all();
    }

    const double min_radius_;
    const std::function<double(const Fit&)>& outside_;
    std::vector<Piece> pieces_;
    std::priority_queue<Pair> queue_;
    size_t most_ = 0;
};

Cluster cluster_of(const Voxels& voxels, std::vector<uint32_t> cells, double min_radius) {
    Sketch sketch;
    for (const uint32_t cell : cells) sketch.add(voxels.points(cell));
    const Fit least = enclosing_ellipsoid(sketch.points(), min_radius);
    return {capped(least.center, least.factor * least.factor.transpose(), min_radius), std::move(cells)};
}

// `k` of the sites, each as far from those before it as can be (Gonzalez 1985); all of them if there are fewer.
std::vector<Vec> far_apart(std::span<const Vec> sites, uint32_t k, uint64_t seed) {
    std::vector<Vec> out;
    std::vector<double> distance(sites.size(), HUGE_VAL);
    auto pick = static_cast<size_t>(Random(seed).uniform() * static_cast<double>(sites.size()));
    while (out.size() < std::min<size_t>(k, sites.size())) {
        out.push_back(sites[pick]);
        for (size_t i = 0; i < sites.size(); ++i)
            distance[i] = std::min(distance[i], (sites[i] - out.back()).squaredNorm());
        pick = static_cast<size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    }
    return out;
}

Vec mean_of(std::span<const Vec> sites, std::span<const uint32_t> members) {
    Vec sum = Vec::Zero();
    for (const uint32_t i : members) sum += sites[i];
    return sum / static_cast<double>(members.size());
}

// Lloyd's algorithm: the sites that are nearest to each center.
std::vector<std::vector<uint32_t>> lloyd(std::span<const Vec> sites, std::vector<Vec> centers) {
    std::vector<std::vector<uint32_t>> members(centers.size());
    for (int round = 0; round < kLloydRounds; ++round) {
        checkpoint();
        for (std::vector<uint32_t>& list : members) list.clear();
        for (size_t i = 0; i < sites.size(); ++i) {
            size_t nearest = 0;
            double least = HUGE_VAL;
            for (size_t c = 0; c < centers.size(); ++c)
                if (const double d = (sites[i] - centers[c]).squaredNorm(); d < least) least = d, nearest = c;
            members[nearest].push_back(static_cast<uint32_t>(i));
        }
        for (size_t c = 0; c < centers.size(); ++c)
            if (!members[c].empty()) centers[c] = mean_of(sites, members[c]);
    }
    return members;
}

// The ellipsoid with the mean and covariance of these cells, were they an ellipsoid themselves, a cell thicker.
Fit fit_of(std::span<const Vec> sites, std::span<const uint32_t> members, double pitch, double min_radius) {
    const Vec mean = mean_of(sites, members);
    Mat covariance = Mat::Zero();
    for (const uint32_t i : members) covariance += (sites[i] - mean) * (sites[i] - mean).transpose();
    covariance *= 5 / static_cast<double>(members.size());
    return capped(mean, covariance + pitch * pitch / 4 * Mat::Identity(), min_radius);
}

} // namespace

double sampled_outside_volume(const Fit& fit, const DistanceField& field, std::span<const Fit* const> others) {
    static const std::vector<Vec> samples = [] { // evenly spread in the unit ball
        std::vector<Vec> out = even_directions(kVolumeSamples);
        for (int i = 0; i < kVolumeSamples; ++i) // 119 is prime to 192: the radii are spread over the directions
            out[static_cast<size_t>(i)] *= std::cbrt((i * 119 % kVolumeSamples + 0.5) / kVolumeSamples);
        return out;
    }();
    double outside = 0;
    for (const Vec& u : samples) {
        const Vec x = fit.center + fit.factor * u;
        if (std::ranges::any_of(others, [&](const Fit* other) { return other->radial_squared(x) < 1; })) continue;
        outside += std::clamp(field(x) / field.pitch() + 0.5, 0.0, 1.0);
    }
    return fit.volume() * outside / static_cast<double>(samples.size());
}

std::vector<Cluster> merge_start(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k,
                                 uint32_t pieces_per_cluster, double min_radius,
                                 const std::function<double(const Fit&)>& outside) {
    const Neighbourhood neighbourhood(voxels, cells);
    const size_t most = size_t{pieces_per_cluster} * k;
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

    std::vector<Sketch> sketches(count);
    std::vector<std::vector<uint32_t>> blocks(count);
    for (uint32_t p = 0; p < cells.size(); ++p) {
        sketches[label[p]].add(voxels.points(cells[p]));
        blocks[label[p]].push_back(cells[p]);
    }
    Merger merger(sketches, min_radius, outside);
    for (uint32_t p = 0; p < cells.size(); ++p)
        neighbourhood.later(p, [&](uint32_t q) {
            if (label[p] != label[q]) merger.connect(label[p], label[q]);
        });
    std::vector<Cluster> clusters;
    for (const std::vector<uint32_t>& merged : merger.run(k, SIZE_MAX)) {
        std::vector<uint32_t> own;
        for (const uint32_t block : merged) own.insert(own.end(), blocks[block].begin(), blocks[block].end());
        std::sort(own.begin(), own.end());
        clusters.push_back(cluster_of(voxels, std::move(own), min_radius));
    }
    return clusters;
}

std::vector<std::vector<uint32_t>> merge_groups(std::span<const Sketch> sketches,
                                                std::span<const std::vector<uint32_t>> neighbours, uint32_t k,
                                                size_t most, double min_radius,
                                                const std::function<double(const Fit&)>& outside) {
    Merger merger(sketches, min_radius, outside);
    for (uint32_t a = 0; a < neighbours.size(); ++a)
        for (const uint32_t b : neighbours[a]) merger.connect(a, b);
    return merger.run(k, most);
}

std::vector<Cluster> spread_start(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k, uint64_t seed,
                                  double min_radius) {
    if (k > kDirectLimit) {
        std::vector<uint32_t> all(cells.begin(), cells.end());
        auto halves = divide(std::move(all), cells.size() * (k / 2) / k,
                             [&](uint32_t cell) { return voxels.box(cell).center(); });
        std::sort(halves.first.begin(), halves.first.end()), std::sort(halves.second.begin(), halves.second.end());
        std::vector<Cluster> out = spread_start(voxels, halves.first, k / 2, seed, min_radius);
        std::ranges::move(spread_start(voxels, halves.second, k - k / 2, seed + 1, min_radius),
                          std::back_inserter(out));
        return out;
    }
    std::vector<Vec> sites;
    for (const uint32_t cell : cells) sites.push_back(voxels.box(cell).center());
    std::vector<Cluster> out;
    for (const std::vector<uint32_t>& list : lloyd(sites, far_apart(sites, k, seed))) {
        if (list.empty()) continue;
        Cluster cluster{fit_of(sites, list, voxels.pitch(), min_radius), {}};
        for (const uint32_t i : list) cluster.cells.push_back(cells[i]);
        out.push_back(std::move(cluster));
    }
    return out;
}

} // namespace prolate

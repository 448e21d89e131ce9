// Variational optimisation of the ellipsoids of one node (paper, Algorithm 1, step 7; its reference [16] gives no
// details).
//
// Lloyd's idea, with cover as the constraint. In turn, each ellipsoid is freed from all cells that some other one
// contains too: only the cells that it *alone* covers bind it. It is then refitted around those, and moved and reshaped
// by a (1+1) evolution strategy (Rechenberg's 1/5 rule) that is always scaled back until it covers them. What it lowers
// is the hybrid error (eq. 3), with E_vol taken as the volume that it adds: outside the solid *and* outside the others,
// because the union is what counts. In the first sweeps, volume inside the solid earns a reward that is annealed to
// zero, so that an ellipsoid can take over its neighbours' cells. The best state seen is kept.
//
// Known limit: local. Ellipsoids that end with nothing of their own are moved to where the error is worst, but there is
// no other global step.
#include "builder/random.hpp"
#include "builder/split.hpp"

#include <algorithm>

namespace prolate {
namespace {

constexpr size_t kSurfaceSamples = 128; // per ellipsoid, for E_sur during a search
constexpr double kFirstReward = 0.1;    // per volume inside the solid, against 1 per volume outside

// Cells of the voxel grid that some ellipsoid of the set covers, on a window around the node.
class Coverage {
public:
    Coverage(const Voxels& voxels, std::span<const uint32_t> cells) : voxels_(voxels) {
        std::array<int, 3> high{};
        low_ = voxels.size();
        for (const uint32_t cell : cells)
            for (size_t a = 0; a < 3; ++a) {
                low_[a] = std::min(low_[a], voxels.coordinates(cell)[a]);
                high[a] = std::max(high[a], voxels.coordinates(cell)[a] + 1);
            }
        for (size_t a = 0; a < 3; ++a) { // ellipsoids stick out of their cells
            const int margin = (high[a] - low_[a]) / 4 + 2;
            low_[a] = std::max(low_[a] - margin, 0);
            size_[a] = std::min(high[a] + margin, voxels.size()[a]) - low_[a];
        }
        count_.assign(static_cast<size_t>(size_[0]) * static_cast<size_t>(size_[1]) * static_cast<size_t>(size_[2]), 0);
    }

    void add(const Fit& fit, int by) {
        // One row through each voxel center; a voxel counts if its center is covered.
        for_each_row(
            fit, voxels_,
            [&](int i, int j, double z0, double z1, double) {
                if (i < low_[0] || j < low_[1] || i >= low_[0] + size_[0] || j >= low_[1] + size_[1]) return;
                uint16_t* const row = count_.data() + row_index(i, j);
                const int last = std::min(static_cast<int>(std::floor(z1 - 0.5)) - low_[2], size_[2] - 1);
                for (int k = std::max(static_cast<int>(std::ceil(z0 - 0.5)) - low_[2], 0); k <= last; ++k)
                    row[k] = static_cast<uint16_t>(row[k] + by);
            },
            1);
    }

    // Volume of `fit` that is outside the solid and that nothing else covers, and its volume inside the solid.
    struct Volumes {
        double added, solid;
    };
    Volumes added_volume(const Fit& fit) const {
        double whole = 0, taken = 0, inside = 0;
        const auto& size = voxels_.size();
        for_each_row(fit, voxels_, [&](int i, int j, double z0, double z1, double area) {
            whole += area * (z1 - z0);
            if (i < 0 || j < 0 || i >= size[0] || j >= size[1]) return;
            const double solid = area * (voxels_.solid_below(i, j, z1) - voxels_.solid_below(i, j, z0));
            inside += solid;
            if (i < low_[0] || j < low_[1] || i >= low_[0] + size_[0] || j >= low_[1] + size_[1]) {
                taken += solid;
                return;
            }
            // Within the window, voxel by voxel; above and below it, the solid alone counts.
            const double w0 = std::clamp(z0, double(low_[2]), double(low_[2] + size_[2]));
            const double w1 = std::clamp(z1, double(low_[2]), double(low_[2] + size_[2]));
            taken += solid - area * (voxels_.solid_below(i, j, w1) - voxels_.solid_below(i, j, w0));
            const uint16_t* const row = count_.data() + row_index(i, j);
            const size_t first = voxels_.index(i, j, 0);
            const int k1 = std::min(static_cast<int>(w1), low_[2] + size_[2] - 1);
            for (int k = static_cast<int>(w0); k <= k1; ++k) {
                const double length = std::min(w1, k + 1.0) - std::max(w0, double(k));
                taken += area * length *
                         (row[k - low_[2]] ? 1.0 : double{voxels_.solid_fraction(first + static_cast<size_t>(k))});
            }
        });
        const double unit = voxels_.pitch() * voxels_.pitch() * voxels_.pitch();
        return {std::max(whole - taken, 0.0) * unit, inside * unit};
    }

private:
    size_t row_index(int i, int j) const {
        return (static_cast<size_t>(i - low_[0]) * static_cast<size_t>(size_[1]) + static_cast<size_t>(j - low_[1])) *
               static_cast<size_t>(size_[2]);
    }

    const Voxels& voxels_;
    std::array<int, 3> low_{}, size_{};
    std::vector<uint16_t> count_;
};

class Optimiser {
public:
    Optimiser(const Voxels& voxels, std::span<const uint32_t> cells, const std::vector<Cluster>& clusters,
              std::span<const Domain> domains, const SplitOptions& options)
        : voxels_(voxels), cells_(cells), domains_(domains), options_(options), random_(options.seed),
          coverage_(voxels, cells), holders_(cells.size(), 0) {
        for (const Cluster& cluster : clusters) {
            fits_.push_back(cluster.fit);
            holds_.emplace_back();
            added_.push_back(0);
            include(fits_.size() - 1);
        }
    }

    void run() {
        keep_best();
        const int sweeps = fits_.size() > 1 ? options_.sweeps : 0; // one alone is fitted already
        for (int sweep = 0; sweep < sweeps; ++sweep) {
            if (options_.cancelled->load(std::memory_order_relaxed)) return;
            // Two annealing cycles; the last third of each is pure.
            const int cycle = (options_.sweeps + 1) / 2, at = sweep % cycle;
            const double reward = kFirstReward * std::max(0.0, 1 - 1.5 * at / std::max(1, cycle - 1));
            for (size_t i = 0; i < fits_.size(); ++i) improve(i, reward);
            keep_best();
            if (options_.progress) options_.progress((sweep + 1.0) / options_.sweeps);
        }
        fits_ = best_;
    }

    // Each cell to the ellipsoid that holds it most centrally.
    Split assign() {
        for (size_t i = 0; i < fits_.size(); ++i) {
            exclude(i); // fits_ may have been exchanged: recompute who holds what
            include(i);
        }
        std::vector<size_t> owner(cells_.size(), fits_.size());
        std::vector<double> nearest(cells_.size(), HUGE_VAL);
        for (size_t i = 0; i < fits_.size(); ++i)
            for_each_held(i, [&](uint32_t c) {
                const double radial = fits_[i].radial_squared(voxels_.center(cells_[c]));
                if (radial < nearest[c]) nearest[c] = radial, owner[c] = i;
            });
        Split out;
        out.clusters.resize(fits_.size());
        for (size_t i = 0; i < fits_.size(); ++i) out.clusters[i].fit = fits_[i];
        for (size_t c = 0; c < cells_.size(); ++c) out.clusters[owner[c]].cells.push_back(cells_[c]);
        out.outside = union_outside();
        out.error = best_error_;
        return out;
    }

private:
    bool holds(const Fit& fit, double shortest_inverse, uint32_t cell) const {
        const double radial = std::sqrt(fit.radial_squared(voxels_.center(cell)));
        const double spread = voxels_.radius(cell) * shortest_inverse;
        if (radial + spread <= 1) return true;
        if (radial - spread > 1) return false;
        for (const Vec& p : voxels_.points(cell))
            if (fit.radial_squared(p) > kHeld) return false;
        return true;
    }

    void include(size_t i) {
        const double shortest_inverse = fits_[i].inverse.norm();
        holds_[i].resize(domains_[i].size());
        for (size_t d = 0; d < domains_[i].size(); ++d) {
            const uint32_t c = domains_[i][d];
            holds_[i][d] = holds(fits_[i], shortest_inverse, cells_[c]);
            holders_[c] = static_cast<uint16_t>(holders_[c] + holds_[i][d]);
        }
        coverage_.add(fits_[i], +1);
        included_.resize(fits_.size());
        included_[i] = fits_[i];
    }
    void exclude(size_t i) {
        for_each_held(i, [&](uint32_t c) { --holders_[c]; });
        coverage_.add(included_[i], -1);
    }
    template <class Visit> void for_each_held(size_t i, Visit&& visit) const {
        for (size_t d = 0; d < holds_[i].size(); ++d)
            if (holds_[i][d]) visit(domains_[i][d]);
    }

    double error_of(const Fit& fit, std::span<const Vec> samples, double reward, double* added = nullptr) const {
        double surface = 0;
        for (const Vec& p : samples) surface = std::max(surface, radial_distance(fit, p));
        const Coverage::Volumes volumes = coverage_.added_volume(fit);
        if (added) *added = volumes.added;
        return options_.error(surface, volumes.added) - options_.error.beta * reward * volumes.solid;
    }

    void improve(size_t i, double reward) {
        exclude(i);
        std::vector<uint32_t> alone; // in its domain: until now it held them
        for (const uint32_t c : domains_[i])
            if (holders_[c] == 0) alone.push_back(cells_[c]);
        if (alone.empty()) alone = half_of_the_worst(i);
        if (!alone.empty()) fits_[i] = search(fits_[i], alone, reward, added_[i]);
        include(i);
    }

    // Nothing binds this ellipsoid: it goes to help the one that adds most, with half of what that one holds.
    std::vector<uint32_t> half_of_the_worst(size_t redundant) const {
        size_t worst = redundant;
        for (size_t j = 0; j < fits_.size(); ++j)
            if (j != redundant && (worst == redundant || added_[j] > added_[worst])) worst = j;
        if (worst == redundant) return {};
        std::vector<uint32_t> own;
        Vec mean = Vec::Zero();
        for_each_held(worst, [&](uint32_t c) {
            if (holders_[c] == 1 && std::binary_search(domains_[redundant].begin(), domains_[redundant].end(), c))
                own.push_back(cells_[c]), mean += voxels_.center(cells_[c]);
        });
        if (own.size() < 2) return own;
        mean /= static_cast<double>(own.size());
        int longest = 0; // column of L with most weight: the factor's last rows mix, so take the widest box side
        fits_[worst].half_extents().maxCoeff(&longest);
        std::vector<uint32_t> half;
        for (const uint32_t cell : own)
            if (voxels_.center(cell)[longest] <= mean[longest]) half.push_back(cell);
        return half;
    }

    Fit search(const Fit& current, std::span<const uint32_t> alone, double reward, double& added) {
        // What binds: the extreme points of the cells held alone.
        const std::vector<uint32_t> hull = voxels_.hull_cells(alone);
        Sketch sketch;
        for (const uint32_t cell : hull) sketch.add(voxels_.points(cell));
        std::vector<Vec> samples;
        for (const uint32_t cell : alone) {
            const auto own = voxels_.samples(cell);
            samples.insert(samples.end(), own.begin(), own.end());
        }
        if (samples.size() > kSurfaceSamples) {
            const size_t stride = samples.size() / kSurfaceSamples + 1;
            size_t kept = 0;
            for (size_t s = 0; s < samples.size(); s += stride) samples[kept++] = samples[s];
            samples.resize(kept);
        }
        std::vector<Vec> core(sketch.points().begin(), sketch.points().end());
        const auto tightened = [&](const Fit& fit) { return fit.scaled(fit.reach(core) * (1 + 1e-9)); };

        const Fit fresh = fit_cells(voxels_, alone, options_.min_radius);
        // Where the fresh fit touches, it may touch at points that the sketch does not have.
        for (const uint32_t cell : hull)
            for (const Vec& p : voxels_.points(cell))
                if (fresh.radial_squared(p) > 0.98) core.push_back(p);
        if (core.size() > 256) { // many cells touch: keep an even choice of the extra ones
            std::vector<Vec> fewer(core.begin(), core.begin() + 48);
            for (size_t e = 48; e < core.size(); e += core.size() / 200 + 1) fewer.push_back(core[e]);
            core.swap(fewer);
        }

        Fit best = tightened(fresh);
        double best_error = error_of(best, samples, reward);
        if (const Fit old = tightened(current); within_caps(old, options_.min_radius)) {
            const double error = error_of(old, samples, reward);
            if (error < best_error) best = old, best_error = error;
        }
        double step = 0.08;
        for (int trial = 0; trial < options_.trials && step > 1e-4; ++trial) {
            Mat change = Mat::Identity();
            for (int r = 0; r < 3; ++r)
                for (int c = 0; c <= r; ++c) change(r, c) += step * random_.symmetric();
            Vec shift; // one by one: compilers differ in the order of a call's arguments
            for (double& x : shift) x = step * random_.symmetric();
            const Fit proposal = tightened({best.center + best.factor * shift, Mat(best.factor * change)});
            if (!within_caps(proposal, options_.min_radius)) continue;
            const double error = error_of(proposal, samples, reward);
            if (error < best_error) {
                best = proposal, best_error = error;
                step *= 1.6;
            } else {
                step *= 0.9;
            }
        }
        // Cover of all the points, not of the core alone.
        double reach = 1;
        for (const uint32_t cell : hull) reach = std::max(reach, best.reach(voxels_.points(cell)));
        best = best.scaled(reach * (1 + 1e-9));
        error_of(best, {}, 0, &added);
        return best;
    }

    // Volume of the union outside the solid. Taking the ellipsoids one by one, each against those before it, sums to
    // the union; `each` gets the index and the volume that it adds.
    template <class Each> double union_outside(Each&& each) {
        double outside = 0;
        for (const Fit& fit : included_) coverage_.add(fit, -1);
        for (size_t i = 0; i < included_.size(); ++i) {
            const double added = coverage_.added_volume(included_[i]).added;
            each(i, added);
            outside += added;
            coverage_.add(included_[i], +1);
        }
        return outside;
    }
    double union_outside() {
        return union_outside([](size_t, double) {});
    }

    // The hybrid error of the set. A cell of the surface corresponds to the holder whose border it is nearest to.
    void keep_best() {
        std::vector<double> distance(cells_.size(), HUGE_VAL), surface(fits_.size(), 0);
        std::vector<size_t> nearest(cells_.size(), 0);
        for (size_t i = 0; i < fits_.size(); ++i)
            for_each_held(i, [&](uint32_t c) {
                const double own = surface_error(fits_[i], voxels_, {&cells_[c], 1});
                if (own < distance[c]) distance[c] = own, nearest[c] = i;
            });
        for (size_t c = 0; c < cells_.size(); ++c) surface[nearest[c]] = std::max(surface[nearest[c]], distance[c]);
        double error = 0;
        union_outside([&](size_t i, double added) { error += options_.error(surface[i], added); });
        if (best_.empty() || error < best_error_) best_ = fits_, best_error_ = error;
    }

    static constexpr double kHeld = 1 + 1e-7; // squared radial coordinate up to which a point counts as held

    const Voxels& voxels_;
    std::span<const uint32_t> cells_;
    std::span<const Domain> domains_;
    const SplitOptions& options_;
    Random random_;
    Coverage coverage_;
    std::vector<Fit> fits_, included_, best_;
    double best_error_ = HUGE_VAL;
    std::vector<double> added_;               // volume that each ellipsoid adds outside
    std::vector<std::vector<uint8_t>> holds_; // [ellipsoid][index in its domain]
    std::vector<uint16_t> holders_;           // how many ellipsoids hold each cell: at least one between updates
};

} // namespace

Split optimise(const Voxels& voxels, std::span<const uint32_t> cells, const std::vector<Cluster>& clusters,
               std::span<const Domain> domains, const SplitOptions& options) {
    Optimiser optimiser(voxels, cells, clusters, domains, options);
    optimiser.run();
    return optimiser.assign();
}

} // namespace prolate

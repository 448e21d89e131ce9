// Many ellipsoids are grown, and those are chosen that together hold most.
//
// Growing: the surface around an ellipsoid is shut out by planes, nearest first, and the largest ellipsoid below all of
// them takes its place; and again, until it gains nothing (Deits and Tedrake 2015, see obstacles.hpp). Every step makes
// a candidate: the last is the largest, but an earlier one may fill a corner better.
//
// Choosing: greedily by the volume that no ellipsoid before holds, which is counted on a lattice. The gain of each
// falls while others are chosen, so that old gains are upper bounds, and few need to be counted anew (M. Minoux,
// "Accelerated Greedy Algorithms for Maximizing Submodular Set Functions", Optimization Techniques, 1978).
//
// Candidates start as balls at the deepest points of the solid, and in later rounds as ellipsoids around what is not
// yet held, here and there. At the end each chosen ellipsoid is moved to where it holds more that no other does, as
// Lloyd's algorithm moves centers.
#include "builder/inner_set.hpp"

#include "builder/inscribed.hpp"
#include "builder/inside_lattice.hpp"
#include "builder/job.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <queue>

namespace prolate {
namespace {

constexpr double kReach = 3;              // of the unit ball: how far a step looks, and the ellipsoid may grow
constexpr size_t kMostPlanes = 60;        // of a step
constexpr double kLeastVolumeGain = 1.02; // of volume, for another step
constexpr double kSpacing = 0.7;          // of seeds of the first round, in their depths
constexpr double kNeighbourhood = 1.4;
constexpr uint32_t kFewPoints = 12; // that are not worth an ellipsoid
constexpr double kThickest = 0.05;  // of the longest radius, the least that an ellipsoid starts with

struct Trials {
    uint32_t seeds; // of the first round, for each ellipsoid asked for; half as many in the others
    int rounds;     // of new candidates
    int growth;     // steps
    int sweeps;     // of moving the chosen ones
};
constexpr Trials trials_of(Quality quality) {
    return quality == Quality::fast     ? Trials{2, 2, 3, 1}
           : quality == Quality::normal ? Trials{3, 3, 5, 3}
                                        : Trials{4, 5, 6, 6};
}

class InnerSet {
public:
    InnerSet(const TriangleTree& surface, const DistanceField& field, const InnerSetOptions& options)
        : surface_(surface), field_(field), options_(options), trials_(trials_of(options.quality)), lattice_(field) {}

    std::vector<Fit> run() {
        std::vector<Fit> starts = deepest();
        for (int round = 0; round < trials_.rounds && !starts.empty(); ++round) {
            grow_all(starts);
            choose();
            options_.progress(0.7 * (round + 1) / trials_.rounds);
            if (round + 1 < trials_.rounds) starts = around_gaps(static_cast<uint64_t>(round));
        }
        for (int sweep = 0; sweep < trials_.sweeps; ++sweep) {
            if (!move_all()) break;
            options_.progress(0.7 + 0.3 * (sweep + 1) / trials_.sweeps);
        }
        return in_order_of_gain();
    }

private:
    // ---- candidates ------------------------------------------------------------------------------------------------

    Fit ball(const Vec& center, double radius) const { return Fit(center, radius * Mat::Identity()); }

    // Balls at the deepest points, not too near to each other.
    std::vector<Fit> deepest() const {
        std::vector<uint32_t> order(lattice_.points().begin(), lattice_.points().end());
        std::stable_sort(order.begin(), order.end(),
                         [this](uint32_t p, uint32_t q) { return lattice_.depth(p) > lattice_.depth(q); });
        std::vector<Fit> out;
        Coverage taken(lattice_, field_.values().size());
        for (const uint32_t p : order) {
            if (out.size() >= size_t{trials_.seeds} * options_.count) break;
            if (taken.holds(p)) continue;
            checkpoint();
            const Vec place = lattice_.place(p);
            const double depth = surface_.distance(place);
            taken.add(ball(place, std::max(kSpacing * depth, 0.5 * lattice_.pitch())));
            if (depth > 0) out.push_back(ball(place, depth));
        }
        return out;
    }

    // Ellipsoids around points that none holds, in balls of about the size of what one ellipsoid is to hold.
    std::vector<Fit> around_gaps(uint64_t round) const {
        std::vector<uint32_t> open;
        for (const uint32_t p : lattice_.points())
            if (!coverage_.holds(p)) open.push_back(p);
        std::vector<Fit> out;
        if (open.empty()) return out;
        const size_t count = size_t{trials_.seeds} * options_.count / 2;
        const double share = static_cast<double>(open.size()) / options_.count * std::pow(lattice_.pitch(), 3);
        const double size = std::cbrt(share * 3 / (4 * std::numbers::pi));
        Random random(options_.seed + 977 * (round + 1));
        for (size_t i = 0; i < count; ++i) {
            const auto at = static_cast<size_t>(random.uniform() * static_cast<double>(open.size()));
            const double radius = size * (1 + 3 * random.uniform());
            add_start(ball(lattice_.place(open[at]), radius), lattice_.place(open[at]), out);
        }
        return out;
    }

    // An ellipsoid around the points of `region` that none holds, or a ball at `fallback`, shrunk until it is free.
    void add_start(const Fit& region, const Vec& fallback, std::vector<Fit>& out) const {
        Vec sum = Vec::Zero();
        Mat squares = Mat::Zero();
        uint32_t count = 0;
        lattice_.for_each_in(region, [&](uint32_t p) {
            if (coverage_.holds(p)) return;
            const Vec x = lattice_.place(p) - region.center;
            sum += x, squares += x * x.transpose(), ++count;
        });
        Fit start = ball(fallback, lattice_.pitch());
        if (count >= kFewPoints) {
            const Vec mean = sum / count;
            Mat q = 5.0 / count * squares - 5 * mean * mean.transpose(); // of a full ellipsoid
            q.diagonal().array() += kThickest * kThickest * q.trace();
            const Vec center = region.center + mean;
            if (field_(center) < 0)
                start = options_.balls ? ball(center, std::cbrt(Fit(center, cholesky(q)).volume()))
                                       : Fit(center, cholesky(q));
        }
        const double room = clearance(start, surface_, kReach);
        if (room > 1e-3 && field_(start.center) < 0) out.push_back(start.scaled(room));
    }

    // All that comes of `start`, the start included.
    std::vector<Fit> grown(Fit start) const {
        std::vector<Fit> out{start};
        for (int step = 0; step < trials_.growth; ++step) {
            const std::vector<Obstacle> planes = obstacles(start, surface_, kReach, kMostPlanes);
            const Fit local = largest_inscribed(planes, kReach, options_.balls);
            const Mat factor = start.factor * local.factor;
            Fit next(start.center + start.factor * local.center, cholesky(factor * factor.transpose()));
            next = next.scaled(clearance(next, surface_, kReach));
            if (!(next.volume() > kLeastVolumeGain * start.volume())) break;
            out.push_back(start = next);
        }
        return out;
    }

    void grow_all(const std::vector<Fit>& starts) {
        std::vector<std::vector<Fit>> all(starts.size());
        parallel_for(size_t{0}, starts.size(), [&](size_t i) { all[i] = grown(starts[i]); });
        for (const std::vector<Fit>& some : all) pool_.insert(pool_.end(), some.begin(), some.end());
    }

    // ---- choice ----------------------------------------------------------------------------------------------------

    // The best of all candidates so far, one by one.
    void choose() {
        struct Entry {
            uint32_t gain, candidate;
            bool operator<(const Entry& other) const {
                return gain != other.gain ? gain < other.gain : candidate > other.candidate;
            }
        };
        coverage_ = Coverage(lattice_, field_.values().size());
        std::vector<Entry> entries(pool_.size());
        parallel_for(size_t{0}, pool_.size(), [&](size_t i) {
            entries[i] = {coverage_.gain(pool_[i]), static_cast<uint32_t>(i)};
        });
        std::priority_queue<Entry> queue(entries.begin(), entries.end());
        chosen_.clear();
        while (chosen_.size() < options_.count && !queue.empty()) {
            Entry best = queue.top();
            queue.pop();
            best.gain = coverage_.gain(pool_[best.candidate]);
            if (best.gain == 0) continue;
            if (!queue.empty() && best < queue.top()) {
                queue.push(best);
                continue;
            }
            chosen_.push_back(pool_[best.candidate]);
            coverage_.add(chosen_.back());
        }
    }

    // Each chosen one in turn makes way for the best that grows where it stands. False if none does.
    bool move_all() {
        bool moved = false;
        for (Fit& fit : chosen_) {
            checkpoint();
            coverage_.remove(fit);
            uint32_t most = coverage_.gain(fit);
            std::vector<Fit> starts;
            for (const double size : {1.0, kNeighbourhood, kNeighbourhood * kNeighbourhood})
                add_start(fit.scaled(size), fit.center, starts);
            std::vector<std::vector<Fit>> all(starts.size());
            parallel_for(size_t{0}, starts.size(), [&](size_t i) { all[i] = grown(starts[i]); });
            for (const std::vector<Fit>& some : all)
                for (const Fit& other : some)
                    if (const uint32_t gain = coverage_.gain(other); gain > most)
                        most = gain, fit = other, moved = true;
            coverage_.add(fit);
        }
        return moved;
    }

    std::vector<Fit> in_order_of_gain() {
        pool_ = std::move(chosen_);
        choose();
        return std::move(chosen_);
    }

    const TriangleTree& surface_;
    const DistanceField& field_;
    const InnerSetOptions& options_;
    const Trials trials_;
    const InsideLattice lattice_;
    std::vector<Fit> pool_, chosen_;
    Coverage coverage_{lattice_, 0}; // of the chosen ones
};

} // namespace

InsideLattice::InsideLattice(const DistanceField& field) : field_(field) {
    for (uint32_t i = 0; i < field.values().size(); ++i)
        if (field.values()[i] < 0) points_.push_back(i);
}

Vec InsideLattice::place(uint32_t index) const {
    const auto ny = static_cast<uint32_t>(field_.size()[1]), nz = static_cast<uint32_t>(field_.size()[2]);
    const uint32_t i = index / (ny * nz), j = index / nz % ny, k = index % nz;
    return field_.origin() + field_.pitch() * Vec(i, j, k);
}

std::vector<Fit> inner_set(const TriangleTree& surface, const DistanceField& field, const InnerSetOptions& options) {
    return InnerSet(surface, field, options).run();
}

} // namespace prolate

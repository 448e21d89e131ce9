#include "builder/grow.hpp"

#include "builder/stack.hpp"
#include "builder/tree_above.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

namespace prolate {
namespace {

constexpr uint32_t kMaxLeaves = 65536;
constexpr uint32_t kDefaultLevels = 3;
constexpr double kLeastGain = 0.999; // a level must bring the outside volume down to less than this much
// Of the search for the least count that meets a limit:
constexpr int kSearchRounds = 12;       // at most
constexpr uint32_t kFirstCount = 8;     // to try
constexpr double kMet = 0.999;          // of a limit: quantisation will add a little
constexpr double kBlocked = 8;          // an excess, of a passage that is not free at all
constexpr double kCountTolerance = 1.1; // it ends this close to the least count

class Grower {
public:
    Grower(const Solid& solid, const GrowOptions& options)
        : solid_(solid), options_(options), sets_(solid, options.build, options.effort, options.min_radius),
          started_(Clock::now()) {}

    Grown run() {
        FlatSet root = sets_.single();
        end_level();
        const BuildOptions& goal = options_.build;
        if (goal.tolerance > 0 || options_.most_distance < HUGE_VAL || options_.passages) {
            grow_upwards(root, meet_limits(root));
        } else if (goal.ellipsoids) {
            const FlatSet leaves = exactly(goal.ellipsoids, [this](double done) { report(done); });
            grown_.goal_reached = leaves.parts.size() == goal.ellipsoids;
            grow_upwards(root, leaves);
        } else
            grow_levels(std::move(root), goal.levels ? goal.levels : kDefaultLevels);
        return std::move(grown_);
    }

private:
    using Clock = std::chrono::steady_clock;

    void report(double done) const {
        if (options_.progress) options_.progress(done, ellipsoids_);
    }
    void end_level() {
        const auto now = Clock::now();
        grown_.seconds.push_back(std::chrono::duration<double>(now - started_).count());
        started_ = now;
    }

    // --- levels -----------------------------------------------------------------------------------------------------

    double most_nodes(uint32_t level) const {
        return std::min(std::pow(options_.build.degree, level), static_cast<double>(kMaxLeaves));
    }

    // A set for each level, down to the last one that gains anything: what a shell's eight ellipsoids cannot do, its 64
    // can, and a ball's cannot either.
    void grow_levels(FlatSet root, uint32_t levels) {
        double work = 0, done = 0;
        for (uint32_t l = 1; l <= levels; ++l) work += most_nodes(l);
        std::vector<FlatSet> sets{std::move(root)};
        double least = sets[0].outside;
        uint32_t last = 0;
        for (uint32_t l = 1; l <= levels; ++l) {
            const auto count = static_cast<uint32_t>(most_nodes(l));
            FlatSet set = sets_.make(count, &sets[l - 1], [&](double part) { report((done + part * count) / work); });
            follow_cuts(sets[l - 1], solid_.pieces);
            if (!(set.outside < kLeastGain * sets[l - 1].outside)) set = halved(sets[l - 1], count);
            done += count;
            ellipsoids_ += static_cast<uint32_t>(set.parts.size());
            if (set.outside < kLeastGain * least) last = l, least = set.outside;
            sets.push_back(std::move(set));
            end_level();
        }
        grown_.goal_reached = last == levels;
        sets.resize(last + 1);
        for (FlatSet& set : sets) follow_cuts(set, solid_.pieces);
        make_counts_fit(sets);
        grown_.nodes = stack(sets, options_.build.degree);
    }

    // `set` with its parts halved, or as it is if that gains nothing: of a sheet much thinner than a cell the field
    // that guides descents shows nothing, but halves are fitted to its pieces.
    FlatSet halved(const FlatSet& set, uint32_t count) const {
        FlatSet halves = set;
        sets_.split(halves, count);
        return halves.outside < set.outside ? halves : set;
    }

    // Splits parts where a level has too few for those of the next one, or less than the one above.
    void make_counts_fit(std::vector<FlatSet>& sets) const {
        const uint32_t degree = options_.build.degree;
        for (size_t l = sets.size(); l-- > 1;) sets_.split(sets[l - 1], (sets[l].parts.size() + degree - 1) / degree);
        for (size_t l = 1; l < sets.size(); ++l) sets_.split(sets[l], sets[l - 1].parts.size());
    }

    // --- leaves -----------------------------------------------------------------------------------------------------

    void grow_upwards(const FlatSet& root, const FlatSet& leaves) {
        if (leaves.parts.size() == 1)
            grown_.nodes = {{root.parts[0].fit, leaves.parts[0].pieces}};
        else
            grown_.nodes =
                tree_above(leaves, root.parts[0].fit, solid_.pieces, sets_, options_.build.degree, options_.min_radius);
        end_level();
    }

    FlatSet exactly(uint32_t count, const std::function<void(double)>& progress) {
        if (count == 1) return sets_.single();
        FlatSet set = sets_.make(count, nullptr, progress);
        sets_.split(set, count);
        return set;
    }

    // How far the cover is from what was asked: above 1, not there yet.
    double excess(const FlatSet& set) const {
        const double tolerance = double{options_.build.tolerance};
        double out = 0;
        if (tolerance > 0) out = set.outside / solid_.columns.volume().value / tolerance;
        if (options_.most_distance < HUGE_VAL)
            out = std::max(out, solid_.distance(ellipsoids_of(fits_of(set.parts))) / options_.most_distance);
        if (const Passages* const passages = options_.passages)
            out = std::max(out, std::min(kBlocked, passages->needed() /
                                                       passages->nearest(ellipsoids_of(fits_of(set.parts))).distance));
        return out;
    }

    // The fewest leaves that meet the limits, to about a tenth: errors fall about like a power of the count. If as many
    // as there may be do not meet them, those.
    FlatSet meet_limits(const FlatSet& root) {
        const uint32_t most = options_.build.ellipsoids ? options_.build.ellipsoids : kMaxLeaves;
        uint32_t low = 1, count = std::min(kFirstCount, most); // low: known to be too few
        double low_excess = excess(root);
        if (low_excess <= kMet) return root;
        std::optional<FlatSet> best;
        for (int round = 0; round < kSearchRounds; ++round) {
            FlatSet set = exactly(count, [&](double part) { report((round + part) / kSearchRounds); });
            if (best) follow_cuts(*best, solid_.pieces);
            const double now = excess(set);
            const bool met = now <= kMet;
            if (met) {
                best = std::move(set);
                if (count <= low * kCountTolerance + 1) return *best;
            } else if (best ? count * kCountTolerance >= static_cast<double>(best->parts.size())
                            : count == most || set.parts.size() < count) {
                if (best) return *best;
                grown_.goal_reached = false;
                return set;
            }
            const double steepness =
                std::clamp(std::log(low_excess / now) / std::log(static_cast<double>(count) / low), 0.4, 1.5);
            if (!met) low = count, low_excess = now;
            const double guess = low * std::pow(low_excess / (0.97 * kMet), 1 / steepness);
            const double limit = best ? static_cast<double>(best->parts.size()) - 1 : std::min<double>(most, low * 8.0);
            count = static_cast<uint32_t>(std::clamp(std::ceil(guess), low + 1.0, std::max(low + 1.0, limit)));
        }
        if (best) return *best;
        grown_.goal_reached = false;
        return root;
    }

    const Solid& solid_;
    const GrowOptions& options_;
    FlatSetMaker sets_;
    Grown grown_;
    Clock::time_point started_;
    uint32_t ellipsoids_ = 1; // so far
};

} // namespace

Grown grow(const Solid& solid, const GrowOptions& options) {
    return Grower(solid, options).run();
}

} // namespace prolate

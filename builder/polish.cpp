#include "builder/polish.hpp"

#include "builder/border.hpp"
#include "builder/cover.hpp"
#include "builder/job.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

namespace prolate {
namespace {

constexpr double kHeld = 1 + 1e-7;    // squared radial coordinate up to which a point counts as held
constexpr double kNearlyHeld = 1.005; // scale of an ellipsoid that holds a piece well enough not to cut it
constexpr double kPolishMargin = 1.2; // ellipsoids may grow so much before neighbours are looked for again
constexpr int kPolishInterval = 4;    // sweeps
constexpr double kPolishDecay = 0.8;  // of the step's square root, over all sweeps
constexpr double kFirstReward = 0.1;  // for volume inside the solid that no other covers; falls to 0
constexpr double kAlmostCapped = 0.9; // of the largest axis ratio of steps
constexpr int kCuttingRounds = 8;
constexpr size_t kCuts = 24; // constraints added a round
constexpr int kDualSweeps = 100;

bool holds(const Fit& fit, double shortest_inverse, const Pieces& pieces, uint32_t piece, double held = kHeld) {
    const double squared = fit.radial_squared(pieces.center(piece));
    const double spread = pieces.radius(piece) * shortest_inverse;
    if (spread <= 1 && squared <= (1 - spread) * (1 - spread)) return true;
    if (squared > (1.01 + spread) * (1.01 + spread)) return false;
    for (const Vec& p : pieces.points(piece))
        if (fit.radial_squared(p) > held) return false;
    return true;
}

Box box_of(const Fit& fit, double margin) {
    const Vec half = margin * fit.half_extents();
    return {fit.center - half, fit.center + half};
}

// A change of an ellipsoid, c += L s and L += L G, in coordinates in which lengths are |s|^2 + |G|^2.
using Step = Eigen::Matrix<double, 9, 1>;

Step step_of(const Vec& s, const Mat& g, Primitive primitive) {
    Step out = Step::Zero();
    out.head<3>() = s;
    if (primitive == Primitive::sphere) {
        out[3] = g.trace() / std::numbers::sqrt3;
        return out;
    }
    out.segment<3>(3) = g.diagonal();
    out.tail<3>() = std::numbers::sqrt2 * Vec(g(0, 1), g(0, 2), g(1, 2));
    return out;
}

Mat shape_of(const Step& step, Primitive primitive) {
    if (primitive == Primitive::sphere) return step[3] / std::numbers::sqrt3 * Mat::Identity();
    const Vec off = step.tail<3>() / std::numbers::sqrt2;
    Mat g;
    g << step[3], off[0], off[1], off[0], step[4], off[2], off[1], off[2], step[5];
    return g;
}

// Linearised constraint normal . step >= bound: the point stays inside.
struct Constraint {
    Step normal;
    double bound, squared, multiplier;
};

// The step nearest to `wanted` that the constraints admit: coordinate ascent in the dual (Hildreth 1957).
Step nearest_admitted(const Step& wanted, std::vector<Constraint>& constraints) {
    Step step = wanted;
    for (const Constraint& c : constraints) step += c.multiplier * c.normal;
    for (int sweep = 0; sweep < kDualSweeps; ++sweep) {
        double change = 0;
        for (Constraint& c : constraints) {
            const double by = std::max(-c.multiplier, (c.bound - c.normal.dot(step)) / c.squared);
            if (by == 0) continue;
            c.multiplier += by;
            step += by * c.normal;
            change = std::max(change, std::abs(by));
        }
        if (change < 1e-6) break;
    }
    return step;
}

class Polisher {
public:
    Polisher(std::vector<Fit>& fits, const Pieces& pieces, const DistanceField& field, const PolishOptions& options)
        : fits_(fits), pieces_(pieces), field_(field), options_(options), random_(options.seed),
          directions_(even_directions(options.directions)), rotated_(directions_.size()), candidates_(fits_.size()),
          held_(fits_.size()), needed_by_(pieces.size(), kNobody) {}

    void run() {
        find_candidates();
        adopt_orphans();
        const int sweeps = std::max(1, options_.sweeps);
        for (int sweep = 0; sweep < sweeps; ++sweep) {
            if (sweep > 0 && sweep % kPolishInterval == 0) find_candidates();
            const double t = static_cast<double>(sweep) / std::max(1, sweeps - 1), left = 1 - kPolishDecay * t;
            step_ = options_.first_step * left * left;
            reward_ = kFirstReward * std::max(0.0, 1 - 2 * t);
            const Mat rotation = random_rotation(random_);
            for (size_t d = 0; d < directions_.size(); ++d) rotated_[d] = rotation * directions_[d];
            for (const std::vector<uint32_t>& group : groups_) update(group);
            keep_best();
            if (options_.progress) options_.progress((sweep + 1.0) / sweeps);
        }
        fits_ = best_;
    }

    std::vector<uint32_t> owners() {
        find_candidates();
        const std::vector<bool> redundant = find_redundant();
        std::vector<uint32_t> owner(pieces_.size(), kNobody);
        std::vector<double> nearest(pieces_.size(), HUGE_VAL);
        for (uint32_t i = 0; i < fits_.size(); ++i)
            for (size_t c = 0; c < candidates_[i].size(); ++c) {
                const uint32_t piece = candidates_[i][c];
                if (!held_[i][c] || redundant[i]) continue;
                const double radial = fits_[i].radial_squared(pieces_.center(piece));
                if (radial < nearest[piece]) nearest[piece] = radial, owner[piece] = i;
            }
        return owner;
    }

private:
    static constexpr uint32_t kNobody = UINT32_MAX;

    // Ellipsoids that need not be there, as others hold all that they hold; small ones go first.
    std::vector<bool> find_redundant() {
        std::vector<uint32_t> order(fits_.size());
        std::iota(order.begin(), order.end(), 0u);
        std::vector<double> volume(fits_.size());
        for (size_t i = 0; i < fits_.size(); ++i) volume[i] = fits_[i].volume();
        std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return volume[a] < volume[b]; });
        std::vector<bool> out(fits_.size(), false);
        for (const uint32_t i : order)
            if (held_alone(i).empty()) out[i] = true, count(i, -1);
        return out;
    }

    // For each ellipsoid, the pieces that it holds or may come to hold; and groups of ellipsoids far apart, that can
    // be moved at the same time.
    void find_candidates() {
        neighbours_ = neighbours_of(fits_, kPolishMargin);
        parallel_for(size_t{0}, fits_.size(), [&](size_t i) {
            const Fit& fit = fits_[i];
            const double shortest_inverse = fit.inverse.norm();
            candidates_[i].clear();
            pieces_.for_each_near(box_of(fit, kPolishMargin), [&](uint32_t piece) {
                const double far = kPolishMargin + pieces_.radius(piece) * shortest_inverse;
                if (fit.radial_squared(pieces_.center(piece)) <= far * far) candidates_[i].push_back(piece);
            });
            find_held(i);
        });
        count_holders();

        std::vector<size_t> group(fits_.size());
        groups_.clear();
        for (uint32_t i = 0; i < fits_.size(); ++i) { // greedy colouring
            std::vector<bool> taken(groups_.size() + 1, false);
            for (const uint32_t j : neighbours_[i])
                if (j < i) taken[group[j]] = true;
            group[i] = static_cast<size_t>(std::find(taken.begin(), taken.end(), false) - taken.begin());
            if (group[i] == groups_.size()) groups_.emplace_back();
            groups_[group[i]].push_back(i);
        }
    }

    void find_held(size_t i) {
        const double shortest_inverse = fits_[i].inverse.norm();
        held_[i].resize(candidates_[i].size());
        for (size_t c = 0; c < candidates_[i].size(); ++c)
            held_[i][c] = holds(fits_[i], shortest_inverse, pieces_, candidates_[i][c]);
    }
    void count_holders() {
        holders_.assign(pieces_.size(), 0);
        for (size_t i = 0; i < fits_.size(); ++i) count(i, +1);
    }
    void count(size_t i, int by) {
        for (size_t c = 0; c < candidates_[i].size(); ++c)
            if (held_[i][c]) holders_[candidates_[i][c]] = static_cast<uint16_t>(holders_[candidates_[i][c]] + by);
    }

    // A piece that nobody holds goes to the ellipsoid whose growth costs the least volume.
    void adopt_orphans() {
        std::vector<double> least(pieces_.size(), HUGE_VAL);
        const double far = kPolishMargin * kPolishMargin * kPolishMargin - 1;
        const auto offer = [&](uint32_t i, uint32_t piece) {
            const double growth = growth_of(fits_[i], piece);
            if (growth < least[piece]) least[piece] = growth, needed_by_[piece] = i;
        };
        for (uint32_t i = 0; i < fits_.size(); ++i)
            pieces_.for_each_near(box_of(fits_[i], kPolishMargin), [&](uint32_t piece) {
                if (holders_[piece] == 0) offer(i, piece);
            });
        for (uint32_t piece = 0; piece < pieces_.size(); ++piece) {
            if (holders_[piece] > 0) continue;
            if (needed_by_[piece] == kNobody || least[piece] > far * fits_[needed_by_[piece]].volume()) // look at all
                for (uint32_t i = 0; i < fits_.size(); ++i) offer(i, piece);
            candidates_[needed_by_[piece]].push_back(piece);
        }
        for (size_t i = 0; i < fits_.size(); ++i) {
            std::sort(candidates_[i].begin(), candidates_[i].end());
            candidates_[i].erase(std::unique(candidates_[i].begin(), candidates_[i].end()), candidates_[i].end());
            find_held(i);
        }
        count_holders();
    }
    double growth_of(const Fit& fit, uint32_t piece) const {
        const double reach = std::max(1.0, fit.reach(pieces_.points(piece)));
        return fit.volume() * (reach * reach * reach - 1);
    }

    std::vector<uint32_t> held_alone(size_t i) const {
        std::vector<uint32_t> out;
        for (size_t c = 0; c < candidates_[i].size(); ++c) {
            const uint32_t piece = candidates_[i][c];
            if (held_[i][c] ? holders_[piece] == 1 : holders_[piece] == 0 && needed_by_[piece] == i)
                out.push_back(piece);
        }
        return out;
    }

    void update(const std::vector<uint32_t>& group) {
        std::vector<Fit> next(group.size());
        parallel_for(size_t{0}, group.size(), [&](size_t n) { next[n] = improved(group[n]); });
        for (size_t n = 0; n < group.size(); ++n) {
            count(group[n], -1);
            fits_[group[n]] = next[n];
        }
        parallel_for(size_t{0}, group.size(), [&](size_t n) { find_held(group[n]); });
        for (const uint32_t i : group) count(i, +1);
    }

    Fit improved(uint32_t i) const {
        const std::vector<uint32_t> alone = held_alone(i);
        if (alone.empty()) return fits_[i];
        const Fit& fit = fits_[i];
        Step wanted = -gradient(i);
        const double length = wanted.norm();
        wanted *= step_ / std::max(length, 1e-3);

        // Cutting planes: what sticks out of the step that the constraints at hand admit becomes a constraint too.
        std::vector<Vec> points;
        const double far = 1 - 4 * step_;
        const double shortest_inverse = fit.inverse.norm();
        for (const uint32_t piece : alone) {
            const double deep = far - pieces_.radius(piece) * shortest_inverse;
            if (deep > 0 && fit.radial_squared(pieces_.center(piece)) < deep * deep) continue;
            for (const Vec& p : pieces_.points(piece))
                if (fit.radial_squared(p) >= far * far) points.push_back(p);
        }
        std::vector<Constraint> constraints;
        std::vector<std::pair<double, size_t>> out;
        Fit next = fit;
        for (int round = 0; round < kCuttingRounds; ++round) {
            out.clear();
            const double border = round == 0 ? far * far : kHeld;
            for (size_t p = 0; p < points.size(); ++p)
                if (const double squared = next.radial_squared(points[p]); squared > border)
                    out.emplace_back(squared, p);
            if (out.empty()) break;
            const size_t most = std::min(out.size(), kCuts);
            std::partial_sort(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(most), out.end(),
                              [](const auto& s, const auto& t) {
                                  return s.first > t.first || (s.first == t.first && s.second < t.second);
                              });
            for (size_t c = 0; c < most; ++c) constraints.push_back(constraint(fit, points[out[c].second]));
            const Step step = nearest_admitted(wanted, constraints);
            next = moved(fit, step.head<3>(), shape_of(step, options_.primitive), options_.min_radius);
        }
        const double by = reach_of(next, pieces_, alone) * (1 + 1e-9);
        const Fit tight = next.scaled(by);
        return within_caps(tight, options_.min_radius) ? tight : next.scaled(std::max(by, 1.0));
    }

    Constraint constraint(const Fit& fit, const Vec& p) const {
        const Vec y = fit.inverse * (p - fit.center);
        const double radial = y.norm();
        const Mat g = y / radial * y.transpose();
        const Step normal = step_of(y / radial, 0.5 * (g + g.transpose()), options_.primitive);
        return {normal, radial - 1, normal.squaredNorm(), 0};
    }

    // Of the volume that ellipsoid i adds, per its own volume.
    Step gradient(uint32_t i) const {
        const Fit& fit = fits_[i];
        Vec s = Vec::Zero();
        Mat g = Mat::Zero();
        for (const Vec& u : rotated_) {
            const Vec x = fit.center + fit.factor * u;
            const bool hidden = std::any_of(neighbours_[i].begin(), neighbours_[i].end(),
                                            [&](uint32_t j) { return fits_[j].radial_squared(x) < 1; });
            if (hidden && !options_.outside) continue;
            const double d = field_(x);
            double w = hidden ? 0 : d > 0 ? options_.objective(d) : -reward_;
            if (options_.outside && d > 0) w -= options_.objective.beta; // E_vol is added in closed form
            s += w * u;
            g += w * u * u.transpose();
        }
        const double share = 3.0 / static_cast<double>(rotated_.size());
        s *= share, g *= share;
        if (options_.outside) {
            const EllipsoidVolume outside = options_.outside(fit);
            s += options_.objective.beta / fit.volume() * outside.d_center;
            g += options_.objective.beta / fit.volume() * outside.d_shape;
        }
        return step_of(s, g, options_.primitive);
    }

    void keep_best() {
        const double error = options_.error(fits_);
        if (best_.empty() || error < best_error_) best_ = fits_, best_error_ = error;
    }

    std::vector<Fit>& fits_;
    const Pieces& pieces_;
    const DistanceField& field_;
    const PolishOptions& options_;
    Random random_;
    const std::vector<Vec> directions_;
    std::vector<Vec> rotated_;
    std::vector<std::vector<uint32_t>> neighbours_, groups_;
    std::vector<std::vector<uint32_t>> candidates_; // of each ellipsoid: pieces
    std::vector<std::vector<uint8_t>> held_;        // of each candidate: does the ellipsoid hold it?
    std::vector<uint16_t> holders_;                 // of each piece
    std::vector<uint32_t> needed_by_;               // of each piece that nobody held at first: who took it
    std::vector<Fit> best_;
    double best_error_ = HUGE_VAL, step_ = 0, reward_ = 0;
};

// What is as thin as steps may make it, though its pieces may be thinner: the least ellipsoid around them instead.
void thin_out(std::vector<Fit>& fits, const Pieces& pieces, std::span<const uint32_t> owner, double min_radius) {
    std::vector<std::vector<uint32_t>> owned(fits.size());
    for (uint32_t piece = 0; piece < owner.size(); ++piece) owned[owner[piece]].push_back(piece);
    parallel_for(size_t{0}, fits.size(), [&](size_t i) {
        Fit& fit = fits[i];
        if (owned[i].empty() || within_caps(fit, 0, kAlmostCapped * kMaxGuidedRatio)) return;
        const Fit least = fit_pieces(pieces, owned[i], min_radius);
        if (least.volume() < fit.volume()) fit = least;
    });
}

} // namespace

void refine_seams(Pieces& pieces, std::span<const Fit> fits) {
    std::vector<bool> settled;
    for (;;) {
        const uint32_t count = pieces.size();
        std::vector<std::vector<uint32_t>> held(fits.size());
        const size_t known = settled.size();
        parallel_for(size_t{0}, fits.size(), [&](size_t i) {
            const Fit large = fits[i].scaled(kNearlyHeld);
            const double shortest_inverse = large.inverse.norm();
            pieces.for_each_near(box_of(large, 1), [&](uint32_t piece) {
                if (piece < known && settled[piece]) return;
                if (holds(large, shortest_inverse, pieces, piece)) held[i].push_back(piece);
            });
        });
        settled.resize(count, false);
        for (const std::vector<uint32_t>& list : held)
            for (const uint32_t piece : list) settled[piece] = true;
        bool any = false;
        for (uint32_t piece = 0; piece < count; ++piece) {
            if (settled[piece]) continue;
            if (pieces.refine(piece))
                any = true;
            else
                settled[piece] = true;
        }
        if (!any) return;
    }
}

std::vector<uint32_t> polish(std::vector<Fit>& fits, const Pieces& pieces, const DistanceField& field,
                             const PolishOptions& options) {
    Polisher polisher(fits, pieces, field, options);
    polisher.run();
    std::vector<uint32_t> owner = polisher.owners();
    thin_out(fits, pieces, owner, options.min_radius);
    return owner;
}

} // namespace prolate

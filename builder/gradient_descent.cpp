#include "builder/gradient_descent.hpp"

#include "builder/border.hpp"
#include "builder/central.hpp"
#include "builder/job.hpp"
#include "builder/random.hpp"

#include "src/symmetric3.hpp"

#include <Eigen/Geometry>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace prolate {
namespace {

constexpr double kLastKappa = 18;
constexpr double kFirstStep = 0.07, kStepDecay = 0.75;  // relative to the radii; falls to 0.4 % of the first
constexpr double kEarlyPull = 2, kAccumulateFrom = 0.3; // until then a penalty on the excess alone, with kappa
// A ball of which the others leave little to see takes shorter steps: so many times that share, of the usual ones. The
// first are half as long as such a cap is high then. Usual ones would hide it now and then, and nothing moves what is.
constexpr double kStepPerShare = 16, kLeastStep = 0.05;
constexpr double kMaxExcess = 0.3;    // radial coordinates beyond 1 count no more than this
constexpr int kNeighbourInterval = 8; // iterations between two searches for neighbours
constexpr double kNeighbourMargin = 1.2;
constexpr size_t kPointStride = 8; // a covered point is looked at every so many iterations
constexpr size_t kPointChunk = 512 * kPointStride;
constexpr double kRelocateUntil = 0.6; // share of the iterations
constexpr int kRelocations = 20;       // rounds of relocation, were they made to the end
constexpr double kUseless = 0.07; // relocated: what it alone covers is less than this much of what it goes to halve

// Gradient descent with momentum, each ellipsoid's step normalised by the size of its recent gradients (Kingma and Ba
// 2015, with one common scale for all nine parameters, so that steps do not depend on the choice of axes).
struct Momentum {
    std::array<double, 9> mean{};
    double square = 0;
};

using Coordinates = std::array<double, 9>; // s, then G: 00, 11, 22, 01, 02, 12

Coordinates coordinates_of(const Vec& s, const Mat& g) {
    return {s.x(), s.y(), s.z(), g(0, 0), g(1, 1), g(2, 2), g(0, 1), g(0, 2), g(1, 2)};
}

// An uncovered point pulls its owner along s, and lengthens it by s y^T.
struct Pulling {
    uint32_t point;
    Eigen::Vector3f s, y; // y: the point in the coordinates that make its owner the unit ball
};

// Eigenvector of the largest eigenvalue of the symmetric `q`, as long as that one's root.
Vec longest_axis(const Mat& q) {
    Matrix3 m;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) m[i][j] = q(int(i), int(j));
    const Eigen3x3 axes = eigen_symmetric(m);
    return std::sqrt(axes.values[0]) * Vec(axes.vectors[0][0], axes.vectors[1][0], axes.vectors[2][0]);
}

class GradientDescent {
public:
    GradientDescent(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
                    std::vector<uint32_t> owner, const DescentOptions& options)
        : fits_(fits), field_(field), points_(points), owner_(std::move(owner)), options_(options),
          random_(options.seed), border_(options.directions), multiplier_(points.size(), 0),
          pulling_((points.size() + kPointChunk - 1) / kPointChunk), momentum_(fits_.size()), moving_(fits_.size()) {
        fits_.insert(fits_.end(), options.fixed.begin(), options.fixed.end());
    }

    void run() {
        std::vector<Fit> next = fits_;
        for (int iteration = 0; iteration < options_.iterations; ++iteration) {
            checkpoint();
            const double t = static_cast<double>(iteration) / std::max(1, options_.iterations - 1);
            bool look = iteration % kNeighbourInterval == 0;
            if (options_.relocate && t < kRelocateUntil && iteration > 0 &&
                iteration % std::max(1, options_.iterations / kRelocations) == 0)
                look = relocate() || look;
            if (look) {
                find_neighbours();
                find_lost_points();
            }
            schedule(t);
            border_.turn(random_rotation(random_));
            update_points(static_cast<size_t>(iteration), t > kAccumulateFrom);
            parallel_for(size_t{0}, moving_, [&](size_t i) { next[i] = step(i); });
            fits_.swap(next);
            decay_mean_ *= kMean, decay_square_ *= kSquare;
            if (options_.progress && iteration % 16 == 0) options_.progress(t);
        }
        fits_.resize(moving_);
    }

private:
    static constexpr double kMean = 0.8, kSquare = 0.95;

    // kappa rises about geometrically and stays at its last value for a fifth of the time; steps fall.
    void schedule(double t) {
        const double rising = std::min(1.0, 1.25 * t);
        double ratio = kLastKappa / options_.first_kappa; // its eighth root:
        for (int i = 0; i < 3; ++i) ratio = std::sqrt(ratio);
        double k = 1 + rising * (ratio - 1);
        for (int i = 0; i < 3; ++i) k *= k;
        kappa_ = options_.first_kappa * k;
        const double s = (1 - kStepDecay * t) * (1 - kStepDecay * t);
        step_ = kFirstStep * s * s * std::min(1.0, 10 / options_.first_kappa);
    }

    // Until the next search, those that may come to touch. Boxes of slanted ellipsoids meet where these are far apart.
    void find_neighbours() {
        neighbours_ = neighbours_of(fits_, kNeighbourMargin);
        parallel_for(size_t{0}, moving_, [&](size_t i) {
            std::vector<std::pair<double, uint32_t>> near;
            for (const uint32_t other : neighbours_[i])
                if (const double d = depth(fits_[i], fits_[other], kNeighbourMargin);
                    d >= 0 && depth(fits_[other], fits_[i], kNeighbourMargin) >= 0)
                    near.emplace_back(-d, other);
            std::ranges::sort(near); // those that hide most first
            neighbours_[i].clear();
            for (const auto& [height, other] : near) neighbours_[i].push_back(other);
        });
    }

    Fit step(size_t i) {
        Vec s = Vec::Zero();
        Mat g = Mat::Zero();
        const Fit& fit = fits_[i];
        const std::span<const Vec> directions = border_.directions();
        const std::vector<uint32_t> hidden = border_.hidden(fit, fits_, neighbours_[i]);
        size_t seen = 0;
        for (size_t n = 0; n < directions.size(); ++n) {
            if (hidden[n]) continue;
            ++seen;
            const Vec& u = directions[n];
            const double d = field_(fit.center + fit.factor * u), w = d > 0 ? options_.objective(d) : -kappa_;
            s += w * u;
            g += w * u * u.transpose();
        }
        const double share = 3.0 / static_cast<double>(directions.size()); // of the ellipsoid's own volume
        Coordinates gradient = coordinates_of(share * s, share * g);
        for (size_t k = 0; k < gradient.size(); ++k) gradient[k] -= pull_[i][k];
        double most = step_;
        if (options_.primitive == Primitive::sphere) {
            const double growth = (gradient[3] + gradient[4] + gradient[5]) / 3;
            gradient = {gradient[0], gradient[1], gradient[2], growth, growth, growth};
            most *= std::clamp(kStepPerShare * static_cast<double>(seen) / static_cast<double>(directions.size()),
                               kLeastStep, 1.0);
        }
        Momentum& m = momentum_[i];
        double square = 0;
        for (size_t k = 0; k < 9; ++k) {
            m.mean[k] = kMean * m.mean[k] + (1 - kMean) * gradient[k];
            square += gradient[k] * gradient[k] / 9;
        }
        m.square = kSquare * m.square + (1 - kSquare) * square;
        const double by = -most / (1 - decay_mean_) / (std::sqrt(m.square / (1 - decay_square_)) + 1e-6);
        const auto& v = m.mean;
        Mat change;
        change << v[3], v[6], v[7], v[6], v[4], v[8], v[7], v[8], v[5];
        return moved(fit, by * Vec(v[0], v[1], v[2]), by * change, options_.min_radius);
    }

    // Who covers each point, how hard those that nobody covers pull, and on whom.
    void update_points(size_t iteration, bool accumulating) {
        const double rate = (accumulating ? options_.pull : kEarlyPull * kappa_) * static_cast<double>(moving_) /
                            static_cast<double>(std::max<size_t>(1, points_.size()));
        parallel_for(size_t{0}, pulling_.size(), [&](size_t chunk) {
            std::vector<Pulling>& pulling = pulling_[chunk];
            size_t kept = 0;
            for (Pulling one : pulling)
                if (update(one, rate, accumulating)) pulling[kept++] = one;
            pulling.resize(kept);
            const size_t end = std::min(points_.size(), (chunk + 1) * kPointChunk);
            for (size_t p = chunk * kPointChunk + iteration % kPointStride; p < end; p += kPointStride) {
                if (multiplier_[p] > 0) continue; // it is there
                Pulling one{static_cast<uint32_t>(p), {}, {}};
                if (update(one, rate, accumulating)) pulling.push_back(one);
            }
        });
        pull_.assign(moving_, {});
        for (const std::vector<Pulling>& pulling : pulling_)
            for (const Pulling& one : pulling) {
                const Vec s = one.s.cast<double>(), y = one.y.cast<double>();
                Coordinates& sum = pull_[owner_[one.point]];
                for (int k = 0; k < 3; ++k) sum[size_t(k)] += s[k], sum[size_t(k) + 3] += s[k] * y[k];
                sum[6] += s[0] * y[1], sum[7] += s[0] * y[2], sum[8] += s[1] * y[2]; // s and y are parallel
            }
    }

    // Does the point pull? Among its owner and the owner's neighbours, the one that has it most centrally is its owner.
    bool update(Pulling& one, double rate, bool accumulating) {
        const Vec& x = points_[one.point];
        uint32_t& owner = owner_[one.point];
        double nearest = fits_[owner].radial_squared(x);
        if (nearest > 1)
            for (const uint32_t other : neighbours_[owner]) // of the one that owned it, whoever does next
                if (const double radial = fits_[other].radial_squared(x); radial < nearest && other < moving_)
                    nearest = radial, owner = other;
        float& multiplier = multiplier_[one.point];
        const double far = std::sqrt(nearest), before = accumulating ? double{multiplier} : 0;
        multiplier = static_cast<float>(std::max(0.0, before + rate * std::min(far - 1, kMaxExcess)));
        if (multiplier == 0) return false;
        const Vec y = fits_[owner].radial(x);
        one.y = y.cast<float>(), one.s = (double{multiplier} / std::max(far, 1e-30) * y).cast<float>();
        return true;
    }

    // Points whose owner has moved away for good look for the most central one of all.
    void find_lost_points() {
        constexpr double kLost = 3;
        const CentralTree tree(std::span<const Fit>(fits_).first(moving_));
        tbb::parallel_for(tbb::blocked_range<size_t>(0, points_.size(), 4096), [&](const auto& range) {
            for (size_t p = range.begin(); p != range.end(); ++p) {
                const double radial = fits_[owner_[p]].radial_squared(points_[p]);
                if (radial >= kLost * kLost) owner_[p] = tree.find(points_[p], radial).value_or(owner_[p]);
            }
        });
    }

    // Ellipsoids that alone cover little go to halve those that stick out most.
    bool relocate() {
        const auto volumes = exclusive_volumes();
        const auto &covers = volumes.first, &outside = volumes.second; // clang 14 captures no structured bindings
        std::vector<uint32_t> by_use(fits_.size()), by_need(fits_.size());
        std::iota(by_use.begin(), by_use.end(), 0u);
        by_need = by_use;
        std::stable_sort(by_use.begin(), by_use.end(), [&](uint32_t a, uint32_t b) { return covers[a] < covers[b]; });
        std::stable_sort(by_need.begin(), by_need.end(),
                         [&](uint32_t a, uint32_t b) { return outside[a] > outside[b]; });
        const std::span<const uint32_t> family = options_.family;
        std::vector<bool> done(fits_.size(), false);
        size_t made = 0;
        const size_t limit = std::max<size_t>(1, fits_.size() / 16);
        for (const uint32_t from : by_use) {
            if (made == limit) break;
            const auto to = std::find_if(by_need.begin(), by_need.end(), [&](uint32_t b) {
                return !done[b] && b != from && (family.empty() || family[b] == family[from]);
            });
            if (to == by_need.end() || done[from]) continue;
            if (covers[from] > kUseless * outside[*to]) {
                if (family.empty()) break;
                continue;
            }
            done[from] = done[*to] = true, ++made;
            halve(*to, from);
        }
        return made > 0;
    }

    // Ellipsoid `b` becomes one half of itself, `a` the other.
    void halve(uint32_t b, uint32_t a) {
        if (options_.primitive != Primitive::sphere || !halve_ball(b, a)) {
            const Fit whole = fits_[b];
            const Mat q = whole.factor * whole.factor.transpose();
            const Vec longest = longest_axis(q);
            const Mat half = q - 0.65 * longest * longest.transpose();
            for (const auto& [i, side] : {std::pair{b, -0.45}, {a, 0.45}})
                fits_[i] =
                    as_primitive(capped(whole.center + side * longest, half, options_.min_radius), options_.primitive);
        }
        momentum_[a] = momentum_[b] = {};
    }

    // The same of a ball, which has no longest axis: what has one is the part of the surface that it alone holds, maybe
    // a small cap. Each half moves as the middle of its side of that part does, and just holds it, but is no larger
    // than the whole: of a part all around it, halves would grow without end. False if there are too few points to
    // tell.
    bool halve_ball(uint32_t b, uint32_t a) {
        constexpr size_t kLeast = 8;
        const Fit whole = fits_[b];
        std::vector<Vec> alone;
        Vec middle = Vec::Zero();
        for (const Vec& p : points_) {
            if (whole.radial_squared(p) >= 1) continue;
            const auto holds = [&](uint32_t i) { return fits_[i].radial_squared(p) < 1; };
            if (std::ranges::none_of(neighbours_[b], holds)) alone.push_back(p), middle += p;
        }
        if (alone.size() < kLeast) return false;
        middle /= static_cast<double>(alone.size());
        Mat spread = Mat::Zero();
        for (const Vec& p : alone) spread += (p - middle) * (p - middle).transpose();
        const Vec axis = longest_axis(spread);
        const auto below = [&](const Vec& p) { return axis.dot(p - middle) < 0; };
        const auto low = static_cast<size_t>(std::partition(alone.begin(), alone.end(), below) - alone.begin());
        const std::span<const Vec> all(alone);
        for (const auto& [i, side] : {std::pair{b, all.first(low)}, {a, all.subspan(low)}}) {
            Vec by = Vec::Zero();
            for (const Vec& p : side) by += (p - middle) / static_cast<double>(side.size());
            double radius = options_.min_radius;
            for (const Vec& p : side) radius = std::max(radius, (p - whole.center - by).norm());
            fits_[i] = {whole.center + by, std::min(radius, whole.factor(0, 0)) * Mat::Identity()};
        }
        return true;
    }

    // For each ellipsoid, the nodes of the field that it alone covers, inside and outside the solid.
    std::pair<std::vector<double>, std::vector<double>> exclusive_volumes() const {
        const auto& size = field_.size();
        constexpr uint32_t kNone = UINT32_MAX, kSeveral = UINT32_MAX - 1;
        std::vector<uint32_t> coverer(field_.values().size(), kNone);
        for (uint32_t i = 0; i < fits_.size(); ++i) {
            const Vec half = fits_[i].half_extents();
            std::array<int, 3> low, high;
            for (int a = 0; a < 3; ++a) {
                const double first = (fits_[i].center[a] - half[a] - field_.origin()[a]) / field_.pitch();
                const double last = (fits_[i].center[a] + half[a] - field_.origin()[a]) / field_.pitch();
                const double end = size[static_cast<size_t>(a)];
                low[static_cast<size_t>(a)] = static_cast<int>(std::clamp(std::ceil(first), 0.0, end));
                high[static_cast<size_t>(a)] = static_cast<int>(std::clamp(std::floor(last), -1.0, end - 1));
            }
            for (int x = low[0]; x <= high[0]; ++x)
                for (int y = low[1]; y <= high[1]; ++y)
                    for (int z = low[2]; z <= high[2]; ++z)
                        if (fits_[i].radial_squared(field_.origin() + field_.pitch() * Vec(x, y, z)) <= 1) {
                            uint32_t& by = coverer[field_.index(x, y, z)];
                            by = by == kNone ? i : kSeveral;
                        }
        }
        std::pair<std::vector<double>, std::vector<double>> out;
        out.first.assign(fits_.size(), 0), out.second.assign(fits_.size(), 0);
        for (size_t v = 0; v < coverer.size(); ++v)
            if (coverer[v] < kSeveral) ++(field_.values()[v] < 0 ? out.first : out.second)[coverer[v]];
        return out;
    }

    std::vector<Fit>& fits_;
    const DistanceField& field_;
    std::span<const Vec> points_;
    std::vector<uint32_t> owner_;
    const DescentOptions& options_;
    Random random_;
    BorderSamples border_;
    std::vector<float> multiplier_;             // of each point
    std::vector<std::vector<Pulling>> pulling_; // by chunks of points
    std::vector<Coordinates> pull_;             // of all points on each ellipsoid
    std::vector<Momentum> momentum_;
    const size_t moving_;                                // the first so many do
    double decay_mean_ = kMean, decay_square_ = kSquare; // powers of the above: what is missing from young averages
    std::vector<std::vector<uint32_t>> neighbours_;
    double kappa_ = 1, step_ = kFirstStep;
};

} // namespace

void descend(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
             std::vector<uint32_t> owner, const DescentOptions& options) {
    GradientDescent(fits, field, points, std::move(owner), options).run();
}

Fit as_primitive(const Fit& fit, Primitive primitive) {
    if (primitive == Primitive::ellipsoid) return fit;
    return {fit.center, Mat(std::cbrt(fit.factor.determinant()) * Mat::Identity())};
}

Fit moved(const Fit& fit, const Vec& s, const Mat& g, double min_radius) {
    const Mat factor = fit.factor * (Mat::Identity() + g);
    const Vec center = fit.center + fit.factor * s;
    const Fit out(center, cholesky(factor * factor.transpose()));
    return within_caps(out, min_radius) ? out : capped(center, factor * factor.transpose(), min_radius);
}

std::vector<std::vector<uint32_t>> neighbours_of(std::span<const Fit> fits, double margin) {
    // Sweep and prune along the axis in which the centers spread most.
    Box box;
    for (const Fit& fit : fits) box.add(fit.center);
    int axis = 0;
    box.size().maxCoeff(&axis);
    std::vector<Vec> half(fits.size());
    std::vector<uint32_t> order(fits.size());
    std::iota(order.begin(), order.end(), 0u);
    for (size_t i = 0; i < fits.size(); ++i) half[i] = margin * fits[i].half_extents();
    const auto low = [&](uint32_t i) { return fits[i].center[axis] - half[i][axis]; };
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return low(a) < low(b); });
    std::vector<std::vector<uint32_t>> out(fits.size());
    for (size_t a = 0; a < order.size(); ++a) {
        const uint32_t i = order[a];
        const double end = fits[i].center[axis] + half[i][axis];
        for (size_t b = a + 1; b < order.size() && low(order[b]) <= end; ++b) {
            const uint32_t j = order[b];
            const Vec gap = (fits[i].center - fits[j].center).cwiseAbs() - half[i] - half[j];
            if ((gap.array() <= 0).all()) out[i].push_back(j), out[j].push_back(i);
        }
    }
    for (std::vector<uint32_t>& list : out) std::sort(list.begin(), list.end());
    return out;
}

} // namespace prolate

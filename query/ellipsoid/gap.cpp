#include "query/ellipsoid/gap.hpp"

#include "query/ellipsoid/symmetric.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr double kLargestStep = 1.8; // in logarithms of rho and sigma
constexpr double kSmallestLimit = 0.05;
constexpr double kDeep = 0.7; // scaled by this about their centers, the bodies would still touch
constexpr double kSmallestStep = 0x1p-50;
// Distances are found to this share of the lengths that enter, before they are compared with a margin.
constexpr double kDistanceTolerance = 1e-9;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

dvec3 unit(const dvec3& v) { // without overflow or underflow; NaN for 0
    const double scale = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    const dvec3 w = v / scale;
    return w / glm::length(w);
}

// The gap along a unit normal, and all that follows from it.
struct Along {
    dvec3 n;
    double a, b, g; // widths of the bodies, gap
    dvec3 qa, qb;   // Q1 n, Q2 n
    dvec3 between;  // x2 - x1: the gradient of g
};

// Unit vector along which a matrix is about thinnest, from its adjugate.
dvec3 thinnest(const dmat3& adjugate) {
    int best = 0;
    for (int i = 1; i < 3; ++i)
        if (adjugate[i][i] > adjugate[best][best]) best = i;
    return unit(adjugate[best]);
}

// log y and exp x, near enough for a step, from basic operations: the same bits everywhere. They are inverse to each
// other, and the first keeps to [-2, 2].
double rough_log(double y) {
    return 2 * (y - 1) / (y + 1);
}
double rough_exp(double x) {
    return (2 + x) / (2 - x);
}

class DirectionSearch {
public:
    DirectionSearch(const PlacedEllipsoid& a, const PlacedEllipsoid& b)
        : a_(a), b_(b), r_(b.center - a.center), q1_(a.factor * glm::transpose(a.factor)),
          q2_(b.factor * glm::transpose(b.factor)), scale_(a.reach + b.reach), slack_(kSeparationMargin * scale_) {}

    // Climbs g until the bounds meet, or until the bodies are known to overlap, or to be farther apart than decide_at_,
    // or not.
    void climb(double tolerance, const dvec3& start_normal) {
        double rho = std::sqrt(trace(q1_) / trace(q2_)); // that of two spheres
        const double width = std::sqrt(trace(q1_) / 3);
        double sigma = width * std::max(glm::length(r_) - width - width / rho, 0.0);
        best_.g = -kInfinity;
        if (glm::dot(start_normal, start_normal) > 0) {
            best_ = along(unit(start_normal));
            if (settled(tolerance)) return;
            rho = best_.a / best_.b, sigma = best_.a * std::max(best_.g, 0.0);
        }
        double low = 0, high = kInfinity; // bracket of Perram and Wertheim's rho, as long as no plane is found
        double best_rho = rho, best_sigma = sigma;
        double limit = kLargestStep; // of Newton's steps: halved where they go too far, so that they learn
        bool substituted = false;
        while (out_.evaluations < kMaxNewtonEvaluations && propose(rho, sigma)) {
            const Along x = along(direction_);
            if (settled(tolerance)) return;
            const bool better = x.g > best_.g;
            if (better) best_ = x, best_rho = rho, best_sigma = sigma;
            if (!(best_.g > 0)) { // no plane yet: as in separation.cpp
                if (sigma == 0) {
                    if (common_point(x, rho)) return;
                    (x.a > rho * x.b ? low : high) = rho;
                    const double before = rho;
                    newton(x, rho, sigma);
                    if (!(rho > low && rho < high)) rho = std::sqrt(low * high);
                    if (!(std::abs(rho - before) > kSmallestStep * before)) return;
                }
                sigma = 0;
            } else if (better && newton(x, rho, sigma, limit)) {
                limit = std::min(2 * limit, kLargestStep), substituted = false;
            } else if (!better && !substituted && limit > kSmallestLimit) { // too far: half-way back
                rho = std::sqrt(rho * best_rho), sigma = std::sqrt(sigma * best_sigma);
                limit /= 2;
            } else if (better || !substituted) {
                rho = best_.a / best_.b, sigma = best_.a * best_.g;
                limit = kLargestStep, substituted = true;
            } else {
                return; // the substitution did not raise g: it has all its digits
            }
        }
        // One in a thousand pairs of thin bodies zigzags: their gap, which is concave around its maximum, is climbed
        // directly.
        while (best_.g > 0 && out_.evaluations < kMaxGapEvaluations && !settled(tolerance))
            if (!step_on_sphere(0)) return;
    }

    bool settled(double tolerance) const {
        return out_.upper - out_.lower <= tolerance || out_.lower > decide_at_ || out_.upper <= decide_at_;
    }

    // Climbs from best_, where g < 0.
    void climb_inside(double tolerance) {
        tolerance = std::max(tolerance, slack_);
        double rho = 0, sigma = 0;
        bool stepped = false; // (rho, sigma) come from a step of Newton's method
        while (out_.evaluations < kMaxGapEvaluations) {
            const double before = best_.g;
            if (!stepped) rho = best_.a / best_.b, sigma = best_.a * best_.g;
            stepped = false;
            if (propose(rho, sigma)) {
                const Along x = along(direction_);
                const bool better = x.g > before;
                if (better) best_ = x;
                if (better && x.g - before > tolerance) {
                    stepped = newton(x, rho, sigma);
                    continue;
                }
            }
            if (!step_on_sphere(tolerance)) return;
        }
    }

    // Directions in which deep bodies may separate sooner than along the normal of Perram and Wertheim's plane.
    void try_thin_directions() {
        const dmat3 sum = q1_ * (1 / trace(q1_)) + q2_ * (1 / trace(q2_));
        for (const dmat3& q : {q1_, q2_, sum}) {
            dvec3 n = thinnest(adjugate(q * (1 / trace(q))));
            if (glm::dot(n, r_) < 0) n = -n;
            consider(n);
        }
    }
    void consider(const dvec3& n) {
        const Along x = along(n);
        if (x.g > best_.g) best_ = x;
    }

    Along along(const dvec3& n) {
        ++out_.evaluations;
        Along x{};
        x.n = n;
        const dvec3 wa = n * a_.factor, wb = n * b_.factor; // L^T n
        x.a = glm::length(wa), x.b = glm::length(wb);
        x.qa = a_.factor * wa, x.qb = b_.factor * wb;
        x.g = glm::dot(n, r_) - x.a - x.b;
        x.between = r_ - x.qa / x.a - x.qb / x.b;
        // Keeps the best lower bound with its normal, the best upper bound with its points. A NaN is never better.
        if (x.g - slack_ > out_.lower) out_.lower = x.g - slack_, out_.normal = x.n;
        const double length = glm::length(x.between) + slack_;
        if (length < out_.upper) {
            out_.upper = length;
            take_points(x);
        }
        return x;
    }
    void take_points(const Along& x) { out_.point_a = a_.center + x.qa / x.a, out_.point_b = b_.center - x.qb / x.b; }

    // direction_ = n(rho, sigma) of the header; false if M is not positive definite.
    bool propose(double rho, double sigma) {
        dmat3 m = q1_ + rho * q2_;
        for (int i = 0; i < 3; ++i) m[i][i] += sigma;
        tau_ = trace(m);
        m *= 1 / tau_;
        adjugate_ = adjugate(m);
        det_ = glm::dot(m[0], adjugate_[0]);
        const dvec3 v = adjugate_ * r_;
        direction_ = v == dvec3(0) ? thinnest(adjugate_) : unit(v);
        length_ = glm::dot(v, direction_);
        return tau_ > 0 && trace(adjugate_) > 0 && det_ > 0 && std::isfinite(length_);
    }

    // Moves rho and sigma by a step of Newton's method on log(a / b / rho) and log(a g / sigma), from their values for
    // the direction x that they gave. Without a sign in common, sigma stays out: 0.
    bool newton(const Along& x, double& rho, double& sigma, double limit = kLargestStep) const {
        // dn = -M^-1 (Q2 n rho dlog(rho) + n sigma dlog(sigma)), up to length, which changes nothing.
        const double k = 1 / (det_ * tau_);
        const dvec3 by_rho = adjugate_ * x.qb * (-rho * k), by_sigma = adjugate_ * x.n * (-sigma * k);
        const double f1 = rough_log(x.a / (x.b * rho)), f2 = rough_log(x.a * x.g / sigma);
        // a, b and g belong to n / |n|: what is due to length alone is taken off.
        const auto derivatives = [&](const dvec3& v, double& d1, double& d2) {
            const double longer = glm::dot(v, x.n);
            const double da = glm::dot(x.qa, v) / x.a - x.a * longer, db = glm::dot(x.qb, v) / x.b - x.b * longer;
            const double dg = glm::dot(x.between, v) - x.g * longer;
            d1 = da / x.a - db / x.b, d2 = da / x.a + dg / x.g;
        };
        double j11, j21, j12, j22;
        derivatives(by_rho, j11, j21), derivatives(by_sigma, j12, j22);
        j11 -= 1, j22 -= 1;
        const double determinant = j11 * j22 - j12 * j21;
        double log_rho = (f2 * j12 - f1 * j22) / determinant, log_sigma = (f1 * j21 - f2 * j11) / determinant;
        if (sigma == 0) {
            if (x.g > 0) return false;
            log_rho = -f1 / j11, log_sigma = 0;
        }
        log_rho = std::clamp(log_rho, -limit, limit);
        log_sigma = std::clamp(log_sigma, -limit, limit);
        rho *= rough_exp(log_rho), sigma *= rough_exp(log_sigma);
        return std::isfinite(rho) && std::isfinite(sigma);
    }

    // Certificate (2) of separation.hpp, for sigma = 0: c1 + Q1 s lies in both bodies, s = v / (det tau).
    bool common_point(const Along& x, double rho) {
        const double room = tau_ * (det_ - kOverlapMargin), slack = kOverlapMargin * scale_;
        const double ta = (length_ * x.a + slack * a_.size) / room, tb = rho * (length_ * x.b + slack * b_.size) / room;
        if (!(room > 0 && ta <= 1 && tb <= 1)) return false;
        deep_ = std::max(ta, tb) < kDeep;
        out_.upper = std::min(
            out_.upper,
            -((1 - ta) * least_width(a_.factor, a_.size) + (1 - tb) * least_width(b_.factor, b_.size)) * (1 - 0x1p-40));
        return true;
    }

    // One step of Newton's method on the sphere from best_, made to rise: the matrix is shifted until it is positive
    // definite on the tangent plane, and the step shortened until g rises. False if less than `tolerance` is to be had.
    bool step_on_sphere(double tolerance) {
        const Along x = best_;
        const dvec3 e = unit(glm::cross(x.n, std::abs(x.n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0))),
                    f = glm::cross(x.n, e);
        const dvec3 ea = e * a_.factor, fa = f * a_.factor, eb = e * b_.factor, fb = f * b_.factor;
        const dvec3 na = x.n * a_.factor / x.a, nb = x.n * b_.factor / x.b;
        const auto curvature = [&](const dvec3& ua, const dvec3& va, const dvec3& ub, const dvec3& vb) {
            return (glm::dot(ua, va) - glm::dot(ua, na) * glm::dot(va, na)) / x.a +
                   (glm::dot(ub, vb) - glm::dot(ub, nb) * glm::dot(vb, nb)) / x.b;
        };
        double ee = curvature(ea, ea, eb, eb) + x.g, ff = curvature(fa, fa, fb, fb) + x.g;
        const double ef = curvature(ea, fa, eb, fb);
        const double mean = (ee + ff) / 2, spread = std::sqrt((ee - ff) * (ee - ff) / 4 + ef * ef);
        const double least = 1e-3 * std::max(mean + spread, -x.g), shift = std::max(least - (mean - spread), 0.0);
        ee += shift, ff += shift;
        const double de = glm::dot(x.between, e), df = glm::dot(x.between, f), determinant = ee * ff - ef * ef;
        const double gain = (de * de * ff - 2 * de * df * ef + df * df * ee) / determinant / 2;
        if (!(gain > tolerance)) return false;
        const dvec3 step = e * ((de * ff - df * ef) / determinant) + f * ((df * ee - de * ef) / determinant);
        for (double t = 1; t > 1e-4; t /= 4) {
            consider(unit(x.n + t * step));
            if (best_.g > x.g) return true;
        }
        return false;
    }

    const PlacedEllipsoid& a_;
    const PlacedEllipsoid& b_;
    const dvec3 r_;
    const dmat3 q1_, q2_;
    const double scale_, slack_;
    dmat3 adjugate_;
    double tau_ = 0, det_ = 0, length_ = 0;
    dvec3 direction_;
    bool deep_ = false;
    double decide_at_ = std::numeric_limits<double>::quiet_NaN(); // of climb(): all that is to be known
    Along best_{};
    Gap out_{-kInfinity, kInfinity, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
};

} // namespace

// |det L| / |adj L| is the product of all three semi-axes over at least that of the two larger ones. The determinant is
// wrong by at most 7 u |L|^3 / 5, the minors by 4 u |L|^2; a placed L by 74 u |L|.
double least_width(const dmat3& l, double size) noexcept {
    const dvec3 x = glm::cross(l[1], l[2]), y = glm::cross(l[2], l[0]), z = glm::cross(l[0], l[1]);
    const double det = std::abs(glm::dot(l[0], x)), square = size * size;
    const double minors = std::sqrt(glm::dot(x, x) + glm::dot(y, y) + glm::dot(z, z));
    const double width = (det - 0x1p-51 * square * size) / (minors + 0x1p-50 * square) - kSeparationMargin * size;
    return width > 0 ? width : 0;
}

Gap distance_of(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double tolerance,
                const dvec3& start_normal) noexcept {
    DirectionSearch search(a, b);
    search.climb(tolerance, start_normal);
    return search.out_;
}

bool separated(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double margin) noexcept {
    if (margin != 0) {
        DirectionSearch search(a, b);
        search.decide_at_ = margin;
        search.climb(kDistanceTolerance * (margin + a.size + b.size), {0, 0, 0});
        return search.out_.lower > margin;
    }
    const PairVerdict verdict = test_pair(a, b).verdict;
    return verdict == PairVerdict::separated || (verdict == PairVerdict::unresolved && distance_of(a, b, 0).lower > 0);
}

Gap depth_of(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double tolerance, const dvec3& start_normal) noexcept {
    DirectionSearch search(a, b);
    search.climb(tolerance, {0, 0, 0});
    if (search.deep_) search.try_thin_directions();
    if (glm::dot(start_normal, start_normal) > 0) search.consider(unit(start_normal));
    search.climb_inside(tolerance);
    search.take_points(search.best_);
    return search.out_;
}

} // namespace prolate::query

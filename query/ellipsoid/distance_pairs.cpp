// distance() for batches: the search of gap.hpp in single precision, as many pairs at once as there are lanes.
//
// A lane is finished when one evaluation gives bounds that are near enough. It then stores them, and the group goes on
// until all are finished. Bodies that are found to overlap go on with sigma < 0 towards their depth. What is unfinished
// after kMaxLaneEvaluations goes to double precision. Lanes do not see each other, so that neither answers nor counters
// depend on the neighbours.
//
// Rounding, v = 2^-24, P and slack as in collide_pairs.cpp, except that 6 v |L| is taken off each slack, which is for
// centers that are near each other; s is the sum of both.
//   n                    scaled to length 1 +- 4 v; the gap of n / |n| differs by 5 v |g| <= 5 v P
//   lower bound          g - s - 7 v P for n (collide_pairs.cpp), less 5 v P: 12 v P, and kLengthUnderflow for a and b
//   x1, x2               L (w / |w|) for the float w is exact but for 3 v |L| of the product, 3.5 v |L| of the length
//                        and v |L| of the quotient; what the bodies bring, and all this, is at most the slack
//   x2 - x1              r, two differences and the length: 3 v (|r| + |L1| + |L2|) + 2.5 v |x2 - x1|
//   upper bound          |x2 - x1| + 1.5 s + 4 v |r| + 4 v |x2 - x1|: |L| is less than slack / 8 v
// The certified depth takes t1 = |w| / det with 16 v for its rounding, and t2 from radial_in_b().
#include "query/simd/targets.hpp"

#include <prolate/pairs.hpp>

#include <algorithm>
#include <bit>
#include <span>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/ellipsoid/distance_pairs.cpp"
#include <hwy/foreach_target.h>

#include "query/ellipsoid/pair_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

constexpr uint32_t kMaxDistanceEvaluations = 8;
constexpr float kLargest = 1.8f; // step in logarithms of rho and sigma

HWY_INLINE Float at_least(Float x, float least) { // NaN gives least
    return greater(set(least), x);
}
HWY_INLINE Float bounded_step(Float x) {
    return at_least(choose(x < kLargest, x, set(kLargest)), -kLargest);
}
HWY_INLINE Float rough_exp(Float x) {
    return (2 + x) / (2 - x);
}

// What one evaluation gives to a pair that it finishes.
struct Answer {
    Float lower, upper;
    Float3 normal, point_a, point_b;
};

class DistanceLanes {
public:
    HWY_INLINE DistanceLanes(const WorldEllipsoid* bodies, const IndexPair* pairs, float tolerance)
        : p_(bodies, pairs), tolerance_(set(tolerance)), slack_(p_.slack - 6 * kV * (p_.a.size + p_.b.size)) {
        const Float width_a = p_.a.size * 0.57735f, width_b = p_.b.size * 0.57735f;
        rho_ = best_rho_ = p_.a.size / p_.b.size; // that of two spheres
        sigma_ = width_a * at_least(length(p_.r) - width_a - width_b, 0);
        best_sigma_ = depth_ = set(0), best_gap_ = set(-3e38f);
        inside_ = rho_ < 0; // none
    }

    // One evaluation and the step to the next. True in lanes whose answer is good enough.
    HWY_INLINE Mask evaluate(Answer& out) {
        const Evaluation e(p_, rho_, sigma_);
        const Float3 xa = e.qa * e.over_a, xb = e.qb * e.over_b, between = p_.r - xa - xb;
        const Float3 along{e.n.x * p_.r.x, e.n.y * p_.r.y, e.n.z * p_.r.z};
        const Float g = along.x + along.y + along.z - e.a - e.b, apart = length(between);

        out.lower = g - (slack_ + 12 * kV * one_norm(along) + kLengthUnderflow);
        const Float above = apart + (1.5f * slack_ + 4 * kV * (p_.distance() + apart) + kLengthUnderflow);
        out.upper = choose(inside_, depth_, above);
        out.normal = e.n;
        out.point_a = p_.a.center + xa, out.point_b = p_.b.center - xb;

        // Outside the bounds themselves must meet. Inside, |x2 - x1| and -g meet where n is stationary, and where Q is
        // positive definite that is a minimum of the depth.
        const Float wide = choose(inside_, apart + g, above - out.lower);
        const Mask definite = (e.det > 0) & (trace(e.adj) > 0);
        const Mask finished = (wide <= tolerance_) & definite & (inside_ | (out.lower > 0));
        advance(e, between, g);
        return finished;
    }

private:
    // Q = mu Q1 + lambda Q2 + nu I of trace 1, its adjugate and determinant; m = adj(Q) r, its length, the direction n
    // = m / |m|; and of each body w = L^T n, L w, |w| and its inverse.
    struct Evaluation {
        Float mu, lambda, nu;
        Sym3 q, adj;
        Float det;
        Float3 m;
        Float norm;
        Float3 n, wa, wb, qa, qb;
        Float a, b, over_a, over_b;

        HWY_INLINE Evaluation(const PairLanes& p, Float rho, Float sigma)
            : mu(1 / (trace(p.q1) + rho * trace(p.q2) + 3 * sigma)), lambda(rho * mu), nu(sigma * mu),
              q(plus_diagonal(p.combine(mu, lambda), nu)), adj(adjugate(q)), det(determinant(q, adj)), m(adj * p.r),
              norm(length(m)), n(m * (1 / norm)), wa(transposed_times(p.a.factor, n)),
              wb(transposed_times(p.b.factor, n)), qa(p.a.factor * wa), qb(p.b.factor * wb), a(length(wa)),
              b(length(wb)), over_a(1 / a), over_b(1 / b) {}
    };

    // Steps in the logarithms of rho and sigma.
    struct Steps {
        Float rho, sigma;
        Float rho_alone; // where sigma stays 0
    };
    // Newton's step of gap.cpp. The first index of j is the equation, the second the unknown.
    HWY_INLINE Steps newton(const Evaluation& e, const Float3& between, Float g) const {
        const Float inverse = -1 / e.det;
        const Float3 by_rho = (e.adj * e.qb) * (e.lambda * inverse), by_sigma = (e.adj * e.n) * (e.nu * inverse);
        const Float ag = e.a * g, over_g = 1 / g;
        const Float f1 = 2 * (e.a - rho_ * e.b) / (e.a + rho_ * e.b), f2 = 2 * (ag - sigma_) / (ag + sigma_);
        const auto derivatives = [&](const Float3& v, Float& d1, Float& d2) HWY_ATTR {
            const Float longer = dot(v, e.n);
            const Float da = (dot(e.qa, v) * e.over_a - e.a * longer) * e.over_a,
                        db = (dot(e.qb, v) * e.over_b - e.b * longer) * e.over_b;
            const Float dg = (dot(between, v) - g * longer) * over_g;
            d1 = da - db, d2 = da + dg;
        };
        Float j11, j21, j12, j22;
        derivatives(by_rho, j11, j21), derivatives(by_sigma, j12, j22);
        j11 = j11 - 1, j22 = j22 - 1;
        const Float over = 1 / (j11 * j22 - j12 * j21);
        return {(f2 * j12 - f1 * j22) * over, (f1 * j21 - f2 * j11) * over, 0 - f1 / j11};
    }

    HWY_INLINE void advance(const Evaluation& e, const Float3& between, Float g) {
        const Steps step = newton(e, between, g);

        // Perram and Wertheim's rho alone, as long as there is neither a plane nor a common point.
        const Mask alone = sigma_ == 0, same_side = g * sigma_ > 0;
        const Float scale = e.mu * e.norm;
        const Float ta = scale * (e.a + kLengthUnderflow) / e.det * (1 + 16 * kV),
                    tb = radial_in_b(p_, e.wa * scale, e.det);
        const Mask common = alone & (ta <= 1) & (tb <= 1);
        const Float depth = (ta - 1) / p_.a.thinness + (tb - 1) / p_.b.thinness;
        depth_ = choose(common, depth * (1 - 16 * kV), depth_);
        inside_ = inside_ | common;
        const Mask search = alone & (g <= 0) & !common;

        const Mask better = same_side & (g > best_gap_);
        best_gap_ = choose(better, g, best_gap_);
        best_rho_ = choose(better, rho_, best_rho_), best_sigma_ = choose(better, sigma_, best_sigma_);

        const Float alone_rho = rho_ * rough_exp(bounded_step(step.rho_alone));
        const Float newton_rho = rho_ * rough_exp(bounded_step(step.rho)),
                    newton_sigma = sigma_ * rough_exp(bounded_step(step.sigma));
        const Float half_rho = 0.5f * (rho_ + best_rho_), half_sigma = 0.5f * (sigma_ + best_sigma_);
        const Float there_rho = e.a * e.over_b, there_sigma = e.a * g;
        // Where sigma is 0, search or begin; where it has g's sign, go on by Newton's step, or half-way back if that
        // was too far; else no plane has been found after all.
        rho_ = choose(alone, choose(search, alone_rho, there_rho),
                      choose(same_side, choose(better, newton_rho, half_rho), there_rho));
        sigma_ = choose(alone, choose(search, set(0), there_sigma),
                        choose(same_side, choose(better, newton_sigma, half_sigma), set(0)));
    }

    const PairLanes p_;
    const Float tolerance_;
    const Float slack_; // of distances
    Float rho_, sigma_;
    Float best_rho_, best_sigma_, best_gap_; // where the gap was greatest so far
    Float depth_;                            // minus a certified depth, of lanes inside
    Mask inside_;                            // a common point is known
};

PairStats distance_pairs(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs,
                         std::span<PairDistance> distances, float tolerance) {
    PairStats stats;
    for (size_t first = 0; first < pairs.size(); first += kFloatLanes) {
        const size_t count = std::min(kFloatLanes, pairs.size() - first);
        IndexPair in_lanes[8];
        for (size_t i = 0; i < kFloatLanes; ++i) in_lanes[i] = pairs[first + std::min(i, count - 1)];
        DistanceLanes lanes(bodies.world.data(), in_lanes, tolerance);
        uint32_t left = (1u << count) - 1;
        for (uint32_t done = 0; left != 0 && done < kMaxDistanceEvaluations; ++done) {
            stats.evaluations += static_cast<uint32_t>(std::popcount(left));
            Answer answer{};
            uint32_t finished = left & bits(lanes.evaluate(answer));
            if (finished == 0) continue;
            left &= ~finished;
            float columns[11][8];
            size_t j = 0;
            for (const Float& x :
                 {answer.lower, answer.upper, answer.normal.x, answer.normal.y, answer.normal.z, answer.point_a.x,
                  answer.point_a.y, answer.point_a.z, answer.point_b.x, answer.point_b.y, answer.point_b.z})
                store_unaligned(x, columns[j++]);
            for (; finished != 0; finished &= finished - 1) {
                const auto i = static_cast<size_t>(std::countr_zero(finished));
                distances[first + i] = {.lower = columns[0][i],
                                        .upper = columns[1][i],
                                        .normal = {columns[2][i], columns[3][i], columns[4][i]},
                                        .point_a = {columns[5][i], columns[6][i], columns[7][i]},
                                        .point_b = {columns[8][i], columns[9][i], columns[10][i]}};
            }
        }
        for (; left != 0; left &= left - 1) {
            const auto i = static_cast<size_t>(std::countr_zero(left));
            const IndexPair& pair = pairs[first + i];
            distances[first + i] = prolate::distance(bodies.shapes[pair.a], bodies.poses[pair.a], bodies.shapes[pair.b],
                                                     bodies.poses[pair.b], tolerance);
            ++stats.in_double;
        }
    }
    return stats;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate {
namespace query {
HWY_EXPORT(distance_pairs);
static PairStats distance_pairs_best(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs,
                                     std::span<PairDistance> distances, float tolerance) {
    return HWY_DYNAMIC_DISPATCH(distance_pairs)(bodies, pairs, distances, tolerance);
}
} // namespace query

PairStats distance(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<PairDistance> distances,
                   float tolerance) noexcept {
    return query::distance_pairs_best(bodies, pairs, distances, tolerance);
}

} // namespace prolate
#endif

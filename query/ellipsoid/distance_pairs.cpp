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
//   lower bound          g - s - 7 v P for n (collide_pairs.cpp), less 5 v P: 12 v P, and kUnderflow for a and b
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

HWY_INLINE F at_least(F x, float least) { // NaN gives least
    return hn::IfThenElse(hn::Gt(x, set(least)), x, set(least));
}
HWY_INLINE F bounded_step(F x) {
    return at_least(choose(hn::Lt(x, set(kLargest)), x, set(kLargest)), -kLargest);
}
HWY_INLINE F rough_exp(F x) {
    return (set(2) + x) / (set(2) - x);
}

// What one evaluation gives to a pair that it finishes.
struct Answer {
    F lower, upper;
    Vector normal, point_a, point_b;
};

class DistanceLanes {
public:
    HWY_INLINE DistanceLanes(const WorldEllipsoid* bodies, const IndexPair* pairs, float tolerance)
        : p_(bodies, pairs), tolerance_(set(tolerance)), slack_(p_.slack - set(6 * kV) * (p_.a.size + p_.b.size)) {
        const F third = set(0.57735f), width_a = p_.a.size * third, width_b = p_.b.size * third;
        rho_ = best_rho_ = p_.a.size / p_.b.size; // that of two spheres
        sigma_ = width_a * at_least(hn::Sqrt(dot(p_.r, p_.r)) - width_a - width_b, 0);
        best_sigma_ = depth_ = set(0), best_gap_ = set(-3e38f);
        inside_ = hn::Lt(rho_, set(0)); // none
    }

    // One evaluation and the step to the next. True in lanes whose answer is good enough.
    HWY_INLINE Mask evaluate(Answer& out) {
        const F mu = set(1) / (trace(p_.q1) + rho_ * trace(p_.q2) + set(3) * sigma_), lambda = rho_ * mu,
                nu = sigma_ * mu;
        Symmetric q = p_.combine(mu, lambda);
        q.xx = q.xx + nu, q.yy = q.yy + nu, q.zz = q.zz + nu;
        const Symmetric adj = adjugate(q);
        const F det = q.xx * adj.xx + q.xy * adj.xy + q.xz * adj.xz;
        const Vector m = adj * p_.r;
        const F length = hn::Sqrt(dot(m, m));
        const Vector n = m * (set(1) / length);
        const Vector wa = p_.a.transposed_times(n), wb = p_.b.transposed_times(n);
        const F a = hn::Sqrt(dot(wa, wa)), b = hn::Sqrt(dot(wb, wb)), over_a = set(1) / a, over_b = set(1) / b;
        const Vector qa = p_.a.times(wa), qb = p_.b.times(wb), xa = qa * over_a, xb = qb * over_b;
        const Vector between{p_.r.x - xa.x - xb.x, p_.r.y - xa.y - xb.y, p_.r.z - xa.z - xb.z};
        const F px = n.x * p_.r.x, py = n.y * p_.r.y, pz = n.z * p_.r.z;
        const F absolute = hn::Abs(px) + hn::Abs(py) + hn::Abs(pz);
        const F g = px + py + pz - a - b, apart = hn::Sqrt(dot(between, between));

        out.lower = g - (slack_ + set(12 * kV) * absolute + set(kUnderflow));
        const F above = apart + (set(1.5f) * slack_ + set(4 * kV) * (p_.distance() + apart) + set(kUnderflow));
        out.upper = choose(inside_, depth_, above);
        out.normal = n;
        out.point_a = {p_.a.center.x + xa.x, p_.a.center.y + xa.y, p_.a.center.z + xa.z};
        out.point_b = {p_.b.center.x - xb.x, p_.b.center.y - xb.y, p_.b.center.z - xb.z};

        // Outside the bounds themselves must meet. Inside, |x2 - x1| and -g meet where n is stationary, and where M is
        // positive definite that is a minimum of the depth.
        const F wide = choose(inside_, apart + g, above - out.lower);
        const Mask definite = hn::And(hn::Gt(det, set(0)), hn::Gt(trace(adj), set(0)));
        const Mask finished =
            hn::And(hn::Le(wide, tolerance_), hn::And(definite, hn::Or(inside_, hn::Gt(out.lower, set(0)))));
        advance(mu, lambda, nu, adj, det, length, n, wa, a, b, over_a, over_b, qa, qb, between, g);
        return finished;
    }

private:
    HWY_INLINE void advance(F mu, F lambda, F nu, const Symmetric& adj, F det, F length, const Vector& n,
                            const Vector& wa, F a, F b, F over_a, F over_b, const Vector& qa, const Vector& qb,
                            const Vector& between, F g) {
        // Newton's step of gap.cpp. The first index of j is the equation, the second the unknown.
        const F inverse = set(-1) / det;
        const Vector by_rho = (adj * qb) * (lambda * inverse), by_sigma = (adj * n) * (nu * inverse);
        const F ag = a * g, over_g = set(1) / g;
        const F f1 = set(2) * (a - rho_ * b) / (a + rho_ * b), f2 = set(2) * (ag - sigma_) / (ag + sigma_);
        const auto derivatives = [&](const Vector& v, F& d1, F& d2) HWY_ATTR {
            const F longer = dot(v, n);
            const F da = (dot(qa, v) * over_a - a * longer) * over_a, db = (dot(qb, v) * over_b - b * longer) * over_b;
            const F dg = (dot(between, v) - g * longer) * over_g;
            d1 = da - db, d2 = da + dg;
        };
        F j11, j21, j12, j22;
        derivatives(by_rho, j11, j21), derivatives(by_sigma, j12, j22);
        j11 = j11 - set(1), j22 = j22 - set(1);
        const F over = set(1) / (j11 * j22 - j12 * j21);
        const F both_rho = (f2 * j12 - f1 * j22) * over, both_sigma = (f1 * j21 - f2 * j11) * over;

        // Perram and Wertheim's rho alone, as long as there is neither a plane nor a common point.
        const Mask alone = hn::Eq(sigma_, set(0)), same_side = hn::Gt(g * sigma_, set(0));
        const F scale = mu * length;
        const F ta = scale * (a + set(kUnderflow)) / det * set(1 + 16 * kV), tb = radial_in_b(p_, wa * scale, det);
        const Mask common = hn::And(alone, hn::And(hn::Le(ta, set(1)), hn::Le(tb, set(1))));
        const F depth = (ta - set(1)) / p_.a.thinness + (tb - set(1)) / p_.b.thinness;
        depth_ = choose(common, depth * set(1 - 16 * kV), depth_);
        inside_ = hn::Or(inside_, common);
        const Mask search = hn::And(alone, hn::Le(g, set(0)));

        const Mask better = hn::And(same_side, hn::Gt(g, best_gap_));
        best_gap_ = choose(better, g, best_gap_);
        best_rho_ = choose(better, rho_, best_rho_), best_sigma_ = choose(better, sigma_, best_sigma_);

        const F alone_rho = rho_ * rough_exp(bounded_step(set(0) - f1 / j11));
        const F newton_rho = rho_ * rough_exp(bounded_step(both_rho)),
                newton_sigma = sigma_ * rough_exp(bounded_step(both_sigma));
        const F half_rho = set(0.5f) * (rho_ + best_rho_), half_sigma = set(0.5f) * (sigma_ + best_sigma_);
        const F there_rho = a * over_b, there_sigma = ag;
        // Where sigma is 0, search or begin; where it has g's sign, go on by Newton's step, or half-way back if that
        // was too far; else no plane has been found after all.
        rho_ = choose(alone, choose(hn::AndNot(common, search), alone_rho, there_rho),
                      choose(same_side, choose(better, newton_rho, half_rho), there_rho));
        sigma_ = choose(alone, choose(hn::AndNot(common, search), set(0), there_sigma),
                        choose(same_side, choose(better, newton_sigma, half_sigma), set(0)));
    }

    const Pairs p_;
    const F tolerance_;
    const F slack_; // of distances
    F rho_, sigma_;
    F best_rho_, best_sigma_, best_gap_; // where the gap was greatest so far
    F depth_;                            // minus a certified depth, of lanes inside
    Mask inside_;                        // a common point is known
};

PairStats distance_pairs(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs,
                         std::span<PairDistance> distances, float tolerance) {
    PairStats stats;
    for (size_t first = 0; first < pairs.size(); first += width()) {
        const size_t count = std::min(width(), pairs.size() - first);
        IndexPair in_lanes[8];
        for (size_t i = 0; i < width(); ++i) in_lanes[i] = pairs[first + std::min(i, count - 1)];
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
            for (const F& x :
                 {answer.lower, answer.upper, answer.normal.x, answer.normal.y, answer.normal.z, answer.point_a.x,
                  answer.point_a.y, answer.point_a.z, answer.point_b.x, answer.point_b.y, answer.point_b.z})
                hn::StoreU(x, Lanes(), columns[j++]);
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

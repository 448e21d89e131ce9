// collide() for batches: the test of separation.hpp in single precision, as many pairs at once as there are lanes.
//
// All pairs are evaluated once. Where most of a group stay undecided the group goes on, else its undecided pairs are
// put on a list, to be evaluated in full groups. A pair undecided after kMaxLaneEvaluations goes to double precision.
// What a pair goes through does not depend on its neighbours, so that neither do its answer and the counters.
//
// Rounding, v = 2^-24. Each body comes with a bound of its own errors (pairs.cpp: slack); its floats are exact
// otherwise. Norms as in separation.hpp; n is m below, of any length.
//   r = c2 - c1          |dri| <= v |ri|, besides what the centers are wrong by
//   p = n.r              3 v P, P = |nx rx| + |ny ry| + |nz rz| <= |n| |r|; with that of r 4 v P
//   a = |L1^T n|         L1^T n: at most three products a component, 3 v |n| |L1|; length: 2.5 v a. In all 5.5 v |n|
//   |L1| p - a - b            the first difference is wrong by v (P + a), the second by v (P + a + b)
// so p - a - b is wrong by at most 6 v P + 7.5 v |n| (|L1| + |L2|), besides what the bodies bring. The test asks for
// more than 7 v P and (|nx| + |ny| + |nz|) times each body's slack, which contains 8.5 v |L|: the rest pays for the
// rounding of the bounds. Squares that underflow make a and b too small by at most 2^-62 each: kUnderflow.
//
// Overlap, the quick test: mu and lambda as computed are exact numbers; N = mu Q1 + lambda Q2, with Q of the exact
// bodies, has trace 1 +- 6 v, and certificate (2) reads mu |L1^T m| <= det N and lambda |L2^T m| <= det N, m = adj(N)
// r.
//   Q1, Q2               products 3 v tau_i, the placed factors 2.1 v tau_i
//   N                    two products and a sum: |dN| <= 7.2 v
//   adj(N)               2 |N| |dN| + 2 v |N|^2: |d adj| <= 17 v
//   det N                one row of each: 17 v + 3 v + 7.2 v |adj| <= 24 v
//   m                    17 v |r| + 3 v |adj| |r| + |adj| |dr|, |adj| <= 1/2: |dm| <= 20 v |r| + slacks / 2
//   |L1^T m|             20 v |r| |L1| + |m| (5.5 v + 1.1 v) |L1|: (24 v |r| + slacks / 2) |L1|
// The test takes 32 v for 24 v, |rx| + |ry| + |rz| for |r|, and slack / 8 v for |L|: the rest pays for its own
// rounding.
//
// The det N of needles and discs is no larger than that. The careful test, for pairs that the quick one leaves, does
// without: w = mu L1^T m, of whatever length it is, gives a point of A, and radial_in_b() tells whether it lies in B.
#include "query/targets.hpp"

#include <prolate/pairs.hpp>

#include <algorithm>
#include <bit>
#include <span>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide_pairs.cpp"
#include <hwy/foreach_target.h>

#include "query/pair_lanes-inl.hpp"

#ifndef PROLATE_QUERY_COLLIDE_PAIRS_ONCE
#define PROLATE_QUERY_COLLIDE_PAIRS_ONCE
namespace prolate::query {

inline constexpr uint32_t kMaxLaneEvaluations = 5;
inline constexpr size_t kChunk = 512; // pairs between lists

// Pairs that are still undecided: which, after how many evaluations, and with which rho to go on. Where a pair waits
// after the first evaluation that is done anew: it is rare, and what the next one needs is left out of the first.
struct Waiting {
    size_t count = 0;
    uint32_t at[kChunk], done[kChunk];
    float rho[kChunk];
    void add(uint32_t pair, uint32_t evaluations, float next_rho) {
        at[count] = pair, done[count] = evaluations, rho[count] = next_rho;
        ++count;
    }
};

} // namespace prolate::query
#endif

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

// Weights of both matrices in N, which make its trace 1; rho = lambda / mu.
struct Weights {
    F mu, lambda;
};
HWY_INLINE F first_rho(const Pairs& p) {
    return p.a.size / p.b.size; // that of two spheres
}
HWY_INLINE Weights first_weights(const Pairs& p) { // for that rho, with one division less
    const F k = set(1) / (p.a.size * p.b.size * (p.a.size + p.b.size));
    return {p.b.size * k, p.a.size * k};
}
HWY_INLINE Weights weights_of(const Pairs& p, F rho) {
    const F mu = set(1) / (trace(p.q1) + rho * trace(p.q2));
    return {mu, rho * mu};
}

// What one evaluation leaves behind.
struct Evaluation {
    Symmetric adj; // of N
    F mu, lambda, det;
    Vector wa, wb;  // L^T m
    F aa, bb, a, b; // their lengths
    Mask separated, overlapping;
};

HWY_INLINE Evaluation evaluate(const Pairs& p, const Weights& weights, F margin) {
    Evaluation e;
    e.mu = weights.mu, e.lambda = weights.lambda;
    const Symmetric q = p.combine(e.mu, e.lambda);
    e.adj = adjugate(q);
    e.det = q.xx * e.adj.xx + q.xy * e.adj.xy + q.xz * e.adj.xz;
    const Vector m = e.adj * p.r;
    e.wa = p.a.transposed_times(m), e.wb = p.b.transposed_times(m);
    e.aa = dot(e.wa, e.wa), e.bb = dot(e.wb, e.wb), e.a = hn::Sqrt(e.aa), e.b = hn::Sqrt(e.bb);
    const F px = m.x * p.r.x, py = m.y * p.r.y, pz = m.z * p.r.z;
    const F absolute = hn::Abs(px) + hn::Abs(py) + hn::Abs(pz), length = hn::Abs(m.x) + hn::Abs(m.y) + hn::Abs(m.z);
    e.separated =
        hn::Gt(px + py + pz - e.a - e.b, (p.slack + margin) * length + set(7 * kV) * absolute + set(kUnderflow));

    const F error = set(4) * p.r1 + set(1 / (8 * kV)) * p.slack, room = e.det - set(32 * kV);
    e.overlapping = hn::And(hn::Le(e.mu * (e.a + set(kUnderflow) + p.a.slack * error), room),
                            hn::Le(e.lambda * (e.b + set(kUnderflow) + p.b.slack * error), room));
    return e;
}

// The careful test.
HWY_INLINE Mask overlapping(const Pairs& p, const Evaluation& e) {
    return hn::And(hn::Le(e.mu * (e.a + set(kUnderflow)), e.det * set(1 - 16 * kV)),
                   hn::Le(radial_in_b(p, e.wa * e.mu, e.det), set(1)));
}

// Newton's step of separation.cpp, brought to one fraction: with c = rho b^2 and h = rho^2 w.adj(Q) w / det(Q), w = Q2
// n, it is (a - rho b) / (a + rho b) * a^2 c / ((c - h) (c + a^2)).
HWY_INLINE F next(const Pairs& p, const Evaluation& e, F rho) {
    const Vector w = p.b.times(e.wb);
    const F c = rho * e.bb, cd = c * e.det, least = set(0x1p-12f) * cd;
    const F difference = cd - rho * e.lambda * dot(w, e.adj * w);
    const F rest = hn::IfThenElse(hn::Gt(difference, least), difference, least);
    const F step = (e.a - rho * e.b) * e.aa * cd / ((e.a + rho * e.b) * (c + e.aa) * rest);
    const F most = set(0.9f), floor = set(-0.9f);
    const F bounded = hn::IfThenElse(hn::Lt(step, most), hn::IfThenElse(hn::Gt(step, floor), step, floor), most);
    return rho * ((set(1) + bounded) / (set(1) - bounded));
}

class Batch {
public:
    Batch(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts, float margin)
        : bodies_(bodies), pairs_(pairs), verdicts_(verdicts), margin_(margin), lane_margin_(margin * (1 + 8 * kV)) {}

    PairStats run() {
        for (size_t begin = 0; begin < pairs_.size(); begin += kChunk) {
            begin_ = begin, end_ = std::min(begin + kChunk, pairs_.size());
            waiting_.count = 0;
            for (size_t first = begin_; first < end_; first += width()) start(first);
            for (size_t first = 0; first < waiting_.count; first += width()) go_on(first);
        }
        return stats_;
    }

private:
    HWY_INLINE const float* row(uint32_t body) const { return bodies_.world[body].center; }

    HWY_INLINE void take(const Evaluation& e, uint32_t& left, uint32_t& separated) {
        separated |= left & bits(e.separated);
        left &= ~bits(hn::Or(e.separated, e.overlapping));
    }

    // First evaluation of the pairs from `first` on.
    HWY_INLINE void start(size_t first) {
        const size_t count = std::min(width(), end_ - first);
        const float* rows_a[8];
        const float* rows_b[8];
        for (size_t i = 0; i < width(); ++i) {
            const IndexPair& pair = pairs_[std::min(first + i, end_ - 1)];
            rows_a[i] = row(pair.a), rows_b[i] = row(pair.b);
        }
        const Pairs p(rows_a, rows_b);
        uint32_t separated = 0, left = (1u << count) - 1;
        const Evaluation e = evaluate(p, first_weights(p), set(lane_margin_));
        take(e, left, separated);
        stats_.evaluations += count - static_cast<uint32_t>(std::popcount(left));
        float rhos[8];
        uint32_t done = 0;
        if (2 * static_cast<size_t>(std::popcount(left)) > width()) done = stay(p, e, left, separated, rhos);
        for (size_t i = 0; i < count; ++i)
            verdicts_[first + i] = static_cast<Verdict>(~separated >> i & 1); // separated or overlapping
        for (; left != 0; left &= left - 1) {
            const auto lane = static_cast<size_t>(std::countr_zero(left));
            waiting_.add(static_cast<uint32_t>(first + lane - begin_), done, done ? rhos[lane] : 0);
        }
    }

    // Further evaluations while most lanes of a group are undecided.
    HWY_INLINE uint32_t stay(const Pairs& p, const Evaluation& first, uint32_t& left, uint32_t& separated,
                             float* rhos) {
        stats_.evaluations += static_cast<uint32_t>(std::popcount(left));
        F rho = first_rho(p);
        Evaluation e = first;
        for (uint32_t done = 1;; ++done) {
            left &= ~bits(overlapping(p, e));
            rho = next(p, e, rho);
            if (2 * static_cast<size_t>(std::popcount(left)) <= width() || done == kMaxLaneEvaluations) {
                hn::StoreU(rho, Lanes(), rhos);
                return done;
            }
            stats_.evaluations += static_cast<uint32_t>(std::popcount(left));
            e = evaluate(p, weights_of(p, rho), set(lane_margin_));
            take(e, left, separated);
        }
    }

    // The rest of the evaluations of the pairs that wait at `first` and behind.
    void go_on(size_t first) {
        const size_t count = std::min(width(), waiting_.count - first);
        const float* rows_a[8];
        const float* rows_b[8];
        float rhos[8], fresh[8];
        uint32_t done[8] = {};
        for (size_t i = 0; i < width(); ++i) {
            const size_t j = std::min(first + i, waiting_.count - 1);
            const IndexPair& pair = pairs_[begin_ + waiting_.at[j]];
            rows_a[i] = row(pair.a), rows_b[i] = row(pair.b), rhos[i] = waiting_.rho[j], done[i] = waiting_.done[j];
            fresh[i] = done[i] == 0 ? 1.0f : 0.0f;
        }
        const Pairs p(rows_a, rows_b);
        const Mask anew = hn::Gt(hn::LoadU(Lanes(), fresh), set(0));
        F rho = hn::IfThenElse(anew, first_rho(p), hn::LoadU(Lanes(), rhos));
        const Weights from_start = first_weights(p), from_rho = weights_of(p, rho);
        Weights weights{hn::IfThenElse(anew, from_start.mu, from_rho.mu),
                        hn::IfThenElse(anew, from_start.lambda, from_rho.lambda)};
        for (uint32_t left = (1u << count) - 1; left != 0;) {
            for (uint32_t rest = left; rest != 0; rest &= rest - 1) {
                const auto lane = static_cast<size_t>(std::countr_zero(rest));
                if (done[lane]++ < kMaxLaneEvaluations) continue;
                in_double(waiting_.at[first + lane]);
                left &= ~(1u << lane);
            }
            stats_.evaluations += static_cast<uint32_t>(std::popcount(left));
            uint32_t separated = 0;
            const Evaluation e = evaluate(p, weights, set(lane_margin_));
            take(e, left, separated);
            left &= ~bits(overlapping(p, e));
            for (; separated != 0; separated &= separated - 1)
                verdict_of(waiting_.at[first + static_cast<size_t>(std::countr_zero(separated))]) = Verdict::separated;
            rho = next(p, e, rho);
            weights = weights_of(p, rho);
        }
    }

    Verdict& verdict_of(uint32_t at) { return verdicts_[begin_ + at]; }
    void in_double(uint32_t at) {
        const IndexPair& pair = pairs_[begin_ + at];
        verdict_of(at) = prolate::collide(bodies_.shapes[pair.a], bodies_.poses[pair.a], bodies_.shapes[pair.b],
                                          bodies_.poses[pair.b], margin_);
        ++stats_.in_double;
    }

    const EllipsoidBodies bodies_;
    const std::span<const IndexPair> pairs_;
    const std::span<Verdict> verdicts_;
    const float margin_, lane_margin_;
    size_t begin_ = 0, end_ = 0;
    PairStats stats_;
    Waiting waiting_;
};

PairStats collide_pairs(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts,
                        float margin) {
    return Batch(bodies, pairs, verdicts, margin).run();
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate {
namespace query {
HWY_EXPORT(collide_pairs);
static PairStats collide_pairs_best(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs,
                                    std::span<Verdict> verdicts, float margin) {
    return HWY_DYNAMIC_DISPATCH(collide_pairs)(bodies, pairs, verdicts, margin);
}
} // namespace query

PairStats collide(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts,
                  float margin) noexcept {
    return query::collide_pairs_best(bodies, pairs, verdicts, margin);
}

} // namespace prolate
#endif

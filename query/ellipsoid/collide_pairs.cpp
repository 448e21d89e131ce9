// collide() for batches: the test of separation.hpp in single precision, as many pairs at once as there are lanes.
//
// All pairs are evaluated once, and those that stay undecided put on a list, to be evaluated on in full groups. Where
// more than a quarter of a group stayed undecided, the next group goes on at once. A pair undecided after
// kMaxLaneEvaluations goes to double precision. What a pair goes through does not depend on its neighbours, so that
// neither do its answer and the counters.
//
// Rounding, v = 2^-24. Each body comes with a bound of its own errors (pairs.cpp: slack); else its floats are exact.
// Norms as in separation.hpp; n is m below, of any length; P = |n| |r|.
//   r = c2 - c1      |dri| <= v |ri|, besides what the centers are wrong by
//   p = n.r          3 v P, with what r is wrong by 4 v P
//   a = |L1^T n|     L1^T n: at most three products a component, 3 v |n| |L1|; length: 2.5 v a. In all 5.5 v |n| |L1|
//   p - a - b        the first difference is wrong by v (P + a), the second by v (P + a + b)
// so p - a - b is wrong by at most 6 v P + 7.5 v |n| (|L1| + |L2|), besides what the bodies bring. If |r| is larger
// than |L1| + |L2| + margin the bodies are apart by more than the margin anyway; else P <= |n| (|L1| + |L2| + margin).
// So it suffices to ask for more than |nx| + |ny| + |nz| times slacks that contain 15 v |L| each, and times (1 + 8 v)
// margin: 13.5 v and 6 v are needed, the rest pays for the rounding of the bounds. Squares that underflow make a and b
// too small by at most 2^-62 each: kLengthUnderflow.
//
// Overlap, the quick test: mu and lambda as computed are exact numbers; N = mu Q1 + lambda Q2, with Q of the exact
// bodies, has trace 1 +- 6 v, and certificate (2) reads t1 = mu |L1^T m| / det N <= 1 and t2 = lambda |L2^T m| / det N
// <= 1, where m = adj(N) r.
//   Q1, Q2           products 3 v tau_i, the placed factors 2.1 v tau_i
//   N                two products and a sum: |dN| <= 7.2 v
//   adj(N)           2 |N| |dN| + 2 v |N|^2: |d adj| <= 17 v
//   det N            one row of each: 17 v + 3 v + 7.2 v |adj| <= 24 v
//   m                17 v |r| + 3 v |adj| |r| + |adj| |dr|, |adj| <= 1/2: |dm| <= 20 v |r| + slacks / 2
//   |L1^T m|         20 v |r| |L1| + |m| (5.5 v + 1.1 v) |L1|: (24 v |r| + slacks / 2) |L1|
// The test takes 32 v for the 24 v of det N. With |r| <= |L1| + |L2| and |L| <= slack / 15 v, L1^T m is wrong by at
// most (1.6 + 0.5) slacks^2 / 15 v, for which it takes e = slacks^2 / 6 v. If |r| is q > 1 times |L1| + |L2|, the
// bodies are apart: the greater of t1 and t2 is at least q, and its error at most 0.9 q mu e. To pass, mu e <= det N
// and q det N - 0.9 q mu e + mu e <= det N, that is (q - 1) det N <= (0.9 q - 1) mu e < (q - 1) mu e: not both can be.
//
// The det N of needles and discs is no larger than that; and (2) holds late, for its point is off by what rho is. The
// careful test, of what the quick ones leave, takes another: z = c1 + t L1 (w / a), w = L1^T m, on the way from A's
// center to its point farthest along m, at t = p / (a + b), where the slabs of both bodies overlap half and half. For
// the best rho it is that of (2); else it is as near to a common point as the gap along m is to the greatest, which is
// of second order in what rho is off. w and t, as computed, are what they are: z lies in A if |w| t <= a, for which a
// is taken 16 v larger (2.5 v of the length, 8 v of the products), and radial_in_b() tells whether it lies in B.
#include "query/simd/targets.hpp"

#include <prolate/pairs.hpp>

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/ellipsoid/collide_pairs.cpp"
#include <hwy/foreach_target.h>

#include "query/ellipsoid/pair_lanes-inl.hpp"

#ifndef PROLATE_QUERY_COLLIDE_PAIRS_ONCE
#define PROLATE_QUERY_COLLIDE_PAIRS_ONCE
namespace prolate::query {

inline constexpr uint32_t kMaxLaneEvaluations = 5;
inline constexpr size_t kChunk = 512; // pairs between lists

// Pairs that are still undecided: which, after how many evaluations, and with which rho to go on. A pair that waits
// after the first evaluation does that anew: it is rare, and the first evaluation is so the leaner.
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
    Float mu, lambda;
};
HWY_INLINE Float first_rho(const PairLanes& p) {
    return p.a.size / p.b.size; // that of two spheres
}
HWY_INLINE Weights first_weights(const PairLanes& p) { // for that rho, with one division less
    const Float k = 1 / (p.a.size * p.b.size * (p.a.size + p.b.size));
    return {p.b.size * k, p.a.size * k};
}
HWY_INLINE Weights weights_of(const PairLanes& p, Float rho) {
    const Float mu = 1 / (trace(p.q1) + rho * trace(p.q2));
    return {mu, rho * mu};
}

// What both quick tests have to leave room for.
struct Limits {
    Float gap;   // times |mx| + |my| + |mz|
    Float error; // of |L^T m|
    HWY_INLINE Limits(const PairLanes& p, float margin)
        : gap(p.slack + margin), error(p.slack * p.slack * (1 / (6 * kV)) + kLengthUnderflow) {}
};

// What one evaluation leaves behind.
struct Evaluation {
    Sym3 adj; // of N
    Float mu, lambda, det;
    Float3 wa, wb;      // L^T m
    Float aa, bb, a, b; // their lengths
    Float p;            // m.r
    Mask separated, overlapping;
};

HWY_INLINE Evaluation evaluate(const PairLanes& p, const Weights& weights, const Limits& limits) {
    Evaluation e{};
    e.mu = weights.mu, e.lambda = weights.lambda;
    const Sym3 q = p.combine(e.mu, e.lambda);
    e.adj = adjugate(q);
    e.det = determinant(q, e.adj);
    const Float3 m = e.adj * p.r;
    e.wa = transposed_times(p.a.factor, m), e.wb = transposed_times(p.b.factor, m);
    e.aa = dot(e.wa, e.wa), e.bb = dot(e.wb, e.wb), e.a = sqrt(e.aa), e.b = sqrt(e.bb);
    e.p = dot(m, p.r);
    e.separated = e.p - e.a - e.b > limits.gap * one_norm(m) + kLengthUnderflow;
    const Float room = e.det - 32 * kV;
    e.overlapping = (e.mu * (e.a + limits.error) <= room) & (e.lambda * (e.b + limits.error) <= room);
    return e;
}

// The careful test. Products with mu are about 1, whatever the unit of lengths.
HWY_INLINE Mask overlapping(const PairLanes& p, const Evaluation& e) {
    const Float both = e.a + e.b, at = (e.a + kLengthUnderflow) * e.mu * (both * e.mu) * (1 + 16 * kV);
    return (abs(e.p) <= both) & (at > 0x1p-90f) & (radial_in_b(p, e.wa * e.mu * (e.p * e.mu), at) <= 1);
}

// Newton's step of separation.cpp, brought to one fraction: with c = rho b^2 and h = rho^2 w.adj(Q) w / det(Q), w = Q2
// n, it is (a - rho b) / (a + rho b) * a^2 c / ((c - h) (c + a^2)).
HWY_INLINE Float next(const PairLanes& p, const Evaluation& e, Float rho) {
    const Float3 w = p.b.factor * e.wb;
    const Float c = rho * e.bb, cd = c * e.det, least = 0x1p-12f * cd;
    const Float difference = cd - rho * e.lambda * dot(w, e.adj * w);
    const Float rest = greater(least, difference);
    const Float step = (e.a - rho * e.b) * e.aa * cd / ((e.a + rho * e.b) * (c + e.aa) * rest);
    const Float bounded = choose(step < 0.9f, greater(set(-0.9f), step), set(0.9f));
    return rho * ((1 + bounded) / (1 - bounded));
}

class Batch {
public:
    Batch(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts, float margin)
        : bodies_(bodies), pairs_(pairs), verdicts_(verdicts), margin_(margin), lane_margin_(margin * (1 + 8 * kV)) {}

    PairStats run() {
        for (size_t begin = 0; begin < pairs_.size(); begin += kChunk) {
            begin_ = begin;
            const auto count = static_cast<uint32_t>(std::min(kChunk, pairs_.size() - begin));
            waiting_.count = 0;
            uint32_t undecided = 0; // of a group, after its first evaluation
            for (uint32_t first = 0; first < count; first += static_cast<uint32_t>(kFloatLanes)) {
                const uint32_t size = std::min(count - first, static_cast<uint32_t>(kFloatLanes));
                undecided = undecided > kFloatLanes / 4 ? many(first, size) : one(first, size);
            }
            for (size_t first = 0; first < waiting_.count; first += kFloatLanes) go_on(first);
        }
        return stats_;
    }

private:
    // First evaluation of `size` pairs from `first` on. Returns how many stay undecided.
    HWY_INLINE uint32_t one(uint32_t first, uint32_t size) {
        IndexPair repeated[8];
        const PairLanes p(bodies_.world.data(), full(first, size, repeated));
        const Evaluation e = evaluate(p, first_weights(p), Limits(p, lane_margin_));
        uint32_t left = ((1u << size) - 1) & ~bits(e.separated | e.overlapping);
        if (left != 0) left &= ~bits(overlapping(p, e));
        write(first, size, bits(e.separated));
        const auto undecided = static_cast<uint32_t>(std::popcount(left));
        stats_.evaluations += size - undecided;
        for (; left != 0; left &= left - 1) waiting_.add(first + static_cast<uint32_t>(std::countr_zero(left)), 0, 0);
        return undecided;
    }

    // The pairs from `first` on; lanes without a pair repeat the last one.
    HWY_INLINE const IndexPair* full(uint32_t first, uint32_t size, IndexPair repeated[8]) const {
        const IndexPair* const pairs = pairs_.data() + begin_ + first;
        if (size == kFloatLanes) return pairs;
        for (uint32_t i = 0; i < kFloatLanes; ++i) repeated[i] = pairs[std::min(i, size - 1)];
        return repeated;
    }

    // verdicts from `first` on: separated where the bit is 1, else overlapping, which is what undecided pairs begin
    // with
    void write(uint32_t first, uint32_t size, uint32_t separated) {
        static_assert(static_cast<int>(Verdict::separated) == 0 && static_cast<int>(Verdict::overlapping) == 1);
        Verdict* const out = &verdict_of(first);
        if (size == 8 && std::endian::native == std::endian::little) {
            // Bit i to the lowest bit of byte i: copy to all bytes, keep one bit in each, carry it into the highest.
            const uint64_t kept = (uint64_t{~separated & 0xffu} * 0x0101010101010101u) & 0x8040201008040201u;
            const uint64_t bytes = ((kept + 0x7f7f7f7f7f7f7f7fu) >> 7) & 0x0101010101010101u;
            std::memcpy(out, &bytes, sizeof bytes);
            return;
        }
        for (uint32_t i = 0; i < size; ++i) out[i] = static_cast<Verdict>(~separated >> i & 1);
    }

    // The same, and on, while more than a quarter are undecided.
    HWY_NOINLINE uint32_t many(uint32_t first, uint32_t size) {
        IndexPair repeated[8];
        const PairLanes p(bodies_.world.data(), full(first, size, repeated));
        const Limits limits(p, lane_margin_);
        uint32_t left = (1u << size) - 1, separated = 0, done = 0, undecided = 0;
        Float rho = first_rho(p);
        for (Weights weights = first_weights(p);; weights = weights_of(p, rho)) {
            stats_.evaluations += static_cast<uint32_t>(std::popcount(left));
            const Evaluation e = evaluate(p, weights, limits);
            separated |= left & bits(e.separated);
            left &= ~bits(e.separated | e.overlapping | overlapping(p, e));
            if (done == 0) undecided = static_cast<uint32_t>(std::popcount(left));
            ++done;
            rho = next(p, e, rho);
            if (static_cast<size_t>(std::popcount(left)) <= kFloatLanes / 4 || done == kMaxLaneEvaluations) break;
        }
        write(first, size, separated);
        float rhos[8];
        store_unaligned(rho, rhos);
        for (; left != 0; left &= left - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(left));
            waiting_.add(first + lane, done, rhos[lane]);
        }
        return undecided;
    }

    // The rest of the evaluations of the pairs that wait at `first` and behind.
    void go_on(size_t first) {
        const size_t size = std::min(kFloatLanes, waiting_.count - first);
        IndexPair pairs[8];
        float rhos[8], done[8];
        for (size_t i = 0; i < kFloatLanes; ++i) {
            const size_t j = first + std::min(i, size - 1);
            pairs[i] = pairs_[begin_ + waiting_.at[j]];
            rhos[i] = waiting_.rho[j], done[i] = static_cast<float>(waiting_.done[j]);
        }
        const PairLanes p(bodies_.world.data(), pairs);
        const Limits limits(p, lane_margin_);
        Float times = load_unaligned(done); // evaluated
        const Mask anew = times == 0;
        Float rho = choose(anew, first_rho(p), load_unaligned(rhos));
        const Weights from_start = first_weights(p), from_rho = weights_of(p, rho);
        Weights weights{choose(anew, from_start.mu, from_rho.mu), choose(anew, from_start.lambda, from_rho.lambda)};
        for (uint32_t left = (1u << size) - 1; left != 0; weights = weights_of(p, rho)) {
            uint32_t exhausted = left & bits(times >= kMaxLaneEvaluations);
            left &= ~exhausted;
            for (; exhausted != 0; exhausted &= exhausted - 1)
                in_double(waiting_.at[first + static_cast<size_t>(std::countr_zero(exhausted))]);
            stats_.evaluations += static_cast<uint32_t>(std::popcount(left));
            const Evaluation e = evaluate(p, weights, limits);
            for (uint32_t separated = left & bits(e.separated); separated != 0; separated &= separated - 1)
                verdict_of(waiting_.at[first + static_cast<size_t>(std::countr_zero(separated))]) = Verdict::separated;
            times = times + 1;
            left &= ~bits(e.separated | e.overlapping | overlapping(p, e));
            rho = next(p, e, rho);
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
    size_t begin_ = 0; // of the chunk
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

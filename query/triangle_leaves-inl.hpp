// All pairs of triangles of two leaves, packed densely into lanes. Compiled once an instruction set.
//
// A's corners are taken from its first corner, B's from its own first, turned, and moved by what lies between the two,
// which is computed in double; then all are scaled by the power of two that brings the greatest coordinate into
// [1/2, 1). So the float tests lose digits in proportion to the leaves and what lies between them, not to the bodies
// (how many: triangle_lanes-inl.hpp). Pairs are counted through blocks of eight triangles of each, and lanes are picked
// by index: pair p of n triangles of A and some of B is (p mod n, p / n). So no lane but the last few is idle, whatever
// the counts.
#if defined(PROLATE_QUERY_TRIANGLE_LEAVES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#undef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#else
#define PROLATE_QUERY_TRIANGLE_LEAVES_INL
#endif

#include "query/triangle_lanes-inl.hpp"
#include "src/bytes.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

// Vectors of four: most leaves have no more triangles. Nothing is read by longer vectors than it was written by, for that
// must wait until the writes have reached the cache.
using QuadTag = HWY_CAPPED(float, 4);
using Quad = hn::Vec<QuadTag>;

// The triangles of a leaf, one a lane; row 3 i + k is coordinate k of corner i. Rows are a little longer than needed:
// so that whole vectors can be read and written, and so that they do not fall on the same places of the cache.
class LeafRows {
public:
    LeafRows(const TreeView& tree, const TriangleRange& range) : count_(range.count) {
        if (tree.vertex_count() <= 0x10000)
            gather<uint16_t>(tree, range);
        else
            gather<uint32_t>(tree, range);
        for (size_t k = 0; k < 3; ++k) origin_[k] = rows_[k][0];
    }
    glm::dvec3 first_corner() const { return {origin_[0], origin_[1], origin_[2]}; }

    /// Places the corners by x - first corner. Each lane of the result is the greatest of some of the coordinates.
    Quad place() {
        Quad most = hn::Zero(QuadTag());
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t row = 0; row < 9; ++row) most = hn::Max(most, set(row, t, from_first(row, t)));
        return most;
    }
    /// Likewise by rotation (x - first corner) + shift.
    Quad place(const glm::dmat3& rotation, const glm::dvec3& shift) {
        Quad most = hn::Zero(QuadTag());
        const auto rounded = [](double x) { return hn::Set(QuadTag(), static_cast<float>(x)); };
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t corner = 0; corner < 9; corner += 3) {
                const Quad x = from_first(corner, t), y = from_first(corner + 1, t), z = from_first(corner + 2, t);
                for (glm::length_t k = 0; k < 3; ++k) {
                    const auto times = [&](glm::length_t column, Quad v) {
                        return hn::Mul(rounded(rotation[column][k]), v);
                    };
                    const Quad turned = hn::Add(hn::Add(times(0, x), times(1, y)), times(2, z));
                    most = hn::Max(most, set(corner + static_cast<size_t>(k), t, hn::Add(turned, rounded(shift[k]))));
                }
            }
        return most;
    }
    void scale(float scale) {
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t row = 0; row < 9; ++row)
                hn::Store(hn::Mul(at(row, t), hn::Set(QuadTag(), scale)), QuadTag(), rows_[row] + t);
    }
    const float* row(size_t row) const { return rows_[row]; }

private:
    static constexpr size_t kGroup = 4, kWidth = kMaxLeafTriangles + 1 + kLanes + kGroup;

    static uint32_t step() { return static_cast<uint32_t>(hn::Lanes(QuadTag())); }

    template <class Index> void gather(const TreeView& tree, const TriangleRange& range) {
        const std::byte* index = tree.triangle_bytes() + size_t{range.first} * 3 * sizeof(Index);
        for (uint32_t t = 0; t < count_; t += kGroup) {
            alignas(16) float corner[3][kGroup][4] = {}; // the fourth coordinate means nothing
            for (size_t i = 0; i < kGroup && t + i < count_; ++i)
                for (auto& of_all : corner) { // behind the vertices there are at least the 6 bytes of a triangle
                    std::memcpy(of_all[i], tree.vertex_bytes() + size_t{load_le<Index>(index)} * 3 * sizeof(float), 16);
                    index += sizeof(Index);
                }
            for (size_t c = 0; c < 3; ++c) transpose(corner[c], 3 * c, t);
        }
    }
    void transpose(const float (&corner)[kGroup][4], size_t row, uint32_t t) {
#if HWY_TARGET == HWY_SCALAR
        for (size_t k = 0; k < 3; ++k)
            for (size_t i = 0; i < kGroup; ++i) rows_[row + k][t + i] = corner[i][k];
#else
        const QuadTag d;
        const Quad first = hn::Load(d, corner[0]), second = hn::Load(d, corner[1]), third = hn::Load(d, corner[2]),
                   fourth = hn::Load(d, corner[3]);
        const Quad odd = hn::InterleaveLower(d, first, third), even = hn::InterleaveLower(d, second, fourth);
        hn::Store(hn::InterleaveLower(d, odd, even), d, rows_[row] + t);
        hn::Store(hn::InterleaveUpper(d, odd, even), d, rows_[row + 1] + t);
        hn::Store(hn::InterleaveLower(d, hn::InterleaveUpper(d, first, third), hn::InterleaveUpper(d, second, fourth)),
                  d, rows_[row + 2] + t);
#endif
    }
    Quad at(size_t row, uint32_t t) const { return hn::Load(QuadTag(), rows_[row] + t); }
    Quad from_first(size_t row, uint32_t t) const {
        return hn::Sub(at(row, t), hn::Set(QuadTag(), origin_[row % 3]));
    }
    // Returns the sizes of what it stores, 0 in lanes without a triangle.
    Quad set(size_t row, uint32_t t, Quad x) {
        hn::Store(x, QuadTag(), rows_[row] + t);
        return hn::IfThenElseZero(hn::FirstN(QuadTag(), count_ - t), hn::Abs(x));
    }

    uint32_t count_;
    float origin_[3];
    alignas(16) float rows_[9][kWidth];
};

// The power of two that brings x > 0 into [1/2, 1); 0, with which nothing is certified, if there is none.
inline float unit_scale(float x) {
    const uint32_t exponent = std::bit_cast<uint32_t>(x) >> 23;
    return exponent > 0 && exponent < 253 ? std::bit_cast<float>((253 - exponent) << 23) : 0;
}

inline float rounded_up(double x) {
    return static_cast<float>(x * (1 + 0x1p-22));
}

// Which triangles of two blocks of `kLanes` at most the pairs are made of: of A's `count`, remainder[count - 1][pair],
// of B's, quotient[count - 1][pair].
struct PairIndices {
    static constexpr size_t kPairs = kLanes * kLanes;
    int32_t remainder[kLanes][kPairs], quotient[kLanes][kPairs];
};
inline constexpr PairIndices kPairIndices = [] {
    PairIndices out{};
    for (size_t count = 1; count <= kLanes; ++count)
        for (size_t pair = 0; pair < PairIndices::kPairs; ++pair) {
            out.remainder[count - 1][pair] = static_cast<int32_t>(pair % count);
            out.quotient[count - 1][pair] = static_cast<int32_t>(pair / count);
        }
    return out;
}();

using IndexTag = hn::RebindToSigned<LaneTag>;

/// kLanes pairs of triangles, of which the first `count` are to be tested.
struct PairBatch {
    const LeafRows* leaf[2];
    const int32_t* index[2];    // of the pairs' triangles
    uint32_t first[2], size[2]; // of the blocks they count from
    uint32_t count;

    /// The triangles of one side, from `lane` on; the block's last if the index is beyond.
    template <size_t kSide> HWY_INLINE LaneTriangle at(size_t lane) const {
        const LaneTag tag;
        const auto which = hn::Min(hn::LoadU(IndexTag(), index[kSide] + lane),
                                   hn::Set(IndexTag(), static_cast<int32_t>(size[kSide] - 1)));
        const auto row_at = [&](size_t row) {
            const float* const eight = leaf[kSide]->row(row) + first[kSide];
            if constexpr (hn::MaxLanes(tag) == kLanes) {
                const auto lanes = size[kSide] <= 4 ? hn::LoadDup128(tag, eight) : hn::LoadU(tag, eight);
                return hn::TableLookupLanes(lanes, hn::IndicesFromVec(tag, which));
            } else
                return hn::GatherIndex(tag, eight, which);
        };
        return {
            {{row_at(0), row_at(1), row_at(2)}, {row_at(3), row_at(4), row_at(5)}, {row_at(6), row_at(7), row_at(8)}}};
    }
    /// Index among the leaf's triangles.
    template <size_t kSide> uint32_t triangle(uint32_t lane) const {
        return first[kSide] + static_cast<uint32_t>(index[kSide][lane]);
    }
};

/// Both leaves from A's first corner, in the lanes' unit.
class LeafPair {
public:
    LeafPair(const TreeView& a, const TriangleRange& in_a, const TreeView& b, const TriangleRange& in_b,
             const RelativePose& b_to_a)
        : a_(a, in_a), b_(b, in_b), count_a_(in_a.count), count_b_(in_b.count) {
        const glm::dvec3 first_a = a_.first_corner(), first_b = b_.first_corner();
        const glm::dvec3 shift = b_to_a.rotation * first_b + (b_to_a.translation - first_a);
        const float largest =
            hn::GetLane(hn::MaxOfLanes(QuadTag(), hn::Max(a_.place(), b_.place(b_to_a.rotation, shift))));
        scale_ = unit_scale(largest);
        a_.scale(scale_), b_.scale(scale_);
        // Corners are no farther from the bodies' origins than the first ones and what lies between: the diagonals of
        // cubes of `largest` and twice that.
        reach_ = glm::length(first_a) + glm::length(first_b) + kDiagonals * double{largest} + b_to_a.distance;
    }
    LaneMargins margins(double distance, const LaneMarginFactors& factors) const {
        const double scale = scale_;
        return {.direction = rounded_up(factors.direction + kSeparationMargin * reach_ * scale),
                .corner_error = rounded_up(kPlacementError + 80 * 0x1p-53 * reach_ * scale),
                .distance = rounded_up(distance * scale)};
    }
    /// Calls visit(PairBatch) for all pairs, in the order of test_leaves(), until it returns true.
    template <class Visit> void any_batch(Visit&& visit) const {
        for (uint32_t block = 0; block < count_a_; block += kLanes) {
            const uint32_t block_size = std::min<uint32_t>(count_a_ - block, kLanes);
            for (uint32_t chunk = 0; chunk < count_b_; chunk += kLanes) {
                const uint32_t chunk_size = std::min<uint32_t>(count_b_ - chunk, kLanes);
                const uint32_t pairs = block_size * chunk_size;
                for (uint32_t pair = 0; pair < pairs; pair += kLanes)
                    if (visit(PairBatch{.leaf = {&a_, &b_},
                                        .index = {kPairIndices.remainder[block_size - 1] + pair,
                                                  kPairIndices.quotient[block_size - 1] + pair},
                                        .first = {block, chunk},
                                        .size = {block_size, chunk_size},
                                        .count = std::min<uint32_t>(pairs - pair, kLanes)}))
                        return;
            }
        }
    }

private:
    static constexpr double kDiagonals = 3 * 1.7321;
    LeafRows a_, b_;
    uint32_t count_a_, count_b_;
    float scale_;
    double reach_;
};

inline LeafResult test_leaf_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                 const RelativePose& b_to_a, double distance, const LaneMarginFactors& factors) {
    const LeafPair leaves(a, in_a, b, in_b, b_to_a);
    const LaneMargins margins = leaves.margins(distance, factors);
    LeafResult result;
    leaves.any_batch([&](const PairBatch& batch) {
        const LaneVerdicts verdicts = test_all_lanes([&](size_t lane) { return batch.at<0>(lane); },
                                                     [&](size_t lane) { return batch.at<1>(lane); }, margins, factors);
        for (uint32_t open = ~verdicts.apart & ((1u << batch.count) - 1); open != 0; open &= open - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(open));
            const uint32_t i = in_a.first + batch.triangle<0>(lane), j = in_b.first + batch.triangle<1>(lane);
            if ((verdicts.meet >> lane & 1) == 0) {
                ++result.exact_tests;
                if (apart(place(a, i), place(b, j, b_to_a), distance)) continue;
            }
            result.pair_tests += lane + 1;
            result.meet = true, result.triangle_a = i, result.triangle_b = j;
            return true;
        }
        result.pair_tests += batch.count;
        return false;
    });
    return result;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

// All pairs of triangles of two leaves, packed densely into lanes. Compiled once an instruction set.
//
// Corners are computed in double, from A's first corner, and rounded to float once, scaled by the power of two that
// brings the greatest coordinate into [1/2, 1): so the float tests lose digits in proportion to the leaves and what
// lies between them, not to the bodies. Pairs are counted through blocks of eight triangles of each, and lanes are
// picked by index: pair p of n triangles of A and some of B is (p mod n, p / n). So no lane but the last few is idle,
// whatever the counts.
#if defined(PROLATE_QUERY_TRIANGLE_LEAVES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#undef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#else
#define PROLATE_QUERY_TRIANGLE_LEAVES_INL
#endif

#include "query/triangle_lanes-inl.hpp"
#include "src/bytes.hpp"

#include <bit>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

// The triangles of a leaf, one a lane; row 3 i + k is coordinate k of corner i. Rows are a little longer than needed:
// so that whole vectors can be read and written, and so that they do not fall on the same places of the cache.
class LeafRows {
public:
    LeafRows(const TreeView& tree, const TriangleRange& range) : count_(range.count) {
        if (tree.vertex_count() <= 0x10000)
            gather<uint16_t>(tree, range);
        else
            gather<uint32_t>(tree, range);
        for (size_t row = 0; row < 9; ++row) // whole vectors
            for (uint32_t t = count_; t % kDoubleLanes != 0; ++t) stored_[row][t] = stored_[row][count_ - 1];
    }

    /// Places the corners at rotation x + translation: the columns of a matrix, and a vector.
    void place(const glm::dmat3& rotation, const glm::dvec3& translation) {
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t corner = 0; corner < 9; corner += 3) {
                const DoubleLane x = stored(corner, t), y = stored(corner + 1, t), z = stored(corner + 2, t);
                for (glm::length_t k = 0; k < 3; ++k) {
                    const auto times = [&](glm::length_t column, DoubleLane v) {
                        return hn::Mul(hn::Set(DoubleTag(), rotation[column][k]), v);
                    };
                    const DoubleLane turned = hn::Add(hn::Add(times(0, x), times(1, y)), times(2, z));
                    set_placed(corner + static_cast<size_t>(k), t,
                               hn::Add(turned, hn::Set(DoubleTag(), translation[k])));
                }
            }
    }
    void place(const glm::dvec3& translation) {
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t row = 0; row < 9; ++row)
                set_placed(
                    row, t,
                    hn::Add(stored(row, t), hn::Set(DoubleTag(), translation[static_cast<glm::length_t>(row % 3)])));
    }
    /// The greatest coordinate of a placed corner.
    double largest() const {
        return greatest([&](size_t row, uint32_t t) { return hn::LoadU(DoubleTag(), placed_[row] + t); });
    }
    /// No corner is farther from the body's origin: the diagonal of a cube.
    double reach() const {
        return 1.7321 * greatest([&](size_t row, uint32_t t) { return stored(row, t); });
    }
    glm::dvec3 first_corner() const { return {stored_[0][0], stored_[1][0], stored_[2][0]}; }

    /// Rounds the placed corners, times `scale`, to floats.
    void scale(double scale) {
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t row = 0; row < 9; ++row) {
                const DoubleLane x = hn::LoadU(DoubleTag(), placed_[row] + t);
                hn::StoreU(hn::DemoteTo(HalfTag(), hn::Mul(x, hn::Set(DoubleTag(), scale))), HalfTag(),
                           scaled_[row] + t);
            }
    }
    const float* row(size_t row) const { return scaled_[row]; }

private:
    static constexpr size_t kDoubleLanes = 4, kWidth = kMaxLeafTriangles + 1 + kLanes;
    using DoubleTag = HWY_CAPPED(double, kDoubleLanes);
    using HalfTag = hn::Rebind<float, DoubleTag>;
    using DoubleLane = hn::Vec<DoubleTag>;

    static uint32_t step() { return static_cast<uint32_t>(hn::Lanes(DoubleTag())); }

    template <class Index> void gather(const TreeView& tree, const TriangleRange& range) {
        const std::byte* index = tree.triangle_bytes() + size_t{range.first} * 3 * sizeof(Index);
        for (uint32_t t = 0; t < count_; ++t)
            for (size_t corner = 0; corner < 9; corner += 3, index += sizeof(Index)) {
                const std::byte* const v = tree.vertex_bytes() + size_t{load_le<Index>(index)} * 3 * sizeof(float);
                for (size_t k = 0; k < 3; ++k) stored_[corner + k][t] = load_le<float>(v + k * sizeof(float));
            }
    }
    DoubleLane stored(size_t row, uint32_t t) const {
        return hn::PromoteTo(DoubleTag(), hn::LoadU(HalfTag(), stored_[row] + t));
    }
    void set_placed(size_t row, uint32_t t, DoubleLane x) { hn::StoreU(x, DoubleTag(), placed_[row] + t); }
    template <class At> double greatest(At&& at) const {
        DoubleLane most = hn::Zero(DoubleTag());
        for (uint32_t t = 0; t < count_; t += step())
            for (size_t row = 0; row < 9; ++row) most = hn::Max(most, hn::Abs(at(row, t)));
        double lanes[kDoubleLanes] = {};
        hn::StoreU(most, DoubleTag(), lanes);
        return std::max({lanes[0], lanes[1], lanes[2], lanes[3]});
    }

    uint32_t count_;
    float stored_[9][kWidth];
    double placed_[9][kWidth];
    float scaled_[9][kWidth];
};

// The power of two that brings x > 0 into [1/2, 1); 0, with which nothing is certified, if there is none.
inline double unit_scale(double x) {
    const uint64_t exponent = std::bit_cast<uint64_t>(x) >> 52;
    return exponent > 0 && exponent < 2045 ? std::bit_cast<double>((2045 - exponent) << 52) : 0;
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
            if constexpr (hn::MaxLanes(tag) == kLanes)
                return hn::TableLookupLanes(hn::LoadU(tag, eight), hn::IndicesFromVec(tag, which));
            else
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
        const glm::dvec3 origin = a_.first_corner();
        a_.place(-origin), b_.place(b_to_a.rotation, b_to_a.translation - origin);
        scale_ = unit_scale(std::max(a_.largest(), b_.largest()));
        a_.scale(scale_), b_.scale(scale_);
        reach_ = a_.reach() + b_.reach() + b_to_a.distance;
    }
    /// Lanes' units in a metre; 0 if there is none.
    double scale() const { return scale_; }
    LaneMargins margins(double distance, const LaneMarginFactors& factors) const {
        return {.direction = rounded_up(factors.direction + kSeparationMargin * reach_ * scale_),
                .corner_error = rounded_up(0x1p-24 + 80 * 0x1p-53 * reach_ * scale_),
                .distance = rounded_up(distance * scale_)};
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
    LeafRows a_, b_;
    uint32_t count_a_, count_b_;
    double scale_, reach_;
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

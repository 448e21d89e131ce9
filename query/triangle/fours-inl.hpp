// All pairs of triangles of two leaves, four triangles of each at a time, packed densely into lanes. Compiled once an
// instruction set.
//
// A's corners are taken from the first of the four's, B's from their own first, turned, and moved by what lies between
// the two, which is computed in double; then all are scaled by the power of two that brings the greatest coordinate
// into [1/2, 1). So the float tests lose digits in proportion to the leaves and what lies between them, not to the
// bodies (how many: lanes-inl.hpp). Lanes are picked by index: pair p of n triangles of A and some of B is
// (p mod n, p / n), so no lane but the last few is idle.
#if defined(PROLATE_QUERY_TRIANGLE_FOURS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_FOURS_INL
#undef PROLATE_QUERY_TRIANGLE_FOURS_INL
#else
#define PROLATE_QUERY_TRIANGLE_FOURS_INL
#endif

#include "query/ellipsoid/separation.hpp"
#include "query/triangle/lanes-inl.hpp"
#include "src/layout.hpp"

#include <prolate/tree.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

// Vectors of four. Nothing is read by longer vectors than it was written by, for that would have to wait until the
// writes have reached the cache.
constexpr size_t kFour = 4;

// A vertex as it stands in the file; the fourth coordinate means nothing.
HWY_INLINE void load_vertex(const TreeView& tree, uint32_t vertex, float (&out)[4]) {
    load_le(tree.raw().vertices() + size_t{vertex} * kVertexBytes, out); // behind it there are 6 bytes of a triangle
}
// From one vertex a row to one coordinate a row, but for the fourth.
HWY_INLINE void transpose(const float (&vertex)[kFour][4], float* x, float* y, float* z) {
#if HWY_TARGET == HWY_SCALAR
    for (size_t i = 0; i < kFour; ++i) x[i] = vertex[i][0], y[i] = vertex[i][1], z[i] = vertex[i][2];
#else
    const QuadTag d;
    const Quad first = load<Quad>(vertex[0]), second = load<Quad>(vertex[1]), third = load<Quad>(vertex[2]),
               fourth = load<Quad>(vertex[3]);
    const Quad odd = hn::InterleaveLower(d, first, third), even = hn::InterleaveLower(d, second, fourth);
    store(hn::InterleaveLower(d, odd, even), x);
    store(hn::InterleaveUpper(d, odd, even), y);
    store(hn::InterleaveLower(d, hn::InterleaveUpper(d, first, third), hn::InterleaveUpper(d, second, fourth)), z);
#endif
}

// One to four triangles of a leaf, one a lane; row 3 i + k is coordinate k of corner i.
class FourTriangles {
public:
    FourTriangles(const TreeView& tree, uint32_t first, uint32_t count) : count_(count), tree_scale_(tree.scale()) {
        if (tree.vertex_count() <= 0x10000)
            gather<uint16_t>(tree, first);
        else
            gather<uint32_t>(tree, first);
        for (size_t k = 0; k < 3; ++k) origin_[k] = rows_[k][0];
    }
    uint32_t count() const { return count_; }
    glm::dvec3 first_corner() const { return glm::dvec3(origin_[0], origin_[1], origin_[2]) * double{tree_scale_}; }
    /// As they stand in the file, before the tree's scale.
    const float* stored(size_t row) const { return rows_[row]; }
    /// The same, less the first corner's: coordinate row % 3 of corner row / 3, of the lanes from `i` on. A scale
    /// of the tree that is no power of two rounds it once more.
    Quad from_first(size_t row, size_t i) const { return stored_from_first(row, i) * tree_scale_; }

    /// Places the corners by x - first corner. Each lane of the result is the greatest of some of the coordinates.
    Quad place() {
        Quad most = broadcast<Quad>(0);
        for (size_t i = 0; i < kFour; i += kQuadLanes)
            for (size_t row = 0; row < 9; ++row) most = max(most, put(row, i, from_first(row, i)));
        return most;
    }
    /// Likewise by rotation (x - first corner) + shift.
    Quad place(const glm::dmat3& rotation, const glm::dvec3& shift) {
        Quad most = broadcast<Quad>(0);
        for (size_t i = 0; i < kFour; i += kQuadLanes)
            for (size_t corner = 0; corner < 9; corner += 3) {
                const Quad x = stored_from_first(corner, i), y = stored_from_first(corner + 1, i),
                           z = stored_from_first(corner + 2, i);
                for (glm::length_t k = 0; k < 3; ++k) {
                    const auto entry = [&](glm::length_t column) {
                        return static_cast<float>(rotation[column][k] * tree_scale_);
                    };
                    const Quad turned = entry(0) * x + entry(1) * y + entry(2) * z;
                    most = max(most, put(corner + static_cast<size_t>(k), i, turned + static_cast<float>(shift[k])));
                }
            }
        return most;
    }
    void scale(float scale) {
        for (size_t i = 0; i < kFour; i += kQuadLanes)
            for (size_t row = 0; row < 9; ++row) store(at(row, i) * scale, scaled_[row] + i);
    }
    const float* row(size_t row) const { return scaled_[row]; }

private:
    template <class Index> void gather(const TreeView& tree, uint32_t first) {
        const std::byte* index = tree.raw().triangles() + size_t{first} * 3 * sizeof(Index);
        alignas(16) float corner[3][kFour][4] = {}; // the fourth coordinate means nothing
        for (uint32_t i = 0; i < count_; ++i)
            for (auto& of_all : corner) {
                load_vertex(tree, load_le<Index>(index), of_all[i]);
                index += sizeof(Index);
            }
        for (size_t c = 0; c < 3; ++c) transpose(corner[c], rows_[3 * c], rows_[3 * c + 1], rows_[3 * c + 2]);
    }
    Quad stored_from_first(size_t row, size_t i) const { return at(row, i) - origin_[row % 3]; }
    Quad at(size_t row, size_t i) const { return load<Quad>(rows_[row] + i); }
    // Returns the sizes of what it stores, 0 in lanes without a triangle.
    Quad put(size_t row, size_t i, Quad x) {
        store(x, rows_[row] + i);
        return choose_or_zero(hn::FirstN(QuadTag(), count_ > i ? count_ - i : 0), abs(x));
    }

    uint32_t count_;
    float tree_scale_;
    float origin_[3];
    alignas(16) float rows_[9][kFour], scaled_[9][kFour];
};

// The power of two that brings x > 0 into [1/2, 1); 0, with which nothing is certified, if there is none.
inline float unit_scale(float x) {
    const uint32_t exponent = std::bit_cast<uint32_t>(x) >> 23;
    return exponent > 0 && exponent < 253 ? std::bit_cast<float>((253 - exponent) << 23) : 0;
}

inline float rounded_up(double x) {
    return static_cast<float>(x * (1 + 0x1p-22));
}

// Which triangles the pairs are made of: of A's `count`, remainder[count - 1][pair], of B's, quotient[count - 1][pair].
struct PairIndices {
    static constexpr size_t kPairs = kFour * kFour;
    int32_t remainder[kFour][kPairs], quotient[kFour][kPairs];
};
inline constexpr PairIndices kPairIndices = [] {
    PairIndices out{};
    for (size_t count = 1; count <= kFour; ++count)
        for (size_t pair = 0; pair < PairIndices::kPairs; ++pair) {
            out.remainder[count - 1][pair] = static_cast<int32_t>(pair % count);
            out.quotient[count - 1][pair] = static_cast<int32_t>(std::min(pair / count, kFour - 1));
        }
    return out;
}();

/// The triangles of these indices, a vector of them; the last one if there are not so many.
HWY_INLINE TriangleLanes pick(const FourTriangles& triangles, const int32_t* index) {
    const FloatTag tag;
    const hn::RebindToSigned<FloatTag> index_tag;
    const auto which =
        hn::Min(hn::LoadU(index_tag, index), hn::Set(index_tag, static_cast<int32_t>(triangles.count() - 1)));
    const auto row = [&](size_t k) {
        if constexpr (kFloatLanes < kFour)
            return hn::GatherIndex(tag, triangles.row(k), which);
        else
            return hn::TableLookupLanes(hn::LoadDup128(tag, triangles.row(k)), hn::IndicesFromVec(tag, which));
    };
    return {{{row(0), row(1), row(2)}, {row(3), row(4), row(5)}, {row(6), row(7), row(8)}}};
}

/// One to four triangles of each leaf, placed where float lanes take them.
class FourPair {
public:
    /// A's are placed already, which gave `most`.
    FourPair(FourTriangles& a, Quad most, FourTriangles& b, const RelativePose& b_to_a) : a_(a), b_(b) {
        const glm::dvec3 corner_a = a.first_corner(), corner_b = b.first_corner();
        const glm::dvec3 shift = b_to_a.rotation * corner_b + (b_to_a.translation - corner_a);
        const float largest = hn::GetLane(hn::MaxOfLanes(QuadTag(), max(most, b.place(b_to_a.rotation, shift))));
        scale_ = unit_scale(largest);
        a_.scale(scale_), b_.scale(scale_);
        // Corners are no farther from the bodies' origins than the first ones and what lies between: the diagonals of
        // cubes of `largest` and twice that.
        reach_ = (glm::length(corner_a) + glm::length(corner_b) + 3 * 1.7321 * double{largest} + b_to_a.distance) *
                 double{scale_};
    }
    /// Lanes' units in a metre; 0 if there is none.
    double scale() const { return scale_; }
    LaneMargins margins(double distance, const LaneMarginFactors& factors) const {
        return {.direction = rounded_up(factors.direction + kSeparationMargin * reach_),
                .corner_error = rounded_up(kPlacementError + 80 * 0x1p-53 * reach_),
                .distance = rounded_up(distance * scale())};
    }
    uint32_t pairs() const { return a_.count() * b_.count(); }
    /// Indices of the triangles of a pair.
    uint32_t in_a(uint32_t pair) const { return static_cast<uint32_t>(of_a()[pair]); }
    uint32_t in_b(uint32_t pair) const { return static_cast<uint32_t>(of_b()[pair]); }
    /// The triangles of the pairs from `pair` on.
    HWY_INLINE TriangleLanes lanes_a(size_t pair) const { return pick(a_, of_a() + pair); }
    HWY_INLINE TriangleLanes lanes_b(size_t pair) const { return pick(b_, of_b() + pair); }

private:
    const int32_t* of_a() const { return kPairIndices.remainder[a_.count() - 1]; }
    const int32_t* of_b() const { return kPairIndices.quotient[a_.count() - 1]; }

    FourTriangles &a_, &b_;
    float scale_;
    double reach_;
};

/// Calls visit(pair, first of A, first of B) for all fours of the leaves until it returns true.
template <class Visit>
HWY_INLINE void any_four_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                              const RelativePose& b_to_a, Visit&& visit) {
    for (uint32_t i = 0; i < in_a.count; i += kFour) {
        FourTriangles four_a(a, in_a.first + i, std::min<uint32_t>(in_a.count - i, kFour));
        const Quad most = four_a.place();
        for (uint32_t j = 0; j < in_b.count; j += kFour) {
            FourTriangles four_b(b, in_b.first + j, std::min<uint32_t>(in_b.count - j, kFour));
            if (visit(FourPair(four_a, most, four_b, b_to_a), in_a.first + i, in_b.first + j)) return;
        }
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

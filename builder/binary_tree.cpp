#include "builder/binary_tree.hpp"

#include "builder/job.hpp"

#include "src/symmetric3.hpp"

#include <prolate/tree.hpp>

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr uint32_t kSortedBelow = 128;                            // triangles of a part; above, bins find the split
constexpr uint32_t kLeastBins = 32, kMostBins = 256, kPerBin = 8; // triangles, about

// Where to cut a part in the order along an axis.
struct Cut {
    double cost = HUGE_VAL; // of both sides together
    uint32_t left = 0;      // triangles on the lower side; 0: no cut found
    size_t group = 0;       // the first on the upper side
};

// The best cut between consecutive groups of triangles, if it costs less than `limit`: `extents(g)` and `size(g)` of
// each. `right` is scratch. Either side's cost only grows with it, so that neither sweep goes on for long.
template <class ExtentsOf, class SizeOf>
Cut best_cut(size_t groups, double limit, std::span<double> right, ExtentsOf&& extents, SizeOf&& size) {
    Extents side;
    uint32_t count = 0;
    size_t first = groups; // below, the upper side alone costs too much
    while (first > 1) {    // cost of this group and all later ones
        side.add(extents(first - 1));
        const double cost = (count += size(first - 1)) * side.squared_width();
        if (cost >= limit) break;
        right[--first] = cost;
    }
    Cut best{.cost = limit};
    side = {}, count = 0;
    for (size_t g = 1; g < groups; ++g) {
        side.add(extents(g - 1));
        count += size(g - 1);
        if (g < first) continue;
        const double left = count * side.squared_width(), cost = left + right[g];
        if (cost < best.cost) best = {cost, count, g};
        if (left >= best.cost) break;
    }
    return best;
}

// The boxes' centers, from their mean, and axes along which they may be cut: principal ones, longest first, and the
// world's.
class Centers {
public:
    // `scratch` is for 3 floats a triangle.
    Centers(std::span<const Extents> extents, std::span<float> scratch) : size_(extents.size()) {
        Vec mean = Vec::Zero();
        for (const Extents& e : extents) mean += e.center();
        mean /= static_cast<double>(size_);
        Matrix3 covariance{};
        for (size_t k = 0; k < 3; ++k) at_[k] = scratch.subspan(k * size_, size_);
        for (size_t i = 0; i < size_; ++i) {
            const Vec d = extents[i].center() - mean;
            for (size_t k = 0; k < 3; ++k) at_[k][i] = static_cast<float>(d[int(k)]);
            for (size_t r = 0; r < 3; ++r)
                for (size_t c = 0; c <= r; ++c) covariance[r][c] += d[int(r)] * d[int(c)];
        }
        for (size_t r = 0; r < 3; ++r)
            for (size_t c = 0; c < r; ++c) covariance[c][r] = covariance[r][c];
        const Matrix3 v = eigen_symmetric(covariance).vectors; // columns
        for (size_t k = 0; k < 3; ++k)
            axes_[k] = {static_cast<float>(v[0][k]), static_cast<float>(v[1][k]), static_cast<float>(v[2][k])};
    }
    void heights(size_t axis, std::span<float> out) const {
        const auto [x, y, z] = axes_[axis];
        for (size_t i = 0; i < size_; ++i) out[i] = (x * at_[0][i] + y * at_[1][i]) + z * at_[2][i];
    }

private:
    size_t size_;
    std::array<std::span<float>, 3> at_;
    std::array<std::array<float, 3>, BinaryTree::kMostAxes> axes_{{{}, {}, {}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
};

// The height of a triangle in the upper half, as a number that grows with it, and its place: a total order.
uint64_t sort_key(float height, uint32_t place) {
    const auto bits = std::bit_cast<uint32_t>(height + 0.0f); // -0 is 0
    const uint32_t rising = bits >> 31 ? ~bits : bits | 0x80000000u;
    return uint64_t{rising} << 32 | place;
}
uint32_t place_in(uint64_t key) {
    return static_cast<uint32_t>(key);
}

// Bins of equal width over the heights: in which of them one is.
struct Bins {
    float low, scale;
    uint32_t count;
    explicit Bins(std::span<const float> heights) {
        const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
        count = std::clamp(static_cast<uint32_t>(heights.size()) / kPerBin, kLeastBins, kMostBins);
        low = *least, scale = static_cast<float>(count) / (*most - *least);
    }
    bool empty() const { return !std::isfinite(scale); }
    uint32_t operator()(float height) const {
        return std::min(static_cast<uint32_t>((height - low) * scale), count - 1);
    }
};

} // namespace

BinaryTree::BinaryTree(MeshView mesh, size_t axes, std::function<void()> report)
    : axes_(axes), report_(std::move(report)) {
    const auto count = static_cast<uint32_t>(mesh.triangles.size());
    extents_.resize(count), order_.resize(count), nodes_.resize(2 * size_t{count} - 1);
    std::iota(order_.begin(), order_.end(), 0u);
    for (uint32_t t = 0; t < count; ++t)
        for (const uint32_t v : mesh.triangles[t]) extents_[t].add(mesh.vertices[v]);
    split(0, {0, count}, kMaxLevels - 1);
}

// Puts the triangles `from`, places of the part, in this order.
void BinaryTree::reorder(const Part& p, std::span<const uint32_t> from) {
    const auto apply = [&](auto& of) {
        const std::vector before(of.begin() + p.begin, of.begin() + p.end);
        for (uint32_t i = 0; i < p.size(); ++i) of[p.begin + i] = before[from[i]];
    };
    apply(order_), apply(extents_);
}

// Cuts a part in two where it pays most, but leaves neither side with more than `most` triangles: else in halves across
// its longest axis. Orders the triangles accordingly; returns how many are left. Tries every cut, or those between
// bins.
uint32_t BinaryTree::cut_sorted(const Part& p, uint64_t most) {
    const uint32_t size = p.size();
    const std::span<const Extents> extents = std::span(extents_).subspan(p.begin, size);
    std::array<float, size_t{3} * kSortedBelow> scratch;
    const Centers centers(extents, scratch);
    std::array<uint64_t, kSortedBelow> keys, longest, chosen;
    Cut best;
    for (size_t axis = 0; axis < axes_; ++axis) {
        std::array<float, kSortedBelow> heights;
        std::array<double, kSortedBelow> right;
        centers.heights(axis, std::span(heights).first(size));
        for (uint32_t i = 0; i < size; ++i) keys[i] = sort_key(heights[i], i);
        std::sort(keys.begin(), keys.begin() + size);
        if (axis == 0) longest = chosen = keys;
        const Cut cut = best_cut(
            size, best.cost, right, [&](size_t i) -> const Extents& { return extents[place_in(keys[i])]; },
            [](size_t) { return 1u; });
        if (cut.cost < best.cost) best = cut, chosen = keys;
    }
    uint32_t left = best.left;
    if (left == 0 || std::max(left, size - left) > most) chosen = longest, left = size / 2;
    std::array<uint32_t, kSortedBelow> from;
    for (uint32_t i = 0; i < size; ++i) from[i] = place_in(chosen[i]);
    reorder(p, std::span(from).first(size));
    return left;
}

uint32_t BinaryTree::cut_binned(const Part& p, uint64_t most) {
    const uint32_t size = p.size();
    const std::span<const Extents> extents = std::span(extents_).subspan(p.begin, size);
    std::vector<float> scratch(3 * size_t{size});
    const Centers centers(extents, scratch);
    std::array<Cut, kMostAxes> cuts;
    const auto try_axis = [&](size_t axis) {
        std::vector<float> heights(size);
        centers.heights(axis, heights);
        const Bins bin_of(heights);
        if (bin_of.empty()) return;
        std::vector<Extents> bins(bin_of.count);
        std::vector<uint32_t> sizes(bin_of.count);
        for (uint32_t i = 0; i < size; ++i) {
            const uint32_t bin = bin_of(heights[i]);
            bins[bin].add(extents[i]);
            ++sizes[bin];
        }
        std::vector<double> right(bin_of.count);
        cuts[axis] = best_cut(
            bin_of.count, HUGE_VAL, right, [&](size_t g) -> const Extents& { return bins[g]; },
            [&](size_t g) { return sizes[g]; });
    };
    if (size > kParallelAbove)
        parallel_for(size_t{0}, axes_, try_axis);
    else
        for (size_t a = 0; a < axes_; ++a) try_axis(a);
    const auto cheapest = std::min_element(
        cuts.begin(), cuts.end(), [](const Cut& x, const Cut& y) { return x.cost < y.cost; }); // first of equals
    std::vector<float> heights(size);
    std::vector<uint32_t> from(size);
    uint32_t left = cheapest->left;
    if (left == 0 || std::max(left, size - left) > most) {
        centers.heights(0, heights);
        left = size / 2;
        std::iota(from.begin(), from.end(), 0u);
        std::nth_element(from.begin(), from.begin() + left, from.end(),
                         [&](uint32_t i, uint32_t j) { return sort_key(heights[i], i) < sort_key(heights[j], j); });
        std::sort(from.begin(), from.begin() + left), std::sort(from.begin() + left, from.end());
    } else {
        centers.heights(static_cast<size_t>(cheapest - cuts.begin()), heights);
        const Bins bin_of(heights);
        uint32_t next_left = 0, next_right = left;
        for (uint32_t i = 0; i < size; ++i) from[bin_of(heights[i]) < cheapest->group ? next_left++ : next_right++] = i;
    }
    reorder(p, from);
    return left;
}

// Makes nodes_[index] of the part and all below it, in at most so many levels; returns the part's extents.
Extents BinaryTree::split(uint32_t index, const Part& p, uint32_t levels) {
    Node& node = nodes_[index];
    node.part = p;
    if (p.size() > kSortedBelow) checkpoint(); // all below takes a millisecond
    Extents all;
    if (p.size() == 1) {
        all = extents_[p.begin];
        report_();
    } else {
        const uint64_t most = uint64_t{1} << (levels - 1);
        node.left = p.size() == 2 ? 1 : p.size() > kSortedBelow ? cut_binned(p, most) : cut_sorted(p, most);
        const uint32_t middle = p.begin + node.left;
        Extents right;
        const auto make_left = [&] { all = split(left_of(index), {p.begin, middle}, levels - 1); };
        const auto make_right = [&] { right = split(right_of(index), {middle, p.end}, levels - 1); };
        if (p.size() > kParallelAbove)
            parallel_invoke(make_left, make_right);
        else
            make_left(), make_right();
        all.add(right);
    }
    node.squared_width = all.squared_width();
    return all;
}

} // namespace prolate

#include "builder/binary_tree.hpp"

#include "builder/job.hpp"

#include "src/symmetric3.hpp"

#include <prolate/tree.hpp>

#include <algorithm>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr uint32_t kSortedBelow = 128;                            // triangles of a part; above, bins find the split
constexpr uint32_t kLeastBins = 32, kMostBins = 256, kPerBin = 8; // triangles, about

} // namespace

BinaryTree::BinaryTree(MeshView mesh, std::function<void()> report) : report_(std::move(report)) {
    const auto count = static_cast<uint32_t>(mesh.triangles.size());
    extents_.resize(count), order_.resize(count), nodes_.resize(2 * size_t{count} - 1);
    std::iota(order_.begin(), order_.end(), 0u);
    parallel_for(0u, count, [&](uint32_t t) {
        for (const uint32_t v : mesh.triangles[t]) extents_[t].add(mesh.vertices[v]);
    });
    split(0, {0, count}, kMaxLevels - 1);
}

std::vector<BinaryTree::Key> BinaryTree::keys(const Part& p, const Vec& axis) const {
    std::vector<Key> out(p.size());
    for (uint32_t i = 0; i < p.size(); ++i) {
        const uint32_t triangle = order_[p.begin + i];
        out[i] = {axis.dot(extents_[triangle].center()), triangle};
    }
    return out;
}

// The best cut between consecutive groups of triangles.
BinaryTree::Cut BinaryTree::best_cut(std::span<const Group> groups) {
    std::vector<double> right(groups.size()); // cost of this group and all later ones
    Group side;
    const auto take = [&side](const Group& group) {
        side.extents.add(group.extents);
        side.triangles += group.triangles;
    };
    for (size_t g = groups.size(); g-- > 0;) {
        take(groups[g]);
        right[g] = side.triangles * side.extents.squared_width();
    }
    Cut best;
    side = {};
    for (size_t g = 0; g + 1 < groups.size(); ++g) {
        take(groups[g]);
        const double cost = side.triangles * side.extents.squared_width() + right[g + 1];
        if (cost < best.cost) best = {cost, side.triangles};
    }
    return best;
}

BinaryTree::Cut BinaryTree::cut_sorted(const Part& p, const Vec& axis) const {
    std::vector<Key> sorted = keys(p, axis);
    std::sort(sorted.begin(), sorted.end());
    std::vector<Group> groups(p.size());
    for (uint32_t i = 0; i < p.size(); ++i) groups[i] = {extents_[sorted[i].second], 1};
    return best_cut(groups);
}

// The same, but only between bins of equal width.
BinaryTree::Cut BinaryTree::cut_binned(const Part& p, const Vec& axis) const {
    const std::vector<Key> all = keys(p, axis);
    const auto [low, high] = std::minmax_element(all.begin(), all.end());
    const uint32_t count = std::clamp(p.size() / kPerBin, kLeastBins, kMostBins);
    const double scale = count / (high->first - low->first);
    if (!std::isfinite(scale)) return {};
    std::vector<Group> bins(count);
    for (const auto& [h, triangle] : all) {
        Group& bin = bins[std::min(static_cast<uint32_t>((h - low->first) * scale), count - 1)];
        bin.extents.add(extents_[triangle]);
        ++bin.triangles;
    }
    std::erase_if(bins, [](const Group& bin) { return bin.triangles == 0; });
    return best_cut(bins);
}

// The principal axes of the boxes' centers, longest first.
std::array<Vec, 3> BinaryTree::principal_axes(const Part& p) const {
    Vec mean = Vec::Zero();
    for (uint32_t i = p.begin; i < p.end; ++i) mean += extents_[order_[i]].center();
    mean /= p.size();
    Matrix3 covariance{};
    for (uint32_t i = p.begin; i < p.end; ++i) {
        const Vec d = extents_[order_[i]].center() - mean;
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) covariance[size_t(r)][size_t(c)] += d[r] * d[c];
    }
    const Matrix3 axes = eigen_symmetric(covariance).vectors; // columns
    return {Vec(axes[0][0], axes[1][0], axes[2][0]), Vec(axes[0][1], axes[1][1], axes[2][1]),
            Vec(axes[0][2], axes[1][2], axes[2][2])};
}

// Cuts a part, of 2 triangles or more, in two where it pays most, but leaves neither side with more than `most`
// triangles: else in halves across its longest axis. Orders the triangles accordingly; returns how many are left.
uint32_t BinaryTree::cut(const Part& p, uint64_t most) {
    if (p.size() == 2) return 1;
    const auto [first, second, third] = principal_axes(p);
    const std::array<Vec, 6> axes{first, second, third, Vec::UnitX(), Vec::UnitY(), Vec::UnitZ()};
    std::array<Cut, 6> cuts;
    const auto try_axis = [&](size_t a) {
        cuts[a] = p.size() > kSortedBelow ? cut_binned(p, axes[a]) : cut_sorted(p, axes[a]);
    };
    if (p.size() > kParallelAbove)
        parallel_for(size_t{0}, cuts.size(), try_axis);
    else
        for (size_t a = 0; a < cuts.size(); ++a) try_axis(a);
    const auto cheaper = [](const Cut& x, const Cut& y) { return x.cost < y.cost; };
    const auto cheapest = std::min_element(cuts.begin(), cuts.end(), cheaper); // the first of equals
    Vec axis = axes[static_cast<size_t>(cheapest - cuts.begin())];
    uint32_t left = cheapest->left;
    if (left == 0 || std::max(left, p.size() - left) > most) axis = first, left = p.size() / 2;

    std::vector<Key> all = keys(p, axis);
    const auto middle = all.begin() + left;
    std::nth_element(all.begin(), middle, all.end());
    const Key first_right = *middle;
    // Both sides keep their order, whatever order nth_element left.
    std::stable_partition(order_.begin() + p.begin, order_.begin() + p.end, [&](uint32_t triangle) {
        return Key(axis.dot(extents_[triangle].center()), triangle) < first_right;
    });
    return left;
}

// Makes nodes_[index] of the part and all below it, in at most so many levels; returns the part's extents.
Extents BinaryTree::split(uint32_t index, const Part& p, uint32_t levels) {
    Node& node = nodes_[index];
    node.part = p;
    checkpoint();
    Extents all;
    if (p.size() == 1) {
        all = extents_[order_[p.begin]];
        report_();
    } else {
        node.left = cut(p, uint64_t{1} << (levels - 1));
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

#include "builder/central.hpp"

#include <algorithm>
#include <numeric>

namespace prolate {

CentralTree::CentralTree(std::span<const Fit> fits) : fits_(fits), order_(fits.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    if (!fits.empty()) grow(0, static_cast<uint32_t>(fits.size()));
}

void CentralTree::grow(uint32_t begin, uint32_t end) {
    constexpr uint32_t kLeaf = 4;
    Node node;
    node.begin = begin, node.end = end;
    for (uint32_t k = begin; k < end; ++k) {
        node.centers.add(fits_[order_[k]].center);
        node.reach = std::max(node.reach, fits_[order_[k]].factor.norm()); // Frobenius: no singular value is larger
    }
    const size_t at = nodes_.size();
    nodes_.push_back(node);
    if (end - begin <= kLeaf) return;
    int axis = 0;
    node.centers.size().maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                         const double x = fits_[a].center[axis], y = fits_[b].center[axis];
                         return x != y ? x < y : a < b;
                     });
    grow(begin, middle);
    nodes_[at].right = static_cast<uint32_t>(nodes_.size());
    grow(middle, end);
}

} // namespace prolate

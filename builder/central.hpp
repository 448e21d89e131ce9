// Which of many ellipsoids has a point most centrally, without asking each of them.
//
// A tree of boxes around the ellipsoids' centers. An ellipsoid without a semi-axis above r has a point at distance d
// from its center at a radial coordinate of d / r or more, which leaves out whole boxes. O(n log^2 n) to make;
// O(log n) a question where the ellipsoids are about alike and evenly spread, O(n) at worst.
#pragma once

#include "builder/fit.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace prolate {

class CentralTree {
public:
    /// Keeps `fits`.
    explicit CentralTree(std::span<const Fit> fits);

    /// The ellipsoid i whose radial_squared(p) is least, and below `least`; the first of equal ones. Thread-safe.
    std::optional<uint32_t> find(const Vec& p, double least) const {
        std::optional<uint32_t> found;
        std::array<uint32_t, 64> stack; // one waits on each level, and the tree is balanced
        size_t waiting = 0;
        if (!nodes_.empty()) stack[waiting++] = 0;
        while (waiting > 0) {
            const Node& node = nodes_[stack[--waiting]];
            if (node.bound(p) > least) continue;
            if (node.right == 0) {
                for (uint32_t k = node.begin; k < node.end; ++k) {
                    const uint32_t i = order_[k];
                    const double radial = fits_[i].radial_squared(p);
                    if (radial < least || (radial == least && found && i < *found)) least = radial, found = i;
                }
                continue;
            }
            const uint32_t left = static_cast<uint32_t>(&node - nodes_.data()) + 1;
            const bool left_first = nodes_[left].bound(p) <= nodes_[node.right].bound(p);
            stack[waiting++] = left_first ? node.right : left;
            stack[waiting++] = left_first ? left : node.right;
        }
        return found;
    }

private:
    struct Node {
        Box centers;
        double reach = 0;            // no semi-axis is longer
        uint32_t begin = 0, end = 0; // of order_
        uint32_t right = 0;          // the left child is the next node; 0: a leaf

        // Below radial_squared(p) of each ellipsoid in it, rounding included.
        double bound(const Vec& p) const {
            const Vec nearest = p.cwiseMax(centers.low).cwiseMin(centers.high);
            return (1 - 1e-6) * (p - nearest).squaredNorm() / (reach * reach);
        }
    };
    void grow(uint32_t begin, uint32_t end);

    std::span<const Fit> fits_;
    std::vector<uint32_t> order_;
    std::vector<Node> nodes_;
};

} // namespace prolate

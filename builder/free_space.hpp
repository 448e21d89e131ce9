// Where the center of a ball may be: the distance from the surface at the nodes of a lattice around the mesh, never
// overstated. What fill.hpp and passages.hpp say of balls rests on it.
//
// Between two nodes that are `length` apart, the distance from the surface is nowhere below half of (their distances
// less `length`), because it changes by no more than one moves. So a step is free for a ball of radius r if
// a + b - length >= 2 r, and neither lattice nor rounding lets a ball through where it does not fit.
#pragma once

#include "builder/eigen.hpp"
#include "builder/triangle_tree.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace prolate {

/// Steps to the neighbours of a node.
inline constexpr int kNeighbours = 26;
constexpr std::array<int, 3> neighbour(int number) {
    const int cell = number < kNeighbours / 2 ? number : number + 1; // the middle one is the node itself
    return {cell / 9 - 1, cell / 3 % 3 - 1, cell % 3 - 1};
}

class FreeSpace {
public:
    /// Nodes at multiples of `pitch` from half a pitch on (centers of the cells of such a lattice), in `region` and one
    /// beyond it. Distances are right to rounding between `from` and `to` metres; below they may be 0, and above, less
    /// than they are. In parallel.
    FreeSpace(const TriangleTree& surface, const Box& region, double pitch, double from, double to);

    double pitch() const { return pitch_; }
    const std::array<int, 3>& size() const { return size_; }
    size_t count() const { return distance_.size(); }
    size_t index(int i, int j, int k) const {
        return (static_cast<size_t>(i) * static_cast<size_t>(size_[1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(size_[2]) +
               static_cast<size_t>(k);
    }
    std::array<int, 3> place(size_t index) const {
        const auto z = static_cast<size_t>(size_[2]), y = static_cast<size_t>(size_[1]);
        return {static_cast<int>(index / (y * z)), static_cast<int>(index / z % y), static_cast<int>(index % z)};
    }
    bool is_border(const std::array<int, 3>& at) const {
        bool border = false;
        for (size_t a = 0; a < 3; ++a) border = border || at[a] == 0 || at[a] == size_[a] - 1;
        return border;
    }
    /// Calls visit(number, index) for each neighbour(number) of the node that there is.
    template <class Visit> void for_each_neighbour(size_t node, Visit&& visit) const {
        const std::array<int, 3> at = place(node);
        const bool border = is_border(at);
        for (int n = 0; n < kNeighbours; ++n) {
            const std::array<int, 3> by = neighbour(n);
            bool outside = false;
            for (size_t a = 0; border && a < 3; ++a)
                outside = outside || at[a] + by[a] < 0 || at[a] + by[a] >= size_[a];
            if (!outside) visit(n, node + index(by[0], by[1], by[2])); // modulo 2^64, if a step is negative
        }
    }
    /// A corner of cell (i, j, k), whose center is the node. As far as pitch and place allow, a float.
    Vec corner(int i, int j, int k) const { return pitch_ * Vec(first_[0] + i, first_[1] + j, first_[2] + k); }
    Vec node(const std::array<int, 3>& at) const { return corner(at[0], at[1], at[2]) + Vec::Constant(0.5 * pitch_); }
    /// Metres from the surface, or less.
    double distance(size_t index) const { return double{distance_[index]}; }

private:
    struct Block {
        std::array<int, 3> low, high; // nodes, high excluded
    };
    void measure(const TriangleTree& surface, const Block& block);

    double pitch_, from_, to_, rounding_;
    std::array<double, 3> first_{}; // of the cells, in pitches: whole numbers
    std::array<int, 3> size_{};
    std::vector<float> distance_;
};

/// At least `length`, with so few bits that multiples of it are exact as long as they can be.
double round_pitch(double length);

} // namespace prolate

// Borders of ellipsoids, sampled: which points of them other ellipsoids hide.
//
// Descents ask this of all ellipsoids in each iteration. So all points are asked at once, in loops over floats that
// compilers turn into vector instructions. Every lane is computed by itself: the numbers are the same on all machines.
#pragma once

#include "builder/fit.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

class Random;

/// Directions evenly spread over the sphere (a Fibonacci lattice, Gonzalez 2010), by arithmetic that is the same on
/// every machine.
std::vector<Vec> even_directions(int count);

/// A rotation, drawn uniformly.
Mat random_rotation(Random& random);

/// Even directions u, which stand for the points center + factor u of an ellipsoid's border. They are asked in blocks
/// of directions that are near each other, as most others hide only a cap of the border.
class BorderSamples {
public:
    explicit BorderSamples(int count);

    /// They become `rotation` times what they were at first.
    void turn(const Mat& rotation);

    /// Block by block.
    std::span<const Vec> directions() const { return turned_; }

    /// For each direction, 1 if one of fits[others] holds that point of the border of `fit`, else 0: to some 1e-6 of
    /// the radial coordinate. At least as long as directions(). Faster if those that hide most come first. Thread-safe.
    std::vector<uint32_t> hidden(const Fit& fit, std::span<const Fit> fits, std::span<const uint32_t> others) const;

private:
    static constexpr size_t kBlock = 16;
    struct Block {
        alignas(16) std::array<float, kBlock> x, y, z; // the last one's are filled up with copies
        Vec middle;
        double radius; // |u - middle| of its directions is at most that
    };
    struct Hider;

    const std::vector<Vec> even_;
    std::vector<Vec> turned_;
    std::vector<Block> blocks_;
};

/// How deep `other` reaches into `fit`, along the line of their centers in the coordinates that make `fit` the unit
/// ball, were both `margin` times as large. They are apart if that is below 0.
double depth(const Fit& fit, const Fit& other, double margin = 1);

} // namespace prolate

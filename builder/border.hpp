// Borders of ellipsoids, sampled: which points of them other ellipsoids hide.
//
// Descents ask this of all ellipsoids in each iteration. So all points are asked at once, in loops over floats that
// compilers turn into vector instructions. Every lane is computed by itself: the numbers are the same on all machines.
#pragma once

#include "builder/fit.hpp"

#include <span>
#include <vector>

namespace prolate {

class Random;

/// Directions evenly spread over the sphere (a Fibonacci lattice, Gonzalez 2010), by arithmetic that is the same on
/// every machine.
std::vector<Vec> even_directions(int count);

/// A rotation, drawn uniformly.
Mat random_rotation(Random& random);

/// Even directions u, which stand for the points center + factor u of an ellipsoid's border.
class BorderSamples {
public:
    explicit BorderSamples(int count);

    /// They become `rotation` times what they were at first.
    void turn(const Mat& rotation);

    std::span<const Vec> directions() const { return turned_; }

    /// Marks the points of `fit`'s border that `other` holds: sets hidden[i] of the i-th direction, and leaves those
    /// beside it. To some 1e-6 of the radial coordinate. Thread-safe.
    void hide(const Fit& fit, const Fit& other, std::span<uint32_t> hidden) const;

private:
    const std::vector<Vec> even_;
    std::vector<Vec> turned_;
    std::vector<float> x_, y_, z_; // of turned_
};

/// Is there a plane between the two, were they `margin` times as large, across the line of their centers in the
/// coordinates that make `fit` the unit ball? Then they are apart.
bool apart(const Fit& fit, const Fit& other, double margin);

} // namespace prolate

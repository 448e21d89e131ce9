// The frames that queries work in: lattice coordinates of a tree, x = metres / step - origin, in which the centers of
// its nodes are as stored, 32nds from 0 to 65535, whatever the tree's scale. Steps are powers of two, or of a scaled
// tree such a one times a float; then lengths are rounded once more in double precision.
#pragma once

#include "query/ellipsoid/placed.hpp"
#include "src/lattice.hpp"

#include <prolate/tree.hpp>

#include <cstdint>

namespace prolate::query {

/// From one body's lattice coordinates to another's: x_to = linear x_from + offset, where `linear` is a rotation times
/// `scale`. All NaN if the relative pose is.
struct LatticePose {
    // Vectors of four, for kernels; the fourth component repeats the first.
    alignas(32) double linear[3][4]; ///< columns
    alignas(32) double offset[4];
    alignas(16) float linear_rounded[3][4]; ///< columns
    float scale;                            ///< step_from / step_to
    /// Bounds every length that entered a coordinate of x_to, in its lattice's steps, for a stored center. Rounding in
    /// double then costs less than 2^-44 of it (the terms: query/ellipsoid/separation.hpp).
    double reach;
    int32_t exponent_from; ///< step exponent of the lattice that x_from lies in
};

LatticePose lattice_pose(const RelativePose& from_to, const LatticeInfo& from, const LatticeInfo& to) noexcept;

} // namespace prolate::query

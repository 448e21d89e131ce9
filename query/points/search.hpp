// One point against a tree: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp)
// share. Everything in the frame of the tree, in metres.
#pragma once

#include "query/ellipsoid/placed.hpp"
#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"

#include <prolate/points.hpp>

#include <glm/vec3.hpp>

#include <cstdint>
#include <limits>

namespace prolate::query {

/// A point as the traversal sees it, in the lattice coordinates of a tree.
struct LatticeProbe {
    double position[3];
    double slack; ///< bounds the error of each coordinate, steps
};

/// What all searches around a point share. Squares are of distances in lattice steps.
struct PointSearch {
    TreeSide side;
    const PlacedPoint point;
    const LatticeProbe probe;
    const uint64_t max_tests;
    Scratch::Entry* const stack;
    QueryStats stats;
    float limit = std::numeric_limits<float>::infinity(); ///< nodes whose square is above it need not be looked at
    float open = std::numeric_limits<float>::infinity();  ///< least square of those left when the budget ran out
    bool in_root_box = false;                             ///< no: the point is outside of all

    PointSearch(const TreeView& tree, const PlacedPoint& placed, Scratch context, uint64_t most_tests) noexcept;
    uint64_t left() const noexcept { return tests_left(max_tests, stats.tests()); }
    /// A lower bound of the distance whose square is at least `square`, metres.
    double metres(float square) const noexcept;
    /// At least the square of so many metres.
    float square_of(double metres) const noexcept;
};

/// Looks for the nearest leaf.
struct NearestSearch : PointSearch {
    NearestSearch(const TreeView& tree, const PlacedPoint& placed, Scratch context, uint64_t most_tests,
                  bool of_ellipsoids) noexcept
        : PointSearch(tree, placed, context, most_tests), ellipsoids(of_ellipsoids) {}

    static constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const bool ellipsoids;      ///< leaves are; else triangles, or nothing but boxes of a prefix
    double decided = kInfinity; ///< no leaf that was looked at is nearer
    double upper = kInfinity;   ///< the nearest one is no farther
    double square = kInfinity;  ///< its distance as computed, squared
    glm::dvec3 nearest{0, 0, 0};
    glm::dvec3 normal{0, 0, 0}; ///< of the surface there, of any length
    uint32_t node = 0, triangle = kNoTriangle;

    double farthest = kInfinity; ///< leaves that are farther than this need not be looked at, metres

    /// A leaf without triangles that is not nearer than `bound`. False, and nothing done, if the budget does not
    /// suffice.
    bool leaf(uint32_t slot, double bound) noexcept;
    /// Nothing farther than this triangle need be looked at.
    void hint(uint32_t t) noexcept;

    /// A triangle that is not nearer than `bound`.
    void try_triangle(uint32_t slot, uint32_t t, double bound) noexcept;
    /// Lowers `farthest` and `limit`.
    void look_within(double distance) noexcept;

private:
    void try_ellipsoid(uint32_t slot, double bound) noexcept;
};

/// Looks at all leaf ellipsoids that hold the point, and at the farthest point of these along `direction`.
struct DepthSearch : PointSearch {
    using PointSearch::PointSearch;

    const glm::dvec3* direction = nullptr; ///< unit; null: look for the deepest ellipsoid instead
    double depth = 0;                      ///< certified, of the deepest, and the way out of it
    glm::dvec3 way_out{0, 0, 1};
    uint32_t node = 0;
    double exit = 0; ///< of all, the farthest

    bool leaf(uint32_t slot, double bound) noexcept;
};

/// All leaves within `limit`, which the search may lower; nearest first, roughly.
void traverse(NearestSearch& search) noexcept;
void traverse(DepthSearch& search) noexcept;

} // namespace prolate::query

// What a tree knows of how its mesh deforms (TreeView::deformation()): a *bounded deformation tree*.
//
// A body deforms by modes: each vertex x of its mesh moves to x + sum over i of q_i U_i(x), and each point of a
// triangle by the same combination of its corners' displacements as it is of its corners. The q_i are the body's
// coordinates, |q_i| <= range(i). Modes are those of a simulation, or blend shapes.
//
// A node stands for all triangles that meet the leaf ellipsoids below it (of exact trees: the triangles below it). For
// each mode it has a shift d_i, and either a growth g_i >= |L^-1 (U_i(x) - d_i)| for every corner x of these, L the
// factor of TreeView::bound(), or a radius r_i >= |U_i(x) - d_i|: what enlarges the node less, a radius where it is
// flat. So for all coordinates in range, all points within sum |q_i| r_i of the ellipsoid {c + sum q_i d_i + (1 + sum
// |q_i| g_i) L u : |u| <= 1} hold what the node stands for, wherever it has moved: a point c + L v moves to c + L v +
// sum q_i (d_i + L w_i), |w_i| <= g_i, or c + L v + sum q_i (d_i + w_i), |w_i| <= r_i. No vertex need be looked at.
//
// The idea is that of D. L. James, D. K. Pai, "BD-Tree: Output-Sensitive Collision Detection for Reduced Deformable
// Models", ACM Transactions on Graphics 23 (SIGGRAPH), 2004, whose nodes are spheres.
#pragma once

#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

inline constexpr uint32_t kMaxModes = 64; ///< most modes of a tree

/// A view of the section of a file that open() has checked (src/FORMAT.md, "DFRM"). Cheap to copy. Safe to share
/// between threads.
class Deformation {
public:
    /// What a unit of a mode does to a node's bound.
    struct Motion {
        double shift[3]; ///< of the center, metres
        double growth;   ///< share of itself by which the ellipsoid grows, at least 0
        double radius;   ///< and how far from it points may be, metres, at least 0
    };

    uint32_t mode_count() const noexcept; ///< 1 ... kMaxModes
    /// Largest absolute value of coordinate `mode` < mode_count() for which the bounds hold; above 0.
    float range(uint32_t mode) const noexcept;
    /// Of the node in `slot`, exactly as stored.
    Motion motion(uint32_t slot, uint32_t mode) const noexcept;

    /// What the coordinates `q`, mode_count() of them, do together: sums over the modes.
    struct Moved {
        double shift[3] = {};   ///< metres
        double lengths[3] = {}; ///< of the shifts' absolute values: what rounding is a share of
        double growth = 0, radius = 0;
    };
    /// To the bound of the node in `slot`; it has motion() for each mode.
    Moved moved(uint32_t slot, std::span<const float> q) const noexcept;

    /// Points of the mesh whose displacements are known. Of exact trees, the vertices, by their numbers. Else one
    /// vertex of each connected part of the surface, with which queries ask whether a body lies inside another.
    uint32_t point_count() const noexcept;
    /// Where point `p` < point_count() of a tree without triangles is while all coordinates are 0, metres.
    Vec3 point(uint32_t p) const noexcept;
    /// U_mode of point `p`, metres.
    Vec3 displacement(uint32_t p, uint32_t mode) const noexcept;
    /// What coordinates do to point `p`: its growth and radius are 0.
    Moved displaced(uint32_t p, std::span<const float> q) const noexcept;

private:
    friend class TreeView;
    Deformation(std::span<const std::byte> content, uint32_t slots, bool exact) noexcept
        : content_(content), slots_(slots), exact_(exact) {}
    std::span<const std::byte> content_;
    uint32_t slots_;
    bool exact_;
};

} // namespace prolate

// How far a placed body reaches along the axes of the world, both ways: what its box is made of.
//
// A body is what queries answer for: the triangles of an exact tree, else the ellipsoids of the leaves (of a prefix:
// those of the cut at its last level).
//
// Each direction is searched by itself, best first (branch and bound). The box of every node bounds what its part of
// the body reaches, and of inner nodes of exact trees the hull does, far closer; that node is opened next which may
// reach farthest. A leaf's triangles, or its ellipsoid, settle it. The search ends when no node can reach farther than
// the body certainly does by more than a tolerance, or after kMostOpened nodes; so the result holds, whatever ends the
// search, and costs no more than that. Where boxes hold no more than a node's own (nested_boxes()), all leaves are
// asked.
//
// Rounding, in the terms and with the bounds of query/ellipsoid/separation.hpp, body A being the world (identity, so T
// = R, whose rows are the world's axes). u = 2^-53, norms of rows are 1; c and L are an ellipsoid's, b and h the center
// and half of a box, w <= 1 a hull's point, p a corner:
//   ellipsoid   r.c 75 u |c|, L^T r 74 u |L|, its norm 4 u more, their sum 2 u (|c| + |L|)
//   hull        v = L^T r as before, v.w 3 products and 2 sums, share |v|: 84 u |L| in all; r.c as before
//   box         r.b 75 u |b|, |r|.h 75 u |h|; their sum 2 u more
//   corner      r.p 75 u |p|
// In all less than 84 u S, S = |c| + |L|, |b| + |h| or |p|, for which the sums of all components stand, and of which
// kSeparationMargin S, 256 u S, is added.
//
// Cost: some 4 nodes opened and 10 hulls looked at, for each of the six directions.
#pragma once

#include "query/ellipsoid/separation.hpp"

#include <prolate/tree.hpp>

#include <cstdint>

namespace prolate::query {

/// Along x, y, z and -x, -y, -z, metres from the image of the tree's origin.
struct Reach {
    double at[6];
};

/// Of how large the body is along an axis, what may be lost on each side.
inline constexpr double kReachTolerance = 0x1p-9;

/// The pose must be finite. The last argument is there only so that the tests can show that a wrong one is caught.
Reach reach(const TreeView& tree, const RelativePose& to_world, double tolerance = kReachTolerance,
            double rounding = kSeparationMargin) noexcept;

} // namespace prolate::query

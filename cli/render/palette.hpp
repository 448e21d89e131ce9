// Colours of the nodes: each node of level 1 has its own hue, and its descendants keep it.
#pragma once

#include <prolate/tree.hpp>

#include <cstdint>
#include <vector>

#include <glm/glm.hpp>

namespace prolate::cli {

/// A colour in OKLCH: perceived lightness 0 ... 1, chroma, hue in radians.
struct Oklch {
    double lightness = 0, chroma = 0, hue = 0;
};

Oklch to_oklch(const glm::dvec3& linear_rgb);
/// Linear sRGB in 0 ... 1. A colour outside of sRGB loses chroma until it fits; lightness and hue stay.
glm::dvec3 to_linear_rgb(Oklch colour);

double srgb_encode(double linear);
double srgb_decode(double encoded);

/// Colour of the i-th of n siblings below the root. Up to eight come from the palette of Okabe and Ito, "Color
/// Universal Design" (2008), which readers with any common colour vision can tell apart; its black, useless under
/// shading, is replaced by Tol's wine. More are spaced evenly in hue, in three alternating lightnesses.
Oklch branch_colour(uint32_t i, uint32_t n);

/// The neutral grey of the root and of meshes.
inline constexpr Oklch kNeutral = {0.80, 0.004, 1.2};

/// Of the outer cover where an inner one is shown: its nodes' own hues would be taken for it.
inline constexpr Oklch kOuter = {0.77, 0.13, 1.25};
/// Of an inner cover, where a section shows it in the mesh.
inline constexpr Oklch kInner = {0.52, 0.09, 4.1};

/// Linear sRGB colour of every node of `tree`, by slot. Below level 1 only the lightness differs from the
/// ancestor's, so that neighbouring siblings can be told apart.
std::vector<Oklch> node_colours(const TreeView& tree);

/// Linear sRGB of a share in 0 ... 1 (beyond: as at the end) on the map "viridis" of S. van der Walt and N. Smith
/// (2015; CC0): equal steps look equal, also to readers with any common colour vision and in grey.
glm::dvec3 heat_colour(double share);

} // namespace prolate::cli

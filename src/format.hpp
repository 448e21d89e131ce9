// Writing .etree files (src/FORMAT.md is normative). TreeView reads them: open.cpp checks, tree.cpp decodes.
//
// A node's numbers are integers times powers of two, so that decoding is exact and the same everywhere:
//     center = (origin + q + r / 32) * 2^step_exponent   q: three uint16, r: three times 5 bits; a float holds it
//     l_ii   = d_i^2 * 2^(exponent - 30)                d: three uint16, 1 ... 65535
//     l_ij   = o_j |o_j| * 2^(exponent - 30)            o: three int16      both rounded to a float
// Squares, because the entries of a thin ellipsoid's factor are both large and small: where the largest is 1, steps at
// 1 are 6e-5, and at 1e-4 they are 6e-7, so that needles and sheets of axis ratios of 10^4 keep their shape. A step of
// a large entry tilts a sheet, though; builder/cover.cpp looks for large entries whose roundings go well together.
// Writing rounds to nearest; the builder then scales the *decoded* ellipsoid until it covers (builder/cover.cpp).
#pragma once

#include "src/power_of_two.hpp"

#include <prolate/tree.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

namespace prolate::format {

using Lattice = LatticeInfo;

inline constexpr int32_t kMaxCoordinate = 1 << 24; ///< |origin + q| stays below: integers that a float holds exactly
inline constexpr int kCenterBits = 24;             ///< significant ones of origin + q + r / 32: those of a float
inline constexpr int32_t kMinStepExponent = -112, kMaxStepExponent = 60;
inline constexpr int32_t kMinNodeExponent = -90, kMaxNodeExponent = 100; ///< no entry is subnormal

/// What an integer of a node's factor stands for, before it is rounded to a float.
inline double entry(int32_t q, int32_t exponent) noexcept {
    return static_cast<double>(q) * std::abs(q) * power_of_two(exponent - 30);
}
/// The integer whose entry is nearest.
inline int32_t nearest_entry(double value, int32_t exponent) noexcept {
    const double square = std::abs(value) * power_of_two(30 - exponent), q = std::floor(std::sqrt(square));
    const bool up = square - q * q > (q + 1) * (q + 1) - square;
    return static_cast<int32_t>(std::copysign(std::min(up ? q + 1 : q, 1e6), value)); // no integer reaches 1e6
}

/// A node as stored, but for the place of its children or triangles, which encode() finds.
struct PackedNode {
    uint16_t center[3] = {};
    uint8_t fraction[3] = {};         // of a step, 32nds, by which the center lies beyond
    uint16_t diagonal[3] = {1, 1, 1}; // l11, l22, l33
    int16_t off_diagonal[3] = {};     // l21, l31, l32
    int8_t exponent = 0;
    uint8_t child_count = 0;
    // The node's box, metres: around its triangles if exact. Empty as here: around its ellipsoid.
    double box_low[3] = {1, 1, 1}, box_high[3] = {0, 0, 0};
    uint8_t triangle_count = 0; // of a leaf of an exact tree
};

/// Lattice for centers inside the box [low, high], all finite: the finest step for which 2^16 steps reach across, a
/// float holds every center exactly, and `size`, the largest half extent of a node, takes at most 2^20 steps. So nodes
/// whose centers all but coincide, and their boxes, keep within what single precision holds.
Lattice lattice_for(const double low[3], const double high[3], double size = 0) noexcept;

/// Bits behind the point that quantise() gives centers along an axis, 0 ... kFractionBits: all that a float holds
/// wherever they lie on the lattice.
int fraction_bits(int32_t origin) noexcept;

/// Nearest representable node to {center + L u}; child fields are left alone. `factor` = l11, l21, l22, l31, l32, l33.
/// Components beyond the lattice are clamped to its border.
void quantise(PackedNode& node, const Lattice& lattice, const double center[3], const double factor[6]) noexcept;

/// Exactly what TreeView::ellipsoid returns for the node.
Ellipsoid decode(const PackedNode& node, const Lattice& lattice) noexcept;

/// Stores all of a node in a lane of its block but where its children begin and its box.
void store_node(std::byte* block, size_t lane, const PackedNode& node) noexcept;

/// Stores the boxes of up to kBlockLanes siblings in their block, outward rounded.
void store_boxes(std::byte* block, std::span<const PackedNode> siblings, const Lattice& lattice) noexcept;

/// One level to be written.
struct PackedLevel {
    std::vector<PackedNode> nodes; ///< in order; children of earlier nodes first
    LevelFigures figures = {};
};

/// The triangles of an exact tree, in the order of its leaves.
struct PackedTriangles {
    std::span<const Vec3> vertices; ///< the first `components` are one of each connected part
    std::span<const Triangle> triangles;
    uint32_t components = 0;
};

/// The bytes of a whole file; `triangles` are written if info.exact, with hull records that know nothing. Gives each
/// family of siblings blocks of its own, and of a tree without triangles finds the bounding volumes of the inner nodes.
/// The caller keeps the invariants of FORMAT.md (counts that add up, degree and level limits).
std::vector<std::byte> encode(const BakeInfo& info, uint32_t degree, const Lattice& lattice,
                              std::span<const PackedLevel> levels, const PackedTriangles& triangles = {});

/// Puts hull records (src/hull.hpp), one for each block, into a whole file of an exact tree.
void store_hulls(std::span<std::byte> file, std::span<const std::byte> hulls);

/// Appends a section (src/FORMAT.md, "Sections") to a whole file, of either version; it is of kFormatVersion then.
void append_section(std::vector<std::byte>& file, const char (&kind)[4], std::span<const std::byte> content);

} // namespace prolate::format

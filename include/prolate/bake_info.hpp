// What an .etree file says of its own making: how it was baked, and how close each level came to the mesh.
//
// "The paper" is S. Liu, C. C. L. Wang, G. Brunnett, J. Wang, "Approximating Solid Objects by Ellipsoid-Tree", 11th
// IEEE International Conference on Computer-Aided Design and Computer Graphics, 2009.
#pragma once

#include <prolate/types.hpp>

#include <cstdint>
#include <limits>

namespace prolate {

/// How E_vol was evaluated (paper, section 3.2).
enum class Method : uint8_t { voxel = 0, analytic = 1 };
/// What the nodes are.
enum class Primitive : uint8_t { ellipsoid = 0, sphere = 1 };
/// Effort of the bake.
enum class Quality : uint8_t { fast = 0, normal = 1, best = 2 };

/// What the file says of its own making.
struct BakeInfo {
    uint64_t source_hash = 0;  ///< hash(MeshView) of the cleaned mesh
    uint64_t options_hash = 0; ///< hash of the options and of the builder's version, see hash(BuildOptions)
    bool surface_mode = false; ///< true: the mesh was open, and only its triangles are guaranteed covered
    bool exact = false;        ///< an exact tree: only the triangles are covered, and stored beside the nodes
    bool proved = false;       ///< the cover of every level was proved, after quantisation, before the file was written
    bool goal_reached = true;  ///< false: the asked count, tolerance or distance could not be met
    double solid_volume = 0;   ///< of the solid, cubic metres; 0 where there is no inside, and of exact open meshes
    float solid_volume_error = 0; ///< of solid_volume, relative; found as LevelFigures::outside_ratio_error is
    double diagonal = 0;          ///< of the mesh's bounding box, metres
    Method method = Method::voxel;
    Primitive primitive = Primitive::ellipsoid;
    Quality quality = Quality::normal;
    float alpha = 0, beta = 0; ///< weights of E_sur^3 and E_vol (paper, eq. 3)
    float tolerance = 0;       ///< asked outside ratio, 0 = not asked
    float distance = 0;        ///< asked Hausdorff distance, in % of the diagonal, 0 = not asked
    uint32_t levels = 0;       ///< asked levels below the root, 0 = not asked
    uint32_t ellipsoids = 0;   ///< asked leaves, 0 = not asked
    uint64_t seed = 0;         ///< of the surface sampling
    uint32_t resolution = 0;   ///< voxels along the longest side
    Placement placement;       ///< of the mesh in the frame of its file: answers are relative to its origin
    float weld = -1;           ///< asked tolerance for vertices that nearly meet, metres; below 0: the default
};

/// How close one level's cut is to the mesh, as measured on the decoded nodes when it was baked. NaN is unknown: ratios
/// have no meaning where the solid has no volume. Lengths in metres, volumes in cubic metres. The file rounds all but
/// union_volume to floats.
struct LevelFigures {
    static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

    double outside_ratio = kUnknown; ///< volume of (union of the cut \ solid) / volume of the solid
    /// Of outside_ratio, absolute. Lengths along z are exact, so the error is that of the quadrature over a lattice of
    /// columns in x and y. This is how far the outside volume moves, at most, if only one of the four interleaved
    /// lattices of twice the pitch is used, plus two of the longest columns; and the same for the solid's volume. It is
    /// an estimate and no strict bound, but on the large side: usually several times the true error.
    double outside_ratio_error = kUnknown;
    double sum_outside_ratio = kUnknown; ///< sum of the single ellipsoids' outside volumes / volume of the solid
    double union_volume = kUnknown;      ///< of the cut
    double surface_error = kUnknown;     ///< largest E_sur of the cut (paper, eq. 1)
    /// No point of the cover is farther from the solid (of an open mesh: from its triangles): the one-sided Hausdorff
    /// distance, too large by at most 0.01 % of the diagonal (quality fast: 0.1 %).
    double hausdorff_max = kUnknown;
    double hausdorff_mean = kUnknown; ///< the same distance, on average over the cover's surface, to about 1 %
    double hausdorff_p99 = kUnknown;  ///< 99 % of the cover's surface is at most so far from the solid
};

} // namespace prolate

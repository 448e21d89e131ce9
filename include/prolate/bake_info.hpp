// What an .etree file says of its own making: how it was baked, and how close each level came to the mesh.
//
// "The paper" is S. Liu, C. C. L. Wang, G. Brunnett, J. Wang, "Approximating Solid Objects by Ellipsoid-Tree", 11th
// IEEE International Conference on Computer-Aided Design and Computer Graphics, 2009.
#pragma once

#include <prolate/mass.hpp>
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

/// How a tree was baked, as its file tells. "Asked" is what BuildOptions asked for; 0 = not asked.
struct BakeInfo {
    uint64_t source_hash = 0;  ///< hash(MeshView) of the cleaned mesh
    uint64_t options_hash = 0; ///< hash of the options and of the builder's version, see hash(BuildOptions)
    bool surface_mode = false; ///< the mesh was open: only its triangles are certain to be covered
    bool exact = false;        ///< an exact tree: the triangles are stored, and the nodes cover only them
    bool proved = false;       ///< every level was proved to cover, after quantisation, before the file was written
    bool goal_reached = true;  ///< false: the asked count or closeness could not be met
    bool inner = false;        ///< an inner cover: each ellipsoid lies inside the solid (TreeView::inner())
    /// Cubic metres, by the columns that all ratios are measured with; mass.volume is more exact. 0 where there is no
    /// inside, and of exact trees of open meshes.
    double solid_volume = 0;
    float solid_volume_error = 0; ///< relative; estimated as LevelFigures::outside_ratio_error is
    MassProperties mass;          ///< of the solid, with density 1
    double diagonal = 0;          ///< of the mesh's bounding box, metres
    Method method = Method::voxel;
    Primitive primitive = Primitive::ellipsoid;
    Quality quality = Quality::normal;
    float alpha = 0, beta = 0; ///< weights of E_sur^3 and E_vol (paper, eq. 3)
    float tolerance = 0;       ///< asked outside ratio
    float distance = 0;        ///< asked Hausdorff distance (BuildOptions' distance or clearance), % of the diagonal
    uint32_t levels = 0;       ///< asked levels below the root
    uint32_t ellipsoids = 0;   ///< asked leaves; with a closeness, the most
    uint64_t seed = 0;         ///< of the random numbers
    uint32_t resolution = 0;   ///< voxels along the longest side of the mesh's box
    Placement placement;       ///< of the mesh in the frame of its file: answers are relative to its origin
    float weld = -1;           ///< asked tolerance for vertices that nearly meet, metres; below 0: the default
    float fill = 0;            ///< radius of the ball, metres: what it cannot reach from outside counts as solid
    float keep_holes = 0;      ///< radius of the ball, metres, that passes the leaves where the mesh has holes
};

/// How close the cut at one level is to the mesh, as measured on the decoded nodes when it was baked. Lengths in
/// metres, volumes in cubic metres. NaN where unknown: ratios have no meaning where the solid has no volume. The file
/// rounds all but union_volume to floats.
struct LevelFigures {
    static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

    double outside_ratio = kUnknown; ///< volume of (union of the cut \ solid) / volume of the solid
    /// Estimated absolute error of outside_ratio. It is no strict bound, but usually several times the true error.
    // Volumes are sums over z-columns of exact length, on a lattice in x and y, so all of the error is the
    // quadrature's. Four interleaved lattices of twice the pitch make up this one. The estimate is how far the volume
    // moves, at most, if only one of them is used, plus two of the longest columns; for the outside volume and for the
    // solid's.
    double outside_ratio_error = kUnknown;
    double sum_outside_ratio = kUnknown; ///< sum of the single ellipsoids' outside volumes / volume of the solid
    double union_volume = kUnknown;      ///< volume of the union of the cut
    double surface_error = kUnknown;     ///< largest E_sur of the cut (paper, eq. 1)
    /// One-sided Hausdorff distance: an upper bound of how far a point of the cover is from the solid (of an open mesh,
    /// from its triangles), too large by at most 0.01 % of the diagonal (quality fast: 0.1 %).
    double hausdorff_max = kUnknown;
    double hausdorff_mean = kUnknown; ///< mean distance of the cover's surface from the solid, to about 1 %
    double hausdorff_p99 = kUnknown;  ///< 99 % of the cover's surface is no farther from the solid than this
};

} // namespace prolate

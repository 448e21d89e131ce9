// Baking: from a triangle mesh to an ellipsoid tree.
//
// The problem, its error measures and the names alpha, beta, E_sur and E_vol are those of "the paper": S. Liu, C. C. L.
// Wang, G. Brunnett, J. Wang, "Approximating Solid Objects by Ellipsoid-Tree", 11th IEEE International Conference on
// Computer-Aided Design and Computer Graphics, 2009, section 4, Algorithm 1.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <vector>

namespace prolate {

/// Options of build(). The defaults are a sound choice.
///
/// What ends the tree is one of four goals: a number of levels, a number of ellipsoids, a closeness (one or several of
/// tolerance, distance, clearance and keep_holes), or, with `exact`, the mesh's own triangles. A number of ellipsoids
/// and a closeness together mean: at most that many, and fewer if they are close enough. 0 means "not asked"; if
/// nothing is asked, levels = 3.
struct BuildOptions {
    uint32_t degree = 8; ///< most children of a node, 2 ... kMaxDegree

    uint32_t levels = 0; ///< levels below the root, 1 ... kMaxLevels - 1; fewer where more would gain nothing
    /// Number of leaves, 1 ... 65536: the best set of exactly that many, with a tree above it. With a closeness: the
    /// most that there may be.
    uint32_t ellipsoids = 0;
    /// Largest outside ratio of the leaves (LevelFigures::outside_ratio), above 0. As few leaves as reach it, with a
    /// tree above them.
    float tolerance = 0;
    /// Largest Hausdorff distance of the leaves from the solid (LevelFigures::hausdorff_max), above 0, in % of the
    /// diagonal of the mesh's box. As few leaves as reach it, with a tree above them.
    float distance = 0;
    /// The same limit as a length, metres, above 0. The smaller of the two counts. See least_clearance().
    float clearance = 0;
    /// Radius of a ball, metres, above 0. Through each hole of the mesh that a somewhat larger ball passes (by a
    /// seventh of its radius, or by 1/110 of the box's longest side if that is more), one of this radius passes the
    /// leaves, too, and between parts likewise. This is proved. As few leaves as leave so much free, with a tree above
    /// them. Not with `fill`. See ball_range().
    float keep_holes = 0;
    /// Radius of a ball, metres, above 0. What such a ball cannot reach from outside without touching the mesh counts
    /// as solid, so that an open mesh has an inside, too. The filled solid leaves out nothing of it and sticks out by
    /// about two cells; these are 1/160 of the box's longest side or 1/40 of the radius, whichever is larger, and
    /// at most an eighth more. All figures are then about the filled solid. 0: only what the mesh encloses is inside.
    /// See ball_range().
    float fill = 0;
    /// Make an exact tree (tree.hpp). Of the other options, only degree, leaf_triangles, quality, weld, inner and
    /// threads then matter.
    bool exact = false;
    uint32_t leaf_triangles = 4; ///< most triangles in a leaf of an exact tree, 1 ... kMaxLeafTriangles

    /// Also make an inner cover (TreeView::inner()) of at most so many leaves, 1 ... 65536; 0: none. The mesh must be
    /// closed, or be so with `fill`. Each ellipsoid is proved to lie inside the solid. The tree itself stays the same.
    uint32_t inner = 0;

    Primitive primitive = Primitive::ellipsoid; ///< what the nodes are
    Quality quality = Quality::normal;          ///< resolution of the voxels, effort of the search
    Method method = Method::voxel;              ///< how E_vol is evaluated; analytic needs a closed mesh
    float alpha = 0.5f;                         ///< weight of E_sur^3, at least 0 (paper, eq. 3)
    float beta = 0.5f;                          ///< weight of E_vol, at least 0; alpha + beta must be above 0
    float weld = kDefaultWeld;                  ///< tolerance for vertices that nearly meet, metres: see clean()
    uint64_t seed = 1;                          ///< of the random numbers
    uint32_t threads = 0;                       ///< 1 ... 1024, or 0 for all cores; the bytes do not depend on it
};

/// Checks that the options are in range and go together. Fails with bad_options or unsupported. Thread-safe.
Result<void> validate(const BuildOptions& options);

/// The least clearance, metres, that a bake can be asked for: distances are measured no finer (a `distance` of 0.01,
/// with Quality::fast of 0.1). `diagonal` is that of the mesh's box, metres. Thread-safe.
double least_clearance(double diagonal, Quality quality) noexcept;

/// The radii, metres, that `fill` and `keep_holes` may have, for a mesh whose box is `longest_side` metres along its
/// longest side. Thread-safe.
struct BallRange {
    double least; ///< finer gaps cannot be told
    double most;  ///< larger balls are larger than the mesh
};
BallRange ball_range(double longest_side) noexcept;

/// Version of the algorithm, from load_mesh() to the quantised nodes. It rises whenever the same file and options give
/// other bytes, so that no cache takes an old bake for a new one.
inline constexpr uint32_t kBuilderVersion = 18;

/// Hash of everything except the mesh that determines the bytes: the options (without `threads`), kBuilderVersion and
/// kFormatVersion. With hash(MeshView) of the cleaned mesh it makes the key of a cache of bakes. BakeInfo holds both.
/// Thread-safe.
uint64_t hash(const BuildOptions& options);

/// How far a build has come.
struct BuildProgress {
    const char* stage = ""; ///< static text: "voxelise", "split", "prove" ...
    double fraction = 0;    ///< of the whole build, 0 ... 1; never falls
    uint32_t nodes = 0;     ///< nodes made so far
};

/// Called several times a second, from one thread at a time. Return false to cancel the build, which then ends within a
/// second.
using ProgressCallback = std::function<bool(const BuildProgress&)>;

/// The cut at one level: its size and how close it is to the mesh.
struct LevelReport : LevelFigures {
    uint32_t nodes = 0;   ///< ellipsoids of the cut
    uint64_t bytes = 0;   ///< size of the file up to the end of this level
    bool covered = false; ///< proved as verify() does
    double seconds = 0;   ///< wall time spent on this level, the proof included
};

/// Result of build().
struct Build {
    Tree tree;
    MeshReport mesh;                 ///< what clean() found and did
    std::vector<LevelReport> levels; ///< the root first
    double solid_volume = 0;         ///< cubic metres; 0 where there is no inside, and of exact trees of open meshes
    double solid_volume_error = 0;   ///< cubic metres; estimated as LevelFigures::outside_ratio_error is
    MassProperties mass;             ///< of the solid, with density 1
    double diagonal = 0;             ///< of the mesh's bounding box, metres
    uint32_t resolution = 0;         ///< voxels along the box's longest side
    bool surface_mode = false;       ///< the mesh is open: see build()
    /// False: the asked count or closeness could not be met at this resolution, or not with so few. Then `levels` tells
    /// how close the tree comes, which is as close as could be.
    bool goal_reached = true;
    double hole_radius = 0; ///< of keep_holes: that of the ball that does pass the leaves, up to about 4 times it
    double seconds = 0;     ///< wall time
};

/// Smallest semi-axis of a node: this part of its longest one, ...
inline constexpr double kThinnestNode = 0x1p-14;
/// ... of the diagonal of the mesh's box, ...
inline constexpr double kThinnestNodeOfMesh = 1e-5;
/// ... and of the mesh's largest coordinate (a few steps of a float), whichever is largest. Where the solid is thinner,
/// it is covered as if it were that thick.
inline constexpr double kThinnestNodeOfPlace = 0x1p-21;

/// Bakes `mesh`, after clean(). Every level is proved to cover before it is returned. The same mesh and options give
/// the same bytes, for any number of threads.
///
/// A mesh that is still open after clean() is baked in surface mode: its triangles are certainly covered, its inside
/// only as far as the generalized winding number tells what is inside.
///
/// With `levels`, each level is optimised by itself. The leaves have at most about 1.3 times the outside volume of the
/// best set of as many `ellipsoids` (of the union's volume, if the mesh encloses nothing).
///
/// Fails with bad_options (also for a closeness below least_clearance(), or a ball beyond ball_range()), unsupported,
/// bad_mesh, cancelled, out_of_memory, or internal. Thread-safe.
Result<Build> build(MeshView mesh, const BuildOptions& options = {}, const ProgressCallback& progress = {});

} // namespace prolate

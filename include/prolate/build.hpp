// Baking: from a triangle mesh to an ellipsoid tree (paper, section 4, Algorithm 1).
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <vector>

namespace prolate {

/// Options of build(). The defaults are a sound choice. Only one of levels, ellipsoids, and tolerance or distance
/// or both may be non-zero; if none is, levels = 3. An exact tree goes down to its triangles instead: it takes none of
/// them, and of the rest only degree, leaf_triangles and threads change it.
struct BuildOptions {
    uint32_t degree = 8;           ///< children per node, 2 ... kMaxDegree
    uint32_t levels = 0;           ///< levels below the root, 1 ... kMaxLevels - 1; fewer where more gain nothing
    uint32_t ellipsoids = 0;       ///< leaves, 1 ... 65536: the best set of exactly so many, with a tree above it
    float tolerance = 0;           ///< outside ratio of the leaves, above 0: met by few leaves, with a tree above them
    float distance = 0;            ///< the same for their Hausdorff distance, in % of the diagonal of the mesh's box
    Method method = Method::voxel; ///< how E_vol is evaluated; analytic needs a closed mesh
    Primitive primitive = Primitive::ellipsoid; ///< what the nodes are
    Quality quality = Quality::normal;          ///< voxel resolution and effort of the optimisation
    float alpha = 0.5f;                         ///< weight of E_sur^3, >= 0 (paper, eq. 3)
    float beta = 0.5f;                          ///< weight of E_vol, >= 0; alpha + beta > 0
    uint64_t seed = 1;                          ///< of all that is drawn at random
    float weld = kDefaultWeld;                  ///< tolerance for vertices that nearly meet, metres: see clean()
    bool exact = false;                         ///< make an exact tree (tree.hpp)
    uint32_t leaf_triangles = 4;                ///< triangles in a leaf of an exact tree, 1 ... kMaxLeafTriangles
    uint32_t threads = 0;                       ///< 0 = all cores. The bytes do not depend on it.
};

/// Checks ranges. Fails with bad_options or unsupported.
Result<void> validate(const BuildOptions& options);

/// Version of the algorithm, from load_mesh() to the quantised nodes. It goes up whenever the same file and options
/// give other bytes, so that no cache takes an old bake for a new one; build_test has a bake whose bytes are known.
inline constexpr uint32_t kBuilderVersion = 9;

/// Hash of all but the mesh that changes the bytes: the options (not `threads`), kBuilderVersion, kFormatVersion.
/// Together with hash(MeshView) of the cleaned mesh it is a bake cache's key, and BakeInfo holds both.
uint64_t hash(const BuildOptions& options);

/// Stage of a running build, for a progress display.
struct BuildProgress {
    const char* stage = ""; ///< static text: "voxelise", "split", "prove" ...
    double fraction = 0;    ///< of the whole build, 0 ... 1, never decreasing
    uint32_t nodes = 0;     ///< nodes made so far
};

/// Called from one thread at a time when something is done, and at least some times a second; return false to cancel
/// the build, which then ends within a second.
using ProgressCallback = std::function<bool(const BuildProgress&)>;

/// Figures of one level's cut.
struct LevelReport : LevelFigures {
    uint32_t nodes = 0;   ///< ellipsoids of the cut
    uint64_t bytes = 0;   ///< file size up to here
    bool covered = false; ///< proved by verify()
    double seconds = 0;   ///< wall time spent on this level, proof included
};

/// What build() made, and what it saw.
struct Build {
    Tree tree;
    MeshReport mesh;
    std::vector<LevelReport> levels;
    double solid_volume = 0;       ///< cubic metres; 0 where there is no inside, and of exact trees of open meshes
    double solid_volume_error = 0; ///< cubic metres; found as LevelFigures::outside_ratio_error is
    double diagonal = 0;           ///< of the mesh's bounding box, metres
    uint32_t resolution = 0;       ///< voxels along the longest side
    bool surface_mode = false;
    bool goal_reached = true; ///< false: the asked count, tolerance or distance could not be met at this resolution
    double seconds = 0;
};

/// Nodes are as thin as the solid, down to semi-axes of 1/16384 of the longest one, of 1e-5 of the diagonal of the
/// mesh's box, and of 2^-21 of its largest coordinate, which is a few steps of a float: what is thinner is covered as
/// if it were that thick.
inline constexpr double kThinnestNode = 0x1p-14, kThinnestNodeOfMesh = 1e-5, kThinnestNodeOfPlace = 0x1p-21;

/// Bakes `mesh`. The same mesh and options give the same bytes, for any number of threads.
/// Each level is proved to cover before it is returned. An open mesh is baked in surface mode: the cover of its
/// triangles is guaranteed, its inside only as far as the generalized winding number tells one.
/// With levels, the leaves have at most about 1.3 times the volume outside the solid that the set of as many
/// `ellipsoids` has (of their union, if the mesh encloses nothing); levels above them may have more outside than the
/// root. Fails with bad_options, unsupported, bad_mesh, cancelled, out_of_memory, or internal. Thread-safe.
Result<Build> build(MeshView mesh, const BuildOptions& options = {}, const ProgressCallback& progress = {});

} // namespace prolate

// Baking: from a triangle mesh to an ellipsoid tree (paper, section 4, Algorithm 1).
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <vector>

namespace prolate {

/// Options of build(). The defaults are a sound choice. Exactly one of levels, ellipsoids, tolerance may be non-zero;
/// if none is, levels = 3.
struct BuildOptions {
    uint32_t degree = 8;     ///< children per node, 2 ... kMaxDegree
    uint32_t levels = 0;     ///< levels below the root, 1 ... kMaxLevels - 1
    uint32_t ellipsoids = 0; ///< leaves, 1 ... 65536: the worst node is split next until there are exactly so many
    float tolerance = 0;     ///< outside ratio of the leaves, above 0: the worst node is split next until it is met
    Method method = Method::voxel;              ///< only voxel in this version
    Primitive primitive = Primitive::ellipsoid; ///< only ellipsoid in this version
    Quality quality = Quality::normal;          ///< voxel resolution and number of optimisation sweeps
    float alpha = 0.5f;                         ///< weight of E_sur^3, >= 0 (paper, eq. 3)
    float beta = 0.5f;                          ///< weight of E_vol, >= 0; alpha + beta > 0
    uint64_t seed = 1;                          ///< of the surface sampling
    uint32_t threads = 0;                       ///< 0 = all cores. The bytes do not depend on it.
};

/// Checks ranges. Fails with bad_options or unsupported.
Result<void> validate(const BuildOptions& options);

/// Hash of all that changes the bytes (not `threads`); a bake cache's key together with the mesh.
uint64_t hash(const BuildOptions& options);

/// Stage of a running build, for a progress display.
struct BuildProgress {
    const char* stage = ""; ///< static text: "voxelise", "split", "prove" ...
    double fraction = 0;    ///< of the whole build, 0 ... 1, never decreasing
    uint32_t nodes = 0;     ///< nodes made so far
};

/// Called now and then from one thread at a time; return false to cancel the build.
using ProgressCallback = std::function<bool(const BuildProgress&)>;

/// Figures of one level's cut.
struct LevelReport {
    uint32_t nodes = 0;           ///< ellipsoids of the cut
    uint64_t bytes = 0;           ///< file size up to here
    double outside_ratio = 0;     ///< vol(union \ solid) / vol(solid), by columns; NaN if the solid has no volume
    double union_volume = 0;      ///< cubic metres
    double sum_outside_ratio = 0; ///< sum of the single ellipsoids' outside volumes / vol(solid), by voxels
    double surface_error = 0;     ///< largest E_sur, metres
    bool covered = false;         ///< proved by verify()
    double seconds = 0;           ///< wall time spent on this level, proof included
};

/// What build() made, and what it saw.
struct Build {
    Tree tree;
    MeshReport mesh;
    std::vector<LevelReport> levels;
    double solid_volume = 0; ///< cubic metres
    double diagonal = 0;     ///< of the mesh's bounding box, metres
    uint32_t resolution = 0; ///< voxels along the longest side
    bool surface_mode = false;
    bool goal_reached = true; ///< false: the asked tolerance or count could not be met at this resolution
    double seconds = 0;
};

/// Bakes `mesh`. The same mesh and options give the same bytes, for any number of threads.
/// Each level is proved to cover before it is returned. An open mesh is baked in surface mode: the cover of its
/// triangles is guaranteed, its inside only as far as the generalized winding number tells one.
/// Fails with bad_options, unsupported, bad_mesh, cancelled, or internal. Thread-safe.
Result<Build> build(MeshView mesh, const BuildOptions& options = {}, const ProgressCallback& progress = {});

} // namespace prolate

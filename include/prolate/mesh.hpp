// Triangle meshes: the builder's input.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace prolate {

/// Borrowed indexed triangles, metres. Outward orientation is counter-clockwise seen from outside.
struct MeshView {
    std::span<const Vec3> vertices;
    std::span<const Triangle> triangles;
};

/// Owned indexed triangles.
struct Mesh {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    MeshView view() const noexcept { return {vertices, triangles}; }
};

/// What clean() found and did. Counts of triangles unless said otherwise.
struct MeshReport {
    uint32_t input_vertices = 0;
    uint32_t input_triangles = 0;
    uint32_t merged_vertices = 0; ///< vertices that lay exactly on an earlier one
    uint32_t unused_vertices = 0; ///< vertices of no kept triangle
    /// Of zero area. Those with a repeated corner are dropped if their points lie in other triangles; the rest stay, so
    /// that no point of the surface is lost.
    uint32_t degenerate_triangles = 0;
    uint32_t open_edges = 0;         ///< edges whose triangles do not cancel (boundary, or inconsistently oriented)
    uint32_t non_manifold_edges = 0; ///< edges of three or more triangles
    bool closed = false;             ///< no open edge: winding numbers are whole, and the mesh bounds a solid
};

/// A mesh fit for baking, with the report on how it became so.
struct CleanMesh {
    Mesh mesh;
    MeshReport report;
};

/// Merges vertices of equal position, drops redundant triangles and unused vertices, and classifies the edges. What
/// stays keeps its order. Fails with bad_mesh for no triangle with an area, an index out of range, or a coordinate that
/// is not finite (`what` begins with "triangle" or "vertex", `where` is its index); out_of_memory. O(n log n). Thread-safe.
Result<CleanMesh> clean(MeshView mesh);

/// XXH3-64 of vertices and triangles in their order. Of a cleaned mesh, it is what BakeInfo::source_hash holds.
uint64_t hash(MeshView mesh) noexcept;

/// Reads every mesh of a scene, with its transforms, through Assimp: OBJ, PLY, STL, OFF, glTF/GLB, 3DS, DAE (by the
/// name's extension). Polygons become triangles; points and lines are left out; mirroring transforms turn the winding.
/// Coordinates stay as the file has them: a stated unit or up axis (DAE, 3DS) is not applied.
/// Fails with io (`where` is errno), out_of_memory or bad_file; `detail`, if given, then receives the reader's
/// own words. The mesh is not cleaned yet. Thread-safe.
Result<Mesh> load_mesh(const char* path, std::string* detail = nullptr);

/// A hash of all that load_mesh() makes the mesh of `path` from: the bytes of the file, its type, the reader's version.
/// Equal hashes mean equal meshes, at the cost of reading the file. Empty if the file cannot be read, or if the mesh
/// may depend on other files, too (glTF and GLB that name some). Thread-safe.
std::optional<uint64_t> hash_mesh_file(const char* path);

} // namespace prolate

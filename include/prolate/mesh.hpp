// Triangle meshes: the builder's input.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace prolate {

using Triangle = std::array<uint32_t, 3>; ///< three vertex indices

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
    uint32_t merged_vertices = 0;      ///< vertices that lay exactly on an earlier one
    uint32_t unused_vertices = 0;      ///< vertices of no kept triangle
    uint32_t degenerate_triangles = 0; ///< zero area; dropped where their points lie in other triangles, kept otherwise
    uint32_t open_edges = 0;           ///< edges whose triangles do not cancel (boundary, or inconsistently oriented)
    uint32_t non_manifold_edges = 0;   ///< edges of three or more triangles
    bool closed = false;               ///< no open edge: winding numbers are whole, and the mesh bounds a solid
};

/// A mesh fit for baking, with the report on how it became so.
struct CleanMesh {
    Mesh mesh;
    MeshReport report;
};

/// Merges vertices of equal position, drops degenerate triangles and unused vertices, and classifies the edges.
/// Fails with bad_mesh for no (non-degenerate) triangles, an index out of range, or a coordinate that is not finite
/// (`where` = triangle or vertex index). Thread-safe.
Result<CleanMesh> clean(MeshView mesh);

/// Reads every mesh of a scene, with its transforms, through Assimp: OBJ, PLY, STL, OFF, glTF/GLB, 3DS, DAE.
/// Fails with io or bad_file; `detail`, if given, then receives the reader's own words. The mesh is not cleaned yet.
/// Thread-safe for different files.
Result<Mesh> load_mesh(const char* path, std::string* detail = nullptr);

} // namespace prolate

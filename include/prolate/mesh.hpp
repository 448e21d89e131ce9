// Triangle meshes: the builder's input.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace prolate {

/// Borrowed indexed triangles, metres. Outward orientation is counter-clockwise seen from outside.
struct MeshView {
    std::span<const Vec3> vertices;
    std::span<const Triangle> triangles;
    Placement placement = {}; ///< in the file's frame: build() writes it into the tree, and moves nothing by it
};

/// Owned indexed triangles.
struct Mesh {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    Placement placement = {};
    MeshView view() const noexcept { return {vertices, triangles, placement}; }
};

/// What clean() found and did.
struct MeshReport {
    uint32_t input_vertices = 0;
    uint32_t input_triangles = 0;
    uint32_t merged_vertices = 0; ///< vertices that lay exactly on an earlier one
    uint32_t unused_vertices = 0; ///< vertices of no kept triangle
    /// Vertices that were moved onto another one within the weld tolerance, and how far at most, metres. A cover also
    /// holds the triangles as they were before: bake and proof add this distance to the mesh. But an exact tree holds,
    /// and answers for, the joined triangles.
    uint32_t welded_vertices = 0;
    double weld_distance = 0;
    /// Triangles of zero area. Those with a repeated corner are dropped if their points lie in other triangles; the
    /// rest stay, so that no point of the surface is lost.
    uint32_t degenerate_triangles = 0;
    uint32_t open_edges = 0;         ///< edges whose triangles do not cancel (boundary, or inconsistently oriented)
    uint32_t non_manifold_edges = 0; ///< edges of three or more triangles
    /// The mesh bounds a solid: it has no open edge, so that winding numbers are whole, and it encloses something. (A
    /// surface each of whose triangles is also there in reverse has no open edge, but encloses nothing.)
    bool closed = false;
    uint32_t turned_shells = 0;      ///< closed parts that were inside out; their triangles were reversed
    std::array<double, 3> size = {}; ///< of the mesh's box, metres
};

/// A mesh fit for baking, with the report on how it became so.
struct CleanMesh {
    Mesh mesh;
    MeshReport report;
};

/// The weld tolerance that clean() chooses itself: eight times the spacing of floats at the largest coordinate.
inline constexpr float kDefaultWeld = -1;
/// That tolerance, metres, where no coordinate is larger than this.
double default_weld(float largest_coordinate) noexcept;

/// Merges vertices of equal position, drops redundant triangles and unused vertices, and classifies the edges. What
/// stays keeps its order.
///
/// If the mesh is then open, but joining vertices of open edges that are within `weld` metres of each other closes it,
/// they are joined: each moves onto the first of its group. (0: never. Below 0: kDefaultWeld.) Vertices of closed
/// surfaces never move, so that thin walls stay.
///
/// Closed parts that are inside out are reversed, with their cavities, so that the winding number is nowhere negative.
/// What counts as solid (winding number not 0) stays the same, or grows where a part sticks out of the one that it was
/// to be cut out of. Cavities, and bodies within bodies, stay as they are.
///
/// Fails with bad_mesh for no triangle with an area, an index out of range, a coordinate that is not finite or beyond
/// kLargestCoordinate (`what` begins with "triangle" or "vertex", and `where` is its index), or a mesh of less than
/// 1e-24 m across; with out_of_memory; with cancelled, within a second after `go_on` has returned false. `go_on` is
/// called several times a second, from one thread at a time. O(n log n). Thread-safe.
Result<CleanMesh> clean(MeshView mesh, float weld = kDefaultWeld, const std::function<bool()>& go_on = {});

/// XXH3-64 of vertices, triangles and placement. BakeInfo::source_hash is that of the cleaned mesh. Thread-safe.
uint64_t hash(MeshView mesh) noexcept;

/// How load_mesh() takes a file's coordinates.
struct ImportOptions {
    /// Length of the file's unit in metres, above 0. None: what the format defines (3MF, glTF), else 1.
    std::optional<double> unit = {};
    std::array<double, 3> scale = {1, 1, 1}; ///< further factors along the axes: finite, not 0
    /// Move the mesh's middle near (0, 0, 0), in double precision, as a mesh at map coordinates needs.
    /// Placement::origin then says from where, in whole steps of a power of two.
    bool recentre = false;
    std::optional<std::array<double, 3>> origin = {}; ///< move this point, in metres, to (0, 0, 0) instead
};

/// Options that place the file as `placement` says, whatever its format defines.
ImportOptions placed_as(const Placement& placement);

/// What the user should know of an import.
struct ImportReport {
    std::string detail;             ///< of an error: the place in the file, a reader's own words
    std::vector<std::string> notes; ///< what the file states and what was done about it, a line each
    std::vector<std::string> files; ///< other files that were read, or should have been: a glTF's buffers
};

/// Reads every mesh of a scene, with its transforms: OBJ, PLY, STL, OFF, glTF/GLB, 3MF, 3DS, DAE (by the name's
/// extension). Positions are read in double precision where the file has it, placed as `options` say, and
/// only then rounded to float. Mirroring transforms and scales turn the faces.
///
/// Polygons, concave ones too, are cut into triangles that tile them exactly; if one is not flat, these triangles are
/// what counts as the surface, and the report says how far from flat. A polygon that crosses itself is an error that
/// names it. Points and lines are left out. Axes stay as the file has them. A DAE's unit is noted and not applied; a
/// 3MF's is. Of glTF, quantised positions and GPU instances are read; compressed geometry is refused by name.
///
/// Fails with io (`where` is errno), out_of_memory, bad_file, or bad_mesh. The last is for what clean() fails for, and
/// for a mesh so far from (0, 0, 0) that floats there are farther apart than 1e-5 of its diagonal (without `recentre`).
/// What follows a "; " in Error::what is advice. Fails with cancelled after `go_on` has returned false. It is called
/// several times a second, except while a library parses the text of a glTF or DAE (some 100 MB a second) or unpacks a
/// 3MF. The mesh is not cleaned yet. Thread-safe.
Result<Mesh> load_mesh(const char* path, const ImportOptions& options = {}, ImportReport* report = nullptr,
                       const std::function<bool()>& go_on = {});

/// A hash of all that load_mesh() makes the mesh of `path` from: the bytes of the file, its type, the options, the
/// reader's version. Equal hashes mean equal meshes, at the cost of reading the file. Empty if the file cannot be read,
/// or if the mesh may depend on other files, too (glTF and GLB that name some). Thread-safe.
std::optional<uint64_t> hash_mesh_file(const char* path, const ImportOptions& options = {});

} // namespace prolate

// What the readers of mesh files make: polygons in double precision, as the file has them. load_mesh() places them,
// rounds them to float and cuts them into triangles.
#pragma once

#include <prolate/error.hpp>
#include <prolate/mesh.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace prolate {

struct RiggedMesh;

using Point = std::array<double, 3>;

/// An affine map in double precision, row by row: a product of many transforms rounds only here.
struct Affine {
    double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};

    Affine operator*(const Affine& inner) const {
        Affine out;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 4; ++j) {
                out.m[i][j] = j == 3 ? m[i][3] : 0;
                for (size_t k = 0; k < 3; ++k) out.m[i][j] += m[i][k] * inner.m[k][j];
            }
        return out;
    }
    Point operator()(const Point& p) const {
        Point out;
        for (size_t i = 0; i < 3; ++i) out[i] = m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3];
        return out;
    }
    double determinant() const {
        return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    }
    bool mirrors() const { return determinant() < 0; }
};

/// Faces of three or more corners, counter-clockwise seen from outside, over shared points.
struct Polygons {
    std::vector<Point> points;
    std::vector<uint32_t> corners; ///< of all faces, one after the other: indices below points.size()
    std::vector<uint32_t> sizes;   ///< corners of each face, at least 3
    std::vector<uint32_t> places;  ///< where each face stands: its line or number, see `place_word`. Empty: its number
    const char* place_word = "face";

    double unit = 1;                ///< metres of one of the file's units, where the format defines it
    bool unit_is_ignored = false;   ///< the file states one other than metres, which is not applied
    std::vector<std::string> notes; ///< one line each: what the file states and what was done about it

    /// Starts a face; its corners are then added.
    void begin_face(uint64_t place) {
        sizes.push_back(0);
        places.push_back(static_cast<uint32_t>(place));
    }
    void add_corner(uint32_t point) {
        corners.push_back(point);
        ++sizes.back();
    }
    void turn_last_face() {
        std::span last(corners.end() - sizes.back(), corners.end());
        for (size_t i = 1, j = last.size() - 1; i < j; ++i, --j) std::swap(last[i], last[j]); // the first stays first
    }
    bool can_hold(size_t more_points) const {
        return points.size() + more_points <= std::numeric_limits<uint32_t>::max();
    }
};

/// The bytes of a regular file. Fails with io.
Result<std::string> read_mesh_bytes(const char* path);

/// The readers, each of its format's bytes. They fail with bad_file; `detail` then says the place (a line, for text).
/// Linear in the size of what they read and make. They pass through checkpoint(), so they may throw Cancelled.
Result<Polygons> read_obj(std::string_view bytes, std::string& detail);
Result<Polygons> read_off(std::string_view bytes, std::string& detail);
Result<Polygons> read_ply(std::string_view bytes, std::string& detail);
Result<Polygons> read_stl(std::string_view bytes, std::string& detail);
Result<Polygons> read_3ds(std::string_view bytes, std::string& detail);
Result<Polygons> read_collada(std::string_view bytes, std::string& detail);
Result<Polygons> read_3mf(std::string_view bytes, std::string& detail);
/// `type` is the name's extension in lower case, with the dot; other files are sought beside `path`.
/// With `rig`, all of that but its mesh is read, too.
Result<Polygons> read_gltf(std::string_view type, std::string_view bytes, const std::string& path, ImportReport& report,
                           RiggedMesh* rig = nullptr);
/// The JSON of a glTF or GLB file; empty if there is none.
std::string_view gltf_json(std::string_view type, std::string_view bytes);
/// The path that a glTF's URI names: without %20 and the like.
std::string without_escapes(std::string_view uri);

} // namespace prolate

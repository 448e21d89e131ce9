// load_mesh(): from a file to a mesh. Each format has its reader (polygons.hpp), which gives polygons in double
// precision; here they are placed, rounded to float, and cut into triangles.
#include "builder/job.hpp"
#include "builder/mesh.hpp"
#include "builder/polygons.hpp"
#include "builder/triangulate.hpp"

#include "src/hash.hpp"

#include <prolate/build.hpp>
#include <prolate/mesh.hpp>
#include <prolate/rig.hpp>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <new>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace prolate {
namespace {

// Rounding to float may move points by this share of the mesh's diagonal.
constexpr double kMostRounding = 1e-5;
// Polygons count as flat if no corner is farther from their plane, as a share of the mesh's diagonal.
constexpr double kFlat = 1e-5;

Error io(const char* what) {
    return {ErrorCode::io, what, static_cast<uint64_t>(errno)};
}

// The extension in lower case, with the dot.
std::string extension(const std::string& path) {
    const size_t slash = path.rfind('/'), dot = path.rfind('.');
    if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return {};
    std::string out = path.substr(dot);
    for (char& c : out)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return out;
}

std::string words(const char* format, auto... values) {
    char out[300];
    std::snprintf(out, sizeof out, format, values...);
    return out;
}

using Reader = Result<Polygons> (*)(std::string_view bytes, std::string& detail);

// Of the formats that are one file.
Reader reader_of(std::string_view type) {
    static constexpr std::pair<std::string_view, Reader> kReaders[] = {
        {".obj", read_obj}, {".off", read_off}, {".ply", read_ply},     {".stl", read_stl},
        {".3mf", read_3mf}, {".3ds", read_3ds}, {".dae", read_collada},
    };
    for (const auto& [known, reader] : kReaders)
        if (known == type) return reader;
    return nullptr;
}

Result<Polygons> read_polygons(const std::string& path, ImportReport& report, RiggedMesh* rig) {
    const std::string type = extension(path);
    const auto bytes = read_mesh_bytes(path.c_str());
    if (!bytes) return bytes.error();
    const bool is_gltf = type == ".gltf" || type == ".glb";
    const Reader reader = reader_of(type);
    if (!reader && !is_gltf) return Error{ErrorCode::bad_file, "unknown kind of mesh file"};
    if (rig && !is_gltf) return Error{ErrorCode::bad_file, "only glTF files have skins and morph targets"};
    std::string_view content = *bytes;
    if (content.empty()) return Error{ErrorCode::bad_file, "the file is empty"};
    if (content.starts_with("\xFF\xFE") || content.starts_with("\xFE\xFF"))
        return Error{ErrorCode::bad_file, "text in UTF-16; save it as UTF-8"};
    if (content.starts_with("version https://git-lfs"))
        return Error{ErrorCode::bad_file, "a pointer of Git LFS, not the file itself; fetch it with 'git lfs pull'"};
    if (content.starts_with("\xEF\xBB\xBF")) content.remove_prefix(3); // the mark of UTF-8
    return is_gltf ? read_gltf(type, content, path, report, rig) : reader(content, report.detail);
}

struct Extent {
    Point low = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

    explicit Extent(const std::vector<Point>& points, const std::vector<uint32_t>& corners) {
        for (const uint32_t corner : corners)
            for (size_t k = 0; k < 3; ++k) {
                low[k] = std::min(low[k], points[corner][k]);
                high[k] = std::max(high[k], points[corner][k]);
            }
    }
    double diagonal() const { return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]); }
    double largest() const {
        double out = 0;
        for (size_t k = 0; k < 3; ++k) out = std::max({out, std::abs(low[k]), std::abs(high[k])});
        return out;
    }
    // The middle, in whole steps of a power of two of about a quarter of the diagonal.
    Point middle() const {
        const double step = std::exp2(std::floor(std::log2(diagonal())) - 1);
        Point out{};
        for (size_t k = 0; k < 3 && step > 0; ++k) out[k] = std::round((low[k] + high[k]) / 2 / step) * step;
        return out;
    }
};

// The distance from a float of this size to the next.
double spacing(double coordinate) {
    const auto x = static_cast<float>(coordinate);
    return double{std::nextafter(x, HUGE_VALF)} - double{x};
}

// Moves and scales the points; says how.
Result<Placement> place(Polygons& polygons, const ImportOptions& options, ImportReport& report) {
    Placement placement;
    for (size_t k = 0; k < 3; ++k) placement.scale[k] = options.unit.value_or(polygons.unit) * options.scale[k];
    for (Point& p : polygons.points)
        for (size_t k = 0; k < 3; ++k) p[k] *= placement.scale[k];
    const Extent there(polygons.points, polygons.corners);
    const double diagonal = there.diagonal();
    if (options.origin)
        placement.origin = *options.origin;
    else if (options.recentre)
        placement.origin = there.middle();
    if (placement.origin != Point{}) {
        for (Point& p : polygons.points)
            for (size_t k = 0; k < 3; ++k) p[k] -= placement.origin[k];
        report.notes.push_back(
            words("taken around a local origin, (%.12g, %.12g, %.12g): all coordinates are relative to it",
                  placement.origin[0], placement.origin[1], placement.origin[2]));
    }
    const double step = spacing(Extent(polygons.points, polygons.corners).largest());
    if (diagonal > 0 && step > kMostRounding * diagonal) {
        report.detail = words("points would move by %.2g m, and the mesh is %.3g m across", step / 2, diagonal);
        return Error{
            ErrorCode::bad_mesh,
            "the mesh lies too far from (0, 0, 0) for single precision; give it a local origin with --recentre"};
    }
    return placement;
}

// Rounds to float and cuts polygons into triangles.
Result<Mesh> to_mesh(const Polygons& polygons, const Placement& placement, ImportReport& report) {
    Mesh mesh;
    mesh.placement = placement;
    mesh.vertices.reserve(polygons.points.size());
    for (const Point& p : polygons.points)
        mesh.vertices.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
    const bool mirrors =
        std::count_if(placement.scale.begin(), placement.scale.end(), [](double s) { return s < 0; }) % 2 == 1;
    const double diagonal = Extent(polygons.points, polygons.corners).diagonal();
    uint64_t cut = 0, bent = 0;
    double most_bent = 0;
    std::vector<uint32_t> face;
    size_t first = 0;
    Checkpoints checkpoint;
    for (size_t f = 0; f < polygons.sizes.size(); first += polygons.sizes[f++]) {
        checkpoint();
        const auto begin = polygons.corners.begin() + static_cast<ptrdiff_t>(first);
        face.assign(begin, begin + polygons.sizes[f]);
        if (mirrors) std::reverse(face.begin() + 1, face.end());
        if (face.size() > 3) {
            ++cut;
            if (const double away = distance_from_flat(mesh.vertices, face); away > kFlat * diagonal)
                ++bent, most_bent = std::max(most_bent, away);
        }
        if (triangulate(mesh.vertices, face, mesh.triangles)) continue;
        report.detail = words("%s %u, %zu corners", polygons.place_word, polygons.places[f], face.size());
        return Error{ErrorCode::bad_file, "a polygon that crosses itself; triangulate it in the program that made it"};
    }
    if (bent > 0)
        report.notes.push_back(
            words("%llu of %llu polygons are not flat, by up to %.3g m: the triangles that they were cut "
                  "into are what is covered",
                  static_cast<unsigned long long>(bent), static_cast<unsigned long long>(cut), most_bent));
    return mesh;
}

// The first face with a coordinate that is no number or too large for a float.
Result<void> check_finite(const Polygons& polygons, const ImportOptions& options, std::string& detail) {
    double scale = 0;
    for (const double s : options.scale) scale = std::max(scale, std::abs(s * options.unit.value_or(polygons.unit)));
    size_t first = 0;
    for (size_t f = 0; f < polygons.sizes.size(); first += polygons.sizes[f++])
        for (size_t i = first; i < first + polygons.sizes[f]; ++i)
            for (const double coordinate : polygons.points[polygons.corners[i]])
                if (!(std::abs(coordinate) * scale <= double{std::numeric_limits<float>::max()})) {
                    detail = words("%s %u", polygons.place_word, polygons.places[f]);
                    return Error{ErrorCode::bad_file, std::isfinite(coordinate)
                                                          ? "a coordinate too large for single precision; scale it down"
                                                          : "a coordinate that is not finite"};
                }
    return {};
}

Result<Mesh> load_or_throw(const char* path, const ImportOptions& options, ImportReport& report, RiggedMesh* rig) {
    auto polygons = read_polygons(path, report, rig);
    if (!polygons) return polygons.error();
    report.notes = std::move(polygons->notes);
    if (polygons->sizes.empty()) return Error{ErrorCode::bad_file, "the file has no triangles"};
    if (const auto finite = check_finite(*polygons, options, report.detail); !finite) return finite.error();
    const auto placement = place(*polygons, options, report);
    if (!placement) return placement.error();
    if (polygons->unit_is_ignored && placement->scale == Placement{}.scale)
        report.notes.push_back("its unit is not applied: --unit or --scale makes its numbers metres");
    auto mesh = to_mesh(*polygons, *placement, report);
    if (mesh)
        if (const auto sound = check_mesh(mesh->view()); !sound) return sound.error();
    return mesh;
}

Result<void> check(const ImportOptions& options) {
    const auto bad = [](const char* what) { return Error{ErrorCode::bad_options, what}; };
    if (options.unit && !(std::isfinite(*options.unit) && *options.unit > 0)) return bad("the unit must be above 0");
    for (const double s : options.scale)
        if (!std::isfinite(s) || s == 0) return bad("the scale must not be 0");
    for (const double o : options.origin.value_or(Point{}))
        if (!std::isfinite(o)) return bad("the origin must be finite");
    return {};
}

} // namespace

Result<std::string> read_mesh_bytes(const char* path) {
    struct Closer {
        int fd;
        ~Closer() {
            if (fd >= 0) ::close(fd);
        }
    };
    const Closer file{::open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK)}; // no wait at a FIFO
    if (file.fd < 0) return io("cannot open the file");
    struct stat status {};
    if (::fstat(file.fd, &status) != 0) return io("cannot read the file");
    if (S_ISDIR(status.st_mode)) return Error{ErrorCode::io, "cannot read the file", EISDIR};
    if (!S_ISREG(status.st_mode)) return Error{ErrorCode::io, "a mesh can only be read from a regular file", ESPIPE};
    std::string bytes(static_cast<size_t>(status.st_size), '\0');
    constexpr size_t kMostAtOnce = size_t{1} << 24; // between two checkpoints
    size_t have = 0;
    while (have < bytes.size()) {
        const ssize_t n = ::read(file.fd, bytes.data() + have, std::min(bytes.size() - have, kMostAtOnce));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io("cannot read the file");
        if (n == 0) break;
        checkpoint();
        have += static_cast<size_t>(n);
    }
    bytes.resize(have);
    return bytes;
}

ImportOptions placed_as(const Placement& placement) {
    return {.unit = 1, .scale = placement.scale, .recentre = false, .origin = placement.origin};
}

std::optional<uint64_t> hash_mesh_file(const char* path, const ImportOptions& options) try {
    const std::string type = extension(path);
    const auto bytes = read_mesh_bytes(path);
    if (!bytes) return {};
    if (type == ".gltf" || type == ".glb") {
        // Buffers in other files are named by a "uri", which only an escape could hide. Images have one, too: then the
        // answer is needlessly empty, but never wrong. No other format reads triangles from a second file.
        const std::string_view json = gltf_json(type, *bytes);
        if (json.empty() || json.find("uri") != json.npos || json.find('\\') != json.npos) return {};
    }
    const Point origin = options.origin.value_or(Point{});
    const double taken[] = {
        options.unit.value_or(0),   options.scale[0], options.scale[1], options.scale[2], options.recentre ? 1.0 : 0.0,
        options.origin ? 1.0 : 0.0, origin[0],        origin[1],        origin[2]};
    const uint64_t reader[] = {kBuilderVersion, hash_bytes(std::as_bytes(std::span(type)))};
    const uint64_t how = hash_bytes(std::as_bytes(std::span(taken)), hash_bytes(std::as_bytes(std::span(reader))));
    return hash_bytes(std::as_bytes(std::span(*bytes)), how);
} catch (const std::bad_alloc&) {
    return {};
}

namespace {

// With what moves it, if that is asked for.
Result<Mesh> load_mesh_of(const char* path, const ImportOptions& options, ImportReport* report,
                          const std::function<bool()>& go_on, RiggedMesh* rig) {
    ImportReport unused;
    ImportReport& out = report ? *report : unused;
    if (const auto valid = check(options); !valid) return valid.error();
    try {
        out = {};
        return Job(1, go_on).run([&] { return load_or_throw(path, options, out, rig); });
    } catch (const Cancelled&) {
        return Error{ErrorCode::cancelled, "cancelled"};
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "the mesh does not fit into memory"};
    } catch (const std::exception& e) {
        try {
            out.detail = e.what();
        } catch (...) { // no memory left for the words
        }
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    } catch (...) {
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    }
}

} // namespace

Result<Mesh> load_mesh(const char* path, const ImportOptions& options, ImportReport* report,
                       const std::function<bool()>& go_on) {
    return load_mesh_of(path, options, report, go_on, nullptr);
}

Result<RiggedMesh> load_rigged_mesh(const char* path, const ImportOptions& options, ImportReport* report,
                                    const std::function<bool()>& go_on) {
    RiggedMesh out;
    auto mesh = load_mesh_of(path, options, report, go_on, &out);
    if (!mesh) return mesh.error();
    out.mesh = std::move(*mesh);
    for (size_t i = 0; i < out.displacements.size(); ++i)
        out.displacements[i] = static_cast<float>(out.displacements[i] * out.mesh.placement.scale[i % 3]);
    const auto& [scale, origin] = out.mesh.placement;
    for (Vec3& joint : out.joints)
        joint = {static_cast<float>(joint.x * scale[0] - origin[0]), static_cast<float>(joint.y * scale[1] - origin[1]),
                 static_cast<float>(joint.z * scale[2] - origin[2])};
    return out;
}

} // namespace prolate

// load_mesh(): from a file to a mesh. Each format has its reader (polygons.hpp), which gives polygons in double
// precision; here they are placed, rounded to float, and cut into triangles.
#include "builder/polygons.hpp"
#include "builder/triangulate.hpp"

#include "src/hash.hpp"

#include <prolate/build.hpp>
#include <prolate/mesh.hpp>

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

Result<std::string> read_all(const char* path) {
    struct Closer {
        int fd;
        ~Closer() {
            if (fd >= 0) ::close(fd);
        }
    };
    const Closer file{::open(path, O_RDONLY | O_CLOEXEC)};
    if (file.fd < 0) return io("cannot open the file");
    struct stat status {};
    if (::fstat(file.fd, &status) != 0) return io("cannot read the file");
    if (S_ISDIR(status.st_mode)) return Error{ErrorCode::io, "cannot read the file", EISDIR};
    if (!S_ISREG(status.st_mode)) // Assimp opens the name a second time
        return Error{ErrorCode::io, "a mesh can only be read from a regular file", ESPIPE};
    std::string bytes(static_cast<size_t>(status.st_size), '\0');
    size_t have = 0;
    while (have < bytes.size()) {
        const ssize_t n = ::read(file.fd, bytes.data() + have, bytes.size() - have);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io("cannot read the file");
        if (n == 0) break;
        have += static_cast<size_t>(n);
    }
    bytes.resize(have);
    return bytes;
}

std::string words(const char* format, auto... values) {
    char out[300];
    std::snprintf(out, sizeof out, format, values...);
    return out;
}

// What Assimp 5.2 does not notice: polygons with holes; indices that are not numbers, over which it runs on one place,
// and takes more memory, for ever; and negative ones, which it takes for 0 (only those of weights may be negative).
Result<void> check_collada(std::string_view text) {
    if (text.find("<ph>") != text.npos)
        return Error{ErrorCode::bad_file, "polygons with holes (<ph>), which are not read; export triangles"};
    for (const std::string_view name : {"<p", "<v", "<vcount"})
        for (size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1)) {
            const size_t end_of_name = at + name.size();
            if (end_of_name == text.size() || std::string_view("> \t\r\n").find(text[end_of_name]) == text.npos)
                continue; // a longer name
            const size_t begin = text.find('>', end_of_name);
            if (begin == text.npos) break;
            if (text[begin - 1] == '/') continue; // <p/>
            // To the end of the element: other markup inside is no list either.
            const std::string_view list = text.substr(begin + 1, text.find("</", begin) - begin - 1);
            const size_t bad = list.find_first_not_of(name == "<v" ? "-0123456789 \t\r\n" : "0123456789 \t\r\n");
            if (bad != list.npos) return Error{ErrorCode::bad_file, "indices that are not numbers", begin + 1 + bad};
        }
    return {};
}

Result<Polygons> read_polygons(const std::string& path, std::string& detail) {
    const std::string type = extension(path);
    constexpr std::string_view kTexts[] = {".obj", ".off", ".ply", ".stl"};
    const bool is_own = std::find(std::begin(kTexts), std::end(kTexts), type) != std::end(kTexts);
    const bool is_gltf = type == ".gltf" || type == ".glb", is_assimps = type == ".dae" || type == ".3ds";
    const auto bytes = read_all(path.c_str());
    if (!bytes) return bytes.error();
    if (!is_own && !is_gltf && !is_assimps && type != ".3mf")
        return Error{ErrorCode::bad_file, "unknown kind of mesh file"};
    if (bytes->empty()) return Error{ErrorCode::bad_file, "the file is empty"};
    if (bytes->starts_with("\xFF\xFE") || bytes->starts_with("\xFE\xFF"))
        return Error{ErrorCode::bad_file, "text in UTF-16; save it as UTF-8"};
    if (bytes->starts_with("version https://git-lfs"))
        return Error{ErrorCode::bad_file, "a pointer of Git LFS, not the file itself; fetch it with 'git lfs pull'"};
    if (is_own) return read_text_or_binary(type, *bytes, detail);
    if (is_gltf) return read_gltf(type, *bytes, path, detail);
    if (type == ".3mf") return read_3mf(*bytes, detail);
    if (type == ".dae")
        if (const auto fit = check_collada(*bytes); !fit) return fit.error();
    return read_with_assimp(type, path, detail);
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
    const double read_spacing = spacing(Extent(polygons.points, polygons.corners).largest());
    double largest_scale = 0;
    for (const double s : placement.scale) largest_scale = std::max(largest_scale, std::abs(s));
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
    const auto lost = [&](double moved) {
        return words("points would move by %.2g m, and the mesh is %.3g m across", moved, diagonal);
    };
    if (polygons.points_are_rounded && diagonal > 0 && read_spacing * largest_scale > kMostRounding * diagonal) {
        report.detail = lost(read_spacing * largest_scale / 2);
        return Error{ErrorCode::bad_mesh,
                     "the mesh lies too far from (0, 0, 0) for the single precision that this format "
                     "is read in; move it there, or export it as OBJ"};
    }
    const double step = spacing(Extent(polygons.points, polygons.corners).largest());
    if (diagonal > 0 && step > kMostRounding * diagonal) {
        report.detail = lost(step / 2);
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
    for (size_t f = 0; f < polygons.sizes.size(); first += polygons.sizes[f++]) {
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

Result<Mesh> load_or_throw(const char* path, const ImportOptions& options, ImportReport& report) {
    auto polygons = read_polygons(path, report.detail);
    if (!polygons) return polygons.error();
    report.notes = std::move(polygons->notes);
    if (polygons->sizes.empty()) return Error{ErrorCode::bad_file, "the file has no triangles"};
    if (const auto finite = check_finite(*polygons, options, report.detail); !finite) return finite.error();
    const auto placement = place(*polygons, options, report);
    if (!placement) return placement.error();
    if (polygons->unit_is_ignored && placement->scale == Placement{}.scale)
        report.notes.push_back("its unit is not applied: --unit or --scale makes its numbers metres");
    return to_mesh(*polygons, *placement, report);
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

ImportOptions placed_as(const Placement& placement) {
    return {.unit = 1, .scale = placement.scale, .recentre = false, .origin = placement.origin};
}

std::optional<uint64_t> hash_mesh_file(const char* path, const ImportOptions& options) try {
    const std::string type = extension(path);
    const auto bytes = read_all(path);
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
    const uint64_t reader[] = {assimp_version(), kBuilderVersion, hash_bytes(std::as_bytes(std::span(type)))};
    const uint64_t how = hash_bytes(std::as_bytes(std::span(taken)), hash_bytes(std::as_bytes(std::span(reader))));
    return hash_bytes(std::as_bytes(std::span(*bytes)), how);
} catch (const std::bad_alloc&) {
    return {};
}

Result<Mesh> load_mesh(const char* path, const ImportOptions& options, ImportReport* report) {
    ImportReport unused;
    ImportReport& out = report ? *report : unused;
    if (const auto valid = check(options); !valid) return valid.error();
    try {
        out = {};
        return load_or_throw(path, options, out);
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

} // namespace prolate

#include "cli/inputs.hpp"

#include "cli/console.hpp"
#include "cli/signals.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <span>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace prolate::cli {
namespace {

// The kind of mesh, as an extension, that begins so.
std::string mesh_kind_of(std::string_view bytes) {
    const auto begins = [bytes](std::string_view with) { return bytes.starts_with(with); };
    const std::string_view head = bytes.substr(0, 4096);
    const auto holds = [head](std::string_view what) { return head.find(what) != head.npos; };
    uint32_t stl_triangles = 0;
    if (bytes.size() >= 84) std::memcpy(&stl_triangles, bytes.data() + 80, sizeof stl_triangles);
    if (bytes.size() >= 84 && bytes.size() == 84 + uint64_t{50} * stl_triangles) return "stl";
    if (begins("ply")) return "ply";
    if (begins("glTF")) return "glb";
    if (begins("PK\x03\x04")) return "3mf";
    if (begins("MM")) return "3ds";
    if (begins("solid") && holds("facet")) return "stl";
    if (holds("<COLLADA")) return "dae";
    if (head.substr(std::min(head.find_first_not_of(" \t\r\n"), head.size())).starts_with('{')) return "gltf";
    for (const char* off : {"OFF", "COFF", "NOFF", "STOFF"})
        if (begins(off)) return "off";
    return "obj";
}

// A mesh from standard input. The importer wants a name, by whose ending it knows the format.
Result<Mesh> load_standard_input(const ImportOptions& options, ImportReport& report) {
    const auto bytes = read_file("-");
    if (!bytes) return bytes.error();
    const GracefulStop removes_its_file;
    std::error_code error;
    const std::string kind = mesh_kind_of(*bytes);
    std::string name = (std::filesystem::temp_directory_path(error) / "prolate-XXXXXX.").string() + kind;
    const int file = error ? -1 : ::mkstemps(name.data(), static_cast<int>(kind.size()) + 1);
    if (file < 0)
        return Error{ErrorCode::io, "cannot be stored in the folder for temporary files", static_cast<uint64_t>(errno)};
    ::close(file);
    const auto written = save(name.c_str(), std::as_bytes(std::span(*bytes)));
    auto mesh = written ? load_mesh(name.c_str(), options, &report, not_interrupted) : Result<Mesh>(written.error());
    ::unlink(name.c_str());
    return mesh;
}

// Standard input can be read once.
Outcome<> take_standard_input() {
    static bool taken = false;
    if (std::exchange(taken, true))
        return Failure{kUsage, "-", "only one of the inputs can be standard input", "name a file"};
    return kSuccess;
}

} // namespace

bool is_standard_input(const std::string& path) {
    return path == "-" || path == "/dev/stdin";
}

Result<std::string> read_file(const std::string& path, size_t most) {
    const auto fail = [] { return Error{ErrorCode::io, "cannot be read", static_cast<uint64_t>(errno)}; };
    const int file = is_standard_input(path) ? ::dup(STDIN_FILENO) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return fail();
    std::string out;
    char buffer[1 << 16];
    while (out.size() < most) {
        const ssize_t n = ::read(file, buffer, std::min(sizeof buffer, most - out.size()));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            const Error error = fail();
            ::close(file);
            return error;
        }
        if (n == 0) break;
        out.append(buffer, static_cast<size_t>(n));
    }
    ::close(file);
    return out;
}

Outcome<Mesh> read_mesh(const std::string& path, const ImportOptions& options) {
    const bool piped = is_standard_input(path);
    if (piped)
        if (const auto taken = take_standard_input(); !taken) return taken.error();
    ImportReport report;
    auto mesh =
        piped ? load_standard_input(options, report) : load_mesh(path.c_str(), options, &report, not_interrupted);
    if (!mesh)
        return failure_of(piped ? "standard input" : path, mesh.error(), report.detail,
                          mesh.error().code == ErrorCode::bad_file
                              ? "export the mesh again, as OBJ, PLY, STL, OFF, glTF, GLB, 3MF, 3DS or DAE"
                              : "");
    for (const std::string& line : report.notes) note(path, line);
    return std::move(*mesh);
}

Outcome<RiggedMesh> read_rigged_mesh(const std::string& path, const ImportOptions& options) {
    ImportReport report;
    auto rigged = load_rigged_mesh(path.c_str(), options, &report, not_interrupted);
    if (!rigged) return failure_of(path, rigged.error(), report.detail);
    return std::move(*rigged);
}

Outcome<Tree> read_tree(const std::string& path) {
    const bool piped = is_standard_input(path);
    if (piped)
        if (const auto taken = take_standard_input(); !taken) return taken.error();
    auto tree = load(piped ? "/dev/stdin" : path.c_str());
    if (!tree)
        return failure_of(piped ? "standard input" : path, tree.error(), "",
                          tree.error().code == ErrorCode::bad_file ? "make it again with 'prolate bake'" : "");
    return std::move(*tree);
}

} // namespace prolate::cli

#include "bench/covers/decompositions.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace prolate::bench {
namespace {

void write_wavefront(const std::string& path, MeshView mesh) {
    std::ofstream file(path);
    for (const Vec3& v : mesh.vertices) file << fmt::format("v {} {} {}\n", v.x, v.y, v.z);
    for (const Triangle& t : mesh.triangles) file << fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
}

} // namespace

// The lines that decompose.py prints with these arguments.
std::vector<std::string> Decomposers::lines_of(const std::string& arguments) const {
    const std::string command = fmt::format("'{}' '{}' {} 2>/dev/null", python_, PROLATE_BENCH_DECOMPOSE, arguments);
    std::string text;
    if (FILE* pipe = popen(command.c_str(), "r")) {
        char buffer[4096];
        while (const size_t n = fread(buffer, 1, sizeof buffer, pipe)) text.append(buffer, n);
        pclose(pipe);
    }
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
}

std::vector<std::string> Decomposers::names(std::string& why) const {
    if (!std::filesystem::exists(python_)) {
        why = fmt::format("there is no {}; ./run peers installs them", python_);
        return {};
    }
    auto names = lines_of("list");
    if (names.empty()) why = "none is installed; ./run peers installs them";
    return names;
}

std::optional<Decomposition> Decomposers::run(const std::string& name, MeshView mesh, uint32_t count,
                                              uint32_t seconds) const {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("prolate-hulls-{}", getpid());
    std::filesystem::create_directory(folder);
    const std::string in = folder / "mesh.obj", out = folder / "hulls.obj";
    write_wavefront(in, mesh);
    const auto lines = lines_of(fmt::format("{} {} {} '{}' '{}'", name, count, seconds, in, out));
    const auto cost = lines.empty() ? nlohmann::json() : nlohmann::json::parse(lines.back(), nullptr, false);
    std::optional<Decomposition> made;
    if (auto hulls = load_mesh(out.c_str()); hulls && cost.is_object())
        made = {cost["version"],
                cost["hulls"],
                std::move(*hulls),
                {cost["wall_seconds"], cost["cpu_seconds"], cost["megabytes"]}};
    std::filesystem::remove_all(folder);
    return made;
}

} // namespace prolate::bench

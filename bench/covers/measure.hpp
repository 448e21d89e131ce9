// What the reports of this folder measure: one bake in a process of its own, and how close a cover is to its solid.
#pragma once

#include "builder/columns.hpp"

#include <prolate/build.hpp>

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <type_traits>

namespace prolate::bench {

inline constexpr double kUnknown = LevelFigures::kUnknown;

/// Qualities by their names on a command line.
inline const std::map<std::string, Quality> kQualities{
    {"fast", Quality::fast}, {"normal", Quality::normal}, {"best", Quality::best}};

/// What a plain list of primitives takes: center and radius, center and factor, and of a hull its corners; four bytes a
/// number.
inline constexpr size_t kSphereBytes = 16, kEllipsoidBytes = 36, kCornerBytes = 12;

/// What a piece of work took. Peak memory is the process's: of the whole, loading included.
struct Cost {
    double wall_seconds = 0, cpu_seconds = 0, megabytes = 0;
};

/// A mesh, cleaned, and how its reader called it.
struct Model {
    std::string name;
    Mesh mesh;
    bool closed = false;
};
/// Reads and cleans `path`; prints the reason if it cannot.
std::optional<Model> load_model(const std::string& path);

/// How close a cover is to the solid. Lengths in percent of the diagonal of the mesh's box; NaN: not measured.
struct Figures {
    uint32_t count = 0;              ///< primitives
    double outside_ratio = kUnknown; ///< volume of (cover \ solid) / volume of the solid
    double outside_error = kUnknown; ///< of outside_ratio, see Quadrature
    double uncovered = kUnknown;     ///< volume of (solid \ cover) / volume of the solid
    double hausdorff_max = kUnknown, hausdorff_mean = kUnknown, hausdorff_p99 = kUnknown;
    double sum_of_volumes = kUnknown; ///< of the primitives, each by itself / volume of the solid
    double list_bytes = kUnknown;     ///< of a plain list of the primitives
    double nanoseconds = kUnknown;    ///< that a query takes, see cli/compare/query_time.hpp
};

/// Measures volumes of covers of one solid, on columns of its own: a bake must not be judged on the lattice that it
/// optimised on.
class Judge {
public:
    Judge(const Model& model, int columns_across);
    Figures ellipsoids(std::span<const Ellipsoid> cover) const;
    /// `hulls` are `count` closed convex surfaces, oriented outwards, one after the other. hausdorff_max is sampled on
    /// them, twice in each percent of the diagonal, so that it is too small by up to a third of a percent. Queries are
    /// those of an exact tree of them all.
    Figures hulls(MeshView hulls, uint32_t count) const;

private:
    double farthest(MeshView surface) const;
    Winding winding_;
    Columns solid_;
    double volume_, diagonal_;
    bool closed_;
};

/// What became of a bake. Trivially copyable: it travels through a pipe.
struct Baked {
    std::array<char, 200> error{}; ///< "" if all went well
    bool unsupported = false;      ///< the error is that this version cannot do what was asked
    uint32_t triangles = 0, nodes = 0, leaves = 0, level_count = 0, resolution = 0;
    uint64_t bytes = 0;
    double outside_ratio = kUnknown; ///< of the last level, as the bake itself reports it
    bool closed = false, proved = false, goal_reached = false;
    Cost cost;
    double voxelise = 0, fit = 0, measure = 0, prove = 0; ///< wall seconds, by stage
    std::array<Figures, kMaxLevels> levels;               ///< of each level's cut
};

/// Bakes the mesh of `path` in a process of its own, so that peak memory is its own, and judges each level's cut (only
/// the last one, with a query's time, if not `all_levels`; none if `columns_across` is 0). The caller must not have
/// started threads.
Baked bake_apart(const std::string& path, const BuildOptions& options, int columns_across, bool all_levels);

/// Runs `work` in a child process and returns what it returns; nothing if the child died. No threads may run yet.
template <class Work> auto in_child(Work&& work) -> std::optional<std::invoke_result_t<Work>> {
    using T = std::invoke_result_t<Work>;
    static_assert(std::is_trivially_copyable_v<T>);
    int ends[2];
    if (pipe(ends) != 0) return std::nullopt;
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        const T result = work();
        const bool sent =
            write(ends[1], &result, sizeof result) == static_cast<ssize_t>(sizeof result); // one page or so
        _exit(sent ? 0 : 1);
    }
    close(ends[1]);
    T result;
    size_t got = 0;
    for (ssize_t n = 1; n > 0 && got<sizeof result; got += n> 0 ? static_cast<size_t>(n) : 0)
        n = read(ends[0], reinterpret_cast<char*>(&result) + got, sizeof result - got);
    close(ends[0]);
    if (child < 0 || waitpid(child, nullptr, 0) != child || got < sizeof result) return std::nullopt;
    return result;
}

} // namespace prolate::bench

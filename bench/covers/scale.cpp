// Time and peak memory of a bake against the number of nodes.
//
//   bench_scale horse.obj --csv scale.csv --svg docs/scale.svg
//
// Every bake runs in a process of its own, so that peak memory is its own. The slope of a step is the exponent p of
// "CPU seconds grow like nodes^p" since the row before: 1 is linear.
#include "bench/covers/measure.hpp"
#include "bench/covers/plot.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/os.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <vector>

namespace prolate::bench {
namespace {

struct Arguments {
    std::vector<std::string> meshes, qualities{"fast"}, modes{"ellipsoids", "levels"};
    std::vector<uint32_t> counts{64, 512, 4096, 32768};
    std::string csv, svg;
    uint32_t degree = 8, threads = 0;
};

constexpr const char* kHead = "model,triangles,mode,quality,asked,nodes,leaves,outside_ratio,cpu_seconds,wall_seconds,"
                              "voxelise_seconds,fit_seconds,measure_seconds,prove_seconds,megabytes,bytes,resolution\n";

int run(const Arguments& a) {
    Panel time{"CPU time", "seconds", {}}, memory{"peak memory", "MiB", {}};
    std::string rows = kHead;
    bool failed = false;
    for (const std::string& path : a.meshes)
        for (const std::string& quality : a.qualities)
            for (const std::string& mode : a.modes) {
                fmt::print("\n{}, --{}, quality {}\n{:>8}{:>8}{:>8}{:>9}{:>9}{:>7}{:>9}{:>7} | {:>8}{:>8}{:>8}{:>8}\n",
                           path, mode, quality, "asked", "nodes", "leaves", "outside", "cpu s", "slope", "MiB", "slope",
                           "voxelise", "fit", "measure", "prove");
                const std::string name = std::filesystem::path(path).stem().string();
                const std::string label = fmt::format("{}, --{}, {}", name, mode, quality);
                time.series.push_back({label, {}}), memory.series.push_back({label, {}});
                for (const uint32_t count : a.counts) {
                    BuildOptions options;
                    options.degree = a.degree, options.threads = a.threads;
                    options.quality = kQualities.at(quality);
                    if (mode == "ellipsoids")
                        options.ellipsoids = count;
                    else
                        options.levels = static_cast<uint32_t>(
                            std::max(1.0, std::round(std::log(count) / std::log(static_cast<double>(a.degree)))));
                    const Baked b = bake_apart(path, options, 0, false);
                    if (b.error[0] != '\0') {
                        fmt::print("{:>8} {}: {}\n", count, b.unsupported ? "unsupported" : "failed", b.error.data());
                        failed |= !b.unsupported;
                        continue;
                    }
                    const auto slope = [&](const Series& s, double y) {
                        if (s.points.empty()) return std::string("-");
                        const auto& [x0, y0] = s.points.back();
                        return fmt::format("{:.2f}", std::log(y / y0) / std::log(b.nodes / x0));
                    };
                    fmt::print("{:>8}{:>8}{:>8}{:>9.4f}{:>9.2f}{:>7}{:>9.0f}{:>7} | {:>8.2f}{:>8.2f}{:>8.2f}{:>8.2f}\n",
                               count, b.nodes, b.leaves, b.outside_ratio, b.cost.cpu_seconds,
                               slope(time.series.back(), b.cost.cpu_seconds), b.cost.megabytes,
                               slope(memory.series.back(), b.cost.megabytes), b.voxelise, b.fit, b.measure, b.prove);
                    std::fflush(stdout);
                    rows += fmt::format(
                        "{},{},{},{},{},{},{},{:.6f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.1f},{},{}\n", name,
                        b.triangles, mode, quality, count, b.nodes, b.leaves, b.outside_ratio, b.cost.cpu_seconds,
                        b.cost.wall_seconds, b.voxelise, b.fit, b.measure, b.prove, b.cost.megabytes, b.bytes,
                        b.resolution);
                    time.series.back().points.emplace_back(b.nodes, b.cost.cpu_seconds);
                    memory.series.back().points.emplace_back(b.nodes, b.cost.megabytes);
                    // After each row: a long run that is interrupted has its files.
                    if (!a.csv.empty()) fmt::output_file(a.csv).print("{}", rows);
                    if (!a.svg.empty())
                        fmt::output_file(a.svg).print("{}", log_log_plot("Cost of a bake", "nodes of the tree",
                                                                         {time, memory}, {.slope_of_one = true}));
                }
            }
    return failed ? 1 : 0;
}

} // namespace
} // namespace prolate::bench

int main(int argc, char** argv) {
    using namespace prolate::bench;
    Arguments a;
    CLI::App app{"Time and peak memory of bakes against the number of nodes; docs/covers.md explains the columns"};
    app.add_option("meshes", a.meshes, "mesh files")->required()->check(CLI::ExistingFile);
    app.add_option("--counts", a.counts, "leaves asked for")->delimiter(',')->capture_default_str();
    app.add_option("--mode", a.modes, "ask by --ellipsoids, by --levels (as many as have so many leaves), or both")
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::IsMember({"ellipsoids", "levels"}));
    app.add_option("--quality", a.qualities)->delimiter(',')->capture_default_str()->check(CLI::IsMember(kQualities));
    app.add_option("--degree", a.degree)->capture_default_str()->check(CLI::Range(2, 64));
    app.add_option("--threads", a.threads, "0: all cores");
    app.add_option("--csv", a.csv, "file for the rows");
    app.add_option("--svg", a.svg, "file for the plot");
    CLI11_PARSE(app, argc, argv);
    return run(a);
}

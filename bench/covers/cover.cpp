// How close covers are to their solids: prolate at several counts, what was published, and what peers do.
//
//   bench_cover horse.obj --counts 8,64 --quality best --peers build/peers/bin/python
//
// docs/covers.md says what each column means. Every bake runs in a process of its own, is measured on columns that it
// did not optimise on, and takes all the cores that it is given; CPU seconds are those of all threads together.
#include "bench/covers/decompositions.hpp"
#include "bench/covers/measure.hpp"
#include "bench/covers/published.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

namespace prolate::bench {
namespace {

using Json = nlohmann::ordered_json;

const std::map<std::string, Method> kMethods{{"voxel", Method::voxel}, {"analytic", Method::analytic}};
const std::map<std::string, Primitive> kPrimitives{{"ellipsoid", Primitive::ellipsoid}, {"sphere", Primitive::sphere}};

template <class T> std::string name_of(const std::map<std::string, T>& names, T value) {
    for (const auto& [name, v] : names)
        if (v == value) return name;
    return "";
}

struct Arguments {
    std::vector<std::string> meshes;
    std::vector<uint32_t> counts{8, 32, 64, 200, 512};
    std::vector<std::string> primitives{"ellipsoid", "sphere"};
    std::string quality = "best", method = "voxel", peers;
    uint32_t levels = 0, degree = 8, threads = 0, peer_seconds = 600;
    float alpha = 0.5f, beta = 0.5f;
    uint64_t seed = 1;
    int columns = 800;
    bool compare_methods = false, trade = false, json = false, csv = false;
};

// Rows, each with the same keys, as a table of text at once, or as JSON or CSV.
class Report {
public:
    explicit Report(const Arguments& a) : json_(a.json), csv_(a.csv) {}
    ~Report() {
        if (json_) fmt::print("{}\n", rows_.dump(2));
    }
    void title(const std::string& text) {
        if (!json_ && !csv_) fmt::print("\n{}\n{}", text, heads());
    }
    void add(const Json& row) {
        if (json_)
            rows_.push_back(row);
        else
            fmt::print("{}", csv_ ? comma_separated(row) : text(row));
        std::fflush(stdout);
    }
    void note(const std::string& text) { fmt::print(json_ || csv_ ? stderr : stdout, "{}\n", text); }

private:
    struct Column {
        const char *key, *head, *format;
        int width;
    };
    static constexpr Column kColumns[] = {{"made_of", "", "{}", -30},
                                          {"count", "n", "{:.0f}", 6},
                                          {"outside_ratio", "outside", "{:.4f}", 8},
                                          {"outside_error", "+/-", "{:.0e}", 6},
                                          {"uncovered", "uncov.", "{:.4f}", 7},
                                          {"hausdorff_max", "H max", "{:.2f}", 6},
                                          {"hausdorff_mean", "mean", "{:.3f}", 6},
                                          {"hausdorff_p99", "99 %", "{:.2f}", 6},
                                          {"sum_of_volumes", "volumes", "{:.2f}", 8},
                                          {"list_bytes", "bytes", "{:.0f}", 7},
                                          {"nanoseconds", "ns", "{:.0f}", 6},
                                          {"outside_at_count", "at n", "{:.2f}", 7},
                                          {"outside_at_bytes", "at B", "{:.2f}", 7},
                                          {"outside_at_time", "at ns", "{:.2f}", 7},
                                          {"proved", "proved", "{}", 7},
                                          {"cpu_seconds", "cpu s", "{:.2f}", 8},
                                          {"wall_seconds", "wall s", "{:.2f}", 8},
                                          {"megabytes", "MiB", "{:.0f}", 6},
                                          {"outside_to_reference", "out. x", "{:.3f}", 7},
                                          {"cpu_to_reference", "cpu x", "{:.2f}", 7},
                                          {"published_naive", "naive", "{:.3f}", 7},
                                          {"published_vhacd", "V-HACD", "{:.3f}", 7},
                                          {"published_amaa", "AMAA", "{:.3f}", 7},
                                          {"goal", "goal", "{:.3f}", 7}};

    static std::string heads() {
        std::string out;
        for (const Column& c : kColumns)
            out += c.width < 0 ? fmt::format("{:<{}}", c.head, -c.width) : fmt::format("{:>{}}", c.head, c.width);
        return out + '\n';
    }
    static std::string text(const Json& row) {
        if (row.contains("error"))
            return fmt::format("{:<30} {}: {}\n", row["made_of"].get<std::string>(),
                               row["unsupported"].get<bool>() ? "unsupported" : "failed",
                               row["error"].get<std::string>());
        std::string out;
        for (const Column& c : kColumns) {
            std::string cell = "-";
            if (const auto value = row.find(c.key); value == row.end())
                cell = "";
            else if (value->is_boolean())
                cell = value->get<bool>() ? "yes" : "NO";
            else if (value->is_string())
                cell = value->get<std::string>();
            else if (value->is_number() && !std::isnan(value->get<double>()))
                cell = fmt::format(fmt::runtime(c.format), value->get<double>());
            out += c.width < 0 ? fmt::format("{:<{}}", cell, -c.width) : fmt::format("{:>{}}", cell, c.width);
        }
        return out + '\n';
    }
    std::string comma_separated(const Json& row) {
        std::string head, line;
        for (const char* key : kKeys) {
            const auto value = row.find(key);
            head += fmt::format("{}{}", head.empty() ? "" : ",", key);
            const bool known = value != row.end() && !(value->is_number_float() && std::isnan(value->get<double>()));
            line += key == kKeys[0] ? "" : ",";
            line += known ? value->dump() : "";
        }
        return (std::exchange(headed_, true) ? "" : head + '\n') + line + '\n';
    }
    static constexpr const char* kKeys[] = {"model",
                                            "triangles",
                                            "closed",
                                            "made_of",
                                            "primitive",
                                            "method",
                                            "quality",
                                            "alpha",
                                            "beta",
                                            "asked",
                                            "count",
                                            "outside_ratio",
                                            "outside_error",
                                            "uncovered",
                                            "hausdorff_max",
                                            "hausdorff_mean",
                                            "hausdorff_p99",
                                            "sum_of_volumes",
                                            "list_bytes",
                                            "nanoseconds",
                                            "outside_at_count",
                                            "outside_at_bytes",
                                            "outside_at_time",
                                            "proved",
                                            "goal_reached",
                                            "cpu_seconds",
                                            "wall_seconds",
                                            "megabytes",
                                            "bytes",
                                            "resolution",
                                            "outside_to_reference",
                                            "cpu_to_reference",
                                            "published_naive",
                                            "published_vhacd",
                                            "published_amaa",
                                            "goal",
                                            "unsupported",
                                            "error"};

    bool json_, csv_, headed_ = false;
    Json rows_ = Json::array();
};

void put(Json& row, const Figures& f) {
    row["count"] = f.count;
    row["outside_ratio"] = f.outside_ratio, row["outside_error"] = f.outside_error, row["uncovered"] = f.uncovered;
    row["hausdorff_max"] = f.hausdorff_max, row["hausdorff_mean"] = f.hausdorff_mean;
    row["hausdorff_p99"] = f.hausdorff_p99, row["sum_of_volumes"] = f.sum_of_volumes;
    row["list_bytes"] = f.list_bytes, row["nanoseconds"] = f.nanoseconds;
}

void put(Json& row, const Cost& c) {
    row["cpu_seconds"] = c.cpu_seconds, row["wall_seconds"] = c.wall_seconds, row["megabytes"] = c.megabytes;
}

void put_published(Json& row, const std::string& model, uint32_t triangles, uint32_t count) {
    const Published p = published(model, triangles, count);
    row["published_naive"] = p.naive, row["published_vhacd"] = p.vhacd, row["published_amaa"] = p.amaa;
    row["goal"] = p.goal;
}

// What a row is set against: its outside ratio and CPU seconds over those.
struct Reference {
    double outside = kUnknown, cpu = kUnknown;
};

// How the outside ratio of some covers falls with what they cost.
class Curve {
public:
    void add(double cost, double outside) {
        if (cost > 0 && outside > 0) points_[std::log(cost)] = std::log(outside);
    }
    // Of the cover of that cost, between two that are there (on a straight line of logarithms); else unknown.
    double operator()(double cost) const {
        const auto above = points_.lower_bound(std::log(cost));
        if (above == points_.end()) return kUnknown;
        if (above->first == std::log(cost)) return std::exp(above->second);
        if (above == points_.begin()) return kUnknown;
        const auto below = std::prev(above);
        const double t = (std::log(cost) - below->first) / (above->first - below->first);
        return std::exp(std::lerp(below->second, above->second, t));
    }

private:
    std::map<double, double> points_;
};

// What rows of other primitives are set against: ellipsoids as many, as large or as fast.
struct Curves {
    Curve by_count, by_bytes, by_time;

    void add(const Json& row) {
        const double outside = row["outside_ratio"];
        by_count.add(row["count"], outside);
        by_bytes.add(row["list_bytes"], outside);
        by_time.add(row["nanoseconds"], outside);
    }
    void compare(Json& row) const {
        const double outside = row["outside_ratio"];
        row["outside_at_count"] = outside / by_count(row["count"]);
        row["outside_at_bytes"] = outside / by_bytes(row["list_bytes"]);
        row["outside_at_time"] = outside / by_time(row["nanoseconds"]);
    }
};

std::string stem(const std::string& path) {
    return std::filesystem::path(path).stem().string();
}

// One bake's row for the cut at level `l`.
Json row_of(const std::string& path, const std::string& made_of, const BuildOptions& o, const Baked& b, uint32_t l,
            uint32_t asked, const Reference& reference = {}) {
    const auto rounded = [](float x) { return std::round(1e6 * double{x}) / 1e6; };
    Json row{{"model", stem(path)},
             {"triangles", b.triangles},
             {"closed", b.closed},
             {"made_of", made_of},
             {"primitive", name_of(kPrimitives, o.primitive)},
             {"method", name_of(kMethods, o.method)},
             {"quality", name_of(kQualities, o.quality)},
             {"alpha", rounded(o.alpha)},
             {"beta", rounded(o.beta)},
             {"asked", asked}};
    row["unsupported"] = b.unsupported;
    if (b.error[0] != '\0') {
        row["error"] = b.error.data();
        return row;
    }
    const Figures& f = b.levels[l];
    put(row, f);
    row["proved"] = b.proved, row["goal_reached"] = b.goal_reached;
    put(row, b.cost);
    row["bytes"] = b.bytes, row["resolution"] = b.resolution;
    row["outside_to_reference"] = f.outside_ratio / reference.outside;
    row["cpu_to_reference"] = b.cost.cpu_seconds / reference.cpu;
    put_published(row, stem(path), b.triangles, asked);
    return row;
}

Reference reference_of(const Json& row) {
    if (row.contains("error")) return {};
    return {row["outside_ratio"].get<double>(), row["cpu_seconds"].get<double>()};
}

class Benchmark {
public:
    explicit Benchmark(const Arguments& a) : a_(a), report_(a) {
        base_.degree = a.degree, base_.threads = a.threads, base_.seed = a.seed;
        base_.alpha = a.alpha, base_.beta = a.beta;
        base_.quality = kQualities.at(a.quality), base_.method = kMethods.at(a.method);
    }

    int run() {
        for (const std::string& path : a_.meshes) {
            if (a_.compare_methods)
                compare_methods(path);
            else if (a_.trade)
                trade(path);
            else if (a_.levels)
                tree(path);
            else
                flat(path);
        }
        return failed_ ? 1 : 0;
    }

private:
    Json bake(const std::string& path, BuildOptions options, uint32_t count, const std::string& made_of,
              const Reference& reference = {}, Curves* curves = nullptr) {
        options.ellipsoids = count;
        const Baked baked = bake_apart(path, options, a_.columns, false);
        const uint32_t last = baked.level_count ? baked.level_count - 1 : 0;
        Json row = row_of(path, made_of, options, baked, last, count, reference);
        failed_ |= row.contains("error") && !baked.unsupported;
        if (curves && !row.contains("error")) {
            if (options.primitive == Primitive::ellipsoid) curves->add(row);
            curves->compare(row);
        }
        report_.add(row);
        return row;
    }

    void flat(const std::string& path) {
        report_.title(fmt::format("{}: flat sets, quality {}", path, a_.quality));
        Curves ellipsoids; // first, so that the others can be set against them
        for (const auto& [name, primitive] : kPrimitives)
            for (const uint32_t count : a_.counts) {
                if (std::ranges::find(a_.primitives, name) == a_.primitives.end()) continue;
                BuildOptions options = base_;
                options.primitive = primitive;
                bake(path, options, count, name + 's', {}, &ellipsoids);
            }
        peers(path, ellipsoids);
    }

    // Each level of a tree against the flat set of the same count.
    void tree(const std::string& path) {
        for (const std::string& primitive : a_.primitives) {
            BuildOptions options = base_;
            options.primitive = kPrimitives.at(primitive);
            report_.title(fmt::format("{}: a tree of {}s, degree {}, quality {}; x: against the flat set of that count",
                                      path, primitive, a_.degree, a_.quality));
            BuildOptions levels = options;
            levels.levels = a_.levels;
            const Baked baked = bake_apart(path, levels, a_.columns, true);
            if (baked.error[0] != '\0') {
                failed_ |= !baked.unsupported;
                report_.add(row_of(path, "tree", levels, baked, 0, 0));
                continue;
            }
            for (uint32_t l = 1; l < baked.level_count; ++l) {
                const uint32_t count = baked.levels[l].count;
                const Json flat = bake(path, options, count, "flat");
                report_.add(row_of(path, fmt::format("level {}", l), levels, baked, l, count, reference_of(flat)));
            }
        }
    }

    // The paper's comparison: the same model and counts; its sentence is that both methods are alike at low levels, and
    // the analytic one better when refining.
    void compare_methods(const std::string& path) {
        report_.title(fmt::format("{}: quality {}; x: against the voxel method", path, a_.quality));
        for (const uint32_t count : a_.counts) {
            Reference reference;
            for (const char* method : {"voxel", "analytic"}) {
                BuildOptions options = base_;
                options.method = kMethods.at(method);
                const Json row = bake(path, options, count, method, reference);
                if (options.method == Method::voxel) reference = reference_of(row);
            }
        }
    }

    // E = alpha E_sur^3 + beta E_vol: shape for volume (paper, eq. 3).
    void trade(const std::string& path) {
        report_.title(fmt::format("{}: quality {}; x: against alpha = 0", path, a_.quality));
        for (const uint32_t count : a_.counts) {
            Reference reference;
            for (const float alpha : {0.0f, 1.0f, 10.0f, 100.0f, 1000.0f}) {
                BuildOptions options = base_;
                options.alpha = alpha, options.beta = 1;
                const Json row = bake(path, options, count, fmt::format("alpha {:g}, beta 1", alpha), reference);
                if (alpha == 0) reference = reference_of(row);
            }
        }
    }

    void peers(const std::string& path, const Curves& ellipsoids) {
        if (a_.peers.empty()) return;
        const Decomposers decomposers(a_.peers);
        std::string why;
        const std::vector<std::string> names = decomposers.names(why);
        if (names.empty()) return report_.note(fmt::format("peers: skipped, {}", why));
        const auto model = load_model(path);
        if (!model) return;
        for (const std::string& name : names)
            for (const uint32_t count : a_.counts) peer(path, *model, decomposers, name, count, ellipsoids);
    }

    void peer(const std::string& path, const Model& model, const Decomposers& decomposers, const std::string& name,
              uint32_t count, const Curves& ellipsoids) {
        const auto made = decomposers.run(name, model.mesh.view(), count, a_.peer_seconds);
        if (!made) return report_.note(fmt::format("{} {}: gave nothing within {} s", name, count, a_.peer_seconds));
        // In a child: oneTBB's threads must not be there when the next bake forks.
        const auto figures = in_child([&] { return Judge(model, a_.columns).hulls(made->hulls.view(), made->count); });
        if (!figures) return report_.note(fmt::format("{} {}: its hulls cannot be measured", name, count));
        Json row{{"model", stem(path)},    {"triangles", model.mesh.triangles.size()},
                 {"closed", model.closed}, {"made_of", fmt::format("{} {} hulls", name, made->version)},
                 {"primitive", "hull"},    {"asked", count}};
        put(row, *figures);
        ellipsoids.compare(row);
        row["proved"] = false;
        put(row, made->cost);
        put_published(row, stem(path), static_cast<uint32_t>(model.mesh.triangles.size()), count);
        report_.add(row);
    }

    const Arguments& a_;
    Report report_;
    BuildOptions base_;
    bool failed_ = false;
};

} // namespace
} // namespace prolate::bench

int main(int argc, char** argv) {
    using namespace prolate::bench;
    Arguments a;
    CLI::App app{"How close covers are to their solids; docs/covers.md explains the columns"};
    app.add_option("meshes", a.meshes, "mesh files")->required()->check(CLI::ExistingFile);
    app.add_option("--counts", a.counts, "ellipsoids asked for")->delimiter(',')->capture_default_str();
    app.add_option("--primitive", a.primitives, "ellipsoid, sphere, or both")
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::IsMember(kPrimitives));
    app.add_option("--quality", a.quality)->capture_default_str()->check(CLI::IsMember(kQualities));
    app.add_option("--method", a.method)->capture_default_str()->check(CLI::IsMember(kMethods));
    auto* levels = app.add_option("--levels", a.levels, "instead: each level of a tree against a flat set")
                       ->check(CLI::Range(1, 10));
    auto* compare = app.add_flag("--compare-methods", a.compare_methods, "instead: voxel against analytic");
    auto* trade = app.add_flag("--trade", a.trade, "instead: alpha = 0, 1, 10, 100, 1000 with beta = 1");
    levels->excludes(compare)->excludes(trade), compare->excludes(trade);
    app.add_option("--alpha", a.alpha)->capture_default_str();
    app.add_option("--beta", a.beta)->capture_default_str();
    app.add_option("--degree", a.degree)->capture_default_str();
    app.add_option("--seed", a.seed)->capture_default_str();
    app.add_option("--threads", a.threads, "0: all cores");
    app.add_option("--columns", a.columns, "columns across, to measure with")
        ->capture_default_str()
        ->check(CLI::Range(16, 4096));
    app.add_option("--peers", a.peers, "Python that has peers installed, as ./run peers makes it");
    app.add_option("--peer-seconds", a.peer_seconds, "wall time after which a peer is stopped")->capture_default_str();
    auto* json = app.add_flag("--json", a.json, "print an array of rows as JSON");
    app.add_flag("--csv", a.csv, "print rows as CSV")->excludes(json);
    CLI11_PARSE(app, argc, argv);
    return Benchmark(a).run();
}

// prolate and other libraries of collision queries in one process, on the same poses.
//
//   bench_peers [MESH | MESH,MESH]... [--quick] [--poses=500] [--seed=1] [--seconds=0.5] [--data=FOLDER]
//               [--benchmark_...]
//
// A MESH is a file, or one of the names horse, bunny, homer, knight (from FOLDER, else from Debian's glmark2-data) and
// cad (made here). Without any: the pairs of kPairs. Benchmarks are called
//   collide|distance/<meshA>-<meshB>/<far|near|touching>[-aligned]/<library>
//   collide-again/<meshA>-<meshB>/<near|touching>/<library>       B has moved by 0.1 %; with and without what is known
//   collide-proxy/<meshA>-<meshB>/near-<leaves>/<library>         proxy trees and hulls instead of triangles
//   pair-boolean|pair-distance/<random|near>/<library>            single ellipsoids (pairs.hpp)
// Their time is the median of a pose (sweep.hpp), and the counters are in nanoseconds and tests a query. All libraries
// of a group run when the first of them is due, in turns; --benchmark_filter leaves out those that do not match. The
// table at the end, with the ratios, goes to standard error.
#include "bench/peers/pairs.hpp"
#include "bench/peers/table.hpp"

#include <benchmark/benchmark.h>

#ifdef PROLATE_BENCH_COAL
#include <dlfcn.h>
#endif

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <regex>
#include <string_view>
#include <type_traits>

namespace prolate::bench::peers {
namespace {

const std::vector<std::pair<std::string, std::string>> kPairs = {
    {"horse", "horse"}, {"bunny", "horse"}, {"homer", "homer"}, {"knight", "knight"}, {"cad", "cad"}};
const std::vector<std::pair<std::string, std::string>> kQuickPairs = {{"knight", "knight"}, {"cad", "cad"}};

struct Arguments {
    ComparisonOptions options;
    std::vector<std::pair<std::string, std::string>> pairs;
};

constexpr const char* kHelp =
    "bench_peers [MESH | MESH,MESH]... [--quick] [--poses=500] [--seed=1] [--seconds=0.5] [--data=FOLDER]\n"
    "            [--benchmark_...]\n"
    "  MESH      a file, or one of horse, bunny, homer, knight (from FOLDER, else from Debian's glmark2-data), cad\n"
    "  --quick   two minutes: two small meshes unless some are named, 100 poses, 0.05 seconds\n"
    "  --poses   poses of each kind\n"
    "  --seconds CPU time that each library gets for each kind of poses, at least\n"
    "and the options of Google Benchmark, such as --benchmark_filter=REGEX, --benchmark_format=json:\n\n";

// Reads what Google Benchmark left of the command line.
std::optional<Arguments> parse(int argc, char** argv) {
    Arguments out;
    out.options.data = PROLATE_BENCH_DATA;
    out.options.python = PROLATE_BENCH_PEERS "/bin/python";
    const bool quick = std::any_of(argv + 1, argv + argc, [](std::string_view word) { return word == "--quick"; });
    if (quick) out.options.poses = 100, out.options.seconds = 0.05;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        const auto value = [&](const std::string& option) -> const char* {
            return word.starts_with(option + "=") ? word.c_str() + option.size() + 1 : nullptr;
        };
        if (const char* v = value("--poses"))
            out.options.poses = std::strtoull(v, nullptr, 10);
        else if (const char* s = value("--seed"))
            out.options.seed = std::strtoull(s, nullptr, 10);
        else if (const char* t = value("--seconds"))
            out.options.seconds = std::strtod(t, nullptr);
        else if (const char* d = value("--data"))
            out.options.data = d;
        else if (word == "--quick")
            continue;
        else if (word.starts_with("-")) {
            std::fprintf(stderr, "bench_peers: no such option: %s\n", word.c_str());
            return std::nullopt;
        } else {
            const size_t comma = word.find(',');
            out.pairs.emplace_back(word.substr(0, comma), comma == word.npos ? word : word.substr(comma + 1));
        }
    }
    if (out.options.poses == 0) {
        std::fprintf(stderr, "bench_peers: --poses must be above 0\n");
        return std::nullopt;
    }
    if (out.pairs.empty()) out.pairs = quick ? kQuickPairs : kPairs;
    return out;
}

constexpr size_t kEllipsoidPairs = 4096;

bool wanted(const std::string& name) { // as Google Benchmark itself decides
    std::string filter = benchmark::GetBenchmarkFilter();
    if (filter.empty() || filter == "all") return true;
    const bool negative = filter[0] == '-';
    if (negative) filter.erase(0, 1);
    return std::regex_search(name, std::regex(filter, std::regex::extended)) != negative;
}

// What is timed together, measured when first asked for.
class Group {
public:
    using Run = std::function<std::vector<Outcome>(const std::vector<std::string>&)>;
    Group(std::string name, const std::vector<std::string>& able, Run run)
        : name_(std::move(name)), run_(std::move(run)) {
        for (const std::string& library : able)
            if (wanted(name_ + "/" + library)) libraries_.push_back(library);
    }
    const std::string& name() const { return name_; }
    const std::vector<std::string>& libraries() const { return libraries_; } // that the filter leaves
    const std::vector<Outcome>& outcomes() {
        if (!done_) outcomes_ = run_(libraries_), done_ = true;
        return outcomes_;
    }
    bool done() const { return done_; }

private:
    std::string name_;
    std::vector<std::string> libraries_;
    Run run_;
    std::vector<Outcome> outcomes_;
    bool done_ = false;
};

void report(benchmark::State& state, Group& group, const std::string& library) {
    const auto& outcomes = group.outcomes();
    const auto at = std::ranges::find(outcomes, library, &Outcome::library);
    if (at == outcomes.end()) {
        state.SkipWithError("the library cannot make this model");
        return;
    }
    for (auto _ : state) state.SetIterationTime(at->timing.median * 1e-9);
    state.counters["median_ns"] = at->timing.median;
    state.counters["mean_ns"] = at->timing.mean;
    state.counters["p99_ns"] = at->timing.p99;
    state.counters["sweeps"] = static_cast<double>(at->timing.sweeps);
    state.counters["wrong"] = static_cast<double>(at->wrong);
    if (at->volume_tests) state.counters["volume_tests"] = *at->volume_tests;
    if (at->triangle_tests) state.counters["triangle_tests"] = *at->triangle_tests;
}

#ifdef PROLATE_BENCH_COAL
// Coal's wheel brings other versions of libraries that this program has, too (Assimp, OctoMap, Boost). Loaded like this
// each side finds its own.
template <class List> void add_from_module(List& libraries) {
    static void* const module = dlopen(PROLATE_BENCH_COAL_MODULE, RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    if (module == nullptr) {
        std::fprintf(stderr, "coal is skipped: %s\n", dlerror());
        return;
    }
    constexpr bool kOfPairs = std::is_same_v<List, PairLibraries>;
    if (void* const add = dlsym(module, kOfPairs ? "add_coal_pairs" : "add_coal_meshes"))
        reinterpret_cast<void (*)(List&)>(add)(libraries);
}
#endif

// Libraries or PairLibraries.
template <class List> List all_libraries() {
    List out;
    add_prolate(out);
#ifdef PROLATE_BENCH_FCL
    add_fcl(out);
#endif
#ifdef PROLATE_BENCH_BULLET
    add_bullet(out);
#endif
#ifdef PROLATE_BENCH_ODE
    if constexpr (std::is_same_v<List, Libraries>) add_ode(out);
#endif
#ifdef PROLATE_BENCH_CCD
    if constexpr (std::is_same_v<List, PairLibraries>) add_ccd(out);
#endif
#ifdef PROLATE_BENCH_COAL
    add_from_module(out);
#endif
    return out;
}

std::vector<Subject> subjects(const std::string& a, const std::string& b) {
    std::vector<std::string> kinds{"far", "near", "touching"};
    if (a == "cad" || b == "cad") kinds.insert(kinds.end(), {"near-aligned", "touching-aligned"});
    std::vector<Subject> out;
    for (const std::string& kind : kinds) out.push_back({Query::collide, a, b, kind});
    for (const std::string& kind : kinds) // where surfaces meet, there is no distance to find
        if (!kind.starts_with("touching")) out.push_back({Query::distance, a, b, kind});
    for (const char* kind : {"near", "touching"}) out.push_back({Query::again, a, b, kind});
    if (a == b)
        for (const uint32_t leaves : {8u, 64u, 512u}) out.push_back({Query::proxy, a, b, "near", leaves});
    return out;
}

// Google Benchmark's reports, without "/iterations:1/manual_time" at the end of each name.
template <class Reporter> class ShortNames final : public Reporter {
    void ReportRuns(const std::vector<benchmark::BenchmarkReporter::Run>& runs) override {
        auto renamed = runs;
        for (auto& run : renamed) run.run_name.iterations.clear(), run.run_name.time_type.clear();
        Reporter::ReportRuns(renamed);
    }
};

std::unique_ptr<benchmark::BenchmarkReporter> reporter(int argc, char** argv) {
    const bool json = std::any_of(argv, argv + argc,
                                  [](const char* word) { return std::string_view(word) == "--benchmark_format=json"; });
    if (json) return std::make_unique<ShortNames<benchmark::JSONReporter>>();
    return std::make_unique<ShortNames<benchmark::ConsoleReporter>>();
}

void announce(const std::string& name, const std::string& about) {
    std::fprintf(stderr, "%-18s %s\n", name.c_str(), about.c_str());
    benchmark::AddCustomContext(name, about);
}

int run(int argc, char** argv) {
    if (std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--help"; }))
        std::fputs(kHelp, stdout);             // Google Benchmark goes on with its own, and ends
    const auto display = reporter(argc, argv); // before Initialize(), which takes its options away
    benchmark::Initialize(&argc, argv);
    const auto arguments = parse(argc, argv);
    if (!arguments) return 2;
    const ComparisonOptions& options = arguments->options;
    Comparison comparison(options, all_libraries<Libraries>());
    const auto pair_libraries = all_libraries<PairLibraries>();
    std::fputs(PROLATE_BENCH_SKIPPED, stderr);
    for (const auto& library : comparison.libraries()) announce(library->name(), library->about());
    for (const auto& library : pair_libraries) announce("pairs: " + library->name(), library->about());
    benchmark::AddCustomContext("poses", std::to_string(options.poses));
    benchmark::AddCustomContext("seed", std::to_string(options.seed));

    std::vector<std::unique_ptr<Group>> groups;
    for (const auto& [a, b] : arguments->pairs)
        for (const Subject& subject : subjects(a, b)) {
            auto group = std::make_unique<Group>(
                subject.name(), comparison.able(subject),
                [&comparison, subject](const auto& names) { return comparison.run(subject, names); });
            if (!group->libraries().empty() && comparison.available(subject)) groups.push_back(std::move(group));
        }
    for (const Query query : {Query::collide, Query::distance})
        for (const bool near : {false, true}) {
            std::vector<std::string> able;
            for (const auto& library : pair_libraries)
                if (query == Query::collide || library->has_distance()) able.push_back(library->name());
            groups.push_back(
                std::make_unique<Group>(pairs_name(query, near), able, [&, query, near](const auto& names) {
                    return compare_pairs(pair_libraries, query, near, kEllipsoidPairs, options.seed, options.seconds,
                                         names);
                }));
        }
    for (const auto& group : groups)
        for (const std::string& library : group->libraries())
            benchmark::RegisterBenchmark((group->name() + "/" + library).c_str(),
                                         [&group, library](benchmark::State& state) { report(state, *group, library); })
                ->Iterations(1)
                ->UseManualTime()
                ->Unit(benchmark::kMicrosecond);
    benchmark::RunSpecifiedBenchmarks(display.get(), nullptr, "all"); // the filter has had its say
    Results results;
    for (const auto& group : groups)
        if (group->done()) results.emplace_back(group->name(), group->outcomes());
    if (!results.empty()) std::fputs((table(results) + table(comparison.memory())).c_str(), stderr);
    return 0;
}

} // namespace
} // namespace prolate::bench::peers

int main(int argc, char** argv) {
    return prolate::bench::peers::run(argc, argv);
}

// prolate and other libraries of collision queries in one process, on the same poses.
//
//   bench_peers [MESH | MESH,MESH]... [--poses=500] [--seed=1] [--seconds=0.5] [--data=FOLDER] [--benchmark_...]
//
// A MESH is a file, or one of the names horse, bunny, homer, knight (from FOLDER, else from Debian's glmark2-data) and
// cad (made here). Without any: the pairs of kPairs. Benchmarks are called
//   collide|distance/<meshA>-<meshB>/<far|near|touching>[-aligned]/<library>;
// their time is the median of a pose (sweep.hpp), and the counters are in nanoseconds and tests a query. All libraries
// of a group run when the first of them is due, in turns; --benchmark_filter leaves out those that do not match. The
// table at the end, with the ratios, goes to standard error.
#include "bench/peers/table.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <regex>

namespace prolate::bench::peers {
namespace {

const std::vector<std::pair<std::string, std::string>> kPairs = {
    {"horse", "horse"}, {"bunny", "horse"}, {"homer", "homer"}, {"knight", "knight"}, {"cad", "cad"}};

struct Arguments {
    ComparisonOptions options;
    std::vector<std::pair<std::string, std::string>> pairs;
};

// Reads what Google Benchmark left of the command line.
std::optional<Arguments> parse(int argc, char** argv) {
    Arguments out;
    out.options.data = PROLATE_BENCH_DATA;
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
    if (out.pairs.empty()) out.pairs = kPairs;
    return out;
}

bool wanted(const std::string& name) { // as Google Benchmark itself decides
    std::string filter = benchmark::GetBenchmarkFilter();
    if (filter.empty() || filter == "all") return true;
    const bool negative = filter[0] == '-';
    if (negative) filter.erase(0, 1);
    return std::regex_search(name, std::regex(filter, std::regex::extended)) != negative;
}

// A subject with the libraries that are wanted, measured when first asked for.
class Group {
public:
    Group(Comparison& comparison, Subject subject) : comparison_(comparison), subject_(std::move(subject)) {
        for (const auto& library : comparison.libraries()) {
            const bool able = subject_.query == Query::collide ? library->has_collide() : library->has_distance();
            if (able && wanted(subject_.name() + "/" + library->name())) names_.push_back(library->name());
        }
    }
    const Subject& subject() const { return subject_; }
    const std::vector<std::string>& names() const { return names_; }
    const std::vector<Outcome>& outcomes() {
        if (!done_) outcomes_ = comparison_.run(subject_, names_), done_ = true;
        return outcomes_;
    }
    bool done() const { return done_; }

private:
    Comparison& comparison_;
    Subject subject_;
    std::vector<std::string> names_;
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

Libraries libraries() {
    Libraries out;
    add_prolate(out);
#ifdef PROLATE_BENCH_FCL
    add_fcl(out);
#endif
#ifdef PROLATE_BENCH_BULLET
    add_bullet(out);
#endif
#ifdef PROLATE_BENCH_ODE
    add_ode(out);
#endif
#ifdef PROLATE_BENCH_COAL
    add_coal(out);
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
    return out;
}

int run(int argc, char** argv) {
    benchmark::Initialize(&argc, argv);
    const auto arguments = parse(argc, argv);
    if (!arguments) return 2;
    Comparison comparison(arguments->options, libraries());
    std::fputs(PROLATE_BENCH_SKIPPED, stderr);
    for (const auto& library : comparison.libraries()) {
        std::fprintf(stderr, "%-16s %s\n", library->name().c_str(), library->about().c_str());
        benchmark::AddCustomContext(library->name(), library->about());
    }
    benchmark::AddCustomContext("poses", std::to_string(arguments->options.poses));
    benchmark::AddCustomContext("seed", std::to_string(arguments->options.seed));

    std::vector<std::unique_ptr<Group>> groups;
    for (const auto& [a, b] : arguments->pairs)
        for (const Subject& subject : subjects(a, b)) {
            groups.push_back(std::make_unique<Group>(comparison, subject));
            Group* const group = groups.back().get();
            if (group->names().empty() || !comparison.available(subject)) continue;
            for (const std::string& name : group->names())
                benchmark::RegisterBenchmark((subject.name() + "/" + name).c_str(),
                                             [group, name](benchmark::State& state) { report(state, *group, name); })
                    ->Iterations(1)
                    ->UseManualTime()
                    ->Unit(benchmark::kMicrosecond);
        }
    benchmark::RunSpecifiedBenchmarks();
    Results results;
    for (const auto& group : groups)
        if (group->done()) results.emplace_back(group->subject().name(), group->outcomes());
    if (!results.empty()) std::fputs(table(results).c_str(), stderr);
    return 0;
}

} // namespace
} // namespace prolate::bench::peers

int main(int argc, char** argv) {
    return prolate::bench::peers::run(argc, argv);
}

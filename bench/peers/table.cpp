#include "bench/peers/table.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace prolate::bench::peers {
namespace {

constexpr const char* kOwn = "prolate";

const Outcome* find(const std::vector<Outcome>& outcomes, const std::string& library) {
    const auto at = std::ranges::find(outcomes, library, &Outcome::library);
    return at == outcomes.end() ? nullptr : &*at;
}

std::string number(double value) { // three digits that count
    return value >= 99.95     ? fmt::format("{:.0f}", value)
           : value >= 9.995   ? fmt::format("{:.1f}", value)
           : value >= 0.09995 ? fmt::format("{:.2f}", value)
                              : fmt::format("{:.4f}", value);
}

std::string cell(const Outcome* outcome, const Outcome* own) {
    if (outcome == nullptr) return "-";
    std::string out = number(outcome->timing.median / 1000);
    if (own != nullptr && own != outcome)
        out += fmt::format(" {:>6}", number(outcome->timing.median / own->timing.median) + "x");
    if (outcome->wrong > 0) out += fmt::format(" !{}", outcome->wrong);
    return out;
}

std::string work(const Outcome* outcome) {
    if (outcome == nullptr || (!outcome->volume_tests && !outcome->triangle_tests)) return "-";
    const auto told = [](const std::optional<double>& x) { return x ? fmt::format("{:.0f}", *x) : "?"; };
    return told(outcome->volume_tests) + " + " + told(outcome->triangle_tests);
}

template <class Cell>
std::string block(const Results& results, const std::vector<std::string>& libraries, const Cell& cell_of) {
    size_t first = 0;
    for (const auto& [name, outcomes] : results) first = std::max(first, name.size());
    std::vector<size_t> widths;
    for (const std::string& library : libraries) {
        widths.push_back(library.size());
        for (const auto& [name, outcomes] : results)
            widths.back() = std::max(widths.back(), cell_of(outcomes, library).size());
    }
    std::string out = fmt::format("{:<{}}", "", first);
    for (size_t k = 0; k < libraries.size(); ++k) out += fmt::format("  {:>{}}", libraries[k], widths[k]);
    for (const auto& [name, outcomes] : results) {
        out += fmt::format("\n{:<{}}", name, first);
        for (size_t k = 0; k < libraries.size(); ++k)
            out += fmt::format("  {:>{}}", cell_of(outcomes, libraries[k]), widths[k]);
    }
    return out + "\n";
}

// Results of one kind of query, which the same libraries answer.
std::string table_of_kind(const Results& results) {
    std::vector<std::string> libraries{kOwn}, telling;
    const auto note = [](std::vector<std::string>& names, const std::string& name) {
        if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    };
    for (const auto& [name, outcomes] : results)
        for (const Outcome& o : outcomes) {
            note(libraries, o.library);
            if (o.volume_tests || o.triangle_tests) note(telling, o.library);
        }
    std::string out =
        "\nMedian of a query, us, and how many times that of prolate it is (!n: n answers are wrong)\n\n" +
        block(results, libraries, [](const auto& outcomes, const std::string& library) {
            return cell(find(outcomes, library), find(outcomes, kOwn));
        });
    if (telling.empty()) return out;
    return out + "\nBounding volumes + triangles tested in a query, on average\n\n" +
           block(results, telling,
                 [](const auto& outcomes, const std::string& library) { return work(find(outcomes, library)); });
}

} // namespace

std::string table(const Results& results) {
    std::vector<std::pair<std::string, Results>> kinds; // in the order of their first results
    for (const auto& result : results) {
        const std::string kind = result.first.substr(0, result.first.find('/'));
        auto at = std::ranges::find(kinds, kind, &std::pair<std::string, Results>::first);
        if (at == kinds.end()) at = kinds.insert(at, {kind, {}});
        at->second.push_back(result);
    }
    std::string out;
    for (const auto& [kind, of_kind] : kinds) out += table_of_kind(of_kind);
    return out;
}

std::string table(const std::vector<Memory>& memory) {
    std::string out = "\nMegabytes of a model\n\n", model;
    for (const Memory& m : memory) {
        if (m.model != model)
            out += fmt::format("{}{} ({} triangles):", model.empty() ? "" : "\n", m.model, m.triangles);
        model = m.model;
        out += fmt::format("  {} {}", m.library, number(static_cast<double>(m.bytes) * 1e-6));
    }
    return memory.empty() ? "" : out + "\n";
}

} // namespace prolate::bench::peers

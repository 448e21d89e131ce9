#include "cli/bake/manifest.hpp"

#include "cli/bake/asset.hpp"
#include "cli/common.hpp"
#include "cli/levels.hpp"
#include "cli/signals.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <vector>

namespace prolate::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kAdvice = "see 'prolate bake --help'";

// One entry of the manifest and what became of it.
struct Entry {
    Asset asset;
    std::string name = "?"; // the mesh as the manifest has it
    std::optional<Json> report;
    std::string error; // empty: none so far
};

// Reads and parses the file; complains and sets `code` if it cannot.
Json read_json(const std::string& path, int& code) {
    const auto text = read_file(path);
    if (!text) {
        code = complain(path, text.error());
        return {};
    }
    try {
        return Json::parse(*text);
    } catch (const Json::exception& e) {
        std::string what = e.what(); // "[json.exception...] parse error at line 3, column 1: ..."
        if (const size_t at = what.find("] "); at != what.npos) what.erase(0, at + 2);
        code = complain(kBadInput, path, "is no JSON: " + what, kAdvice);
        return {};
    }
}

std::string unknown_key(const std::string& key, const std::vector<std::string>& known) {
    const std::string near = nearest_word(key, known);
    return fmt::format("unknown key \"{}\"", key) + (near.empty() ? "" : fmt::format(" (did you mean \"{}\"?)", near));
}

// The type that `option` wants of a JSON value; "" if `value` has it.
std::string wrong_type(const CLI::Option& option, const Json& value) {
    if (option.get_items_expected_max() == 0) return value.is_boolean() ? "" : "true or false";
    const std::string type = option.get_type_name();
    if (type == "UINT") return value.is_number_unsigned() ? "" : "a whole number, 0 or above";
    if (option.get_items_expected_max() > 1) {
        const auto is_number = [](const Json& one) { return one.is_number(); };
        const bool sound = value.is_array() && std::all_of(value.begin(), value.end(), is_number);
        return sound || value.is_number() ? "" : "a number or an array of numbers";
    }
    if (type == "FLOAT") return value.is_number() ? "" : "a number";
    return value.is_string() ? "" : "a text";
}

// Sets the asset's options from `values` by the names of the command line; returns what is wrong, or "".
std::string set_options(const Json& values, Asset& asset) {
    CLI::App app;
    declare_asset_options(app, asset);
    std::vector<std::string> known, words;
    for (const CLI::Option* option : app.get_options())
        if (option->get_name() != "--help") known.push_back(option->get_single_name());
    for (const auto& [key, value] : values.items()) {
        if (std::find(known.begin(), known.end(), key) == known.end()) return unknown_key(key, known);
        const bool positional = key == "mesh";
        CLI::Option* option = app.get_option(positional ? key : "--" + key);
        if (const std::string wanted = wrong_type(*option, value); !wanted.empty())
            return fmt::format("\"{}\" must be {}", key, wanted);
        if (value.is_boolean()) {
            if (value.get<bool>()) words.push_back("--" + key);
        } else {
            std::string text = value.is_string() ? value.get<std::string>() : value.dump();
            if (value.is_array()) text = text.substr(1, text.size() - 2); // [1,2,3]
            if (text.empty()) return fmt::format("\"{}\" must not be empty", key);
            if (positional)
                asset.mesh = text;
            else
                words.push_back(fmt::format("--{}={}", key, text));
        }
    }
    try {
        std::reverse(words.begin(), words.end()); // as CLI11 wants it
        app.parse(words);
    } catch (const CLI::ParseError& e) {
        return e.what();
    }
    return "";
}

// The keys that exclude each other: how far the tree goes.
constexpr const char* kGoals[] = {"levels", "ellipsoids", "tolerance", "distance", "exact"};

// The defaults, overridden by the entry.
Json merged(Json defaults, const Json& entry) {
    const auto is_in_entry = [&entry](const char* goal) { return entry.contains(goal); };
    if (std::any_of(std::begin(kGoals), std::end(kGoals), is_in_entry))
        for (const char* goal : kGoals) defaults.erase(goal);
    defaults.update(entry);
    return defaults;
}

// All entries, badly written ones with their error; or complains and sets `code`.
std::vector<Entry> read_manifest(const std::string& path, const ManifestOptions& options, int& code) {
    const Json root = read_json(path, code);
    if (code != kDone) return {};
    const auto refuse = [&](const std::string& what) {
        code = complain(kBadInput, path, what, kAdvice);
        return std::vector<Entry>();
    };
    if (!root.is_object() || !root.contains("assets") || !root["assets"].is_array())
        return refuse("must be an object with an array \"assets\"");
    for (const auto& item : root.items())
        if (item.key() != "assets" && item.key() != "defaults")
            return refuse(unknown_key(item.key(), {"assets", "defaults"}));
    const Json defaults = root.value("defaults", Json::object());
    if (!defaults.is_object()) return refuse("\"defaults\" must be an object");
    for (const char* own : {"mesh", "output", "report"})
        if (defaults.contains(own))
            return refuse(fmt::format("\"{}\" belongs to each asset, not to the defaults", own));
    Asset unused;
    if (const std::string error = set_options(defaults, unused); !error.empty()) return refuse("defaults: " + error);

    const fs::path folder = fs::path(path).parent_path();
    std::vector<Entry> entries;
    for (const Json& from : root["assets"]) {
        Entry& entry = entries.emplace_back();
        Asset& asset = entry.asset;
        asset.options.threads = options.threads;
        if (!from.is_object()) {
            entry.error = "must be an object";
            continue;
        }
        if (from.contains("mesh") && from["mesh"].is_string()) entry.name = from["mesh"];
        entry.error = set_options(merged(defaults, from), asset);
        for (const char* needed : {"mesh", "output"})
            if (entry.error.empty() && !from.contains(needed)) entry.error = fmt::format("\"{}\" is missing", needed);
        for (std::string* file : {&asset.mesh, &asset.output, &asset.report}) {
            if (file->empty()) continue;
            if (file != &asset.mesh && is_standard_output(*file)) entry.error = "cannot go to standard output";
            if (file == &asset.mesh && is_standard_input(*file)) entry.error = "cannot come from standard input";
            *file = (folder / *file).string();
        }
    }
    return entries;
}

std::string title(size_t index, const Entry& entry) {
    return fmt::format("asset {} ({})", index + 1, entry.name);
}

// Complains of all that can be told without baking, and keeps it as the entry's error.
void check(Entry& entry, size_t index, Outputs& outputs) {
    if (!entry.error.empty()) {
        complain(kBadInput, title(index, entry), entry.error, "correct the manifest");
        return;
    }
    const PartOfWork part(title(index, entry));
    int code = kDone;
    std::error_code none;
    if (!options_of(entry.asset, code)) {
        // complained
    } else if (!fs::exists(entry.asset.mesh, none)) {
        complain(entry.asset.mesh, Error{ErrorCode::io, "cannot open the file", ENOENT});
    } else {
        claim_outputs(entry.asset, outputs, fmt::format(" of asset {}", index + 1));
    }
    entry.error = part.complaint();
}

Json summary_json(const std::string& path, const std::vector<Entry>& entries) {
    Json out{{"manifest", path}};
    for (const char* count : {"baked", "unchanged", "cached", "failed", "not_done"}) out[count] = 0;
    const auto increment = [&out](const std::string& name) { out[name] = out[name].get<int>() + 1; };
    out["assets"] = Json::array();
    for (size_t i = 0; i < entries.size(); ++i) {
        const Entry& entry = entries[i];
        Json one{{"asset", i + 1}};
        if (entry.report) {
            one.update(*entry.report);
            increment((*entry.report)["source"]);
        } else {
            one["mesh"] = entry.asset.mesh;
            one["tree"] = entry.asset.output;
            one["error"] = entry.error.empty() ? "not done: interrupted" : entry.error;
            increment(entry.error.empty() ? "not_done" : "failed");
        }
        out["assets"].push_back(std::move(one));
    }
    return out;
}

std::string summary_table(const std::vector<Entry>& entries) {
    size_t width = 4;
    for (const Entry& entry : entries) width = std::max(width, visible(entry.name).size());
    std::string out = fmt::format("asset {:<{}} {:>8} {:>14} {:>12} {:>10}\n", "mesh", width, "nodes", "outside ratio",
                                  "bytes", "seconds");
    for (size_t i = 0; i < entries.size(); ++i) {
        const Entry& entry = entries[i];
        out += fmt::format("{:>5} {:<{}} ", i + 1, visible(entry.name), width);
        if (!entry.report) {
            out += entry.error.empty() ? "not done\n" : fmt::format("failed: {}\n", visible(entry.error));
            continue;
        }
        const Json& report = *entry.report;
        const Json& ratio = report["levels"].back()["outside_ratio"];
        out += fmt::format(
            "{:>8} {:>14} {:>12} {:>10}\n", grouped(report["nodes"]),
            ratio.is_number() && std::isfinite(ratio.get<double>()) ? fmt::format("{:.4f}", ratio.get<double>()) : "-",
            grouped(report["bytes"]),
            report["source"] == "baked" ? fmt::format("{:.2f}", report["seconds"].get<double>())
                                        : report["source"].get<std::string>());
    }
    return out;
}

} // namespace

int bake_manifest(const std::string& path, Outputs& outputs, BakeCache& cache, const ManifestOptions& options) {
    int code = kDone;
    std::vector<Entry> entries = read_manifest(path, options, code);
    if (code != kDone) return code;
    const GracefulStop keeps_what_is_done;
    // What can be known at once is said at once, before hours of work.
    outputs.reads(path, "the manifest");
    for (size_t i = 0; i < entries.size(); ++i)
        name_inputs(entries[i].asset, outputs, fmt::format(" of asset {}", i + 1));
    if (code = outputs.claim(options.report, "the summary", "json"); code != kDone) return code;
    for (size_t i = 0; i < entries.size(); ++i) check(entries[i], i, outputs);

    for (size_t i = 0; i < entries.size() && !interrupted(); ++i) {
        Entry& entry = entries[i];
        if (!entry.error.empty()) continue;
        const PartOfWork part(title(i, entry));
        const std::string label = fmt::format("[{}/{}] {}  ", i + 1, entries.size(), entry.name);
        std::optional<Baked> baked;
        const int failure = guarded([&] {
            int failed = kDone;
            baked = bake_asset(entry.asset, outputs, cache, options.rebake, label, failed);
            return failed;
        });
        if (baked) {
            entry.report = report_of(entry.asset, *baked);
            note(entry.asset.output, fmt::format("{}, {} nodes, {} bytes, {:.2f} s", name_of(baked->source),
                                                 grouped(baked->tree.view().node_count()),
                                                 grouped(baked->tree.bytes().size()), baked->seconds));
        } else if (failure != kInterrupted) {
            entry.error = part.complaint();
        }
    }
    const Json summary = summary_json(path, entries);
    const std::string text = text_of(summary);
    if (options.json)
        print(text);
    else if (!is_quiet())
        print(summary_table(entries));
    if (code = outputs.write(options.report, text, Outputs::Effort::account); code != kDone) return code;
    if (const int not_done = summary["not_done"]; not_done > 0)
        return complain(kInterrupted, path,
                        fmt::format("interrupted with {} of {} assets not done", not_done, entries.size()),
                        "run it again to go on");
    if (const int failed = summary["failed"]; failed > 0)
        return complain(kNo, path, fmt::format("{} of {} assets failed", failed, entries.size()), "see above");
    return kDone;
}

} // namespace prolate::cli

#include "cli/bake/manifest.hpp"

#include "cli/bake/asset.hpp"
#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/levels.hpp"
#include "cli/signals.hpp"
#include "cli/words.hpp"

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

constexpr const char* kManifestAdvice = "see 'prolate bake --help'";

// One entry of the manifest and what became of it.
struct Entry {
    Asset asset;
    std::string name = "?"; // the mesh as the manifest has it
    std::optional<Json> report;
    std::string error; // empty: none so far
};

Outcome<Json> read_json(const std::string& path) {
    const auto text = read_file(path);
    if (!text) return failure_of(path, text.error());
    try {
        return Json::parse(*text);
    } catch (const Json::exception& e) {
        std::string what = e.what(); // "[json.exception...] parse error at line 3, column 1: ..."
        if (const size_t at = what.find("] "); at != what.npos) what.erase(0, at + 2);
        return Failure{kBadInput, path, "is not JSON: " + what, kManifestAdvice};
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
constexpr const char* kGoals[] = {"levels", "ellipsoids", "tolerance", "distance", "clearance", "keep-holes", "exact"};

// The defaults, overridden by the entry.
Json merged(Json defaults, const Json& entry) {
    const auto is_in_entry = [&entry](const char* goal) { return entry.contains(goal); };
    if (std::any_of(std::begin(kGoals), std::end(kGoals), is_in_entry))
        for (const char* goal : kGoals) defaults.erase(goal);
    defaults.update(entry);
    return defaults;
}

// All entries, badly written ones with their error.
Outcome<std::vector<Entry>> read_manifest(const std::string& path, const ManifestOptions& options) {
    const auto json = read_json(path);
    if (!json) return json.error();
    const Json& root = *json;
    const auto refuse = [&path](const std::string& what) { return Failure{kBadInput, path, what, kManifestAdvice}; };
    if (!root.is_object() || !root.contains("assets") || !root["assets"].is_array())
        return refuse("must be an object with an array \"assets\"");
    for (const auto& item : root.items())
        if (item.key() != "assets" && item.key() != "defaults")
            return refuse(unknown_key(item.key(), {"assets", "defaults"}));
    const Json defaults = root.value("defaults", Json::object());
    if (!defaults.is_object()) return refuse("\"defaults\" must be an object");
    for (const char* own : {"mesh", "output", "report", "modes"})
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
        for (std::string* file : {&asset.mesh, &asset.output, &asset.report, &asset.modes}) {
            if (file->empty()) continue;
            if (file != &asset.mesh && file != &asset.modes && is_standard_output(*file))
                entry.error = "cannot go to standard output";
            if (file == &asset.mesh && is_standard_input(*file)) entry.error = "cannot come from standard input";
            *file = (folder / *file).string();
        }
    }
    return entries;
}

std::string title(size_t index, const Entry& entry) {
    return fmt::format("asset {} ({})", index + 1, entry.name);
}

// Tells a failure of the asset, and keeps it as the entry's error.
void fail(Entry& entry, const Failure& failure) {
    tell(failure);
    entry.error = failure.subject + ": " + failure.what;
}

// What can be told of an entry without baking.
Outcome<> check(const Entry& entry, size_t index, Outputs& outputs) {
    if (const auto options = options_of(entry.asset); !options) return options.error();
    std::error_code none;
    if (!fs::exists(entry.asset.mesh, none))
        return failure_of(entry.asset.mesh, Error{ErrorCode::io, "cannot open the file", ENOENT});
    return claim_outputs(entry.asset, outputs, fmt::format(" of asset {}", index + 1));
}

// What can be known at once is said at once, before hours of work.
void check_all(std::vector<Entry>& entries, Outputs& outputs) {
    for (size_t i = 0; i < entries.size(); ++i) {
        Entry& entry = entries[i];
        if (!entry.error.empty()) {
            tell({kBadInput, title(i, entry), entry.error, "correct the manifest"});
            continue;
        }
        const PartOfWork part(title(i, entry));
        if (const auto sound = check(entry, i, outputs); !sound) fail(entry, sound.error());
    }
}

// Bakes one asset, whatever becomes of it.
void bake(Entry& entry, size_t index, size_t count, const Outputs& outputs, BakeCache& cache, bool rebake) {
    const PartOfWork part(title(index, entry));
    const std::string label = fmt::format("[{}/{}] {}  ", index + 1, count, entry.name);
    const auto baked = guarded([&] { return bake_asset(entry.asset, outputs, cache, rebake, label); });
    if (!baked && baked.error().code == kInterrupted) return tell(baked.error());
    if (!baked) return fail(entry, baked.error());
    entry.report = report_of(entry.asset, *baked);
    note(entry.asset.output,
         fmt::format("{}, {} nodes, {} bytes, {:.2f} s", name_of(baked->source),
                     grouped(baked->tree.view().node_count()), grouped(baked->tree.bytes().size()), baked->seconds));
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

Outcome<ExitCode> bake_manifest(const std::string& path, Outputs& outputs, BakeCache& cache,
                                const ManifestOptions& options) {
    auto read = read_manifest(path, options);
    if (!read) return read.error();
    std::vector<Entry>& entries = *read;
    const GracefulStop keeps_what_is_done;
    outputs.reads(path, "the manifest");
    for (size_t i = 0; i < entries.size(); ++i)
        name_inputs(entries[i].asset, outputs, fmt::format(" of asset {}", i + 1));
    if (const auto claimed = outputs.claim(options.report, "the summary", "json"); !claimed) return claimed.error();
    check_all(entries, outputs);
    for (size_t i = 0; i < entries.size() && !interrupted(); ++i)
        if (entries[i].error.empty()) bake(entries[i], i, entries.size(), outputs, cache, options.rebake);

    const Json summary = summary_json(path, entries);
    const std::string text = text_of(summary);
    if (options.json)
        print(text);
    else if (!is_quiet())
        print(summary_table(entries));
    if (const auto written = outputs.write(options.report, text, Outputs::Effort::account); !written)
        return written.error();
    if (const int not_done = summary["not_done"]; not_done > 0)
        return Failure{kInterrupted, path,
                       fmt::format("interrupted with {} of {} assets not done", not_done, entries.size()),
                       "run it again to go on"};
    if (const int failed = summary["failed"]; failed > 0)
        return Failure{kNo, path, fmt::format("{} of {} assets failed", failed, entries.size()), "see above"};
    return kDone;
}

} // namespace prolate::cli

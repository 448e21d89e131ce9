// prolate: the command line. Parses, then runs one command; exit codes are in failure.hpp.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/generator.hpp"
#include "cli/signals.hpp"
#include "cli/words.hpp"

#include <prolate/version.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace prolate::cli {
namespace {

constexpr const char* kMainFooter = R"(
Examples:
  prolate bake horse.obj -o horse.etree --levels 3
  prolate verify horse.etree horse.obj
  prolate export horse.etree -o cover.csv --level 2
  prolate view horse.etree horse.obj -o horse.html
  prolate collide horse.etree horse.etree --pose 0.5,0,0

A file may be -: standard input or output.

Exit codes: 0 done, 1 the answer is "no" (verify, collide --exit-code) or some assets failed (bake --manifest), 2
wrong usage, 3 bad input, 4 reading or writing failed, or memory or threads ran out, 5 an error in prolate itself, 6
undecided (collide --exit-code), 128 + the number of a signal that interrupted it (130 for Ctrl-C). With --json, an
error is printed as JSON as well: {"error": {"code", "subject", "what", "advice"}}.

'prolate COMMAND --help' or 'prolate help COMMAND' describes a command; 'prolate man' is all of it on one page.)";

// "did you mean 'bake'?", or where to look.
std::string hint(std::string_view word, const std::vector<std::string>& known, const std::string& otherwise) {
    const std::string near = nearest_word(word, known);
    return near.empty() ? otherwise : fmt::format("did you mean '{}'?", near);
}

// Looks for unknown words first: the parser would rather complain of something that is missing because of them.
Outcome<> check_words(const CLI::App& app, const std::vector<std::string>& words) {
    if (words.empty()) return Failure{kUsage, "usage", "no command given", "see 'prolate --help'"};
    if (words[0].starts_with('-')) return kSuccess;
    std::vector<std::string> known;
    const CLI::App* command = nullptr;
    for (const CLI::App* one : app.get_subcommands([](const CLI::App*) { return true; })) {
        known.push_back(one->get_name());
        if (one->get_name() == words[0]) command = one;
    }
    if (!command) return Failure{kUsage, words[0], "no such command", hint(words[0], known, "see 'prolate --help'")};
    known.clear();
    for (const CLI::Option* option : command->get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (size_t i = 1; i < words.size() && words[i] != "--"; ++i) {
        const std::string word = words[i].substr(0, words[i].find('='));
        if (word.starts_with("--") && std::find(known.begin(), known.end(), word) == known.end())
            return Failure{kUsage, word, "no such option",
                           hint(word, known, fmt::format("see 'prolate {} --help'", words[0]))};
    }
    return kSuccess;
}

// A whole number, of digits only: the parser would take "" for 0 and -1 for 2^64 - 1.
std::string check_number(const std::string& word) {
    const bool digits = std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; });
    return digits && !word.empty() ? "" : fmt::format("\"{}\" is not a whole number of 0 or more", word);
}
std::string check_not_empty(const std::string& word) {
    return word.empty() ? "its value is empty" : "";
}

// What all commands have in common.
void complete(CLI::App& app) {
    for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
        command->add_flag_callback("-q,--quiet", be_quiet,
                                   "print errors only: no notes, no progress, no table beside a file");
        for (CLI::Option* option : command->get_options()) {
            if (option->get_items_expected_max() == 0) continue;
            const bool number = option->get_type_name() == "UINT";
            option->check(CLI::Validator(number ? check_number : check_not_empty, ""));
        }
    }
}

Outcome<ExitCode> run(std::vector<std::string> words) {
    CLI::App app("prolate: collision detection on ellipsoid trees", "prolate");
    app.set_version_flag("--version", fmt::format("{} (.etree format {})", generator(), kFormatVersion));
    app.footer(kMainFooter);
    app.require_subcommand(1);
    Work chosen;
    add_bake(app, chosen);
    add_info(app, chosen);
    add_verify(app, chosen);
    add_export(app, chosen);
    add_collide(app, chosen);
    add_compare(app, chosen);
    add_render(app, chosen);
    add_view(app, chosen);
    add_completion(app, chosen);
    add_man(app, chosen);
    complete(app);
    if (!words.empty() && words[0] == "help") { // help COMMAND is COMMAND --help
        words.erase(words.begin());
        words.resize(std::min<size_t>(words.size(), 1));
        words.push_back("--help");
    }
    if (const auto known = check_words(app, words); !known) return known.error();
    const std::string name = words[0];
    try {
        std::reverse(words.begin(), words.end()); // as CLI11 wants it
        app.parse(words);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) { // --help, --version
            app.exit(e);
            return kDone;
        }
        const auto used = app.get_subcommands();
        const std::string command = used.empty() ? "" : used[0]->get_name() + " ";
        return Failure{kUsage, used.empty() ? "usage" : used[0]->get_name(), e.what(),
                       fmt::format("see 'prolate {}--help'", command)};
    }
    catch_signals(name.c_str());
    return chosen();
}

} // namespace
} // namespace prolate::cli

// NOLINTNEXTLINE(bugprone-exception-escape): what lacks the memory to tell that memory lacks may end as it does
int main(int argc, char** argv) {
    using namespace prolate::cli;
    const std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
    if (std::find(words.begin(), std::find(words.begin(), words.end(), "--"), "--json") != words.end())
        errors_as_json();
    return finish(guarded([&words] { return run(words); }));
}

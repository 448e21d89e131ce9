// prolate: the command line. Parses, then runs one command; exit codes are in common.hpp.
#include "cli/common.hpp"

#include <prolate/version.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <new>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
Examples:
  prolate bake horse.obj -o horse.etree --levels 3
  prolate verify horse.etree horse.obj
  prolate export horse.etree -o horse.csv --level 2
  prolate view horse.etree horse.obj -o horse.html
  prolate collide horse.etree horse.etree --pose 0.5,0,0

Exit codes: 0 done, 1 the answer is "no" (verify) or some assets failed (bake --manifest), 2 usage, 3 bad input,
4 reading or writing failed, 5 an error in prolate itself, 130 interrupted.

'prolate COMMAND --help' tells more.)";

// "did you mean 'bake'?", or where to look.
std::string hint(std::string_view word, const std::vector<std::string>& known, const std::string& otherwise) {
    const std::string near = nearest_word(word, known);
    return near.empty() ? otherwise : fmt::format("did you mean '{}'?", near);
}

// Looks for unknown words first: the parser would rather complain of something that is missing because of them.
int check_words(const CLI::App& app, const std::vector<std::string>& words) {
    if (words.empty()) return complain(kUsage, "usage", "no command given", "see 'prolate --help'");
    if (words[0].starts_with('-')) return kDone;
    std::vector<std::string> known;
    const CLI::App* command = nullptr;
    for (const CLI::App* one : app.get_subcommands([](const CLI::App*) { return true; })) {
        known.push_back(one->get_name());
        if (one->get_name() == words[0]) command = one;
    }
    if (!command) return complain(kUsage, words[0], "no such command", hint(words[0], known, "see 'prolate --help'"));
    known.clear();
    for (const CLI::Option* option : command->get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (size_t i = 1; i < words.size() && words[i] != "--"; ++i) {
        const std::string word = words[i].substr(0, words[i].find('='));
        if (word.starts_with("--") && std::find(known.begin(), known.end(), word) == known.end())
            return complain(kUsage, word, "no such option",
                            hint(word, known, fmt::format("see 'prolate {} --help'", words[0])));
    }
    return kDone;
}

int run(int argc, char** argv) {
    CLI::App app("prolate: collision detection on ellipsoid trees", "prolate");
    app.set_version_flag("--version", fmt::format("prolate {}.{}.{} (.etree format {})", PROLATE_VERSION_MAJOR,
                                                  PROLATE_VERSION_MINOR, PROLATE_VERSION_PATCH, kFormatVersion));
    app.footer(kFooter);
    app.require_subcommand(1);
    Work chosen;
    add_bake(app, chosen);
    add_info(app, chosen);
    add_verify(app, chosen);
    add_export(app, chosen);
    add_collide(app, chosen);
    add_render(app, chosen);
    add_view(app, chosen);
    if (const int code = check_words(app, {argv + 1, argv + argc}); code != kDone) return code;
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) return finish_output(app.exit(e)); // --help, --version
        const auto used = app.get_subcommands();
        const std::string command = used.empty() ? "" : used[0]->get_name() + " ";
        return complain(kUsage, used.empty() ? "usage" : used[0]->get_name(), e.what(),
                        fmt::format("see 'prolate {}--help'", command));
    }
    catch_signals();
    return finish_output(chosen());
}

} // namespace
} // namespace prolate::cli

int main(int argc, char** argv) {
    using namespace prolate::cli;
    try {
        return run(argc, argv);
    } catch (const std::bad_alloc&) {
        return complain(kIo, "memory", "there is not enough of it", "try a smaller mesh or fewer levels");
    } catch (const std::exception& e) {
        return complain(kInternal, "internal error", e.what(), "please report this");
    }
}

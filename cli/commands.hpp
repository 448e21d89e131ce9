// The commands. Each is one file with one function add_<name>(app, chosen): it declares its options on a subcommand of
// `app` and, when the subcommand is on the command line, sets `chosen` to the work. main() parses first and works
// second, so no command runs inside the parser.
#pragma once

#include "cli/failure.hpp"

#include <functional>

namespace CLI {
class App;
}

namespace prolate::cli {

/// The work of the chosen command; returns what to exit with if it does not fail.
using Work = std::function<Outcome<ExitCode>()>;

void add_bake(CLI::App& app, Work& chosen);
void add_info(CLI::App& app, Work& chosen);
void add_verify(CLI::App& app, Work& chosen);
void add_export(CLI::App& app, Work& chosen);
void add_collide(CLI::App& app, Work& chosen);
void add_compare(CLI::App& app, Work& chosen);
void add_render(CLI::App& app, Work& chosen);
void add_view(CLI::App& app, Work& chosen);
void add_completion(CLI::App& app, Work& chosen);
void add_man(CLI::App& app, Work& chosen);

} // namespace prolate::cli

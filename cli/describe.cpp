// prolate completion, prolate man: what the command line is, told to shells and to man(1), from the parser's own
// description of itself.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/generator.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <sstream>

namespace prolate::cli {
namespace {

constexpr const char* kShells[] = {"bash", "zsh", "fish"};

constexpr const char* kDescribeFooter = R"(
Examples:
  prolate completion bash >~/.local/share/bash-completion/completions/prolate
  prolate completion zsh >~/.zfunc/_prolate            # a folder of your $fpath
  prolate completion fish >~/.config/fish/completions/prolate.fish)";

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
    return command.get_options([](const CLI::Option* option) { return !option->get_positional(); });
}

bool takes_value(const CLI::Option& option) {
    return option.get_items_expected_max() > 0;
}

// The words that an option takes, if it says so: "TEXT:{x,y,z}".
std::vector<std::string> choices_of(const CLI::Option& option) {
    std::string type = option.get_type_name();
    const size_t begin = type.find('{'), end = type.find('}');
    if (begin == type.npos || end == type.npos) return {};
    return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

// In single quotes, for a shell.
std::string shell_quoted(std::string_view text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

std::vector<std::string> names_of(const CLI::Option& option) {
    std::vector<std::string> names;
    for (const std::string& name : option.get_snames()) names.push_back(fmt::format("-{}", name));
    for (const std::string& name : option.get_lnames()) names.push_back(fmt::format("--{}", name));
    return names;
}

std::string joined(const std::vector<std::string>& words, const char* with) {
    return fmt::format("{}", fmt::join(words, with));
}

std::string bash(const CLI::App& app) {
    std::vector<std::string> commands{"help"};
    std::string options, values;
    for (const CLI::App* command : commands_of(app)) {
        const std::string& name = command->get_name();
        commands.push_back(name);
        std::vector<std::string> all;
        for (const CLI::Option* option : options_of(*command)) {
            for (const std::string& one : names_of(*option)) all.push_back(one);
            if (const auto choices = choices_of(*option); !choices.empty())
                values += fmt::format("        {}) COMPREPLY=($(compgen -W '{}' -- \"$word\")); return ;;\n",
                                      name + "/" + names_of(*option).back(), joined(choices, " "));
        }
        options += fmt::format("        {}) words='{}' ;;\n", name, joined(all, " "));
    }
    return fmt::format(R"(# bash completion for prolate
_prolate() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} command=${{COMP_WORDS[1]}} words=
    COMPREPLY=()
    if ((COMP_CWORD == 1)) || [[ $command == help ]]; then
        COMPREPLY=($(compgen -W '{} --help --version' -- "$word"))
        return
    fi
    case $command/${{COMP_WORDS[COMP_CWORD - 1]}} in
{}    esac
    [[ $word == -* ]] || return # files
    case $command in
{}    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _prolate prolate
)",
                       joined(commands, " "), values, options);
}

std::string zsh(const CLI::App& app) {
    const auto described = [](std::string text) {
        for (size_t at = 0; (at = text.find_first_of("[]:\\", at)) != text.npos; at += 2) text.insert(at, 1, '\\');
        return text;
    };
    std::string commands, cases;
    for (const CLI::App* command : commands_of(app)) {
        commands += fmt::format("        {}\n",
                                shell_quoted(command->get_name() + ":" + described(command->get_description())));
        cases += fmt::format("        {}) _arguments -s", command->get_name());
        for (const CLI::Option* option : options_of(*command))
            for (const std::string& name : names_of(*option)) {
                std::string spec = name + "[" + described(option->get_description()) + "]";
                if (takes_value(*option)) {
                    const auto choices = choices_of(*option);
                    spec += choices.empty() ? ":value:_files" : fmt::format(":value:({})", joined(choices, " "));
                }
                cases += fmt::format(" \\\n            {}", shell_quoted(spec));
            }
        cases += " \\\n            '*:file:_files' ;;\n";
    }
    return fmt::format(R"(#compdef prolate
_prolate() {{
    local -a commands=(
{}        'help:show what a command does'
    )
    if ((CURRENT == 2)) || [[ $words[2] == help ]]; then
        _describe command commands
        return
    fi
    local command=$words[2]
    shift words
    ((CURRENT--))
    case $command in
{}    esac
}}
_prolate "$@"
)",
                       commands, cases);
}

std::string fish(const CLI::App& app) {
    const auto described = [](std::string text) { // in fish, a backslash escapes within single quotes
        for (size_t at = 0; (at = text.find_first_of("\\'", at)) != text.npos; at += 2) text.insert(at, 1, '\\');
        return fmt::format("'{}'", text);
    };
    std::string out = "# fish completion for prolate\n";
    std::vector<std::string> commands;
    for (const CLI::App* command : commands_of(app)) {
        commands.push_back(command->get_name());
        out += fmt::format("complete -c prolate -n __fish_use_subcommand -x -a {} -d {}\n", command->get_name(),
                           described(command->get_description()));
    }
    out += "complete -c prolate -n __fish_use_subcommand -x -a help -d 'show what a command does'\n";
    out += fmt::format("complete -c prolate -n '__fish_seen_subcommand_from help' -x -a '{}'\n", joined(commands, " "));
    for (const CLI::App* command : commands_of(app))
        for (const CLI::Option* option : options_of(*command)) {
            out += fmt::format("complete -c prolate -n '__fish_seen_subcommand_from {}'", command->get_name());
            for (const std::string& name : option->get_snames()) out += fmt::format(" -s {}", name);
            for (const std::string& name : option->get_lnames()) out += fmt::format(" -l {}", name);
            if (takes_value(*option)) {
                const auto choices = choices_of(*option);
                out += choices.empty() ? " -r" : fmt::format(" -x -a '{}'", joined(choices, " "));
            }
            out += fmt::format(" -d {}\n", described(option->get_description()));
        }
    return out;
}

// ---- man ----

// Text that roff leaves as it is.
std::string plain(std::string_view text) {
    std::string out;
    bool begins = true;
    for (const char c : text) {
        if (begins && (c == '.' || c == '\'')) out += "\\&"; // would be a request
        out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
        begins = c == '\n';
    }
    return out;
}

// A footer is set already: its lines stay as they are.
std::string as_is(const std::string& footer) {
    const size_t begin = footer.find_first_not_of('\n');
    return begin == footer.npos ? "" : fmt::format(".PP\n.nf\n{}\n.fi\n", plain(footer.substr(begin)));
}

std::string options_man(const CLI::App& command) {
    std::string out;
    for (const CLI::Option* option : command.get_options()) {
        std::string head = option->get_positional() ? fmt::format("\\fI{}\\fR", plain(option->get_name()))
                                                    : fmt::format("\\fB{}\\fR", plain(joined(names_of(*option), ", ")));
        if (!option->get_positional() && takes_value(*option))
            head += fmt::format(" {}", plain(option->get_type_name()));
        out += fmt::format(".TP\n{}\n{}", head, plain(option->get_description()));
        if (!option->get_default_str().empty()) out += fmt::format(" (default: {})", plain(option->get_default_str()));
        out += '\n';
    }
    return out;
}

std::string man(const CLI::App& app) {
    std::string out = fmt::format(".TH PROLATE 1 \"\" \"{}\" \"User Commands\"\n.SH NAME\nprolate \\- {}\n",
                                  generator(), plain("collision detection on ellipsoid trees"));
    out += ".SH SYNOPSIS\n.nf\n";
    for (const CLI::App* command : commands_of(app)) {
        out += fmt::format("\\fBprolate {}\\fR", command->get_name());
        for (const CLI::Option* option : command->get_options([](const CLI::Option* o) { return o->get_positional(); }))
            out += fmt::format(fmt::runtime(option->get_required() ? " \\fI{}\\fR" : " [\\fI{}\\fR]"),
                               plain(option->get_name()));
        out += " [\\fIoptions\\fR]\n";
    }
    out += fmt::format(".fi\n.SH DESCRIPTION\n{}", as_is(app.get_footer()));
    for (const CLI::App* command : commands_of(app)) {
        std::string title = command->get_name();
        std::transform(title.begin(), title.end(), title.begin(),
                       [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
        out += fmt::format(".SH PROLATE {}\n{}.\n", title, plain(command->get_description()));
        out += options_man(*command) + as_is(command->get_footer());
    }
    return out;
}

} // namespace

void add_completion(CLI::App& app, Work& chosen) {
    auto shell = std::make_shared<std::string>();
    CLI::App* command = app.add_subcommand("completion", "Print a script that completes the command line in a shell");
    command->add_option("shell", *shell, "bash, zsh or fish")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(kShells), std::end(kShells))))
        ->required();
    command->footer(kDescribeFooter);
    command->callback([&app, &chosen, shell] {
        chosen = [&app, shell] {
            print(*shell == "bash" ? bash(app) : *shell == "zsh" ? zsh(app) : fish(app));
            return kDone;
        };
    });
}

void add_man(CLI::App& app, Work& chosen) {
    CLI::App* command = app.add_subcommand("man", "Print the manual page, of all commands");
    command->footer("\nExamples:\n  prolate man | man -l -\n  prolate man >/usr/local/share/man/man1/prolate.1");
    command->callback([&app, &chosen] {
        chosen = [&app] {
            print(man(app));
            return kDone;
        };
    });
}

} // namespace prolate::cli

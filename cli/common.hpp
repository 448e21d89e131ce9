// What the commands share: exit codes, one-line errors, reading of inputs, standard output.
//
// Each command is one file with one function add_<name>(app, chosen): it declares its options on a subcommand of `app`
// and, when the subcommand is on the command line, sets `chosen` to the work. main() parses first and works second, so
// no command runs inside the parser.
#pragma once

#include "cli/grouped.hpp"

#include <prolate/error.hpp>
#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace prolate::cli {

/// Exit codes; `prolate --help` lists them, scripts depend on them.
enum ExitCode : int {
    kDone = 0,
    kNo = 1,       ///< the work was done and the answer is "no" (verify; collide --exit-code: they meet), or some of
                   ///< it failed (bake --manifest)
    kUsage = 2,    ///< the command line asks for what does not exist
    kBadInput = 3, ///< a file's content cannot be used
    kIo = 4,       ///< reading or writing failed, or the machine has too little memory, space or threads
    kInternal = 5, ///< a promise of the program did not hold
    kUnknown = 6,  ///< collide --exit-code: undecided within the budget
    kInterrupted = 130, ///< Ctrl-C; 128 and the signal's number for others that ask to stop (signals.hpp)
};

/// The work of the chosen command; returns an ExitCode.
using Work = std::function<int()>;

void add_bake(CLI::App& app, Work& chosen);
void add_info(CLI::App& app, Work& chosen);
void add_verify(CLI::App& app, Work& chosen);
void add_export(CLI::App& app, Work& chosen);
void add_collide(CLI::App& app, Work& chosen);
void add_render(CLI::App& app, Work& chosen);
void add_view(CLI::App& app, Work& chosen);
void add_completion(CLI::App& app, Work& chosen);
void add_man(CLI::App& app, Work& chosen);

/// `text` fit for a terminal and for one line: control characters, marks that turn the direction of writing, and bytes
/// that are no UTF-8 become "\\x1b".
std::string visible(std::string_view text);

/// Prints the one line "prolate: <subject>: <what>; <advice>" on stderr (no "; " if `advice` is empty, everything made
/// visible()) and returns `code`.
int complain(int code, std::string_view subject, std::string_view what, std::string_view advice = {});

/// Reports a library error about `subject` (a file name or an option) and returns the exit code that belongs to it.
/// `detail` adds the words of a third party.
int complain(std::string_view subject, const Error& error, std::string_view detail = {});

/// The words of an error, with what its `where` means in it.
std::string words_of(const Error& error, std::string_view detail = {});

/// Runs `work` and returns its exit code; complains of an exception: out of memory, out of threads, or an error in
/// prolate itself.
int guarded(const Work& work);

/// From here on notes, the progress line and tables that only accompany a file are left out: --quiet.
void be_quiet();
bool is_quiet();

/// Prints the line "prolate: <subject>: <text>" on stderr, unless quiet; no error.
void note(std::string_view subject, std::string_view text);

/// While it lives, lines of complain() and note() begin with "prolate: <part>: ": the work is one part of many.
class PartOfWork {
public:
    explicit PartOfWork(std::string part);
    ~PartOfWork();
    PartOfWork(const PartOfWork&) = delete;
    PartOfWork& operator=(const PartOfWork&) = delete;
    /// The last complaint since, without the part's name and the advice.
    std::string complaint() const;
};

/// True for "-" and "/dev/stdin".
bool is_standard_input(const std::string& path);

/// The first `most` bytes of a file, or of standard input. Fails with io, also for a folder.
Result<std::string> read_file(const std::string& path, size_t most = SIZE_MAX);

/// Reads a mesh or a tree, also from standard input; reports the reason and sets `code` if it cannot. What is to be
/// known of the import is noted.
std::optional<Mesh> read_mesh(const std::string& path, int& code, const ImportOptions& options = {});
std::optional<Tree> read_tree(const std::string& path, int& code);

/// Adds `text` to standard output. Failure shows in finish_output().
void print(std::string_view text);

/// Flushes standard output; returns the errno of the first write that failed since the last time, or 0.
int flush_output();
int complain_of_output(int error);

/// The same at the program's end: returns `code`, or complains and returns kIo if something could not be written. A
/// reader that has closed its pipe has read enough.
int finish_output(int code);

/// From here on, errors are printed as JSON too (--json), by finish_with_json().
void report_errors_as_json();
/// From here on standard output carries a file: what else would be printed goes to stderr.
void take_standard_output();
/// At the program's end: prints {"error": {...}} on standard output if it failed with `code` without an answer there.
void finish_with_json(int code);

/// The one of `known` that was probably meant by `word`; "" if none is near.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

/// The extension of a file name in lower case, without the dot: "Out.PLY" -> "ply"; "" if there is none.
std::string extension(const std::string& path);

} // namespace prolate::cli

// What the commands share: exit codes, one-line errors, output, interruption, progress.
//
// Each command is one file with one function add_<name>(app, chosen): it declares its options on a subcommand of `app`
// and, when the subcommand is on the command line, sets `chosen` to the work. main() parses first and works second, so
// no command runs inside the parser.
#pragma once

#include "cli/grouped.hpp"
#include "cli/remaining.hpp"

#include <prolate/error.hpp>
#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <chrono>
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
    kNo = 1,            ///< the work was done and the answer is "no" (verify), or some of it failed (bake --manifest)
    kUsage = 2,         ///< the command line asks for what does not exist
    kBadInput = 3,      ///< a file's content cannot be used
    kIo = 4,            ///< the operating system refused to read or write
    kInternal = 5,      ///< a promise of the program did not hold
    kInterrupted = 130, ///< Ctrl-C
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

/// Prints the one line "prolate: <subject>: <what>; <advice>" on stderr (no "; " if `advice` is empty, control
/// characters made visible) and returns `code`.
int complain(int code, std::string_view subject, std::string_view what, std::string_view advice = {});

/// Reports a library error about `subject` (a file name or an option) and returns the exit code that belongs to it.
/// `detail` adds the words of a third party.
int complain(std::string_view subject, const Error& error, std::string_view detail = {});

/// The words of an error, with what its `where` means in it.
std::string words_of(const Error& error, std::string_view detail = {});

/// Prints the line "prolate: <subject>: <text>" on stderr; no error.
void note(std::string_view subject, std::string_view text);

/// While it lives, lines of complain() and note() begin with "prolate: <part>: ": the work is one part of many.
class PartOfWork {
public:
    explicit PartOfWork(std::string part);
    ~PartOfWork();
    PartOfWork(const PartOfWork&) = delete;
    PartOfWork& operator=(const PartOfWork&) = delete;
    /// The last complaint since, without the part's name and the advice.
    const std::string& complaint() const;
};

/// Reads a mesh or a tree; reports the reason and sets `code` if it cannot. What is to be known of the import is noted.
std::optional<Mesh> read_mesh(const std::string& path, int& code, const ImportOptions& options = {});
std::optional<Tree> read_tree(const std::string& path, int& code);

/// True for "-" and "/dev/stdout".
bool is_standard_output(const std::string& path);

/// Finds out before the work whether `path` can be written: kDone, or reports the reason and returns the exit code.
int check_output(const std::string& path);

/// Writes a whole output: atomically to a file, or to standard output if `path` is "-". Reports failure.
int write_output(const std::string& path, std::span<const std::byte> bytes);
int write_output(const std::string& path, std::string_view text);

/// Adds `text` to standard output. Failure shows in finish_output().
void print(std::string_view text);

/// Flushes standard output at the program's end: returns `code`, or kIo if something could not be written.
int finish_output(int code);

/// From here on Ctrl-C (SIGINT) and SIGTERM only set interrupted(), and a file size limit is an error of write().
void catch_signals();
bool interrupted() noexcept;

/// One line on stderr, redrawn about ten times a second: stage, percent, nodes, elapsed and remaining time. Silent if
/// stderr is no terminal. The destructor wipes the line.
class ProgressLine {
public:
    /// `label` stands at the line's beginning.
    explicit ProgressLine(std::string label = "");
    ~ProgressLine();
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;
    /// `fraction` in 0 ... 1; `nodes` is left out if 0. Returns false once the user has interrupted.
    bool show(std::string_view stage, double fraction, uint32_t nodes = 0);

private:
    using Clock = std::chrono::steady_clock;
    std::string label_;
    RemainingTime remaining_;
    Clock::time_point start_ = Clock::now(), drawn_{};
    bool terminal_ = false, dirty_ = false;
};

/// The one of `known` that was probably meant by `word`; "" if none is near.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

/// The extension of a file name in lower case, without the dot: "Out.PLY" -> "ply"; "" if there is none.
std::string extension(const std::string& path);

} // namespace prolate::cli

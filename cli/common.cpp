#include "cli/common.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <utility>

#include <unistd.h>

namespace prolate::cli {
namespace {

std::atomic<bool> interrupted_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch only lock-free atomics");
int output_errno = 0; // of the first failed write to standard output
std::string part_of_work, last_complaint;

int exit_code(ErrorCode code) {
    switch (code) {
    case ErrorCode::bad_options:
    case ErrorCode::unsupported:
        return kUsage;
    case ErrorCode::bad_mesh:
    case ErrorCode::bad_file:
    case ErrorCode::newer_version:
        return kBadInput;
    case ErrorCode::io:
        return kIo;
    case ErrorCode::cancelled:
        return kInterrupted;
    case ErrorCode::internal:
    case ErrorCode::out_of_memory:
    case ErrorCode::bad_id:
        break;
    }
    return kInternal;
}

std::string_view advice_for_errno(int number) {
    switch (number) {
    case ENOENT:
        return "check the path";
    case ENOTDIR:
    case EISDIR:
        return "name a file";
    case EACCES:
    case EPERM:
    case EROFS:
        return "check the permissions";
    case ENOSPC:
    case EDQUOT:
        return "free some space";
    case EFBIG:
        return "raise the file size limit (ulimit -f)";
    default:
        return "";
    }
}

std::string_view advice_for(const Error& error) {
    switch (error.code) {
    case ErrorCode::bad_options:
        return "see the command's --help";
    case ErrorCode::bad_mesh:
        return "repair the mesh";
    case ErrorCode::bad_file:
        return "check the file";
    case ErrorCode::newer_version:
        return "bake it again or use a newer prolate";
    case ErrorCode::io:
        return advice_for_errno(static_cast<int>(error.where));
    case ErrorCode::internal:
        return "please report this, with the input";
    case ErrorCode::unsupported: // says itself what to use
    case ErrorCode::cancelled:
    case ErrorCode::out_of_memory: // these two come from worlds, which the command has none of
    case ErrorCode::bad_id:
        break;
    }
    return "";
}

void print_line(std::string_view subject, std::string_view what, std::string_view advice) {
    std::string line = fmt::format("prolate: {}{}: {}", part_of_work, subject, what);
    if (!advice.empty()) line += fmt::format("; {}", advice);
    for (char& c : line) // a file name or a reader's words may hold anything; this stays one line
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
    line += '\n';
    std::fwrite(line.data(), 1, line.size(), stderr);
}

int complain_with_advice(std::string_view subject, const Error& error, std::string_view detail,
                         std::string_view advice) {
    if (error.code == ErrorCode::cancelled)
        return complain(kInterrupted, subject, "interrupted", "nothing was written");
    // An error that brings its own advice says it behind a "; ".
    const std::string_view what = error.what;
    const size_t own = what.find("; ");
    if (own == what.npos) return complain(exit_code(error.code), subject, words_of(error, detail), advice);
    const std::string before(what.substr(0, own));
    return complain(exit_code(error.code), subject, words_of({error.code, before.c_str(), error.where}, detail),
                    what.substr(own + 2));
}

extern "C" void on_signal(int) {
    interrupted_flag.store(true);
}

} // namespace

int complain(int code, std::string_view subject, std::string_view what, std::string_view advice) {
    last_complaint = fmt::format("{}: {}", subject, what);
    print_line(subject, what, advice);
    return code;
}

std::string words_of(const Error& error, std::string_view detail) {
    std::string what = error.what;
    if (error.code == ErrorCode::io && error.where != 0)
        what += fmt::format(": {}", std::strerror(static_cast<int>(error.where)));
    if (error.code == ErrorCode::newer_version) what += fmt::format(" (version {})", error.where);
    if (error.code == ErrorCode::bad_mesh && (what.starts_with("vertex") || what.starts_with("triangle")))
        what += fmt::format(" (index {})", error.where);
    if (!detail.empty())
        what += fmt::format(" ({})", detail);
    else if (error.code == ErrorCode::bad_file && error.where != 0)
        what += fmt::format(" (at byte {})", error.where);
    return what;
}

int complain(std::string_view subject, const Error& error, std::string_view detail) {
    return complain_with_advice(subject, error, detail, advice_for(error));
}

void note(std::string_view subject, std::string_view text) {
    print_line(subject, text, "");
}

PartOfWork::PartOfWork(std::string part) {
    part_of_work = std::move(part) + ": ";
    last_complaint.clear();
}
PartOfWork::~PartOfWork() {
    part_of_work.clear();
}
const std::string& PartOfWork::complaint() const {
    return last_complaint;
}

std::optional<Mesh> read_mesh(const std::string& path, int& code, const ImportOptions& options) {
    ImportReport report;
    auto mesh = load_mesh(path.c_str(), options, &report);
    if (mesh) {
        for (const std::string& line : report.notes) note(path, line);
        return std::move(*mesh);
    }
    code = complain_with_advice(path, mesh.error(), report.detail,
                                mesh.error().code == ErrorCode::bad_file
                                    ? "export the mesh again, as OBJ, PLY, STL, OFF, glTF, GLB, 3MF, 3DS or DAE"
                                    : advice_for(mesh.error()));
    return {};
}

std::optional<Tree> read_tree(const std::string& path, int& code) {
    auto tree = load(path.c_str());
    if (tree) return std::move(*tree);
    code = complain_with_advice(path, tree.error(), "",
                                tree.error().code == ErrorCode::bad_file ? "make it again with 'prolate bake'"
                                                                         : advice_for(tree.error()));
    return {};
}

bool is_standard_output(const std::string& path) {
    return path == "-" || path == "/dev/stdout";
}

int check_output(const std::string& path) {
    namespace fs = std::filesystem;
    if (is_standard_output(path)) return kDone;
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) return complain(path, Error{ErrorCode::io, "cannot write there", EISDIR});
    if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored)) return kDone; // a pipe or device
    const fs::path parent = fs::path(path).parent_path();
    const std::string folder = parent.empty() ? "." : parent.string();
    if (!fs::is_directory(folder, ignored))
        return complain(kIo, path, fmt::format("the folder {} does not exist", folder), "create it first");
    if (::access(folder.c_str(), W_OK) != 0)
        return complain(path, Error{ErrorCode::io, "cannot write into its folder", static_cast<uint64_t>(errno)});
    return kDone;
}

int write_output(const std::string& path, std::span<const std::byte> bytes) {
    if (is_standard_output(path)) {
        print({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
        return kDone;
    }
    // save() replaces the name; a link should go on pointing at what it points at.
    std::error_code error;
    const std::filesystem::path target = std::filesystem::canonical(path, error);
    const auto saved = save(error ? path.c_str() : target.c_str(), bytes);
    return saved ? static_cast<int>(kDone) : complain(path, saved.error());
}

int write_output(const std::string& path, std::string_view text) {
    return write_output(path, std::as_bytes(std::span(text.data(), text.size())));
}

void print(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() && output_errno == 0) output_errno = errno;
}

int finish_output(int code) {
    if (std::fflush(stdout) != 0 && output_errno == 0) output_errno = errno;
    if (output_errno == 0) return code;
    return complain("standard output",
                    Error{ErrorCode::io, "cannot write all of it", static_cast<uint64_t>(output_errno)});
}

void catch_signals() {
    struct sigaction action {};
    action.sa_handler = on_signal;
    // A second Ctrl-C ends the program at once.
    action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    ::signal(SIGXFSZ, SIG_IGN); // let write() say EFBIG, so that the temporary file is removed
}

bool interrupted() noexcept {
    return interrupted_flag.load();
}

ProgressLine::ProgressLine(std::string label) : label_(std::move(label)), terminal_(::isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
    if (dirty_) std::fputs("\r\x1b[K", stderr);
}

bool ProgressLine::show(std::string_view stage, double fraction, uint32_t nodes) {
    const Clock::time_point now = Clock::now();
    if (terminal_ && (!dirty_ || now - drawn_ > std::chrono::milliseconds(100))) {
        const double seconds = std::chrono::duration<double>(now - start_).count();
        const std::string count = nodes > 0 ? fmt::format("  {} nodes", grouped(nodes)) : "";
        const auto left = remaining_.after(seconds, fraction);
        fmt::print(stderr, "\r\x1b[K{}{:<12} {:3.0f} %{}  {:.0f} s{}", label_, stage, 100 * fraction, count, seconds,
                   left ? fmt::format(", about {} left", rounded_time(*left)) : "");
        std::fflush(stderr);
        drawn_ = now;
        dirty_ = true;
    }
    return !interrupted();
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
    // Levenshtein distance: how many letters to insert, delete or change.
    const auto distance = [word](std::string_view other) {
        std::vector<size_t> row(other.size() + 1);
        std::iota(row.begin(), row.end(), size_t{0});
        for (size_t i = 0; i < word.size(); ++i) {
            size_t diagonal = std::exchange(row[0], i + 1);
            for (size_t j = 0; j < other.size(); ++j)
                diagonal =
                    std::exchange(row[j + 1], std::min({row[j + 1] + 1, row[j] + 1, diagonal + (word[i] != other[j])}));
        }
        return row.back();
    };
    const auto nearest = std::min_element(known.begin(), known.end(),
                                          [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    return nearest != known.end() && distance(*nearest) <= 1 + word.size() / 4 ? *nearest : "";
}

std::string extension(const std::string& path) {
    std::string out = std::filesystem::path(path).extension().string();
    if (!out.empty()) out.erase(0, 1);
    for (char& c : out)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return out;
}

} // namespace prolate::cli

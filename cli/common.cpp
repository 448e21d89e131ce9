#include "cli/common.hpp"

#include "cli/signals.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <new>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace prolate::cli {
namespace {

int output_errno = 0; // of the first failed write to standard output
bool printed = false, output_taken = false, quiet = false, json_errors = false;
std::string part_of_work;
struct Complaint {
    int code = kDone;
    std::string subject, what, advice;
} last_complaint;

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
    case ErrorCode::out_of_memory:
        return kIo;
    case ErrorCode::cancelled:
        return kInterrupted;
    case ErrorCode::internal:
    case ErrorCode::bad_id:
        break;
    }
    return kInternal;
}

constexpr const char* kMemoryAdvice = "take a smaller mesh, fewer levels or ellipsoids, or a lower --quality";

std::string_view advice_for_errno(int number) {
    switch (number) {
    case ENOENT:
        return "check the path";
    case ENOTDIR:
    case EISDIR:
        return "name a file";
    case ENAMETOOLONG:
        return "take a shorter name";
    case EAGAIN:
        return "raise the limit of processes (ulimit -u)";
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
    case ErrorCode::out_of_memory:
        return kMemoryAdvice;
    case ErrorCode::unsupported: // says itself what to use
    case ErrorCode::cancelled:
    case ErrorCode::bad_id: // comes from worlds, which the command has none of
        break;
    }
    return "";
}

void print_line(std::string_view subject, std::string_view what, std::string_view advice) {
    std::string line = fmt::format("prolate: {}{}: {}", part_of_work, subject, what);
    if (!advice.empty()) line += fmt::format("; {}", advice);
    line = visible(line) + '\n'; // a file name or a reader's words may hold anything
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

// Bytes of the UTF-8 character that `text` begins with, and the character; 0 bytes if it is none.
std::pair<size_t, char32_t> decode(std::string_view text) {
    const auto byte = [text](size_t i) { return static_cast<unsigned char>(text[i]); };
    const size_t length = byte(0) < 0x80   ? 1
                          : byte(0) < 0xc2 ? 0
                          : byte(0) < 0xe0 ? 2
                          : byte(0) < 0xf0 ? 3
                          : byte(0) < 0xf5 ? 4
                                           : 0;
    if (length == 0 || length > text.size()) return {0, 0};
    char32_t c = length == 1 ? byte(0) : byte(0) & (0x7fu >> length);
    for (size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xc0) != 0x80) return {0, 0};
        c = c << 6 | (byte(i) & 0x3fu);
    }
    return {length, c};
}

// The kind of mesh, as an extension, that begins so.
std::string mesh_kind_of(std::string_view bytes) {
    const auto begins = [bytes](std::string_view with) { return bytes.starts_with(with); };
    const std::string_view head = bytes.substr(0, 4096);
    const auto holds = [head](std::string_view what) { return head.find(what) != head.npos; };
    uint32_t stl_triangles = 0;
    if (bytes.size() >= 84) std::memcpy(&stl_triangles, bytes.data() + 80, sizeof stl_triangles);
    if (bytes.size() >= 84 && bytes.size() == 84 + uint64_t{50} * stl_triangles) return "stl";
    if (begins("ply")) return "ply";
    if (begins("glTF")) return "glb";
    if (begins("PK\x03\x04")) return "3mf";
    if (begins("MM")) return "3ds";
    if (begins("solid") && holds("facet")) return "stl";
    if (holds("<COLLADA")) return "dae";
    if (head.substr(std::min(head.find_first_not_of(" \t\r\n"), head.size())).starts_with('{')) return "gltf";
    for (const char* off : {"OFF", "COFF", "NOFF", "STOFF"})
        if (begins(off)) return "off";
    return "obj";
}

// A mesh from standard input. The importer wants a name, by whose ending it knows the format.
Result<Mesh> load_standard_input(const ImportOptions& options, ImportReport& report) {
    const auto bytes = read_file("-");
    if (!bytes) return bytes.error();
    const GracefulStop removes_its_file;
    std::error_code error;
    const std::string kind = mesh_kind_of(*bytes);
    std::string name = (std::filesystem::temp_directory_path(error) / "prolate-XXXXXX.").string() + kind;
    const int file = error ? -1 : ::mkstemps(name.data(), static_cast<int>(kind.size()) + 1);
    if (file < 0)
        return Error{ErrorCode::io, "cannot be kept in the folder for temporary files", static_cast<uint64_t>(errno)};
    ::close(file);
    const auto written = save(name.c_str(), std::as_bytes(std::span(*bytes)));
    auto mesh = written ? load_mesh(name.c_str(), options, &report) : Result<Mesh>(written.error());
    ::unlink(name.c_str());
    return mesh;
}

// Standard input can be read once.
bool take_standard_input(int& code) {
    static bool taken = false;
    if (std::exchange(taken, true))
        code = complain(kUsage, "-", "standard input can be only one of the inputs", "name a file");
    return code == kDone;
}

} // namespace

std::string visible(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const auto [length, c] = decode(text);
        const bool control = c < 0x20 || (c >= 0x7f && c < 0xa0);
        const bool turns = (c >= 0x200e && c <= 0x200f) || (c >= 0x2028 && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
        const size_t bytes = std::max<size_t>(length, 1);
        if (length == 0 || control || turns)
            for (const char byte : text.substr(0, bytes))
                out += fmt::format("\\x{:02x}", static_cast<unsigned char>(byte));
        else
            out += text.substr(0, bytes);
        text.remove_prefix(bytes);
    }
    return out;
}

int complain(int code, std::string_view subject, std::string_view what, std::string_view advice) {
    last_complaint = {code, std::string(subject), std::string(what), std::string(advice)};
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

int guarded(const Work& work) {
    try {
        return work();
    } catch (const std::bad_alloc&) {
        return complain(kIo, "memory", "there is not enough of it", kMemoryAdvice);
    } catch (const std::length_error&) { // a container that would be larger than any memory
        return complain(kIo, "memory", "there is not enough of it", kMemoryAdvice);
    } catch (const std::exception& e) {
        // oneTBB's words when the system gives no thread; its exception says nothing else.
        if (std::string_view(e.what()).starts_with("pthread_"))
            return complain(kIo, "threads", e.what(), advice_for_errno(EAGAIN));
        return complain(kInternal, "internal error", e.what(), "please report this, with the input");
    }
}

void be_quiet() {
    quiet = true;
}
bool is_quiet() {
    return quiet;
}

void note(std::string_view subject, std::string_view text) {
    if (!quiet) print_line(subject, text, "");
}

PartOfWork::PartOfWork(std::string part) {
    part_of_work = std::move(part) + ": ";
    last_complaint = {};
}
PartOfWork::~PartOfWork() {
    part_of_work.clear();
}
std::string PartOfWork::complaint() const {
    return last_complaint.code == kDone ? "" : last_complaint.subject + ": " + last_complaint.what;
}

bool is_standard_input(const std::string& path) {
    return path == "-" || path == "/dev/stdin";
}

Result<std::string> read_file(const std::string& path, size_t most) {
    const auto fail = [] { return Error{ErrorCode::io, "cannot be read", static_cast<uint64_t>(errno)}; };
    const int file = is_standard_input(path) ? ::dup(STDIN_FILENO) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return fail();
    std::string out;
    char buffer[1 << 16];
    while (out.size() < most) {
        const ssize_t n = ::read(file, buffer, std::min(sizeof buffer, most - out.size()));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            const Error error = fail();
            ::close(file);
            return error;
        }
        if (n == 0) break;
        out.append(buffer, static_cast<size_t>(n));
    }
    ::close(file);
    return out;
}

std::optional<Mesh> read_mesh(const std::string& path, int& code, const ImportOptions& options) {
    ImportReport report;
    const bool piped = is_standard_input(path);
    if (piped && !take_standard_input(code)) return {};
    auto mesh = piped ? load_standard_input(options, report) : load_mesh(path.c_str(), options, &report);
    if (mesh) {
        for (const std::string& line : report.notes) note(path, line);
        return std::move(*mesh);
    }
    code = complain_with_advice(piped ? "standard input" : path, mesh.error(), report.detail,
                                mesh.error().code == ErrorCode::bad_file
                                    ? "export the mesh again, as OBJ, PLY, STL, OFF, glTF, GLB, 3MF, 3DS or DAE"
                                    : advice_for(mesh.error()));
    return {};
}

std::optional<Tree> read_tree(const std::string& path, int& code) {
    const bool piped = is_standard_input(path);
    if (piped && !take_standard_input(code)) return {};
    auto tree = load(piped ? "/dev/stdin" : path.c_str());
    if (tree) return std::move(*tree);
    code = complain_with_advice(piped ? "standard input" : path, tree.error(), "",
                                tree.error().code == ErrorCode::bad_file ? "make it again with 'prolate bake'"
                                                                         : advice_for(tree.error()));
    return {};
}

void print(std::string_view text) {
    printed = true;
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() && output_errno == 0) output_errno = errno;
}

int flush_output() {
    if (std::fflush(stdout) != 0 && output_errno == 0) output_errno = errno;
    return std::exchange(output_errno, 0);
}

int finish_output(int code) {
    const int error = flush_output();
    return error == 0 || error == EPIPE ? code : complain_of_output(error);
}

int complain_of_output(int error) {
    return complain("standard output", Error{ErrorCode::io, "cannot write all of it", static_cast<uint64_t>(error)});
}

void report_errors_as_json() {
    json_errors = true;
}

void finish_with_json(int code) {
    if (!json_errors || printed || code == kDone || last_complaint.code == kDone) return;
    const nlohmann::ordered_json error{{"error",
                                        {{"code", code},
                                         {"subject", last_complaint.subject},
                                         {"what", last_complaint.what},
                                         {"advice", last_complaint.advice}}}};
    const std::string text = error.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
    if (output_taken)
        fmt::print(stderr, "{}", text);
    else
        print(text);
}

void take_standard_output() {
    output_taken = true;
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

#include "cli/outputs.hpp"

#include "cli/console.hpp"
#include "cli/inputs.hpp"
#include "cli/mesh_files.hpp"
#include "cli/signals.hpp"

#include "src/can_save.hpp"

#include <prolate/tree.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

#include <sys/stat.h>
#include <unistd.h>

namespace prolate::cli {
namespace fs = std::filesystem;
namespace {

// What file this is, in words that are equal for equal files; "" for what may be written by many: pipes and devices.
// Of a file that is yet to be made: its folder, which is there or the claim fails, and its name.
std::string identity(const std::string& path) {
    struct stat status {};
    const bool standard = is_standard_output(path);
    if ((standard ? ::fstat(STDOUT_FILENO, &status) : ::stat(path.c_str(), &status)) == 0) {
        if (S_ISREG(status.st_mode) || S_ISDIR(status.st_mode))
            return fmt::format("{}:{}", status.st_dev, status.st_ino);
        return standard ? "standard output" : "";
    }
    std::error_code none;
    fs::path file = path;
    for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(file, none)); ++links)
        file = file.parent_path() / fs::read_symlink(file, none);
    const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
    if (::stat(folder.c_str(), &status) != 0) return fs::weakly_canonical(file, none).string();
    return fmt::format("{}:{}/{}", status.st_dev, status.st_ino, file.filename().string());
}

// The mark that prolate leaves in what it writes: at the beginning, or anywhere in it.
struct Mark {
    std::string_view kind, begins, holds;
};
constexpr Mark kMarks[] = {
    {"etree",
     "\x89"
     "ETREE",
     ""},
    {"json", "{", "\"generator\": \"prolate "},
    {"html", "<!DOCTYPE html>", "<meta name=\"generator\" content=\"prolate\">"},
    {"png",
     "\x89"
     "PNG\r\n",
     std::string_view("tEXtSoftware\0prolate", 20)},
    {"csv", "level,cx,cy,cz,", ""},
    {"ply", "ply\n", "\ncomment prolate export\n"},
    {"obj", "# prolate export\n", ""},
    {"glb", "glTF", "\"generator\":\"prolate "},
    {"pov", "// prolate export", ""},
};
constexpr size_t kMarkReach = 1024; // bytes from the beginning that hold every mark

// Keeps what could not be written where it belongs; returns where, or "".
std::string keep_elsewhere(const std::string& path, std::span<const std::byte> content) {
    std::error_code error;
    const fs::path folder = fs::temp_directory_path(error);
    if (error) return "";
    const std::string name = is_standard_output(path) ? "output" : fs::path(path).filename().string();
    for (int number = 1; number < 100; ++number) {
        const std::string kept = (folder / fmt::format("kept-{}-{}", number, name)).string();
        if (fs::exists(fs::symlink_status(kept, error))) continue;
        return save(kept.c_str(), content) ? kept : "";
    }
    return "";
}

} // namespace

bool is_standard_output(const std::string& path) {
    return path == "-" || path == "/dev/stdout";
}

bool is_ours(std::string_view kind, std::string_view content) {
    const std::string_view head = content.substr(0, kMarkReach);
    for (const Mark& mark : kMarks)
        if (mark.kind == kind) return head.starts_with(mark.begins) && head.find(mark.holds) != head.npos;
    return false;
}

void Outputs::declare(CLI::App& command) {
    command.add_flag("--force", force_, "replace files that prolate did not write, too (never one that is read)");
}

void Outputs::reads(const std::string& path, const std::string& role) {
    if (path.empty()) return;
    struct stat status {};
    if (is_standard_input(path)) { // a name in the folder is another file
        if (::fstat(STDIN_FILENO, &status) == 0 && S_ISREG(status.st_mode))
            users_.emplace(fmt::format("{}:{}", status.st_dev, status.st_ino), User{role, path});
        return;
    }
    if (const std::string file = identity(path); !file.empty()) users_.emplace(file, User{role, path});
}

void Outputs::reads_mesh(const std::string& path, const std::string& role) {
    reads(path, role);
    for (const std::string& other : files_beside(path)) reads(other, "read with " + role);
}

Outcome<> Outputs::claim(const std::string& path, const std::string& role, std::string_view kind) {
    if (path.empty()) return kSuccess;
    if (const std::string file = identity(path); !file.empty()) {
        const auto [user, added] = users_.emplace(file, User{role, path});
        if (!added)
            return Failure{kUsage, path,
                           user->second.path == path
                               ? fmt::format("is {}", user->second.role)
                               : fmt::format("is the same file as {}, {}", user->second.role, user->second.path),
                           fmt::format("name another file for {}", role)};
    }
    claims_.emplace(path, kind);
    if (is_standard_output(path)) {
        take_standard_output();
        return kSuccess;
    }
    std::error_code none;
    const fs::path parent = fs::path(path).parent_path();
    const std::string folder = parent.empty() ? "." : parent.string();
    if (!fs::exists(path, none) && !fs::is_directory(folder, none))
        return Failure{kIo, path, fmt::format("the folder {} does not exist", folder), "create it first"};
    if (auto mine = check_content(path, kind); !mine) return mine;
    if (const auto can = can_save(path.c_str()); !can) return failure_of(path, can.error());
    return kSuccess;
}

Outcome<> Outputs::check_content(const std::string& path, std::string_view kind) const {
    std::error_code none;
    if (force_ || !fs::is_regular_file(path, none) || fs::file_size(path, none) == 0) return kSuccess;
    const auto head = read_file(path, kMarkReach);
    if (head && is_ours(kind, *head)) return kSuccess;
    return Failure{kIo, path,
                   head ? fmt::format("exists and is not a .{} file that prolate wrote", kind)
                        : "exists, and its content cannot be read",
                   "name another file, or replace it with --force"};
}

Outcome<> Outputs::write(const std::string& path, std::span<const std::byte> content, Effort effort) const {
    if (path.empty()) return kSuccess;
    const GracefulStop whole; // once begun, it is finished
    if (interrupted() && effort != Effort::account) return failure_of(path, Error{ErrorCode::cancelled});
    Outcome<> written = kSuccess;
    if (is_standard_output(path)) {
        print({reinterpret_cast<const char*>(content.data()), content.size()});
        if (effort == Effort::long_) written = flush_output();             // else finish() reports
    } else if (written = check_content(path, claims_.at(path)); written) { // the work took its time
        if (const auto saved = save(path.c_str(), content); !saved) written = failure_of(path, saved.error());
    }
    if (written || effort != Effort::long_) return written;
    const std::string kept = keep_elsewhere(path, content);
    return kept.empty() ? written.error() : advised(written.error(), "what was made is kept as " + kept);
}

Outcome<> Outputs::write(const std::string& path, std::string_view content, Effort effort) const {
    return write(path, std::as_bytes(std::span(content.data(), content.size())), effort);
}

} // namespace prolate::cli

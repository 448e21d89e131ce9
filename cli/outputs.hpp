// What a run writes, and the promise that nothing is lost by it:
//   - an output is never one of the run's inputs or another of its outputs: the same file, whatever it is called,
//     through symbolic and hard links; the files that a glTF mesh is read from are inputs, all of them;
//   - a file that prolate did not write, as its content tells, is replaced only with --force;
//   - what can be known to stand in the way of writing is known before the work.
// Every command names its inputs, then claims its outputs, works, and writes them.
#pragma once

#include "cli/failure.hpp"

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace prolate::cli {

/// True for "-" and "/dev/stdout".
bool is_standard_output(const std::string& path);

/// Is `content`, or its first 1024 bytes, a file of this kind that prolate wrote? Kinds are named as their usual
/// extensions: etree, json, html, png, csv, ply, obj, glb, pov.
bool is_ours(std::string_view kind, std::string_view content);

class Outputs {
public:
    /// Declares --force.
    void declare(CLI::App& command);

    /// Names an input; `role` says what it is ("the mesh"). An empty path is no file. Inputs come before outputs.
    void reads(const std::string& path, const std::string& role);
    /// The same for a mesh, and for the other files that are read with it.
    void reads_mesh(const std::string& path, const std::string& role);

    /// Claims `path` ("-" for standard output) for a file of this kind and finds out whether it can be written. An
    /// empty path is no file.
    Outcome<> claim(const std::string& path, const std::string& role, std::string_view kind);

    enum class Effort {
        small,   ///< the content is soon made again
        long_,   ///< if it cannot be written where it belongs, it is kept in the folder for temporary files
        account, ///< of what was done: written after an interruption, too
    };
    /// Writes a claimed output: atomically to a file, or to standard output. If it fails, a file that was there before
    /// is as it was.
    Outcome<> write(const std::string& path, std::span<const std::byte> content, Effort effort = Effort::small) const;
    Outcome<> write(const std::string& path, std::string_view content, Effort effort = Effort::small) const;

private:
    Outcome<> check_content(const std::string& path, std::string_view kind) const;

    struct User {
        std::string role, path;
    };
    std::map<std::string, User> users_;         // by what file it is
    std::map<std::string, std::string> claims_; // path to kind
    bool force_ = false;
};

} // namespace prolate::cli

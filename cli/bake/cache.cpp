#include "cli/bake/cache.hpp"

#include "cli/console.hpp"
#include "cli/inputs.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <utility>

namespace prolate::cli {
namespace fs = std::filesystem;
namespace {

std::string tree_name(uint64_t source, uint64_t options) {
    return fmt::format("{:016x}-{:016x}.etree", source, options);
}
std::string source_name(uint64_t file) {
    return fmt::format("{:016x}.mesh", file);
}
// The whole content of a .mesh entry; that it repeats its name finds entries that were renamed.
std::string source_text(uint64_t file, uint64_t source) {
    return fmt::format("{:016x} {:016x}\n", file, source);
}

} // namespace

bool is_bake_of(const TreeView& tree, uint64_t source, uint64_t options) {
    const BakeInfo info = tree.bake_info();
    return info.source_hash == source && info.options_hash == options && info.proved && !tree.is_prefix() &&
           !tree.deformation(); // of which the options say nothing
}

std::string BakeCache::path(const std::string& name) const {
    return (fs::path(folder_) / name).string();
}

std::optional<Tree> BakeCache::find(uint64_t source, uint64_t options) const {
    if (folder_.empty()) return {};
    const std::string entry = path(tree_name(source, options));
    std::error_code none;
    if (!fs::exists(entry, none)) return {};
    auto tree = load(entry.c_str());
    if (tree && is_bake_of(tree->view(), source, options)) return std::move(*tree);
    note(entry, fmt::format("damaged cache entry ({}), not used", tree ? "not what its name says" : tree.error().what));
    return {};
}

std::optional<uint64_t> BakeCache::find_source(uint64_t file) const {
    if (folder_.empty()) return {};
    const auto text = read_file(path(source_name(file)));
    if (!text || text->size() != source_text(file, 0).size()) return {};
    const uint64_t source = std::strtoull(text->c_str() + 17, nullptr, 16);
    if (*text != source_text(file, source)) return {};
    return source;
}

void BakeCache::write(const std::string& name, std::span<const std::byte> bytes) {
    if (folder_.empty()) return;
    std::error_code error;
    fs::create_directories(folder_, error);
    const std::string entry = path(name);
    std::error_code none;
    if (fs::is_directory(entry, none)) return note(entry, "a folder where the cache wants a file: not kept");
    // A link would lead out of the folder, to a file that is not the cache's.
    if (fs::is_symlink(fs::symlink_status(entry, none))) fs::remove(entry, none);
    Result<void> saved = error ? Error{ErrorCode::io, "cannot be made", static_cast<uint64_t>(error.value())}
                               : save(entry.c_str(), bytes);
    if (saved) return;
    note(std::exchange(folder_, ""), fmt::format("the cache folder is left out: {}", words_of(saved.error())));
}

void BakeCache::keep(const TreeView& tree, bool replace) {
    const BakeInfo info = tree.bake_info();
    const std::string name = tree_name(info.source_hash, info.options_hash);
    std::error_code none;
    if (replace || !fs::is_regular_file(path(name), none)) write(name, tree.bytes());
}

void BakeCache::keep_source(uint64_t file, uint64_t source) {
    const std::string text = source_text(file, source);
    write(source_name(file), std::as_bytes(std::span(text)));
}

} // namespace prolate::cli

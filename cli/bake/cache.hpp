// A folder of baked trees, so that no mesh is baked twice with the same options: on this machine, after a clean
// checkout, or on any machine that shares the folder.
//
// Two kinds of entries, both written atomically, both safe to delete at any time:
//   <source>-<options>.etree   a tree, named by the two hashes that its header holds
//   <file hash>.mesh           the source hash of the mesh in a file of these bytes (hash_mesh_file()), so that an
//                              unchanged file need not be imported to know its mesh
// Nothing in the folder is believed for its name: a tree counts if it opens, with all hashes right, and its header says
// what its name says. A wrong .mesh entry leads to a tree that does not exist. Whoever can write to the folder can
// nevertheless forge trees, as with any build cache: 'prolate verify' proves them anew.
#pragma once

#include <prolate/tree.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace prolate::cli {

/// Is `tree` whole, proved, and what a bake of this mesh (its source hash) with these options makes?
bool is_bake_of(const TreeView& tree, uint64_t source, uint64_t options);

class BakeCache {
public:
    /// Without a folder it finds nothing and keeps nothing. A folder that does not exist is made when it is needed.
    explicit BakeCache(std::string folder = "") : folder_(std::move(folder)) {}
    explicit operator bool() const { return !folder_.empty(); }

    /// The tree, if there is a sound one. A damaged entry gets a note on stderr, and keep() replaces it.
    std::optional<Tree> find(uint64_t source, uint64_t options) const;
    /// The source hash of the mesh in files of this hash.
    std::optional<uint64_t> find_source(uint64_t file) const;

    /// Adds the tree; an entry that is there already stays unless `replace`. If the folder cannot be written, that is
    /// noted on stderr once, and the work goes on without it.
    void keep(const TreeView& tree, bool replace);
    void keep_source(uint64_t file, uint64_t source);

private:
    std::string path(const std::string& name) const;
    void write(const std::string& name, std::span<const std::byte> bytes);

    std::string folder_;
};

} // namespace prolate::cli

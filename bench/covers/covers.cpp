#include "bench/covers/covers.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

namespace prolate::bench {

std::string cover_file(const std::string& folder, const std::string& model, const BuildOptions& options) {
    const auto named = [](const auto& names, auto value) {
        for (const auto& [name, v] : names)
            if (v == value) return name;
        return std::string();
    };
    return fmt::format("{}/{}-{}-{}-{}-{}.etree", folder, model,
                       options.primitive == Primitive::sphere ? "sphere" : "ellipsoid",
                       options.method == Method::analytic ? "analytic" : "voxel", options.ellipsoids,
                       named(kQualities, options.quality));
}

std::optional<Tree> cover_of(const Model& model, const BuildOptions& options, const std::string& folder) {
    const std::string file = cover_file(folder, model.name, options);
    if (auto kept = load(file.c_str())) {
        const BakeInfo info = kept->view().bake_info();
        if (info.source_hash == hash(model.mesh.view()) && info.options_hash == hash(options)) return std::move(*kept);
    }
    fmt::print(stderr, "baking {}\n", file);
    auto built = build(model.mesh.view(), options);
    if (!built) {
        fmt::print(stderr, "{}: {}\n", file, built.error().what);
        return std::nullopt;
    }
    std::filesystem::create_directories(folder);
    if (const auto saved = save(file.c_str(), built->tree.bytes()); !saved)
        fmt::print(stderr, "{}: {}\n", file, saved.error().what);
    return std::move(built->tree);
}

std::vector<Ellipsoid> leaves_of(const TreeView& tree) {
    std::vector<Ellipsoid> out;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t node) { out.push_back(tree.ellipsoid(node)); });
    return out;
}

} // namespace prolate::bench

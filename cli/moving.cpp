#include "cli/moving.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <utility>

namespace prolate::cli {
namespace {

std::array<float, 3> place_of(const Vec3& v) {
    return {v.x, v.y, v.z};
}

} // namespace

std::vector<uint32_t> sources_of(const Mesh& as_read, const std::vector<Vec3>& vertices) {
    std::map<std::array<float, 3>, uint32_t> source;
    for (const Triangle& t : as_read.triangles)
        for (const uint32_t corner : t) source.emplace(place_of(as_read.vertices[corner]), corner);
    std::vector<uint32_t> out;
    out.reserve(vertices.size());
    for (const Vec3& v : vertices) out.push_back(source.at(place_of(v)));
    return out;
}

std::vector<float> displacements_at(const std::vector<uint32_t>& sources, const Modes& modes) {
    const size_t of_mode = modes.displacements.size() / modes.ranges.size();
    std::vector<float> out;
    for (size_t m = 0; m < modes.ranges.size(); ++m)
        for (const uint32_t vertex : sources) {
            const float* u = &modes.displacements[m * of_mode + 3 * size_t{vertex}];
            out.insert(out.end(), u, u + 3);
        }
    return out;
}

std::vector<float> displacements_of(const TreeView& exact_tree) {
    std::vector<float> out;
    const Deformation modes = *exact_tree.deformation();
    for (uint32_t m = 0; m < modes.mode_count(); ++m)
        for (uint32_t v = 0; v < modes.point_count(); ++v) {
            const Vec3 u = modes.displacement(v, m);
            out.insert(out.end(), {u.x, u.y, u.z});
        }
    return out;
}

Outcome<ProvedModes> prove_modes(const TreeView& tree, const Mesh& as_read, const std::string& modes_path) {
    const auto deformation = tree.deformation();
    if (!deformation)
        return Failure{kUsage, modes_path, "the tree does not deform", "bake it with these --modes, or leave them out"};
    std::vector<float> ranges;
    for (uint32_t m = 0; m < deformation->mode_count(); ++m) ranges.push_back(deformation->range(m));
    auto modes = read_modes(modes_path, ranges, as_read.placement.scale);
    if (!modes) return modes.error();
    const auto proof = verify_modes(tree, as_read.view(), modes->view());
    if (!proof) return failure_of(modes_path, proof.error());
    return ProvedModes{std::move(*modes), *proof};
}

Outcome<std::vector<float>> displacements_of(const TreeView& tree, const Mesh& as_read,
                                             const std::vector<Vec3>& vertices, const std::string& modes_path) {
    auto known = prove_modes(tree, as_read, modes_path);
    if (!known) return known.error();
    if (!known->proof.proved)
        return Failure{kBadInput, modes_path,
                       fmt::format("mode {} is not one that the tree was baked with", known->proof.mode + 1),
                       "give the file that bake had"};
    return displacements_at(sources_of(as_read, vertices), known->file.view());
}

} // namespace prolate::cli

#include "cli/view/scene.hpp"

#include "cli/levels.hpp"
#include "cli/render/palette.hpp"
#include "cli/view/tables.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/gtc/packing.hpp>

namespace prolate::cli {
namespace {

constexpr uint32_t kLatticeNodes = 300'000;

std::array<uint8_t, 3> srgb(const Oklch& colour) {
    const glm::dvec3 linear = to_linear_rgb(colour);
    std::array<uint8_t, 3> out{};
    for (glm::length_t i = 0; i < 3; ++i)
        out[static_cast<size_t>(i)] = static_cast<uint8_t>(std::lround(255 * srgb_encode(linear[i])));
    return out;
}

void append(std::vector<float>& to, const Ellipsoid& e) {
    to.insert(to.end(), {e.center.x, e.center.y, e.center.z, e.l11, e.l21, e.l22, e.l31, e.l32, e.l33});
}

// The tables of the nodes, one row each, in order of slots.
nlohmann::ordered_json nodes_of(const TreeView& tree, NumberBlock& numbers) {
    std::vector<uint32_t> slot;
    std::vector<uint8_t> level, children, triangles, colour;
    std::vector<float> ellipsoid, radii;
    const std::vector<Oklch> colours = node_colours(tree);
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        tree.for_each_node(l, [&](uint32_t node) {
            const Ellipsoid e = tree.ellipsoid(node);
            slot.push_back(node);
            level.push_back(static_cast<uint8_t>(l));
            children.push_back(static_cast<uint8_t>(tree.children(node).count));
            triangles.push_back(static_cast<uint8_t>(tree.triangles(node).count));
            for (const uint8_t channel : srgb(colours[node])) colour.push_back(channel);
            append(ellipsoid, e);
            for (const double radius : principal_axes(e).radii) radii.push_back(static_cast<float>(radius));
        });
    return {{"slot", numbers.add(slot)},         {"level", numbers.add(level)},
            {"children", numbers.add(children)}, {"triangles", numbers.add(triangles)},
            {"colour", numbers.add(colour)},     {"ellipsoid", numbers.add(ellipsoid)},
            {"radii", numbers.add(radii)}};
}

nlohmann::ordered_json mesh_of(const Mesh& mesh, NumberBlock& numbers) {
    std::vector<float> vertices;
    for (const Vec3& v : mesh.vertices) vertices.insert(vertices.end(), {v.x, v.y, v.z});
    nlohmann::ordered_json out{{"vertices", numbers.add(vertices)}};
    const auto indices = [&]<class Index>(Index) {
        std::vector<Index> list;
        for (const Triangle& t : mesh.triangles)
            for (const uint32_t corner : t) list.push_back(static_cast<Index>(corner));
        return numbers.add(list);
    };
    out["triangles"] = mesh.vertices.size() <= 0x10000 ? indices(uint16_t{}) : indices(uint32_t{});
    return out;
}

std::vector<float> to_floats(const std::vector<double>& values) {
    std::vector<float> out(values.size());
    std::transform(values.begin(), values.end(), out.begin(), [](double value) { return static_cast<float>(value); });
    return out;
}

// How the nodes move (viewer/deformation.js), in the order of nodes_of().
nlohmann::ordered_json deformation_of(const TreeView& tree, NumberBlock& numbers) {
    std::vector<float> ranges, bound, motions;
    const auto modes = tree.deformation();
    const uint32_t count = modes ? modes->mode_count() : 0;
    for (uint32_t m = 0; m < count; ++m) ranges.push_back(modes->range(m));
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        tree.for_each_node(l, [&](uint32_t node) {
            append(bound, tree.bound(node));
            for (uint32_t m = 0; m < count; ++m) {
                const Deformation::Motion motion = modes->motion(node, m);
                for (const double x : {motion.shift[0], motion.shift[1], motion.shift[2], motion.growth, motion.radius})
                    motions.push_back(static_cast<float>(x));
            }
        });
    return {{"ranges", numbers.add(ranges)}, {"bound", numbers.add(bound)}, {"motions", numbers.add(motions)}};
}

// How bones move them (viewer/skinning.js), and the mesh.
nlohmann::ordered_json skin_of(const TreeView& tree, const ShownSkin& shown, NumberBlock& numbers) {
    const Skin skin = *tree.skin();
    std::vector<uint32_t> first = {0};
    std::vector<uint16_t> bones;
    std::vector<float> influences, joints;
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        tree.for_each_node(l, [&](uint32_t node) {
            for (uint32_t i = 0; i < skin.influence_count(node); ++i) {
                const Skin::Influence of = skin.influence(node, i);
                bones.push_back(static_cast<uint16_t>(of.bone));
                for (const double x : {of.weight, of.spread, of.center[0], of.center[1], of.center[2], of.radius})
                    influences.push_back(static_cast<float>(x));
            }
            first.push_back(static_cast<uint32_t>(bones.size()));
        });
    for (const Vec3& joint : shown.joints) joints.insert(joints.end(), {joint.x, joint.y, joint.z});
    return {{"bones", shown.bones},
            {"parents", shown.parents},
            {"joints", numbers.add(joints)},
            {"first", numbers.add(first)},
            {"influence_bones", numbers.add(bones)},
            {"influences", numbers.add(influences)},
            {"each", shown.each},
            {"indices", numbers.add(shown.indices)},
            {"weights", numbers.add(shown.weights)}};
}

// Half floats, in percent of the diagonal: 0.05 % of each value is as good as a picture gets.
nlohmann::ordered_json distances_of(const DistanceLattice& lattice, double diagonal, NumberBlock& numbers) {
    std::vector<uint16_t> halves;
    for (const float distance : lattice.distance)
        halves.push_back(glm::packHalf1x16(static_cast<float>(std::clamp(100 * distance / diagonal, -1e4, 1e4))));
    return {{"origin", {lattice.origin.x, lattice.origin.y, lattice.origin.z}},
            {"pitch", lattice.pitch},
            {"size", lattice.size},
            {"distance", numbers.add(halves)}};
}

} // namespace

std::optional<nlohmann::ordered_json> view_body(const ViewBody& body, NumberBlock& numbers, bool with_file,
                                                const std::function<bool(double)>& progress) {
    const TreeView& tree = body.tree;
    const BakeInfo info = tree.bake_info();
    nlohmann::ordered_json out{{"tree", body.tree_name},
                               {"mesh_name", body.mesh_name},
                               {"degree", tree.degree()},
                               {"exact", info.exact},
                               {"surface", info.surface_mode},
                               {"proved", info.proved},
                               {"covers", info.proved && (!body.mesh || body.own_mesh)},
                               {"diagonal", info.diagonal},
                               {"solid_volume", info.solid_volume}};
    out["levels"] = nlohmann::ordered_json::array();
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        nlohmann::ordered_json level = level_json(tree, l);
        level["cut"] = cut_size(tree, l);
        out["levels"].push_back(std::move(level));
    }
    out["nodes"] = nodes_of(tree, numbers);
    if (const auto inner = tree.inner()) {
        out["inner"] = {{"levels", inner->level_count()}, {"nodes", nodes_of(*inner, numbers)}};
        for (uint32_t l = 0; l < inner->level_count(); ++l)
            out["inner"]["cuts"].push_back({{"nodes", cut_size(*inner, l)},
                                            {"share", inner->level(l).union_volume / inner->bake_info().solid_volume}});
    }
    if (tree.deformation() || body.skin) {
        out["deformation"] = deformation_of(tree, numbers);
        if (body.skin) out["deformation"]["skin"] = skin_of(tree, *body.skin, numbers);
        if (!body.displacements.empty()) out["deformation"]["displacements"] = numbers.add(body.displacements);
    }
    if (body.mesh) {
        out["mesh"] = mesh_of(body.mesh->mesh, numbers);
        out["mesh"]["closed"] = body.mesh->report.closed;
        const Solid solid(body.mesh->mesh.view(), body.mesh->report.closed);
        const auto lattice = distance_lattice(tree, *body.mesh, solid, kLatticeNodes, progress);
        if (!lattice) return {};
        if (info.diagonal > 0) out["lattice"] = distances_of(*lattice, info.diagonal, numbers);
        if (!info.exact) {
            const NodeFigures figures = node_figures(tree, *body.mesh, solid, *lattice);
            out["nodes"]["outside_volume"] = numbers.add(to_floats(figures.outside_volume));
            out["nodes"]["sub_volume"] = numbers.add(to_floats(figures.sub_volume));
        }
    }
    if (with_file) out["file"] = numbers.add(tree.bytes());
    return out;
}

} // namespace prolate::cli

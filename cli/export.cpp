// prolate export: the tree's ellipsoids for other programs, in full precision (csv, json) or as a picture (ply).
#include "cli/common.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <numbers>
#include <vector>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
The cut at a level (its nodes and the leaves above it) covers the solid. Without --level: csv holds the cut of every
level, a leaf above it again for each; json holds every node once, with its own level; ply pictures the finest cut.
With --level L: the cut at L. Nodes are named by their slots in the file, which have gaps. Of an exact tree, these are the ellipsoids, and json adds the triangles of each leaf, as
places in the file's order.
csv: level,cx,cy,cz,r1,r2,r3,R11,...,R33: center, radii, and the rotation row by row; its column i is the direction
of radius i. ply: ellipsoids as meshes, their corners on the ellipsoids, one color for each child of the root.

Examples:
  prolate export horse.etree -o horse.csv --level 2
  prolate export horse.etree -o - --format csv | wc -l
  prolate export horse.etree -o horse.ply --level 2)";

struct ExportArguments {
    std::string tree, output, format;
    std::optional<uint32_t> level;
};

// The nodes to export with the level to give for each.
struct Selection {
    std::vector<uint32_t> nodes, levels;
};

void add_cut(const TreeView& tree, uint32_t level, Selection& to) {
    tree.for_each_in_cut(level, [&to](uint32_t node) { to.nodes.push_back(node); });
    to.levels.resize(to.nodes.size(), level);
}

// Of each level what covers the solid: whoever reads the rows of one level has a whole cover.
Selection all_cuts(const TreeView& tree) {
    Selection out;
    for (uint32_t l = 0; l < tree.level_count(); ++l) add_cut(tree, l, out);
    return out;
}

Selection all_nodes(const TreeView& tree) {
    Selection out;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        tree.for_each_node(l, [&out](uint32_t node) { out.nodes.push_back(node); });
        out.levels.resize(out.nodes.size(), l);
    }
    return out;
}

std::string as_csv(const TreeView& tree, const Selection& selection) {
    std::string out = "level,cx,cy,cz,r1,r2,r3,R11,R12,R13,R21,R22,R23,R31,R32,R33\n";
    for (size_t i = 0; i < selection.nodes.size(); ++i) {
        const Ellipsoid e = tree.ellipsoid(selection.nodes[i]);
        const PrincipalAxes axes = principal_axes(e);
        fmt::format_to(std::back_inserter(out), "{},{:.17g},{:.17g},{:.17g}", selection.levels[i], e.center.x,
                       e.center.y, e.center.z);
        for (const double r : axes.radii) fmt::format_to(std::back_inserter(out), ",{:.17g}", r);
        for (const auto& row : axes.rotation)
            for (const double entry : row) fmt::format_to(std::back_inserter(out), ",{:.17g}", entry);
        out += '\n';
    }
    return out;
}

std::string as_json(const TreeView& tree, const Selection& selection) {
    nlohmann::ordered_json out;
    out["degree"] = tree.degree();
    out["levels"] = tree.level_count();
    out["nodes"] = nlohmann::ordered_json::array();
    for (size_t i = 0; i < selection.nodes.size(); ++i) {
        const uint32_t node = selection.nodes[i];
        const Ellipsoid e = tree.ellipsoid(node);
        const PrincipalAxes axes = principal_axes(e);
        const ChildRange children = tree.children(node);
        const TriangleRange triangles = tree.triangles(node);
        // As doubles, which print all digits of the float that they come from.
        out["nodes"].push_back({{"node", node},
                                {"level", selection.levels[i]},
                                {"first_child", children.first},
                                {"child_count", children.count},
                                {"center", std::array<double, 3>{e.center.x, e.center.y, e.center.z}},
                                {"factor", std::array<double, 6>{e.l11, e.l21, e.l22, e.l31, e.l32, e.l33}},
                                {"radii", axes.radii},
                                {"rotation", axes.rotation}});
        if (tree.has_triangles()) {
            out["nodes"].back()["first_triangle"] = triangles.first;
            out["nodes"].back()["triangle_count"] = triangles.count;
        }
    }
    return out.dump(1) + '\n';
}

// The unit sphere as a mesh: an octahedron, each triangle split into four, three times.
struct Sphere {
    std::vector<std::array<double, 3>> vertices;
    std::vector<std::array<uint32_t, 3>> triangles;
};

Sphere unit_sphere() {
    Sphere s{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
             {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
    for (int round = 0; round < 3; ++round) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
        const auto middle = [&](uint32_t a, uint32_t b) {
            const auto [found, is_new] =
                middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(s.vertices.size()));
            if (is_new) {
                std::array<double, 3> m{};
                for (size_t i = 0; i < 3; ++i) m[i] = s.vertices[a][i] + s.vertices[b][i];
                const double length = std::hypot(m[0], m[1], m[2]);
                for (double& x : m) x /= length;
                s.vertices.push_back(m);
            }
            return found->second;
        };
        std::vector<std::array<uint32_t, 3>> finer;
        for (const auto& [a, b, c] : s.triangles) {
            const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
        }
        s.triangles = std::move(finer);
    }
    return s;
}

// Clearly different colors for any number of things: hues a golden angle apart.
std::array<unsigned char, 3> color(uint32_t index) {
    const double hue = std::fmod(index / std::numbers::phi, 1.0) * 6;
    std::array<unsigned char, 3> out{};
    for (size_t i = 0; i < 3; ++i) {
        const double away = std::abs(std::fmod(hue + 6 - 2.0 * static_cast<double>(i), 6.0) - 3); // 3 at the hue itself
        out[i] = static_cast<unsigned char>(std::lround(70 + 170 * std::clamp(away - 1, 0.0, 1.0)));
    }
    return out;
}

// For each node, by slot, the place of its level-1 ancestor among the root's children; 0 for the root.
std::vector<uint32_t> families(const TreeView& tree) {
    std::vector<uint32_t> family(tree.slot_count(), 0);
    tree.for_each_node([&](uint32_t node) { // parents come before children
        const ChildRange children = tree.children(node);
        for (uint32_t i = 0; i < children.count; ++i) family[children.first + i] = node == 0 ? i : family[node];
    });
    return family;
}

template <class T> void append_little_endian(std::string& out, T value) {
    const auto bits = std::bit_cast<uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8) out += static_cast<char>(bits >> shift & 0xff);
}

std::string as_ply(const TreeView& tree, const Selection& selection) {
    const Sphere sphere = unit_sphere();
    const std::vector<uint32_t> family = families(tree);
    const size_t count = selection.nodes.size();
    std::string out = fmt::format("ply\nformat binary_little_endian 1.0\ncomment prolate export\n"
                                  "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
                                  "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                  "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                                  count * sphere.vertices.size(), count * sphere.triangles.size());
    for (const uint32_t node : selection.nodes) {
        const Ellipsoid e = tree.ellipsoid(node);
        for (const auto& [x, y, z] : sphere.vertices) {
            append_little_endian(out, static_cast<float>(e.center.x + e.l11 * x));
            append_little_endian(out, static_cast<float>(e.center.y + e.l21 * x + e.l22 * y));
            append_little_endian(out, static_cast<float>(e.center.z + e.l31 * x + e.l32 * y + e.l33 * z));
            for (const unsigned char channel : color(family[node])) out += static_cast<char>(channel);
        }
    }
    for (uint32_t i = 0; i < count; ++i)
        for (const auto& triangle : sphere.triangles) {
            out += char{3};
            for (const uint32_t corner : triangle)
                append_little_endian(out, static_cast<uint32_t>(i * sphere.vertices.size()) + corner);
        }
    return out;
}

int run(const ExportArguments& a) {
    const std::string format = a.format.empty() ? extension(a.output) : a.format;
    if (format == "glb" || format == "pov" || format == "obj")
        return complain(kUsage, format, fmt::format("this version does not export {} yet", format),
                        "use csv, json or ply");
    if (format != "csv" && format != "json" && format != "ply")
        return complain(kUsage, format.empty() ? a.output : format,
                        format.empty() ? "the format is not clear from the name" : "no such export format",
                        "use csv, json or ply, as the extension or with --format");
    int code = check_output(a.output);
    if (code != kDone) return code;
    const auto tree = read_tree(a.tree, code);
    if (!tree) return code;
    const TreeView view = tree->view();
    if (a.level && *a.level >= view.level_count())
        return complain(kUsage, "--level", fmt::format("the tree has no level {}", *a.level),
                        fmt::format("its levels are 0 to {}", view.level_count() - 1));
    const auto cut = [&view](uint32_t level) {
        Selection out;
        add_cut(view, level, out);
        return out;
    };
    if (format == "ply") return write_output(a.output, as_ply(view, cut(a.level.value_or(view.level_count() - 1))));
    if (format == "csv") return write_output(a.output, as_csv(view, a.level ? cut(*a.level) : all_cuts(view)));
    return write_output(a.output, as_json(view, a.level ? cut(*a.level) : all_nodes(view)));
}

} // namespace

void add_export(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<ExportArguments>();
    CLI::App* command = app.add_subcommand("export", "Write a tree's ellipsoids as csv, json or ply");
    command->add_option("tree", a->tree, "the .etree file")->required();
    command->add_option("-o,--output", a->output, "the file to write, or - for standard output")->required();
    command->add_option("--format", a->format, "csv, json or ply (default: the output's extension)");
    command->add_option("--level", a->level, "export the cut at this level, 0 = the root");
    command->footer(kFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli

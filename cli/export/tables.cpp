// csv and json: the nodes in full precision.
#include "cli/export/formats.hpp"
#include "cli/generator.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <iterator>

namespace prolate::cli {

std::string as_csv(const TreeView& tree, const Selection& selection) {
    std::string out = "level,cx,cy,cz,r1,r2,r3,R11,R12,R13,R21,R22,R23,R31,R32,R33\n";
    for (size_t i = 0; i < selection.nodes.size(); ++i) {
        const Ellipsoid e = tree.ellipsoid(selection.nodes[i]);
        const PrincipalAxes axes = outer_axes(e);
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
    out["generator"] = generator();
    out["degree"] = tree.degree();
    out["levels"] = tree.level_count();
    out["precision"] = {{"center", "exact in single precision"},
                        {"factor", "exact in single precision"},
                        {"radii", "rounded up: they cover as read in double precision"},
                        {"rotation", "double precision"}};
    out["nodes"] = nlohmann::ordered_json::array();
    for (size_t i = 0; i < selection.nodes.size(); ++i) {
        const uint32_t node = selection.nodes[i];
        const Ellipsoid e = tree.ellipsoid(node);
        const PrincipalAxes axes = outer_axes(e);
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

} // namespace prolate::cli

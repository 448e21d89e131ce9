// csv and json: the nodes in full precision.
#include "cli/export/formats.hpp"
#include "cli/generator.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <iterator>

namespace prolate::cli {
namespace {

// The principal axes as printed, 17 digits of a double, with radii enlarged so that what a reader makes of them holds
// the decoded ellipsoid. G = diag(1/r) R^T L maps the unit ball to where the decoded ellipsoid is in the printed one's
// unit ball, and |G|^2 <= 1 + |G^T G - 1|. Rounding, here and at the reader's, costs less than 2^-46 r1 / r3.
PrincipalAxes outer_axes(const Ellipsoid& e) {
    PrincipalAxes axes = principal_axes(e);
    const double l[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}};
    double g[3][3] = {}, square = 0;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) g[i][j] += axes.rotation[k][i] * l[k][j] / axes.radii[i];
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const double entry = g[0][i] * g[0][j] + g[1][i] * g[1][j] + g[2][i] * g[2][j] - (i == j ? 1 : 0);
            square += entry * entry;
        }
    const double growth = 1 + std::sqrt(square) + 0x1p-46 * axes.radii[0] / axes.radii[2];
    for (double& radius : axes.radii) radius *= growth;
    return axes;
}

} // namespace

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

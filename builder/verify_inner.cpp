// The triangles are mapped to where the ellipsoid is the unit ball. There each must lie beyond a plane that the ball
// does not reach (obstacles.hpp). The plane's height is the least one of the triangle's corners, so whichever plane was
// found, the proof holds.
//
// Rounding: a mapped corner L^-1 (p - c) is off by a few 2^-53 |L^-1| times the largest coordinate, and times the axis
// ratio for the rounding of L^-1; 1e-12 of that coordinate is asked for, which suffices for axis ratios up to 1000.
// kRadial pays for the normal's length and the sums of its products.
#include "builder/verify_inner.hpp"

#include "builder/cover.hpp"
#include "builder/job.hpp"
#include "builder/obstacles.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace prolate {
namespace {

constexpr double kRounding = 1e-12; // of the largest coordinate
constexpr double kRadial = 1e-12;
constexpr double kMostRatio = 1000; // of axes; the proof does not hold beyond

} // namespace

double proof_margin(MeshView mesh) {
    double largest = 0;
    for (const Vec3& v : mesh.vertices) largest = std::max(largest, to_vec(v).cwiseAbs().maxCoeff());
    return kRounding * largest;
}

bool lies_inside(const Ellipsoid& ellipsoid, const Winding& winding, double margin) {
    const Fit fit(ellipsoid);
    if (!(fit.factor.norm() * fit.inverse.norm() <= 3 * kMostRatio)) return false; // of Frobenius norms: 3 for a ball
    const double room = clearance(fit, winding.tree(), 2);
    if (!(room >= 1 + kRadial + radial_margin(fit, margin))) return false;
    const std::optional<double> number = winding.whole(fit.center);
    return number && std::abs(*number) > 0.5;
}

void verify_inner(const TreeView& inner, MeshView mesh, double weld_distance, VerifyReport& report) {
    const Winding winding(mesh);
    const double margin = proof_margin(mesh) + weld_distance;
    std::vector<uint32_t> nodes;
    inner.for_each_node([&](uint32_t node) { nodes.push_back(node); });
    std::vector<char> inside(nodes.size());
    parallel_for(size_t{0}, nodes.size(),
                 [&](size_t i) { inside[i] = lies_inside(inner.ellipsoid(nodes[i]), winding, margin); });
    report.has_inner = true;
    const auto outside = std::find(inside.begin(), inside.end(), 0);
    report.inner_inside = outside == inside.end();
    report.protruding_node = report.inner_inside ? 0 : nodes[static_cast<size_t>(outside - inside.begin())];
}

} // namespace prolate

// Distances: nearest triangle of the builder's box hierarchy, O(log n) a lattice node. Outside volumes: the builder's
// columns, which measured the levels' figures too. Sub-volumes: one descent for each lattice node inside the solid.
#include "cli/view_tables.hpp"

#include "builder/columns.hpp"
#include "builder/winding.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::cli {
namespace {

constexpr int kColumnsAcross = 200;

Box box_of(const TreeView& tree, const Mesh& mesh) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    // The root sticks out by far the most, and would take the lattice's nodes away from where they are looked at.
    tree.for_each_node([&](uint32_t node) {
        if (node == 0 && tree.node_count() > 1) return;
        const Ellipsoid e = tree.ellipsoid(node);
        const Vec center = to_vec(e.center);
        const Vec half(e.l11, std::hypot(double{e.l21}, double{e.l22}),
                       std::hypot(double{e.l31}, double{e.l32}, double{e.l33}));
        box.add(center - half), box.add(center + half);
    });
    return box;
}

// How much of a lattice cell the solid fills, from the distance at its middle.
double filled(double distance, double pitch) {
    return std::clamp(0.5 - distance / pitch, 0.0, 1.0);
}

} // namespace

std::optional<DistanceLattice> distance_lattice(const TreeView& tree, const CleanMesh& mesh, uint32_t nodes,
                                                const std::function<bool(double)>& progress) {
    const Box box = box_of(tree, mesh.mesh);
    const Vec size = box.size().cwiseMax(1e-3 * box.size().maxCoeff());
    DistanceLattice out;
    out.pitch = std::cbrt(size.prod() / nodes);
    for (glm::length_t a = 0; a < 3; ++a) {
        // A step beyond the box on either side.
        out.size[static_cast<size_t>(a)] = static_cast<uint32_t>(std::ceil(size[a] / out.pitch)) + 3;
        out.origin[a] = box.center()[a] - 0.5 * out.pitch * (out.size[static_cast<size_t>(a)] - 1);
    }
    const uint32_t nx = out.size[0], ny = out.size[1], nz = out.size[2];
    out.distance.resize(size_t{nx} * ny * nz);
    const Winding winding(mesh.mesh.view());
    for (uint32_t k = 0; k < nz; ++k) {
        tbb::parallel_for(uint32_t{0}, ny, [&, k](uint32_t j) {
            for (uint32_t i = 0; i < nx; ++i) {
                const Vec p = Vec(out.origin.x, out.origin.y, out.origin.z) + out.pitch * Vec(i, j, k);
                const double distance = winding.tree().distance(p);
                const bool inside = std::abs(winding(p)) >= 0.5;
                out.distance[(size_t{k} * ny + j) * nx + i] = static_cast<float>(inside ? -distance : distance);
            }
        });
        if (!progress((k + 1.0) / nz)) return {};
    }
    return out;
}

NodeFigures node_figures(const TreeView& tree, const CleanMesh& mesh, const DistanceLattice& lattice) {
    NodeFigures out;
    std::vector<uint32_t> place(tree.slot_count(), 0); // of a slot in the tables
    std::vector<uint32_t> slots;
    tree.for_each_node([&](uint32_t node) {
        place[node] = static_cast<uint32_t>(slots.size());
        slots.push_back(node);
    });
    const Winding winding(mesh.mesh.view());
    const Columns columns = measuring_columns(mesh.mesh.view(), mesh.report.closed, winding, kColumnsAcross);
    out.outside_volume.resize(slots.size());
    tbb::parallel_for(size_t{0}, slots.size(), [&](size_t n) {
        const Ellipsoid e = tree.ellipsoid(slots[n]);
        out.outside_volume[n] = measure_cover(columns, {&e, 1}).sum_outside.value;
    });

    out.sub_volume.assign(slots.size(), 0);
    const auto [nx, ny, nz] = lattice.size;
    for (size_t at = 0; at < lattice.distance.size(); ++at) {
        const double share = filled(double{lattice.distance[at]}, lattice.pitch);
        if (share == 0) continue;
        const glm::dvec3 steps(at % nx, at / nx % ny, at / nx / ny);
        const glm::dvec3 p = lattice.origin + lattice.pitch * steps;
        const double point[3] = {p.x, p.y, p.z};
        for (uint32_t node = 0;;) {
            out.sub_volume[place[node]] += share;
            const ChildRange children = tree.children(node);
            if (children.count == 0) break;
            double least = std::numeric_limits<double>::infinity();
            for (uint32_t c = children.first; c < children.first + children.count; ++c)
                if (const double radial = radial_squared(tree.ellipsoid(c), point); radial < least)
                    least = radial, node = c;
        }
    }
    // The root stands for all of the solid, whose volume the columns know better than the lattice.
    const double scale = out.sub_volume[0] > 0 ? columns.volume().value / out.sub_volume[0] : 0;
    for (double& volume : out.sub_volume) volume *= scale;
    return out;
}

} // namespace prolate::cli

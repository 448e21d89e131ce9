// Distances: nearest triangle of the builder's box hierarchy, O(log n) a lattice node. Outside volumes: the builder's
// columns, which measured the levels' figures too. Sub-volumes: one descent for each lattice node inside the solid.
#include "cli/view/tables.hpp"

#include "cli/render/scene.hpp"

#include "builder/columns.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::cli {
namespace {

constexpr int kColumnsAcross = 200;

Box box_of(const TreeView& tree, const Mesh& mesh) {
    Box box;
    box.add(mesh.view());
    // The root sticks out by far the most, and would take the lattice's nodes away from where they are looked at.
    tree.for_each_node([&](uint32_t node) {
        if (node != 0 || tree.node_count() == 1) box.add(tree.ellipsoid(node));
    });
    return box;
}

// How much of a lattice cell the solid fills, from the distance at its middle.
double filled(double distance, double pitch) {
    return std::clamp(0.5 - distance / pitch, 0.0, 1.0);
}

} // namespace

std::optional<DistanceLattice> distance_lattice(const TreeView& tree, const CleanMesh& mesh, const Solid& solid,
                                                uint32_t nodes, const std::function<bool(double)>& progress) {
    const Box box = box_of(tree, mesh.mesh);
    const glm::dvec3 center = (box.low + box.high) / 2.0, extent = box.high - box.low;
    const glm::dvec3 size = glm::max(extent, glm::dvec3(1e-3 * std::max({extent.x, extent.y, extent.z})));
    DistanceLattice out;
    out.pitch = std::cbrt(size.x * size.y * size.z / nodes);
    for (glm::length_t a = 0; a < 3; ++a) {
        // A step beyond the box on either side.
        out.size[static_cast<size_t>(a)] = static_cast<uint32_t>(std::ceil(size[a] / out.pitch)) + 3;
        out.origin[a] = center[a] - 0.5 * out.pitch * (out.size[static_cast<size_t>(a)] - 1);
    }
    const uint32_t nx = out.size[0], ny = out.size[1], nz = out.size[2];
    out.distance.resize(size_t{nx} * ny * nz);
    for (uint32_t k = 0; k < nz; ++k) {
        tbb::parallel_for(uint32_t{0}, ny, [&, k](uint32_t j) {
            for (uint32_t i = 0; i < nx; ++i) {
                const glm::dvec3 p = out.origin + out.pitch * glm::dvec3(i, j, k);
                const double distance = solid.distance(p);
                out.distance[(size_t{k} * ny + j) * nx + i] = static_cast<float>(solid.holds(p) ? -distance : distance);
            }
        });
        if (!progress((k + 1.0) / nz)) return {};
    }
    return out;
}

NodeFigures node_figures(const TreeView& tree, const CleanMesh& mesh, const Solid& solid,
                         const DistanceLattice& lattice) {
    NodeFigures out;
    std::vector<uint32_t> place(tree.slot_count(), 0); // of a slot in the tables
    std::vector<uint32_t> slots;
    tree.for_each_node([&](uint32_t node) {
        place[node] = static_cast<uint32_t>(slots.size());
        slots.push_back(node);
    });
    const Columns columns = measuring_columns(mesh.mesh.view(), mesh.report.closed, &solid.winding(), kColumnsAcross);
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

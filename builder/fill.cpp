#include "builder/fill.hpp"

#include "builder/free_space.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {
namespace {

constexpr double kCells = 160;            // along the longest side of the mesh's box, ...
constexpr double kMostCells = 40;         // ... but no more than so many in the ball's radius
constexpr double kInside = 1 - 1e-9;      // a ball is over a cell that lies within so much of its radius
constexpr double kStepOfFloats = 0x1p-23; // of the largest coordinate: corners of cells are floats

using Flags = std::vector<uint8_t>; // of nodes, or of the cells around them

// The places that the ball gets to, by steps that are certainly free, from a corner of the lattice.
Flags places_of_ball(const FreeSpace& space, double radius) {
    std::array<double, kNeighbours> lengths; // of steps
    for (int n = 0; n < kNeighbours; ++n) {
        const std::array<int, 3> by = neighbour(n);
        lengths[static_cast<size_t>(n)] =
            space.pitch() * std::sqrt(std::abs(by[0]) + std::abs(by[1]) + std::abs(by[2]));
    }
    Flags reached(space.count(), 0);
    std::vector<size_t> waiting{0};
    reached[0] = 1;
    Checkpoints checkpoints;
    while (!waiting.empty()) {
        checkpoints();
        const size_t from = waiting.back();
        waiting.pop_back();
        space.for_each_neighbour(from, [&](int n, size_t to) {
            if (reached[to] || space.distance(to) < radius ||
                space.distance(from) + space.distance(to) - lengths[static_cast<size_t>(n)] < 2 * radius)
                return;
            reached[to] = 1;
            waiting.push_back(to);
        });
    }
    return reached;
}

// least(i) = min over m of cost(m) + value(i + m stride), for m of at most `reach` steps, along lines of `length`
// values.
void spread(std::span<float> values, size_t length, size_t stride, int reach, std::span<const float> cost) {
    const size_t lines = values.size() / length / stride; // groups of `stride` lines that lie side by side
    parallel_for(size_t{0}, lines, [&](size_t line) {
        float* const first = values.data() + line * length * stride;
        const std::vector<float> before(first, first + length * stride);
        for (size_t i = 0; i < length; ++i) {
            float* const to = first + i * stride;
            std::fill(to, to + stride, HUGE_VALF);
            const auto at = static_cast<int>(i);
            for (int m = std::max(0, at - reach); m <= std::min(static_cast<int>(length) - 1, at + reach); ++m) {
                const float* const from = before.data() + static_cast<size_t>(m) * stride;
                const float add = cost[static_cast<size_t>(std::abs(m - at))];
                for (size_t k = 0; k < stride; ++k) to[k] = std::min(to[k], from[k] + add);
            }
        }
    });
}

// The cells that the ball is never wholly over, with its center at any one of its places.
Flags unreached_cells(const FreeSpace& space, const Flags& places, double radius, double rounding) {
    // The farthest corner of the cell m steps away is (m + 1/2) steps away along that axis.
    const double steps = kInside * radius / space.pitch();
    const int reach = static_cast<int>(steps);
    std::vector<float> cost(static_cast<size_t>(reach) + 1);
    for (size_t m = 0; m < cost.size(); ++m) {
        const double far = static_cast<double>(m) + 0.5 + rounding / space.pitch();
        cost[m] = static_cast<float>(far * far);
    }
    std::vector<float> squared(space.count());
    for (size_t i = 0; i < squared.size(); ++i) squared[i] = places[i] ? 0 : HUGE_VALF;
    const auto nx = static_cast<size_t>(space.size()[0]), ny = static_cast<size_t>(space.size()[1]),
               nz = static_cast<size_t>(space.size()[2]);
    spread(squared, nz, 1, reach, cost);
    spread(squared, ny, nz, reach, cost);
    spread(squared, nx, ny * nz, reach, cost);
    Flags unreached(space.count());
    const auto limit = static_cast<float>(steps * steps * (1 - 1e-6)); // sums of floats: rounded by less than that
    for (size_t i = 0; i < unreached.size(); ++i) unreached[i] = !(squared[i] <= limit);
    return unreached;
}

// The border between cells that are set and cells that are not.
class Border {
public:
    Border(const FreeSpace& space, const Flags& cells) : space_(space), cells_(cells) {}

    Mesh mesh() {
        for (size_t axis = 0; axis < 3; ++axis)
            for (int slice = 1; slice < space_.size()[axis]; ++slice)
                for (const bool up : {false, true}) add_slice(axis, slice, up);
        return std::move(mesh_);
    }

private:
    bool is_set(size_t axis, int slice, int u, int v) const {
        std::array<int, 3> at{};
        at[axis] = slice, at[(axis + 1) % 3] = u, at[(axis + 2) % 3] = v;
        return cells_[space_.index(at[0], at[1], at[2])] != 0;
    }

    // The faces between cells slice - 1 and slice whose outside is above (`up`) or below, in rectangles: each as long
    // as it gets along v, then as wide as that lasts.
    void add_slice(size_t axis, int slice, bool up) {
        checkpoint();
        const int nu = space_.size()[(axis + 1) % 3], nv = space_.size()[(axis + 2) % 3];
        std::vector<uint8_t> open(static_cast<size_t>(nu) * static_cast<size_t>(nv));
        const auto face = [&](int u, int v) -> uint8_t& {
            return open[static_cast<size_t>(u) * static_cast<size_t>(nv) + static_cast<size_t>(v)];
        };
        for (int u = 0; u < nu; ++u)
            for (int v = 0; v < nv; ++v) {
                const bool below = is_set(axis, slice - 1, u, v), above = is_set(axis, slice, u, v);
                face(u, v) = up ? below && !above : above && !below;
            }
        for (int u = 0; u < nu; ++u)
            for (int v = 0; v < nv; ++v) {
                if (!face(u, v)) continue;
                int v_end = v, u_end = u + 1;
                while (v_end < nv && face(u, v_end)) ++v_end;
                const auto whole = [&](int row) {
                    for (int w = v; w < v_end; ++w)
                        if (!face(row, w)) return false;
                    return true;
                };
                while (u_end < nu && whole(u_end)) ++u_end;
                for (int row = u; row < u_end; ++row)
                    for (int w = v; w < v_end; ++w) face(row, w) = 0;
                add_rectangle(axis, slice, {u, u_end}, {v, v_end}, up);
            }
    }

    void add_rectangle(size_t axis, int slice, std::array<int, 2> u, std::array<int, 2> v, bool up) {
        const auto base = static_cast<uint32_t>(mesh_.vertices.size());
        for (const auto& [i, j] : {std::pair{0u, 0u}, {1u, 0u}, {1u, 1u}, {0u, 1u}}) { // counter-clockwise from above
            std::array<int, 3> at{};
            at[axis] = slice, at[(axis + 1) % 3] = u[i], at[(axis + 2) % 3] = v[j];
            const Vec p = space_.corner(at[0], at[1], at[2]);
            mesh_.vertices.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
        }
        const std::array<uint32_t, 4> turn = up ? std::array{0u, 1u, 2u, 3u} : std::array{0u, 3u, 2u, 1u};
        mesh_.triangles.push_back({base + turn[0], base + turn[1], base + turn[2]});
        mesh_.triangles.push_back({base + turn[0], base + turn[2], base + turn[3]});
    }

    const FreeSpace& space_;
    const Flags& cells_;
    Mesh mesh_;
};

} // namespace

double fill_pitch(const Box& box, double radius) {
    return round_pitch(std::max(box.size().maxCoeff() / kCells, radius / kMostCells));
}

Mesh fill(MeshView mesh, double radius) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    const double pitch = fill_pitch(box, radius);
    const Vec margin = Vec::Constant(radius + 2 * pitch);
    const Box region{box.low - margin, box.high + margin};
    const double rounding =
        kStepOfFloats * std::max(region.low.cwiseAbs().maxCoeff(), region.high.cwiseAbs().maxCoeff());
    const FreeSpace space(TriangleTree(mesh), region, pitch, radius, radius + pitch);
    const Flags places = places_of_ball(space, radius);
    const Flags cells = unreached_cells(space, places, radius, rounding);
    Mesh out = Border(space, cells).mesh();
    out.placement = mesh.placement;
    return out;
}

} // namespace prolate

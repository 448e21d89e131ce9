#include "builder/voxels.hpp"

#include "builder/clip.hpp"
#include "builder/job.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {
Voxels::Voxels(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    pitch_ = box.size().maxCoeff() / resolution;
    // A margin of a bit more than a cell: the border cells are empty, and grid planes keep off round coordinates.
    origin_ = box.low - Vec(1.13, 1.17, 1.19) * pitch_;
    for (size_t a = 0; a < 3; ++a)
        size_[a] = static_cast<int>(std::ceil((box.high[int(a)] - origin_[int(a)]) / pitch_)) + 1;
    collect_cells(mesh, closed, winding);
}

// Cuts each triangle along the grid planes it crosses: slabs in x, then bars in y, then cells in z.
// Calls visit(voxel, triangle, polygon) for each part.
template <class Visit> void Voxels::clip_triangles(MeshView mesh, Visit&& visit) const {
    // Cells whose closed extent meets [low, high]: a coordinate on a grid plane belongs to both sides.
    const auto range = [&](const Polygon& p, int axis) {
        double low = p[0][axis], high = low;
        for (const Vec& v : p) low = std::min(low, v[axis]), high = std::max(high, v[axis]);
        const double a = (low - origin_[axis]) / pitch_, b = (high - origin_[axis]) / pitch_;
        const int last = size_[static_cast<size_t>(axis)] - 1;
        int first_cell = std::clamp(static_cast<int>(std::floor(a)), 0, last);
        int last_cell = std::clamp(static_cast<int>(std::floor(b)), 0, last);
        while (first_cell > 0 && low <= origin_[axis] + first_cell * pitch_) --first_cell;
        while (last_cell < last && high >= origin_[axis] + (last_cell + 1) * pitch_) ++last_cell;
        return std::pair(first_cell, last_cell);
    };
    // Cuts `polygon` along `axis` and the axes after it; the scratch belongs to that axis alone.
    uint32_t triangle = 0;
    Polygon rest[3], part[3], next[3];
    const auto slice = [&](auto&& self, const Polygon& polygon, int axis, std::array<int, 3>& at) -> void {
        if (axis == 3) {
            visit(static_cast<uint32_t>(index(at[0], at[1], at[2])), triangle, polygon);
            return;
        }
        const auto a = static_cast<size_t>(axis);
        const auto [first, last] = range(polygon, axis);
        rest[a] = polygon;
        for (int c = first; c <= last && !rest[a].empty(); ++c) {
            at[a] = c;
            if (c < last) {
                split_polygon(rest[a], axis, origin_[axis] + (c + 1) * pitch_, part[a], next[a]);
                rest[a].swap(next[a]);
            } else {
                part[a].swap(rest[a]);
            }
            if (!part[a].empty()) self(self, part[a], axis + 1, at);
        }
    };
    for (; triangle < mesh.triangles.size(); ++triangle) {
        checkpoint();
        const Triangle& t = mesh.triangles[triangle];
        std::array<int, 3> at{};
        slice(slice, {to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]])}, 0, at);
    }
}

namespace {

// (voxel, value) pairs sorted by voxel, values of one voxel in the order in which they came.
template <class Value> struct Buckets {
    std::vector<size_t> begin;
    std::vector<Value> values;

    Buckets(std::vector<std::pair<uint32_t, Value>>&& pairs, size_t voxels) : begin(voxels + 1, 0) {
        for (const auto& pair : pairs) ++begin[pair.first + 1];
        for (size_t v = 0; v < voxels; ++v) begin[v + 1] += begin[v];
        values.resize(pairs.size());
        std::vector<size_t> fill(begin.begin(), begin.end() - 1);
        for (const auto& [voxel, value] : pairs) values[fill[voxel]++] = value;
        pairs = {};
    }
};

} // namespace

void Voxels::collect_cells(MeshView mesh, bool closed, const Winding& winding) {
    std::vector<std::pair<uint32_t, Vec>> corner_pairs;
    std::vector<std::pair<uint32_t, uint32_t>> triangle_pairs;
    clip_triangles(mesh, [&](uint32_t voxel, uint32_t triangle, const Polygon& polygon) {
        for (const Vec& v : polygon) corner_pairs.emplace_back(voxel, v);
        triangle_pairs.emplace_back(voxel, triangle);
    });
    const size_t voxels = index(size_[0] - 1, size_[1] - 1, size_[2] - 1) + 1;
    const Buckets clipped(std::move(corner_pairs), voxels);
    const Buckets crossing(std::move(triangle_pairs), voxels);

    // Corners inside the closed solid.
    const Columns corners(mesh, closed, &winding,
                          {origin_.x(), origin_.y(), pitch_, pitch_, size_[0] + 1, size_[1] + 1});
    const auto corner_index = [&](int i, int j, int k) {
        return (static_cast<size_t>(i) * static_cast<size_t>(size_[1] + 1) + static_cast<size_t>(j)) *
                   static_cast<size_t>(size_[2] + 1) +
               static_cast<size_t>(k);
    };
    std::vector<bool> inside(corner_index(size_[0], size_[1], size_[2]) + 1, false);
    const double tie = 1e-9 * pitch_; // a corner on the surface counts as inside
    for (int i = 0; i <= size_[0]; ++i)
        for (int j = 0; j <= size_[1]; ++j)
            for (const Interval& solid : corners.column(i, j)) {
                const int k1 =
                    std::min(static_cast<int>(std::floor((solid.high + tie - origin_.z()) / pitch_)), size_[2]);
                for (int k = std::max(static_cast<int>(std::ceil((solid.low - tie - origin_.z()) / pitch_)), 0);
                     k <= k1; ++k)
                    inside[corner_index(i, j, k)] = true;
            }

    cell_of_.assign(voxels, kNoCell);
    point_begin_.push_back(0);
    triangle_begin_.push_back(0);
    for (int i = 0; i < size_[0]; ++i)
        for (int j = 0; j < size_[1]; ++j, checkpoint())
            for (int k = 0; k < size_[2]; ++k) {
                const size_t v = index(i, j, k);
                std::vector<Vec>& out = points_;
                const size_t first = out.size();
                for (size_t p = clipped.begin[v]; p < clipped.begin[v + 1]; ++p) out.push_back(clipped.values[p]);
                for (int c = 0; c < 8; ++c) {
                    const int ci = i + (c & 1), cj = j + (c >> 1 & 1), ck = k + (c >> 2);
                    if (inside[corner_index(ci, cj, ck)]) out.push_back(origin_ + pitch_ * Vec(ci, cj, ck));
                }
                if (out.size() == first) continue;
                std::sort(out.begin() + static_cast<std::ptrdiff_t>(first), out.end(), lexicographically_before);
                out.erase(std::unique(out.begin() + static_cast<std::ptrdiff_t>(first), out.end()), out.end());
                cell_of_[v] = cell_count();
                coordinates_.push_back({i, j, k});
                point_begin_.push_back(out.size());
                for (size_t t = crossing.begin[v]; t < crossing.begin[v + 1]; ++t)
                    triangles_.push_back(crossing.values[t]);
                triangle_begin_.push_back(triangles_.size());
            }
}

} // namespace prolate

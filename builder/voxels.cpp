#include "builder/voxels.hpp"

#include "builder/clip.hpp"
#include "builder/random.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {
namespace {

constexpr int kSubColumns = 4; // columns per cell and axis, for the solid fractions

bool before(const Vec& a, const Vec& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

} // namespace

Voxels::Voxels(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    pitch_ = box.size().maxCoeff() / resolution;
    // A margin of a bit more than a cell: the border cells are empty, and grid planes keep off round coordinates.
    origin_ = box.low - Vec(1.13, 1.17, 1.19) * pitch_;
    for (size_t a = 0; a < 3; ++a)
        size_[a] = static_cast<int>(std::ceil((box.high[int(a)] - origin_[int(a)]) / pitch_)) + 1;
    measure_fractions(mesh, closed, winding);
    collect_cells(mesh, closed, winding);
    sample_begin_.assign(cell_count() + 1, 0);
}

void Voxels::measure_fractions(MeshView mesh, bool closed, const Winding& winding) {
    const double sub = pitch_ / kSubColumns;
    const Columns columns(
        mesh, closed, winding,
        {origin_.x() + 0.5 * sub, origin_.y() + 0.5 * sub, sub, sub, size_[0] * kSubColumns, size_[1] * kSubColumns});
    solid_volume_ = columns.volume();
    solid_.assign(static_cast<size_t>(size_[0]) * static_cast<size_t>(size_[1]) * static_cast<size_t>(size_[2]), 0);
    constexpr double kShare = 1.0 / (kSubColumns * kSubColumns);
    tbb::parallel_for(0, size_[0], [&](int i) {
        for (int j = 0; j < size_[1]; ++j)
            for (int s = 0; s < kSubColumns * kSubColumns; ++s)
                for (const Interval& solid :
                     columns.column(i * kSubColumns + s / kSubColumns, j * kSubColumns + s % kSubColumns)) {
                    const double low = (solid.low - origin_.z()) / pitch_, high = (solid.high - origin_.z()) / pitch_;
                    const int k1 = std::min(static_cast<int>(high), size_[2] - 1);
                    for (int k = std::max(static_cast<int>(low), 0); k <= k1; ++k)
                        solid_[index(i, j, k)] +=
                            static_cast<float>(kShare * (std::min(high, k + 1.0) - std::max(low, double(k))));
                }
    });
    below_.resize(solid_.size());
    for (int i = 0; i < size_[0]; ++i)
        for (int j = 0; j < size_[1]; ++j) {
            float sum = 0;
            for (int k = 0; k < size_[2]; ++k)
                below_[index(i, j, k)] = std::exchange(sum, sum + solid_[index(i, j, k)]);
        }
}

// Cuts each triangle along the grid planes it crosses: slabs in x, then bars in y, then cells in z.
void Voxels::clip_triangles(MeshView mesh, std::vector<std::pair<uint32_t, Vec>>& pieces) const {
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
    // Calls visit(cell, polygon) for the parts of `polygon` along `axis`; the scratch belongs to that axis alone.
    Polygon rest[3], part[3], next[3];
    const auto slice = [&](auto&& self, const Polygon& polygon, int axis, std::array<int, 3>& at) -> void {
        if (axis == 3) {
            const auto cell = static_cast<uint32_t>(index(at[0], at[1], at[2]));
            for (const Vec& v : polygon) pieces.emplace_back(cell, v);
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
    for (const Triangle& t : mesh.triangles) {
        std::array<int, 3> at{};
        slice(slice, {to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]])}, 0, at);
    }
}

void Voxels::collect_cells(MeshView mesh, bool closed, const Winding& winding) {
    std::vector<std::pair<uint32_t, Vec>> pieces;
    clip_triangles(mesh, pieces);
    const size_t voxels = solid_.size();
    std::vector<uint32_t> begin(voxels + 1, 0);
    for (const auto& piece : pieces) ++begin[piece.first + 1];
    for (size_t v = 0; v < voxels; ++v) begin[v + 1] += begin[v];
    std::vector<Vec> clipped(pieces.size());
    std::vector<uint32_t> fill(begin.begin(), begin.end() - 1);
    for (const auto& [cell, point] : pieces) clipped[fill[cell]++] = point;
    pieces = {};

    // Corners inside the closed solid.
    const Columns corners(mesh, closed, winding,
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
    for (int i = 0; i < size_[0]; ++i)
        for (int j = 0; j < size_[1]; ++j)
            for (int k = 0; k < size_[2]; ++k) {
                const size_t v = index(i, j, k);
                std::vector<Vec>& out = points_;
                const size_t first = out.size();
                out.insert(out.end(), clipped.begin() + begin[v], clipped.begin() + begin[v + 1]);
                const bool surface = out.size() > first;
                for (int c = 0; c < 8; ++c) {
                    const int ci = i + (c & 1), cj = j + (c >> 1 & 1), ck = k + (c >> 2);
                    if (inside[corner_index(ci, cj, ck)]) out.push_back(origin_ + pitch_ * Vec(ci, cj, ck));
                }
                if (out.size() == first) continue;
                std::sort(out.begin() + static_cast<std::ptrdiff_t>(first), out.end(), before);
                out.erase(std::unique(out.begin() + static_cast<std::ptrdiff_t>(first), out.end()), out.end());
                cell_of_[v] = cell_count();
                coordinates_.push_back({i, j, k});
                point_begin_.push_back(out.size());
                on_surface_.push_back(surface);
                Box box;
                for (size_t p = first; p < out.size(); ++p) box.add(out[p]);
                Ball ball{box.center(), 0};
                for (size_t p = first; p < out.size(); ++p)
                    ball.radius = std::max(ball.radius, (out[p] - ball.center).norm());
                balls_.push_back(ball);
            }
}

void Voxels::sample_surface(MeshView mesh, uint32_t count, uint64_t seed) {
    const auto corner = [&](const Triangle& t, size_t i) { return to_vec(mesh.vertices[t[i]]); };
    const auto area = [&](const Triangle& t) {
        return 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    };
    double total = 0;
    for (const Triangle& t : mesh.triangles) total += area(t);
    std::vector<std::pair<uint32_t, Vec>> found;
    Random random(seed);
    // Systematic sampling: one sample each time the running area passes a multiple of the step. Area-uniform, and no
    // region goes without.
    const double step = total / std::max(1u, count);
    double debt = random.uniform() * step;
    for (const Triangle& t : mesh.triangles) {
        debt += area(t);
        for (; debt >= step && step > 0; debt -= step) {
            double u = random.uniform(), v = random.uniform();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const Vec p = (1 - u - v) * corner(t, 0) + u * corner(t, 1) + v * corner(t, 2);
            const Vec at = (p - origin_) / pitch_;
            const uint32_t cell = cell_at(static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z()));
            if (cell != kNoCell) found.emplace_back(cell, p);
        }
    }
    sample_begin_.assign(cell_count() + 1, 0);
    for (const auto& sample : found) ++sample_begin_[sample.first + 1];
    for (uint32_t c = 0; c < cell_count(); ++c) sample_begin_[c + 1] += sample_begin_[c];
    samples_.resize(found.size());
    std::vector<size_t> fill(sample_begin_.begin(), sample_begin_.end() - 1);
    for (const auto& [cell, point] : found) samples_[fill[cell]++] = point;
}

std::vector<uint32_t> Voxels::hull_cells(std::span<const uint32_t> cells) const {
    std::vector<bool> member(cell_count(), false);
    for (const uint32_t cell : cells) member[cell] = true;
    const auto has = [&](int i, int j, int k) {
        const uint32_t cell = cell_at(i, j, k);
        return cell != kNoCell && member[cell];
    };
    std::vector<uint32_t> out;
    for (const uint32_t cell : cells) {
        const auto& [i, j, k] = coordinates_[cell];
        if (on_surface_[cell] || !has(i - 1, j, k) || !has(i + 1, j, k) || !has(i, j - 1, k) || !has(i, j + 1, k) ||
            !has(i, j, k - 1) || !has(i, j, k + 1))
            out.push_back(cell);
    }
    return out;
}

} // namespace prolate

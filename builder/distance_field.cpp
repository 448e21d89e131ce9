#include "builder/distance_field.hpp"

#include "builder/job.hpp"
#include "builder/triangle_tree.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr double kUnitsPerPitch = 256; // so distances of up to 128 steps are told apart

} // namespace

DistanceField::DistanceField(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    pitch_ = box.size().maxCoeff() / resolution;
    per_pitch_ = 1 / pitch_;
    // A margin of three steps: ellipsoids stick out, and lattice planes keep off round coordinates.
    origin_ = box.low - Vec(3.13, 3.17, 3.19) * pitch_;
    for (int a = 0; a < 3; ++a)
        size_[static_cast<size_t>(a)] = static_cast<int>(std::ceil((box.high[a] - origin_[a]) / pitch_)) + 4;
    const size_t nodes = index(size_[0] - 1, size_[1] - 1, size_[2] - 1) + 1;
    distance_.assign(nodes, HUGE_VALF);
    closest_.assign(nodes, Eigen::Vector3f::Zero());
    seed(mesh);
    propagate();
    closest_ = {};
    sign(mesh, closed, winding);
    gather_corners();
}

// Exact distances around each triangle, one step beyond its box: slabs of the lattice in parallel.
void DistanceField::seed(MeshView mesh) {
    constexpr int kSlab = 8;
    parallel_for(0, (size_[0] + kSlab - 1) / kSlab, [&](int slab) {
        const int first = slab * kSlab, last = std::min(first + kSlab, size_[0]) - 1;
        Checkpoints checkpoints;
        for (const Triangle& t : mesh.triangles) {
            checkpoints();
            const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
            const Vec low = (a.cwiseMin(b).cwiseMin(c) - origin_) * per_pitch_;
            const Vec high = (a.cwiseMax(b).cwiseMax(c) - origin_) * per_pitch_;
            const int i0 = std::max(static_cast<int>(low.x()), first);
            const int i1 = std::min(static_cast<int>(high.x()) + 1, last);
            for (int i = i0; i <= i1; ++i)
                for (int j = static_cast<int>(low.y()); j <= static_cast<int>(high.y()) + 1; ++j)
                    for (int k = static_cast<int>(low.z()); k <= static_cast<int>(high.z()) + 1; ++k) {
                        const Vec p = origin_ + pitch_ * Vec(i, j, k), q = nearest_point(p, a, b, c);
                        const auto distance = static_cast<float>((q - p).norm());
                        const size_t v = index(i, j, k);
                        if (distance < distance_[v])
                            distance_[v] = distance, closest_[v] = ((q - origin_) * per_pitch_).cast<float>();
                    }
        }
    });
}

// Each node takes over its neighbour's closest point if that is closer: along each axis, there and back, twice.
void DistanceField::propagate() {
    const auto offer = [this](size_t to, size_t from, int i, int j, int k) {
        if (distance_[from] == HUGE_VALF) return;
        const Eigen::Vector3f& q = closest_[from];
        const float x = q.x() - static_cast<float>(i), y = q.y() - static_cast<float>(j),
                    z = q.z() - static_cast<float>(k);
        const auto distance = static_cast<float>(double{std::sqrt(x * x + y * y + z * z)} * pitch_);
        if (distance < distance_[to]) distance_[to] = distance, closest_[to] = q;
    };
    for (int pass = 0; pass < 2; ++pass)
        for (size_t axis = 3; axis-- > 0;) {
            const size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
            parallel_for(0, size_[u], [&](int a) {
                for (int b = 0; b < size_[v]; ++b) {
                    int at[3];
                    at[u] = a, at[v] = b;
                    const auto step = [&](int to, int from) {
                        at[axis] = from;
                        const size_t source = index(at[0], at[1], at[2]);
                        at[axis] = to;
                        offer(index(at[0], at[1], at[2]), source, at[0], at[1], at[2]);
                    };
                    for (int c = 1; c < size_[axis]; ++c) step(c, c - 1);
                    for (int c = size_[axis] - 1; c-- > 0;) step(c, c + 1);
                }
            });
        }
}

void DistanceField::sign(MeshView mesh, bool closed, const Winding& winding) {
    const Columns columns(mesh, closed, &winding, {origin_.x(), origin_.y(), pitch_, pitch_, size_[0], size_[1]});
    for (int i = 0; i < size_[0]; ++i)
        for (int j = 0; j < size_[1]; ++j)
            for (const Interval& solid : columns.column(i, j)) {
                const int k1 =
                    std::min(static_cast<int>(std::floor((solid.high - origin_.z()) * per_pitch_)), size_[2] - 1);
                for (int k = std::max(static_cast<int>(std::ceil((solid.low - origin_.z()) * per_pitch_)), 0); k <= k1;
                     ++k)
                    distance_[index(i, j, k)] = -std::abs(distance_[index(i, j, k)]);
            }
}

void DistanceField::gather_corners() {
    unit_ = pitch_ / kUnitsPerPitch;
    const auto units = [this](int i, int j, int k) {
        const size_t v = index(std::min(i, size_[0] - 1), std::min(j, size_[1] - 1), k);
        const double rounded = std::floor(double{distance_[v]} * per_pitch_ * kUnitsPerPitch + 0.5);
        return static_cast<int16_t>(std::clamp<double>(rounded, INT16_MIN, INT16_MAX));
    };
    corners_.resize(distance_.size());
    parallel_for(0, size_[0], [&](int i) {
        for (int j = 0; j < size_[1]; ++j)
            for (int k = 0; k < size_[2]; ++k)
                corners_[index(i, j, k)] = {units(i, j, k), units(i, j + 1, k), units(i + 1, j, k),
                                            units(i + 1, j + 1, k)};
    });
}

} // namespace prolate

#include "tests/query/lane_references.hpp"

#include "src/bytes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

float sum_of_squares(float x, float y, float z) {
    return x * x + y * y + z * z;
}
float dot(float x, float y, float z, float u, float v, float w) {
    return x * u + y * v + z * w;
}

float entry_sum(const LaneNode& e) {
    return e.l11 + e.l22 + e.l33 + (std::abs(e.l21) + std::abs(e.l31) + std::abs(e.l32));
}

// |L^T n|
float width(const LaneNode& e, float x, float y, float z) {
    const float along[3] = {dot(e.l11, e.l21, e.l31, x, y, z), e.l22 * y + e.l32 * z, e.l33 * z};
    return std::sqrt(sum_of_squares(along[0], along[1], along[2]));
}

float size_of(const LaneNode& e) {
    const float xx = e.l11 * e.l11, yy = e.l21 * e.l21 + e.l22 * e.l22;
    return std::sqrt(xx + yy + dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33));
}

// The direction n = adj(Q) r of query/node/lanes-inl.hpp, r, and |L2|.
struct Proposal {
    float n[3], r[3], size;
};
Proposal propose(const LaneNode& e, const Single& s) {
    const float xx = e.l11 * e.l11, yx = e.l21 * e.l11, zx = e.l31 * e.l11;
    const float yy = e.l21 * e.l21 + e.l22 * e.l22, zy = e.l31 * e.l21 + e.l32 * e.l22;
    const float zz = dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33), size = size_of(e);
    const float w2 = 1 / (size * (size + s.size)), weight = size * w2 * s.weight;
    const auto mix = [&](float q1, float q2) { return weight * q1 + w2 * q2; };
    const float qxx = mix(s.diagonal[0], xx), qyy = mix(s.diagonal[1], yy), qzz = mix(s.diagonal[2], zz);
    const float qyz = mix(s.off_diagonal[1], zy), qxz = mix(s.off_diagonal[2], zx), qxy = mix(s.off_diagonal[0], yx);
    const float rx = e.center[0] - s.center[0], ry = e.center[1] - s.center[1], rz = e.center[2] - s.center[2];
    const float axx = qyy * qzz - qyz * qyz, ayy = qxx * qzz - qxz * qxz, azz = qxx * qyy - qxy * qxy;
    const float axy = qxz * qyz - qxy * qzz, axz = qxy * qyz - qxz * qyy, ayz = qxy * qxz - qxx * qyz;
    return {{dot(axx, axy, axz, rx, ry, rz), dot(axy, ayy, ayz, rx, ry, rz), dot(axz, ayz, azz, rx, ry, rz)},
            {rx, ry, rz},
            size};
}

} // namespace

LaneGap lane_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const Single& s) {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto [n, r, size] = propose(e, s);
    const float x = n[0], y = n[1], z = n[2];
    const auto along = [&](size_t c) { return dot(s.factor[c][0], s.factor[c][1], s.factor[c][2], x, y, z); };
    const float a = std::sqrt(sum_of_squares(along(0), along(1), along(2)));
    const float p = dot(x, y, z, r[0], r[1], r[2]), sum = a + width(e, x, y, z);
    const float length = std::abs(x) + std::abs(y) + std::abs(z);
    const float gap = p - sum - (s.slack + kLaneMargin * size) * length;
    return {length > kLaneDirection ? gap : 0, sum_of_squares(x, y, z), p / sum, size};
}

float hull_reach(const std::byte* hull, const float (&v)[3], float width) {
    float most = -HUGE_VALF;
    for (size_t i = 0; i < kHullPoints; ++i) {
        const auto along = [&](size_t k) {
            return static_cast<float>(load_le<int8_t>(hull + kHullPoint + kHullPoints * k + i)) * v[k];
        };
        most = std::max(most, along(0) + along(1) + along(2));
    }
    const auto share = static_cast<float>(load_le<uint8_t>(hull + kHullShare));
    return share > 0 ? most * kPerHullUnit + share * kPerHullShare * width : width;
}

AxisMask axis_mask(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticePoint& point,
                   uint32_t axis) {
    const LaneNode e = load_node(block, lane, step_exponent);
    const float factor[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}; // rows
    float r[3];
    for (size_t i = 0; i < 3; ++i) r[i] = e.center[i] - point.position[i];
    const size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    // Products with the zeros of the factor change nothing.
    const auto row_product = [&](size_t p, size_t q) {
        return dot(factor[p][0], factor[p][1], factor[p][2], factor[q][0], factor[q][1], factor[q][2]);
    };
    const float a = row_product(i, i), b = row_product(i, j), c = row_product(j, j);
    const float si = r[i] * kAxisScale, sj = r[j] * kAxisScale;
    const float ni = c * si - b * sj, nj = a * sj - b * si;
    float along[3];
    for (size_t k = 0; k < 3; ++k) along[k] = factor[i][k] * ni + factor[j][k] * nj;
    const float margin = point.slack + kLaneMargin * entry_sum(e), length = std::abs(ni) + std::abs(nj);
    const float width = std::sqrt(sum_of_squares(along[0], along[1], along[2]));
    const float g = (ni * r[i] + nj * r[j]) - width - margin * length;
    if (g > 0 && length > kLaneDirection) return {0, 0};
    const float widened = std::sqrt(row_product(axis, axis)) + margin;
    return {!(widened + r[axis] < 0), !(widened - r[axis] < 0)};
}

float box_entry(const std::byte* block, uint32_t lane, const LatticeRay& ray, float limit) {
    const BlockBoxes boxes(block);
    float enter = 0, leave = limit;
    for (size_t i = 0; i < 3; ++i) {
        const auto side = [&](size_t at) {
            return static_cast<float>(load_le<uint8_t>(block + at + kBlockLanes * i + lane));
        };
        const float inverse = ray.inverse[i], per_step = inverse * boxes.step(i);
        const float begins = static_cast<float>(boxes.origin(i)) - ray.origin[i];
        const float parameter = begins * inverse;
        const float margin = (ray.thickness + ray.slack) * std::abs(inverse) + kLaneMargin * std::abs(parameter);
        const bool forward = !(inverse < 0);
        const float near = parameter - margin, far = parameter + margin;
        const float in = side(forward ? kBlockBoxLow : kBlockBoxHigh) * per_step + near;
        const float out = side(forward ? kBlockBoxHigh : kBlockBoxLow) * per_step + far;
        if (in > enter) enter = in;
        if (out < leave) leave = out;
    }
    return enter > leave ? std::numeric_limits<float>::infinity() : enter;
}

float ray_entry(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticeRay& ray, float limit) {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto& s = ray.span;
    const float rx = e.center[0] - ray.origin[0], ry = e.center[1] - ray.origin[1], rz = e.center[2] - ray.origin[2];
    const float i1 = 1 / e.l11, i2 = 1 / e.l22, i3 = 1 / e.l33;
    const float y1 = rx * i1, y2 = (ry - e.l21 * y1) * i2, y3 = (rz - e.l31 * y1 - e.l32 * y2) * i3;
    const float v1 = s[0] * i1, v2 = (s[1] - e.l21 * v1) * i2, v3 = (s[2] - e.l31 * v1 - e.l32 * v2) * i3;
    const float vv = sum_of_squares(v1, v2, v3), nearest = dot(y1, y2, y3, v1, v2, v3) / vv;
    const float m1 = y1 - nearest * v1, m2 = y2 - nearest * v2, m3 = y3 - nearest * v3;
    const float outside = sum_of_squares(m1, m2, m3), inside = 1 - outside > 0 ? 1 - outside : 0;
    const float back = std::sqrt(inside / vv);
    const bool ahead = nearest > back;
    const float z1 = ahead ? m1 + back * v1 : y1, z2 = ahead ? m2 + back * v2 : y2, z3 = ahead ? m3 + back * v3 : y3;
    const float nz = z3 * i3, ny = (z2 - e.l32 * nz) * i2, nx = (z1 - e.l21 * ny - e.l31 * nz) * i1;
    const float width =
        std::sqrt(sum_of_squares(dot(e.l11, e.l21, e.l31, nx, ny, nz), e.l22 * ny + e.l32 * nz, e.l33 * nz));
    const float length = std::abs(nx) + std::abs(ny) + std::abs(nz), margin = ray.slack + kLaneMargin * entry_sum(e);
    float g = dot(nx, ny, nz, rx, ry, rz) - width - margin * length;
    if (ray.thickness > 0) g -= ray.thickness * std::sqrt(sum_of_squares(nx, ny, nz));
    const float along = dot(nx, ny, nz, s[0], s[1], s[2]);
    if (!(length > kLaneDirection && g > 0)) return 0;
    if (g > limit * along) return std::numeric_limits<float>::infinity();
    return along > 0 ? g / along : 0;
}

ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneRoundedBox& box) {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto [n, r, size] = propose(e, box.single);
    const float x = n[0], y = n[1], z = n[2];
    const auto along = [&](const float(&edge)[3]) { return std::abs(dot(edge[0], edge[1], edge[2], x, y, z)); };
    const float edges = along(box.edges[0]) + along(box.edges[1]) + along(box.edges[2]);
    const float round = box.radius * std::sqrt(sum_of_squares(x, y, z));
    const float p = dot(x, y, z, r[0], r[1], r[2]), sum = width(e, x, y, z) + (edges + round);
    const float length = std::abs(x) + std::abs(y) + std::abs(z);
    const float gap = p - sum - (box.slack + kLaneMargin * size) * length;
    return {length > kLaneDirection ? gap : 0, p / sum};
}

ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneHalfSpace& h) {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto& n = h.normal;
    const float height = dot(n[0], n[1], n[2], e.center[0], e.center[1], e.center[2]) - h.offset;
    const float low = height - width(e, n[0], n[1], n[2]);
    return {low - (h.slack + kLaneMargin * size_of(e)), low};
}

} // namespace prolate::query

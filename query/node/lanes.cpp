#include "query/node/lanes.hpp"

#include "src/block_box.hpp"

#include <glm/mat3x3.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace prolate::query {

namespace {

// What a node's box says, in coordinates of its own tree: center and half the width.
struct LaneBox {
    float center[3], half[3];
};
LaneBox box_of(const std::byte* block, uint32_t lane) {
    const BlockBoxes boxes(block);
    LaneBox out;
    for (size_t i = 0; i < 3; ++i) {
        const int32_t low = boxes.low(i, lane), high = boxes.high(i, lane);
        const float half_step = boxes.half_step(i);
        out.center[i] = static_cast<float>(boxes.origin(i)) + static_cast<float>(low + high) * half_step;
        out.half[i] = static_cast<float>(high - low) * half_step + (kBoxMargin * std::abs(out.center[i]) + kBoxSlack);
    }
    return out;
}

// All that follows from the center and the factor.
void complete(double reach, Single& s) {
    const auto& f = s.factor;
    for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3;
        s.diagonal[i] = f[0][i] * f[0][i] + f[1][i] * f[1][i] + f[2][i] * f[2][i];
        s.off_diagonal[i] = f[0][i] * f[0][j] + f[1][i] * f[1][j] + f[2][i] * f[2][j];
    }
    s.size = std::sqrt(s.diagonal[0] + s.diagonal[1] + s.diagonal[2]);
    s.weight = 1 / s.size;
    const float center = std::abs(s.center[0]) + std::abs(s.center[1]) + std::abs(s.center[2]);
    s.slack = kLaneMargin * (center + s.size) + common_slack(reach);
    s.reach = reach;
    for (size_t i = 0; i < 3; ++i) {
        const float half = std::sqrt(s.diagonal[i]) + s.slack; // slack is far above what rounding costs here
        s.low[i] = s.center[i] - half, s.high[i] = s.center[i] + half;
    }
}

} // namespace

Single place(const std::byte* block, uint32_t lane, const LatticePose& pose, PlacedBox* placed_box) noexcept {
    const LaneNode e = load_node(block, lane, pose.exponent_from);
    const LaneBox box = box_of(block, lane);
    Single s{};
    const auto& m = pose.linear;
    const auto& r = pose.linear_rounded;
    const double x = e.center[0], y = e.center[1], z = e.center[2];
    for (size_t i = 0; i < 3; ++i) {
        s.exact[i] = (m[0][i] * x + m[1][i] * y) + (m[2][i] * z + pose.offset[i]);
        s.center[i] = static_cast<float>(s.exact[i]);
        s.factor[0][i] = r[0][i] * e.l11 + r[1][i] * e.l21 + r[2][i] * e.l31;
        s.factor[1][i] = r[1][i] * e.l22 + r[2][i] * e.l32;
        s.factor[2][i] = r[2][i] * e.l33;
    }
    complete(pose.reach, s);
    // Cut with the box around the node's own box, as it lies in these coordinates.
    float away[3];
    for (size_t i = 0; i < 3; ++i) away[i] = box.center[i] - e.center[i];
    float turned[3], around[3]; // the box's center, and half the sides of the box around it
    for (size_t i = 0; i < 3; ++i) {
        turned[i] = r[0][i] * away[0] + r[1][i] * away[1] + r[2][i] * away[2];
        around[i] = std::abs(r[0][i]) * box.half[0] + std::abs(r[1][i]) * box.half[1] + std::abs(r[2][i]) * box.half[2];
        const float at = s.center[i] + turned[i], half = s.slack + around[i];
        if (at - half > s.low[i]) s.low[i] = at - half;
        if (at + half < s.high[i]) s.high[i] = at + half;
    }
    if (placed_box == nullptr) return s;
    for (size_t i = 0; i < 3; ++i) {
        placed_box->center[i] = turned[i];
        for (size_t c = 0; c < 3; ++c) placed_box->axis[c][i] = r[c][i] * box.half[c];
    }
    const auto farthest = [&](size_t i) { return std::abs(turned[i]) + around[i]; };
    placed_box->slack = kLaneMargin * (farthest(0) + farthest(1) + farthest(2));
    return s;
}

Single place(const PlacedEllipsoid& ellipsoid, const LatticeInfo& lattice) noexcept {
    const double per_step = steps_per_metre(lattice);
    Single s{};
    double reach = ellipsoid.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const auto g = static_cast<glm::length_t>(i);
        s.exact[i] = ellipsoid.center[g] * per_step - lattice.origin[i];
        s.center[i] = static_cast<float>(s.exact[i]);
        reach += std::abs(static_cast<double>(lattice.origin[i]));
        for (size_t column = 0; column < 3; ++column)
            s.factor[column][i] =
                static_cast<float>(ellipsoid.factor[static_cast<glm::length_t>(column)][g] * per_step);
    }
    complete(reach, s);
    return s;
}

bool boxes_apart(const std::byte* block, uint32_t lane, const Single& s, float margin) noexcept {
    const BlockBoxes boxes(block);
    bool apart = false;
    for (size_t i = 0; i < 3; ++i) {
        const auto origin = static_cast<float>(boxes.origin(i));
        const float low = ((s.low[i] - margin) - origin) * boxes.per_step(i),
                    high = ((s.high[i] + margin) - origin) * boxes.per_step(i);
        const float least = std::min(low > 0 ? low + kAlmostOne : 0.0f, 256.0f);
        const float most = std::max(high < 255 ? high : 255.0f, -1.0f);
        apart |= boxes.high(i, lane) < static_cast<int32_t>(least) || boxes.low(i, lane) > static_cast<int32_t>(most);
    }
    return apart;
}

} // namespace prolate::query

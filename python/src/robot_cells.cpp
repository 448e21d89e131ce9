// Which cells meet, and which balls certainly do.
//
// Two boxes are apart if they are along one of their six axes (S. Gottschalk, M. C. Lin, D. Manocha, "OBBTree: A
// Hierarchical Structure for Rapid Interference Detection", SIGGRAPH 1996, less the nine axes across edges). All of
// this is in single precision. Entries of a FloatPlace are off by 8 u, u = 2^-24, sums of three products by 4 u more,
// so a gap along a unit vector is wrong by less than 32 u times the sum of the lengths involved; 2^-18 of it is
// demanded (kBoxSlack).
#include "python/src/robot_cells.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::python {
namespace {

// A box in the frame of other cells: each column of `edge` is an axis times the half extent.
struct PlacedCell {
    float center[3], axis[3][3], half[3], extent[3]; // axis[i] is a unit vector; extent: half of the box around it
};

PROLATE_ROBOT_INLINE PlacedCell placed(const Cell& cell, const FloatPlace& at, float margin) {
    PlacedCell out{};
    float size = margin;
    for (size_t k = 0; k < 3; ++k) {
        out.center[k] =
            at.r[k][0] * cell.center[0] + at.r[k][1] * cell.center[1] + at.r[k][2] * cell.center[2] + at.t[k];
        size += std::abs(at.t[k]) + std::abs(cell.center[k]) + cell.half[k];
    }
    const float more = margin + kBoxSlack * size;
    for (size_t i = 0; i < 3; ++i) out.half[i] = cell.half[i] + more;
    for (size_t k = 0; k < 3; ++k) {
        out.extent[k] = more;
        for (size_t i = 0; i < 3; ++i) {
            out.axis[i][k] = at.r[k][i];
            out.extent[k] += std::abs(at.r[k][i]) * cell.half[i];
        }
    }
    return out;
}

PROLATE_ROBOT_INLINE uint32_t meeting(const CellBlock& block, const PlacedCell& b) {
    const Floats zero{};
    const Floats3 d = {block.center.x - b.center[0], block.center.y - b.center[1], block.center.z - b.center[2]};
    Floats gap =
        greater(greater(absolute(d.x) - (block.half.x + b.extent[0]), absolute(d.y) - (block.half.y + b.extent[1])),
                absolute(d.z) - (block.half.z + b.extent[2]));
    // What the block's own numbers add to the error.
    const Floats reach = (block.half.x + block.half.y + block.half.z + absolute(block.center.x) +
                          absolute(block.center.y) + absolute(block.center.z)) *
                         kBoxSlack;
    for (size_t i = 0; i < 3; ++i) {
        const float* const n = b.axis[i];
        const Floats along = absolute(d.x * n[0] + d.y * n[1] + d.z * n[2]);
        const Floats half =
            block.half.x * std::abs(n[0]) + block.half.y * std::abs(n[1]) + block.half.z * std::abs(n[2]);
        gap = greater(gap, along - (half + b.half[i]));
    }
    return bits(!(gap - reach > zero));
}

struct Entry {
    uint32_t a, b;
};

float size_of(const Cell& cell) noexcept {
    return cell.half[0] + cell.half[1] + cell.half[2];
}

// A search that has this many pairs open says that the bodies may meet.
constexpr size_t kMostOpen = 1024;

PROLATE_ROBOT_CLONES bool search(const Cells& a, const Cells& b, const FloatPlace& b_in_a, const FloatPlace& a_in_b,
                                 const float& margin, LeafVisitor* visitor) {
    Entry open[kMostOpen];
    size_t count = 1;
    open[0] = {Cells::kRoot, Cells::kRoot};
    while (count > 0) {
        const Entry at = open[--count];
        const uint32_t below_a = a.children(at.a), below_b = b.children(at.b);
        if (below_a == Cells::kLeaf && below_b == Cells::kLeaf) {
            if (!visitor || visitor->meets(at.a, at.b)) return true;
            continue;
        }
        if (count + kLanes > kMostOpen) return true;
        const Cell cell_a = a.cell(at.a), cell_b = b.cell(at.b);
        const bool open_a = below_b == Cells::kLeaf || (below_a != Cells::kLeaf && size_of(cell_a) >= size_of(cell_b));
        const uint32_t block = open_a ? below_a : below_b;
        uint32_t meets = open_a ? meeting(a.blocks[block], placed(cell_b, b_in_a, margin))
                                : meeting(b.blocks[block], placed(cell_a, a_in_b, margin));
        for (; meets != 0; meets &= meets - 1) {
            const auto child = static_cast<uint32_t>(kLanes * block) + static_cast<uint32_t>(__builtin_ctz(meets));
            open[count++] = open_a ? Entry{child, at.b} : Entry{at.a, child};
        }
    }
    return false;
}

PROLATE_ROBOT_CLONES bool balls_meet(const std::vector<BallBlock>& a, const std::vector<BallBlock>& b,
                                     const FloatPlace& at) {
    const Floats zero{};
    for (const BallBlock& others : b)
        for (size_t i = 0; i < kLanes && others.radius[i] > 0; ++i) {
            const float x = others.center.x[i], y = others.center.y[i], z = others.center.z[i];
            float c[3], size = 0;
            for (size_t k = 0; k < 3; ++k) {
                c[k] = at.r[k][0] * x + at.r[k][1] * y + at.r[k][2] * z + at.t[k];
                size += std::abs(at.t[k]);
            }
            size += std::abs(x) + std::abs(y) + std::abs(z);
            for (const BallBlock& balls : a) {
                const Floats3& center = balls.center;
                const Floats3 d = {center.x - c[0], center.y - c[1], center.z - c[2]};
                const Floats reach = absolute(center.x) + absolute(center.y) + absolute(center.z) + size;
                const Floats near = balls.radius + others.radius[i] - reach * kBoxSlack;
                if (bits((balls.radius > zero) & (near > zero) & (dot(d, d) < near * near)) != 0) return true;
            }
        }
    return false;
}

PROLATE_ROBOT_CLONES bool inner_meets(const BallBlock* balls, size_t count, const float (&half)[3],
                                      const FloatPlace& box) {
    const float size_of_box =
        std::abs(box.t[0]) + std::abs(box.t[1]) + std::abs(box.t[2]) + half[0] + half[1] + half[2];
    for (const BallBlock* ball = balls; ball != balls + count; ++ball) {
        const Floats zero{};
        const Floats3& c = ball->center;
        const Floats3 d = {c.x - box.t[0], c.y - box.t[1], c.z - box.t[2]};
        Floats squares = zero;
        for (size_t i = 0; i < 3; ++i) {
            const Floats along = absolute(d.x * box.r[0][i] + d.y * box.r[1][i] + d.z * box.r[2][i]);
            const Floats beyond = at_least_0(along - half[i]);
            squares = squares + beyond * beyond;
        }
        const Floats size = absolute(c.x) + absolute(c.y) + absolute(c.z) + size_of_box;
        const Floats radius = ball->radius - size * kBoxSlack;
        if (bits((radius > zero) & (squares < radius * radius)) != 0) return true;
    }
    return false;
}

} // namespace

FloatPlace float_place(const Pose& pose) noexcept {
    const Quat& q = pose.rotation;
    const float s = 2 / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return {{{1 - s * (q.y * q.y + q.z * q.z), s * (q.x * q.y - q.z * q.w), s * (q.x * q.z + q.y * q.w)},
             {s * (q.x * q.y + q.z * q.w), 1 - s * (q.x * q.x + q.z * q.z), s * (q.y * q.z - q.x * q.w)},
             {s * (q.x * q.z - q.y * q.w), s * (q.y * q.z + q.x * q.w), 1 - s * (q.x * q.x + q.y * q.y)}},
            {pose.translation.x, pose.translation.y, pose.translation.z}};
}

FloatPlace inverse(const FloatPlace& place) noexcept {
    FloatPlace out{};
    for (size_t i = 0; i < 3; ++i)
        for (size_t k = 0; k < 3; ++k) {
            out.r[i][k] = place.r[k][i];
            out.t[i] -= place.r[k][i] * place.t[k];
        }
    return out;
}

Cell Cells::cell(uint32_t node) const noexcept {
    if (node == kRoot) return root;
    const CellBlock& block = blocks[node / kLanes];
    const size_t i = node % kLanes;
    return {{block.center.x[i], block.center.y[i], block.center.z[i]},
            {block.half.x[i], block.half.y[i], block.half.z[i]}};
}

bool cells_meet(const Cells& a, const Cells& b, const FloatPlace& b_in_a, const float& margin, LeafVisitor* visitor) {
    return search(a, b, b_in_a, inverse(b_in_a), margin, visitor);
}

bool inner_meets_inner(const Cells& a, const Cells& b, const FloatPlace& b_in_a) {
    return balls_meet(a.inner, b.inner, b_in_a);
}

bool inner_meets_box(const Cells& a, const std::array<float, 3>& half, const FloatPlace& b_in_a) {
    return inner_meets(a.inner.data(), a.inner.size(), {half[0], half[1], half[2]}, b_in_a);
}

} // namespace prolate::python

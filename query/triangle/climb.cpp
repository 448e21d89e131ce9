#include "query/triangle/climb.hpp"

#include "query/ellipsoid/placed.hpp"
#include "src/block_box.hpp"
#include "src/bytes.hpp"
#include "src/power_of_two.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

// A point in lattice coordinates of a tree, for tests against nodes' boxes.
class BoxProbe {
public:
    BoxProbe(const LatticeInfo& lattice, const Vec3& p) { // as stored
        const double per_step = power_of_two(-lattice.step_exponent);
        const float metres[3] = {p.x, p.y, p.z};
        for (size_t i = 0; i < 3; ++i) at_[i] = double{metres[i]} * per_step - lattice.origin[i];
    }
    // Bit i: the box of lane i may hold the point.
    uint32_t lanes(const std::byte* block) const {
        const BlockBoxes boxes(block);
        uint32_t out = 0xff;
        for (size_t i = 0; i < 3; ++i) {
            const double per_step = boxes.per_step(i), x = at_[i] - boxes.origin(i);
            // Box steps, the whole ones below and above: rounding is far below the slack.
            const int32_t below = static_cast<int32_t>(std::clamp((x + kSlack) * per_step, -1.0, 255.0) + 1) - 1,
                          above = 256 - static_cast<int32_t>(256 - std::clamp((x - kSlack) * per_step, 0.0, 256.0));
            uint32_t held = 0;
            for (size_t lane = 0; lane < kBlockLanes; ++lane)
                held |= static_cast<uint32_t>(boxes.low(i, lane) <= below && boxes.high(i, lane) >= above) << lane;
            out &= held;
        }
        return out;
    }

private:
    static constexpr double kSlack = 0x1p-10; // lattice steps
    double at_[3];
};

} // namespace

double Hills::height(uint32_t vertex, const dvec3& up) const noexcept {
    return glm::dot(up, to_double(tree_.vertex(vertex))) * double{tree_.scale()};
}

// Calls visit(corners) for each triangle that has this vertex.
template <class Visit> void Hills::triangles_at(uint32_t vertex, Visit&& visit) const {
    if (tests_ > most_tests_) return;
    Known& known = known_[vertex % kKnown];
    if (known.vertex == vertex) {
        tests_ += known.tests;
        for (uint32_t i = 0; i < known.count; ++i) visit(tree_.triangle(known.triangles[i]));
        return;
    }
    const uint64_t before = tests_;
    known.vertex = vertex, known.count = 0;
    const BoxProbe probe(tree_.raw().lattice(), tree_.vertex(vertex));
    struct Family {
        uint32_t first, left; // siblings from slot `first` on
    };
    Family stack[(kBlockLanes + 1) * kMaxLevels]; // of each level, the children of one block wait, and the rest of one
    uint32_t size = 0;
    stack[size++] = {0, 1};
    while (size > 0) {
        Family& family = stack[size - 1];
        const uint32_t first = family.first, count = std::min(family.left, kBlockLanes);
        family.first += kBlockLanes, family.left -= count;
        if (family.left == 0) --size;
        tests_ += count;
        const std::byte* const block = tree_.raw().block(first / kBlockLanes);
        const uint32_t held = probe.lanes(block);
        for (uint32_t lane = 0; lane < count; ++lane) {
            if ((held >> lane & 1) == 0) continue;
            const uint32_t children = load_le<uint8_t>(block + kBlockCount + lane);
            if (children < kTriangleLeaf) {
                stack[size++] = {first_child(block, lane), children};
                continue;
            }
            const uint32_t begin = first_triangle(block, lane), triangles = children - kTriangleLeaf;
            tests_ += triangles;
            for (uint32_t t = begin; t < begin + triangles; ++t) {
                const Triangle corners = tree_.triangle(t);
                if (std::find(corners.begin(), corners.end(), vertex) == corners.end()) continue;
                if (known.count < Known::kMost) known.triangles[known.count] = t;
                ++known.count;
                visit(corners);
            }
        }
    }
    known.tests = static_cast<uint32_t>(tests_ - before);
    if (known.count > Known::kMost) known.vertex = UINT32_MAX;
}

uint32_t Hills::step(uint32_t vertex, const dvec3& up) const noexcept {
    const double from = height(vertex, up);
    uint32_t top = vertex;
    double most = from;
    triangles_at(vertex, [&](const Triangle& corners) {
        for (const uint32_t v : corners) {
            if (v == vertex) continue;
            const double h = height(v, up); // of equally high ones the first by index, whatever the tree's order
            if (h > most || (h == most && h > from && v < top)) top = v, most = h;
        }
    });
    return top;
}

uint32_t Hills::step(uint32_t first, uint32_t second, const dvec3& up) const noexcept {
    uint32_t top = first;
    double most = std::max(height(first, up), height(second, up));
    triangles_at(first, [&](const Triangle& corners) {
        if (std::find(corners.begin(), corners.end(), second) == corners.end()) return;
        for (const uint32_t v : corners)
            if (v != first && v != second && height(v, up) > most) top = v, most = height(v, up);
    });
    return top;
}

double Climb::step() noexcept {
    const uint32_t from = vertex;
    vertex = second != vertex ? hills->step(vertex, second, up) : hills->step(vertex, up);
    second = vertex, --steps_left;
    if (vertex == from) steps_left = 0;
    return vertex == from ? 0 : hills->height(vertex, up) - hills->height(from, up);
}

} // namespace prolate::query

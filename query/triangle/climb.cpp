#include "query/triangle/climb.hpp"

#include "query/ellipsoid/placed.hpp"
#include "src/block_box.hpp"
#include "src/bytes.hpp"
#include "src/power_of_two.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <new>

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
        uint64_t held = kTops;
        for (size_t i = 0; i < 3; ++i) {
            const double per_step = boxes.per_step(i), x = at_[i] - boxes.origin(i);
            // Box steps, the whole ones below and above: rounding is far below the slack.
            const double low = (x + kSlack) * per_step, high = (x - kSlack) * per_step;
            if (!(low >= 0 && high <= 255)) return 0;
            const auto below = static_cast<uint64_t>(std::min(low, 255.0)),
                       above = 255 - static_cast<uint64_t>(255 - std::max(high, 0.0));
            held &= no_less(kOnes * below, load_le<uint64_t>(block + kBlockBoxLow + kBlockLanes * i)) &
                    no_less(load_le<uint64_t>(block + kBlockBoxHigh + kBlockLanes * i), kOnes * above);
        }
        return static_cast<uint32_t>((held >> 7) * 0x0102040810204080 >> 56); // gathers one bit of each byte
    }

private:
    static constexpr uint64_t kOnes = 0x0101010101010101, kTops = 0x80 * kOnes;
    // Eight bytes at once, in the top bit of each: x >= y.
    static uint64_t no_less(uint64_t x, uint64_t y) {
        const uint64_t difference = (x | kTops) - (y & ~kTops); // of the lower bits, which does not reach the next byte
        return ((x & ~y) | (~(x ^ y) & difference)) & kTops;
    }

    static constexpr double kSlack = 0x1p-10; // lattice steps
    double at_[3];
};

} // namespace

// Null if there is too little of it.
Hills::Known* Hills::many(std::span<std::byte> room) noexcept {
    void* at = room.data();
    size_t size = room.size();
    return at == nullptr ? nullptr
                         : static_cast<Known*>(std::align(alignof(Known), kManyKnown * sizeof(Known), at, size));
}

Hills::Hills(const TreeView& tree, uint64_t& tests, uint64_t most_tests, std::span<std::byte> room) noexcept
    : tree_(tree), tests_(tests), most_tests_(most_tests), known_(many(room) != nullptr ? many(room) : few_),
      known_count_(known_ == few_ ? kFewKnown : kManyKnown) {}

// Calls visit(corners) for each triangle that has this vertex.
template <class Visit> void Hills::find(uint32_t vertex, Visit&& visit) const {
    const BoxProbe probe(tree_.raw().lattice(), tree_.vertex(vertex));
    const auto look = [&](uint32_t begin, uint32_t triangles) {
        tests_ += triangles;
        for (uint32_t t = begin; t < begin + triangles; ++t) {
            const Triangle corners = tree_.triangle(t);
            if (std::find(corners.begin(), corners.end(), vertex) != corners.end()) visit(corners);
        }
    };
    // Of each level, siblings: those from slot `first` on are still to be tested, and of the block before it, the lanes
    // that hold the vertex to be opened.
    struct Family {
        uint32_t first, left, held;
    };
    Family stack[kMaxLevels + 1];
    uint32_t size = 0;
    stack[size++] = {0, 1, 0};
    while (size > 0) {
        Family& family = stack[size - 1];
        if (family.held != 0) {
            const auto lane = static_cast<uint32_t>(std::bit_width(family.held)) - 1;
            family.held ^= 1u << lane;
            const std::byte* const block = tree_.raw().block(family.first / kBlockLanes - 1);
            stack[size++] = {first_child(block, lane), load_le<uint8_t>(block + kBlockCount + lane), 0};
            continue;
        }
        if (family.left == 0) {
            --size;
            continue;
        }
        const uint32_t count = std::min(family.left, kBlockLanes);
        const std::byte* const block = tree_.raw().block(family.first / kBlockLanes);
        family.first += kBlockLanes, family.left -= count;
        tests_ += count;
        const uint32_t held = probe.lanes(block);
        for (uint32_t lane = 0; lane < count; ++lane) {
            if ((held >> lane & 1) == 0) continue;
            const uint32_t children = load_le<uint8_t>(block + kBlockCount + lane);
            if (children < kTriangleLeaf)
                family.held |= 1u << lane;
            else
                look(first_triangle(block, lane), children - kTriangleLeaf);
        }
    }
}

uint32_t Hills::Known::place_of(uint32_t neighbour) const noexcept {
    return static_cast<uint32_t>(std::find(neighbours, neighbours + neighbour_count, neighbour) - neighbours);
}

// What is known of a vertex, found if it is not. Null if it has too many neighbours.
const Hills::Known* Hills::known(uint32_t vertex) const {
    if (!ready_)
        for (uint32_t i = 0; i < known_count_; ++i) (new (known_ + i) Known)->vertex = UINT32_MAX;
    ready_ = true;
    Known& known = known_[vertex % known_count_];
    if (known.vertex == vertex) {
        tests_ += known.tests;
        return &known;
    }
    const uint64_t before = tests_;
    known.vertex = vertex, known.triangle_count = known.neighbour_count = 0;
    bool fits = true;
    find(vertex, [&](const Triangle& corners) {
        fits = fits && known.triangle_count < Known::kMost;
        if (!fits) return;
        size_t other = 0;
        for (const uint32_t v : corners) {
            if (v == vertex || other == 2) continue;
            const uint32_t place = known.place_of(v);
            fits = fits && place < Known::kMost;
            if (!fits) return;
            if (place == known.neighbour_count) known.neighbours[known.neighbour_count++] = v;
            known.triangles[known.triangle_count][other++] = static_cast<uint8_t>(place);
        }
        for (; other < 2; ++other) known.triangles[known.triangle_count][other] = UINT8_MAX; // a corner twice
        ++known.triangle_count;
    });
    known.tests = static_cast<uint32_t>(tests_ - before);
    if (fits) return &known;
    known.vertex = UINT32_MAX, tests_ = before;
    return nullptr;
}

uint32_t Hills::step(uint32_t vertex, const dvec3& up) const noexcept {
    if (tests_ > most_tests_) return vertex;
    const double from = height(vertex, up);
    uint32_t top = vertex;
    double most = from;
    const auto look = [&](uint32_t v, double h) { // of equally high ones the first by index, whatever the tree's order
        if (h > most || (h == most && h > from && v < top)) top = v, most = h;
    };
    if (const Known* const k = known(vertex))
        for (uint32_t i = 0; i < k->neighbour_count; ++i) look(k->neighbours[i], height(k->neighbours[i], up));
    else
        find(vertex, [&](const Triangle& corners) {
            for (const uint32_t v : corners)
                if (v != vertex) look(v, height(v, up));
        });
    return top;
}

uint32_t Hills::step(uint32_t first, uint32_t second, const dvec3& up) const noexcept {
    if (tests_ > most_tests_) return first;
    uint32_t top = first;
    double most = std::max(height(first, up), height(second, up));
    const auto look = [&](uint32_t v, double h) {
        if (h > most) top = v, most = h;
    };
    if (const Known* const k = known(first)) {
        const uint32_t edge = k->place_of(second);
        for (uint32_t i = 0; i < k->triangle_count; ++i) {
            const uint8_t(&others)[2] = k->triangles[i];
            const uint32_t v = others[0] == edge ? others[1] : others[1] == edge ? others[0] : UINT8_MAX;
            if (v < k->neighbour_count) look(k->neighbours[v], height(k->neighbours[v], up));
        }
    } else {
        find(first, [&](const Triangle& corners) {
            if (std::find(corners.begin(), corners.end(), second) == corners.end()) return;
            for (const uint32_t v : corners)
                if (v != first && v != second) look(v, height(v, up));
        });
    }
    return top;
}

uint32_t Hills::neighbours(uint32_t vertex, std::span<uint32_t> out) const noexcept {
    if (tests_ > most_tests_) return 0;
    size_t count = 0;
    const auto look = [&](uint32_t v) {
        const auto end = out.begin() + static_cast<std::ptrdiff_t>(count);
        if (v != vertex && count < out.size() && std::find(out.begin(), end, v) == end) out[count++] = v;
    };
    if (const Known* const k = known(vertex))
        std::for_each(k->neighbours, k->neighbours + k->neighbour_count, look);
    else
        find(vertex, [&](const Triangle& corners) { std::for_each(corners.begin(), corners.end(), look); });
    return static_cast<uint32_t>(count);
}

double Climb::step() noexcept {
    const uint32_t from = vertex;
    vertex = second != vertex ? hills->step(vertex, second, up) : hills->step(vertex, up);
    second = vertex, --steps_left;
    if (vertex == from) steps_left = 0;
    return vertex == from ? 0 : hills->height(vertex, up) - hills->height(from, up);
}

} // namespace prolate::query

// The boxes of a World's bodies.
//
// As long as a body cannot have left its box, a move costs no more than a bound on its motion. Otherwise its tight box
// is computed; if that is still inside, the motion counts from there. If not, or if the box has become much larger than
// needed - the body has turned - the leaf gets another.
#include "query/world/state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {
namespace {

using query::BoundsTree;

constexpr float kLargest = 4; // a box has at most so many times the slack it began with

// Rounding to nearest keeps the order, so the result contains `box`.
Bounds widened(const Bounds& box, float part) {
    const float pad =
        part * std::max({box.upper.x - box.lower.x, box.upper.y - box.lower.y, box.upper.z - box.lower.z});
    return {{box.lower.x - pad, box.lower.y - pad, box.lower.z - pad},
            {box.upper.x + pad, box.upper.y + pad, box.upper.z + pad}};
}

} // namespace

void World::State::mark_changed(uint32_t index) noexcept {
    if (!std::exchange(marks[index].changed, true)) changed.push_back(index);
}
void World::State::mark_moved(uint32_t index) noexcept {
    if (!std::exchange(marks[index].moved, true)) moved.push_back(index);
}

void World::State::enter(uint32_t index, const Bounds& box, const query::Anchor& anchor) noexcept {
    Entry& entry = entries[index];
    const Bounds wide = widened(box, options.slack);
    if (query::is_finite(wide)) {
        entry.leaf = tree.insert(wide, index);
    } else {
        entry.leaf = BoundsTree::kNone;
        entry.unbounded_at = static_cast<uint32_t>(unbounded.size());
        unbounded.push_back(index);
    }
    entry.anchor = anchor, entry.room = room_for(entry, box);
    mark_changed(index);
}

void World::State::leave(uint32_t index) noexcept {
    const Entry& entry = entries[index];
    if (entry.leaf != BoundsTree::kNone) return tree.remove(entry.leaf);
    const uint32_t last = unbounded.back();
    unbounded[entry.unbounded_at] = last, entries[last].unbounded_at = entry.unbounded_at;
    unbounded.pop_back();
}

// How far the faces of a body's box are from those of `box`; below 0 if it needs another box.
double World::State::room_for(const Entry& entry, const Bounds& box) const noexcept {
    if (entry.leaf == BoundsTree::kNone || !query::is_finite(box)) return -1;
    const Bounds& wide = tree.box(entry.leaf);
    if (!query::contains(widened(box, kLargest * options.slack), wide)) return -1;
    return std::min({double{box.lower.x} - wide.lower.x, double{box.lower.y} - wide.lower.y,
                     double{box.lower.z} - wide.lower.z, double{wide.upper.x} - box.upper.x,
                     double{wide.upper.y} - box.upper.y, double{wide.upper.z} - box.upper.z});
}

World::State::Placement World::State::place(const Entry& entry, const Pose& pose) const noexcept {
    const auto to_world = query::relative_pose({}, pose);
    const query::Anchor anchor = query::anchor(entry.local, to_world);
    if (query::motion(entry.local, entry.anchor, anchor) <= entry.room)
        return {.stays = true, .room = -1, .box = {}, .anchor = {}};
    const Bounds box = query::bounds_at(*entry.body.tree(), to_world, entry.body.margin, query::kBoxTolerance);
    const double room = room_for(entry, box);
    const bool still_unbounded = entry.leaf == BoundsTree::kNone && !query::is_finite(box);
    return {.stays = room >= 0 || still_unbounded, .room = room, .box = box, .anchor = anchor};
}

void World::State::move(const Move& to) noexcept {
    Entry& entry = entries[to.index];
    entry.body.pose = to.pose;
    mark_moved(to.index);
    if (!to.placement.stays) {
        leave(to.index);
        enter(to.index, to.placement.box, to.placement.anchor);
    } else if (to.placement.room >= 0) {
        entry.anchor = to.placement.anchor, entry.room = to.placement.room;
    }
}

bool World::State::apart_from_half_space(uint32_t one, uint32_t other) const noexcept {
    if (marks[one].half_space && marks[other].half_space) return true;
    if (!marks[one].half_space && !marks[other].half_space) return false;
    const Body& ground = entries[marks[one].half_space ? one : other].body;
    const uint32_t leaf = entries[marks[one].half_space ? other : one].leaf;
    return leaf != BoundsTree::kNone && query::certainly_apart(*ground.half_space(), ground.margin, tree.box(leaf));
}

// In double: products of floats are exact, sums and the root are wrong by less than 8 u of the moduli, u = 2^-53. With
// a normal of 0 both sides are, and a NaN fails the comparison.
bool query::certainly_apart(const HalfSpace& half_space, float margin, const Bounds& box) noexcept {
    const double n[3] = {half_space.normal.x, half_space.normal.y, half_space.normal.z};
    const double at[3] = {n[0] * (n[0] < 0 ? box.upper.x : box.lower.x), n[1] * (n[1] < 0 ? box.upper.y : box.lower.y),
                          n[2] * (n[2] < 0 ? box.upper.z : box.lower.z)};
    const double length = std::sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]);
    const double moduli = std::abs(at[0]) + std::abs(at[1]) + std::abs(at[2]) +
                          (std::abs(double{half_space.offset}) + double{margin}) * length;
    const double height = (at[0] + at[1]) + at[2] - (double{half_space.offset} + double{margin}) * length;
    return height > 0x1p-49 * moduli;
}

} // namespace prolate

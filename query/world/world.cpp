// Bodies of a World, their boxes, and the queries that only need these.
//
// As long as a body cannot have left its box, a move costs no more than a bound on its motion. Otherwise its tight box
// is computed; if that is still inside, the motion counts from there. If not, or if the box has become much larger than
// needed - the body has turned - the leaf gets another.
#include "query/world/jobs.hpp"
#include "query/world/state.hpp"

#include <cassert>
#include <cmath>
#include <new>
#include <utility>

namespace prolate {
namespace {

using query::BoundsTree;

constexpr uint32_t kMostBodies = uint32_t{1} << 30; // the tree's nodes, twice as many, have 32-bit numbers
constexpr uint32_t kGrain = 64;                     // boxes
constexpr float kLargest = 4;                       // a box has at most so many times the slack it began with
constexpr double kTolerance = 0x1p-6;               // of boxes, small beside the slack: half as dear as bounds()

constexpr Error kOutOfMemory{ErrorCode::out_of_memory, "the world's memory resource gave no more", 0};
constexpr Error kBadId{ErrorCode::bad_id, "no body has this id, or has it any more", 0};

// Rounding to nearest keeps the order, so the result contains `box`.
Bounds widened(const Bounds& box, float part) {
    const float pad =
        part * std::max({box.upper.x - box.lower.x, box.upper.y - box.lower.y, box.upper.z - box.lower.z});
    return {{box.lower.x - pad, box.lower.y - pad, box.lower.z - pad},
            {box.upper.x + pad, box.upper.y + pad, box.upper.z + pad}};
}

// A box on its way: seen from a body's box, it is a ray against the sum of both boxes. Differences and quotients of
// floats, in double, are wrong by 2 u of themselves, u = 2^-53; so are the times t at which the ray enters and leaves.
// Signs are right. Comparisons let a NaN pass.
class Path {
public:
    Path(const Bounds& box, const Vec3& direction) : box_(box), direction_(direction) {}

    bool meets(const Bounds& other, float until) const {
        double enters = 0, leaves = until;
        const auto pass = [&](float own_lower, float own_upper, float lower, float upper, double d) {
            const double below = double{lower} - own_upper, above = double{upper} - own_lower;
            if (d == 0) return !(below > 0 || above < 0);
            const double first = (d > 0 ? below : above) / d, last = (d > 0 ? above : below) / d;
            if (first > enters) enters = first;
            if (last < leaves) leaves = last;
            return true;
        };
        return pass(box_.lower.x, box_.upper.x, other.lower.x, other.upper.x, direction_.x) &&
               pass(box_.lower.y, box_.upper.y, other.lower.y, other.upper.y, direction_.y) &&
               pass(box_.lower.z, box_.upper.z, other.lower.z, other.upper.z, direction_.z) &&
               !(enters > leaves * (1 + 0x1p-50));
    }
    // Does the second box lie nearer to the start?
    bool second_first(const Bounds& first, const Bounds& second) const { return along(second) < along(first); }

private:
    double along(const Bounds& b) const {
        return (double{b.lower.x} + b.upper.x) * direction_.x + (double{b.lower.y} + b.upper.y) * direction_.y +
               (double{b.lower.z} + b.upper.z) * direction_.z;
    }
    Bounds box_;
    Vec3 direction_;
};

} // namespace

void World::State::reserve_bodies(uint32_t bodies) {
    if (bodies <= capacity) return;
    if (bodies > kMostBodies) throw std::bad_alloc();
    entries.reserve(bodies);
    marks.reserve(bodies);
    free_entries.reserve(bodies);
    unbounded.reserve(bodies);
    changed.reserve(bodies);
    moved.reserve(bodies);
    placements.reserve(bodies);
    tree.reserve(bodies);
    capacity = bodies;
}

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
    const Bounds box = query::bounds_at(entry.body.tree, to_world, entry.body.margin, kTolerance);
    const double room = room_for(entry, box);
    const bool still_unbounded = entry.leaf == BoundsTree::kNone && !query::is_finite(box);
    return {.stays = room >= 0 || still_unbounded, .room = room, .box = box, .anchor = anchor};
}

void World::State::move(uint32_t index, const Pose& pose, const Placement& placement) noexcept {
    Entry& entry = entries[index];
    entry.body.pose = pose;
    mark_moved(index);
    if (!placement.stays) {
        leave(index);
        enter(index, placement.box, placement.anchor);
    } else if (placement.room >= 0) {
        entry.anchor = placement.anchor, entry.room = placement.room;
    }
}

Result<World> World::create(const WorldOptions& options, std::pmr::memory_resource* memory) noexcept {
    if (!(options.slack >= 0 && options.slack <= 1)) return Error{ErrorCode::bad_options, "slack must be 0 ... 1", 0};
    if (!memory) memory = std::pmr::get_default_resource();
    try {
        void* place = memory->allocate(sizeof(State), alignof(State));
        return World(new (place) State(options, memory));
    } catch (...) {
        return kOutOfMemory;
    }
}

void World::Deleter::operator()(State* state) const noexcept {
    std::pmr::memory_resource* memory = state->memory;
    state->~State();
    memory->deallocate(state, sizeof(State), alignof(State));
}

Result<void> World::reserve(uint32_t bodies, uint32_t pairs) noexcept {
    try {
        state_->reserve_bodies(bodies);
        state_->reserve_pairs(pairs);
        return {};
    } catch (...) {
        return kOutOfMemory;
    }
}

Result<BodyId> World::insert(const Body& body) noexcept {
    State& s = *state_;
    if (!(body.margin >= 0 && std::isfinite(body.margin)))
        return Error{ErrorCode::bad_options, "a margin must be finite and not negative", 0};
    if (s.free_entries.empty() && s.entries.size() == s.capacity) {
        try {
            s.reserve_bodies(std::max(16u, 2 * s.capacity));
        } catch (...) {
            return kOutOfMemory;
        }
    }
    const State::Entry entry{.body = body, .local = query::local_bounds(body.tree)};
    uint32_t index = static_cast<uint32_t>(s.entries.size());
    if (s.free_entries.empty()) {
        s.entries.push_back(entry);
        s.marks.emplace_back();
    } else {
        index = s.free_entries.back();
        s.free_entries.pop_back();
        s.entries[index] = entry;
    }
    State::Mark& mark = s.marks[index];
    mark.layers = body.layers, mark.mask = body.mask, mark.alive = true;
    s.mark_moved(index);
    const auto to_world = query::relative_pose({}, body.pose);
    s.enter(index, query::bounds_at(body.tree, to_world, body.margin, kTolerance),
            query::anchor(entry.local, to_world));
    ++s.count;
    return s.id(index);
}

Result<void> World::remove(BodyId id) noexcept {
    State& s = *state_;
    if (!s.names(id)) return kBadId;
    s.leave(id.index);
    State::Mark& mark = s.marks[id.index];
    mark.alive = false;
    if (++mark.generation != 0) s.free_entries.push_back(id.index); // else all its ids have been given
    --s.count;
    return {};
}

Result<void> World::move(BodyId id, const Pose& pose) noexcept {
    if (!state_->names(id)) return kBadId;
    state_->move(id.index, pose, state_->place(state_->entries[id.index], pose));
    return {};
}

Result<void> World::move(std::span<const BodyId> ids, std::span<const Pose> poses, const Jobs& jobs) noexcept {
    State& s = *state_;
    if (ids.size() != poses.size())
        return Error{ErrorCode::bad_options, "as many poses as ids are needed", std::min(ids.size(), poses.size())};
    ++s.batch;
    for (size_t i = 0; i < ids.size(); ++i) {
        if (!s.names(ids[i])) return Error{kBadId.code, kBadId.what, i};
        if (std::exchange(s.entries[ids[i].index].batch, s.batch) == s.batch)
            return Error{ErrorCode::bad_options, "a body can only be moved to one pose", i};
    }
    s.placements.resize(ids.size()); // no two ids are the same, so there is room
    query::for_ranges(jobs, static_cast<uint32_t>(ids.size()), kGrain, [&](uint32_t begin, uint32_t end, uint32_t) {
        for (uint32_t i = begin; i < end; ++i) s.placements[i] = s.place(s.entries[ids[i].index], poses[i]);
    });
    for (size_t i = 0; i < ids.size(); ++i) s.move(ids[i].index, poses[i], s.placements[i]);
    return {};
}

Result<void> World::refilter(BodyId id, uint32_t layers, uint32_t mask) noexcept {
    State& s = *state_;
    if (!s.names(id)) return kBadId;
    s.entries[id.index].body.layers = s.marks[id.index].layers = layers;
    s.entries[id.index].body.mask = s.marks[id.index].mask = mask;
    s.mark_changed(id.index);
    return {};
}

const Body* World::find(BodyId id) const noexcept {
    return state_->names(id) ? &state_->entries[id.index].body : nullptr;
}

uint32_t World::body_count() const noexcept {
    return state_->count;
}

WorldStats World::stats() const noexcept {
    WorldStats out = state_->stats;
    out.bodies = state_->count, out.unbounded = static_cast<uint32_t>(state_->unbounded.size());
    return out;
}

void World::visit_boxes(const Bounds& box, uint32_t mask, bool (*call)(void*, BodyId), void* user) const {
    const State& s = *state_;
    const auto wanted = [&](uint32_t index) { return (s.marks[index].layers & mask) != 0; };
    for (const uint32_t index : s.unbounded)
        if (wanted(index) && !call(user, s.id(index))) return;
    s.tree.walk([&](const Bounds& other) { return overlap(box, other); },
                [&](uint32_t index) { return !wanted(index) || call(user, s.id(index)); });
}

void World::cast_boxes(const Bounds& box, const Vec3& direction, float until, uint32_t mask,
                       float (*call)(void*, BodyId, float), void* user) const {
    const State& s = *state_;
    const auto show = [&](uint32_t index) {
        if ((s.marks[index].layers & mask) != 0) until = call(user, s.id(index), until);
        return !(until < 0);
    };
    if (until < 0) return;
    for (const uint32_t index : s.unbounded)
        if (!show(index)) return;
    const Path path(box, direction);
    s.tree.walk([&](const Bounds& other) { return path.meets(other, until); },
                [&](const Bounds& first, const Bounds& second) { return path.second_first(first, second); }, show);
}

} // namespace prolate

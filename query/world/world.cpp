// Bodies of a World, and their parts.
#include "query/world/jobs.hpp"
#include "query/world/state.hpp"

#include <cassert>
#include <cmath>
#include <new>
#include <utility>

namespace prolate {
namespace {

constexpr uint32_t kMostBodies = uint32_t{1} << 30; // the tree's nodes, twice as many, have 32-bit numbers
constexpr uint32_t kBoxesATask = 64;                // boxes

constexpr Error kOutOfMemory{ErrorCode::out_of_memory, "the world's memory resource gave no more", 0};
constexpr Error kBadId{ErrorCode::bad_id, "no body has this id, or has it any more", 0};
constexpr Error kStays{ErrorCode::bad_options, "a half-space stays where it is", 0};

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
    moves.reserve(bodies);
    tree.reserve(bodies);
    capacity = bodies;
}

Pose part_pose(const Pose& pose, const Pose& local) noexcept {
    const query::RelativePose at = query::relative_pose({}, pose);
    const Quat &p = pose.rotation, &q = local.rotation;
    const double x = p.x, y = p.y, z = p.z, w = p.w;
    // Of length 1: the product of two quaternions of any lengths could be out of range.
    const double length = std::sqrt((x * x + y * y + z * z + w * w) *
                                    (double{q.x} * q.x + double{q.y} * q.y + double{q.z} * q.z + double{q.w} * q.w));
    const auto part = [length](double v) { return static_cast<float>(v / length); };
    return {query::to_float(at.rotation * query::to_double(local.translation) + at.translation),
            {part(w * q.x + x * q.w + y * q.z - z * q.y), part(w * q.y - x * q.z + y * q.w + z * q.x),
             part(w * q.z + x * q.y - y * q.x + z * q.w), part(w * q.w - x * q.x - y * q.y - z * q.z)}};
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
    if (state_->busy()) return query::kBusy;
    try {
        state_->reserve_bodies(bodies);
        state_->reserve_pairs(pairs);
        return {};
    } catch (...) {
        return kOutOfMemory;
    }
}

uint32_t World::State::add(const Entry& entry) noexcept {
    uint32_t index = static_cast<uint32_t>(entries.size());
    if (free_entries.empty()) {
        entries.push_back(entry);
        marks.emplace_back();
    } else {
        index = free_entries.back();
        free_entries.pop_back();
        entries[index] = entry;
    }
    Mark& mark = marks[index];
    const Body& body = entry.body;
    mark.layers = body.layers, mark.mask = body.mask, mark.body = index, mark.alive = true;
    mark.half_space = body.half_space() != nullptr;
    mark_moved(index);
    if (mark.half_space) {
        enter(index, query::kEverything, {});
    } else {
        entries[index].local = query::local_bounds(*body.tree());
        const auto to_world = query::relative_pose({}, body.pose);
        enter(index, query::bounds_at(*body.tree(), to_world, body.margin, query::kBoxTolerance),
              query::anchor(entries[index].local, to_world));
    }
    ++count;
    return index;
}

void World::State::take_away(uint32_t index) noexcept {
    leave(index);
    Mark& mark = marks[index];
    mark.alive = false;
    if (++mark.generation != 0) free_entries.push_back(index); // else all its ids have been given
    --count;
}

Result<BodyId> World::insert(const Body& body, std::span<const Part> parts) noexcept {
    State& s = *state_;
    if (s.busy()) return query::kBusy;
    if (!(body.margin >= 0 && std::isfinite(body.margin)))
        return Error{ErrorCode::bad_options, "a margin must be finite and not negative", 0};
    if (body.half_space() != nullptr && !parts.empty())
        return Error{ErrorCode::bad_options, "a half-space has no parts", 0};
    const size_t wanted = s.entries.size() - s.free_entries.size() + 1 + parts.size();
    if (wanted > s.capacity) {
        try {
            if (wanted > kMostBodies) throw std::bad_alloc();
            s.reserve_bodies(std::max({16u, 2 * s.capacity, static_cast<uint32_t>(wanted)}));
        } catch (...) {
            return kOutOfMemory;
        }
    }
    const uint32_t index = s.add({.body = body});
    uint32_t last = index;
    for (const Part& part : parts) {
        const Body own{.shape = part.tree,
                       .pose = part_pose(body.pose, part.pose),
                       .user = body.user,
                       .layers = body.layers,
                       .mask = body.mask,
                       .margin = body.margin};
        last = s.entries[last].next = s.add({.body = own, .in_body = part.pose});
        s.marks[last].body = index;
    }
    return s.id(index);
}

Result<void> World::remove(BodyId id) noexcept {
    State& s = *state_;
    if (s.busy()) return query::kBusy;
    if (!s.names_body(id)) return kBadId;
    for (uint32_t i = id.index; i != State::kNoEntry;) s.take_away(std::exchange(i, s.entries[i].next));
    return {};
}

Result<void> World::move(BodyId id, const Pose& pose) noexcept {
    State& s = *state_;
    if (s.busy()) return query::kBusy;
    if (!s.names_body(id)) return kBadId;
    if (s.marks[id.index].half_space) return kStays;
    s.for_parts(id.index, pose, [&](uint32_t index, const Pose& to) {
        s.move({.index = index, .pose = to, .placement = s.place(s.entries[index], to)});
    });
    return {};
}

Result<void> World::move(std::span<const BodyId> ids, std::span<const Pose> poses, const Jobs& jobs) noexcept {
    State& s = *state_;
    if (s.busy()) return query::kBusy;
    if (ids.size() != poses.size())
        return Error{ErrorCode::bad_options, "as many poses as ids are needed", std::min(ids.size(), poses.size())};
    ++s.batch;
    for (size_t i = 0; i < ids.size(); ++i) {
        if (!s.names_body(ids[i])) return Error{kBadId.code, kBadId.what, i};
        if (s.marks[ids[i].index].half_space) return Error{kStays.code, kStays.what, i};
        if (std::exchange(s.entries[ids[i].index].batch, s.batch) == s.batch)
            return Error{ErrorCode::bad_options, "a body can only be moved to one pose", i};
    }
    s.moves.clear(); // no two ids are the same, so there is room
    for (size_t i = 0; i < ids.size(); ++i)
        s.for_parts(ids[i].index, poses[i], [&](uint32_t index, const Pose& pose) {
            s.moves.push_back({.index = index, .pose = pose, .placement = {}});
        });
    query::for_ranges(jobs, static_cast<uint32_t>(s.moves.size()), kBoxesATask,
                      [&](uint32_t begin, uint32_t end, uint32_t) {
                          for (uint32_t i = begin; i < end; ++i)
                              s.moves[i].placement = s.place(s.entries[s.moves[i].index], s.moves[i].pose);
                      });
    for (const State::Move& to : s.moves) s.move(to);
    return {};
}

Result<void> World::refilter(BodyId id, uint32_t layers, uint32_t mask) noexcept {
    State& s = *state_;
    if (s.busy()) return query::kBusy;
    if (!s.names_body(id)) return kBadId;
    for (uint32_t i = id.index; i != State::kNoEntry; i = s.entries[i].next) {
        s.entries[i].body.layers = s.marks[i].layers = layers;
        s.entries[i].body.mask = s.marks[i].mask = mask;
        s.mark_changed(i);
    }
    return {};
}

const Body* World::find(BodyId id) const noexcept {
    return state_->names(id) ? &state_->entries[id.index].body : nullptr;
}

BodyId World::body_of(BodyId id) const noexcept {
    return state_->names(id) ? state_->id(state_->marks[id.index].body) : BodyId{};
}

BodyId World::part(BodyId id, uint32_t i) const noexcept {
    const State& s = *state_;
    if (!s.names_body(id)) return {};
    uint32_t index = id.index;
    for (; i > 0 && index != State::kNoEntry; --i) index = s.entries[index].next;
    return index != State::kNoEntry ? s.id(index) : BodyId{};
}

uint32_t World::body_count() const noexcept {
    return state_->count;
}

WorldStats World::stats() const noexcept {
    WorldStats out = state_->stats;
    out.bodies = state_->count, out.unbounded = static_cast<uint32_t>(state_->unbounded.size());
    return out;
}

} // namespace prolate

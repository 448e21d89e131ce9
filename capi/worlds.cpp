// Worlds of the C interface, in the caller's memory.
#include "capi/handles.hpp"
#include "capi/world.hpp"

#include <prolate/prolate.h>
#include <prolate/world.hpp>

#include <new>
#include <span>
#include <type_traits>

using namespace prolate;
using namespace prolate::capi;

namespace {

void* allocate_new(void*, size_t size, size_t alignment) {
    return ::operator new(size, std::align_val_t(alignment), std::nothrow);
}
void release_new(void*, void* memory, size_t, size_t alignment) {
    ::operator delete(memory, std::align_val_t(alignment));
}

// Of the parts of a body at a time.
constexpr size_t kMostParts = 65535;

} // namespace

namespace {

// The parts of a body on their way, in the caller's memory.
class Parts {
public:
    Parts(const prolate_world& world, size_t count)
        : allocator_(world.allocator), count_(count),
          parts_(count > 0 ? allocator_.allocate(allocator_.user, count * sizeof(Part), alignof(Part)) : nullptr) {}
    ~Parts() {
        if (parts_ != nullptr) allocator_.release(allocator_.user, parts_, count_ * sizeof(Part), alignof(Part));
    }
    Parts(const Parts&) = delete;
    Parts& operator=(const Parts&) = delete;

    bool good() const { return count_ == 0 || parts_ != nullptr; }
    void set(size_t i, const Part& part) { new (static_cast<Part*>(parts_) + i) Part(part); }
    std::span<const Part> all() const { return {static_cast<const Part*>(parts_), count_}; }

private:
    static_assert(std::is_trivially_destructible_v<Part>);
    const prolate_allocator& allocator_;
    const size_t count_;
    void* const parts_;
};

} // namespace

prolate_status prolate_world_create(const prolate_world_options* options, const prolate_allocator* allocator,
                                    prolate_world** world) {
    auto given = fresh<prolate_world_options>();
    if (world == nullptr) return PROLATE_BAD_ARGUMENT;
    if (allocator != nullptr && (allocator->allocate == nullptr || allocator->release == nullptr))
        return PROLATE_BAD_ARGUMENT;
    if (!read(options, given)) return PROLATE_BAD_STRUCT;
    const prolate_allocator own = allocator != nullptr ? *allocator : prolate_allocator{allocate_new, release_new, {}};
    void* const place = own.allocate(own.user, sizeof(prolate_world), alignof(prolate_world));
    if (place == nullptr) return PROLATE_OUT_OF_MEMORY;
    auto* const out = new (place) prolate_world{own, Memory(own), {}};
    WorldOptions world_options;
    if (given.slack != 0) world_options.slack = given.slack;
    auto made = World::create(world_options, &out->memory);
    if (!made) {
        prolate_world_destroy(out);
        return status_of(made);
    }
    out->world.emplace(std::move(*made));
    *world = out;
    return PROLATE_OK;
}

void prolate_world_destroy(prolate_world* world) {
    if (world == nullptr) return;
    const prolate_allocator allocator = world->allocator;
    world->~prolate_world();
    allocator.release(allocator.user, world, sizeof(prolate_world), alignof(prolate_world));
}

prolate_status prolate_world_reserve(prolate_world* world, uint32_t bodies, uint32_t pairs) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->reserve(bodies, pairs));
}

prolate_status prolate_world_insert(prolate_world* world, const prolate_world_body* body, prolate_body_id* id) {
    if (world == nullptr || body == nullptr || id == nullptr) return PROLATE_BAD_ARGUMENT;
    auto given = fresh<prolate_world_body>();
    if (!read(body, given)) return PROLATE_BAD_STRUCT;
    const TreeView* const view = view_of(given.tree);
    if ((view == nullptr) == (given.half_space == nullptr) || (given.half_space != nullptr && given.tree != nullptr) ||
        (given.parts == nullptr && given.part_count > 0) || given.part_count > kMostParts)
        return PROLATE_BAD_ARGUMENT;
    for (size_t i = 0; i < given.part_count; ++i)
        if (view_of(given.parts[i].tree) == nullptr) return PROLATE_BAD_ARGUMENT;
    Body out{.shape = given.half_space != nullptr ? decltype(Body::shape)(same<HalfSpace>(*given.half_space)) : *view,
             .pose = same<Pose>(given.pose)};
    out.user = given.user, out.margin = given.margin;
    if (given.layers != 0 || given.mask != 0) out.layers = given.layers, out.mask = given.mask;
    Parts parts(*world, given.part_count);
    if (!parts.good()) return PROLATE_OUT_OF_MEMORY;
    for (size_t i = 0; i < given.part_count; ++i)
        parts.set(i, {*view_of(given.parts[i].tree), same<Pose>(given.parts[i].pose)});
    const auto inserted = world->world->insert(out, parts.all());
    if (inserted) *id = same<prolate_body_id>(*inserted);
    return status_of(inserted);
}

prolate_status prolate_world_remove(prolate_world* world, prolate_body_id id) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->remove(same<BodyId>(id)));
}

prolate_status prolate_world_move(prolate_world* world, prolate_body_id id, prolate_pose pose) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->move(same<BodyId>(id), same<Pose>(pose)));
}

prolate_status prolate_world_move_many(prolate_world* world, const prolate_body_id* ids, const prolate_pose* poses,
                                       size_t count, const prolate_jobs* jobs, prolate_error* error) {
    if (world == nullptr || (count > 0 && (ids == nullptr || poses == nullptr)))
        return failed(PROLATE_BAD_ARGUMENT, error);
    static_assert(sizeof(BodyId) == sizeof(prolate_body_id) && sizeof(Pose) == sizeof(prolate_pose));
    const auto moved = world->world->move({reinterpret_cast<const BodyId*>(ids), count},
                                          {reinterpret_cast<const Pose*>(poses), count}, jobs_of(jobs));
    return moved ? PROLATE_OK : failed(moved.error(), error);
}

prolate_status prolate_world_refilter(prolate_world* world, prolate_body_id id, uint32_t layers, uint32_t mask) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->refilter(same<BodyId>(id), layers, mask));
}

prolate_status prolate_world_find(const prolate_world* world, prolate_body_id id, prolate_pose* pose, uint64_t* user) {
    if (world == nullptr) return PROLATE_BAD_ARGUMENT;
    const Body* const body = world->world->find(same<BodyId>(id));
    if (body == nullptr) return PROLATE_BAD_ID;
    if (pose != nullptr) *pose = same<prolate_pose>(body->pose);
    if (user != nullptr) *user = body->user;
    return PROLATE_OK;
}

prolate_status prolate_world_body_of(const prolate_world* world, prolate_body_id part, prolate_body_id* body) {
    if (world == nullptr || body == nullptr) return PROLATE_BAD_ARGUMENT;
    const BodyId found = world->world->body_of(same<BodyId>(part));
    if (found == BodyId{}) return PROLATE_BAD_ID;
    *body = same<prolate_body_id>(found);
    return PROLATE_OK;
}

prolate_status prolate_world_part(const prolate_world* world, prolate_body_id body, uint32_t i, prolate_body_id* part) {
    if (world == nullptr || part == nullptr) return PROLATE_BAD_ARGUMENT;
    const BodyId found = world->world->part(same<BodyId>(body), i);
    if (found == BodyId{}) return PROLATE_BAD_ID;
    *part = same<prolate_body_id>(found);
    return PROLATE_OK;
}

prolate_status prolate_world_update_pairs(prolate_world* world, const prolate_jobs* jobs,
                                          const prolate_body_pair** pairs, size_t* count) {
    if (world == nullptr || pairs == nullptr || count == nullptr) return PROLATE_BAD_ARGUMENT;
    static_assert(sizeof(BodyPair) == sizeof(prolate_body_pair) &&
                  offsetof(BodyPair, moved) == offsetof(prolate_body_pair, moved));
    const auto found = world->world->update_pairs(jobs_of(jobs));
    if (found) *pairs = reinterpret_cast<const prolate_body_pair*>(found->data()), *count = found->size();
    return status_of(found);
}

prolate_status prolate_world_ended_pairs(const prolate_world* world, const prolate_body_pair** pairs, size_t* count) {
    if (world == nullptr || pairs == nullptr || count == nullptr) return PROLATE_BAD_ARGUMENT;
    const auto ended = world->world->ended_pairs();
    *pairs = reinterpret_cast<const prolate_body_pair*>(ended.data()), *count = ended.size();
    return PROLATE_OK;
}

prolate_status prolate_world_slot_count(const prolate_world* world, uint32_t* count) {
    if (world == nullptr || count == nullptr) return PROLATE_BAD_ARGUMENT;
    *count = world->world->slot_count();
    return PROLATE_OK;
}

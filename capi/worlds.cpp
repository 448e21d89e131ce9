// Worlds of the C interface, in the caller's memory.
#include "capi/handles.hpp"

#include <prolate/prolate.h>
#include <prolate/world_queries.hpp>

#include <memory_resource>
#include <optional>

using namespace prolate;
using namespace prolate::capi;

namespace {

// The caller's functions.
class Memory final : public std::pmr::memory_resource {
public:
    explicit Memory(const prolate_allocator& allocator) : allocator_(allocator) {}

private:
    void* do_allocate(size_t size, size_t alignment) override {
        void* const out = allocator_.allocate(allocator_.user, size, alignment);
        if (out == nullptr) throw std::bad_alloc(); // World turns it into an Error
        return out;
    }
    void do_deallocate(void* memory, size_t size, size_t alignment) override {
        allocator_.release(allocator_.user, memory, size, alignment);
    }
    bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }

    const prolate_allocator allocator_;
};

void* allocate_new(void*, size_t size, size_t alignment) {
    return ::operator new(size, std::align_val_t(alignment), std::nothrow);
}
void release_new(void*, void* memory, size_t, size_t alignment) {
    ::operator delete(memory, std::align_val_t(alignment));
}

Jobs jobs_of(const prolate_jobs* jobs) {
    return jobs != nullptr ? Jobs{jobs->run, jobs->user, jobs->workers} : Jobs{};
}
template <class T> prolate_status status_of(const Result<T>& result) {
    return result ? PROLATE_OK : static_cast<prolate_status>(result.error().code);
}

} // namespace

struct prolate_world {
    prolate_allocator allocator;
    Memory memory;
    std::optional<World> world;
};

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
    if (view == nullptr) return PROLATE_BAD_ARGUMENT;
    Body out{.shape = *view, .pose = same<Pose>(given.pose)};
    out.user = given.user, out.margin = given.margin;
    if (given.layers != 0 || given.mask != 0) out.layers = given.layers, out.mask = given.mask;
    const auto inserted = world->world->insert(out);
    if (inserted) *id = same<prolate_body_id>(*inserted);
    return status_of(inserted);
}

prolate_status prolate_world_remove(prolate_world* world, prolate_body_id id) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->remove(same<BodyId>(id)));
}

prolate_status prolate_world_move(prolate_world* world, prolate_body_id id, prolate_pose pose) {
    return world == nullptr ? PROLATE_BAD_ARGUMENT : status_of(world->world->move(same<BodyId>(id), same<Pose>(pose)));
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

prolate_status prolate_world_collide(const prolate_world* world, const prolate_body_pair* pairs, size_t count,
                                     const prolate_jobs* given_jobs, void* scratch, size_t scratch_size,
                                     const prolate_query_options* options, prolate_verdict* verdicts) {
    const Jobs jobs = jobs_of(given_jobs);
    auto given = fresh<prolate_query_options>();
    QueryContext* const contexts = context_of(scratch, scratch_size, jobs.workers);
    if (world == nullptr || contexts == nullptr || jobs.workers == 0 || count > UINT32_MAX ||
        (count > 0 && (pairs == nullptr || verdicts == nullptr)))
        return PROLATE_BAD_ARGUMENT;
    if (!read(options, given)) return PROLATE_BAD_STRUCT;
    static_assert(sizeof(Verdict) == sizeof(prolate_verdict));
    return status_of(collide(*world->world, {reinterpret_cast<const BodyPair*>(pairs), count},
                             std::span(reinterpret_cast<Verdict*>(verdicts), count),
                             {.contexts = {contexts, jobs.workers}, .jobs = jobs}, options_of(given)));
}

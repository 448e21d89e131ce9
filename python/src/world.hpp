// World: many bodies. One call at a time works on it, whatever threads call. Whatever pairs a call is about, it finds
// them first.
#pragma once

#include "python/src/batch.hpp"
#include "python/src/tree.hpp"

#include <prolate/tbb.hpp>
#include <prolate/world_queries.hpp>

#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

namespace prolate::python {

class HeldWorld {
public:
    explicit HeldWorld(nb::handle slack);

    // ---- bodies (world.cpp) ----

    uint64_t insert(nb::handle shape, nb::handle pose, nb::handle parts, nb::handle margin, nb::handle layers,
                    nb::handle mask, nb::handle order);
    void remove(nb::handle id);
    void move(nb::handle ids, nb::handle poses, nb::handle order);
    void refilter(nb::handle id, nb::handle layers, nb::handle mask);
    uint64_t body_of(nb::handle id); ///< 0: none
    uint64_t part(nb::handle id, nb::handle i);
    uint32_t count();

    // ---- its pairs (world_queries.cpp); `ids` are (M, 2) ----

    nb::tuple pairs(); ///< (ids, begins)
    nb::tuple collide(nb::handle margin, nb::handle max_level, nb::handle budget,
                      nb::handle threads);                                              ///< (ids, verdicts)
    nb::tuple collide_solids(nb::handle margin, nb::handle budget, nb::handle threads); ///< (ids, verdicts)
    /// (ids, arrays of PairArrays)
    nb::tuple distance(nb::handle tolerance, nb::handle max_distance, nb::handle budget, nb::handle threads);
    /// (ids, contact_arrays(), verdicts, ids of events, kinds of events)
    nb::tuple contacts(nb::handle margin, nb::handle budget, nb::handle threads);

    // ---- from outside (world_probes.cpp) ----

    /// (ids, arrays of HitArrays, single)
    nb::tuple raycast(nb::handle origins, nb::handle directions, nb::handle radius, nb::handle max_t, nb::handle mask,
                      nb::handle budget, nb::handle threads);
    /// (ids, arrays of PairArrays, gaps, single)
    nb::tuple sweep(nb::handle tree, nb::handle start, nb::handle end, nb::handle margin, nb::handle tolerance,
                    nb::handle mask, nb::handle budget, nb::handle threads, nb::handle order);
    /// (offsets, ids): of shapes, each (kind, numbers), ...
    nb::tuple overlap_shapes(nb::handle shapes, nb::handle margin, nb::handle mask, nb::handle budget,
                             nb::handle threads);
    /// ... or of a tree at poses.
    nb::tuple overlap_tree(nb::handle tree, nb::handle poses, nb::handle margin, nb::handle mask, nb::handle budget,
                           nb::handle threads, nb::handle order);

private:
    /// work() with the world to itself. The interpreter's lock is given up meanwhile.
    template <class Work> auto locked(const Work& work) {
        const nb::gil_scoped_release released;
        const std::lock_guard lock(mutex_);
        return work();
    }
    /// ask(workers) with the world to itself; throws its error.
    template <class Ask> void ask(nb::handle threads, const Ask& ask_);
    /// The same, with the pairs up to date; their ids.
    template <class Ask> nb::object ask_pairs(nb::handle threads, const Ask& ask_);
    Result<void> update();
    nb::tuple overlap(const std::vector<Probe>& probes, nb::handle threads, const QueryOptions& options, uint32_t mask);

    World world_;
    std::mutex mutex_;
    std::unordered_map<uint64_t, std::vector<nb::object>> trees_; ///< by the number of the body that they are of
    std::unique_ptr<QueryContext[]> contexts_;
    uint32_t context_count_ = 0;
    std::vector<PairContacts> records_; ///< by slot; empty until somebody asks for contacts
    std::vector<ContactEvent> ended_;   ///< found by update() since the last contacts()
};

uint64_t number_of(BodyId id) noexcept;
BodyId id_of(uint64_t number) noexcept;
uint32_t bits_of(nb::handle value, const char* name); ///< 32 of them

template <class Ask> void HeldWorld::ask(nb::handle threads, const Ask& ask_) {
    const auto count = static_cast<uint32_t>(thread_count(threads));
    check_done(locked([&]() -> Result<void> {
        oneapi::tbb::task_arena arena(static_cast<int>(count));
        const Jobs jobs = count > 1 ? tbb_jobs(arena) : Jobs{};
        if (context_count_ < jobs.workers) {
            contexts_ = std::make_unique_for_overwrite<QueryContext[]>(jobs.workers);
            context_count_ = jobs.workers;
        }
        return ask_(Workers{{contexts_.get(), context_count_}, jobs});
    }));
}

template <class Ask> nb::object HeldWorld::ask_pairs(nb::handle threads, const Ask& ask_) {
    std::vector<uint64_t> ids;
    ask(threads, [&](const Workers& workers) -> Result<void> {
        if (const auto updated = update(); !updated) return updated;
        for (const BodyPair& pair : world_.pairs()) ids.push_back(number_of(pair.a)), ids.push_back(number_of(pair.b));
        return ask_(workers, world_.pairs());
    });
    return to_numpy(ids, {ids.size() / 2, 2});
}

} // namespace prolate::python

// Queries of many pairs of a World. Jobs share them out; each answer goes to its own place, so nothing depends on who
// computed it.
#include "query/world/jobs.hpp"
#include "query/world/two_bodies.hpp"

#include <prolate/world_queries.hpp>

#include <algorithm>
#include <utility>

namespace prolate {
namespace {

// The caches of pairs: as many as there are slots, or none.
template <class Cache> struct Caches {
    std::span<OfPair<Cache>> all;

    Cache* of(const BodyPair& pair) const {
        if (all.empty()) return nullptr;
        OfPair<Cache>& at = all[pair.slot];
        if (at.a != pair.a || at.b != pair.b) at = {pair.a, pair.b, {}};
        return &at.cache;
    }
};

// What every query of pairs checks. `slots`: for how many of these there is room.
Result<void> check(const World& world, std::span<const BodyPair> pairs, size_t room, size_t slots,
                   const Workers& workers) {
    if (room < pairs.size() || pairs.size() > UINT32_MAX) return query::kSpanTooShort;
    if (!query::has_context_each(workers.jobs, workers.contexts)) return query::kTooFewContexts;
    for (size_t i = 0; i < pairs.size(); ++i) {
        if (world.find(pairs[i].a) == nullptr || world.find(pairs[i].b) == nullptr)
            return Error{ErrorCode::bad_id, "a body of this pair has been removed", i};
        if (pairs[i].slot >= slots) return query::kSpanTooShort;
    }
    return {};
}

// Calls ask(pair, body a, body b, context, index) for each pair.
template <class Ask>
void for_pairs(const World& world, std::span<const BodyPair> pairs, const Workers& workers, Ask&& ask) {
    query::for_ranges(workers.jobs, static_cast<uint32_t>(pairs.size()), query::kQueryGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i)
                              ask(pairs[i], *world.find(pairs[i].a), *world.find(pairs[i].b), workers.contexts[worker],
                                  i);
                      });
}

template <class Cache> size_t slots(std::span<OfPair<Cache>> caches) {
    return caches.empty() ? SIZE_MAX : caches.size();
}

template <class Out, class Take>
Result<void> collide_pairs(const World& world, std::span<const BodyPair> pairs, std::span<Out> out,
                           const Workers& workers, const QueryOptions& options, std::span<OfPair<PairCache>> caches,
                           Take&& take) {
    if (const auto good = check(world, pairs, out.size(), slots(caches), workers); !good) return good;
    for_pairs(world, pairs, workers,
              [&](const BodyPair& pair, const Body& a, const Body& b, Scratch context, uint32_t i) {
                  out[i] = take(query::collide(a, b, context, options, Caches<PairCache>{caches}.of(pair)));
              });
    return {};
}

} // namespace

Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<CollideResult> out,
                     const Workers& workers, const QueryOptions& options,
                     std::span<OfPair<PairCache>> caches) noexcept {
    return collide_pairs(world, pairs, out, workers, options, caches, [](const CollideResult& r) { return r; });
}

Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<Verdict> out,
                     const Workers& workers, const QueryOptions& options,
                     std::span<OfPair<PairCache>> caches) noexcept {
    return collide_pairs(world, pairs, out, workers, options, caches, [](const CollideResult& r) { return r.verdict; });
}

Result<void> distance(const World& world, std::span<const BodyPair> pairs, std::span<DistanceResult> out,
                      const Workers& workers, const DistanceOptions& options,
                      std::span<OfPair<DistanceCache>> caches) noexcept {
    if (const auto good = check(world, pairs, out.size(), slots(caches), workers); !good) return good;
    for_pairs(world, pairs, workers,
              [&](const BodyPair& pair, const Body& a, const Body& b, Scratch context, uint32_t i) {
                  out[i] = query::distance(a, b, context, options, Caches<DistanceCache>{caches}.of(pair));
              });
    return {};
}

Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<SolidsResult> out,
                     const Workers& workers, const SolidsOptions& options,
                     std::span<OfPair<SolidsCache>> caches) noexcept {
    if (const auto good = check(world, pairs, out.size(), slots(caches), workers); !good) return good;
    for_pairs(world, pairs, workers,
              [&](const BodyPair& pair, const Body& a, const Body& b, Scratch context, uint32_t i) {
                  out[i] = query::collide_solids(a, b, context, options, Caches<SolidsCache>{caches}.of(pair));
              });
    return {};
}

Result<void> distance(const World& world, std::span<const BodyPair> pairs, std::span<SolidsDistance> out,
                      const Workers& workers, const DistanceOptions& options) noexcept {
    if (const auto good = check(world, pairs, out.size(), SIZE_MAX, workers); !good) return good;
    for_pairs(world, pairs, workers, [&](const BodyPair&, const Body& a, const Body& b, Scratch context, uint32_t i) {
        out[i] = query::distance_solids(a, b, context, options);
    });
    return {};
}

Result<void> sweep(const World& world, std::span<const BodyPair> pairs, std::span<const Motion> motions,
                   std::span<SweepResult> out, const Workers& workers, const SweepOptions& options) noexcept {
    if (const auto good = check(world, pairs, out.size(), SIZE_MAX, workers); !good) return good;
    const auto has_motion = [&](BodyId id) { return id.index < motions.size(); };
    if (!std::ranges::all_of(pairs, [&](const BodyPair& p) { return has_motion(p.a) && has_motion(p.b); }))
        return query::kSpanTooShort;
    for_pairs(world, pairs, workers,
              [&](const BodyPair& pair, const Body& a, const Body& b, Scratch context, uint32_t i) {
                  out[i] = query::sweep(a, motions[pair.a.index], b, motions[pair.b.index], context, options);
              });
    return {};
}

Result<void> contacts(const World& world, std::span<const BodyPair> pairs, std::span<PairContacts> records,
                      const Workers& workers, const QueryOptions& options) noexcept {
    if (const auto good = check(world, pairs, SIZE_MAX, records.size(), workers); !good) return good;
    for_pairs(world, pairs, workers,
              [&](const BodyPair& pair, const Body& a, const Body& b, Scratch context, uint32_t) {
                  PairContacts& record = records[pair.slot];
                  if (record.a != pair.a || record.b != pair.b) {
                      record = {};
                      record.a = pair.a, record.b = pair.b;
                  }
                  record.result = query::contacts(a, b, record.manifolds, context, options);
                  if (record.result.verdict != Verdict::undecided)
                      record.touching = record.result.verdict == Verdict::overlapping;
              });
    return {};
}

Result<size_t> contact_events(const World& world, std::span<PairContacts> records,
                              std::span<ContactEvent> out) noexcept {
    const auto ended = world.ended_pairs(), listed = world.pairs();
    if (records.size() < world.slot_count() || out.size() < ended.size() + listed.size()) return query::kSpanTooShort;
    size_t count = 0;
    const auto add = [&](const BodyPair& pair, ContactEvent::Kind kind) {
        out[count++] = {.a = pair.a, .b = pair.b, .slot = pair.slot, .kind = kind};
    };
    for (const BodyPair& pair : ended) {
        PairContacts& record = records[pair.slot];
        if (record.a != pair.a || record.b != pair.b) continue;
        if (record.reported) add(pair, ContactEvent::Kind::ended);
        record = {};
    }
    for (const BodyPair& pair : listed) {
        PairContacts& record = records[pair.slot];
        if (record.a != pair.a || record.b != pair.b) continue; // never asked about
        const bool before = std::exchange(record.reported, record.touching);
        if (record.touching)
            add(pair, before ? ContactEvent::Kind::stays : ContactEvent::Kind::began);
        else if (before)
            add(pair, ContactEvent::Kind::ended);
    }
    return count;
}

} // namespace prolate

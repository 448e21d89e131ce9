// What is asked of the pairs of a world.
#include "python/src/answers.hpp"
#include "python/src/world.hpp"

namespace prolate::python {

// Contacts that have ended are known only until the pairs are next brought up to date: they are kept for contacts().
Result<void> HeldWorld::update() {
    const auto pairs = world_.update_pairs();
    if (!pairs) return pairs.error();
    if (records_.empty()) return {};
    records_.resize(std::max<size_t>(records_.size(), world_.slot_count()));
    std::vector<ContactEvent> events(world_.ended_pairs().size() + pairs->size());
    const auto count = contact_events(world_, records_, events);
    if (!count) return count.error();
    for (size_t i = 0; i < *count; ++i)
        if (events[i].kind == ContactEvent::Kind::ended) ended_.push_back(events[i]);
    return {};
}

nb::tuple HeldWorld::pairs() {
    std::vector<uint8_t> begin;
    const nb::object ids = ask_pairs(nb::int_(1), [&](const Workers&, std::span<const BodyPair> pairs) -> Result<void> {
        for (const BodyPair& pair : pairs) begin.push_back(pair.begins);
        return {};
    });
    auto begins = new_array<bool>(begin.size());
    std::copy(begin.begin(), begin.end(), begins.get());
    return nb::make_tuple(ids, to_numpy(std::move(begins), {begin.size()}));
}

nb::tuple HeldWorld::collide(nb::handle margin, nb::handle max_level, nb::handle budget, nb::handle threads) {
    const Limits limits(margin, max_level, budget);
    std::vector<Verdict> found;
    const nb::object ids = ask_pairs(threads, [&](const Workers& workers, std::span<const BodyPair> pairs) {
        found.resize(pairs.size());
        return prolate::collide(world_, pairs, std::span(found), workers, limits.options(0));
    });
    auto verdicts = new_array<uint8_t>(found.size());
    for (size_t i = 0; i < found.size(); ++i) verdicts[i] = static_cast<uint8_t>(found[i]);
    return nb::make_tuple(ids, to_numpy(std::move(verdicts), {found.size()}));
}

nb::tuple HeldWorld::collide_solids(nb::handle margin, nb::handle budget, nb::handle threads) {
    const Limits limits(margin, nb::none(), budget);
    std::vector<SolidsResult> found;
    const nb::object ids = ask_pairs(threads, [&](const Workers& workers, std::span<const BodyPair> pairs) {
        found.resize(pairs.size());
        const SolidsOptions options{.max_pair_tests = limits.budget, .margin = rounded_up(limits.margin)};
        return prolate::collide(world_, pairs, std::span(found), workers, options);
    });
    auto verdicts = new_array<uint8_t>(found.size());
    for (size_t i = 0; i < found.size(); ++i) verdicts[i] = static_cast<uint8_t>(found[i].verdict);
    return nb::make_tuple(ids, to_numpy(std::move(verdicts), {found.size()}));
}

nb::tuple HeldWorld::distance(nb::handle tolerance, nb::handle max_distance, nb::handle budget, nb::handle threads) {
    DistanceOptions options;
    options.tolerance_relative = number_from_0(tolerance, "tolerance");
    options.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    if (!max_distance.is_none()) options.max_distance = number_from_0(max_distance, "max_distance");
    std::vector<DistanceResult> found;
    const nb::object ids = ask_pairs(threads, [&](const Workers& workers, std::span<const BodyPair> pairs) {
        found.resize(pairs.size());
        return prolate::distance(world_, pairs, found, workers, options);
    });
    PairArrays out(found.size());
    for (size_t i = 0; i < found.size(); ++i) out.store(i, found[i], {});
    return nb::make_tuple(ids, out.take());
}

nb::tuple HeldWorld::contacts(nb::handle margin, nb::handle budget, nb::handle threads) {
    const Limits limits(margin, nb::none(), budget);
    std::vector<std::vector<Contact>> found;
    std::vector<uint8_t> verdict;
    std::vector<ContactEvent> events;
    const nb::object ids =
        ask_pairs(threads, [&](const Workers& workers, std::span<const BodyPair> pairs) -> Result<void> {
            records_.resize(std::max<size_t>({records_.size(), world_.slot_count(), 1}));
            const auto done = prolate::contacts(world_, pairs, records_, workers, limits.options(0));
            if (!done) return done;
            found.resize(pairs.size());
            for (size_t i = 0; i < pairs.size(); ++i) {
                const PairContacts& record = records_[pairs[i].slot];
                verdict.push_back(static_cast<uint8_t>(record.result.verdict));
                collect(record.manifolds, {}, found[i]);
            }
            events.resize(world_.ended_pairs().size() + pairs.size());
            const auto count = contact_events(world_, records_, events);
            if (!count) return count.error();
            events.resize(*count);
            events.insert(events.begin(), ended_.begin(), ended_.end());
            ended_.clear();
            return {};
        });
    const size_t n = events.size();
    auto event_ids = new_array<uint64_t>(2 * n);
    auto kinds = new_array<uint8_t>(n);
    for (size_t i = 0; i < n; ++i) {
        event_ids[2 * i] = number_of(events[i].a), event_ids[2 * i + 1] = number_of(events[i].b);
        kinds[i] = static_cast<uint8_t>(events[i].kind);
    }
    return nb::make_tuple(ids, contact_arrays(found), to_numpy(verdict, {verdict.size()}),
                          to_numpy(std::move(event_ids), {n, 2}), to_numpy(std::move(kinds), {n}));
}

} // namespace prolate::python

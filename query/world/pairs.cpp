// The pairs of a World, kept from step to step.
//
// Only bodies whose boxes have changed can begin or end a pair, so only those are looked up in the tree, on the host's
// threads; what they find is put in order, and merged with what the old list says of the others. A pair of two changed
// bodies is found from the lower index. Threads write into one array, at places drawn from a counter; if it is too
// short they go on counting, and all is done again with a longer one.
//
// Complexity: O(log n + pairs) a changed body for bodies spread about, O(p log p) for the order of the p pairs found,
// O(pairs) for the merge. A body without bounds costs O(n).
#include "query/world/jobs.hpp"
#include "query/world/state.hpp"

#include <algorithm>
#include <atomic>
#include <new>

namespace prolate {
namespace {

constexpr uint32_t kBodiesATask = 16; // bodies
constexpr uint32_t kNoSlot = UINT32_MAX;
constexpr uint64_t kEnd = UINT64_MAX; // above all keys

uint64_t key(uint32_t a, uint32_t b) {
    return uint64_t{a} << 32 | b;
}

// What all workers share.
struct Findings {
    std::span<uint64_t> out;
    std::atomic<uint64_t> count{0}, box_tests{0};
};

// The search of one worker in one range: collects before it writes, so that the counter is not fought for.
class PairCollector {
public:
    PairCollector(const World::State& state, Findings& findings) : s_(state), findings_(findings) {}
    ~PairCollector() {
        flush();
        findings_.box_tests.fetch_add(box_tests_, std::memory_order_relaxed);
    }

    void look_up(uint32_t index) {
        if (!s_.marks[index].alive) return;
        const uint32_t leaf = s_.entries[index].leaf;
        if (leaf == query::BoundsTree::kNone) {
            for (uint32_t other = 0; other < s_.marks.size(); ++other)
                if (s_.marks[other].alive) consider(index, other);
            return;
        }
        const Bounds box = s_.tree.box(leaf);
        s_.tree.walk(
            [&](const Bounds& other) {
                ++box_tests_;
                return overlap(box, other);
            },
            [&](uint32_t other) {
                consider(index, other);
                return true;
            });
        for (const uint32_t other : s_.unbounded) consider(index, other);
    }

private:
    void consider(uint32_t index, uint32_t other) {
        const World::State::Mark &own = s_.marks[index], &others = s_.marks[other];
        if (own.body == others.body || (other < index && others.changed)) return;
        if ((own.layers & others.mask) == 0 || (others.layers & own.mask) == 0) return;
        if ((own.half_space || others.half_space) && s_.apart_from_half_space(index, other)) return;
        const auto [a, b] = std::minmax(index, other);
        if (s_.options.filter && !s_.options.filter(s_.options.filter_user, s_.entries[a].body, s_.entries[b].body))
            return;
        if (count_ == kRoom) flush();
        keys_[count_++] = key(a, b);
    }
    void flush() {
        const uint64_t at = findings_.count.fetch_add(count_, std::memory_order_relaxed);
        if (at + count_ <= findings_.out.size()) std::copy_n(keys_, count_, findings_.out.data() + at);
        count_ = 0;
    }

    static constexpr uint32_t kRoom = 256;
    const World::State& s_;
    Findings& findings_;
    uint64_t box_tests_ = 0;
    uint32_t count_ = 0;
    uint64_t keys_[kRoom];
};

} // namespace

void World::State::reserve_pairs(uint32_t count_of_pairs) {
    if (found.size() < count_of_pairs) found.resize(count_of_pairs);
    pairs.reserve(count_of_pairs);
    next_pairs.reserve(count_of_pairs);
    ended.reserve(count_of_pairs);
    free_slots.reserve(2 * size_t{count_of_pairs}); // slots: of pairs, and of those that have ended
}

uint64_t World::State::find_pairs(const Jobs& jobs) {
    for (;;) {
        Findings findings{found};
        query::for_ranges(jobs, static_cast<uint32_t>(changed.size()), kBodiesATask,
                          [&](uint32_t begin, uint32_t end, uint32_t) {
                              PairCollector search(*this, findings);
                              for (uint32_t i = begin; i < end; ++i) search.look_up(changed[i]);
                          });
        const uint64_t total = findings.count;
        if (total <= found.size()) {
            std::sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(total));
            stats.changed = static_cast<uint32_t>(changed.size()), stats.box_tests = findings.box_tests;
            return total;
        }
        if (total > UINT32_MAX) throw std::bad_alloc();
        found.resize(static_cast<size_t>(std::min<uint64_t>(total + total / 4, UINT32_MAX)));
    }
}

void World::State::merge_pairs(uint64_t found_count) {
    const auto stays = [&](const BodyPair& p) { // in the list, whatever was found
        return names(p.a) && names(p.b) && !marks[p.a.index].changed && !marks[p.b.index].changed;
    };
    const uint64_t total = found_count + static_cast<uint64_t>(std::ranges::count_if(pairs, stays));
    if (total > UINT32_MAX) throw std::bad_alloc();
    next_pairs.reserve(static_cast<size_t>(total));
    ended.reserve(pairs.size());
    free_slots.reserve(slot_count);
    for (const BodyPair& p : ended) free_slots.push_back(p.slot); // the caller has had time to look them up
    ended.clear();
    next_pairs.clear();
    const auto add = [&](BodyId a, BodyId b, uint32_t slot) {
        const bool either_moved = marks[a.index].moved || marks[b.index].moved;
        next_pairs.push_back({.a = a, .b = b, .slot = slot, .begins = slot == kNoSlot, .moved = either_moved});
    };
    auto old = pairs.begin();
    for (uint64_t i = 0;;) {
        const uint64_t old_key = old != pairs.end() ? key(old->a.index, old->b.index) : kEnd;
        const uint64_t new_key = i < found_count ? found[static_cast<size_t>(i)] : kEnd;
        if (old_key == kEnd && new_key == kEnd) break;
        const bool goes_on = old_key == new_key ? names(old->a) && names(old->b) : old_key < new_key && stays(*old);
        if (goes_on) {
            add(old->a, old->b, old->slot);
        } else {
            if (old_key <= new_key) ended.push_back(*old);
            if (new_key <= old_key)
                add(id(static_cast<uint32_t>(new_key >> 32)), id(static_cast<uint32_t>(new_key)), kNoSlot);
        }
        if (old_key <= new_key) ++old;
        if (new_key <= old_key) ++i;
    }
    for (BodyPair& pair : next_pairs) {
        if (pair.slot != kNoSlot) continue;
        if (free_slots.empty()) {
            pair.slot = slot_count++;
        } else {
            pair.slot = free_slots.back();
            free_slots.pop_back();
        }
    }
    std::swap(pairs, next_pairs);
    for (const uint32_t index : changed) marks[index].changed = false;
    for (const uint32_t index : moved) marks[index].moved = false;
    changed.clear(), moved.clear();
}

Result<std::span<const BodyPair>> World::update_pairs(const Jobs& jobs) noexcept {
    if (state_->busy()) return query::kBusy;
    try {
        const State::Busy busy(*state_);
        state_->merge_pairs(state_->find_pairs(jobs));
        return pairs();
    } catch (...) {
        return Error{ErrorCode::out_of_memory, "the world's memory resource gave no more for pairs", 0};
    }
}

std::span<const BodyPair> World::pairs() const noexcept {
    return state_->pairs;
}

std::span<const BodyPair> World::ended_pairs() const noexcept {
    return state_->ended;
}

uint32_t World::slot_count() const noexcept {
    return state_->slot_count;
}

} // namespace prolate

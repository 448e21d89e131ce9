// What a World is made of. world.cpp keeps the bodies, boxes.cpp their boxes, pairs.cpp the list of pairs.
//
// A body and each of its parts is an entry: either a leaf of the tree or, if it has no finite box, in the list of
// unbounded ones. The parts of a body are a chain. What all pairs are asked about is kept apart, in few bytes an entry:
// the lists of pairs jump about in it.
#pragma once

#include "query/world/bounds.hpp"
#include "query/world/bounds_tree.hpp"

#include <prolate/world.hpp>

#include <atomic>

namespace prolate {

struct World::State {
    static constexpr uint32_t kNoEntry = UINT32_MAX;
    struct Entry {
        Body body;
        query::LocalBounds local = {};
        Pose in_body = {};                        // a part's, in the body's frame
        uint32_t next = kNoEntry;                 // part of the same body
        uint32_t leaf = query::BoundsTree::kNone; // kNone: unbounded
        uint32_t unbounded_at = 0;                // where, in that list
        query::Anchor anchor = {};                // where a box was last computed, and how far from there
        double room = -1;                         // it may move within the leaf's box
        uint64_t batch = 0;                       // the last move() of many that named it
    };
    struct Mark { // of an entry
        uint32_t generation = 1;
        uint32_t layers = 0, mask = 0; // the body's
        uint32_t body = 0;             // the entry that it is a part of, or itself
        bool alive = false, half_space = false;
        bool moved = false, changed = false; // since the last update_pairs(): its pose, its box
    };
    struct Placement { // what a move comes to
        bool stays;    // within the box that the body has
        double room;   // of Entry; if below 0, no box had to be computed
        Bounds box;
        query::Anchor anchor;
    };
    struct Move {
        uint32_t index;
        Pose pose;
        Placement placement;
    };
    // While one lives, the caller's functions may be running: nothing may change.
    class Busy {
    public:
        explicit Busy(const State& state) : running_(state.running) {
            running_.fetch_add(1, std::memory_order_relaxed);
        }
        ~Busy() { running_.fetch_sub(1, std::memory_order_relaxed); }
        Busy(const Busy&) = delete;
        Busy& operator=(const Busy&) = delete;

    private:
        std::atomic<uint32_t>& running_;
    };

    State(const WorldOptions& o, std::pmr::memory_resource* m)
        : memory(m), options(o), tree(m), entries(m), marks(m), free_entries(m), unbounded(m), changed(m), moved(m),
          moves(m), found(m), pairs(m), next_pairs(m), ended(m), free_slots(m) {}

    // Throw what the memory resource throws.
    void reserve_bodies(uint32_t count);
    void reserve_pairs(uint32_t count);

    bool names(BodyId id) const noexcept {
        return id.index < marks.size() && marks[id.index].generation == id.generation && marks[id.index].alive;
    }
    // A body's own id, not that of another part.
    bool names_body(BodyId id) const noexcept { return names(id) && marks[id.index].body == id.index; }
    bool busy() const noexcept { return running.load(std::memory_order_relaxed) > 0; }
    BodyId id(uint32_t index) const noexcept { return {index, marks[index].generation}; }
    uint32_t add(const Entry& entry) noexcept; // there must be room
    void take_away(uint32_t index) noexcept;
    // Calls call(index, pose) for all parts of a body at `pose`.
    template <class Call> void for_parts(uint32_t body, const Pose& pose, Call&& call) const {
        call(body, pose);
        for (uint32_t i = entries[body].next; i != kNoEntry; i = entries[i].next)
            call(i, part_pose(pose, entries[i].in_body));
    }

    // Certainly no pair, though one has no box: a half-space, and a box beyond it; or two half-spaces.
    bool apart_from_half_space(uint32_t one, uint32_t other) const noexcept;
    Placement place(const Entry& entry, const Pose& pose) const noexcept;
    double room_for(const Entry& entry, const Bounds& box) const noexcept;
    void move(const Move& move) noexcept;
    void enter(uint32_t index, const Bounds& box,
               const query::Anchor& anchor) noexcept; // among the leaves or the unbounded
    void leave(uint32_t index) noexcept;
    void mark_changed(uint32_t index) noexcept;
    void mark_moved(uint32_t index) noexcept;

    // Fills `found`, in order, with the pairs of which a box has changed, and returns their number. May throw.
    uint64_t find_pairs(const Jobs& jobs);
    // Makes the new list from the old and `found`. May throw, but then has changed nothing.
    void merge_pairs(uint64_t found_count);

    std::pmr::memory_resource* memory;
    WorldOptions options;
    query::BoundsTree tree;
    uint32_t capacity = 0; // bodies that need no allocation
    uint32_t count = 0;
    std::pmr::vector<Entry> entries;
    std::pmr::vector<Mark> marks;
    std::pmr::vector<uint32_t> free_entries, unbounded;
    std::pmr::vector<uint32_t> changed, moved; // those so marked; some may be dead
    std::pmr::vector<Move> moves;              // of the move() of many that is at work
    uint64_t batch = 0;
    mutable std::atomic<uint32_t> running{0}; // calls that call the caller's functions

    std::pmr::vector<uint64_t> found; // a.index 2^32 + b.index
    std::pmr::vector<BodyPair> pairs, next_pairs, ended;
    std::pmr::vector<uint32_t> free_slots;
    uint32_t slot_count = 0;
    WorldStats stats;
};

inline const World::State& state_of(const World& world) noexcept {
    return *world.state_;
}

namespace query {

/// Does no point of the box lie in the half-space, or within the margin of it?
bool certainly_apart(const HalfSpace& half_space, float margin, const Bounds& box) noexcept;

inline constexpr Error kBusy{ErrorCode::busy, "the world is calling a function of the caller's", 0};

} // namespace query
} // namespace prolate

// What a World is made of. world.cpp keeps the bodies and their boxes, pairs.cpp the list of pairs.
//
// Every body is either a leaf of the tree or, if it has no finite box, in the list of unbounded ones. What all pairs
// are asked about is kept apart, in few bytes a body: the lists of pairs jump about in it.
#pragma once

#include "query/world/bounds.hpp"
#include "query/world/bounds_tree.hpp"

#include <prolate/world.hpp>

namespace prolate {

struct World::State {
    struct Entry {
        Body body;
        query::LocalBounds local;
        uint32_t leaf = query::BoundsTree::kNone; // kNone: unbounded
        uint32_t unbounded_at = 0;                // where, in that list
        query::Anchor anchor = {};                // where a box was last computed, and how far from there
        double room = -1;                         // it may move within the leaf's box
        uint64_t batch = 0;                       // the last move() of many that named it
    };
    struct Mark { // of an entry
        uint32_t generation = 1;
        uint32_t layers = 0, mask = 0; // the body's
        bool alive = false;
        bool moved = false, changed = false; // since the last update_pairs(): its pose, its box
    };
    struct Placement { // what a move comes to
        bool stays;    // within the box that the body has
        double room;   // of Entry; if below 0, no box had to be computed
        Bounds box;
        query::Anchor anchor;
    };

    State(const WorldOptions& o, std::pmr::memory_resource* m)
        : memory(m), options(o), tree(m), entries(m), marks(m), free_entries(m), unbounded(m), changed(m), moved(m),
          placements(m), found(m), pairs(m), next_pairs(m), free_slots(m) {}

    // Throw what the memory resource throws.
    void reserve_bodies(uint32_t count);
    void reserve_pairs(uint32_t count);

    bool names(BodyId id) const noexcept {
        return id.index < marks.size() && marks[id.index].generation == id.generation && marks[id.index].alive;
    }
    BodyId id(uint32_t index) const noexcept { return {index, marks[index].generation}; }
    Placement place(const Entry& entry, const Pose& pose) const noexcept;
    double room_for(const Entry& entry, const Bounds& box) const noexcept;
    void move(uint32_t index, const Pose& pose, const Placement& placement) noexcept;
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
    std::pmr::vector<Placement> placements;
    uint64_t batch = 0;

    std::pmr::vector<uint64_t> found; // a.index 2^32 + b.index
    std::pmr::vector<BodyPair> pairs, next_pairs;
    std::pmr::vector<uint32_t> free_slots;
    uint32_t slot_count = 0;
    WorldStats stats;
};

} // namespace prolate

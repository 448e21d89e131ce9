// A world of many bodies: which of them may touch, and do they?
//
// A World is a broadphase, in the way of Box2D's and Bullet's: each body has a box, somewhat larger than it need be, so
// that small moves change nothing, and a dynamic tree of these boxes (query/world/bounds_tree.hpp has the sources)
// finds those that overlap. What it promises: two bodies whose solids come nearer than their margins together are a
// pair. Rounding is outward throughout. A body whose pose is not finite, or whose box is beyond the range of floats,
// never separates: it is a pair with every other body that the filter admits.
//
// Memory comes from one std::pmr::memory_resource, given at the start. Only create(), reserve(), insert() and
// update_pairs() take any, and the last two none as long as what was reserved suffices. If it refuses, they fail with
// out_of_memory and change nothing.
//
// Threads: const functions may be called at the same time as each other, on one world; the others need it for
// themselves. Trees are only read. Functions that take Jobs do their work on the host's threads, and return the same
// for any number of them. The same calls in the same order give the same results.
#pragma once

#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/error.hpp>
#include <prolate/jobs.hpp>
#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <memory>
#include <memory_resource>
#include <span>
#include <type_traits>

namespace prolate {

/// Names a body of a World. An id is never given twice: that of a removed body is refused for ever.
struct BodyId {
    uint32_t index = 0;      ///< below the largest number of bodies at any time; reused
    uint32_t generation = 0; ///< 0 names no body
    friend bool operator==(const BodyId&, const BodyId&) = default;
};

/// A solid in a World.
struct Body {
    TreeView tree; ///< its bytes must outlive the body
    Pose pose;
    uint64_t user = 0;           ///< the caller's own
    uint32_t layers = 1;         ///< bits: what it is
    uint32_t mask = ~uint32_t{}; ///< bits: what it meets. A pair needs layers of each in the mask of the other.
    float margin = 0; ///< metres, finite, >= 0: a pair whose solids come nearer than both margins together counts
};

/// Options of a World.
struct WorldOptions {
    /// How much larger than need be a box is on each side, as a part of its longest one: 0 ... 1. More means fewer
    /// changes of the tree and more pairs that do not touch.
    float slack = 0.1f;
    /// Has the last word about a pair that layers and masks admit; null: all. `a` has the lower index. Must be a pure
    /// function of the two bodies, and be safe to call from all workers: it is asked when a pair begins and when the
    /// box of one of the two has changed. World::refilter() has it asked again.
    bool (*filter)(void* user, const Body& a, const Body& b) = nullptr;
    void* filter_user = nullptr; ///< handed to filter
};

/// Two bodies whose boxes overlap.
struct BodyPair {
    BodyId a, b;   ///< a.index < b.index
    uint32_t slot; ///< a number of its own as long as the pair lasts, below World::slot_count(): where the caller may
                   ///< keep, in an array, what it knows of the pair from earlier steps
    bool begins;   ///< it was not there at the last update_pairs(); what `slot` holds is another's
    bool moved;    ///< one of the bodies was inserted or moved since
    friend bool operator==(const BodyPair&, const BodyPair&) = default;
};

/// What a World holds, and what the last update_pairs() did.
struct WorldStats {
    uint32_t bodies = 0;
    uint32_t unbounded = 0; ///< bodies without a finite box
    uint32_t changed = 0;   ///< bodies whose boxes had changed
    uint64_t box_tests = 0; ///< boxes compared
};

class World {
public:
    /// An empty world, whose memory is `memory`'s; null: std::pmr::get_default_resource(). It must outlive the world.
    /// Fails with bad_options or out_of_memory.
    static Result<World> create(const WorldOptions& options = {}, std::pmr::memory_resource* memory = nullptr) noexcept;

    /// Makes room for so many bodies and pairs, so that nothing allocates as long as there are no more at any time.
    /// Fails with out_of_memory.
    Result<void> reserve(uint32_t bodies, uint32_t pairs) noexcept;

    /// Fails with bad_options (margin) or out_of_memory. Cost: a few microseconds, most of them for the tree's local
    /// box.
    Result<BodyId> insert(const Body& body) noexcept;
    /// Fails with bad_id. The body's pairs are listed until the next update_pairs().
    Result<void> remove(BodyId id) noexcept;
    /// Fails with bad_id.
    Result<void> move(BodyId id, const Pose& pose) noexcept;
    /// Moves ids[i] to poses[i]. The boxes are the jobs' work. Fails with bad_options if the spans' lengths differ or a
    /// body is named twice, or with bad_id; `where` is the index of the offence. Then nothing has moved.
    Result<void> move(std::span<const BodyId> ids, std::span<const Pose> poses, const Jobs& jobs = {}) noexcept;
    /// Changes what a body is and meets, and has the filter asked again about it. Fails with bad_id.
    Result<void> refilter(BodyId id, uint32_t layers, uint32_t mask) noexcept;

    /// The body, or null if there is none. Valid until the world changes.
    const Body* find(BodyId id) const noexcept;
    uint32_t body_count() const noexcept;

    /// Brings the list of pairs up to date, and returns it as pairs() does. Only what boxes that have changed may meet
    /// is looked for. Fails with out_of_memory; then the list is the old one, and a later call finds all.
    Result<std::span<const BodyPair>> update_pairs(const Jobs& jobs = {}) noexcept;
    /// The pairs as of the last update_pairs(), ordered by a.index, then b.index. Valid until the next.
    std::span<const BodyPair> pairs() const noexcept;
    /// All slots of pairs are below. Never falls.
    uint32_t slot_count() const noexcept;
    WorldStats stats() const noexcept;

    /// collide() for each of `pairs` – all of pairs(), or some – at the bodies' present poses; out[i] answers pairs[i].
    /// Each worker uses the context of its number. Fails with bad_options if `out` is shorter than `pairs` or
    /// `contexts` than jobs.workers, or with bad_id, `where` being the pair's index; then nothing was asked.
    Result<void> collide(std::span<const BodyPair> pairs, std::span<CollideResult> out,
                         std::span<QueryContext> contexts, const Jobs& jobs = {},
                         const QueryOptions& options = {}) const noexcept;

    /// Calls call(BodyId) for bodies with a layer in `mask` whose boxes meet `box`, until it returns false: all whose
    /// solids, or their margins, do, and some more. In no particular order, but always the same. `call` must not
    /// change the world, and a NaN in `box` meets all.
    template <class Call> void visit(const Bounds& box, Call&& call, uint32_t mask = ~uint32_t{}) const {
        using Callable = std::remove_reference_t<Call>;
        visit_boxes(
            box, mask, [](void* user, BodyId id) -> bool { return (*static_cast<Callable*>(user))(id); },
            const_cast<void*>(static_cast<const void*>(&call)));
    }

    /// Calls call(BodyId, float until) for bodies with a layer in `mask` whose boxes meet `box` moved by t `direction`
    /// for a t from 0 to `until`: all whose solids, or their margins, do, and some more; nearer ones rather earlier. It
    /// returns the `until` from there on – the t of a hit, so that only nearer bodies follow, or the same again, or a
    /// negative number to end. A box of one point is a ray; a box around a body's sphere about the center of its
    /// rotation serves a sweep. `call` must not change the world. A NaN meets all.
    template <class Call>
    void cast(const Bounds& box, const Vec3& direction, float until, Call&& call, uint32_t mask = ~uint32_t{}) const {
        using Callable = std::remove_reference_t<Call>;
        cast_boxes(
            box, direction, until, mask,
            [](void* user, BodyId id, float t) -> float { return (*static_cast<Callable*>(user))(id, t); },
            const_cast<void*>(static_cast<const void*>(&call)));
    }

    /// Of what was moved from, only destruction and assignment are allowed.
    World(World&&) noexcept = default;
    World& operator=(World&&) noexcept = default;

    struct State; ///< internal

private:
    struct Deleter {
        void operator()(State* state) const noexcept;
    };
    explicit World(State* state) : state_(state) {}
    void visit_boxes(const Bounds& box, uint32_t mask, bool (*call)(void*, BodyId), void* user) const;
    void cast_boxes(const Bounds& box, const Vec3& direction, float until, uint32_t mask,
                    float (*call)(void*, BodyId, float), void* user) const;

    std::unique_ptr<State, Deleter> state_;
};

} // namespace prolate

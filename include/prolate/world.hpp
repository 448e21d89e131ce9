// A world of many bodies: which of them may touch? world_queries.hpp asks whether they do, how far apart they are, and
// where they touch, of all pairs in one call.
//
// A body is a tree at a pose, or a half-space: ground, which is a pair with what comes near it and costs nothing else.
// A body may have more trees, its parts, that move with it: a compound. Pairs are pairs of parts, each with an id of
// its own, so that an L-shaped compound has two tight boxes rather than a wide one, and contacts are kept part by part.
//
// A World is a broadphase like those of Box2D and Bullet: each body has a box, somewhat larger than necessary, so that
// small moves change nothing, and a dynamic tree of these boxes (query/world/bounds_tree.hpp has the sources) finds
// those that overlap. It promises that two bodies are a pair if their solids are nearer to each other than the sum of
// their margins; rounding is outward throughout. A body whose pose is not finite, or whose box is beyond the range of
// floats, is a pair with every other body that the filter admits.
//
// Memory comes from one std::pmr::memory_resource, given at the start. Only create(), reserve(), insert() and
// update_pairs() allocate, and the last two do not as long as what was reserved suffices. If the resource has no more,
// they fail with out_of_memory and change nothing.
//
// Threads: concurrent calls of const functions on one World are safe; every other call needs exclusive access. A
// function that the world calls (by visit(), cast() or as the filter) may call const functions, but must change
// nothing: insert(), remove(), move(), refilter(), reserve() and update_pairs() then fail with `busy` and do nothing.
// Remove bodies after the call, or while going through pairs() or events, which stay as they are. Trees are only read.
// Functions that take Jobs work on the host's threads, and their results do not depend on how many there are. The same
// calls in the same order give the same results.
#pragma once

#include <prolate/bounds.hpp>
#include <prolate/error.hpp>
#include <prolate/jobs.hpp>
#include <prolate/shapes.hpp>
#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <memory>
#include <memory_resource>
#include <span>
#include <type_traits>
#include <variant>

namespace prolate {

/// Names a body of a World, or a part of one. The id of a removed body is never reused.
struct BodyId {
    uint32_t index = 0;      ///< below the largest number of bodies and parts so far; reused with another generation
    uint32_t generation = 0; ///< 0 names no body
    friend bool operator==(const BodyId&, const BodyId&) = default;
};

/// A solid in a World.
struct Body {
    /// A tree, whose bytes must outlive the body, or a half-space. That is given in the world, and stays there: its
    /// pose is not used. Two half-spaces are no pair.
    std::variant<TreeView, HalfSpace> shape;
    Pose pose;
    uint64_t user = 0;           ///< for the caller's own use
    uint32_t layers = 1;         ///< bits: the layers that the body is in
    uint32_t mask = ~uint32_t{}; ///< bits: the layers that it meets. Bodies of a pair must meet each other.
    float margin = 0; ///< metres, finite, at least 0: bodies are a pair if nearer than the sum of their margins

    const TreeView* tree() const noexcept { return std::get_if<TreeView>(&shape); }         ///< null of a half-space
    const HalfSpace* half_space() const noexcept { return std::get_if<HalfSpace>(&shape); } ///< null of a tree
};

/// Another tree of a body.
struct Part {
    TreeView tree; ///< its bytes must outlive the body
    Pose pose;     ///< in the body's frame
};

/// Where a part of a body is: `local` first, then `pose`, in double precision and rounded to floats once. For queries,
/// the part is exactly there. Thread-safe.
Pose part_pose(const Pose& pose, const Pose& local) noexcept;

/// Options of a World.
struct WorldOptions {
    /// By how much a box is enlarged on each side, as a part of its longest one: 0 ... 1. More means fewer changes of
    /// the tree, and more pairs that do not touch.
    float slack = 0.1f;
    /// Decides on pairs that layers and masks admit; null admits all. Parts of one body are never asked about, and no
    /// pair. `a` has the lower index. Must be a pure function
    /// of the two bodies that is safe to call from all workers. It is called when a pair begins, when the box of one of
    /// its bodies has changed, and after World::refilter().
    bool (*filter)(void* user, const Body& a, const Body& b) = nullptr;
    void* filter_user = nullptr; ///< handed to filter
};

/// Two bodies whose boxes overlap.
struct BodyPair {
    BodyId a, b;   ///< of bodies or parts, a.index < b.index
    uint32_t slot; ///< the pair's own number for as long as it lasts, below World::slot_count(): an index into an array
                   ///< of the caller's in which it keeps caches, say
    bool begins;   ///< new since the last update_pairs(): what the caller keeps at `slot` is another pair's. It was
                   ///< free for one update_pairs() at least, so that what has ended can still be looked up
    bool moved;    ///< one of the bodies was inserted or moved since the last update_pairs()
    friend bool operator==(const BodyPair&, const BodyPair&) = default;
};

/// What a World holds, and what the last update_pairs() did.
struct WorldStats {
    uint32_t bodies = 0;    ///< and parts
    uint32_t unbounded = 0; ///< those without a finite box: half-spaces, too
    uint32_t changed = 0;   ///< bodies whose boxes were made anew
    uint64_t box_tests = 0; ///< boxes compared
};

class World {
public:
    /// An empty world that takes its memory from `memory`, which must outlive it; null stands for
    /// std::pmr::get_default_resource(). Fails with bad_options or out_of_memory.
    static Result<World> create(const WorldOptions& options = {}, std::pmr::memory_resource* memory = nullptr) noexcept;

    /// Makes room for this many bodies (of compounds, each part counts) and pairs. Nothing allocates as long as there
    /// are never more. Fails with out_of_memory.
    Result<void> reserve(uint32_t bodies, uint32_t pairs) noexcept;

    /// Adds a body, with parts beside its own tree if there are any. Takes a few microseconds a tree, most of them for
    /// its local box. Returns the body's id; part() has those of its parts, which are in the body's layers, and have
    /// its mask, margin and user. Fails with bad_options (margin, or a half-space with parts) or out_of_memory.
    Result<BodyId> insert(const Body& body, std::span<const Part> parts = {}) noexcept;
    /// Removes a body and its parts. Their pairs stay listed until the next update_pairs(). Fails with bad_id, as the
    /// following three do, for ids of parts, too.
    Result<void> remove(BodyId id) noexcept;
    /// Moves a body and its parts. Fails with bad_id, or with bad_options for a half-space.
    Result<void> move(BodyId id, const Pose& pose) noexcept;
    /// Moves ids[i] to poses[i]; the boxes are computed by the jobs. Fails with bad_options if the spans' lengths
    /// differ, a body is named twice or is a half-space, or with bad_id; `where` is the index of the offence. Then
    /// nothing has moved.
    Result<void> move(std::span<const BodyId> ids, std::span<const Pose> poses, const Jobs& jobs = {}) noexcept;
    /// Changes the layers and the mask of a body; the filter is asked again about its pairs. Fails with bad_id.
    Result<void> refilter(BodyId id, uint32_t layers, uint32_t mask) noexcept;

    /// The body, or of a part its tree at its pose in the world; null if there is none. Valid until the world changes.
    const Body* find(BodyId id) const noexcept;
    /// The body that a part belongs to; itself for a body, and BodyId{} if there is none.
    BodyId body_of(BodyId id) const noexcept;
    /// Part `i` of a body, in the order of insert(), or BodyId{} if there is none: 0 is the body itself.
    BodyId part(BodyId id, uint32_t i) const noexcept;
    /// Parts of compounds count as bodies.
    uint32_t body_count() const noexcept;

    /// Brings the list of pairs up to date and returns it, as pairs() does. Its cost depends on how many boxes have
    /// changed. Fails with out_of_memory; then the list is the old one, and a later call finds all pairs.
    Result<std::span<const BodyPair>> update_pairs(const Jobs& jobs = {}) noexcept;
    /// The pairs as of the last update_pairs(), ordered by a.index, then b.index. Valid until the next update_pairs().
    std::span<const BodyPair> pairs() const noexcept;
    /// The pairs that the last update_pairs() took from the list, in the same order: their boxes have parted, a body
    /// was removed, or the filter or the layers changed. Ids may be those of removed bodies. Valid until the next
    /// update_pairs().
    std::span<const BodyPair> ended_pairs() const noexcept;
    /// BodyPair::slot is below this. Never falls.
    uint32_t slot_count() const noexcept;
    WorldStats stats() const noexcept;

    /// Calls call(BodyId) for the bodies that have a layer in `mask` and whose boxes meet `box`, until it returns
    /// false. These are all bodies whose solids, inflated by their margins, meet `box`, and some more. The order is
    /// unspecified, but always the same. A NaN in `box` meets all bodies.
    template <class Call> void visit(const Bounds& box, Call&& call, uint32_t mask = ~uint32_t{}) const {
        using Callable = std::remove_reference_t<Call>;
        visit_boxes(
            box, mask, [](void* user, BodyId id) -> bool { return (*static_cast<Callable*>(user))(id); },
            const_cast<void*>(static_cast<const void*>(&call)));
    }

    /// Calls call(BodyId, float until) for the bodies that have a layer in `mask` and whose boxes meet `box` when it is
    /// moved by t * direction, for some t from 0 to `until`. These are all bodies whose solids, inflated by their
    /// margins, meet it, and some more, nearer ones first by tendency.
    ///
    /// `call` returns the new `until`: the t of a hit, so that only nearer bodies follow; the old one; or a negative
    /// number, to end. A box of a single point makes a ray. For a sweep, take the box of
    /// a sphere that holds the body and has its center at Motion::center. A NaN meets all bodies.
    template <class Call>
    void cast(const Bounds& box, const Vec3& direction, float until, Call&& call, uint32_t mask = ~uint32_t{}) const {
        using Callable = std::remove_reference_t<Call>;
        cast_boxes(
            box, direction, until, mask,
            [](void* user, BodyId id, float t) -> float { return (*static_cast<Callable*>(user))(id, t); },
            const_cast<void*>(static_cast<const void*>(&call)));
    }

    /// A world that was moved from may only be destroyed or assigned to.
    World(World&&) noexcept = default;
    World& operator=(World&&) noexcept = default;

    struct State; ///< internal
    friend const State& state_of(const World& world) noexcept;

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

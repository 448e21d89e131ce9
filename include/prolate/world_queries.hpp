// What is asked of the bodies of a World in one call: of its pairs (do they meet, how far apart are they, where do they
// touch, when will they meet?), or from outside (what does a ray hit, what meets a shape, what does a moving body
// hit?).
//
// Each answer is that of the query of two bodies of the same name, with all that it certifies, at the bodies' present
// poses. A half-space takes the part of one body as half_space.hpp and shapes.hpp have it.
//
// The work is shared out among the workers, and no answer depends on how many there are. Nothing is allocated. The
// world must not change meanwhile; it may be asked by several threads at the same time, each with contexts of its own.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/jobs.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/solids.hpp>
#include <prolate/sweep.hpp>
#include <prolate/world.hpp>

#include <cstdint>
#include <span>
#include <variant>

namespace prolate {

/// Who does the work: worker i, below jobs.workers, uses contexts[i]. With fewer contexts than workers, calls fail with
/// bad_options.
struct Workers {
    std::span<QueryContext> contexts;
    Jobs jobs = {};
};

// ---- pairs ----
//
// `pairs` are all of World::pairs(), or some: those with `moved`, say, if the others keep their answers. out[i] is the
// answer for pairs[i]. Fails with bad_options if a span is too short, or with bad_id if a body of pairs[i] has been
// removed, `where` being i. Then no query was made.

/// A cache of a pair of bodies, in an array of the caller's at BodyPair::slot: World::slot_count() of them. It knows
/// whose it is. What it holds of other bodies is never used, so it needs no care when pairs come and go. A body keeps
/// its tree, so that is never stale either.
template <class Cache> struct OfPair {
    BodyId a, b;
    Cache cache;
};

/// Do they meet? With the verdict alone, one byte a pair is written.
Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<CollideResult> out,
                     const Workers& workers, const QueryOptions& options = {},
                     std::span<OfPair<PairCache>> caches = {}) noexcept;
Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<Verdict> out,
                     const Workers& workers, const QueryOptions& options = {},
                     std::span<OfPair<PairCache>> caches = {}) noexcept;

/// How far apart are they?
Result<void> distance(const World& world, std::span<const BodyPair> pairs, std::span<DistanceResult> out,
                      const Workers& workers, const DistanceOptions& options = {},
                      std::span<OfPair<DistanceCache>> caches = {}) noexcept;

/// Do the solids meet, and how far apart are they? As collide() and distance() of a Solid (solids.hpp). Over a
/// half-space, a solid certainly meets it where a leaf of its inner cover reaches into it.
Result<void> collide(const World& world, std::span<const BodyPair> pairs, std::span<SolidsResult> out,
                     const Workers& workers, const SolidsOptions& options = {},
                     std::span<OfPair<SolidsCache>> caches = {}) noexcept;
Result<void> distance(const World& world, std::span<const BodyPair> pairs, std::span<SolidsDistance> out,
                      const Workers& workers, const DistanceOptions& options = {}) noexcept;

/// When do they first meet, if body `id` moves by motions[id.index]? Where they are now does not matter, only
/// Motion::start; of a half-space the motion is not used. `motions` are World::body_count() or more: enough for all
/// indices that `pairs` name. Pairs are listed by the bodies' boxes at their present poses: margins must make up for
/// the motions.
Result<void> sweep(const World& world, std::span<const BodyPair> pairs, std::span<const Motion> motions,
                   std::span<SweepResult> out, const Workers& workers, const SweepOptions& options = {}) noexcept;

/// The contacts of a pair, in an array of the caller's at BodyPair::slot, as OfPair: about 1 KB. Keep it from one step
/// to the next; ages and impulses of points go on as in contacts.hpp.
struct PairContacts {
    BodyId a, b;                ///< whose contacts these are; normals point from `a` to `b`
    ContactResult result;       ///< of the last contacts()
    bool touching = false;      ///< the last verdict that was not undecided was overlapping
    bool reported = false;      ///< touching, when contact_events() was last asked
    ContactManifolds manifolds; ///< in which the solver leaves its impulses
};

/// Where do they touch? records[pairs[i].slot] gets the contacts of pairs[i]; `records` are World::slot_count().
Result<void> contacts(const World& world, std::span<const BodyPair> pairs, std::span<PairContacts> records,
                      const Workers& workers, const QueryOptions& options = {}) noexcept;

/// Two bodies that touch, or did.
struct ContactEvent {
    enum class Kind : uint8_t { began, stays, ended };
    BodyId a, b;       ///< a.index < b.index; of a pair that has ended, one or both may have been removed
    uint32_t slot = 0; ///< of its record. That of a pair that has ended is no longer valid if the pair left the list
    Kind kind = Kind::began;
    friend bool operator==(const ContactEvent&, const ContactEvent&) = default;
};

/// What has changed since the last call, after contacts() of the pairs: first, those that left the list while they
/// touched, `ended`; then each pair of the list that touches, `began` or `stays`, and those that no longer do, `ended`;
/// both in the order of the lists. Returns how many there are. Call it after each update_pairs() to miss none; bodies
/// may be removed while the events are gone through, and what they touched has ended in the next call.
///
/// Fails with bad_options if `records` are fewer than World::slot_count(), or `out` is shorter than ended_pairs() and
/// pairs() together; then nothing has changed. Serial, some nanoseconds a pair.
Result<size_t> contact_events(const World& world, std::span<PairContacts> records,
                              std::span<ContactEvent> out) noexcept;

// ---- from outside ----
//
// Of bodies that have a layer in `mask`. out[i] is the answer for question i. Of compounds, the ids are those of parts
// (World::body_of()). A budget of tests is for each body by itself. Fails with bad_options if a span is too short; then
// no query was made.

/// What a ray hits first.
struct RayHit {
    BodyId body;          ///< that `result` is about, if it is overlapping; of several that are hit at once, the one of
                          ///< the lowest index
    RaycastResult result; ///< of all bodies together: `clear`, `stats`, and if no hit was found the verdict
};
/// Where do rays first meet a body? A half-space is met at its plane, or where the ray begins, in it. Rays of which
/// neighbours go much the same way, as those of a picture, take less time together than one by one, for the same bits.
Result<void> raycast(const World& world, std::span<const Ray> rays, std::span<RayHit> out, const Workers& workers,
                     const QueryOptions& options = {}, uint32_t mask = ~uint32_t{}) noexcept;

/// A tree at a pose, not of the world.
struct PlacedTree {
    TreeView tree;
    Pose pose;
};
/// What bodies are asked whether they meet.
using Probe = std::variant<Sphere, Capsule, Box, PlacedTree>;

/// Which bodies meet the probes, or may: all that are not separated. counts[i] is their number; of those of probe i,
/// found[i * most] and following are the ids, in ascending order of index: `most` of them, the lowest, if there are
/// more. `most` is found.size() / probes.size().
Result<void> overlap(const World& world, std::span<const Probe> probes, std::span<BodyId> found,
                     std::span<uint32_t> counts, const Workers& workers, const QueryOptions& options = {},
                     uint32_t mask = ~uint32_t{}) noexcept;

/// A tree in motion, not of the world.
struct MovingTree {
    TreeView tree;
    Motion motion;
};
/// What a moving tree hits first.
struct SweepHit {
    BodyId body;        ///< that `result` is about, if it is overlapping; the moving tree is `a`
    SweepResult result; ///< of all bodies together: the times and `stats`
};
/// When do moving trees first meet a body, all bodies being at rest?
Result<void> sweep(const World& world, std::span<const MovingTree> moving, std::span<SweepHit> out,
                   const Workers& workers, const SweepOptions& options = {}, uint32_t mask = ~uint32_t{}) noexcept;

} // namespace prolate

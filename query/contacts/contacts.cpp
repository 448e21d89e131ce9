// Contact manifolds: all pairs of leaves that meet, as collide_all() finds them, each turned into points with a normal
// (pair_contacts.hpp), and all of these into a few manifolds (manifold.hpp).
//
// Mostly there is one way out, which is sought first (one_way.hpp). Bodies that have none or several, that are open, or
// whose nodes stand for what is in them go through their pairs twice; the search runs again only if there are too many
// to be kept. The first time for the normals: of each pair that along which its surroundings overlap least
// (query/triangle/contact.hpp), if that is less than what a patch found before needs to resolve it, that is, to have it
// separated once the bodies are moved along the patch's normal. Normals of faces make patches, others wait and count if
// no patch resolves them that is no deeper. Then the deepest vertices of each patch are found, and patches all of which
// another one resolves are dropped. The second time for the points: of each pair along the normal of the first patch
// that resolves it. (Compare Terdiman's "voided features", which Bullet and Jolt have in variants.)
//
// Once there are more pairs than usual, both times leave out pairs of nodes that have the normal of a patch, which
// resolves them, and reach no farther out than the patch's points (node_pair.hpp); the others are opened in the order
// of how much farther they do. In the mean of the normals, what is left out weighs about as much.
//
// Complexity: that of collide_all() without what is left out, and of one way .1 or .2 us for each pair that meets, some
// 30 climbs and two rays; otherwise twice that, some us for each pair, and for each patch up to 18 climbs and rays.
#include "query/contacts/contacts.hpp"
#include "query/contacts/last_contacts.hpp"
#include "query/contacts/manifold.hpp"
#include "query/contacts/node_pair.hpp"
#include "query/contacts/one_way.hpp"
#include "query/contacts/pair_contacts.hpp"
#include "query/node/scratch.hpp"

#include <prolate/contacts.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

namespace prolate {
namespace query {
namespace {

using glm::dvec3;

constexpr double kSamePoint = 1e-4;   // of the smaller body: what is nearer is one point
constexpr double kLeastWeight = 1e-7; // of the smaller body: a normal's weight in the mean, if its pair has no depth
constexpr uint64_t kTries = 32, kFewResolved = 8; // pairs of nodes; of so many, one has the normal of a patch
// Shares of a patch's extent: points that lie farther out by less do not matter, to its normal and to its outline.
constexpr double kFarther = 0x1p-6, kFartherOut = 0x1p-8;
constexpr double kSlack = 0.25; // of a depth: the normals of curved bodies are means, and no exact ones

double smaller_size(const CollideSearch& search) {
    return std::min(place(search.a.tree.root(), search.a.tree.scale()).size,
                    place(search.b.tree.root(), search.b.tree.scale()).size);
}

class Collector {
public:
    Collector(CollideSearch& search, const DividedScratch& scratch, const OrderedBodies<Pose>& bodies,
              const LastContacts& last, uint64_t many)
        : search_(search), many_(many), size_(smaller_size(search)),
          bodies_(bodies, search.b_to_a, search.options.margin,
                  {search.stats, search.other_tests, search.options.max_pair_tests}, scratch, kSamePoint * size_),
          pairs_(search, bodies_), candidates_{last, bodies.exchanged},
          one_way_(bodies_, candidates_, ways_[0], points_[0]), patches_(kSamePoint * size_),
          of_ellipsoids_(!search.a.tree.has_triangles() && !search.b.tree.has_triangles()) {
        const bool limited = search.a.limit_from != UINT32_MAX || search.b.limit_from != UINT32_MAX;
        if (!bodies_.closed_a || !bodies_.closed_b || limited) phase_ = Phase::normals;
        for (uint32_t i = 0; i < last.count(); ++i) patches_.expect(last.normal(i));
        search.each = [](void* self, const MeetingPair& pair) {
            auto* const collector = static_cast<Collector*>(self);
            collector->add(pair, collector->search_.found);
        };
        search.each_user = this;
        if (limited) return; // nodes stand for triangles
        search.sift = [](void* self, Scratch::Entry* begin, Scratch::Entry* end) {
            return static_cast<Collector*>(self)->sift(begin, end);
        };
        search.sift_user = this;
    }

    // After the search, which found these pairs first.
    void finish(std::span<const MeetingPair> first) {
        met_ = true, first_ = first[0];
        if (phase_ == Phase::seek && !begin_one_way(first)) again(Phase::normals, first);
        if (phase_ == Phase::one_way) {
            if (in_one_way(first)) return;
            way_count_ = 0, points_[0] = {};
            again(Phase::normals, first);
        }
        settle();
        again(Phase::points, first);
    }

    // After that: patches with points, at least one if any pair met.
    uint32_t patches(const Patch* (&out)[kManifolds]) {
        uint32_t count = 0;
        for (uint32_t i = 0; i < way_count_; ++i)
            if (!points_[i].empty()) out[count++] = &points_[i];
        if (count > 0 || !met_) return count; // a later search may find none within the budget
        const Contact c = pairs_.last_resort(first_);
        points_[0] = Patch(c.normal);
        add_to(points_[0], c.normal, c);
        out[0] = &points_[0];
        return 1;
    }
    // Points nearer to each other are one.
    double same_point() const { return patches_.same_point(); }

private:
    enum class Phase : uint8_t { seek, one_way, normals, points }; // what pairs are asked for
    // A patch of the first pass, its way, and the deepest points along that.
    struct Group {
        const Patch* patch;
        Way way;
        Patch deepest;
    };

    // What two triangles have by themselves, if it is no longer than another patch's way: a normal of a face, or one
    // point that waits. If it is longer it is not known, but asked for once no way resolves the pair.
    struct Own {
        bool known = false, certain = false;
        uint32_t waiting = 0;
        dvec3 normal{0, 0, 0};
    };

    // ---- what need not be looked at ----

    // CollideSearch::sift.
    Scratch::Entry* sift(Scratch::Entry* begin, Scratch::Entry* end) {
        const bool sifts = phase_ == Phase::normals ? search_.found >= many_ && !patches_.full() : reduce_;
        if (!sifts || gives_up()) return end;
        return keep_gains(begin, end, [this](Scratch::Entry& e) { return gain_of(e); });
    }
    // Curved bodies have few such pairs, and looking for them would cost time in vain.
    bool gives_up() const { return looked_at_ >= kTries && resolved_ * kFewResolved < looked_at_; }
    // How much farther out, or deeper, points of a pair of nodes may lie than those that are known of the patch or way
    // that resolves it. Infinite if there is none, or the pair is not flat; not above 0: it need not be looked at.
    double gain_of(Scratch::Entry& e) {
        const NodePair pair(search_, e.node_a, e.node_b);
        uint32_t resolving = e.flags / kFirstSiftBit; // 0: not known yet, else one more than its number
        if (resolving == 0) resolving = resolving_patch(pair);
        ++looked_at_, resolved_ += resolving != 0;
        if (resolving == 0) return HUGE_VAL;
        e.flags |= resolving * kFirstSiftBit;
        const bool along = phase_ == Phase::one_way; // which has points where both triangles are, seen along the way
        const auto extent = [&](const dvec3& d) { return pair.extent(d, along ? 0 : 0.5 * search_.options.margin); };
        const auto gain = [&](const Patch& p, const dvec3& n, double share) {
            return p.empty() ? HUGE_VAL : p.gain(pair.overlap(n), same_point(), share, extent);
        };
        if (phase_ == Phase::normals) {
            Patch& patch = patches_[resolving - 1];
            const dvec3 n = patch.normal();
            const double out = gain(patch, n, kFarther);
            if (!(out > 0)) patch.weigh(n, static_cast<double>(pair.triangles()) * weight_of(patch.depth()));
            return out;
        }
        if (along && pair.overlap(ways_[0].normal) < -search_.options.margin) return 0;
        double most = 0; // a pair's points are those of the first way that resolves it
        for (uint32_t i = 0; i < resolving; ++i) most = std::max(most, gain(points_[i], ways_[i].normal, kFartherOut));
        const auto holds = [&](const dvec3& p) { return points_[resolving - 1].holds(p, same_point(), extent); };
        return most > 0 || !candidates_.last.any(holds) ? most : same_point(); // what is known is found again
    }
    // One more than the number of a patch, or way, that resolves all pairs below them.
    uint32_t resolving_patch(const NodePair& pair) {
        std::optional<dvec3> normal; // once it is asked for
        const bool of_patches = phase_ == Phase::normals;
        for (uint32_t i = 0; i < (of_patches ? patches_.count() : way_count_); ++i) {
            const Way way = of_patches ? Way{patches_[i].normal(), patches_[i].overlap()} : ways_[i];
            if (pair.resolved_by(way, same_point(), normal)) return i + 1;
        }
        return 0;
    }

    void add(const MeetingPair& pair, uint64_t number) {
        if (phase_ == Phase::seek) { // waits until there are enough
            if (number < kMany) return;
            if (!begin_one_way(search_.pairs)) add_all(Phase::normals, search_.pairs);
        }
        if (phase_ == Phase::one_way) return one_way_.add(pair);
        phase_ == Phase::normals ? add_normals(pair, number) : add_points(pair, repeats_ ? own_[number] : Own{});
    }
    void add_all(Phase phase, std::span<const MeetingPair> pairs) {
        phase_ = phase;
        for (size_t i = 0; i < pairs.size(); ++i) add(pairs[i], i);
    }
    // All pairs that were found, once more.
    void again(Phase phase, std::span<const MeetingPair> first) {
        looked_at_ = resolved_ = 0, repeats_ = search_.found < std::min(many_, kMany);
        if (repeats_) return add_all(phase, first);
        phase_ = phase, search_.stats = {}, search_.other_tests = 0, search_.found = 0; // what they count is known
        traverse(search_);
    }

    // ---- all pairs in one way ----

    bool begin_one_way(std::span<const MeetingPair> some) {
        if (!one_way_.begin(some)) return false;
        phase_ = Phase::one_way, way_count_ = 1, reduce_ = search_.found >= many_;
        for (const MeetingPair& pair : some) one_way_.add(pair);
        return true;
    }
    // False if the bodies have none, or several.
    bool in_one_way(std::span<const MeetingPair> first) {
        if (one_way_.confirm()) return true;
        while (one_way_.turn()) {
            reduce_ = reduce_ && one_way_.by_climbs();
            again(Phase::one_way, first);
            if (one_way_.confirm()) return true;
        }
        return false;
    }

    // ---- the first pass ----

    void add_normals(const MeetingPair& pair, uint64_t number) {
        KnownOverlap known;
        patches_.for_each([&](const Patch& p) {
            if (p.overlap() < known.overlap && pairs_.resolves(p.normal(), p.overlap(), pair))
                known = {p.normal(), p.overlap()};
        });
        const ContactsOfPair found = pairs_.by_itself(pair, known);
        const bool of_triangles = pair.triangle_a != kNoTriangle && pair.triangle_b != kNoTriangle;
        if (number < kMany) own_[number] = {};
        if (number < kMany && found.count > 0 && (of_triangles || of_ellipsoids_))
            own_[number] = {true, found.certain, of_ellipsoids_ ? static_cast<uint32_t>(number) : waiting_.count,
                            found.contacts[0].normal};
        if (of_ellipsoids_ && number < kWaiting) waiting_.contacts[number] = found.contacts[0];
        for (const Contact& c : found) {
            if (found.certain) { // what is no better than what resolves it gives points, not a direction
                take(c, c.overlap <= known.overlap + same_point());
            } else {
                if (waiting_.count == kWaiting) flush();
                waiting_.add(c);
            }
        }
    }
    void take(const Contact& c, bool with_normal) {
        const double weight = with_normal ? weight_of(c.depth) : 0;
        patches_.add(c.normal, candidates_.of(c), weight, with_normal ? c.overlap : -HUGE_VAL);
    }
    double weight_of(double depth) const {
        return std::max(0.0, depth + search_.options.margin) + kLeastWeight * size_;
    }
    // What waits counts if no patch resolves it, or only one that is deeper than the pair.
    void flush() {
        for (const Contact& c : waiting_) {
            bool resolved = false;
            patches_.for_each([&](const Patch& p) {
                resolved = resolved || (pairs_.resolves(p.normal(), p.overlap(), c.pair) &&
                                        (c.overlap < 0 || p.overlap() <= c.overlap + same_point()));
            });
            if (!resolved) take(c, true);
        }
        waiting_.count = 0; // they stay where they are
    }

    // ---- between the passes ----

    // Settles the normals and depths of the manifolds. Not inlined, so that its groups are not on the stack during the
    // passes.
    [[gnu::noinline]] void settle() {
        flush();
        reduce_ = search_.found >= many_ && !gives_up();
        Group groups[Patches::kMost];
        const uint32_t count = group_patches(groups);
        bool needed[Patches::kMost];
        std::fill_n(needed, count, true);
        for (uint32_t i = 0; i < count; ++i)
            for (uint32_t j = 0; j < count && needed[i]; ++j)
                if (j != i && needed[j]) needed[i] = !resolves_all(groups[j], groups[i]);
        for (uint32_t i = 0; i < count && way_count_ < kManifolds; ++i)
            if (needed[i]) ways_[way_count_] = groups[i].way, points_[way_count_] = groups[i].deepest, ++way_count_;
    }
    // All patches, the deepest first.
    uint32_t group_patches(Group (&groups)[Patches::kMost]) {
        uint32_t count = 0;
        patches_.for_each([&](const Patch& p) {
            const dvec3 n = bodies_.shortest_way(p);
            Group group{.patch = &p, .way = {n, p.depth()}, .deepest = Patch(n)};
            const auto add = [&](const Contact& c) { add_to(group.deepest, n, c); };
            bodies_.deepest(p, {n, p.overlap()}, add);
            group.way.depth = std::max(group.way.depth, group.deepest.depth());
            uint32_t at = count++;
            for (; at > 0 && group.way.depth > groups[at - 1].way.depth; --at) groups[at] = groups[at - 1];
            groups[at] = group;
        });
        return count;
    }
    // Does the one group's way separate all pairs of the other, and all its deepest points?
    bool resolves_all(const Group& one, const Group& other) const {
        const dvec3& n = one.way.normal;
        const double depth = one.way.depth + kSlack * std::abs(one.way.depth);
        const Candidate* all[Patch::kSieve];
        return std::all_of(all, all + other.patch->kept(all),
                           [&](const Candidate* c) { return pairs_.resolves(n, depth, c->pair); }) &&
               (other.deepest.empty() || glm::dot(n, other.way.normal) * other.deepest.depth() <= depth + same_point());
    }

    // ---- the second pass ----

    void add_points(const MeetingPair& pair, const Own& own) {
        if (of_ellipsoids_ && own.known) return add_by_itself(waiting_.contacts[own.waiting]);
        const bool has_triangle = pair.triangle_a != kNoTriangle || pair.triangle_b != kNoTriangle;
        if (has_triangle && add_along_ways(pair)) return; // above a level's cut there may be none
        if (own.known && !own.certain) return add_by_itself(waiting_.contacts[own.waiting]);
        const ContactsOfPair found = own.known ? pairs_.along(own.normal, pair) : pairs_.by_itself(pair);
        for (const Contact& c : found) add_by_itself(c);
    }
    // False if the pair may have others.
    bool add_along_ways(const MeetingPair& pair) {
        for (uint32_t i = 0; i < way_count_; ++i) {
            if (!pairs_.resolves(ways_[i].normal, ways_[i].depth, pair)) continue;
            const ContactsOfPair found = pairs_.along(ways_[i].normal, pair);
            for (const Contact& c : found) add_to(points_[i], ways_[i].normal, c);
            if (found.certain) return true;
        }
        return false;
    }
    void add_by_itself(const Contact& c) {
        Patch* const patch =
            std::find_if(points_, points_ + way_count_, [&](const Patch& p) { return p.takes(c.normal); });
        if (patch != points_ + way_count_) add_to(*patch, c.normal, c);
    }

    void add_to(Patch& patch, const dvec3& normal, const Contact& c) const {
        patch.add(normal, candidates_.of(c), 0, c.overlap, same_point());
    }

    CollideSearch& search_;
    const uint64_t many_;
    Phase phase_ = Phase::seek;
    bool reduce_ = false, repeats_ = false;
    uint64_t looked_at_ = 0, resolved_ = 0; // pairs of nodes, of this pass
    static constexpr uint32_t kFirstSiftBit = CollideSearch::kSiftBits & -CollideSearch::kSiftBits;
    const double size_;
    TouchingBodies bodies_;
    const PairContacts pairs_;
    const Candidates candidates_;
    OneWay one_way_;
    bool met_ = false;
    MeetingPair first_; // that met
    Patches patches_;   // of the first pass, for their normals
    static constexpr uint32_t kWaiting = 128;
    // Of edges, corners and closest points, in the first pass. Ellipsoids have none: then the contact of each pair, for
    // the second.
    ContactList<kWaiting> waiting_;
    Own own_[kMany]; // of the first pass, for the second
    const bool of_ellipsoids_;
    uint32_t way_count_ = 0;
    Way ways_[kManifolds];
    Patch points_[kManifolds]; // of the second pass
};

} // namespace

ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, Scratch context, const QueryOptions& options,
                       uint64_t many) noexcept {
    if (!suffices(context, a, b)) {
        manifolds = {};
        return {};
    }
    const auto bodies = in_canonical_order(a, pose_a, b, pose_b);
    const DividedScratch scratch = divide(context, a, b);
    CollideSearch search(bodies, scratch.least, options);
    const RelativePose to_world = relative_pose(Pose{}, bodies.place_a);
    const LastContacts last(manifolds, bodies.exchanged, to_world);
    manifolds = {};
    Collector collector(search, scratch, bodies, last, many);
    MeetingPair met[kMany];
    search.all = true, search.pairs = met;
    ContactResult out;
    out.verdict = decide(search);
    out.enclosed = out.verdict == Verdict::overlapping && search.found == 0;
    out.found = search.found;
    out.stats = search.stats;
    out.stats.triangle_tests += search.other_tests;
    if (!std::isfinite(search.b_to_a.distance)) return out; // no place for points

    if (search.found > 0) collector.finish({met, static_cast<size_t>(std::min(search.found, kMany))});
    const Patch* patches[kManifolds];
    manifolds.count = collector.patches(patches);
    for (uint32_t i = 0; i < manifolds.count; ++i) {
        Manifold& m = manifolds.manifolds[i];
        m = manifold_of(*patches[i], collector.same_point(), bodies.exchanged, to_world);
        last.hand_on(m);
    }
    return out;
}

} // namespace query

ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, Scratch context, const QueryOptions& options) noexcept {
    const double radii = double{a.radius()} + b.radius();
    QueryOptions of_cores = options;
    of_cores.margin = query::with_radius(query::sound(options).margin, radii);
    const ContactResult out = query::contacts(a, pose_a, b, pose_b, manifolds, context, of_cores, query::kMany);
    if (radii > 0) query::round_contacts(manifolds, a.radius(), b.radius());
    return out;
}

} // namespace prolate

// Do two *solids* meet, how far apart are they, and how deep in each other? collide(), distance() and contacts() of the
// meshes that trees were baked from, certain on both sides, from covers alone.
//
// Ellipsoids that cover a solid stick out of it, so covers that meet prove nothing. A tree that was baked with an inner
// cover (BuildOptions::inner, TreeView::inner()) has ellipsoids inside the solid, too:
//  - outer covers apart:   the solids are certainly apart;
//  - inner covers meeting: the solids certainly meet;
//  - neither:              the pose is within the *band*, whose width the bounds of distance() tell. Whoever needs to
//                          know more asks exact trees. Most poses do not come so far.
// What a solid is: all that a closed mesh encloses, or with BuildOptions::fill the filled one; of an open mesh, the
// triangles. query.hpp says how verdicts, limits and scratch work.
//
// Without an inner cover, nothing is certain to meet or to be near. An exact tree is the solid itself: two of them are
// asked as collide() and distance() ask them; against a tree without triangles, an inner cover that it has stands for
// it where bodies meet. A prefix of an exact tree is no solid: undecided. The radius of a rounded() tree is part of the
// solid.
//
// All queries here are thread-safe on shared solids, and symmetric but for the counters, and bounds for rounding. A
// pose that is not finite, or whose quaternion is zero, leaves everything open.
#pragma once

#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/query.hpp>

#include <limits>
#include <optional>

namespace prolate {

/// A tree, asked about as the solid that it was baked from: with what holds the solid, and what lies in it. Borrows the
/// tree's bytes as TreeView does. To make one takes about 0.1 us, so keep it for many queries.
class Solid {
public:
    /// `max_level`: of either cover, 0 = the roots only. All levels are covers by themselves: deeper ones narrow the
    /// band. Exact trees are not limited.
    explicit Solid(const TreeView& tree, uint32_t max_level = kMaxLevels) noexcept;

    /// Holds the solid; of an exact tree, is it.
    const TreeView& outer() const noexcept { return outer_; }
    /// Lies in the solid: its inner cover, or else an exact tree itself. Null if nothing is known to lie in it.
    const TreeView* inner() const noexcept {
        if (inner_) return &*inner_;
        return outer_.has_triangles() ? &outer_ : nullptr;
    }
    /// False of a prefix of an exact tree, of which nothing is certain.
    bool is_known() const noexcept { return outer_.has_triangles() || !outer_.is_exact(); }

private:
    TreeView outer_;
    std::optional<TreeView> inner_;
};

/// Limits of collide() and contacts() of solids.
struct SolidsOptions {
    uint64_t max_pair_tests = UINT64_MAX; ///< as QueryOptions has it, for both covers together
    float margin = 0;                     ///< solids at most this far apart count as meeting, metres
    /// The bodies may be displaced by so much against each other, metres, without the answer becoming wrong: what is
    /// not known of the poses. Of two exact trees, only *separated* keeps to it. Lengths are taken as
    /// QueryOptions::margin is.
    float uncertainty = 0;
};

/// Answer of collide().
struct SolidsResult {
    /// separated: the solids are farther apart than the margin. overlapping: a point of one is certainly within the
    /// margin of a point of the other. undecided: within the band, or out of budget.
    Verdict verdict = Verdict::undecided;
    bool out_of_budget = false; ///< undecided only because max_pair_tests ended the search
    QueryStats stats;
};

/// Temporal coherence of one pair of solids, as PairCache is: of the outer covers, and the inner leaves that met last,
/// which are tested first. Owned by the caller, 100 bytes. Reset it (`= {}`) when a body's tree or level changes. What
/// is certain is the same with and without; with it, poses may be decided that differ from contact by rounding.
struct SolidsCache {
    PairCache outer;
    DistanceCache inner; ///< valid if they certainly met
};
static_assert(sizeof(SolidsCache) == 100);

/// Do the solids meet, or come within options.margin of each other? A search of the outer covers, and if these meet,
/// one of the inner covers.
SolidsResult collide(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, Scratch context,
                     const SolidsOptions& options = {}, SolidsCache* cache = nullptr) noexcept;

/// Answer of distance().
struct SolidsDistance {
    /// As of collide(), without a margin.
    Verdict verdict = Verdict::undecided;
    /// Certified: lower <= distance of the solids <= upper, metres; the distance of solids that meet is 0. What the
    /// tolerances of the options leave open is part of both. `upper` is infinite without inner covers.
    double lower = 0, upper = std::numeric_limits<double>::infinity();
    /// Points of the two solids, world, `upper` apart, as DistanceResult has them. They are set if 0 < upper <
    /// infinity.
    Vec3 point_a, point_b;
    QueryStats stats;
};

/// How far apart are the solids? The lower bound is that of the outer covers, the upper one that of the inner covers.
/// If the solids are certainly at least options.max_distance apart, `upper` is not looked for. options.max_level is not
/// used. Anytime, as distance() of trees is: the lower bound gets half of the budget, the upper one what is left.
SolidsDistance distance(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, Scratch context,
                        const DistanceOptions& options = {}) noexcept;

/// Answer of contacts().
struct SolidsContacts {
    /// That of collide().
    Verdict verdict = Verdict::undecided;
    /// Certified: depth_lower <= depth of the solids <= depth_upper, metres. The depth is the length of the shortest
    /// translation after which the solids have no common inner point; 0 if they have none. `depth_upper` is infinite if
    /// the budget ended before a way out was found.
    double depth_lower = 0, depth_upper = std::numeric_limits<double>::infinity();
    /// Moving `b` by it, world, metres, certainly separates the solids, however the sum is rounded to floats;
    /// `depth_upper` is its length. 0 if they are apart already, or if none was found.
    Vec3 way_out;
    uint64_t found = 0; ///< as ContactResult has it
    QueryStats stats;
};

/// Where and how deep do the solids touch? The manifolds are those of contacts() of the outer covers: a solver that
/// resolves them separates the solids. The lower bound of the depth is that of the deepest pair of inner ellipsoids
/// that is found, 0.9 of what these overlap by. The upper bound comes from moving the outer covers apart along the
/// manifolds' normals, or if none leads out, away from each other.
SolidsContacts contacts(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b,
                        ContactManifolds& manifolds, Scratch context, const SolidsOptions& options = {}) noexcept;

} // namespace prolate

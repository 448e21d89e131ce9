// One collide() query: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp) share.
#pragma once

#include "query/node/limits.hpp"
#include "query/node/order.hpp"
#include "query/node/tree_side.hpp"
#include "query/triangle/slab.hpp"

#include <prolate/collide.hpp>

#include <cstdint>
#include <span>

namespace prolate::query {

/// Of two nodes: they are farther apart than margin + skin; or they are flat and lie so nearly in one plane that slabs
/// of what is below them will not tell, either.
enum class Slabs : uint8_t { say_nothing, separated, in_one_plane };

struct CollideSearch {
    TreeSide a, b;
    const RelativePose b_to_a;
    const QueryOptions options; // sound
    Scratch::Entry* const stack;
    QueryStats stats;

    bool all = false; ///< go on after the first pair
    std::span<MeetingPair> pairs;
    uint64_t found = 0;
    void (*each)(void* user, const MeetingPair& pair) = nullptr; ///< is handed all pairs taken, if not null
    void* each_user = nullptr;
    /// Of a search that need not see all pairs: sorts pairs of nodes that are put on the stack, up to a block of them,
    /// so that the last are opened first, and takes out those that need not be opened. Returns the new end. Each pair
    /// comes again before it is opened, or decided, alone. It may set kSiftBits of an entry's flags: pairs below it
    /// keep them.
    Scratch::Entry* (*sift)(void* user, Scratch::Entry* begin, Scratch::Entry* end) = nullptr;
    void* sift_user = nullptr;
    static constexpr uint32_t kSiftBits = 0xff00;
    uint64_t other_tests = 0;  ///< that `each` did, of the same budget
    bool out_of_tests = false; ///< the budget ran out within a leaf

    /// Nodes count as separated only if they are farther apart than options.margin + skin, metres. Leaves that are
    /// nearer, but beyond options.margin, shrink the skin to what they leave; so if the bodies turn out to be
    /// separated, they are farther apart than margin + skin.
    float skin = 0;
    bool roots_meet = false;

    CollideSearch(const TreeView& tree_a, const TreeView& tree_b, const RelativePose& pose_b_to_a, Scratch context,
                  const QueryOptions& query_options) noexcept;
    CollideSearch(const OrderedBodies<Pose>& bodies, Scratch context, const QueryOptions& query_options) noexcept
        : CollideSearch(bodies.a, bodies.b, relative_pose(bodies.place_a, bodies.place_b), context, query_options) {}

    /// Decides on two leaves: takes all their pairs that meet, or the first. True to stop the query. `normal` is 0, or
    /// of any length, in A's frame, from A to B, and along it they may well be separated.
    bool meet(uint32_t node_a, uint32_t node_b, const glm::dvec3& normal) noexcept;
    /// What slabs say of the triangles below two nodes. n is of length 1 but for rounding, in A's frame, and nearly
    /// separates them.
    Slabs slabs_of(const NodeWithHull& node_a, const NodeWithHull& node_b, const glm::dvec3& n) noexcept;
    /// Takes a pair that meets. True to stop the query.
    bool take(const MeetingPair& pair) noexcept;
    /// Does this one pair meet? It must name leaves of these trees, and their triangles where they have any. False
    /// too if it is out of tests.
    bool meets(const MeetingPair& pair) noexcept;

    /// Tests left of the budget.
    uint64_t left() const noexcept { return tests_left(options.max_pair_tests, stats.tests() + other_tests); }

    /// Starts with this skin.
    void set_skin(float distance) noexcept;

private:
    bool spend(uint64_t tests) noexcept;
    template <class FartherThan> bool separated_by_margin(FartherThan&& farther_than) noexcept;
    bool separated_along(const glm::dvec3& normal, TriangleRange in_a, TriangleRange in_b) noexcept;
    float least_skin_ = 0;
    double reach_of_triangles() noexcept;
    double triangle_reach_ = -1; // S of query/triangle/support.hpp, once it is asked for
};

/// The bodies are certainly so far apart, metres, by spheres around their roots; NaN if the pose is not finite.
double gap_of_spheres(const TreeView& a, const TreeView& b, const RelativePose& b_to_a) noexcept;
/// The same by the boxes of their roots; if they are apart along a side, no axis across two sides is asked.
double gap_of_boxes(const TreeView& a, const TreeView& b, const RelativePose& b_to_a) noexcept;
/// Does the pair that a cache names exist?
bool names_leaves(const MeetingPair& pair, const TreeView& a, const TreeView& b) noexcept;
/// The traversal alone: separated, overlapping (what max_level lets stand for leaves), or undecided (out of budget).
/// Leaves that meet are counted in `found`.
Verdict traverse(CollideSearch& search) noexcept;
/// The whole question: do surfaces meet, or else does one solid hold a part of the other? Completes `stats`.
Verdict decide(CollideSearch& search) noexcept;

} // namespace prolate::query

// raycast() queries: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp) share.
#pragma once

#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/raycast/lanes.hpp"
#include "query/raycast/ray.hpp"

#include <prolate/raycast.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <limits>
#include <span>

namespace prolate::query {

inline constexpr uint32_t kRaysAtOnce = 8;

/// Siblings of a block that wait on a ray's stack.
struct RayFamily {
    float bounds[kBlockLanes]; ///< the ray enters them no sooner; of lanes that do not wait, anything
    uint32_t first, level;     ///< slot of the first, and its level
    uint32_t waiting;          ///< lanes that still do, as bits
};
/// The most families that wait while a ray is at a leaf, and room for the next one.
inline uint32_t ray_stack_size(const TreeView& tree) noexcept {
    return blocks_for(tree.degree()) * (tree.level_count() - 1) + 2;
}

/// A tree at a pose: what many rays have in common.
struct RaycastBody {
    const TreeSide side;
    const QueryOptions options; // sound
    const float* const growth;  ///< of raycast_cut(): by slots; else null
    RayFamily* const stacks;    ///< null if the scratch is too small
    const uint32_t stack_size;  ///< of each
    const RayBound root;
    const glm::dvec3 translation;
    const glm::dmat3 rotation;             ///< from the world to the body
    const double per_step;                 ///< lattice steps a metre
    double shift[4] = {}, shift_reach = 0; ///< of its origin, steps, and the sum of their moduli

    RaycastBody(const TreeView& tree, const Pose& pose, Scratch scratch, const QueryOptions& asked,
                const float* grown) noexcept;
};

/// One ray.
struct RaycastSearch {
    const RaycastBody& body;
    const PlacedRay ray;
    const bool any; ///< stop at the first hit that is found
    QueryStats stats = {};
    bool finished = true; ///< false if the budget ran out
    bool found = false;
    RayHit best{std::numeric_limits<double>::infinity(), {}}; ///< of the placed ray; of a triangle without a normal
    double clear =
        std::numeric_limits<double>::infinity(); ///< of the placed ray: the least bound of what was left aside
    uint32_t node = 0, triangle = kNoTriangle;

    RaycastSearch(const RaycastBody& of_all, const Ray& world_ray, bool any_hit) noexcept;

    /// Decides on the ellipsoid of the leaf `at`, or of a node that stands for what is below it.
    void meet(uint32_t at) noexcept;
    /// The same of one triangle of a leaf.
    void meet_triangle(uint32_t leaf, uint32_t triangle) noexcept;
};

/// The traversal: finds the first hit of each, or any. Of rays that are valid and not empty, all against one body,
/// which has a stack for each, and no more than kRaysAtOnce; of raycast_cut(), one.
void traverse(std::span<RaycastSearch> searches) noexcept;

} // namespace prolate::query

// A ray against a deformed body, node by node.
#pragma once

#include "query/deform/body.hpp"
#include "query/raycast/ray.hpp"

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate::query {

/// Twice those of ray.hpp: body.hpp works them out.
inline constexpr double kDeformedRayMargin = 2 * kSeparationMargin, kDeformedTriangleMargin = 2 * kRayMargin;

/// The ray cut down to the body's root. `to_frame`: from a frame at the ray's origin that is turned as the world.
/// `empty` if it certainly misses the root.
PlacedRay place(const Ray& ray, const RelativePose& to_frame, const Deformed& body, double margin) noexcept;

struct RaySearch {
    const Deformed& body;
    const PlacedRay& ray;
    Scratch::Entry* stack; ///< as much as a search of the tree by itself needs
    double margin;         ///< what comes as near as this is hit, too
    uint64_t most_tests;
    bool any; ///< stop at the first hit that is found

    RaySearch(const Deformed& searched, const PlacedRay& placed, Scratch::Entry* scratch, double within, uint64_t most,
              bool any_hit) noexcept
        : body(searched), ray(placed), stack(scratch), margin(within), most_tests(most), any(any_hit) {}

    QueryStats stats = {};
    bool found = false;
    RayHit best = {}; ///< of the placed ray
    uint32_t node = 0, triangle = kNoTriangle;

    /// Finds the first hit, or any. False if the budget ran out.
    bool run() noexcept;

private:
    bool test(uint32_t node_tested, double& enters) noexcept;
    void meet_triangles(uint32_t leaf, TriangleRange triangles) noexcept;
    void push_children(uint32_t opened, uint32_t& size) noexcept;
    bool out_of_tests_ = false;
};

} // namespace prolate::query

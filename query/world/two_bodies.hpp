// The queries of two bodies of a World, each of which may be a half-space: they choose the query of two trees or of a
// tree and a half-space, and exchange the bodies in the answer if need be. Of two half-spaces, which are no pair,
// nothing is claimed.
#pragma once

#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>
#include <prolate/solids.hpp>
#include <prolate/sweep.hpp>
#include <prolate/world.hpp>
#include <prolate/world_queries.hpp>

namespace prolate::query {

CollideResult collide(const Body& a, const Body& b, Scratch context, const QueryOptions& options,
                      PairCache* cache) noexcept;
DistanceResult distance(const Body& a, const Body& b, Scratch context, const DistanceOptions& options,
                        DistanceCache* cache) noexcept;
SolidsResult collide_solids(const Body& a, const Body& b, Scratch context, const SolidsOptions& options,
                            SolidsCache* cache) noexcept;
SolidsDistance distance_solids(const Body& a, const Body& b, Scratch context, const DistanceOptions& options) noexcept;
ContactResult contacts(const Body& a, const Body& b, ContactManifolds& manifolds, Scratch context,
                       const QueryOptions& options) noexcept;
SweepResult sweep(const Body& a, const Motion& motion_a, const Body& b, const Motion& motion_b, Scratch context,
                  const SweepOptions& options) noexcept;

/// One body, and something that is none.
RaycastResult raycast(const Body& body, const Ray& ray, Scratch context, const QueryOptions& options) noexcept;
Verdict overlap(const Body& body, const Probe& probe, Scratch context, const QueryOptions& options) noexcept;
/// A box that holds the probe and all within the margin of it.
Bounds bounds_of(const Probe& probe, float margin) noexcept;

} // namespace prolate::query

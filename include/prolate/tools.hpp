// For tools that draw or inspect trees: rays against the ellipsoids of a cut. Simulations want raycast.hpp instead,
// which asks about the body that the tree stands for.
#pragma once

#include <prolate/raycast.hpp>

#include <span>

namespace prolate {

/// growth[node]: the factor, at least 1, by which the ellipsoid of `node` must grow about its center to hold those of
/// all nodes below it. `growth` has tree.slot_count() elements. Takes some microseconds a node. Thread-safe.
void node_growth(const TreeView& tree, std::span<float> growth) noexcept;

/// The first hit of the ray with the ellipsoids of the cut at options.max_level, just as they are stored, of exact
/// trees too. `growth` comes from node_growth(). Everything else is as in raycast(). Thread-safe on shared trees.
RaycastResult raycast_cut(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                          Scratch context, const QueryOptions& options = {}) noexcept;

/// The same, but stops at any hit, as raycast_any() does.
RaycastResult raycast_cut_any(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                              Scratch context, const QueryOptions& options = {}) noexcept;

} // namespace prolate

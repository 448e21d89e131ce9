// Many rays through a World: each goes from body to body, the nearest boxes first, but those that have come to one body
// are cast against it at once.
#pragma once

#include <prolate/world.hpp>
#include <prolate/world_queries.hpp>

#include <span>

namespace prolate::query {

inline constexpr uint32_t kRaysUnderWay = 64; ///< that are cast together

/// out[i] is the answer for rays[i], the same bits whatever rays are with it. Options are sound. Thread-safe while the
/// world does not change.
void cast_rays(const World& world, std::span<const Ray> rays, std::span<RayHit> out, Scratch context,
               const QueryOptions& options, uint32_t mask) noexcept;

} // namespace prolate::query

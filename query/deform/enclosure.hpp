// Where surfaces do not meet: does one deformed body hold a part of the other?
#pragma once

#include "query/deform/pair.hpp"

#include <prolate/query.hpp>

namespace prolate::query {

enum class Enclosure : uint8_t { none, perhaps, out_of_tests };

/// Certainly `none` of `inner` in `outer`? Surfaces must be separated. A connected part of a surface lies wholly inside
/// or wholly outside of another that it does not meet; so it lies outside if from one of its points a ray leads away
/// that misses all of the other's leaf ellipsoids, or triangles: then the winding number around that point is 0. Rays
/// are cast away from the root's center, and along the axes and diagonals of the frame. A rigid tree without triangles
/// has a part for each leaf. `stack` holds what searches of both trees need.
Enclosure look_inside(const Deformed& inner, const Deformed& outer, const RelativePose& inner_to_outer,
                      Scratch::Entry* stack, uint64_t most_tests, QueryStats& stats) noexcept;
/// Certainly none of either body in the other?
Enclosure look_inside_both(const DeformedPair& pair, Scratch::Entry* stack, uint64_t most_tests,
                           QueryStats& stats) noexcept;

} // namespace prolate::query

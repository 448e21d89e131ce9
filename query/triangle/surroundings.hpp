// A triangle and what is around it, for contacts.
#pragma once

#include "query/triangle/climb.hpp"
#include "query/triangle/placed.hpp"

#include <cstdint>

namespace prolate::query {

/// Part of a triangle: corner 0 ... 2; 3 + i: the edge from corner i to the next; kFace.
using Feature = uint8_t;
inline constexpr Feature kFirstEdge = 3, kFace = 6;

inline constexpr double kFacing = 0.9;        ///< cosine: a face turned farther from a normal has no points along it
inline constexpr double kSameAsFace = 0.9999; ///< cosine: a normal that is the face's

struct Surrounded {
    PlacedTriangle triangle; ///< in A's frame
    bool closed = false;     ///< its mesh is
    const Hills* hills = nullptr;
    Triangle corners{};                   ///< their vertices
    const glm::dmat3* rotation = nullptr; ///< from the tree's frame to A's; null: none

    /// The corner that is the highest along `up`, in A's frame.
    Feature highest(const glm::dvec3& up) const noexcept;
    /// The climb along `up` from a corner, or from an edge that `up` is perpendicular to. At its end without hills.
    Climb climb(Feature from, const glm::dvec3& up) const noexcept;
};

} // namespace prolate::query

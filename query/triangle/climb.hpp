// How far does a mesh reach in a direction, near one of its triangles? Hill climbing from vertex to vertex (Cameron,
// "Enhancing GJK", 1997): of a convex body it ends at the farthest vertex, of any other one at the top of a hill.
//
// Neighbours are found by the vertices' indices: triangles hang together where they share a vertex. A vertex's
// triangles lie in leaves whose boxes hold it, a few of them.
//
// Complexity: a step is a descent to the leaves around one vertex, about ten blocks; kClimbSteps at most. The triangles
// and neighbours of the last vertices are kept, of 128 if there is room, else of 12: climbs of neighbouring pairs pass
// the same ones, and of ten steps nine find their vertex known.
#pragma once

#include "query/triangle/placed.hpp"

#include <prolate/tree.hpp>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate::query {

inline constexpr uint32_t kClimbSteps = 128;

/// A tree with triangles, in its own frame.
class Hills {
public:
    /// `tests` counts nodes and triangles looked at; nothing rises any more once they exceed `most_tests`. `room`:
    /// memory to remember vertices in, of any size; it alters no answer and no count.
    Hills(const TreeView& tree, uint64_t& tests, uint64_t most_tests, std::span<std::byte> room) noexcept;
    Hills(const Hills&) = delete;
    Hills& operator=(const Hills&) = delete;

    double height(uint32_t vertex, const glm::dvec3& up) const noexcept {
        return glm::dot(up, stored_vertex(tree_, vertex)) * double{tree_.scale()};
    }
    /// The highest neighbour of a vertex along `up`, if it is higher than the vertex; else the vertex itself.
    uint32_t step(uint32_t vertex, const glm::dvec3& up) const noexcept;
    /// From an edge on, all of which is equally high: the highest third corner of its triangles, if that is higher than
    /// the edge; else `first`.
    uint32_t step(uint32_t first, uint32_t second, const glm::dvec3& up) const noexcept;
    /// The neighbours of a vertex, each once: of more than there is room for, some. Returns how many.
    uint32_t neighbours(uint32_t vertex, std::span<uint32_t> out) const noexcept;

private:
    // The neighbours of a vertex, each once, its triangles by the places of their other corners among these, and what
    // it took to find them, which counts each time that they are asked for.
    struct Known {
        static constexpr uint32_t kMost = 12; // few vertices have more neighbours, or triangles
        uint32_t vertex, tests;
        uint8_t triangle_count, neighbour_count;
        uint8_t triangles[kMost][2];
        uint32_t neighbours[kMost];

        uint32_t place_of(uint32_t neighbour) const noexcept; // neighbour_count: nowhere
    };
    static constexpr uint32_t kFewKnown = 12, kManyKnown = 128;

    template <class Visit> void find(uint32_t vertex, Visit&& visit) const;
    static Known* many(std::span<std::byte> room) noexcept;
    const Known* known(uint32_t vertex) const;

    const TreeView& tree_;
    uint64_t& tests_;
    const uint64_t most_tests_;
    mutable Known few_[kFewKnown]; // without room
    Known* const known_;
    const uint32_t known_count_;
    mutable bool ready_ = false; // most pairs of a scene never climb
};

/// A climb, a step at a time.
struct Climb {
    const Hills* hills;
    glm::dvec3 up;           ///< in the tree's frame
    uint32_t vertex, second; ///< where it is: a vertex, or the edge between these
    uint32_t steps_left;     ///< 0: it is at its end

    /// One step; returns by how much it rises.
    double step() noexcept;
};

} // namespace prolate::query

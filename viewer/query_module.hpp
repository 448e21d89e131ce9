// The runtime as the viewer's page calls it: two bodies, one of which moves. Compiled to WebAssembly for the page, and
// natively for the test that compares the bits of both.
//
// Numbers cross the border as arrays of doubles, which hold counters, floats and doubles alike; viewer/query.js reads
// them by the same order.
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {

/// Most levels and meeting pairs that an answer tells of.
enum : uint32_t { kAnswerLevels = 32, kAnswerPairs = 4096 };

/// Everything that a page shows of one pair of poses.
struct ViewerAnswer {
    // collide()
    double verdict;  ///< prolate::Verdict
    double enclosed; ///< one body holds a part of the other
    double node_a, node_b, triangle_a, triangle_b;
    double pair_tests, block_tests, triangle_tests;
    // distance()
    double lower, upper;
    double point_a[3], point_b[3];
    double has_points; ///< 0: no witness
    double distance_pair_tests;
    // collide_all() with a level limit, for each level from 0 to level_count - 1. How many tests a limit adds is how
    // many pairs were tested whose deeper node is of that level.
    double level_count;
    double level_tests[kAnswerLevels];   ///< with that limit; less than all if the budget ran out
    double level_verdict[kAnswerLevels]; ///< of the covers at that level
    // Nodes of the level that was asked for which meet.
    double pair_count; ///< in viewer_pairs(), of those found
};

/// Room for the bytes of body 0 or 1.
std::byte* viewer_allocate(uint32_t body, uint32_t bytes);
/// Takes what has been written there for a tree; 0 if it is none.
uint32_t viewer_open(uint32_t body);
/// The pose of a body, to be written: translation, then rotation x, y, z, w.
float* viewer_pose(uint32_t body);
/// Asks everything about the poses as they are; `level` selects the pairs to list.
const ViewerAnswer* viewer_query(uint32_t level);
/// Nodes that meet: node of A, node of B, and so on.
const uint32_t* viewer_pairs();
/// collide() alone, so many times: for a clock. Returns the last verdict.
uint32_t viewer_collide(uint32_t times);
}

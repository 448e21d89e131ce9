// The poses that the libraries are compared at.
//
// Both bodies are turned at random; B comes from afar along a random direction until the surfaces first meet within
// the resolution of a bisection, at t. Then
//     near     = t + up to 1 % of the size: apart,
//     touching = t - up to 1 % of the size: meeting,
//     far      = 2 to 4 sizes away: the boxes are well apart.
// Every pose is confirmed by the reference; the same seed gives the same poses whatever libraries do.
#pragma once

#include "bench/peers/reference.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace prolate::bench::peers {

struct PoseSets {
    std::vector<Placement> far, near, touching;
};

/// `count` poses of each kind. `aligned`: rotations are the 24 of the cube, so that axes and flats are parallel.
PoseSets make_poses(const Reference& a, const Reference& b, size_t count, uint64_t seed, bool aligned);

} // namespace prolate::bench::peers

// The poses that the libraries are compared at.
//
// Both bodies are turned at random; B comes from afar along a random direction until the surfaces first meet within
// the resolution of a bisection, at t. Then
//     near     = t + up to 1 % of the size: apart,
//     touching = t - up to 1 % of the size: meeting,
//     far      = 2 to 4 sizes away: the boxes are well apart.
// Of near and touching poses there are also ones where B has since moved by up to 0.1 % of the size.
// Every pose is confirmed by the judge. If that is the reference, the same seed gives the same poses whatever the
// libraries do.
#pragma once

#include "bench/peers/reference.hpp"

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace prolate::bench::peers {

struct PoseSets {
    std::vector<Placement> far, near, touching;
};

/// `count` poses of each kind, judged by `meet`. `aligned`: rotations are the 24 of the cube, so that axes and flats
/// are parallel.
PoseSets make_poses(const std::function<bool(const Placement&)>& meet, size_t count, uint64_t seed, bool aligned);

/// The same, where B has moved on: turned and shifted at random, so that no point of it has gone farther than 0.1 %.
std::vector<Placement> moved(std::span<const Placement> poses, uint64_t seed);

} // namespace prolate::bench::peers

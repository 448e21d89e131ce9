// The comparison on single ellipsoids: do they meet, and how far are they apart?
//
// Radii up to 10 times apart, the largest 1. Both are turned at random, and one is moved along a random direction so
// that both, scaled about their centers by s, would just touch:
//     random: s from 0.1 to 1.9, near: s within 1e-3 of 1;    for distances only s > 1.
// Pairs are so short work that only whole sweeps are timed, each library's several times in a row until they take a
// millisecond or so: what it keeps of the pairs is then in the caches, as it is for one that needs that long for one
// sweep. A library that has a call for many pairs at once is timed on that.
#pragma once

#include "bench/peers/comparison.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace prolate::bench::peers {

/// Ellipsoids around the origins of their bodies, along the bodies' axes.
struct EllipsoidPair {
    std::array<float, 3> radii_a, radii_b;
    Pose a, b;
};

class PairScene {
public:
    virtual ~PairScene() = default;
    /// Answers all pairs; `out` has as many entries.
    virtual void meet(std::span<uint8_t> out) = 0;
    virtual void distance(std::span<double>) {} ///< called if PairLibrary::has_distance()
};

class PairLibrary {
public:
    virtual ~PairLibrary() = default;
    virtual std::string name() const = 0;
    virtual std::string about() const = 0;
    virtual bool has_distance() const { return false; }
    /// In the library's own types. `pairs` outlive the scene.
    virtual std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const = 0;
};

using PairLibraries = std::vector<std::unique_ptr<PairLibrary>>;

void add_prolate(PairLibraries& libraries);
void add_fcl(PairLibraries& libraries);
void add_ccd(PairLibraries& libraries);
void add_bullet(PairLibraries& libraries);

/// Runs the libraries called `names` on `count` pairs. Prints whose answers are wrong: those about pairs that are not
/// within 1e-9 of contact, and distances that are off by more than 1e-5.
std::vector<Outcome> compare_pairs(const PairLibraries& libraries, Query query, bool near, size_t count, uint64_t seed,
                                   double seconds, const std::vector<std::string>& names);

/// pair-boolean/near, pair-distance/random ...
std::string pairs_name(Query query, bool near);

} // namespace prolate::bench::peers

// Most bodies that touch can be separated in one way: along one normal, by one depth, no pair of triangles that meet is
// left. That is found from all pairs together, and each then gives its points along that normal, which takes a tenth of
// the time of asking each for the way that it has by itself (contacts.cpp).
//
// The way is sought twice. First as where the bodies, climbed around the pairs, overlap least, as convex bodies do. It
// is confirmed if something lies about as deep there: if not, the climbs have left the place where the bodies touch, as
// they do inside a ring, along a thread or in a hollow. Then along the mean of the faces, and along that face through
// which the deepest point would leave, as deep as what can be reached without leaving the other body. Bodies that are
// apart, within a margin, have the way between their nearest points, if a plane across it lies between all that is near
// each pair. What none of these finds, as where a box stands in a corner, has several ways.
#pragma once

#include "query/contacts/bodies.hpp"

#include <cmath>
#include <span>

namespace prolate::query {

/// The mean of the outward normals of faces, B's reversed.
class FacesMean {
public:
    void add(const PlacedTriangle& a, const PlacedTriangle& b) noexcept;
    /// Of length 1. 0, if it says little: they look in all directions.
    glm::dvec3 direction() const noexcept;

private:
    glm::dvec3 sum_{0, 0, 0};
    double count_ = 0;
};

class OneWay {
public:
    /// What it finds: the way, and the points along it. All must outlive it.
    OneWay(TouchingBodies& bodies, const Candidates& candidates, Way& way, Patch& points) noexcept
        : bodies_(bodies), candidates_(candidates), way_(way), points_(points) {}

    /// Seeks the direction by some of the pairs that meet: of least overlap. False if there is none. The bodies must be
    /// closed.
    bool begin(std::span<const MeetingPair> some) noexcept;
    /// After confirm() said no: begins again with the next direction, for which all pairs must be added once more.
    /// False if there is none left. Of bodies that are apart, within the margin, the one between their nearest points.
    /// Else first that of the mean of the faces; then that along which what was deepest bears.
    bool turn() noexcept;
    /// Is the depth of this direction known, or that of the pairs?
    bool by_climbs() const noexcept { return by_climbs_; }
    /// Takes the points of a pair.
    void add(const MeetingPair& pair) noexcept;
    /// After all pairs, and not during a traversal: is this the way out? Finds the deepest points.
    bool confirm() noexcept;

private:
    void start(const Way& way, bool by_climbs) noexcept;
    bool clip(const MeetingPair& pair, const PlacedTriangle& a, const PlacedTriangle& b) noexcept;
    void take(const Contact& contact) noexcept;
    double most() const noexcept;
    bool own_is_shorter(double share, double depth) const noexcept;
    bool confirm_climbs() noexcept;
    bool confirm_inside() noexcept;

    TouchingBodies& bodies_;
    const Candidates& candidates_;
    Way& way_;
    Patch& points_;
    bool by_climbs_ = true, apart_ = false;
    FacesMean faces_;
    glm::dvec3 bears_{0, 0, 0};
    uint32_t turns_ = 0;
    double own_ = HUGE_VAL;      // least overlap that a pair has by itself
    double shortest_ = HUGE_VAL; // depth of the last direction that is not by climbs
    double beside_ = -HUGE_VAL;  // most overlap of pairs that have no points
};

} // namespace prolate::query

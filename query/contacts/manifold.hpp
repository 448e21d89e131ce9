// Many points of contact reduced to a few manifolds, as they come, in constant room.
//
// Source: Gregorius, "Robust contact creation for physics simulations" (GDC 2015): of the points of one normal keep the
// deepest, the farthest from it, the one that makes the largest triangle with these, and the one that adds most to it;
// Bullet and Jolt do the same, in other orders. Here points first go through a sieve of constant size: of each patch
// the deepest is kept and the farthest in eight directions of its plane, which do not depend on the order they come in.
// A convex outline of four corners passes it whole.
//
// Points of the last query are preferred while another is better by less than a tenth, so that what rests stays.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/contacts.hpp>

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

struct Candidate {
    glm::dvec3 middle{0, 0, 0}; // between the surfaces
    double depth = 0;
    uint64_t id = 0;
    bool known = false;         // of the last query
    glm::dvec3 normal{0, 0, 1}; // of the pair
    MeetingPair pair;
};

/// Points of about one normal.
class Patch {
public:
    static constexpr uint32_t kSieve = 9; ///< the deepest; the farthest in eight directions

    explicit Patch(const glm::dvec3& normal) noexcept;
    Patch() = default;

    bool takes(const glm::dvec3& normal) const noexcept;
    /// `weight`: of the normal in the mean. `overlap`: what separates the bodies here, along the normal. Points nearer
    /// to each other than `same_point` count as one.
    void add(const glm::dvec3& normal, const Candidate& candidate, double weight, double overlap,
             double same_point) noexcept;
    /// May a point of the ellipsoid that is no deeper than `depth` take the place of one, be it deeper by more than 1 %
    /// or a tenth of same_point, or farther out? Ask only if there are points.
    bool may_take(const PlacedEllipsoid& e, double depth, double same_point) const noexcept;
    bool empty() const noexcept { return !any_; }
    double depth() const noexcept { return any_ ? sieve_[0].depth : -1e300; } ///< of the deepest point
    double overlap() const noexcept { return overlap_; }                      ///< the largest
    const Candidate* begin() const noexcept { return sieve_; } ///< those that stand for all, if there are any
    const Candidate* end() const noexcept { return sieve_ + kSieve; }
    glm::dvec3 normal() const noexcept; ///< the mean
    /// Is the mean one of different normals?
    bool mixed() const noexcept;
    /// The best four or fewer. Returns how many.
    uint32_t reduce(double same_point, Candidate (&out)[kManifoldPoints]) const noexcept;

private:
    glm::dvec3 seed_{0, 0, 1}, x_{1, 0, 0}, y_{0, 1, 0}, sum_{0, 0, 0};
    double weight_ = 0;
    Candidate sieve_[kSieve];
    double reach_[kSieve]; // what each is the best for: depth, or coordinate
    double overlap_ = -1e300;
    bool any_ = false;
};

/// The manifold of a patch, in the world. `exchanged`: the caller has the bodies the other way round. `to_world`: from
/// A's frame.
Manifold manifold_of(const Patch& patch, double same_point, bool exchanged, const RelativePose& to_world) noexcept;

/// Sorts points into patches by their normals: the deepest of them, if there are more.
class Patches {
public:
    static constexpr uint32_t kMost = 8;

    explicit Patches(double same_point) : same_point_(same_point) {}
    /// A patch for points of about this normal, if some come.
    void expect(const glm::dvec3& normal) noexcept {
        if (count_ < kMost) patches_[count_++] = Patch(normal);
    }
    void add(const glm::dvec3& normal, const Candidate& candidate, double weight, double overlap) noexcept;
    double same_point() const noexcept { return same_point_; }
    /// Calls visit(patch) for those that have points.
    template <class Visit> void for_each(Visit&& visit) const {
        for (uint32_t i = 0; i < count_; ++i)
            if (!patches_[i].empty()) visit(patches_[i]);
    }

private:
    double same_point_;
    Patch patches_[kMost];
    uint32_t count_ = 0;
};

} // namespace prolate::query

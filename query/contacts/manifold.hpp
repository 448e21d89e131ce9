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

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace prolate::query {

struct Candidate {
    glm::dvec3 middle; // between the surfaces
    double depth;
    uint64_t id;
    bool known;        // of the last query
    glm::dvec3 normal; // of the pair
    MeetingPair pair;
};

/// Of the depth: what the deepest point's may be too small by.
inline constexpr double kSameDepth = 0.01;

/// Between which heights something lies along a direction.
struct Extent {
    double low, high;
};

/// Points of about one normal.
class Patch {
public:
    static constexpr uint32_t kSieve = 9; ///< the deepest; the farthest in eight directions

    /// `lean`: what a point counts as farther out for each metre that it is deeper.
    explicit Patch(const glm::dvec3& normal, double lean = 0) noexcept;
    /// `along`: what the first of directions() is to be, about; not parallel to the normal.
    Patch(const glm::dvec3& normal, const glm::dvec3& along, double lean = 0) noexcept;
    Patch() = default;

    bool takes(const glm::dvec3& normal) const noexcept;
    /// `weight`: of the normal in the mean. `overlap`: what separates the bodies here, along the normal. Points nearer
    /// to each other than `same_point` count as one.
    /// True if the candidate takes a place.
    bool add(const glm::dvec3& normal, const Candidate& candidate, double weight, double overlap,
             double same_point) noexcept;
    /// Gives the deepest point this depth, if it is greater.
    void deepen(double depth) noexcept {
        if (depth > reach_[0]) kept_[best_[0]].depth = reach_[0] = depth;
    }
    /// The directions that points are the farthest along, and against.
    std::array<glm::dvec3, 4> directions() const noexcept {
        constexpr double kDiagonal = 0.7071067811865476;
        return {x_, y_, kDiagonal * (x_ + y_), kDiagonal * (x_ - y_)};
    }
    /// Between which heights the points count as lying along one of directions(), if there are any.
    Extent extent(uint32_t i) const noexcept { return {-reach_[5 + i], reach_[1 + i]}; }
    /// May a point of this depth take a place, were it known of the last query? All may, as long as there are none.
    bool may_take(const glm::dvec3& middle, double depth, double same_point) const noexcept {
        const double x = glm::dot(x_, middle), y = glm::dot(y_, middle);
        constexpr double kDiagonal = 0.7071067811865476;
        const double values[] = {
            depth, x, y, kDiagonal * (x + y), kDiagonal * (x - y), -x, -y, -kDiagonal * (x + y), kDiagonal * (y - x)};
        bool may = !any_ || depth > reach_[0] - same_point;
        for (uint32_t i = 1; i < kSieve; ++i) may = may || values[i] + lean_ * depth > reach_[i] - same_point;
        return may;
    }
    /// By how much a point that is no deeper than `depth`, and along each direction d within extent(d), may be deeper
    /// than the deepest, by more than 1 % or a tenth of same_point, or lie farther out than all, by more than
    /// same_point and than this share of the extent that they have. Not above 0: it takes no place. Ask only if there
    /// are points.
    template <class ExtentAlong>
    double gain(double depth, double same_point, double share, ExtentAlong&& extent) const noexcept {
        const std::array<glm::dvec3, 4> ways = directions();
        double most = depth - reach_[0] - std::max(kSameDepth * std::abs(reach_[0]), 0.1 * same_point);
        for (uint32_t i = 0; i < 4; ++i) {
            const Extent along = extent(ways[i]);
            const double same = std::max(same_point, share * (reach_[1 + i] + reach_[5 + i]));
            most =
                std::max(most, std::max(along.high - reach_[1 + i], -along.low - reach_[5 + i]) + lean_ * depth - same);
        }
        return most;
    }
    /// Does a point lie within extent(d) along the patch's two axes?
    template <class ExtentAlong>
    bool holds(const glm::dvec3& p, double same_point, ExtentAlong&& extent) const noexcept {
        const auto within = [&](const glm::dvec3& d) {
            const Extent along = extent(d);
            return glm::dot(d, p) >= along.low - same_point && glm::dot(d, p) <= along.high + same_point;
        };
        return within(x_) && within(y_);
    }
    bool empty() const noexcept { return !any_; }
    double depth() const noexcept { return any_ ? deepest().depth : -1e300; } ///< of the deepest point
    double overlap() const noexcept { return overlap_; }                      ///< the largest
    const Candidate& deepest() const noexcept { return kept_[best_[0]]; }     ///< if there are points
    /// Those that stand for all, if there are any, each once: the deepest first. Returns how many.
    uint32_t kept(const Candidate* (&out)[kSieve]) const noexcept;
    glm::dvec3 normal() const noexcept; ///< the mean
    /// Is the mean one of different normals?
    bool mixed() const noexcept;
    /// Counts in the mean, without a point.
    void weigh(const glm::dvec3& normal, double weight) noexcept { sum_ += weight * normal, weight_ += weight; }
    /// The best four or fewer, if there are any; `n`: normal(). Returns how many.
    uint32_t reduce(const glm::dvec3& n, double same_point, const Candidate* (&out)[kManifoldPoints]) const noexcept;

private:
    glm::dvec3 seed_{0, 0, 1}, x_{1, 0, 0}, y_{0, 1, 0}, sum_{0, 0, 0};
    double weight_ = 0, lean_ = 0;
    Candidate kept_[kSieve]; // each once, for what it is the best for is often several things
    uint8_t best_[kSieve];   // of kept_: the deepest, and the farthest in each direction
    double reach_[kSieve];   // their depth, or coordinate
    double overlap_ = -1e300;
    bool any_ = false;
};

/// The manifold of a patch, in the world. `exchanged`: the caller has the bodies the other way round. `to_world`: from
/// A's frame.
Manifold manifold_of(const Patch& patch, double same_point, bool exchanged, const RelativePose& to_world) noexcept;

/// What contacts of cores are, of bodies that are these and all within a radius of them.
void round_contacts(ContactManifolds& manifolds, float radius_a, float radius_b) noexcept;

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
    /// Each keeps its number.
    uint32_t count() const noexcept { return count_; }
    Patch& operator[](uint32_t i) noexcept { return patches_[i]; }
    bool full() const noexcept { return count_ == kMost; } ///< one may take another's number
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

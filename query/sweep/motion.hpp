// Two bodies in motion, seen from one of them: poses at any time in double precision, and how fast all is.
//
// Sines and cosines are our own, from basic operations, so that they are the same bits everywhere: the argument less a
// multiple of pi / 2 (of which a number of 33 bits and the rest are taken off, after Cody and Waite 1980), then
// Taylor's series; wrong by at most 2 u, u = 2^-53, for arguments up to kMaxTurn.
//
// Rounding, in the terms of query/ellipsoid/separation.hpp; theta = t |angular| for a body, the angle it has turned by.
//   turn        of half the angle: |angular| is wrong by 3 u of itself, so the quaternion by at most (10 + 2 theta) u,
//               the matrix by (60 + 6 theta) u
//   R(t)        turn times the starting rotation, 29 u:                    |dR| <= (100 + 6 theta) u
//   T = R_a^T R_b                                                         |dT| <= (210 + 6 (theta_a + theta_b)) u
//   translation R_a^T (what lies between the centers) - T center_b + center_a, wrong by at most
//               (320 + 12 (theta_a + theta_b)) u (|d| + 2 |center_a| + 2 |center_b| + |linear_a| + |linear_b|)
// A point x of body B is therefore seen at a place that is wrong by at most slack (lengths + |x|), where `lengths` is
// the last bracket and slack = 2^-44 (1 + (theta_a + theta_b) / 16), 512 u for small angles. RelativePose::distance is
// `lengths`, which bounds all that entered the translation, so that the queries' own margins hold as well.
#pragma once

#include "query/ellipsoid/separation.hpp"

#include <prolate/sweep.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace prolate::query {

struct SineCosine {
    double sine, cosine;
};
/// |x| <= kMaxTurn.
SineCosine sine_cosine(double x) noexcept;

/// Of the smaller body's size: the tolerance if none is given.
inline constexpr double kSweepTolerance = 1e-4;

/// What a meeting of cores is, of bodies that are these and all within a radius of them.
inline void round_sweep(SweepResult& r, float radius_a, float radius_b) noexcept {
    if (r.enclosed || !(r.time_upper <= 1)) return;
    const auto move = [&](Vec3& p, float by) {
        p = {p.x + by * r.normal.x, p.y + by * r.normal.y, p.z + by * r.normal.z};
    };
    move(r.point_a, radius_a), move(r.point_b, -radius_b);
    r.distance = r.distance > double{radius_a} + radius_b ? r.distance - (double{radius_a} + radius_b) : 0;
}

/// The motion of one body, in double precision.
class MovingBody {
public:
    explicit MovingBody(const Motion& motion) noexcept;

    glm::dmat3 rotation(double t) const noexcept;
    /// What the point turned about is, relative to the starting translation, in the world.
    glm::dvec3 center_at(double t) const noexcept { return arm_ + t * linear_; }
    const glm::dvec3& center() const noexcept { return center_; }
    const glm::dvec3& linear() const noexcept { return linear_; }
    /// Rotation vector: in the body's own frame it never changes.
    const glm::dvec3& spin() const noexcept { return spin_; }
    double speed() const noexcept { return speed_; } ///< |spin|
    bool finite() const noexcept;
    /// (sin(h) axis, cos(h)), h half the angle at time t.
    glm::dvec4 turn(double t) const noexcept;

private:
    glm::dmat3 start_;
    glm::dvec3 center_, arm_, linear_, angular_, spin_;
    double speed_;
};

/// Both bodies at one time, in the frame of body A.
struct Instant {
    RelativePose b_to_a;
    glm::dvec3 center_b; ///< the point that B turns about
    glm::dvec3 velocity; ///< of B's less of A's
    glm::dvec3 spin_b;
    double slack; ///< see above
};

class PairMotion {
public:
    PairMotion(const Motion& a, const Motion& b) noexcept;
    /// At the start, the pose is that of the queries that know no motion, to the bit.
    Instant at(double t) const noexcept;
    const MovingBody& a() const noexcept { return a_; }
    const MovingBody& b() const noexcept { return b_; }
    bool finite() const noexcept;

private:
    MovingBody a_, b_;
    RelativePose start_;
    glm::dvec3 between_; ///< the starting translation of B less that of A
    double lengths_;
};

} // namespace prolate::query

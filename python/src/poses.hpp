// Poses of a call: one, or one for each of N queries, in any of the forms that Python callers have.
//
// The runtime takes poses of floats. A pose of doubles that floats hold exactly goes there as it is. Of any other, the
// bodies are taken in the frame of one of them: the other's pose in it is computed in double precision and only then
// rounded, so that no digits are lost far from the origin, and `slack` bounds how far a point of the body is moved by
// the rounding. Callers add it to the margin, so that *separated* holds of the poses as they were given.
#pragma once

#include "python/src/arrays.hpp"

#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>
#include <prolate/types.hpp>

#include <array>
#include <span>
#include <vector>

namespace prolate::python {

/// x y z, qx qy qz qw.
struct DoublePose {
    double t[3] = {0, 0, 0};
    double q[4] = {0, 0, 0, 1};
};
using Point = std::array<double, 3>;
using Quaternion = std::array<double, 4>; ///< x y z w

/// Turns by `b`, then by `a`.
inline Quaternion product(const Quaternion& a, const Quaternion& b) noexcept {
    return {
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

/// Are all its numbers floats?
bool holds_floats(const DoublePose& pose) noexcept;
Pose to_floats(const DoublePose& pose) noexcept;

Point transformed(const DoublePose& pose, const Point& p) noexcept;
Point rotated(const DoublePose& pose, const Point& v) noexcept;
/// transpose(R) v.
Point rotated_back(const DoublePose& pose, const Point& v) noexcept;

/// Checked: finite, within the range of floats, no quaternion of zero.
class Poses {
public:
    /// The identity, single.
    Poses();
    /// Shapes (7,), (N, 7), (4, 4) or (N, 4, 4). `order` is "xyzw" or "wxyz", which has the real part first.
    Poses(nb::handle value, const char* name, nb::handle order);
    Poses(Poses&&) = default; // a copy would point into the other's vector

    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return single_; }
    /// Null if the poses came as doubles.
    const Pose* floats() const noexcept { return floats_; }
    /// Pose `i`; the only one, if there is one.
    DoublePose at(size_t i) const noexcept;
    size_t index(size_t i) const noexcept { return count_ == 1 ? 0 : i; }

private:
    void take_matrices(const double* entries, const char* name);
    void check(const char* name) const;

    size_t count_ = 0;
    bool single_ = false;
    const Pose* floats_ = nullptr;
    const DoublePose* doubles_ = nullptr;
    std::vector<DoublePose> own_;
    nb::object keep_;
};

/// Number of queries that `a` and `b` make up: equal counts, or one of them 1.
size_t broadcast(const Poses& a, const char* name_a, const Poses& b, const char* name_b);

/// Two bodies as the runtime takes them.
struct PlacedBodies {
    Pose a, b;
    double slack = 0;      ///< metres; 0 if the poses are the caller's
    bool in_frame = false; ///< `a` and `b` are in `frame`
    DoublePose frame;
    Point to_world(const Vec3& p) const noexcept;
    Point direction_to_world(const Vec3& v) const noexcept;
};
/// A pose in which others are taken.
struct Frame {
    DoublePose pose;
    std::array<double, 4> back{0, 0, 0, 1}; ///< the unit quaternion of the inverse rotation
    Frame() = default;
    explicit Frame(const DoublePose& of) noexcept;
};

/// The pose of `body` in `frame`, rounded, and by how much that moves a point at `reach`.
struct RoundedPose {
    Pose pose;
    double slack;
};
RoundedPose in_frame(const Frame& frame, const DoublePose& body, double reach) noexcept;

/// `p`, rounded; adds to `slack` by how much.
Vec3 rounded(const Point& p, double& slack) noexcept;

/// The half-space normal.p <= offset, {normal, offset} in `n`, in the frame of a body. Where the body is, within
/// `reach` of its origin, its plane is off by at most `slack`.
HalfSpace half_space_in_frame(double reach, const DoublePose& body, std::span<const double> n, double& slack) noexcept;

/// A motion between two poses, rounded in `frame`, and by how much that moves any of its points at most.
struct RoundedMotion {
    Motion motion;
    double slack;
};
RoundedMotion motion_in(const Frame& frame, const DoublePose& start, const DoublePose& end, double reach) noexcept;

} // namespace prolate::python

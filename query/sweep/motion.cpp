#include "query/sweep/motion.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace prolate {
namespace query {
namespace {

using glm::dmat3;
using glm::dvec3;
using glm::dvec4;

// Rotation of the unit quaternion (v, w).
dmat3 matrix_of(const dvec4& q) {
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
            {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
            {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
}

constexpr size_t kTerms = 11;
// 1 / n! with the signs of the sine's series, or with `first` = 0 of the cosine's: terms of x^first, x^(first + 2) ...
constexpr std::array<double, kTerms> series(int first) {
    std::array<double, kTerms> out{};
    double factorial = 1;
    int n = first;
    for (size_t i = 0; i < kTerms; ++i) {
        out[i] = (i % 2 == 0 ? 1 : -1) / factorial;
        factorial *= (n + 1) * (n + 2); // exact below 2^53, then as good as any rounding of small terms
        n += 2;
    }
    return out;
}
constexpr auto kSine = series(1), kCosine = series(0);

double sum(const std::array<double, kTerms>& terms, double square) {
    double out = terms[kTerms - 1];
    for (size_t i = kTerms - 1; i-- > 1;) out = out * square + terms[i];
    return out * square; // without the first term, 1, so that the caller may add it last
}

} // namespace

SineCosine sine_cosine(double x) noexcept {
    if (!(std::abs(x) <= kMaxTurn))
        return {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
    constexpr double kHigh = 0x1.921fb544p+0, kLow = 0x1.0b4611a626331p-34; // pi / 2
    const double turns = std::floor(x * (2 / std::numbers::pi) + 0.5);
    const double r = (x - turns * kHigh) - turns * kLow, square = r * r;
    const double s = r + r * sum(kSine, square), c = 1 + sum(kCosine, square);
    switch (static_cast<int64_t>(turns) & 3) {
    case 0:
        return {s, c};
    case 1:
        return {c, -s};
    case 2:
        return {-s, -c};
    default:
        return {-c, s};
    }
}

MovingBody::MovingBody(const Motion& motion) noexcept
    : start_(rotation_matrix(motion.start.rotation)), center_(to_double(motion.center)), arm_(start_ * center_),
      linear_(to_double(motion.linear)), angular_(to_double(motion.angular)), spin_(glm::transpose(start_) * angular_),
      speed_(glm::length(angular_)) {}

bool MovingBody::finite() const noexcept {
    return std::isfinite(glm::dot(arm_, arm_) + glm::dot(linear_, linear_)) && speed_ <= kMaxTurn;
}

dvec4 MovingBody::turn(double t) const noexcept {
    if (!(speed_ > 0)) return {0, 0, 0, 1};
    const auto [sine, cosine] = sine_cosine(0.5 * t * speed_);
    return {angular_ / speed_ * sine, cosine};
}

dmat3 MovingBody::rotation(double t) const noexcept {
    return matrix_of(turn(t)) * start_;
}

PairMotion::PairMotion(const Motion& a, const Motion& b) noexcept
    : a_(a), b_(b), start_(relative_pose(a.start, b.start)),
      between_(to_double(b.start.translation) - to_double(a.start.translation)),
      lengths_(glm::length(between_) + 2 * (glm::length(a_.center()) + glm::length(b_.center())) +
               glm::length(a_.linear()) + glm::length(b_.linear())) {}

bool PairMotion::finite() const noexcept {
    return a_.finite() && b_.finite() && std::isfinite(lengths_);
}

Instant PairMotion::at(double t) const noexcept {
    const dmat3 to_a = glm::transpose(a_.rotation(t)), b = b_.rotation(t);
    Instant out;
    out.b_to_a.rotation = to_a * b;
    out.center_b = to_a * (between_ + (b_.center_at(t) - a_.center_at(t))) + a_.center();
    out.b_to_a.translation = out.center_b - out.b_to_a.rotation * b_.center();
    out.b_to_a.distance = lengths_;
    if (t == 0) out.b_to_a = start_;
    out.velocity = to_a * (b_.linear() - a_.linear());
    out.spin_b = out.b_to_a.rotation * b_.spin();
    out.slack = 0x1p-44 * (1 + t * (a_.speed() + b_.speed()) / 16);
    return out;
}

} // namespace query

Pose pose_at(const Motion& motion, double t) noexcept {
    const query::MovingBody body(motion);
    const auto q = body.turn(t);
    const Quat& s = motion.start.rotation;
    const double x = s.x, y = s.y, z = s.z, w = s.w, length = std::sqrt(x * x + y * y + z * z + w * w);
    const auto part = [length](double value) { return static_cast<float>(value / length); };
    const glm::dvec3 moved = body.center_at(t) - body.rotation(t) * body.center();
    const auto place = [](float from, double by) { return static_cast<float>(from + by); };
    const Vec3& from = motion.start.translation;
    return {{place(from.x, moved.x), place(from.y, moved.y), place(from.z, moved.z)},
            {part(q.w * x + q.x * w + q.y * z - q.z * y), part(q.w * y - q.x * z + q.y * w + q.z * x),
             part(q.w * z + q.x * y - q.y * x + q.z * w), part(q.w * w - q.x * x - q.y * y - q.z * z)}};
}

Motion motion_between(const Pose& start, const Pose& end, const Vec3& center) noexcept {
    const auto unit = [](const Quat& q) {
        const glm::dvec4 v(q.x, q.y, q.z, q.w);
        return v / glm::length(v);
    };
    const glm::dvec4 p = unit(start.rotation), q = unit(end.rotation);
    // q p^-1: the turn in the world.
    glm::dvec3 axis(-q.w * p.x + q.x * p.w - q.y * p.z + q.z * p.y, -q.w * p.y + q.x * p.z + q.y * p.w - q.z * p.x,
                    -q.w * p.z - q.x * p.y + q.y * p.x + q.z * p.w);
    double cosine = glm::dot(p, q);
    if (cosine < 0) axis = -axis, cosine = -cosine;
    const double sine = glm::length(axis);
    // Half the angle: where sine / cosine is a tangent. The correction is the sine of what is still missing.
    double half = sine < cosine ? sine : std::numbers::pi / 2 - cosine;
    for (int i = 0; i < 6; ++i) {
        const auto at = query::sine_cosine(half);
        half += sine * at.cosine - cosine * at.sine;
    }
    const glm::dvec3 angular = sine > 0 ? axis * (2 * half / sine) : glm::dvec3(0);
    const glm::dvec3 c(center.x, center.y, center.z);
    const glm::dvec3 turned = query::rotation_matrix(end.rotation) * c - query::rotation_matrix(start.rotation) * c;
    const auto moved = [](float from, float to, double by) { return static_cast<float>((double{to} - from) + by); };
    const Vec3 &s = start.translation, &e = end.translation;
    return {start,
            {moved(s.x, e.x, turned.x), moved(s.y, e.y, turned.y), moved(s.z, e.z, turned.z)},
            {static_cast<float>(angular.x), static_cast<float>(angular.y), static_cast<float>(angular.z)},
            center};
}

} // namespace prolate

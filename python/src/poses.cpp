#include "python/src/poses.hpp"

#include <prolate/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace prolate::python {
namespace {

static_assert(sizeof(Pose) == 7 * sizeof(float) && sizeof(DoublePose) == 7 * sizeof(double));

constexpr double kMost = std::numeric_limits<float>::max();

// All quaternions here have squares within range: check() lets nothing else through.
double square_of(const Quaternion& q) noexcept {
    return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
}
Quaternion turn_of(const DoublePose& pose) noexcept {
    return {pose.q[0], pose.q[1], pose.q[2], pose.q[3]};
}
Quaternion unit(const Quaternion& q) noexcept {
    const double scale = 1 / std::sqrt(square_of(q));
    return {q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale};
}

// By a quaternion of any length.
Point turned(const Quaternion& q, const Point& v) noexcept {
    const double s = 2 / square_of(q), x = q[0], y = q[1], z = q[2], w = q[3];
    return {(1 - s * (y * y + z * z)) * v[0] + s * ((x * y - z * w) * v[1] + (x * z + y * w) * v[2]),
            (1 - s * (x * x + z * z)) * v[1] + s * ((x * y + z * w) * v[0] + (y * z - x * w) * v[2]),
            (1 - s * (x * x + y * y)) * v[2] + s * ((x * z - y * w) * v[0] + (y * z + x * w) * v[1])};
}
Quaternion conjugate(const Quaternion& q) noexcept {
    return {-q[0], -q[1], -q[2], q[3]};
}

std::string at_index(const char* name, bool single, size_t i) {
    return single ? std::string(name) : std::string(name) + "[" + std::to_string(i) + "]";
}

DoublePose pose_of(const double (&m)[4][4]) noexcept {
    const double rotation[3][3] = {
        {m[0][0], m[0][1], m[0][2]}, {m[1][0], m[1][1], m[1][2]}, {m[2][0], m[2][1], m[2][2]}};
    const auto [x, y, z, w] = quaternion_of(rotation);
    return {{m[0][3], m[1][3], m[2][3]}, {x, y, z, w}};
}

bool is_wxyz(nb::handle order) {
    if (PyUnicode_Check(order.ptr())) {
        if (PyUnicode_CompareWithASCIIString(order.ptr(), "xyzw") == 0) return false;
        if (PyUnicode_CompareWithASCIIString(order.ptr(), "wxyz") == 0) return true;
    }
    value_error("order", "must be \"xyzw\" or \"wxyz\"");
}

// Doubles of any layout to `own`, the quaternion's real part last.
void take_sevens(const double* from, size_t count, bool wxyz, std::vector<DoublePose>& own) {
    own.resize(count);
    std::memcpy(static_cast<void*>(own.data()), from, count * sizeof(DoublePose));
    if (wxyz)
        for (DoublePose& pose : own) std::rotate(std::begin(pose.q), std::begin(pose.q) + 1, std::end(pose.q));
}

} // namespace

bool holds_floats(const DoublePose& pose) noexcept {
    const auto is_float = [](double x) { return static_cast<double>(static_cast<float>(x)) == x; };
    return std::all_of(std::begin(pose.t), std::end(pose.t), is_float) &&
           std::all_of(std::begin(pose.q), std::end(pose.q), is_float);
}
Pose to_floats(const DoublePose& pose) noexcept {
    const auto f = [](double x) { return static_cast<float>(x); };
    return {{f(pose.t[0]), f(pose.t[1]), f(pose.t[2])}, {f(pose.q[0]), f(pose.q[1]), f(pose.q[2]), f(pose.q[3])}};
}

Point transformed(const DoublePose& pose, const Point& p) noexcept {
    const Point r = rotated(pose, p);
    return {r[0] + pose.t[0], r[1] + pose.t[1], r[2] + pose.t[2]};
}
Point rotated(const DoublePose& pose, const Point& v) noexcept {
    return turned(turn_of(pose), v);
}
Point rotated_back(const DoublePose& pose, const Point& v) noexcept {
    return turned(conjugate(turn_of(pose)), v);
}

Poses::Poses() : count_(1), single_(true), own_(1) {
    doubles_ = own_.data();
}
Poses::Poses(nb::handle value, const char* name, nb::handle order) {
    const bool wxyz = is_wxyz(order);
    AnyArray array = import_array(value);
    keep_ = nb::borrow(value);
    const bool is_float = array.is_valid() && array.dtype() == nb::dtype<float>();
    const bool is_double = array.is_valid() && array.dtype() == nb::dtype<double>();
    const bool sevens = array.is_valid() && array.ndim() <= 2 && array.ndim() > 0 && array.shape(array.ndim() - 1) == 7;
    const bool as_is = (is_float || is_double) && array.is_contiguous();
    if (!as_is || (is_float && (wxyz || !sevens))) {
        keep_ = as_numpy(value, name, "float64");
        array = import_array(keep_);
    }
    const size_t ndim = array.ndim();
    const auto size = [&](size_t from_last) { return ndim >= from_last ? array.shape(ndim - from_last) : 0; };
    const bool matrices = (ndim == 2 || ndim == 3) && size(1) == 4 && size(2) == 4;
    if (!matrices && !((ndim == 1 || ndim == 2) && size(1) == 7))
        value_error(name, "must have shape (7,), (N, 7), (4, 4) or (N, 4, 4), not " + array.shape_text());
    single_ = ndim == (matrices ? 2u : 1u);
    count_ = single_ ? 1 : array.shape(0);
    if (matrices) {
        take_matrices(static_cast<const double*>(array.data()), name);
    } else if (array.dtype() == nb::dtype<float>()) {
        floats_ = static_cast<const Pose*>(array.data());
    } else if (wxyz) {
        take_sevens(static_cast<const double*>(array.data()), count_, wxyz, own_);
        doubles_ = own_.data();
    } else {
        doubles_ = static_cast<const DoublePose*>(array.data());
    }
    check(name);
}

void Poses::take_matrices(const double* entries, const char* name) {
    own_.resize(count_);
    for (size_t i = 0; i < count_; ++i) {
        Matrix4 matrix;
        std::memcpy(matrix.m, entries + 16 * i, sizeof matrix.m);
        if (const auto rigid = pose_from_matrix(matrix); !rigid)
            value_error(at_index(name, single_, i), rigid.error().what);
        own_[i] = pose_of(matrix.m);
    }
    doubles_ = own_.data();
}

void Poses::check(const char* name) const {
    for (size_t i = 0; i < count_; ++i) {
        const DoublePose pose = at(i);
        const auto& [t, q] = pose;
        const double squares = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
        if (std::abs(t[0]) + std::abs(t[1]) + std::abs(t[2]) <= kMost && squares > 1e-30 && squares <= kMost) continue;
        const auto fits = [](double x) { return std::abs(x) <= kMost; }; // false for NaN
        if (!std::all_of(std::begin(pose.t), std::end(pose.t), fits) ||
            !std::all_of(std::begin(pose.q), std::end(pose.q), fits))
            value_error(at_index(name, single_, i), "is not finite, or beyond the range of float32");
        const double most =
            std::max({std::abs(pose.q[0]), std::abs(pose.q[1]), std::abs(pose.q[2]), std::abs(pose.q[3])});
        if (!(most > 1e-18)) value_error(at_index(name, single_, i), "has a quaternion of 0; no rotation is 0 0 0 1");
    }
}

DoublePose Poses::at(size_t i) const noexcept {
    if (!floats_) return doubles_[index(i)];
    const Pose& p = floats_[index(i)];
    return {{p.translation.x, p.translation.y, p.translation.z},
            {p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w}};
}

size_t broadcast(const Poses& a, const char* name_a, const Poses& b, const char* name_b) {
    if (a.count() == b.count() || b.count() == 1) return a.count();
    if (a.count() == 1) return b.count();
    value_error(name_b, "has " + std::to_string(b.count()) + " poses and " + name_a + " " + std::to_string(a.count()) +
                            "; give as many, or one");
}

Point PlacedBodies::to_world(const Vec3& p) const noexcept {
    const Point point = {p.x, p.y, p.z};
    return in_frame ? transformed(frame, point) : point;
}
Point PlacedBodies::direction_to_world(const Vec3& v) const noexcept {
    const Point direction = {v.x, v.y, v.z};
    return in_frame ? rotated(frame, direction) : direction;
}

Frame::Frame(const DoublePose& of) noexcept : pose(of), back(conjugate(unit(turn_of(of)))) {}

RoundedPose in_frame(const Frame& frame, const DoublePose& body, double reach) noexcept {
    const DoublePose& at = frame.pose;
    const Point d = {body.t[0] - at.t[0], body.t[1] - at.t[1], body.t[2] - at.t[2]};
    const Point t = turned(frame.back, d);
    // Quaternions of about length 1 need not be made exactly so for the runtime.
    const Quaternion given = turn_of(body);
    const double squares = square_of(given);
    const bool plain = squares > 0x1p-20 && squares < 0x1p20;
    const Quaternion q = product(frame.back, plain ? given : unit(given));
    const DoublePose exact{{t[0], t[1], t[2]}, {q[0], q[1], q[2], q[3]}};
    const Pose pose = to_floats(exact);
    const auto square = [](double x) { return x * x; };
    const double moved =
        square(t[0] - pose.translation.x) + square(t[1] - pose.translation.y) + square(t[2] - pose.translation.z);
    const double bent_squares = square(q[0] - pose.rotation.x) + square(q[1] - pose.rotation.y) +
                                square(q[2] - pose.rotation.z) + square(q[3] - pose.rotation.w);
    const double bent = std::sqrt(plain ? bent_squares / squares : bent_squares);
    // A quaternion that is off by the part `bent` of its length turns by another angle of at most 2 bent (1 + bent).
    // The last term is more than what double precision loses above.
    const double lengths = std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2]) + reach;
    return {pose, 1.0001 * (std::sqrt(moved) + 2 * bent * reach) + 0x1p-46 * lengths};
}

Vec3 rounded(const Point& p, double& slack) noexcept {
    const Vec3 out{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    slack += std::hypot(p[0] - out.x, p[1] - out.y, p[2] - out.z);
    return out;
}

HalfSpace half_space_in_frame(double reach, const DoublePose& body, std::span<const double> n, double& slack) noexcept {
    const double length = std::hypot(n[0], n[1], n[2]);
    const Point normal = {n[0] / length, n[1] / length, n[2] / length};
    const double offset = n[3] / length;
    const double below = offset - (normal[0] * body.t[0] + normal[1] * body.t[1] + normal[2] * body.t[2]);
    double bent = 0;
    const Vec3 local_normal = rounded(rotated_back(body, normal), bent);
    const auto local_offset = static_cast<float>(below);
    const double lengths = std::abs(body.t[0]) + std::abs(body.t[1]) + std::abs(body.t[2]) + std::abs(offset);
    slack = 4 * bent * (reach + std::abs(below)) + std::abs(below - local_offset) + 0x1p-46 * (reach + lengths);
    return {local_normal, local_offset};
}

RoundedMotion motion_in(const Frame& frame, const DoublePose& start, const DoublePose& end, double reach) noexcept {
    const RoundedPose from = in_frame(frame, start, reach), to = in_frame(frame, end, reach);
    // In between, a point is off by no more than at both ends together, the turn of at most pi between them included;
    // motion_between() rounds once more, at most by as much.
    const double rounding =
        0x1p-22 * (reach + std::hypot(from.pose.translation.x, from.pose.translation.y, from.pose.translation.z) +
                   std::hypot(to.pose.translation.x, to.pose.translation.y, to.pose.translation.z));
    return {motion_between(from.pose, to.pose), 4 * (from.slack + to.slack) + rounding};
}

} // namespace prolate::python

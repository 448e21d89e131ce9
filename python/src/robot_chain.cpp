#include "python/src/robot_chain.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::python {
namespace {

double length(const Point& v) noexcept {
    return std::hypot(v[0], v[1], v[2]);
}

PROLATE_ROBOT_INLINE void multiply(const Doubles (&a)[4], const Doubles (&b)[4], Doubles (&out)[4]) {
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

template <class T> const T* column(nb::handle array, const char* name, size_t rows, std::vector<T>& own) {
    const AnyArray view = import_array(array);
    if (!view.is_valid() || !view.is_contiguous() || view.dtype() != nb::dtype<T>())
        type_error(name, "must be a contiguous array of the type that prolate.robots makes");
    const auto* const from = static_cast<const T*>(view.data());
    own.assign(from, from + view.size());
    if (rows != 0 && own.size() != rows) value_error(name, "has the wrong length");
    return own.data();
}

// Two unit vectors that make a right-handed frame with the unit vector `a`; x and y for z. T. Duff et al., "Building an
// Orthonormal Basis, Revisited", Journal of Computer Graphics Techniques 6 (1), 2017.
std::array<Point, 2> across(const Point& a) noexcept {
    const double s = a[2] < 0 ? -1 : 1, b = -1 / (s + a[2]), c = a[0] * a[1] * b;
    return {Point{1 + s * a[0] * a[0] * b, s * c, -s * a[0]}, Point{c, s + a[1] * a[1] * b, -a[1]}};
}

} // namespace

Chain::Chain(nb::handle kinds, nb::handle parents, nb::handle children, nb::handle coordinates, nb::handle origins,
             nb::handle axes, nb::handle anchors, nb::handle scales, size_t link_count, size_t nq)
    : link_count_(link_count), nq_(nq), joint_of_(link_count, -1) {
    std::vector<uint8_t> kind;
    std::vector<int64_t> parent, child, coordinate;
    std::vector<double> axis, anchor, scale;
    column(kinds, "kinds", 0, kind);
    const size_t count = kind.size();
    column(parents, "parents", count, parent), column(children, "children", count, child);
    column(coordinates, "coordinates", count, coordinate), column(axes, "axes", 3 * count, axis);
    column(anchors, "anchors", 3 * count, anchor), column(scales, "scales", 2 * count, scale);
    const Poses poses(origins, "origins", nb::str("xyzw"));
    for (size_t j = 0; j < count; ++j) {
        const auto p = static_cast<size_t>(parent[j]), c = static_cast<size_t>(child[j]);
        if (p >= link_count || c >= link_count || kind[j] > static_cast<uint8_t>(JointKind::floating))
            value_error("joints[" + std::to_string(j) + "]", "names a link or kind that does not exist");
        ChainJoint joint;
        joint.kind = static_cast<JointKind>(kind[j]);
        joint.parent = static_cast<uint32_t>(p), joint.child = static_cast<uint32_t>(c);
        joint.coordinate = static_cast<size_t>(coordinate[j]);
        joint.multiplier = scale[2 * j], joint.offset = scale[2 * j + 1];
        const DoublePose origin = poses.at(j);
        const Point at{anchor[3 * j], anchor[3 * j + 1], anchor[3 * j + 2]};
        const Point along{axis[3 * j], axis[3 * j + 1], axis[3 * j + 2]};
        const double norm = std::sqrt(origin.q[0] * origin.q[0] + origin.q[1] * origin.q[1] +
                                      origin.q[2] * origin.q[2] + origin.q[3] * origin.q[3]);
        for (size_t k = 0; k < 4; ++k) joint.at_0[k] = origin.q[k] / norm;
        joint.turn = product(joint.at_0, {along[0], along[1], along[2], 0});
        joint.anchor = at, joint.axis = along;
        joint.arm = transformed(origin, at);
        const auto sides = across(along);
        joint.across = {python::rotated(origin, sides[0]), python::rotated(origin, sides[1]),
                        python::rotated(origin, along)};
        joint.length = length(joint.arm) + length(at);
        joint_of_[c] = static_cast<int64_t>(j);
        joints_.push_back(joint);
    }
}

namespace {

// The joint's own rotation, and where it takes its anchor from Joint::arm, both in the parent's frame.
struct Step {
    Doubles q[4];
    Doubles3 shift;
    Doubles far;   ///< no less than the shift's length
    Doubles angle; ///< no less than its size
};

PROLATE_ROBOT_INLINE Doubles gathered(const double* const (&q)[kLanes], size_t i) {
    Doubles out{};
    for (size_t lane = 0; lane < kLanes; ++lane) out[lane] = q[lane][i];
    return out;
}

PROLATE_ROBOT_INLINE void turn_by(const ChainJoint& joint, const Doubles& angle, Step& step) {
    Doubles s{}, c{};
    for (size_t lane = 0; lane < kLanes; ++lane) {
        s[lane] = std::sin(0.5 * angle[lane]);
        c[lane] = std::cos(0.5 * angle[lane]);
    }
    for (size_t k = 0; k < 4; ++k) step.q[k] = c * joint.at_0[k] + s * joint.turn[k];
    // Of what it is the sum of, too, where it mimics another.
    const double offset = std::abs(joint.offset);
    step.angle = (angle < 0 ? -angle : angle) + 2 * offset;
}

PROLATE_ROBOT_INLINE void shift_by(const ChainJoint& joint, size_t direction, const Doubles& by, Step& step) {
    const Point& d = joint.across[direction];
    step.shift = step.shift + Doubles3{by * d[0], by * d[1], by * d[2]};
    step.far += by < 0 ? -by : by;
}

// A unit quaternion of q, times the joint's rotation at 0.
PROLATE_ROBOT_INLINE void turn_by_quaternion(const ChainJoint& joint, const double* const (&q)[kLanes], size_t first,
                                             Doubles (&out)[4]) {
    Doubles own[4], base[4];
    for (size_t k = 0; k < 4; ++k) own[k] = gathered(q, first + k), base[k] = Doubles{} + joint.at_0[k];
    const Doubles norm = square_root(own[0] * own[0] + own[1] * own[1] + own[2] * own[2] + own[3] * own[3]);
    for (Doubles& x : own) x = x / norm;
    multiply(base, own, out);
}

PROLATE_ROBOT_INLINE Step step_of(const ChainJoint& joint, const double* const (&q)[kLanes]) {
    Step step{};
    for (size_t k = 0; k < 4; ++k) step.q[k] = Doubles{} + joint.at_0[k];
    const auto value = [&] { return gathered(q, joint.coordinate) * joint.multiplier + joint.offset; };
    switch (joint.kind) {
    case JointKind::fixed:
        break;
    case JointKind::revolute:
    case JointKind::continuous:
        turn_by(joint, value(), step);
        break;
    case JointKind::prismatic:
        shift_by(joint, 2, value(), step);
        break;
    case JointKind::planar:
        shift_by(joint, 0, gathered(q, joint.coordinate), step);
        shift_by(joint, 1, gathered(q, joint.coordinate + 1), step);
        turn_by(joint, gathered(q, joint.coordinate + 2), step);
        break;
    case JointKind::ball:
        turn_by_quaternion(joint, q, joint.coordinate, step.q);
        break;
    case JointKind::floating: {
        // Its axis is z, so these are the axes of the joint's frame.
        for (size_t k = 0; k < 3; ++k) shift_by(joint, k, gathered(q, joint.coordinate + k), step);
        turn_by_quaternion(joint, q, joint.coordinate + 3, step.q);
        break;
    }
    }
    return step;
}

PROLATE_ROBOT_CLONES void place(const ChainJoint* joints, size_t count, const double* const (&q)[kLanes],
                                LinkFrames* out) {
    for (const ChainJoint* joint = joints; joint != joints + count; ++joint) {
        const LinkFrames& parent = out[joint->parent];
        LinkFrames& child = out[joint->child];
        const Step step = step_of(*joint, q);
        multiply(parent.q, step.q, child.q);
        const Doubles zero{};
        const Doubles3 arm = {zero + joint->arm[0], zero + joint->arm[1], zero + joint->arm[2]};
        child.t = parent.t + rotated(parent.q, arm + step.shift);
        if (joint->anchor != Point{}) child.t = child.t - rotated(child.q, joint->anchor);
        child.extent = parent.extent + (step.far + joint->length);
        child.steps = parent.steps + (step.angle + 1.0);
    }
}

} // namespace

void Chain::frames(const double* const (&q)[kLanes], LinkFrames* out) const noexcept {
    const Doubles zero{};
    out[0] = {{zero, zero, zero}, {zero, zero, zero, zero + 1.0}, zero, zero};
    place(joints_.data(), joints_.size(), q, out);
}

DoublePose pose_in(const LinkFrames& frames, size_t lane) noexcept {
    return {{frames.t.x[lane], frames.t.y[lane], frames.t.z[lane]},
            {frames.q[0][lane], frames.q[1][lane], frames.q[2][lane], frames.q[3][lane]}};
}

Rows<double> configurations(nb::handle q, const char* name, const Chain& chain) {
    Rows<double> rows = rows_of_doubles(q, name, chain.nq(), true);
    for (const ChainJoint& joint : chain.joints()) {
        if (!has_quaternion(joint)) continue;
        const size_t first = joint.coordinate + (joint.kind == JointKind::floating ? 3 : 0);
        for (size_t i = 0; i < rows.count; ++i) {
            const double* const p = &rows.values[i * chain.nq() + first];
            const double most = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2]), std::abs(p[3])});
            if (most > 1e-18 && most < 1e18) continue;
            value_error(std::string(name) + "[" + std::to_string(i) + "]", "has a quaternion of 0 from coordinate " +
                                                                               std::to_string(first) +
                                                                               " on; no rotation is 0 0 0 1");
        }
    }
    return rows;
}

} // namespace prolate::python

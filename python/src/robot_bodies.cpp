#include "python/src/robot_bodies.hpp"

#include "python/src/batch.hpp"

#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/primitives.hpp>
#include <prolate/shapes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::python {
namespace {

double length(const Vec3& v) noexcept {
    return std::hypot(double{v.x}, double{v.y}, double{v.z});
}

// The bodies of trees that are larger than what they were opened from by `radius` all around.
std::unique_ptr<RobotBody> body_of_view(const TreeView& view, double reach) {
    auto out = std::make_unique<RobotBody>();
    out->view = view;
    out->reach = reach;
    out->cells = cells_of(view, thread_context());
    return out;
}

// A point that the link may really meet ends the search. Here and below, the frame, and the first of the search's two
// bodies, are the cloud's.
class NearPoint final : public LeafVisitor {
public:
    NearPoint(const RobotBody& link, const RobotBody& cloud, const PlacedPair& at, float margin, QueryContext& context)
        : link_(link), cloud_(cloud), at_(at), margin_(margin), context_(context) {}
    bool meets(uint32_t a, uint32_t) override {
        const Sphere ball{cloud_.points[cloud_.ids[a]], cloud_.radius};
        return overlap(*link_.view, at_.a, ball, context_, {.margin = margin_}).verdict != Verdict::separated;
    }

private:
    const RobotBody &link_, &cloud_;
    const PlacedPair& at_;
    float margin_;
    QueryContext& context_;
};

// The nearest of the points, as far as cells leave it open.
class NearestPoint final : public LeafVisitor {
public:
    /// The search looks at what is within `margin`, which shrinks as nearer points are found.
    NearestPoint(const RobotBody& link, const RobotBody& cloud, const PlacedPair& at, float& margin,
                 QueryContext& context)
        : link_(link), cloud_(cloud), at_(at), margin_(margin), best_{margin, std::numeric_limits<double>::infinity()},
          context_(context) {}
    bool meets(uint32_t a, uint32_t) override {
        const Vec3& point = cloud_.points[cloud_.ids[a]];
        const SignedDistance found = signed_distance(*link_.view, at_.a, point, context_);
        best_.lower = std::min(best_.lower, std::max(found.lower - cloud_.radius, 0.0));
        best_.upper = std::min(best_.upper, std::max(found.upper - cloud_.radius, 0.0));
        margin_ = std::min(margin_, rounded_up(best_.upper));
        return best_.lower <= 0;
    }
    DistanceRange best() const { return best_; }

private:
    const RobotBody &link_, &cloud_;
    const PlacedPair& at_;
    float& margin_;
    DistanceRange best_;
    QueryContext& context_;
};

} // namespace

std::unique_ptr<RobotBody> body_of_tree(nb::handle tree, const char* name) {
    const HeldTree& held = tree_of(tree, name);
    auto out = body_of_view(held.view, held.reach);
    out->keep = nb::borrow(tree);
    return out;
}

void RobotScene::place(std::unique_ptr<RobotBody> body, nb::handle pose) {
    const Poses poses(pose, "pose", nb::str("xyzw"));
    if (!poses.single()) value_error("pose", "must be one pose");
    body->pose = poses.at(0);
    bodies_.push_back(std::move(body));
}

void RobotScene::add_tree(nb::handle tree, nb::handle pose) {
    place(body_of_tree(tree, "shape"), pose);
}

void RobotScene::add_box(nb::handle half, nb::handle pose) {
    const Rows<double> row = rows_of_doubles(half, "shape.half", 3, true);
    auto out = std::make_unique<RobotBody>();
    std::array<double, 3> sides{};
    for (size_t k = 0; k < 3; ++k) {
        if (!(row.values[k] > 0)) value_error("shape.half", "must be above 0");
        out->half[k] = rounded_up(row.values[k]);
        sides[k] = out->half[k];
    }
    out->kind = RobotBody::Kind::box;
    out->own = value_or_throw(box_tree({out->half[0], out->half[1], out->half[2]}), "shape.half");
    out->view = out->own->view();
    out->cells = cells_of_box(sides);
    out->reach = std::hypot(sides[0], sides[1], sides[2]) * (1 + 1e-12);
    place(std::move(out), pose);
}

void RobotScene::add_capsule(nb::handle a, nb::handle b, nb::handle radius, nb::handle pose) {
    const Rows<double> from = rows_of_doubles(a, "shape.a", 3, true), to = rows_of_doubles(b, "shape.b", 3, true);
    const double wide = number_from_0(radius, "shape.radius");
    const auto end = [](const Rows<double>& row) {
        return Vec3{static_cast<float>(row.values[0]), static_cast<float>(row.values[1]),
                    static_cast<float>(row.values[2])};
    };
    const Vec3 low = end(from), high = end(to);
    // The ends are rounded; the radius makes up for it.
    const double longest = std::max(length(low), length(high)), rounding = 0x1p-23 * longest;
    auto tree = value_or_throw(capsule_tree(low, high, rounded_up(wide + rounding)), "shape");
    auto out = body_of_view(tree.view(), (longest + wide + rounding) * (1 + 1e-6));
    out->own = std::move(tree);
    out->view = out->own->view();
    place(std::move(out), pose);
}

void RobotScene::add_half_space(nb::handle row) {
    const Rows<double> numbers = rows_of_doubles(row, "shape", 4, true);
    auto out = std::make_unique<RobotBody>();
    out->kind = RobotBody::Kind::half_space;
    std::copy(numbers.values.begin(), numbers.values.end(), out->plane.begin());
    bodies_.push_back(std::move(out));
}

void RobotScene::add_points(nb::handle points, nb::handle radius, nb::handle pose) {
    const Rows<double> rows = rows_of_doubles(points, "shape.points", 3, false);
    if (rows.count == 0) return;
    auto out = std::make_unique<RobotBody>();
    out->kind = RobotBody::Kind::points;
    double rounding = 0;
    for (size_t i = 0; i < rows.count; ++i) {
        const double* const p = &rows.values[3 * i];
        out->points.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
        const Vec3& at = out->points.back();
        rounding = std::max(rounding, std::hypot(p[0] - at.x, p[1] - at.y, p[2] - at.z));
        out->reach = std::max(out->reach, length(at));
    }
    out->radius = rounded_up(number_from_0(radius, "shape.radius") + rounding);
    out->reach = (out->reach + out->radius) * (1 + 1e-12);
    out->cells = cells_of_points(out->points, out->radius, out->ids);
    place(std::move(out), pose);
}

PlacedPair placed_pair(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b,
                       const DoublePose& pose_b) noexcept {
    PlacedPair out{};
    out.in_b = b.kind == RobotBody::Kind::points || b.reach > a.reach;
    const RoundedPose smaller =
        out.in_b ? in_frame(Frame(pose_b), pose_a, a.reach) : in_frame(Frame(pose_a), pose_b, b.reach);
    (out.in_b ? out.a : out.b) = smaller.pose;
    out.slack = smaller.slack;
    out.smaller = float_place(smaller.pose);
    return out;
}

bool may_touch(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b, const DoublePose& pose_b,
               double margin, QueryContext& context) noexcept {
    if (b.kind == RobotBody::Kind::half_space) {
        double slack = 0;
        const HalfSpace ground = half_space_in_frame(a.reach, pose_a, b.plane, slack);
        return overlap(*a.view, {}, ground, context, {.margin = rounded_up(margin + slack)}).verdict !=
               Verdict::separated;
    }
    const PlacedPair at = placed_pair(a, pose_a, b, pose_b);
    const float wide = rounded_up(margin + at.slack);
    const Cells &larger = at.in_b ? b.cells : a.cells, &smaller = at.in_b ? a.cells : b.cells;
    if (b.kind == RobotBody::Kind::points) {
        NearPoint near(a, b, at, wide, context);
        return cells_meet(larger, smaller, at.smaller, wide, &near);
    }
    if (!cells_meet(larger, smaller, at.smaller, wide)) return false;
    const QueryOptions options{.margin = wide};
    if (b.kind == RobotBody::Kind::tree)
        return inner_meets_inner(larger, smaller, at.smaller) ||
               collide(*a.view, at.a, *b.view, at.b, context, options).verdict != Verdict::separated;
    if (inner_meets_box(a.cells, b.half, at.in_b ? inverse(at.smaller) : at.smaller)) return true;
    return overlap(*a.view, at.a, Box{at.b, {b.half[0], b.half[1], b.half[2]}}, context, options).verdict !=
           Verdict::separated;
}

DistanceRange distance_of(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b, const DoublePose& pose_b,
                          double most, double tolerance, QueryContext& context) noexcept {
    const auto widened = [](double lower, double upper, double slack) {
        return DistanceRange{std::max(lower - slack, 0.0), upper + slack};
    };
    double slack = 0;
    DistanceOptions options;
    options.tolerance_relative = tolerance;
    if (b.kind == RobotBody::Kind::half_space) {
        const HalfSpace ground = half_space_in_frame(a.reach, pose_a, b.plane, slack);
        options.max_distance = most + slack;
        const DistanceResult found = distance(*a.view, {}, ground, context, options);
        return widened(found.lower, found.upper, slack);
    }
    const PlacedPair at = placed_pair(a, pose_a, b, pose_b);
    options.max_distance = most + at.slack;
    if (std::isfinite(most) || b.kind == RobotBody::Kind::points) {
        const Cells &larger = at.in_b ? b.cells : a.cells, &smaller = at.in_b ? a.cells : b.cells;
        float wide = rounded_up(options.max_distance);
        if (b.kind == RobotBody::Kind::points) {
            NearestPoint nearest(a, b, at, wide, context);
            const bool ended = cells_meet(larger, smaller, at.smaller, wide, &nearest);
            return widened(ended ? 0 : nearest.best().lower, nearest.best().upper, at.slack);
        }
        if (!cells_meet(larger, smaller, at.smaller, wide)) return {most, std::numeric_limits<double>::infinity()};
    }
    const DistanceResult found = distance(*a.view, at.a, *b.view, at.b, context, options);
    return widened(found.lower, found.upper, at.slack);
}

} // namespace prolate::python

// How long do two moving leaves keep apart? In double precision.
//
// Along a fixed direction n the gap of two convex pieces, seen t from now, is at least
//     G(t) = n.(c_b - c_a) + t n.(v_b - v_a) - h_a(n + t m_a) - h_b(-n - t m_b) - curve t^2 / 2 - rounding,
// h their supports about the points turned about, m = n x w and `curve` as in lanes-inl.hpp: a piece's points
// move by their present velocity, up to a second order that is bounded. Supports are convex, so G is concave: where
// G(t) >= 0 it was so all the time before, and where a chord of it is. This takes all corners of a triangle by their
// own speeds, so that a corner at rest does not stop what others do (a box that tips over an edge), where one bound for
// the whole piece would.
//
// n is the direction along which the pieces' distance is certified from below; an inexact one costs steps only.
#include "query/ellipsoid/gap.hpp"
#include "query/sweep/search.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

// The least tolerance. A step that begins while upper > reached gains if the gap along n exceeds the target by more
// than its own rounding: the gap is `lower`, reached - target half of the tolerance, so it does if that is above upper
// - lower and the rounding. With S all lengths that enter, pieces whose edges are nearly parallel (slivers, and boxes
// side by side) have upper - lower of up to sqrt(u) S / 4, u = 2^-53, 2.6e-9 S: closest points of two edges are found
// by a quotient of a / sin^2 of their angle, whose error u S / sin^2 moves them along the edges by that much, and apart
// by sin of the angle times as much, or the whole edge's: worst where sin^2 = u. (The tests find at most
// 2e-9 S for triangles, and 1e-9 of their sizes for ellipsoids.) So 2^-27 S is enough, 7.5e-9 S; taken as 2^-24 of both
// sizes for pieces near their bodies' origins, and 2^-27 of the lengths for those that are not. Motion that turns far
// rounds more (motion.hpp).
constexpr double kLeastOfSizes = 0x1p-24, kLeastOfLengths = 0x1p-27, kLeastOfTurns = 0x1p-38;
constexpr double kRoundDown = 1 - 0x1p-40; // of times: far above what rounds in them
constexpr double kGoodEnough = 0.01;       // what of a gap need not be used up
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A piece with its levers from the point turned about.
struct TrianglePiece {
    PlacedTriangle placed;
    dvec3 corner[3];
    double lever;

    TrianglePiece() = default;
    TrianglePiece(const PlacedTriangle& triangle, const dvec3& center) : placed(triangle), lever(0) {
        for (size_t i = 0; i < 3; ++i) {
            corner[i] = placed.corner[i] - center;
            lever = std::max(lever, glm::length(corner[i]));
        }
    }
    double support(const dvec3& n) const {
        return std::max({glm::dot(n, corner[0]), glm::dot(n, corner[1]), glm::dot(n, corner[2])});
    }
};
struct EllipsoidPiece {
    PlacedEllipsoid placed;
    dvec3 center;
    double lever;

    EllipsoidPiece(const PlacedEllipsoid& ellipsoid, const dvec3& turned_about)
        : placed(ellipsoid), center(ellipsoid.center - turned_about), lever(glm::length(center) + ellipsoid.size) {}
    double support(const dvec3& n) const { return glm::dot(n, center) + glm::length(n * placed.factor); }
};

// What the queries of two pieces say: no farther apart than `upper`, at these points, along this direction.
struct Nearest {
    double upper;
    bool meet;
    dvec3 on_a, on_b, n;
};
Nearest nearest(const TriangleDistance& d, bool meet) {
    const dvec3 n = d.lower > 0 ? d.normal : d.on_b - d.on_a;
    const double length = glm::length(n);
    return {d.upper, meet, d.on_a, d.on_b, length > 0 ? n / length : dvec3(0)};
}
Nearest nearest(const TrianglePiece& x, const TrianglePiece& y, const dvec3&, double) {
    const TriangleDistance d = distance(x.placed, y.placed);
    return nearest(d, !(d.lower > 0));
}
Nearest nearest(const TrianglePiece& x, const EllipsoidPiece& y, const dvec3&, double) {
    const TriangleDistance d = distance(x.placed, y.placed);
    return nearest(d, !separated(x.placed, y.placed));
}
Nearest nearest(const EllipsoidPiece& x, const TrianglePiece& y, const dvec3& n, double tolerance) {
    Nearest out = nearest(y, x, n, tolerance);
    std::swap(out.on_a, out.on_b), out.n = -out.n;
    return out;
}
Nearest nearest(const EllipsoidPiece& x, const EllipsoidPiece& y, const dvec3& n, double tolerance) {
    const Gap gap = distance_of(x.placed, y.placed, tolerance, n);
    return {std::max(gap.upper, 0.0), !separated(x.placed, y.placed), gap.point_a, gap.point_b, gap.normal};
}

void store(const dvec3& v, float (&out)[3]) {
    for (size_t i = 0; i < 3; ++i) out[i] = static_cast<float>(v[static_cast<glm::length_t>(i)]);
}
dvec3 on_lattice(const dvec3& metres, const LatticeInfo& lattice) {
    const double per_step = steps_per_metre(lattice);
    return metres * per_step - dvec3(lattice.origin[0], lattice.origin[1], lattice.origin[2]);
}
float length_up(const dvec3& v) {
    return static_cast<float>(glm::length(v) * (1 + 0x1p-20));
}

SweepOptions sound(SweepOptions options) {
    options.margin = sound_length(options.margin), options.tolerance = sound_tolerance(options.tolerance);
    return options;
}

// All in X's frame, metres.
MotionFrame frame(const LatticePose& y_to_x, const LatticeInfo& lattice, const dvec3& velocity, const dvec3& spin_x,
                  const dvec3& spin_y, const dvec3& center_x, const dvec3& center_y) {
    MotionFrame out{};
    out.y_to_x = y_to_x;
    const dvec3 in_steps = velocity * steps_per_metre(lattice), center = on_lattice(center_y, lattice);
    store(in_steps, out.velocity), store(spin_x, out.spin_x), store(spin_y, out.spin_y);
    store(on_lattice(center_x, lattice), out.center_x);
    out.speed = length_up(in_steps), out.spin_x_length = length_up(spin_x), out.spin_y_length = length_up(spin_y);
    for (size_t i = 0; i < 3; ++i) out.center_y[i] = center[static_cast<glm::length_t>(i)];
    return out;
}

} // namespace

SweepSearch::SweepSearch(const OrderedBodies<Motion>& bodies, Scratch context,
                         const SweepOptions& sweep_options) noexcept
    : a(tree_side(bodies.a, sweep_options.max_level)), b(tree_side(bodies.b, sweep_options.max_level)),
      motion(bodies.place_a, bodies.place_b), options(sound(sweep_options)), entries(context.entries()),
      room(heap_room(context, a.tree, b.tree)) {
    move_to(0);
    const PlacedEllipsoid x = place(a.tree.root(), a.tree.scale()),
                          y = place(b.tree.root(), b.tree.scale(), now.b_to_a);
    const double asked = options.tolerance > 0 ? options.tolerance : kSweepTolerance * std::min(x.size, y.size);
    const double turned = motion.a().speed() + motion.b().speed();
    const double tolerance = std::max({asked, kLeastOfSizes * (x.size + y.size),
                                       std::max(kLeastOfLengths, kLeastOfTurns * (1 + turned)) * (x.reach + y.reach)});
    target = options.margin + tolerance / 2, reached = options.margin + tolerance;
}

void SweepSearch::move_to(double t) noexcept {
    if (t == time) return;
    time = t;
    now = motion.at(t);
    const RelativePose a_to_b = inverse(now.b_to_a);
    frame_a = frame(lattice_pose(now.b_to_a, b.lattice, a.lattice), a.lattice, now.velocity, motion.a().spin(),
                    now.spin_b, motion.a().center(), now.center_b);
    frame_b = frame(lattice_pose(a_to_b, a.lattice, b.lattice), b.lattice, a_to_b.rotation * -now.velocity,
                    motion.b().spin(), a_to_b.rotation * motion.a().spin(), motion.b().center(),
                    a_to_b.rotation * motion.a().center() + a_to_b.translation);
}

double closing_time(double gap, double rate, double curve, double most_rate) noexcept {
    // gap = rate t + curve t^2 / 2, solved without cancellation for either sign of the rate.
    const double root = std::sqrt(rate * rate + 2 * curve * gap);
    const double bent = rate > 0 ? 2 * gap / (rate + root) : curve > 0 ? (root - rate) / curve : kInfinity;
    const double straight = most_rate > 0 ? gap / most_rate : kInfinity;
    const double least = std::max(bent, straight) * kRoundDown;
    return least > 0 ? least : 0; // a NaN, too
}

// Time from now, at most `limit`, in which the gap along n stays above the target.
template <class X, class Y>
double SweepSearch::safe_time(const X& x, const Y& y, const dvec3& n, double limit) const noexcept {
    const double speed_a = motion.a().speed(), speed_b = motion.b().speed();
    const dvec3 ma = glm::cross(n, motion.a().spin()), mb = glm::cross(n, now.spin_b);
    const double turn_a = glm::length(ma) * x.lever, turn_b = glm::length(mb) * y.lever;
    const double margin = kSeparationMargin + now.slack;
    const double drift = margin * (glm::length(now.velocity) + speed_a * x.lever + speed_b * y.lever);
    const double curve = (turn_a * speed_a + turn_b * speed_b) / kRoundDown;
    const double away = glm::dot(n, now.velocity) - drift;
    const double start =
        glm::dot(n, now.center_b - motion.a().center()) - target - margin * (x.placed.reach + y.placed.reach);
    const auto gap = [&](double t) {
        return start + t * (away - 0.5 * curve * t) - x.support(n + t * ma) - y.support(-n - t * mb);
    };
    const double first = gap(0);
    if (!(first > 0)) return 0;
    // A bracket: G is positive at `low` and negative at `high`. The chord gives a better `low`, the middle either.
    double low = 0, high = limit, at_low = first, at_high = gap(limit);
    if (at_high >= 0) return limit;
    constexpr int kSteps = 6;
    for (int i = 0; i < kSteps; ++i) {
        low += (high - low) * (at_low / (at_low - at_high)) * kRoundDown;
        at_low = gap(low);
        if (!(at_low > kGoodEnough * first)) break;
        const double middle = 0.5 * (low + high), there = gap(middle);
        (there >= 0 ? low : high) = middle;
        (there >= 0 ? at_low : at_high) = there;
    }
    return std::min(std::max(low, closing_time(first, kInfinity, 0, (turn_a + turn_b) / kRoundDown - away)), limit);
}

// False if the pieces meet now. Else `least` is no longer than they keep apart, and n a direction that says so if it
// was shortened.
template <class X, class Y>
bool SweepSearch::advance_pair(const X& x, const Y& y, const MeetingPair& pair, dvec3& n, double& least) noexcept {
    if (n != dvec3(0) && safe_time(x, y, n, least) >= least) return true;
    const Nearest d = nearest(x, y, n, 0.25 * (reached - target));
    double t = d.meet || d.upper <= reached ? 0 : overshoot * safe_time(x, y, d.n, least);
    if (t >= least) return true;
    if (t <= kLeastStep * time) t = 0; // where rounding permits no step, they meet as far as it can tell
    n = d.n, least = t;
    if (t > 0) return true;
    found = true, horizon = time, witness = pair, distance = d.meet ? 0 : d.upper;
    on_a = d.on_a, on_b = d.on_b, normal = d.n;
    return false;
}

uint64_t SweepSearch::triangle_tests(uint32_t node_a, uint32_t node_b, bool as_covers) const noexcept {
    const uint32_t in_a = as_covers ? 0 : a.tree.triangles(node_a).count;
    const uint32_t in_b = as_covers ? 0 : b.tree.triangles(node_b).count;
    return in_a + in_b == 0 ? 0 : uint64_t{std::max(in_a, 1u)} * std::max(in_b, 1u);
}

double SweepSearch::advance(uint32_t node_a, uint32_t node_b, bool as_covers) noexcept {
    const TriangleRange in_a = as_covers ? TriangleRange{} : a.tree.triangles(node_a),
                        in_b = as_covers ? TriangleRange{} : b.tree.triangles(node_b);
    const dvec3 center_a = motion.a().center(), center_b = now.center_b;
    const auto ellipsoid_a = [&] { return EllipsoidPiece(place(a.tree.bound(node_a), a.tree.scale()), center_a); };
    const auto ellipsoid_b = [&] {
        return EllipsoidPiece(place(b.tree.bound(node_b), b.tree.scale(), now.b_to_a), center_b);
    };
    double least = horizon - time;
    dvec3 n(0);
    if (in_a.count == 0 && in_b.count == 0) {
        advance_pair(ellipsoid_a(), ellipsoid_b(), {node_a, node_b, kNoTriangle, kNoTriangle}, n, least);
        return time + least;
    }
    TrianglePiece of_a[kMaxLeafTriangles];
    for (uint32_t i = 0; i < in_a.count; ++i) of_a[i] = TrianglePiece(place(a.tree, in_a.first + i), center_a);
    if (in_b.count == 0) {
        const EllipsoidPiece y = ellipsoid_b();
        stats.triangle_tests += in_a.count;
        for (uint32_t i = 0; i < in_a.count; ++i)
            if (!advance_pair(of_a[i], y, {node_a, node_b, in_a.first + i, kNoTriangle}, n, least)) break;
        return time + least;
    }
    const auto x = in_a.count == 0 ? std::optional(ellipsoid_a()) : std::nullopt;
    for (uint32_t j = 0; j < in_b.count; ++j) {
        const uint32_t t = in_b.first + j;
        const TrianglePiece y(place(b.tree, t, now.b_to_a), center_b);
        stats.triangle_tests += std::max(in_a.count, 1u);
        if (x && !advance_pair(*x, y, {node_a, node_b, kNoTriangle, t}, n, least)) break;
        for (uint32_t i = 0; i < in_a.count; ++i)
            if (!advance_pair(of_a[i], y, {node_a, node_b, in_a.first + i, t}, n, least)) return time + least;
    }
    return time + least;
}

} // namespace prolate::query

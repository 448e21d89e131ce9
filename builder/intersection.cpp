#include "builder/intersection.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>

namespace prolate {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kDirections = 16;      // tried for d of (2)
constexpr double kClearance = 1e-3;  // of d from all arcs: that of the first try; halved from try to try
constexpr double kNeedle = 1e-12;    // a triangle's smallest sine, below which it counts as a segment
constexpr double kLongestArc = 2;    // radians; longer ones are cut, lest the chord of one be near a diameter
constexpr double kBeyond = 1 + 1e-9; // squared distance beyond which a plane does not touch the ball, nor an edge in it
constexpr size_t kNoEdge = 3;

// std::atan2 to the last digit or two; several times as fast for the small angles that most arcs have.
double angle_of(double y, double x) {
    if (!(std::abs(y) < 0.125 * x)) return std::atan2(y, x);
    const double t = y / x, s = t * t, ss = s * s;
    return t * ((1 - 1.0 / 3 * s) +
                ss * ((1.0 / 5 - 1.0 / 7 * s) + ss * ((1.0 / 9 - 1.0 / 11 * s) + ss * (1.0 / 13 - 1.0 / 15 * s))));
}

// A corner of a triangle in unit-ball coordinates.
struct Corner {
    Vec y;
    double square;
    explicit Corner(const Vec& at) : y(at), square(at.squaredNorm()) {}
    bool inside() const { return square <= 1; }
};

// Clips the edge p -> q, at least one end of which is outside, to the ball: false if nothing is left. Both triangles at
// an edge get the very same points, because the corner nearer to the origin goes first: also near a tangent, where the
// points are uncertain by 1e-8, the triangles' arcs join.
bool clip(const Corner& p, const Corner& q, Vec& start, Vec& end) {
    const auto position = [](const Corner& c) { return std::tie(c.y.x(), c.y.y(), c.y.z()); };
    const bool swap = q.square != p.square ? q.square < p.square : position(q) < position(p);
    const Corner &near = swap ? q : p, &far = swap ? p : q;
    const Vec edge = far.y - near.y;
    const double along = near.y.dot(edge);
    if (!near.inside() && along >= 0) return false;
    // |near + t edge| = 1 at t = (-along -+ root) / length, root^2 = length - |near x edge|^2 (Lagrange's identity).
    const double length = edge.squaredNorm(), root_square = length - near.y.cross(edge).squaredNorm();
    if (!near.inside() && root_square <= 0) return false;
    const double root = std::sqrt(std::max(root_square, 0.0));
    const auto at = [&](double numerator) { return Vec(near.y + std::clamp(numerator / length, 0.0, 1.0) * edge); };
    Vec &first = swap ? end : start, &last = swap ? start : end;
    first = near.inside() ? near.y : at(-along - root);
    last = at(-along + root);
    return true;
}

// The disc in which a triangle's plane cuts the ball.
struct Disc {
    Vec normal;            // unit
    double height, square; // of the plane above the origin; squared radius
    Vec foot;              // center: the foot of the origin

    Disc(const Vec& n, double h) : normal(n), height(h), square(std::max(0.0, (1 - h) * (1 + h))), foot(h * n) {}

    // Angle about the foot from p to q, both in the plane, in [-pi, pi].
    double turn(const Vec& p, const Vec& q) const { return angle_of(normal.dot(p.cross(q)), (p - foot).dot(q - foot)); }
};

// The sums of (1), (2) and (3) over triangles in unit-ball coordinates.
class BallSums {
public:
    Vec area = Vec::Zero();   // sum of A n_t
    Mat moment = Mat::Zero(); // sum of (integral of y) n_t^T; its trace is the sum of h A
    double swept = 0;         // sum of I_d
    bool too_near = false;    // an arc comes so near to d that `swept` is not to be trusted

    BallSums(const Vec& d, double clearance) : d_(d), clearance_(clearance) {}

    void add(const Corner& a, const Corner& b, const Corner& c) {
        if (b.square < a.square || c.square < a.square) // the nearest corner first
            return c.square < b.square ? add_sorted(c, a, b) : add_sorted(b, c, a);
        add_sorted(a, b, c);
    }

private:
    using Corners = std::array<const Corner*, 3>;

    void add_sorted(const Corner& a, const Corner& b, const Corner& c) {
        if (!a.inside()) { // perhaps all is beyond the plane that touches the ball below a
            const double ab = a.y.dot(b.y), ac = a.y.dot(c.y), beyond = kBeyond * a.square;
            if (ab > 0 && ac > 0 && ab * ab > beyond && ac * ac > beyond) return;
        }
        const Vec ab = b.y - a.y, ac = c.y - a.y, normal = ab.cross(ac);
        if (a.inside() && b.inside() && c.inside()) {
            const Vec part = 0.5 * normal;
            area += part;
            moment += (a.y + (ab + ac) / 3) * part.transpose();
            return;
        }
        const double square = normal.squaredNorm(), height = normal.dot(a.y);
        if (!a.inside() && height * height > kBeyond * square) return;
        // The normal of a needle is lost in rounding; but then its sides leave the ball in the same point.
        if (square <= kNeedle * kNeedle * ab.squaredNorm() * ac.squaredNorm()) return;
        const double length = std::sqrt(square);
        add_cut({&a, &b, &c}, Disc(normal / length, height / length));
    }

    // Walks around (triangle ∩ disc): an inside piece p -> q adds the triangle (foot, p, q), an arc the sector over it.
    void add_cut(const Corners& corners, const Disc& disc) {
        double twice_area = 0;
        Vec chords = Vec::Zero(), about_foot = Vec::Zero(); // sum of q - p over the pieces; first moment
        Vec p, q, entry, exit;
        size_t entry_edge = kNoEdge, exit_edge = kNoEdge; // of an entry without its exit, of an exit without its entry
        bool whole = true;                                // nothing of the boundary is in the ball
        for (size_t i = 0; i < 3; ++i) {
            const Corner &from = *corners[i], &to = *corners[(i + 1) % 3];
            if (from.inside() && to.inside())
                p = from.y, q = to.y;
            else if (!clip(from, to, p, q))
                continue;
            whole = false;
            const double triangle = disc.normal.dot(p.cross(q));
            twice_area += triangle;
            chords += q - p;
            about_foot += triangle / 6 * (p + q - 2 * disc.foot);
            if (!from.inside()) {
                if (exit_edge == kNoEdge)
                    entry = p, entry_edge = i;
                else
                    twice_area += disc.square * add_arc(disc, corners, exit, exit_edge, p, i);
            }
            exit_edge = to.inside() ? kNoEdge : i;
            exit = q;
        }
        if (exit_edge != kNoEdge)
            twice_area += disc.square * add_arc(disc, corners, exit, exit_edge, entry, entry_edge + 3);
        if (whole) { // then the disc is in the triangle, or it misses it
            for (size_t i = 0; i < 3; ++i)
                if (!(disc.normal.dot(corners[i]->y.cross(corners[(i + 1) % 3]->y)) > 0)) return;
            const Vec rim = disc.foot + std::sqrt(disc.square) * disc.normal.unitOrthogonal();
            sweep(disc, rim, rim, 2 * kPi);
            twice_area = 2 * kPi * disc.square;
        }
        // A sector from p to q has the moment square / 3 (q - p) x normal. As the boundary is closed, the sum over the
        // arcs is minus that over the pieces.
        about_foot -= disc.square / 3 * chords.cross(disc.normal);
        const Vec part = 0.5 * twice_area * disc.normal;
        area += part;
        moment += disc.foot * part.transpose() + about_foot * disc.normal.transpose();
    }

    // Adds the arc p -> q, counter-clockwise, from edge `first` to edge `last`; its angle, 0 ... 2 pi.
    double add_arc(const Disc& disc, const Corners& corners, const Vec& p, size_t first, const Vec& q, size_t last) {
        double angle = disc.turn(p, q);
        if (angle <
            1e-6) { // or 2 pi more? The way by the corners turns as much, never nearer to the foot than the arc.
            angle = disc.turn(p, corners[(first + 1) % 3]->y) + disc.turn(corners[last % 3]->y, q);
            for (size_t i = first + 1; i < last; ++i) angle += disc.turn(corners[i % 3]->y, corners[(i + 1) % 3]->y);
            angle = std::max(angle, 0.0);
        }
        sweep(disc, p, q, angle);
        return angle;
    }

    void sweep(const Disc& disc, const Vec& p, const Vec& q, double angle) {
        if (angle <= kLongestArc) return sweep_short(disc, p, q, angle);
        const double parts = std::ceil(angle / kLongestArc);
        const Vec x = p - disc.foot, y = disc.normal.cross(x);
        Vec from = p;
        for (double i = 1; i < parts; ++i) {
            const double at = angle * i / parts;
            const Vec to = disc.foot + std::cos(at) * x + std::sin(at) * y;
            sweep_short(disc, from, to, angle / parts);
            from = to;
        }
        sweep_short(disc, from, q, angle / parts);
    }

    // Adds the area that the short arc p -> q sweeps as seen from -d: that of the spherical triangle (-d, p, q), and of
    // the segment between the arc and its chord, the great circle through p and q.
    void sweep_short(const Disc& disc, const Vec& p, const Vec& q, double angle) {
        // tan(triangle / 2) = -d.(p x q) / (1 - d.p + p.q - q.d) (Van Oosterom and Strackee 1983), in differences.
        const Vec u = p - d_, v = q - d_;
        const double side = d_.dot(u.cross(v)) + 0.0, facing = u.dot(v); // + 0.0: no negative zero
        const double above = disc.normal.dot(d_) - disc.height;
        const double reach = 0.5 * angle * std::sqrt(disc.square) + clearance_;
        if (std::min(u.squaredNorm(), v.squaredNorm()) < reach * reach && std::abs(above) < clearance_) too_near = true;
        const double triangle = -2 * angle_of(side, facing);
        // The sector of the cap that the arc belongs to, less the spherical triangle of the cap's pole, p and q.
        const double rim = 1 + std::abs(disc.height);
        double segment = angle * disc.square / rim -
                         2 * angle_of(disc.normal.dot(p.cross(q)), rim * rim + (p - disc.foot).dot(q - disc.foot));
        const bool left = disc.height >= 0; // the segment is to the left of the chord: on the normal's side
        const bool holds_d = facing < 0 && (left ? above > 0 && side < 0 : above < 0 && side > 0);
        if (holds_d) segment -= 4 * kPi;
        swept += triangle + (left ? segment : -segment);
    }

    Vec d_;
    double clearance_;
};

} // namespace

EllipsoidVolume inside_volume(const Fit& ellipsoid, const Winding& winding) {
    const Mat &factor = ellipsoid.factor, &inverse = ellipsoid.inverse;
    for (int attempt = 0;; ++attempt) {
        const Vec d = sketch_directions()[static_cast<size_t>(attempt)];
        BallSums cut(d, std::ldexp(kClearance, -attempt));
        Vec area = Vec::Zero();   // sum of A n_t over nodes that are inside, in the mesh's coordinates
        Mat moment = Mat::Zero(); // sum of (integral of x - center) n_t^T over them
        winding.tree().visit(
            ellipsoid,
            [&](uint32_t node) {
                const Winding::Moments& sum = winding.moments()[node];
                area += sum.dipole;
                moment += (sum.center - ellipsoid.center) * sum.dipole.transpose() + sum.moment.transpose();
            },
            [&](const TriangleTree::Corners& corners) {
                const auto [a, b, c] = corners;
                cut.add(Corner(ellipsoid.radial(to_vec(a))), Corner(ellipsoid.radial(to_vec(b))),
                        Corner(ellipsoid.radial(to_vec(c))));
            });
        const bool last = attempt + 1 == kDirections;
        if (cut.too_near && !last) continue;
        const Vec at = ellipsoid.center + factor * d;
        const std::optional<double> number = winding.whole(at);
        if (!number && !last) continue;

        const double scale = factor(0, 0) * factor(1, 1) * factor(2, 2);
        const double sphere = 4 * kPi * number.value_or(std::round(winding(at))) - cut.swept;
        EllipsoidVolume out;
        out.volume = (scale * (sphere + cut.moment.trace()) + moment.trace()) / 3;
        out.d_center = -scale * cut.area - factor.transpose() * area;
        const Mat skew = scale * cut.moment + inverse * moment * factor;
        out.d_shape = out.volume * Mat::Identity() - 0.5 * (skew + skew.transpose());
        return out;
    }
}

EllipsoidVolume outside_volume(const Fit& ellipsoid, const EllipsoidVolume& inside) {
    const double whole = ellipsoid.volume();
    return {whole - inside.volume, -inside.d_center, whole * Mat::Identity() - inside.d_shape};
}

} // namespace prolate

#include "bench/peers/reference.hpp"

#include "tests/scenes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::bench::peers {
namespace {

using Point = Reference::Point;
using Corners = std::array<Point, 3>;

constexpr uint32_t kLeafTriangles = 4;
constexpr double kMeeting = 1e-14;

Point operator-(const Point& a, const Point& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Point along(const Point& a, const Point& d, double t) {
    return {a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]};
}
double dot(const Point& a, const Point& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Point cross(const Point& a, const Point& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double squared(const Point& a) {
    return dot(a, a);
}

double segments(const Point& p, const Point& q, const Point& r, const Point& s) { // squared distance of pq and rs
    const Point d = q - p, e = s - r, w = p - r;
    const double a = dot(d, d), b = dot(d, e), c = dot(e, e), f = dot(e, w), g = dot(d, w);
    const double determinant = a * c - b * b;
    double x = determinant > 0 ? std::clamp((b * f - c * g) / determinant, 0.0, 1.0) : 0;
    double y = c > 0 ? (b * x + f) / c : 0;
    if (y < 0 || y > 1) {
        y = std::clamp(y, 0.0, 1.0);
        x = a > 0 ? std::clamp((b * y - g) / a, 0.0, 1.0) : 0;
    }
    return squared(along(p, d, x) - along(r, e, y));
}

// Squared distance of a point to the inside of a triangle; infinite if its foot lies outside, where edges are nearer.
double to_inside(const Point& p, const Corners& t) {
    const Point n = cross(t[1] - t[0], t[2] - t[0]);
    for (size_t i = 0; i < 3; ++i)
        if (dot(cross(t[(i + 1) % 3] - t[i], p - t[i]), n) < 0) return INFINITY;
    const double height = dot(p - t[0], n);
    return height * height / squared(n);
}

bool passes_through(const Point& p, const Point& q, const Corners& t) {
    const Point n = cross(t[1] - t[0], t[2] - t[0]);
    if (dot(p - t[0], n) * dot(q - t[0], n) > 0) return false;
    double sign[3];
    for (size_t i = 0; i < 3; ++i) sign[i] = dot(cross(t[i] - p, t[(i + 1) % 3] - p), q - p);
    return (sign[0] > 0 && sign[1] > 0 && sign[2] > 0) || (sign[0] < 0 && sign[1] < 0 && sign[2] < 0);
}

double triangles(const Corners& a, const Corners& b) { // squared distance
    double best = INFINITY;
    for (size_t i = 0; i < 3; ++i) {
        if (passes_through(a[i], a[(i + 1) % 3], b) || passes_through(b[i], b[(i + 1) % 3], a)) return 0;
        best = std::min({best, to_inside(a[i], b), to_inside(b[i], a)});
        for (size_t j = 0; j < 3; ++j) best = std::min(best, segments(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]));
    }
    return best;
}

// Both bodies as seen from A.
class Pairing {
public:
    Pairing(const Reference& a, const Reference& b, const Placement& at) : a_(a), b_(b) {
        const auto ra = scenes::rotation_rows(at.a.rotation), rb = scenes::rotation_rows(at.b.rotation);
        const auto& ta = at.a.translation;
        const auto& tb = at.b.translation;
        const Point d{double{tb.x} - ta.x, double{tb.y} - ta.y, double{tb.z} - ta.z};
        for (size_t i = 0; i < 3; ++i)
            for (size_t k = 0; k < 3; ++k) {
                t_[i] += ra[k][i] * d[k];
                for (size_t j = 0; j < 3; ++j) r_[i][j] += ra[k][i] * rb[k][j];
            }
    }

    // Smallest squared distance, or anything not above `enough` as soon as it is found.
    double search(double enough) {
        best_ = INFINITY, enough_ = enough;
        visit(0, 0);
        return best_;
    }
    bool any_within(double reach) {
        best_ = reach * reach, enough_ = best_;
        visit(0, 0);
        return found_;
    }

private:
    Point place(const Point& p) const { return {dot(r_[0], p) + t_[0], dot(r_[1], p) + t_[1], dot(r_[2], p) + t_[2]}; }
    // Squared lower bound: the largest gap along the axes of either box.
    double bound(const Reference::Node& m, const Reference::Node& n) const {
        const Point d = place(n.middle) - m.middle;
        double gap = 0;
        for (size_t i = 0; i < 3; ++i) {
            const double of_b =
                std::abs(r_[i][0]) * n.half[0] + std::abs(r_[i][1]) * n.half[1] + std::abs(r_[i][2]) * n.half[2];
            gap = std::max(gap, std::abs(d[i]) - m.half[i] - of_b);
        }
        for (size_t j = 0; j < 3; ++j) {
            double of_a = 0, at = 0;
            for (size_t i = 0; i < 3; ++i) of_a += std::abs(r_[i][j]) * m.half[i], at += r_[i][j] * d[i];
            gap = std::max(gap, std::abs(at) - n.half[j] - of_a);
        }
        gap = std::max(0.0, gap - 1e-14); // rounding must not hide a contact
        return gap * gap;
    }
    bool done() const { return found_ && best_ <= enough_; }
    void visit(uint32_t i, uint32_t j) {
        const Reference::Node &m = a_.nodes()[i], &n = b_.nodes()[j];
        if (m.count > 0 && n.count > 0) {
            for (uint32_t v = n.first; v < n.first + n.count; ++v) {
                Corners b = b_.triangle(v);
                for (Point& p : b) p = place(p);
                for (uint32_t u = m.first; u < m.first + m.count; ++u) {
                    const double now = triangles(a_.triangle(u), b);
                    if (now <= best_) best_ = now, found_ = true;
                    if (done()) return;
                }
            }
            return;
        }
        const bool split_a = n.count > 0 || (m.count == 0 && squared(m.half) >= squared(n.half));
        uint32_t next[2][2] = {{split_a ? m.first : i, split_a ? j : n.first},
                               {split_a ? m.first + 1 : i, split_a ? j : n.first + 1}};
        double bounds[2];
        for (size_t k = 0; k < 2; ++k) bounds[k] = bound(a_.nodes()[next[k][0]], b_.nodes()[next[k][1]]);
        if (bounds[1] < bounds[0]) std::swap(bounds[0], bounds[1]), std::swap(next[0], next[1]);
        for (size_t k = 0; k < 2 && !done(); ++k)
            if (bounds[k] <= best_) visit(next[k][0], next[k][1]);
    }

    const Reference &a_, &b_;
    std::array<Point, 3> r_{};
    Point t_{};
    double best_ = 0, enough_ = 0;
    bool found_ = false;
};

} // namespace

Reference::Reference(MeshView mesh) {
    const auto at = [&](uint32_t v) { return Point{mesh.vertices[v].x, mesh.vertices[v].y, mesh.vertices[v].z}; };
    for (const Triangle& t : mesh.triangles) triangles_.push_back({at(t[0]), at(t[1]), at(t[2])});
    nodes_.emplace_back();
    split(0, 0, static_cast<uint32_t>(triangles_.size()));
}

void Reference::split(uint32_t node, uint32_t begin, uint32_t end) {
    Point low, high;
    low.fill(INFINITY), high.fill(-INFINITY);
    for (uint32_t t = begin; t < end; ++t)
        for (const Point& p : triangles_[t])
            for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    size_t axis = 0;
    for (size_t i = 0; i < 3; ++i) {
        nodes_[node].middle[i] = (low[i] + high[i]) / 2, nodes_[node].half[i] = (high[i] - low[i]) / 2;
        if (high[i] - low[i] > high[axis] - low[axis]) axis = i;
    }
    if (end - begin <= kLeafTriangles) {
        nodes_[node].first = begin, nodes_[node].count = end - begin;
        return;
    }
    const uint32_t middle = begin + (end - begin) / 2;
    const auto key = [axis](const Corners& t) { return t[0][axis] + t[1][axis] + t[2][axis]; };
    std::nth_element(triangles_.begin() + begin, triangles_.begin() + middle, triangles_.begin() + end,
                     [&](const Corners& s, const Corners& t) { return key(s) < key(t); });
    const auto children = static_cast<uint32_t>(nodes_.size());
    nodes_[node].first = children, nodes_[node].count = 0;
    nodes_.resize(nodes_.size() + 2);
    split(children, begin, middle);
    split(children + 1, middle, end);
}

bool meet(const Reference& a, const Reference& b, const Placement& at) {
    return Pairing(a, b, at).any_within(kMeeting);
}

double distance(const Reference& a, const Reference& b, const Placement& at) {
    return std::sqrt(Pairing(a, b, at).search(0));
}

} // namespace prolate::bench::peers

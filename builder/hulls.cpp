// Points of hulls are corners of the triangles, chosen one by one: the farthest from the hull of the points so far. All
// in the coordinates in which the node's ellipsoid is the unit ball, where no direction is special. Then they are
// rounded, and what is left outside the rounded points' hull is measured: a corner's distance from it is at most that
// from any convex combination of the points.
//
// Where a node's triangles are coplanar, or a face ends it, the record also holds a slab (src/slab.hpp).
//
// Of many corners, the points are chosen among those that are the farthest along some direction.
//
// Complexity: O(n) an inner node of n corners, some hundred products a corner.
#include "builder/hulls.hpp"

#include "builder/fit.hpp"
#include "builder/job.hpp"

#include "src/bytes.hpp"
#include "src/slab.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace prolate {
namespace {

constexpr int kMostSteps = 64;
constexpr size_t kPlanes = 16; // that are tried for a slab
// Of a node's size: a slab that is thicker tells no more than the hull, whose points are rounded, unless it ends with a
// face. That is at least kFewest triangles, and that share of the node's area, which are as near to a plane as floats
// tell.
constexpr double kThinSlab = 0x1p-12, kTouching = 0x1p-20, kShareOfFace = 0.125;
constexpr size_t kFewest = 16;
// More than rounding costs anywhere below, in unit-ball coordinates: in double, some 2^-53 times the axis ratio, which
// is at most 2^14.
constexpr double kShareRounding = 1e-9;

// The convex combination of at most four of the points that is nearest to w, found as in P. Wolfe 1976, "Finding the
// nearest point in a polytope": the point that is farthest towards w joins those that the combination is of, and those
// that the nearest point of their affine hull needs less than nothing of leave.
class NearestCombination {
public:
    NearestCombination(std::span<const Vec> points, const Vec& w) : points_(points), w_(w) {
        corners_[0] = farthest(w), weights_[0] = 1;
        x_ = points[corners_[0]];
    }
    double distance() const { return (w_ - x_).norm(); }
    // False once it is as near as it gets.
    bool improve() {
        const Vec to = w_ - x_;
        const size_t next = farthest(to);
        const double along = to.dot(points_[next] - x_);
        if (!(along > kLeastStep * to.squaredNorm()) || count_ == 4) return false;
        corners_[count_] = next, weights_[count_++] = 0;
        while (!settle())
            if (count_ == 0) return false;
        Vec x = Vec::Zero();
        for (size_t i = 0; i < count_; ++i) x += weights_[i] * points_[corners_[i]];
        const bool nearer = (w_ - x).squaredNorm() < to.squaredNorm();
        if (nearer) x_ = x;
        return nearer;
    }

private:
    static constexpr double kLeastStep = 1e-3;

    size_t farthest(const Vec& direction) const {
        size_t best = 0;
        double most = -HUGE_VAL;
        for (size_t i = 0; i < points_.size(); ++i)
            if (const double d = direction.dot(points_[i]); d > most) most = d, best = i;
        return best;
    }
    // Moves the weights to those of the nearest point of the affine hull, or as far as none is below 0, and then drops
    // the corner that stopped them. True if none did. Without corners, it has failed.
    bool settle() {
        const std::array<double, 4> wanted = nearest_in_affine_hull();
        double share = 1;
        size_t stops = count_;
        for (size_t i = 0; i < count_; ++i) {
            if (wanted[i] > 0) continue;
            const double reached = weights_[i] / (weights_[i] - wanted[i]);
            if (!(reached >= share)) share = reached, stops = i;
        }
        if (stops == count_) {
            weights_ = wanted;
            return true;
        }
        for (size_t i = 0; i < count_; ++i) weights_[i] += share * (wanted[i] - weights_[i]);
        --count_;
        for (size_t i = stops; i < count_; ++i) corners_[i] = corners_[i + 1], weights_[i] = weights_[i + 1];
        return false;
    }
    // Weights of the corners, which sum to 1. Of corners in one plane, on one line or in one place, not a number.
    std::array<double, 4> nearest_in_affine_hull() const {
        const Vec &origin = points_[corners_[0]], to = w_ - origin;
        std::array<double, 4> out{1, 0, 0, 0};
        if (count_ == 1) return out;
        const auto edge = [&](size_t i) { return points_[corners_[i]] - origin; };
        const Vec d = edge(1);
        if (count_ == 2) {
            out[1] = to.dot(d) / d.squaredNorm();
        } else {
            const Vec e = edge(2), n = d.cross(e);
            if (count_ == 3) {
                out[1] = to.cross(e).dot(n) / n.squaredNorm(), out[2] = d.cross(to).dot(n) / n.squaredNorm();
            } else {
                const Vec f = edge(3);
                const double volume = n.dot(f);
                out[1] = to.cross(e).dot(f) / volume, out[2] = d.cross(to).dot(f) / volume, out[3] = n.dot(to) / volume;
            }
        }
        out[0] = 1 - (out[1] + out[2] + out[3]);
        return out;
    }

    std::span<const Vec> points_;
    const Vec w_;
    Vec x_;
    std::array<size_t, 4> corners_{};
    std::array<double, 4> weights_{};
    size_t count_ = 1;
};

// An upper bound on the distance of w from the convex hull of the points, close to it if it is above `enough`.
double distance_from_hull(std::span<const Vec> points, const Vec& w, double enough) {
    NearestCombination nearest(points, w);
    double distance = nearest.distance();
    for (int step = 0; step < kMostSteps && distance > enough && nearest.improve(); ++step)
        distance = nearest.distance();
    return distance;
}

// Those that are the farthest along some direction, if there are many: the hull of the others is not much smaller.
std::vector<Vec> outermost(const std::vector<Vec>& w) {
    const auto directions = sketch_directions();
    if (w.size() <= 2 * directions.size()) return w;
    std::vector<size_t> chosen;
    for (const Vec& d : directions) {
        size_t low = 0, high = 0;
        double least = HUGE_VAL, most = -HUGE_VAL;
        for (size_t i = 0; i < w.size(); ++i) {
            const double height = d.dot(w[i]);
            if (height < least) least = height, low = i;
            if (height > most) most = height, high = i;
        }
        chosen.insert(chosen.end(), {low, high});
    }
    std::sort(chosen.begin(), chosen.end());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    std::vector<Vec> out;
    out.reserve(chosen.size());
    for (const size_t i : chosen) out.push_back(w[i]);
    return out;
}

// Some of the points, whose hull the others are near.
std::vector<Vec> choose(const std::vector<Vec>& w) {
    if (w.size() <= kHullPoints) return w;
    std::vector<Vec> out;
    const auto farthest = [&](auto&& distance) {
        size_t best = 0;
        double most = -HUGE_VAL;
        for (size_t i = 0; i < w.size(); ++i)
            if (const double d = distance(i); d > most) most = d, best = i;
        return std::pair(best, most);
    };
    out.push_back(w[farthest([&](size_t i) { return w[i].squaredNorm(); }).first]);
    std::vector<double> distance(w.size(), HUGE_VAL); // from the hull so far, at most
    Checkpoints checkpoints;
    while (out.size() < kHullPoints) {
        double most = 0; // those that were nearer need not be looked at again
        const auto [next, gap] = farthest([&](size_t i) {
            checkpoints();
            if (distance[i] > most)
                distance[i] = distance_from_hull(out, w[i], most), most = std::max(most, distance[i]);
            return distance[i];
        });
        if (!(gap > 0)) break;
        out.push_back(w[next]);
    }
    return out;
}

// Twice the area of a triangle.
double twice_area(const TreeView& tree, uint32_t triangle) {
    const Triangle t = tree.triangle(triangle);
    const Vec p = to_vec(tree.vertex(t[0]));
    return (to_vec(tree.vertex(t[1])) - p).cross(to_vec(tree.vertex(t[2])) - p).norm();
}

// What lies below a node: triangles, and their corners, each once.
struct Face {
    uint32_t triangle;
    double area; // twice
};
struct Below {
    std::vector<Face> faces;
    std::vector<Vec> corners;
};
Below below(const TreeView& tree, uint32_t node) {
    Below out;
    std::vector<uint32_t> vertices;
    const auto collect = [&](const auto& self, uint32_t at) -> void {
        const TriangleRange range = tree.triangles(at);
        for (uint32_t t = range.first; t < range.first + range.count; ++t) {
            out.faces.push_back({t, twice_area(tree, t)});
            for (const uint32_t v : tree.triangle(t)) vertices.push_back(v);
        }
        const ChildRange children = tree.children(at);
        for (uint32_t i = 0; i < children.count; ++i) self(self, children.first + i);
    };
    collect(collect, node);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    out.corners.reserve(vertices.size());
    for (const uint32_t v : vertices) out.corners.push_back(to_vec(tree.vertex(v)));
    return out;
}

// Between which heights over a plane all corners lie, rounded outwards; wider than `enough`, perhaps too little, once
// it is certain that the plane is neither on the one side of all of them nor on the other, but for `touching`.
struct Heights {
    double low = 0, high = 0;
    double width() const { return high - low; }
};
Heights heights_over(const Slab& plane, std::span<const Vec> corners, double enough, double touching) {
    Heights out;
    const double of_origin = Vec(plane.origin).lpNorm<1>();
    for (const Vec& x : corners) {
        const double height = plane.height(x.data());
        const double rounding = kSlabRounding * (x.lpNorm<1>() + of_origin);
        out.low = std::min(out.low, height - rounding), out.high = std::max(out.high, height + rounding);
        if (out.width() > enough && out.low < -touching && out.high > touching) break;
    }
    return out;
}

// The area of the triangles in a plane; 0 if they are fewer than kFewest.
double area_in(const TreeView& tree, const Slab& plane, std::span<const Face> faces, double touching) {
    double area = 0;
    size_t count = 0;
    for (const auto& [t, of_t] : faces) {
        const Triangle corners = tree.triangle(t);
        const bool in_plane = std::all_of(corners.begin(), corners.end(), [&](uint32_t v) {
            return std::abs(plane.height(to_vec(tree.vertex(v)).data())) <= touching;
        });
        if (in_plane) area += of_t, ++count;
    }
    return count < kFewest ? 0 : area;
}

void store_slab(std::byte* record, const Slab& plane, uint32_t triangle, const Heights& heights) {
    for (size_t k = 0; k < 3; ++k)
        store_le(record + kHullNormal + k, static_cast<int8_t>(std::round(plane.normal[k] * kHullUnit)));
    store_le(record + kHullPlane, triangle);
    store_le(record + kHullLow, std::nextafter(static_cast<float>(heights.low), -HUGE_VALF));
    store_le(record + kHullHigh, std::nextafter(static_cast<float>(heights.high), HUGE_VALF));
}

// Of the planes of the largest triangles that with the thinnest slab, if that is thin for a node of this size; else the
// plane of a face, with all of the node on one side of it, that has the most area.
void describe_slab(const TreeView& tree, Below& below, double size, std::byte* record) {
    std::vector<Face>& faces = below.faces;
    const size_t count = std::min(faces.size(), kPlanes);
    double whole = 0;
    for (const Face& face : faces) whole += face.area;
    std::partial_sort(
        faces.begin(), faces.begin() + static_cast<std::ptrdiff_t>(count), faces.end(),
        [](const Face& s, const Face& t) { return s.area > t.area || (s.area == t.area && s.triangle < t.triangle); });
    const double touching = kTouching * size;
    double thinnest = kThinSlab * size, largest = kShareOfFace * whole;
    bool thin = false;
    for (const Face& face : std::span(faces).first(count)) {
        const Slab plane = plane_of(tree, face.triangle);
        if (!Vec(plane.normal).allFinite()) continue;
        const Heights heights = heights_over(plane, below.corners, thinnest, touching);
        if (heights.width() <= thinnest) {
            thin = true, thinnest = heights.width();
            store_slab(record, plane, face.triangle, heights);
        } else if (!thin && (heights.low >= -touching || heights.high <= touching)) {
            const double area = area_in(tree, plane, faces, touching);
            if (!(area > largest)) continue;
            largest = area;
            store_slab(record, plane, face.triangle, heights);
        }
    }
}

void describe(const TreeView& tree, uint32_t node, std::byte* record) {
    const Fit fit(tree.ellipsoid(node));
    Below at = below(tree, node);
    describe_slab(tree, at, fit.factor.norm(), record);
    std::vector<Vec> w = std::move(at.corners);
    for (Vec& x : w) x = fit.radial(x);
    const std::vector<Vec> candidates = outermost(w), chosen = choose(candidates);
    for (size_t i = 0; i < kHullPoints; ++i) // the last again where there are fewer
        for (size_t k = 0; k < 3; ++k) {
            const double x = chosen[std::min(i, chosen.size() - 1)][static_cast<int>(k)];
            const double q = std::clamp(std::round(x * kHullUnit), -kHullUnit, kHullUnit);
            store_le(record + kHullPoint + kHullPoints * k + i, static_cast<int8_t>(q));
        }
    const Hull hull(record);
    double most = hull.distance(Vec::Zero(), 0);                                   // the center, too: FORMAT.md
    for (const Vec& x : candidates) most = std::max(most, hull.distance(x, most)); // what others are compared with
    Checkpoints checkpoints;
    for (const Vec& x : w) most = std::max(most, hull.distance(x, most)), checkpoints();
    const double share = std::ceil((most + kShareRounding) * kHullShares);
    store_le(record + kHullShare, static_cast<uint8_t>(share <= kHullShares ? share : 0));
}

} // namespace

Hull::Hull(const std::byte* record) : share(load_le<uint8_t>(record + kHullShare) / kHullShares) {
    for (size_t i = 0; i < kHullPoints; ++i)
        for (size_t k = 0; k < 3; ++k)
            points[i][static_cast<int>(k)] = load_le<int8_t>(record + kHullPoint + kHullPoints * k + i) / kHullUnit;
}

double Hull::distance(const Vec& w, double enough) const {
    return distance_from_hull(points, w, enough);
}

std::vector<std::byte> hulls_of(const TreeView& tree) {
    std::vector<std::byte> out(size_t{tree.block_count()} * kHullBytes);
    parallel_for(uint32_t{0}, tree.slot_count(), [&](uint32_t node) {
        if (!tree.is_node(node)) return;
        const ChildRange children = tree.children(node);
        if (children.count > 0) describe(tree, node, out.data() + size_t{children.first / kBlockLanes} * kHullBytes);
    });
    return out;
}

} // namespace prolate

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

#include "builder/corners_by_use.hpp"
#include "builder/fit.hpp"
#include "builder/hull_distance.hpp"
#include "builder/job.hpp"

#include "src/bytes.hpp"
#include "src/slab.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

namespace prolate {
namespace {

constexpr size_t kPlanes = 16; // that are tried for a slab
// Of a node's size: a slab that is thicker tells no more than the hull, whose points are rounded, unless it ends with a
// face. That is at least kFewest triangles, and that share of the node's area, which are as near to a plane as floats
// tell.
constexpr double kThinSlab = 0x1p-12, kTouching = 0x1p-20, kShareOfFace = 0.125;
constexpr size_t kFewest = 16;
// More than rounding costs anywhere below, in unit-ball coordinates: in double, some 2^-53 times the axis ratio, which
// is at most 2^14.
constexpr double kShareRounding = 1e-9;

// How far points reach along directions, up and down: loops over directions, which compilers vectorise. That is why
// they compare integers: g++ does not where a comparison of floats, which may trap, chooses two values.
class Reaches {
public:
    explicit Reaches(size_t directions) : count_(std::min(directions, kMost)) {
        up_.fill(key_of(-HUGE_VALF)), down_.fill(key_of(HUGE_VALF));
    }
    void add(const Vec& point, uint32_t name) {
        const auto x = static_cast<float>(point.x()), y = static_cast<float>(point.y()),
                   z = static_cast<float>(point.z());
        const Directions& along = directions();
        for (size_t d = 0; d < count_; ++d) {
            const float height = (along.x[d] * x + along.y[d] * y) + along.z[d] * z;
            const int32_t key = key_of(height + 0.0f); // never -0
            highest_[d] = key > up_[d] ? name : highest_[d], up_[d] = key > up_[d] ? key : up_[d];
            lowest_[d] = key < down_[d] ? name : lowest_[d], down_[d] = key < down_[d] ? key : down_[d];
        }
    }
    // Which of all points reaches farther than the others by most, if any does.
    struct Farthest {
        float by = 0;
        uint32_t name = 0;
    };
    Farthest beyond(const Reaches& others) const {
        Farthest out;
        for (size_t d = 0; d < count_; ++d) {
            const float up = with_key(up_[d]) - with_key(others.up_[d]),
                        down = with_key(others.down_[d]) - with_key(down_[d]);
            if (up > out.by) out = {up, highest_[d]};
            if (down > out.by) out = {down, lowest_[d]};
        }
        return out;
    }
    // The farthest points, each direction's.
    std::vector<uint32_t> extremes() const {
        std::vector<uint32_t> out(highest_.begin(), highest_.begin() + static_cast<std::ptrdiff_t>(count_));
        out.insert(out.end(), lowest_.begin(), lowest_.begin() + static_cast<std::ptrdiff_t>(count_));
        return out;
    }

private:
    // A float as an integer of the same order, if it is not -0, and back.
    static int32_t ordered(int32_t bits) { return bits ^ (bits >> 31 & INT32_MAX); }
    static int32_t key_of(float x) { return ordered(std::bit_cast<int32_t>(x)); }
    static float with_key(int32_t key) { return std::bit_cast<float>(ordered(key)); }

    static constexpr size_t kMost = 48;
    struct Directions {
        std::array<float, kMost> x, y, z;
    };
    static const Directions& directions() {
        static const Directions table = [] {
            Directions out{};
            for (size_t d = 0; d < kMost; ++d) {
                const Vec& along = sketch_directions()[d];
                out.x[d] = static_cast<float>(along.x()), out.y[d] = static_cast<float>(along.y());
                out.z[d] = static_cast<float>(along.z());
            }
            return out;
        }();
        return table;
    }
    const size_t count_;
    std::array<int32_t, kMost> up_, down_; // keys
    std::array<uint32_t, kMost> highest_{}, lowest_{};
};

// Those that are the farthest along some direction, if there are many: the hull of the others is not much smaller.
std::vector<Vec> extremes_of(const std::vector<Vec>& w, const Reaches& reaches) {
    std::vector<uint32_t> extremes = reaches.extremes();
    if (w.size() <= extremes.size()) return w;
    std::sort(extremes.begin(), extremes.end());
    extremes.erase(std::unique(extremes.begin(), extremes.end()), extremes.end());
    std::vector<Vec> out;
    out.reserve(extremes.size());
    for (const uint32_t i : extremes) out.push_back(w[i]);
    return out;
}

// Some of the points, whose hull the others are near. The first ones are told by how far the hull reaches, which is the
// distance of convex sets, if the directions are many; the last ones by the distance itself, which takes longer.
std::vector<Vec> choose(const std::vector<Vec>& w, const std::vector<Vec>& all_w, const Reaches& all,
                        size_t directions) {
    if (w.size() <= kHullPoints) return w;
    constexpr size_t kByReach = 12;
    std::vector<Vec> out;
    HullDistance hull;
    const auto take = [&](const Vec& point) { out.push_back(point), hull.add(point); };
    Reaches chosen(directions);
    while (out.size() < kByReach) {
        const Reaches::Farthest next = all.beyond(chosen);
        if (!(next.by > 0)) break;
        take(all_w[next.name]), chosen.add(out.back(), next.name);
    }
    std::vector<double> distance(w.size(), HUGE_VAL); // from the hull so far, at most
    std::vector<Combination> nearest(w.size());
    const auto farthest = [&] {
        return static_cast<size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    };
    Checkpoints checkpoints;
    while (out.size() < kHullPoints) {
        double most = 0; // those that were nearer need not be looked at again
        const auto look_at = [&](size_t i) {
            checkpoints();
            if (distance[i] > most) distance[i] = hull(w[i], most, nearest[i]), most = std::max(most, distance[i]);
        };
        look_at(farthest());
        for (size_t i = 0; i < w.size(); ++i) look_at(i);
        if (!(most > 0)) break;
        take(w[farthest()]);
    }
    return out;
}

// Twice the area of a triangle.
double twice_area(const TreeView& tree, uint32_t triangle) {
    const Triangle t = tree.triangle(triangle);
    const Vec p = to_vec(tree.vertex(t[0]));
    return (to_vec(tree.vertex(t[1])) - p).cross(to_vec(tree.vertex(t[2])) - p).norm();
}

struct Face {
    uint32_t triangle;
    double area; // twice
};

// What lies below the nodes of a tree: in depth-first order, that below a node is consecutive.
class Below {
public:
    explicit Below(const TreeView& tree) : parts_(tree.slot_count()), corners_(walk(tree), vertices_of(tree)) {}
    std::vector<Face> faces(uint32_t node) const {
        return {faces_.begin() + parts_[node].begin, faces_.begin() + parts_[node].end};
    }
    std::vector<Vec> corners(uint32_t node) const { return corners_.of(parts_[node].begin, parts_[node].end); }

private:
    struct Part {
        uint32_t begin = 0, end = 0; // of faces_
    };
    std::vector<Triangle> walk(const TreeView& tree) {
        std::vector<Triangle> out;
        const auto visit = [&](const auto& self, uint32_t at) -> void {
            parts_[at].begin = static_cast<uint32_t>(faces_.size());
            const TriangleRange range = tree.triangles(at);
            for (uint32_t t = range.first; t < range.first + range.count; ++t) {
                faces_.push_back({t, twice_area(tree, t)});
                out.push_back(tree.triangle(t));
            }
            const ChildRange children = tree.children(at);
            for (uint32_t i = 0; i < children.count; ++i) self(self, children.first + i);
            parts_[at].end = static_cast<uint32_t>(faces_.size());
        };
        visit(visit, 0);
        return out;
    }
    static std::vector<Vec3> vertices_of(const TreeView& tree) {
        std::vector<Vec3> out(tree.vertex_count());
        for (uint32_t v = 0; v < out.size(); ++v) out[v] = tree.vertex(v);
        return out;
    }

    std::vector<Part> parts_; // of slots
    std::vector<Face> faces_;
    const CornersByUse corners_; // of these
};

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
void describe_slab(const TreeView& tree, std::vector<Face> faces, std::span<const Vec> corners, double size,
                   std::byte* record) {
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
        const Heights heights = heights_over(plane, corners, thinnest, touching);
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

void describe(const TreeView& tree, const Below& below, uint32_t node, size_t directions, std::byte* record) {
    const Fit fit(tree.ellipsoid(node));
    std::vector<Vec> w = below.corners(node);
    describe_slab(tree, below.faces(node), w, fit.factor.norm(), record);
    for (Vec& x : w) x = fit.radial(x);
    Reaches all(directions);
    for (uint32_t i = 0; i < w.size(); ++i) all.add(w[i], i);
    const std::vector<Vec> candidates = extremes_of(w, all), points = choose(candidates, w, all, directions);
    for (size_t i = 0; i < kHullPoints; ++i) // the last again where there are fewer
        for (size_t k = 0; k < 3; ++k) {
            const double x = points[std::min(i, points.size() - 1)][static_cast<int>(k)];
            const double q = std::clamp(std::round(x * kHullUnit), -kHullUnit, kHullUnit);
            store_le(record + kHullPoint + kHullPoints * k + i, static_cast<int8_t>(q));
        }
    // The center lies within it, too (FORMAT.md). Of the corners, those come first that others are compared with.
    Hull hull(record);
    double share = 0; // 255ths
    const auto hold = [&](const Vec& x) {
        const double enough = share / kHullShares - kShareRounding, distance = hull.distance(x, enough);
        if (!(distance <= enough)) share = std::ceil((distance + kShareRounding) * kHullShares);
    };
    hold(Vec::Zero());
    for (const Vec& x : candidates) hold(x);
    Checkpoints checkpoints;
    for (const Vec& x : w) hold(x), checkpoints();
    store_le(record + kHullShare, static_cast<uint8_t>(share <= kHullShares ? share : 0));
}

} // namespace

Hull::Hull(const std::byte* record) : share(load_le<uint8_t>(record + kHullShare) / kHullShares) {
    for (size_t i = 0; i < kHullPoints; ++i) {
        const auto coordinate = [&](size_t k) -> double {
            return load_le<int8_t>(record + kHullPoint + kHullPoints * k + i);
        };
        points_.add({coordinate(0), coordinate(1), coordinate(2)});
    }
}

double Hull::distance(const Vec& w, double enough) {
    const Vec at = kHullUnit * w;
    const double most = kHullUnit * enough;
    const auto around = [&](const Simplex& simplex) { return simplex.within(at, most); };
    if (enough >= 0 && (points_.near_point(at, most) || std::any_of(near_.begin(), near_.end(), around))) return enough;
    const double out = points_(at, most, last_);
    near_[oldest_++ % near_.size()] = Simplex(points_, last_);
    return out / kHullUnit;
}

std::vector<std::byte> hulls_of(const TreeView& tree, const ExactEffort& effort) {
    std::vector<std::byte> out(size_t{tree.block_count()} * kHullBytes);
    const Below below(tree);
    parallel_for(uint32_t{0}, tree.slot_count(), [&](uint32_t node) {
        if (!tree.is_node(node)) return;
        const ChildRange children = tree.children(node);
        if (children.count > 0)
            describe(tree, below, node, effort.hull_directions,
                     out.data() + size_t{children.first / kBlockLanes} * kHullBytes);
    });
    return out;
}

} // namespace prolate

#include "builder/hausdorff.hpp"

#include "builder/fit.hpp"
#include "builder/job.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <queue>
#include <vector>

namespace prolate {
namespace {

constexpr size_t kMostBranches = 20'000; // of one ellipsoid's branch and bound
constexpr double kSame = 1e-12;          // squared radial coordinates this close to 1 are on the surface

// Which ellipsoids' boxes meet a box: a binary tree over the boxes.
class BoxTree {
public:
    explicit BoxTree(const std::vector<Box>& boxes) : boxes_(boxes), order_(boxes.size()) {
        std::iota(order_.begin(), order_.end(), 0u);
        if (!order_.empty()) build(0, static_cast<uint32_t>(order_.size()));
    }

    template <class Visit> void visit(const Box& box, Visit&& visit) const {
        for (uint32_t n = 0; n < nodes_.size();) {
            const Node& node = nodes_[n];
            if (!meet(node.box, box)) {
                n = node.skip;
                continue;
            }
            if (node.skip == n + 1)
                for (uint32_t i = node.begin; i < node.end; ++i)
                    if (meet(boxes_[order_[i]], box)) visit(order_[i]);
            ++n;
        }
    }

private:
    struct Node {
        Box box;
        uint32_t begin, end; // in order_
        uint32_t skip;       // the node after this one's subtree
    };

    static bool meet(const Box& a, const Box& b) {
        return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
    }

    void build(uint32_t begin, uint32_t end) {
        const auto index = static_cast<uint32_t>(nodes_.size());
        Node node{{}, begin, end, 0};
        for (uint32_t i = begin; i < end; ++i) node.box.add(boxes_[order_[i]]);
        nodes_.push_back(node);
        if (end - begin > 4) {
            int axis = 0;
            node.box.size().maxCoeff(&axis);
            const uint32_t middle = begin + (end - begin) / 2;
            std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                             [&](uint32_t a, uint32_t b) {
                                 const double s = boxes_[a].center()[axis], t = boxes_[b].center()[axis];
                                 return s != t ? s < t : a < b;
                             });
            build(begin, middle);
            build(middle, end);
        }
        nodes_[index].skip = static_cast<uint32_t>(nodes_.size());
    }

    const std::vector<Box>& boxes_;
    std::vector<uint32_t> order_;
    std::vector<Node> nodes_;
};

class Measure {
public:
    Measure(std::span<const Ellipsoid> ellipsoids, const Winding& winding, bool closed)
        : fits_(ellipsoids.begin(), ellipsoids.end()), winding_(winding), closed_(closed) {
        for (const Ellipsoid& e : ellipsoids) axes_.push_back(principal_axes(e));
    }

    HausdorffDistance operator()(double tolerance, uint32_t samples) const {
        HausdorffDistance out;
        sample(samples, out);
        // Each ellipsoid starts from the samples' maximum and not from its neighbours', which depend on the threads.
        std::vector<Bounds> bounds(fits_.size());
        parallel_for(size_t{0}, fits_.size(), [&](size_t i) { bounds[i] = supremum(i, out.max, tolerance); });
        double upper = out.max;
        for (const Bounds& b : bounds) {
            out.max = std::max(out.max, b.lower);
            upper = std::max(upper, b.upper);
        }
        out.max_error = upper - out.max;
        return out;
    }

private:
    struct Bounds {
        double lower, upper;
    };
    struct Sample {
        double distance, area;
        auto operator<=>(const Sample&) const = default;
    };

    bool inside(const Vec& p) const { return closed_ && winding_.whole(p).value_or(1) != 0; }

    // --- the boundary's samples ---

    struct BoundaryPoint {
        Vec position;
        double area;
    };

    void sample(uint32_t count, HausdorffDistance& out) const {
        std::vector<Box> boxes;
        std::vector<double> areas;
        for (size_t i = 0; i < fits_.size(); ++i) {
            const Vec half = fits_[i].half_extents();
            boxes.push_back({fits_[i].center - half, fits_[i].center + half});
            double sum = 0;
            for (const Vec& u : sketch_directions()) sum += area_element(i, u);
            areas.push_back(4 * std::numbers::pi / static_cast<double>(sketch_directions().size()) * sum);
        }
        const BoxTree tree(boxes);
        std::vector<std::vector<BoundaryPoint>> points(fits_.size());
        const auto spread = [&](double area_per_point) {
            parallel_for(size_t{0}, fits_.size(), [&](size_t i) {
                std::vector<uint32_t> neighbours;
                tree.visit(boxes[i], [&](uint32_t j) {
                    if (j != i) neighbours.push_back(j);
                });
                points[i] = boundary_points(i, neighbours, std::ceil(areas[i] / area_per_point));
            });
            double area = 0;
            for (const auto& own : points)
                for (const BoundaryPoint& p : own) area += p.area;
            return area;
        };
        // Most of the ellipsoids' surfaces is hidden in others. A few points tell how much.
        const double whole = std::accumulate(areas.begin(), areas.end(), 0.0);
        const double visible = std::max(spread(4 * whole / count), 0.01 * whole);
        out.area = spread(visible / count);

        std::vector<std::vector<Sample>> own(fits_.size());
        parallel_for(size_t{0}, fits_.size(), [&](size_t i) {
            for (const auto& [p, area] : points[i]) own[i].push_back({distance(p), area}), checkpoint();
        });
        std::vector<Sample> all;
        for (const auto& samples : own) all.insert(all.end(), samples.begin(), samples.end());
        if (all.empty()) return;
        std::sort(all.begin(), all.end());
        out.samples = all.size();
        out.max = all.back().distance;
        double moment = 0, below = 0;
        for (const Sample& s : all) {
            moment += s.area * s.distance;
            if (below < 0.99 * out.area) out.p99 = s.distance;
            below += s.area;
        }
        out.mean = moment / out.area;
    }

    double distance(const Vec& p) const { return inside(p) ? 0 : winding_.tree().distance(p); }

    // The point of ellipsoid i at u in the frame of its principal axes, in which it is the unit ball.
    Vec point(size_t i, const Vec& u) const {
        const auto& [radii, turn] = axes_[i];
        const Vec v(radii[0] * u.x(), radii[1] * u.y(), radii[2] * u.z());
        return fits_[i].center + Vec(turn[0][0] * v.x() + turn[0][1] * v.y() + turn[0][2] * v.z(),
                                     turn[1][0] * v.x() + turn[1][1] * v.y() + turn[1][2] * v.z(),
                                     turn[2][0] * v.x() + turn[2][1] * v.y() + turn[2][2] * v.z());
    }

    // Area of its surface there per solid angle of u.
    double area_element(size_t i, const Vec& u) const {
        const auto& [a, b, c] = axes_[i].radii;
        return Vec(b * c * u.x(), c * a * u.y(), a * b * u.z()).norm();
    }

    // Those of `count` points on an ellipsoid that no other one hides.
    std::vector<BoundaryPoint> boundary_points(size_t own, const std::vector<uint32_t>& neighbours,
                                               double count) const {
        std::vector<BoundaryPoint> out;
        Checkpoints checkpoints;
        for (double k = 0; k < count; ++k) {
            checkpoints();
            // A Fibonacci lattice (Gonzalez 2010), turned differently for each ellipsoid.
            const double z = 1 - (2 * k + 1) / count, r = std::sqrt(1 - z * z);
            const double turn = (k + 0.618 * static_cast<double>(own)) * (3 - std::sqrt(5.0)) * std::numbers::pi;
            const Vec u(r * std::cos(turn), r * std::sin(turn), z), p = point(own, u);
            const bool hidden = std::ranges::any_of(neighbours, [&](uint32_t j) {
                const double radial = fits_[j].radial_squared(p);
                return radial < 1 - kSame || (radial < 1 + kSame && j < own); // of equal surfaces the first one counts
            });
            if (!hidden) out.push_back({p, area_element(own, u) * 4 * std::numbers::pi / count});
        }
        return out;
    }

    // --- branch and bound ---

    struct Cell {
        Vec low, high; // in the frame of point()
        double upper;  // no point of (cell ∩ ellipsoid) is farther from the solid
        uint32_t number;
        // Of two equal ones, the older first.
        bool operator<(const Cell& o) const { return upper != o.upper ? upper < o.upper : number > o.number; }
    };

    // Corners of a convex polyhedron around (cell ∩ unit ball): of the cell, cut by the plane normal . y = 1.
    static std::vector<Vec> corners(const Cell& cell, const Vec& normal) {
        const Box box{cell.low, cell.high};
        std::vector<Vec> out;
        for (unsigned i = 0; i < 8; ++i) {
            const Vec p = box.corner(i);
            const double height = normal.dot(p) - 1;
            if (height <= 0) out.push_back(p);
            for (unsigned axis = 0; axis < 3; ++axis) {
                const unsigned j = i | 1u << axis;
                if (j == i) continue;
                const Vec q = box.corner(j);
                const double other = normal.dot(q) - 1;
                if ((height < 0) != (other < 0)) out.push_back(p + height / (height - other) * (q - p));
            }
        }
        return out;
    }

    // Bounds the cell from above, and raises `lower` by what is found. False if no point of it exceeds lower +
    // tolerance.
    bool bound(size_t i, Cell& cell, double& lower, double tolerance) const {
        if (Vec::Zero().cwiseMax(cell.low).cwiseMin(cell.high).squaredNorm() >= 1) return false; // misses the ball
        const Vec middle = 0.5 * (cell.low + cell.high);
        const double radius = middle.norm();
        const Vec normal = radius > 0 ? Vec(middle / radius) : Vec::UnitX();
        const Vec q = point(i, radius > 1 ? normal : middle);
        const TriangleTree::Nearest nearest = winding_.tree().nearest(q);
        std::vector<Vec> around = corners(cell, normal);
        for (Vec& y : around) y = point(i, y);
        const auto farthest = [&](const Vec& from) {
            double square = 0;
            for (const Vec& p : around) square = std::max(square, (p - from).squaredNorm());
            return std::sqrt(square);
        };
        cell.upper = std::min(cell.upper, farthest(nearest.point));
        const double enough = lower + tolerance, if_inside = std::max(0.0, farthest(q) - nearest.distance);
        if (cell.upper <= enough) return false;
        if (if_inside > enough && nearest.distance <= lower) return true; // whether q is inside makes no difference
        if (!inside(q))
            lower = std::max(lower, nearest.distance);
        else if (if_inside < cell.upper)
            cell.upper = if_inside;
        return cell.upper > lower + tolerance;
    }

    Bounds supremum(size_t i, double lower, double tolerance) const {
        std::priority_queue<Cell> cells;
        uint32_t number = 0;
        const auto consider = [&](const Vec& low, const Vec& high, double upper) {
            Cell cell{low, high, upper, number++};
            if (bound(i, cell, lower, tolerance)) cells.push(cell);
        };
        consider(Vec::Constant(-1), Vec::Constant(1), HUGE_VAL);
        const Vec lengths(axes_[i].radii);
        while (!cells.empty() && cells.top().upper > lower + tolerance) {
            checkpoint();
            if (number > kMostBranches) return {lower, cells.top().upper};
            const Cell cell = cells.top();
            cells.pop();
            int axis = 0;
            lengths.cwiseProduct(cell.high - cell.low).maxCoeff(&axis);
            Vec low = cell.low, high = cell.high;
            low[axis] = high[axis] = 0.5 * (low[axis] + high[axis]);
            consider(cell.low, high, cell.upper);
            consider(low, cell.high, cell.upper);
        }
        return {lower, lower + tolerance};
    }

    std::vector<Fit> fits_;
    std::vector<PrincipalAxes> axes_;
    const Winding& winding_;
    bool closed_;
};

} // namespace

HausdorffDistance hausdorff_distance(std::span<const Ellipsoid> ellipsoids, const Winding& winding, bool closed,
                                     double tolerance, uint32_t samples) {
    return Measure(ellipsoids, winding, closed)(tolerance, samples);
}

} // namespace prolate

// Best first: boxes and triangles come in the order of their distance from the center, as the ellipsoid sees it.
#include "builder/obstacles.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

namespace prolate {
namespace {

// A triangle that reaches below a plane by no more than this share of its height counts as shut out: its own nearest
// point is what the plane goes through.
constexpr double kOnPlane = 1e-9;

class ObstacleSearch {
public:
    ObstacleSearch(const Fit& ellipsoid, const TriangleTree& surface, double most)
        : ellipsoid_(ellipsoid), surface_(surface), most_(most) {
        if (!surface.nodes().empty()) push_node(0);
    }

    std::vector<Obstacle> run(size_t count) {
        while (!queue_.empty() && found_.size() < count) {
            const Entry entry = queue_.top();
            queue_.pop();
            if (entry.is_triangle) {
                if (!shut_out(entry.index)) add(entry.plane);
            } else if (!shut_out(surface_.nodes()[entry.index].box)) {
                open(entry.index);
            }
        }
        return std::move(found_);
    }

private:
    struct Entry {
        double distance; // at most that of what it holds
        uint32_t index;
        bool is_triangle;
        Obstacle plane;                                                                // of a triangle
        bool operator<(const Entry& other) const { return distance > other.distance; } // the nearest on top
    };
    using Corners = std::array<Vec, 3>;

    void open(uint32_t index) {
        const TriangleTree::Node& node = surface_.nodes()[index];
        if (node.right != 0) {
            push_node(index + 1), push_node(node.right);
            return;
        }
        for (uint32_t t = node.begin; t < node.end; ++t)
            if (const Obstacle plane = plane_of(corners(t)); plane.height <= most_)
                queue_.push({plane.height, t, true, plane});
    }

    void push_node(uint32_t index) {
        const Box& box = surface_.nodes()[index].box;
        const Vec y = ellipsoid_.radial(box.center());
        const double length = y.norm();
        // Along y, the box reaches as far inwards as this.
        const double extent = 0.5 * box.size().dot((ellipsoid_.inverse.transpose() * y).cwiseAbs());
        const double distance = length > 0 ? std::max(0.0, length - extent / length) : 0;
        if (distance <= most_) queue_.push({distance, index, false, {}});
    }

    Corners corners(uint32_t t) const {
        const TriangleTree::Corners& c = surface_.triangles()[t];
        return {ellipsoid_.radial(to_vec(c[0])), ellipsoid_.radial(to_vec(c[1])), ellipsoid_.radial(to_vec(c[2]))};
    }

    // The plane across the way to the nearest point. Whatever that point is, the triangle lies beyond the plane.
    static Obstacle plane_of(const Corners& c) {
        const Vec nearest = nearest_point(Vec::Zero(), c[0], c[1], c[2]);
        const double length = nearest.norm();
        const Vec n = length > 0 ? Vec(nearest / length) : Vec::UnitX();
        return {n, std::max(0.0, std::min({n.dot(c[0]), n.dot(c[1]), n.dot(c[2])}))};
    }

    void add(const Obstacle& plane) {
        found_.push_back(plane);
        gradients_.push_back(ellipsoid_.inverse.transpose() * plane.normal);
    }

    bool shut_out(uint32_t t) const {
        const Corners c = corners(t);
        return std::any_of(found_.begin(), found_.end(), [&](const Obstacle& o) {
            return std::min({o.normal.dot(c[0]), o.normal.dot(c[1]), o.normal.dot(c[2])}) >= o.height * (1 - kOnPlane);
        });
    }
    bool shut_out(const Box& box) const {
        const Vec half = 0.5 * box.size(), from_center = box.center() - ellipsoid_.center;
        for (size_t i = 0; i < found_.size(); ++i)
            if (gradients_[i].dot(from_center) - gradients_[i].cwiseAbs().dot(half) >= found_[i].height) return true;
        return false;
    }

    const Fit& ellipsoid_;
    const TriangleTree& surface_;
    const double most_;
    std::priority_queue<Entry> queue_;
    std::vector<Obstacle> found_;
    std::vector<Vec> gradients_; // of their heights, in space
};

} // namespace

std::vector<Obstacle> obstacles(const Fit& ellipsoid, const TriangleTree& surface, double most, size_t count) {
    return ObstacleSearch(ellipsoid, surface, most).run(count);
}

double clearance(const Fit& ellipsoid, const TriangleTree& surface, double most) {
    const std::vector<Obstacle> nearest = obstacles(ellipsoid, surface, most, 1);
    return nearest.empty() ? most : nearest[0].height;
}

} // namespace prolate

#include "builder/passages.hpp"

#include "builder/fit.hpp"
#include "builder/free_space.hpp"
#include "builder/job.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <queue>

namespace prolate {
namespace {

constexpr double kStepsOfRadius = 6;    // in the ball's radius, ...
constexpr double kMostStepsAcross = 96; // ... but not more than these in the box's longest side
constexpr double kRegionMargin = 0.15;  // of that side: how far around the mesh the lattice reaches, besides the ball
constexpr double kCoordinateRounding = 1e-12; // of the largest coordinate
constexpr int kIterations = 60;               // of a bisection

// Which of a node's neighbours are neighbours of each other, as bits.
struct Adjacency {
    std::array<uint32_t, kNeighbours> all{};  // that touch in a face, an edge or a corner
    std::array<uint32_t, kNeighbours> face{}; // that touch in a face; only neighbours that are no corners of the cube
    uint32_t faces = 0, edges = 0;            // neighbours through a face, through an edge
};

const Adjacency& adjacency() {
    static const Adjacency made = [] {
        Adjacency out;
        const auto steps = [](const std::array<int, 3>& by) {
            return std::abs(by[0]) + std::abs(by[1]) + std::abs(by[2]);
        };
        for (int n = 0; n < kNeighbours; ++n) {
            const int own = steps(neighbour(n));
            (own == 1 ? out.faces : out.edges) |= own <= 2 ? 1u << n : 0u;
            for (int m = 0; m < kNeighbours; ++m) {
                const std::array<int, 3> p = neighbour(n), q = neighbour(m);
                const std::array<int, 3> by{q[0] - p[0], q[1] - p[1], q[2] - p[2]};
                if (n == m || std::max({std::abs(by[0]), std::abs(by[1]), std::abs(by[2])}) > 1) continue;
                out.all[static_cast<size_t>(n)] |= 1u << m;
                if (steps(by) == 1 && own <= 2 && steps(q) <= 2) out.face[static_cast<size_t>(n)] |= 1u << m;
            }
        }
        return out;
    }();
    return made;
}

// What can be reached within `among` from its lowest member that is in `from`.
uint32_t component(uint32_t among, uint32_t from, const std::array<uint32_t, kNeighbours>& adjacent) {
    uint32_t found = from & -from, waiting = found;
    while (waiting) {
        const auto n = static_cast<size_t>(std::countr_zero(waiting));
        waiting &= waiting - 1;
        const uint32_t fresh = adjacent[n] & among & ~found;
        found |= fresh, waiting |= fresh;
    }
    return found;
}

// May a node go whose neighbours in the set are `set`? Those stay connected around it, and so does what is not in the
// set and touches it in a face.
bool is_simple(uint32_t set) {
    const Adjacency& adjacent = adjacency();
    if (set == 0 || component(set, set, adjacent.all) != set) return false;
    const uint32_t outside = ~set & (adjacent.faces | adjacent.edges), touching = outside & adjacent.faces;
    return touching != 0 && (component(outside, touching, adjacent.face) & touching) == touching;
}

// The places of the ball's center, thinned.
class Thinning {
public:
    Thinning(const FreeSpace& space, double radius) : space_(space), in_(space.count(), 0) {
        // Those that are connected with the outside.
        std::vector<size_t> waiting{0};
        in_[0] = 1;
        while (!waiting.empty()) {
            checkpoints_();
            const size_t from = waiting.back();
            waiting.pop_back();
            space_.for_each_neighbour(from, [&](int, size_t to) {
                if (in_[to] || space_.distance(to) < radius) return;
                in_[to] = 1;
                waiting.push_back(to);
            });
        }
    }

    void run() {
        for (size_t i = 0; i < in_.size(); ++i)
            if (in_[i]) enqueue(i);
        while (!queue_.empty()) {
            checkpoints_();
            const size_t at = queue_.top().node;
            queue_.pop();
            in_[at] = kIn;
            if (!is_simple(neighbours_in(at))) continue;
            in_[at] = kOut;
            space_.for_each_neighbour(at, [this](int, size_t to) {
                if (in_[to] == kIn) enqueue(to);
            });
        }
    }

    template <class Visit> void for_each(Visit&& visit) const {
        for (size_t i = 0; i < in_.size(); ++i)
            if (in_[i]) visit(space_.place(i));
    }

private:
    enum : uint8_t { kOut = 0, kIn = 1, kQueued = 2 };
    struct Waiting {
        double distance;
        size_t node;
        bool operator<(const Waiting& other) const { // the nearest to the surface on top
            return distance != other.distance ? distance > other.distance : node > other.node;
        }
    };

    void enqueue(size_t node) {
        const std::array<int, 3> at = space_.place(node);
        if (space_.is_border(at)) return;
        in_[node] = kQueued;
        // All its neighbours being there, it cannot go; when one goes, its turn comes again.
        if (neighbours_in(node) == (1u << kNeighbours) - 1) {
            in_[node] = kIn;
            return;
        }
        queue_.push({space_.distance(node), node});
    }
    uint32_t neighbours_in(size_t node) const {
        uint32_t set = 0;
        space_.for_each_neighbour(node, [&](int n, size_t to) { set |= in_[to] ? 1u << n : 0u; });
        return set;
    }

    const FreeSpace& space_;
    std::vector<uint8_t> in_;
    std::priority_queue<Waiting> queue_;
    Checkpoints checkpoints_;
};

// The distance of `p` from an ellipsoid, or a little less; 0 inside. The nearest point x has p - x = t Q^-1 (x - c),
// with Q = L L^T; so x - c = Q w for w = (Q + t I)^-1 (p - c), and |L^T w| = 1. Along any n, p is at least
// n.(p - c) - |L^T n| away, so that an approximate t will do.
double distance_below(const Fit& fit, const Vec& p) {
    const Vec q = p - fit.center;
    if (fit.radial_squared(p) <= 1) return 0;
    const Mat shape = fit.factor * fit.factor.transpose();
    double low = 0, high = fit.factor.norm() * q.norm();
    Vec w = q;
    for (int i = 0; i < kIterations && high - low > 1e-9 * high; ++i) {
        const double t = 0.5 * (low + high);
        w = (shape + t * Mat::Identity()).inverse() * q;
        ((fit.factor.transpose() * w).squaredNorm() > 1 ? low : high) = t;
    }
    w.normalize();
    return std::max(0.0, w.dot(q) - (fit.factor.transpose() * w).norm());
}

} // namespace

Passages::Passages(MeshView mesh, double radius) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    const double side = box.size().maxCoeff();
    const double pitch = std::max(radius / kStepsOfRadius, side / kMostStepsAcross);
    needed_ = radius + 0.5 * std::sqrt(3.0) * pitch;
    const Vec margin = Vec::Constant(needed_ + kRegionMargin * side);
    const Box region{box.low - margin, box.high + margin};
    rounding_ = kCoordinateRounding * std::max(region.low.cwiseAbs().maxCoeff(), region.high.cwiseAbs().maxCoeff());
    needed_ += rounding_;
    const FreeSpace space(TriangleTree(mesh), region, pitch, needed_, 1.5 * needed_);
    Thinning thinning(space, needed_);
    thinning.run();
    thinning.for_each([&](const std::array<int, 3>& at) {
        skeleton_.push_back(space.node(at));
        any_ = any_ || !space.is_border(at);
    });
}

Passages::Nearest Passages::nearest(std::span<const Ellipsoid> cover) const {
    std::vector<Fit> fits;
    std::vector<double> reach; // of each, around its center
    for (const Ellipsoid& e : cover) fits.emplace_back(e), reach.push_back(fits.back().factor.norm());
    std::vector<double> distances(skeleton_.size());
    parallel_for(size_t{0}, skeleton_.size(), [&](size_t i) {
        double least = 4 * needed_; // farther is as good
        for (size_t e = 0; e < fits.size(); ++e)
            if ((skeleton_[i] - fits[e].center).norm() - reach[e] < least)
                least = std::min(least, distance_below(fits[e], skeleton_[i]));
        distances[i] = std::max(0.0, least - rounding_);
    });
    const auto nearest = static_cast<size_t>(std::ranges::min_element(distances) - distances.begin());
    return {distances[nearest], skeleton_[nearest]};
}

} // namespace prolate

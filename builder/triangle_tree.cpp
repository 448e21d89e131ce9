#include "builder/triangle_tree.hpp"

#include "builder/job.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr uint32_t kLeafTriangles = 8;
constexpr uint32_t kTaskTriangles = 8192; // subtrees with more are built in parallel

// A total order along `axis` (triangles that it calls equal are), so that the tree does not depend on the library's
// sorting.
bool before(const TriangleTree::Corners& s, const TriangleTree::Corners& t, int axis) {
    const auto key = [axis](const TriangleTree::Corners& c) {
        return to_vec(c[0])[axis] + to_vec(c[1])[axis] + to_vec(c[2])[axis];
    };
    if (const double ks = key(s), kt = key(t); ks != kt) return ks < kt;
    for (size_t i = 0; i < 3; ++i)
        for (const float Vec3::*k : {&Vec3::x, &Vec3::y, &Vec3::z})
            if (s[i].*k != t[i].*k) return s[i].*k < t[i].*k;
    return false;
}

Vec nearest_point(const Vec& p, const Vec& a, const Vec& b) {
    const Vec edge = b - a;
    const double length = edge.squaredNorm(), along = (p - a).dot(edge);
    return along <= 0 ? a : along >= length ? b : Vec(a + along / length * edge);
}

double squared_distance(const Vec& p, const Box& box) {
    return (box.low - p).cwiseMax(p - box.high).cwiseMax(0.0).squaredNorm();
}

} // namespace

TriangleTree::TriangleTree(MeshView mesh) {
    triangles_.reserve(mesh.triangles.size());
    for (const Triangle& t : mesh.triangles)
        triangles_.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    if (triangles_.empty()) return;
    const auto count = static_cast<uint32_t>(triangles_.size());
    nodes_.resize(2 * ((count - 1) / kLeafTriangles + 1) - 1);
    build(0, 0, count);
}

// All leaves but the last are full, so that the size of a subtree, and with it every node's index, is known beforehand.
void TriangleTree::build(uint32_t index, uint32_t begin, uint32_t end) {
    Node& node = nodes_[index];
    node = {{}, begin, end, 0};
    for (uint32_t t = begin; t < end; ++t)
        for (const Vec3& v : triangles_[t]) node.box.add(to_vec(v));
    int axis = 0;
    node.box.size().maxCoeff(&axis);
    const auto order = [axis](const Corners& s, const Corners& t) { return before(s, t, axis); };
    const auto first = triangles_.begin() + begin, last = triangles_.begin() + end;
    const uint32_t leaves = (end - begin - 1) / kLeafTriangles + 1, left_leaves = (leaves + 1) / 2;
    if (leaves == 1) {
        std::sort(first, last, order);
        return;
    }
    const uint32_t middle = begin + left_leaves * kLeafTriangles;
    std::nth_element(first, triangles_.begin() + middle, last, order);
    node.right = index + 2 * left_leaves;
    const auto left = [=, this] { build(index + 1, begin, middle); };
    const auto right = [=, this] { build(nodes_[index].right, middle, end); };
    if (end - begin > kTaskTriangles) {
        parallel_invoke(left, right);
    } else {
        left();
        right();
    }
}

Vec nearest_point(const Vec& p, const Vec& a, const Vec& b, const Vec& c) {
    const Vec ab = b - a, bc = c - b, ca = a - c, normal = ab.cross(bc);
    const double square = normal.squaredNorm();
    const bool beyond[3] = {normal.dot(ab.cross(p - a)) < 0, normal.dot(bc.cross(p - b)) < 0,
                            normal.dot(ca.cross(p - c)) < 0};
    // The plane of a needle is not to be trusted; its edges are as near as makes no difference.
    const bool needle = square <= 1e-16 * ab.squaredNorm() * bc.squaredNorm();
    if (!needle && !beyond[0] && !beyond[1] && !beyond[2]) return p - normal.dot(p - a) / square * normal;
    // The nearest point lies on an edge that the foot of p is beyond.
    Vec nearest = a;
    const auto consider = [&](const Vec& q) {
        if ((p - q).squaredNorm() < (p - nearest).squaredNorm()) nearest = q;
    };
    if (needle || beyond[0]) consider(nearest_point(p, a, b));
    if (needle || beyond[1]) consider(nearest_point(p, b, c));
    if (needle || beyond[2]) consider(nearest_point(p, c, a));
    return nearest;
}

TriangleTree::Nearest TriangleTree::nearest(const Vec& p, double upper_bound) const {
    struct Entry {
        uint32_t node;
        double square;
    };
    double square = upper_bound * upper_bound;
    Nearest found{upper_bound, p};
    Entry stack[kMaxDepth];
    int top = 0;
    if (!nodes_.empty()) stack[top++] = {0, squared_distance(p, nodes_[0].box)};
    while (top > 0) {
        const Entry entry = stack[--top];
        if (entry.square >= square) continue;
        const Node& node = nodes_[entry.node];
        if (node.right == 0) {
            for (uint32_t t = node.begin; t < node.end; ++t) {
                const auto& [a, b, c] = triangles_[t];
                const Vec point = nearest_point(p, to_vec(a), to_vec(b), to_vec(c));
                const double d = (p - point).squaredNorm();
                if (d < square) square = d, found = {std::sqrt(d), point};
            }
            continue;
        }
        Entry near{entry.node + 1, squared_distance(p, nodes_[entry.node + 1].box)};
        Entry far{node.right, squared_distance(p, nodes_[node.right].box)};
        if (far.square < near.square) std::swap(near, far);
        if (far.square < square) stack[top++] = far;
        if (near.square < square) stack[top++] = near;
    }
    return found;
}

} // namespace prolate

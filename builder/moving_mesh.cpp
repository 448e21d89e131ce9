// A cover says of no leaf which part of the surface it holds. Each point of the surface lies in some leaf, though, and
// so its triangle meets that leaf: a leaf that bounds the motion of all corners of all triangles that meet it holds the
// point wherever it moves, because a point moves by the same convex combination of its corners' displacements.
#include "builder/moving_mesh.hpp"

#include "builder/fit.hpp"
#include "builder/triangle_tree.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr double kMeetingMargin = 1e-9; // of the radial coordinate: triangles as near as this meet, too

Error bad_mesh(const char* what, uint64_t where) {
    return {ErrorCode::bad_mesh, what, where};
}

Result<void> check(const TreeView& tree, const CleanMesh& cleaned) {
    const BakeInfo info = tree.bake_info();
    const auto unsupported = [](const char* what) { return Error{ErrorCode::unsupported, what, 0}; };
    if (tree.is_prefix() || info.inner) return unsupported("only whole trees can deform");
    if (info.fill > 0) return unsupported("a filled solid has another surface than the mesh; bake without fill");
    if (hash(cleaned.mesh.view()) != info.source_hash)
        return bad_mesh("the tree was baked from another mesh, or with another weld tolerance", 0);
    if (cleaned.report.welded_vertices > 0)
        return unsupported("welding moved vertices of this open mesh, so that their modes are not its own; "
                           "join them in the mesh, or bake with a weld tolerance of 0");
    return {};
}

// Positions in an order; -0 is 0, as clean() has it.
using Key = std::array<uint32_t, 3>;
Key key_of(const Vec3& v) {
    return {std::bit_cast<uint32_t>(v.x + 0.0f), std::bit_cast<uint32_t>(v.y + 0.0f),
            std::bit_cast<uint32_t>(v.z + 0.0f)};
}

void make_set(std::vector<uint32_t>& numbers) {
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
}

} // namespace

Result<MovingMesh> MovingMesh::of(const TreeView& tree, MeshView mesh, const Alike& alike) {
    auto cleaned = clean(mesh, tree.bake_info().weld);
    if (!cleaned) return cleaned.error();
    if (const auto sound = check(tree, *cleaned); !sound) return sound.error();
    MovingMesh out;
    out.exact_ = tree.has_triangles();
    if (out.exact_) {
        for (uint32_t v = 0; v < tree.vertex_count(); ++v) out.vertices_.push_back(tree.vertex(v));
        for (uint32_t t = 0; t < tree.triangle_count(); ++t) out.triangles_.push_back(tree.triangle(t));
    } else {
        out.vertices_ = std::move(cleaned->mesh.vertices), out.triangles_ = std::move(cleaned->mesh.triangles);
    }
    if (const auto sound = out.find_sources(mesh, alike); !sound) return sound.error();
    return out;
}

// For each vertex one in its place of the mesh as read; all others there must move alike.
Result<void> MovingMesh::find_sources(MeshView input, const Alike& alike) {
    std::vector<std::pair<Key, uint32_t>> places;
    for (const Triangle& t : input.triangles)
        for (const uint32_t corner : t) places.emplace_back(key_of(input.vertices[corner]), corner);
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    for (size_t i = 1; i < places.size(); ++i) {
        if (places[i].first != places[i - 1].first) continue;
        if (!alike(places[i].second, places[i - 1].second))
            return bad_mesh("vertex moves otherwise than another one in one place, with which it is joined; let them "
                            "move alike",
                            places[i].second);
    }
    for (const Vec3& v : vertices_) {
        const auto found = std::lower_bound(places.begin(), places.end(), std::pair(key_of(v), uint32_t{0}));
        if (found == places.end() || found->first != key_of(v))
            return bad_mesh("the tree was baked from another mesh", source_.size());
        source_.push_back(found->second);
    }
    return {};
}

std::vector<uint32_t> MovingMesh::witnesses() const {
    std::vector<uint32_t> parent(vertices_.size());
    std::iota(parent.begin(), parent.end(), 0u);
    if (exact_) return parent;
    const auto root_of = [&](uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : triangles_) parent[root_of(t[1])] = parent[root_of(t[2])] = root_of(t[0]);
    std::vector<uint32_t> out;
    for (const Triangle& t : triangles_) out.push_back(root_of(t[0]));
    make_set(out);
    return out;
}

// Triangles of `candidates` that come near to the ellipsoid.
std::vector<uint32_t> MovingMesh::meeting(const Ellipsoid& ellipsoid, std::span<const uint32_t> candidates) const {
    const Fit fit(ellipsoid);
    const Vec half = fit.half_extents() * (1 + kMeetingMargin);
    std::vector<uint32_t> out;
    for (const uint32_t t : candidates) {
        Box box;
        for (const uint32_t corner : triangles_[t]) box.add(to_vec(vertices_[corner]));
        if (((box.low - fit.center).array() > half.array()).any() ||
            ((fit.center - box.high).array() > half.array()).any())
            continue;
        const auto corner = [&](size_t i) { return fit.radial(to_vec(vertices_[triangles_[t][i]])); };
        if (nearest_point(Vec::Zero(), corner(0), corner(1), corner(2)).norm() <= 1 + kMeetingMargin) out.push_back(t);
    }
    return out;
}

std::vector<uint32_t> MovingMesh::visit_below(const TreeView& tree, uint32_t node, std::span<const uint32_t> candidates,
                                              const Visit& visit) const {
    std::vector<uint32_t> corners;
    const auto take = [&](uint32_t t) { corners.insert(corners.end(), triangles_[t].begin(), triangles_[t].end()); };
    const bool exact = tree.has_triangles();
    // bound() of a node holds the leaves below it, so what meets them meets it.
    const std::vector<uint32_t> met = exact ? std::vector<uint32_t>() : meeting(tree.bound(node), candidates);
    if (const ChildRange children = tree.children(node); children.count > 0) {
        for (uint32_t c = children.first; c < children.first + children.count; ++c) {
            const std::vector<uint32_t> below = visit_below(tree, c, met, visit);
            corners.insert(corners.end(), below.begin(), below.end());
        }
    } else if (exact) {
        const TriangleRange own = tree.triangles(node);
        for (uint32_t t = own.first; t < own.first + own.count; ++t) take(t);
    } else {
        std::for_each(met.begin(), met.end(), take);
    }
    make_set(corners);
    visit(node, corners);
    return corners;
}

void MovingMesh::for_each_node(const TreeView& tree, const Visit& visit) const {
    std::vector<uint32_t> all(triangles_.size());
    std::iota(all.begin(), all.end(), 0u);
    visit_below(tree, 0, all, visit);
}

} // namespace prolate

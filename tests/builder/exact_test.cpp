// Exact trees: every triangle in its place, the proof, and queries against brute force over all pairs of triangles.
#include "builder/random.hpp"
#include "query/collide/search.hpp"
#include "query/triangle/separation.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "src/hull.hpp"
#include "src/slab.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/bounds.hpp>
#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>
#include <prolate/verify.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>

namespace prolate {
namespace {

using scenes::Point;

Build must_build(const Mesh& mesh, BuildOptions options = {}) {
    options.exact = true;
    auto built = build(mesh.view(), options);
    if (!built) throw std::runtime_error(built.error().what);
    return std::move(*built);
}

// ---- meshes ----

Mesh duplicated() { // more equal triangles than a leaf takes
    Mesh mesh = shapes::tetrahedron();
    for (int i = 0; i < 3; ++i)
        mesh.triangles.insert(mesh.triangles.end(), mesh.triangles.begin(), mesh.triangles.end());
    return mesh;
}
Mesh spiral() { // sizes from 1 to 1e-36: the best splits take off a triangle or two at a time
    Mesh mesh;
    float s = 1;
    for (int i = 0; i < 60; ++i, s *= 0.25f)
        shapes::append(mesh, {{{s, 0, 0}, {0.9f * s, s, 0}, {0, s, s}}, {{0, 1, 2}}});
    return mesh;
}

struct Model {
    const char* name;
    Mesh mesh;
    uint32_t components;
};
void PrintTo(const Model& model, std::ostream* out) {
    *out << model.name;
}

class ExactTreeOf : public testing::TestWithParam<Model> {};

std::array<std::tuple<float, float, float>, 3> positions(const auto& vertex, const Triangle& t) {
    std::array<std::tuple<float, float, float>, 3> out;
    for (size_t i = 0; i < 3; ++i) {
        const Vec3 p = vertex(t[i]);
        out[i] = {p.x, p.y, p.z};
    }
    return out;
}

TEST_P(ExactTreeOf, HoldsEveryTriangleInOneLeafAndAllEllipsoidsAbove) {
    for (const auto& [degree, leaf] : {std::pair{8u, 4u}, {2u, 1u}, {3u, 7u}, {64u, 127u}}) {
        BuildOptions options;
        options.degree = degree, options.leaf_triangles = leaf;
        const Build built = must_build(GetParam().mesh, options);
        const TreeView tree = built.tree.view();
        ASSERT_TRUE(tree.has_triangles() && tree.bake_info().exact);
        EXPECT_EQ(tree.degree(), degree);

        // The mesh's triangles, as they are.
        const CleanMesh clean = *prolate::clean(GetParam().mesh.view());
        std::multiset<std::array<std::tuple<float, float, float>, 3>> expected, held;
        for (const Triangle& t : clean.mesh.triangles)
            expected.insert(positions([&](uint32_t v) { return clean.mesh.vertices[v]; }, t));
        std::vector<uint32_t> parent(tree.slot_count());
        uint32_t triangles = 0;
        tree.for_each_node([&, leaf = leaf](uint32_t n) { // clang cannot capture a binding by reference
            const ChildRange children = tree.children(n);
            EXPECT_NE(children.count, 1u);
            for (uint32_t c = 0; c < children.count; ++c) parent[children.first + c] = n;
            const TriangleRange range = tree.triangles(n);
            EXPECT_LE(range.count, leaf);
            triangles += range.count;
            for (uint32_t t = range.first; t < range.first + range.count; ++t) {
                held.insert(positions([&](uint32_t v) { return tree.vertex(v); }, tree.triangle(t)));
                for (const uint32_t corner : tree.triangle(t)) {
                    const Vec3 v = tree.vertex(corner);
                    const double p[3] = {v.x, v.y, v.z};
                    for (uint32_t node = n;; node = parent[node]) {
                        ASSERT_LE(radial_squared(tree.ellipsoid(node), p), 1) << "node " << node;
                        if (node == 0) break;
                    }
                }
            }
        });
        EXPECT_TRUE(held == expected);
        EXPECT_EQ(triangles, tree.triangle_count());

        const auto proof = verify(tree, GetParam().mesh.view());
        ASSERT_TRUE(proof);
        EXPECT_TRUE(proof->covered && proof->exact);
        EXPECT_EQ(proof->surface_mode, !clean.report.closed);
        EXPECT_EQ(tree.bake_info().surface_mode, !clean.report.closed);
        for (const LevelReport& level : built.levels) EXPECT_TRUE(level.covered);
    }
}

TEST_P(ExactTreeOf, NamesOneVertexOfEachComponent) {
    const Build built = must_build(GetParam().mesh);
    const TreeView tree = built.tree.view();
    EXPECT_EQ(tree.component_count(), GetParam().components);
    std::vector<uint32_t> label(tree.vertex_count());
    std::iota(label.begin(), label.end(), 0u);
    for (bool changed = true; changed;) { // each vertex takes the least label of its neighbours
        changed = false;
        for (uint32_t t = 0; t < tree.triangle_count(); ++t) {
            const auto [a, b, c] = tree.triangle(t);
            const uint32_t least = std::min({label[a], label[b], label[c]});
            for (const uint32_t v : {a, b, c})
                if (label[v] != least) label[v] = least, changed = true;
        }
    }
    for (uint32_t v = 0; v < tree.vertex_count(); ++v) EXPECT_LT(label[v], tree.component_count());
    for (uint32_t v = 0; v < tree.component_count(); ++v) EXPECT_EQ(label[v], v);
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, ExactTreeOf,
    testing::Values(Model{"torus", shapes::torus(1, 0.3f, 48, 24), 1}, Model{"box", shapes::box(1, 2, 3), 1},
                    Model{"two_pieces", shapes::two_pieces(), 2}, Model{"hollow", shapes::hollow_ball(), 2},
                    Model{"sheet", shapes::sheet(1, 1, 40), 1}, // coplanar, and large enough for bins
                    Model{"open_box", shapes::open_box(), 1}, Model{"duplicated", duplicated(), 1},
                    Model{"spiral", spiral(), 60},
                    Model{"one_triangle", Mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}, 1},
                    Model{"micrometres", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {}, 1e-6f), 1},
                    Model{"far_away", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {1e4f, -1e4f, 5e3f}), 1}),
    [](const auto& model) { return std::string(model.param.name); });

TEST(ExactTree, SameBytesForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 96, 48);
    BuildOptions options;
    options.threads = 1;
    const Build one = must_build(mesh, options);
    for (const uint32_t threads : {2u, 8u}) {
        options.threads = threads;
        EXPECT_TRUE(std::ranges::equal(one.tree.bytes(), must_build(mesh, options).tree.bytes()));
    }
}

// Queries test all children of a node in one go: lanes should not stay empty while children could still be divided.
TEST(ExactTree, FillsItsNodes) {
    for (const Mesh& mesh : {shapes::icosphere(3), shapes::torus(1, 0.3f, 37, 19)})
        for (const uint32_t degree : {2u, 5u, 8u, 64u}) {
            BuildOptions options;
            options.degree = degree;
            const Build built = must_build(mesh, options);
            const TreeView tree = built.tree.view();
            std::vector<uint32_t> nodes, below(tree.slot_count()); // triangles
            uint32_t lanes = 0, used = 0;
            tree.for_each_node([&](uint32_t n) { nodes.push_back(n); });
            for (size_t i = nodes.size(); i-- > 0;) { // children come after their parents
                const uint32_t n = nodes[i];
                const ChildRange children = tree.children(n);
                below[n] = tree.triangles(n).count;
                for (uint32_t c = 0; c < children.count; ++c) below[n] += below[children.first + c];
                if (!tree.is_leaf(n)) lanes += std::min(degree, below[n]), used += children.count;
            }
            EXPECT_GT(used, 0.85 * lanes) << degree;
        }
}

uint32_t inner_nodes(const TreeView& tree) {
    uint32_t count = 0;
    tree.for_each_node([&](uint32_t n) { count += !tree.is_leaf(n); });
    return count;
}

TEST(ExactTree, LeavesHoldSeveralTrianglesWhereThatIsCheaper) {
    const auto torus = [](float scale) { return shapes::moved(shapes::torus(1, 0.3f, 96, 48), {}, scale); };
    const Build built = must_build(torus(1));
    const uint32_t inner = inner_nodes(built.tree.view());
    // So many full nodes of 8 would lead down to single triangles.
    EXPECT_LT(inner, (built.tree.view().triangle_count() - 1) / 7);
    // The squares of other scales' widths are beyond a float: still the same tree, up to rounding.
    for (const float scale : {1e-24f, 1e20f})
        EXPECT_NEAR(inner_nodes(must_build(torus(scale)).tree.view()), inner, 0.02 * inner) << scale;
}

TEST(ExactTree, EndsWhereTheFormatDoes) {
    BuildOptions options;
    options.degree = 2, options.leaf_triangles = 1;
    EXPECT_EQ(must_build(spiral(), options).tree.view().level_count(), kMaxLevels); // then parts are halved
}

TEST(ExactTree, CoordinatesHaveALimit) {
    // At the limit everything is finite; beyond it, nothing is baked and nothing opened.
    const auto sized = [](float half) { return shapes::moved(shapes::box(2, 2, 2), {-half, -half, -half}, half); };
    const Mesh largest = sized(kLargestCoordinate);
    const auto beyond = build(sized(kLargestCoordinate * 1.001f).view(), {.exact = true});
    ASSERT_FALSE(beyond);
    EXPECT_EQ(beyond.error().code, ErrorCode::bad_mesh);
    EXPECT_EQ(std::string(beyond.error().what).substr(0, 6), "vertex");

    const Build built = must_build(largest);
    const TreeView tree = built.tree.view();
    std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
    const auto at = static_cast<size_t>(tree.raw().vertices() - tree.bytes().data()) + 12 * 5;
    for (const float bad : {3e38f, -kLargestCoordinate * 1.001f, std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN()}) {
        store_le(bytes.data() + at + 4, bad);
        const auto opened = TreeView::open(bytes, {.check_hash = false});
        ASSERT_FALSE(opened);
        EXPECT_EQ(opened.error().where, at);
    }

    const Build ball = must_build(shapes::moved(shapes::icosphere(2), {}, kLargestCoordinate));
    scenes::Random random(14);
    QueryContext context;
    for (const TreeView& other : {tree, ball.tree.view()})
        for (int i = 0; i < 50; ++i) {
            const Point d = random.direction();
            const double t = double{kLargestCoordinate} * random.in(0, 4);
            const Pose pose{scenes::to_float({t * d[0], t * d[1], t * d[2]}), random.rotation()};
            const auto finite = [](const Vec3& v) {
                return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
            };
            const QueryOptions near{.margin = 0.1f * kLargestCoordinate};
            ContactManifolds m;
            const ContactResult touching = contacts(tree, {}, other, pose, m, context, near);
            EXPECT_EQ(touching.verdict, collide(tree, {}, other, pose, context, near).verdict);
            EXPECT_EQ(m.count > 0, touching.verdict == Verdict::overlapping && !touching.enclosed);
            for (uint32_t k = 0; k < m.count; ++k)
                for (uint32_t p = 0; p < m.manifolds[k].count; ++p) {
                    const ContactPoint& point = m.manifolds[k].points[p];
                    EXPECT_TRUE(finite(m.manifolds[k].normal) && finite(point.point_a) && finite(point.point_b) &&
                                std::isfinite(point.depth));
                }
            const DistanceResult apart = distance(tree, {}, other, pose, context);
            EXPECT_TRUE(std::isfinite(apart.lower) && std::isfinite(apart.upper));
            const float far = 3 * kLargestCoordinate;
            const SweepResult swept = sweep(tree, {}, other, {pose, {far, -far, far}, {1, 2, 3}, {}}, context);
            EXPECT_NE(swept.verdict, Verdict::undecided);
            EXPECT_TRUE(std::isfinite(swept.distance) && finite(swept.point_a) && finite(swept.normal));
            const RaycastResult hit = raycast(other, pose, {{}, scenes::to_float(random.direction())}, context);
            EXPECT_EQ(std::isfinite(hit.t) && finite(hit.point), hit.verdict == Verdict::overlapping);
            EXPECT_NE(overlap(other, pose, Sphere{{}, kLargestCoordinate}, context).verdict, Verdict::undecided);
        }
}

TEST(ExactTree, OptionsAreChecked) {
    const Mesh mesh = shapes::box();
    const auto error_of = [&](auto&& change) {
        BuildOptions options;
        options.exact = true;
        change(options);
        const auto built = build(mesh.view(), options);
        return built ? ErrorCode{} : built.error().code;
    };
    EXPECT_EQ(error_of([](BuildOptions& o) { o.levels = 2; }), ErrorCode::bad_options);
    EXPECT_EQ(error_of([](BuildOptions& o) { o.ellipsoids = 8; }), ErrorCode::bad_options);
    EXPECT_EQ(error_of([](BuildOptions& o) { o.tolerance = 0.1f; }), ErrorCode::bad_options);
    EXPECT_EQ(error_of([](BuildOptions& o) { o.leaf_triangles = 0; }), ErrorCode::bad_options);
    EXPECT_EQ(error_of([](BuildOptions& o) { o.leaf_triangles = 128; }), ErrorCode::bad_options);
    EXPECT_EQ(error_of([](BuildOptions& o) { o.leaf_triangles = 127; }), ErrorCode{});
    BuildOptions proxy, exact, other;
    exact.exact = other.exact = true, other.leaf_triangles = 3;
    EXPECT_EQ((std::set{hash(proxy), hash(exact), hash(other)}).size(), 3u);
    const auto cancelled = build(mesh.view(), exact, [](const BuildProgress&) { return false; });
    ASSERT_FALSE(cancelled);
    EXPECT_EQ(cancelled.error().code, ErrorCode::cancelled);
}

// ---- the proof ----

TEST(ExactTree, TheProofNoticesAnotherMesh) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh);
    const auto covered = [&](const Mesh& other) {
        const VerifyReport report = *verify(built.tree.view(), other.view());
        EXPECT_EQ(report.same_mesh, report.covered);
        return report.covered;
    };
    EXPECT_TRUE(covered(mesh));
    Mesh turned = mesh; // another order of triangles and corners is the same mesh
    std::reverse(turned.triangles.begin(), turned.triangles.end());
    for (Triangle& t : turned.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
    EXPECT_TRUE(covered(turned));
    EXPECT_TRUE(covered(shapes::inverted(mesh))) << "what is inside out is turned, here and in the bake";
    Mesh moved = mesh, fewer = mesh, more = mesh;
    moved.vertices[7].x += 1e-6f;
    fewer.triangles.pop_back();
    more.triangles.push_back({0, 13, 47});
    EXPECT_FALSE(covered(moved));
    EXPECT_FALSE(covered(fewer));
    EXPECT_FALSE(covered(more));
}

TEST(ExactTree, TheProofNoticesNodesThatDoNotHoldTheirTriangles) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh);
    const TreeView tree = built.tree.view();
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        std::vector<uint32_t> nodes;
        tree.for_each_node(l, [&](uint32_t n) { nodes.push_back(n); });
        const uint32_t node = nodes[nodes.size() / 2];
        // Shrinks one node by an exponent.
        std::vector<std::byte> bytes(built.tree.bytes().begin(), built.tree.bytes().end());
        const auto block = static_cast<size_t>(tree.raw().block(node / kBlockLanes) - built.tree.bytes().data());
        std::byte& exponent = bytes[block + kBlockExponent + node % kBlockLanes];
        exponent = std::byte(std::to_integer<int>(exponent) - 1);
        const auto shrunk = TreeView::open(bytes, {.check_hash = false});
        ASSERT_TRUE(shrunk);
        const auto proof = verify(*shrunk, mesh.view());
        ASSERT_TRUE(proof);
        EXPECT_FALSE(proof->covered);
        EXPECT_TRUE(proof->same_mesh);
        for (uint32_t other = 0; other < tree.level_count(); ++other)
            EXPECT_EQ(proof->levels[other].covered, !(other == l || (other > l && tree.is_leaf(node)))) << l << other;
        if (l == 0) {
            EXPECT_TRUE(proof->levels[0].has_counterexample);
            EXPECT_GT(proof->levels[0].depth, 0.1);
        }
    }
}

// How far a node's hull reaches along d, in double: src/FORMAT.md.
double reach(const TreeView& tree, uint32_t node, const std::byte* hull, const Point& d) {
    const Ellipsoid e = tree.ellipsoid(node);
    const double v[] = {e.l11 * d[0] + e.l21 * d[1] + e.l31 * d[2], e.l22 * d[1] + e.l32 * d[2], e.l33 * d[2]};
    double most = -HUGE_VAL;
    for (size_t i = 0; i < kHullPoints; ++i) {
        double along = 0;
        for (size_t k = 0; k < 3; ++k)
            along += v[k] * load_le<int8_t>(hull + kHullPoint + kHullPoints * k + i) / kHullUnit;
        most = std::max(most, along);
    }
    return e.center.x * d[0] + e.center.y * d[1] + e.center.z * d[2] + most +
           load_le<uint8_t>(hull + kHullShare) / kHullShares * std::hypot(v[0], v[1], v[2]);
}

TEST_P(ExactTreeOf, HullsReachAsFarAsTheirTriangles) {
    scenes::Random random(3);
    for (const auto& [degree, leaf] : {std::pair{8u, 4u}, {2u, 1u}, {64u, 127u}}) {
        BuildOptions options;
        options.degree = degree, options.leaf_triangles = leaf;
        const Build built = must_build(GetParam().mesh, options);
        const TreeView tree = built.tree.view();
        uint32_t known = 0;
        const auto corners = [&](const auto& self, uint32_t node, const auto& visit) -> void {
            const TriangleRange range = tree.triangles(node);
            for (uint32_t t = range.first; t < range.first + range.count; ++t)
                for (const uint32_t corner : tree.triangle(t)) visit(tree.vertex(corner));
            const ChildRange children = tree.children(node);
            for (uint32_t i = 0; i < children.count; ++i) self(self, children.first + i, visit);
        };
        tree.for_each_node([&](uint32_t node) {
            const ChildRange children = tree.children(node);
            if (children.count == 0) return;
            const std::byte* const hull = tree.raw().hull(children.first / kBlockLanes);
            if (hull[kHullShare] == std::byte{0}) return;
            ++known;
            for (int i = 0; i < 20; ++i) {
                const Point d = random.direction();
                double most = -HUGE_VAL;
                corners(corners, node,
                        [&](const Vec3& v) { most = std::max(most, v.x * d[0] + v.y * d[1] + v.z * d[2]); });
                const Ellipsoid e = tree.ellipsoid(node);
                const double size = std::hypot(e.center.x, e.center.y, e.center.z) + std::hypot(e.l11, e.l22, e.l33);
                ASSERT_LE(most, reach(tree, node, hull, d) + 1e-15 * size) << "node " << node;
            }
        });
        EXPECT_TRUE(known > 0 || tree.level_count() == 1);
    }
}

TEST(ExactTree, HullsAreClose) {
    const Build built = must_build(shapes::torus(1, 0.3f, 48, 24));
    const TreeView tree = built.tree.view();
    std::vector<int> shares;
    tree.for_each_node([&](uint32_t node) {
        const ChildRange children = tree.children(node);
        if (children.count > 0)
            shares.push_back(std::to_integer<int>(tree.raw().hull(children.first / kBlockLanes)[kHullShare]));
    });
    std::sort(shares.begin(), shares.end());
    EXPECT_GT(shares.front(), 0); // something is known of all nodes
    EXPECT_LT(shares[shares.size() / 2], 0.05 * kHullShares);
    EXPECT_LT(shares.back(), 0.3 * kHullShares);
}

// The bytes of the tree with half the share in the hull of `node`, or with no points but the center.
std::vector<std::byte> with_bad_hull(const Tree& tree, uint32_t node, bool half) {
    const TreeView view = tree.view();
    const std::byte* const from = view.raw().hull(0);
    std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
    std::vector<std::byte> hulls(from, from + view.block_count() * kHullBytes);
    std::byte* const hull = hulls.data() + size_t{view.children(node).first / kBlockLanes} * kHullBytes;
    if (half)
        hull[kHullShare] = std::byte(std::to_integer<unsigned>(hull[kHullShare]) / 2);
    else
        std::fill_n(hull, kHullShare, std::byte{0});
    format::store_hulls(bytes, hulls);
    return bytes;
}

TEST(ExactTree, TheProofNoticesAHullThatIsTooSmall) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh);
    const TreeView tree = built.tree.view();
    for (uint32_t l = 0; l + 1 < tree.level_count(); ++l) {
        uint32_t node = UINT32_MAX;
        tree.for_each_node(l, [&](uint32_t n) {
            if (!tree.is_leaf(n)) node = n;
        });
        for (const bool half : {false, true}) {
            if (half && l > 0) continue; // there the share is mostly what rounding up has added
            const auto bytes = with_bad_hull(built.tree, node, half);
            const auto bad = TreeView::open(bytes);
            ASSERT_TRUE(bad) << bad.error().what;
            const auto proof = verify(*bad, mesh.view());
            ASSERT_TRUE(proof);
            EXPECT_FALSE(proof->covered);
            EXPECT_FALSE(proof->levels[l].covered);
        }
    }
}

// Nodes of an exact tree that have a slab, with all corners below each.
template <class Visit> uint32_t for_each_slab(const TreeView& tree, Visit&& visit) {
    uint32_t count = 0;
    const auto corners = [&](const auto& self, uint32_t node, std::vector<Vec3>& out) -> void {
        const TriangleRange range = tree.triangles(node);
        for (uint32_t t = range.first; t < range.first + range.count; ++t)
            for (const uint32_t corner : tree.triangle(t)) out.push_back(tree.vertex(corner));
        const ChildRange children = tree.children(node);
        for (uint32_t i = 0; i < children.count; ++i) self(self, children.first + i, out);
    };
    tree.for_each_node([&](uint32_t node) {
        const ChildRange children = tree.children(node);
        if (children.count == 0) return;
        const std::byte* const record = tree.raw().hull(children.first / kBlockLanes);
        if (!has_slab(record)) return;
        std::vector<Vec3> below;
        corners(corners, node, below);
        visit(node, slab_of(tree, record), below), ++count;
    });
    return count;
}

Mesh turned(Mesh mesh, const Quat& rotation) {
    for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(rotation, {v.x, v.y, v.z}));
    return mesh;
}

TEST(ExactTree, SlabsHoldTheirTrianglesAndAreThin) {
    scenes::Random random(11);
    const Mesh plate = shapes::box(1, 1, 0.1f), sheet = shapes::sheet(1, 1, 20);
    for (const Mesh& mesh :
         {sheet, turned(sheet, random.rotation()), shapes::moved(turned(sheet, random.rotation()), {3, -5, 7}, 100),
          plate, shapes::icosphere(3)}) {
        const Build built = must_build(mesh);
        const TreeView tree = built.tree.view();
        const uint32_t flat = for_each_slab(tree, [&](uint32_t node, const Slab& slab, const std::vector<Vec3>& below) {
            const Ellipsoid e = tree.ellipsoid(node);
            ASSERT_LT(slab.high - slab.low, 1e-3 * std::hypot(e.l11, e.l21, e.l31));
            for (const Vec3& v : below) {
                const long double p[3] = {v.x, v.y, v.z};
                long double height = 0;
                for (size_t i = 0; i < 3; ++i) height += slab.normal[i] * (p[i] - slab.origin[i]);
                ASSERT_TRUE(slab.low <= height && height <= slab.high);
            }
        });
        if (mesh.triangles.size() == sheet.triangles.size()) {
            const std::byte* const of_root = tree.raw().hull(tree.children(0).first / kBlockLanes);
            EXPECT_TRUE(has_slab(of_root));
            EXPECT_GT(flat, 10u);
        } else if (mesh.triangles.size() > plate.triangles.size()) {
            EXPECT_EQ(flat, 0u); // a ball has no flat sides
        }
    }
}

// The bytes of the tree with the slab of `node` moved up by `by`, metres.
std::vector<std::byte> with_bad_slab(const Tree& tree, uint32_t node, float by) {
    const TreeView view = tree.view();
    const std::byte* const from = view.raw().hull(0);
    std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
    std::vector<std::byte> hulls(from, from + view.block_count() * kHullBytes);
    std::byte* const slab = hulls.data() + size_t{view.children(node).first / kBlockLanes} * kHullBytes;
    for (const size_t at : {kHullLow, kHullHigh}) store_le(slab + at, load_le<float>(slab + at) + by);
    format::store_hulls(bytes, hulls);
    return bytes;
}

TEST(ExactTree, TheProofNoticesASlabBesideItsTriangles) {
    const Mesh mesh = shapes::sheet(1, 1, 20);
    const Build built = must_build(mesh);
    const auto sound = verify(built.tree.view(), mesh.view());
    ASSERT_TRUE(sound && sound->covered);
    for (const float by : {1e-12f, -1e-12f}) {
        const auto bytes = with_bad_slab(built.tree, 0, by);
        const auto bad = TreeView::open(bytes);
        ASSERT_TRUE(bad) << bad.error().what;
        const auto proof = verify(*bad, mesh.view());
        ASSERT_TRUE(proof);
        EXPECT_FALSE(proof->covered || proof->levels[0].covered);
    }
}

TEST(ExactTree, APrefixCoversTheSurface) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh);
    const uint32_t levels = built.tree.view().level_count();
    ASSERT_GE(levels, 4u);
    for (uint32_t l = 0; l < levels; ++l) {
        const auto prefix = TreeView::open(built.tree.bytes().first(built.tree.view().level(l).end_byte));
        ASSERT_TRUE(prefix);
        EXPECT_TRUE(prefix->is_prefix() && prefix->bake_info().exact && !prefix->has_triangles());
        EXPECT_EQ(prefix->level_count(), l + 1);
        EXPECT_EQ(prefix->triangle_count() + prefix->vertex_count() + prefix->component_count(), 0u);
        prefix->for_each_node([&](uint32_t n) { EXPECT_EQ(prefix->triangles(n).count, 0u); });
        if (l == 2) {
            const auto proof = verify(*prefix, mesh.view());
            ASSERT_TRUE(proof);
            EXPECT_TRUE(proof->covered && !proof->exact);
        }
    }
}

// ---- queries ----

struct Query {
    Pose a, b;
};

// Least distance of two triangles of the bodies, by brute force; 0 if some meet.
class Truth {
public:
    Truth(const Mesh& a, const Mesh& b, const Query& q) {
        const auto place = [&](const Mesh& mesh, const Pose& pose) {
            std::vector<reference::Corners> out;
            for (const Triangle& t : mesh.triangles)
                out.push_back(reference::placed({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]}, pose,
                                                q.a.translation));
            return out;
        };
        const auto in_a = place(a, q.a), in_b = place(b, q.b);
        const auto boxes_apart = [&](const reference::Corners& x, const reference::Corners& y) {
            for (size_t k = 0; k < 3; ++k) {
                const auto [x_low, x_high] = std::minmax({x[0][k], x[1][k], x[2][k]});
                const auto [y_low, y_high] = std::minmax({y[0][k], y[1][k], y[2][k]});
                if (x_low > y_high + least || y_low > x_high + least) return true;
            }
            return false;
        };
        for (const auto& x : in_a)
            for (const auto& y : in_b)
                if (!boxes_apart(x, y)) least = std::min(least, reference::distance(x, y));
    }
    static constexpr reference::Real kFar = 0.05L; // farther ones do not matter
    reference::Real least = kFar;
};

CollideResult ask(const Build& a, const Build& b, const Query& q, const QueryOptions& options = {}) {
    QueryContext context;
    return collide(a.tree.view(), q.a, b.tree.view(), q.b, context, options);
}

Query between(scenes::Random& random) {
    const Point d = random.direction();
    return {{{0.1f, 0.2f, 0.3f}, random.rotation()},
            {scenes::to_float({4 * d[0], 4 * d[1], 4 * d[2]}), random.rotation()}};
}
// B on its way to A's place: at `t` = 0 apart, at 1 there.
Query at(const Query& q, double t) {
    const auto mix = [t](float a, float b) { return static_cast<float>(b + t * (double{a} - b)); };
    Query out = q;
    out.b.translation = {mix(q.a.translation.x, q.b.translation.x), mix(q.a.translation.y, q.b.translation.y),
                         mix(q.a.translation.z, q.b.translation.z)};
    return out;
}

struct Body {
    Mesh mesh;
    Build built;
    Body(const Mesh& m) : mesh(m), built(must_build(m)) {}
};
std::vector<Body> bodies() {
    std::vector<Body> out;
    out.emplace_back(shapes::torus(1, 0.3f, 20, 10));
    out.emplace_back(shapes::icosphere(2));
    out.emplace_back(shapes::box(1, 1, 0.1f));
    out.emplace_back(shapes::sheet(1, 1, 6));
    out.emplace_back(shapes::open_box());
    return out;
}

TEST(ExactQuery, AgreesWithBruteForceNearContact) {
    const auto all = bodies();
    scenes::Random random(5);
    uint32_t apart = 0, meeting = 0;
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 6; ++i) {
                const Query start = between(random);
                double near = 0, far = 1; // the first contact of the bisection
                for (int step = 0; step < 22; ++step) {
                    const double middle = (near + far) / 2;
                    (ask(a.built, b.built, at(start, middle)).verdict == Verdict::separated ? near : far) = middle;
                }
                for (const double t :
                     {near - 1e-2, near - 1e-4, near - 1e-6, near, far, far + 1e-6, far + 1e-4, far + 1e-2}) {
                    const Query q = at(start, t);
                    const CollideResult result = ask(a.built, b.built, q);
                    const Truth truth(a.mesh, b.mesh, q);
                    if (truth.least == 0) {
                        ASSERT_EQ(result.verdict, Verdict::overlapping);
                    } else if (truth.least > 1e-11L && !result.enclosed) {
                        ASSERT_EQ(result.verdict, Verdict::separated);
                    }
                    apart += result.verdict == Verdict::separated;
                    if (result.verdict != Verdict::overlapping || result.enclosed) continue;
                    ++meeting;
                    // The triangles that it names meet, and belong to the leaves that it names.
                    const TreeView ta = a.built.tree.view(), tb = b.built.tree.view();
                    const auto named = [](const TreeView& tree, uint32_t node, uint32_t triangle, const Pose& pose,
                                          const Pose& origin) {
                        const TriangleRange range = tree.triangles(node);
                        EXPECT_TRUE(triangle >= range.first && triangle < range.first + range.count);
                        const auto [x, y, z] = tree.triangle(triangle);
                        return reference::placed({tree.vertex(x), tree.vertex(y), tree.vertex(z)}, pose,
                                                 origin.translation);
                    };
                    ASSERT_LT(reference::distance(named(ta, result.pair.node_a, result.pair.triangle_a, q.a, q.a),
                                                  named(tb, result.pair.node_b, result.pair.triangle_b, q.b, q.a)),
                              1e-11L);
                    ASSERT_GT(result.stats.triangle_tests, 0u);
                }
            }
    EXPECT_GT(apart, 400u);
    EXPECT_GT(meeting, 400u);
}

// Flat bodies that are parallel, or nearly: what their slabs say.
struct Flats {
    Body a{shapes::sheet(1, 1, 20)}, b{shapes::sheet(0.8f, 0.8f, 17)};
    // B above A by `gap`, tilted by `tilt` radians, and both turned.
    Query at(scenes::Random& random, double gap, double tilt) const {
        const Quat turn = random.rotation();
        const auto half = static_cast<float>(tilt / 2);
        const Quat own{turn.w * half + turn.x, turn.z * half + turn.y, turn.z - turn.y * half, turn.w - turn.x * half};
        const Point place = scenes::rotate(turn, {random.in(-0.2, 0.4), random.in(-0.2, 0.4), gap});
        return {{{}, turn}, {scenes::to_float(place), own}};
    }
};

TEST(ExactQuery, FlatBodiesAgreeWithBruteForce) {
    const Flats flats;
    scenes::Random random(12);
    QueryContext context;
    uint32_t separated = 0, few = 0, parallel = 0;
    for (int i = 0; i < 200; ++i) {
        const double gap = i % 10 == 0 ? 0 : random.log_in(1e-7, 0.04),
                     tilt = i % 2 == 0 ? 0 : random.log_in(1e-8, 1e-2);
        const Query q = flats.at(random, gap, tilt);
        const TreeView a = flats.a.built.tree.view(), b = flats.b.built.tree.view();
        const auto truth = static_cast<double>(Truth(flats.a.mesh, flats.b.mesh, q).least);
        if (truth >= static_cast<double>(Truth::kFar)) continue;
        const DistanceResult d = distance(a, q.a, b, q.b, context);
        ASSERT_LE(d.lower, truth * (1 + 1e-12));
        ASSERT_GE(d.upper, truth * (1 - 1e-6) - 1e-13);
        ASSERT_LE(d.upper - d.lower, 1e-6 * d.upper + 1e-12);
        const CollideResult c = collide(a, q.a, b, q.b, context);
        if (truth == 0) {
            ASSERT_EQ(c.verdict, Verdict::overlapping);
        } else if (truth > 1e-11) {
            ASSERT_EQ(c.verdict, Verdict::separated);
            ++separated;
        }
        if (tilt == 0 && gap > 1e-6) ++parallel, few += d.stats.tests() < 1000 && c.stats.tests() < 20;
    }
    EXPECT_GT(separated, 100u);
    EXPECT_GT(parallel, 50u);
    EXPECT_EQ(few, parallel); // of 800 x 578 triangles that are equally near
}

// The same of bodies that are flat but for the rounding of their corners: no slab says exactly how far apart they are,
// and floats cannot tell the pairs of triangles from each other.
TEST(ExactQuery, BodiesThatAreFlatButForRoundingAgreeWithBruteForce) {
    scenes::Random random(14);
    const Quat turn = random.rotation();
    const auto turned = [&](Mesh mesh) {
        for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(turn, {v.x, v.y, v.z}));
        return mesh;
    };
    const Body a{turned(shapes::sheet(1, 1, 12))}, b{turned(shapes::sheet(0.8f, 0.8f, 10))};
    QueryContext context;
    uint32_t apart = 0;
    for (int i = 0; i < 100; ++i) {
        const Point place{random.in(-0.2, 0.4), random.in(-0.2, 0.4), random.log_in(1e-7, 0.04)};
        const Query q{{}, {scenes::to_float(scenes::rotate(turn, place)), {}}};
        const auto truth = static_cast<double>(Truth(a.mesh, b.mesh, q).least);
        if (truth >= static_cast<double>(Truth::kFar)) continue;
        const DistanceResult d = distance(a.built.tree.view(), q.a, b.built.tree.view(), q.b, context);
        ASSERT_LE(d.lower, truth * (1 + 1e-12));
        ASSERT_GE(d.upper, truth * (1 - 1e-6) - 1e-13);
        ASSERT_LE(d.upper - d.lower, 1e-6 * d.upper + 1e-12);
        apart += truth > 1e-6;
    }
    EXPECT_GT(apart, 60u);
}

// That these tests would notice slabs that lie beside their triangles.
TEST(ExactQueryHarness, CatchesSlabsThatAreTooThin) {
    const Flats flats;
    scenes::Random random(13);
    QueryContext context;
    uint32_t wrong = 0;
    const auto bytes = with_bad_slab(flats.a.built.tree, 0, -0.1f);
    const TreeView bad = *TreeView::open(bytes);
    for (int i = 0; i < 60; ++i) {
        const Query q = flats.at(random, -1e-3, 1e-2);
        if (Truth(flats.a.mesh, flats.b.mesh, q).least > 0) continue; // they cross beside A
        wrong += collide(bad, q.a, flats.b.built.tree.view(), q.b, context).verdict == Verdict::separated;
    }
    EXPECT_GT(wrong, 5u);
}

// That the test above would notice hulls that are too small.
TEST(ExactQueryHarness, CatchesHullsThatAreTooSmall) {
    const Body a(shapes::icosphere(2)), b(shapes::torus(1, 0.3f, 20, 10));
    const TreeView sound = a.built.tree.view();
    const std::byte* const from = sound.raw().hull(0);
    std::vector<std::byte> bytes(a.built.tree.bytes().begin(), a.built.tree.bytes().end());
    std::vector<std::byte> hulls(from, from + sound.block_count() * kHullBytes);
    for (size_t i = 0; i < hulls.size(); i += kHullBytes) // 0.7 of what they were
        for (size_t k = 0; k < kHullShare; ++k) {
            auto& q = hulls[i + k];
            q = static_cast<std::byte>(static_cast<uint8_t>(static_cast<int8_t>(0.7 * std::to_integer<int8_t>(q))));
        }
    format::store_hulls(bytes, hulls);
    const TreeView small = *TreeView::open(bytes);
    scenes::Random random(6);
    QueryContext context;
    uint32_t wrong = 0;
    for (int i = 0; i < 200; ++i) {
        const Query start = between(random);
        double near = 0, far = 1;
        for (int step = 0; step < 22; ++step) {
            const double middle = (near + far) / 2;
            (ask(a.built, b.built, at(start, middle)).verdict == Verdict::separated ? near : far) = middle;
        }
        const Query q = at(start, far + 1e-3);
        wrong += collide(small, q.a, b.built.tree.view(), q.b, context).verdict == Verdict::separated;
    }
    EXPECT_GT(wrong, 0u);
}

// Bodies that drift past each other, some of them through each other.
TEST(ExactQuery, ACacheChangesNoVerdict) {
    const auto all = bodies();
    scenes::Random random(9);
    uint32_t separated = 0, meeting = 0, untested = 0;
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 4; ++i) {
                const Query start = between(random);
                PairCache cache;
                for (int step = 0; step < 60; ++step) {
                    const Query q = at(start, 0.5 + 0.002 * step);
                    QueryContext context;
                    const CollideResult plain = ask(a.built, b.built, q);
                    const CollideResult cached =
                        collide(a.built.tree.view(), q.a, b.built.tree.view(), q.b, context, {}, &cache);
                    ASSERT_EQ(cached.verdict, plain.verdict) << "step " << step;
                    ++(plain.verdict == Verdict::separated ? separated : meeting);
                    untested += cached.verdict == Verdict::separated && cached.stats.pair_tests == 0;
                    if (cached.verdict != Verdict::separated || cached.stats.pair_tests == 0) continue;
                    // What it promises to keep is really there.
                    const long double least = Truth(a.mesh, b.mesh, q).least;
                    ASSERT_TRUE(least == Truth::kFar || static_cast<long double>(cache.distance) <= least + 1e-11L);
                }
            }
    EXPECT_GT(separated, 500u);
    EXPECT_GT(meeting, 50u);
    EXPECT_GT(untested, separated / 3);
}

TEST(ExactQuery, AMarginIsADistance) {
    const auto all = bodies();
    scenes::Random random(10);
    uint32_t within = 0, beyond = 0;
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 40; ++i) {
                const Query q = at(between(random), random.in(0.3, 0.9));
                const auto least = static_cast<double>(Truth(a.mesh, b.mesh, q).least);
                if (least == 0 || least > 0.99 * static_cast<double>(Truth::kFar) || ask(a.built, b.built, q).enclosed)
                    continue;
                for (const double share : {0.5, 0.999, 1.001, 2.0}) {
                    QueryContext context;
                    const QueryOptions options{.margin = static_cast<float>(share * least)};
                    const bool meets =
                        collide(a.built.tree.view(), q.a, b.built.tree.view(), q.b, context, options).verdict ==
                        Verdict::overlapping;
                    ASSERT_EQ(meets, share > 1) << share;
                    ++(meets ? within : beyond);
                }
            }
    EXPECT_GT(within, 30u);
    EXPECT_GT(beyond, 30u);
}

TEST(ExactQuery, DistanceBoundsHoldTheTruth) {
    const auto all = bodies();
    scenes::Random random(12);
    uint32_t near = 0, meeting = 0;
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 20; ++i) {
                const Query q = at(between(random), random.in(0.3, 0.95));
                const TreeView ta = a.built.tree.view(), tb = b.built.tree.view();
                QueryContext context;
                const DistanceResult result = distance(ta, q.a, tb, q.b, context);
                ASSERT_EQ(result.verdict, ask(a.built, b.built, q).verdict);
                ASSERT_LE(result.lower, result.upper);
                const DistanceResult other = distance(tb, q.b, ta, q.a, context);
                ASSERT_TRUE(other.lower == result.lower && other.upper == result.upper);
                if (result.verdict == Verdict::overlapping) {
                    ASSERT_EQ(result.lower, 0);
                    ++meeting;
                    continue;
                }
                const auto least = static_cast<double>(Truth(a.mesh, b.mesh, q).least);
                if (least > 0.99 * static_cast<double>(Truth::kFar)) {
                    ASSERT_GE(result.upper, 0.99 * least);
                    continue;
                }
                ASSERT_LE(result.lower, least + 1e-11);
                ASSERT_GE(result.upper, least - 1e-11);
                ASSERT_LE(result.upper - result.lower, 2e-6 * result.upper + 1e-9);
                for (const uint64_t budget : {1, 10, 100}) { // anytime
                    const DistanceResult cut = distance(ta, q.a, tb, q.b, context, {.max_pair_tests = budget});
                    ASSERT_TRUE(cut.lower <= least + 1e-11 && cut.upper >= least - 1e-11);
                    ASSERT_LE(cut.stats.pair_tests, budget);
                }
                ++near;
            }
    EXPECT_GT(near, 10u);
    EXPECT_GT(meeting, 100u);
}

// Of bodies with many hulls, apart and on their way to each other.
TEST(ExactQuery, DistancesAndSweepsOfFineBodiesAgreeWithCollisions) {
    scenes::Random random(4);
    const auto dented = [&](Mesh mesh) {
        for (Vec3& v : mesh.vertices) {
            const auto scale = static_cast<float>(random.in(0.95, 1));
            v = {scale * v.x, scale * v.y, scale * v.z};
        }
        return must_build(mesh);
    };
    const Build zoo[] = {dented(shapes::icosphere(3)), dented(shapes::torus(1, 0.3f, 40, 20)),
                         dented(shapes::torus(1, 0.05f, 60, 6))};
    const auto vec = [](const Point& d, double length) {
        return scenes::to_float({length * d[0], length * d[1], length * d[2]});
    };
    QueryContext context;
    int hits = 0;
    for (int i = 0; i < 300; ++i) {
        const TreeView a = zoo[random.below(3)].tree.view(), b = zoo[random.below(3)].tree.view();
        const Motion still{{{}, random.rotation()}, {}, {}, {}};
        const Point from = random.direction(), aside = random.direction();
        const double away = random.in(1.5, 4), way = away * random.in(0.5, 2);
        const Motion moving{{vec(from, away), random.rotation()},
                            vec({0.2 * aside[0] - from[0], 0.2 * aside[1] - from[1], 0.2 * aside[2] - from[2]}, way),
                            vec(random.direction(), random.in(0, 3)),
                            {}};
        const DistanceResult d = distance(a, still.start, b, moving.start, context);
        const auto meet_within = [&](double margin) {
            const QueryOptions options{.margin = static_cast<float>(margin)};
            return collide(a, still.start, b, moving.start, context, options).verdict;
        };
        if (d.lower > 0) {
            EXPECT_EQ(meet_within(d.lower * (1 - 1e-6)), Verdict::separated);
            EXPECT_EQ(meet_within(d.upper * (1 + 1e-6)), Verdict::overlapping);
        }
        const SweepResult r = sweep(a, still, b, moving, context);
        EXPECT_NE(r.verdict, Verdict::undecided);
        hits += r.verdict == Verdict::overlapping && r.time_upper > 0;
        for (int k = 1; k < 16 && r.time_lower > 0; ++k) {
            const double t = r.time_lower * (1 - std::ldexp(1.0, -k));
            EXPECT_EQ(collide(a, still.start, b, pose_at(moving, t), context).verdict, Verdict::separated)
                << i << ' ' << t;
        }
    }
    EXPECT_GT(hits, 100);
}

TEST(ExactQuery, AllPairsAreFoundAndCounted) {
    const auto all = bodies();
    scenes::Random random(11);
    uint32_t several = 0;
    for (const Body& a : all)
        for (const Body& b : all) {
            const Query q = at(between(random), 0.9);
            const TreeView ta = a.built.tree.view(), tb = b.built.tree.view();
            QueryContext context;
            std::vector<MeetingPair> pairs(4096), few(2);
            const CollideAllResult result = collide_all(ta, q.a, tb, q.b, pairs, context);
            ASSERT_EQ(result.verdict, ask(a.built, b.built, q).verdict);
            // Every two triangles that certainly meet are among them, and no two that are certainly apart.
            const query::RelativePose b_to_a = query::relative_pose(q.a, q.b);
            uint64_t expected = 0;
            for (uint32_t i = 0; i < ta.triangle_count(); ++i)
                for (uint32_t j = 0; j < tb.triangle_count(); ++j)
                    expected += !query::separated(query::place(ta, i), query::place(tb, j, b_to_a));
            ASSERT_EQ(result.found, expected);
            several += result.found > 1;
            const CollideAllResult short_one = collide_all(ta, q.a, tb, q.b, few, context);
            ASSERT_EQ(short_one.found, result.found);
            for (size_t i = 0; i < std::min<uint64_t>(few.size(), result.found); ++i) ASSERT_EQ(few[i], pairs[i]);
        }
    EXPECT_GT(several, 4u);
}

TEST(ExactQuery, TouchingAndCoplanarMeet) {
    const Build box = must_build(shapes::box()), sheet = must_build(shapes::sheet(1, 1, 4));
    const auto verdict = [](const Build& a, const Build& b, Vec3 move) { return ask(a, b, {{}, {move, {}}}).verdict; };
    EXPECT_EQ(verdict(box, box, {1, 0, 0}), Verdict::overlapping); // face on face
    EXPECT_EQ(verdict(box, box, {1, 0.5f, 0.25f}), Verdict::overlapping);
    EXPECT_EQ(verdict(box, box, {1, 1, 0}), Verdict::overlapping);  // edge on edge
    EXPECT_EQ(verdict(box, box, {1, 1, -1}), Verdict::overlapping); // corner on corner
    EXPECT_EQ(verdict(box, box, {0, 0, 0}), Verdict::overlapping);
    EXPECT_EQ(verdict(box, box, {1.0000002f, 0, 0}), Verdict::separated);
    EXPECT_EQ(verdict(box, box, {1.0000002f, 1, 0}), Verdict::separated);
    EXPECT_EQ(verdict(sheet, sheet, {0.3f, 0.3f, 0}), Verdict::overlapping);
    EXPECT_EQ(verdict(sheet, sheet, {1, 0, 0}), Verdict::overlapping);
    EXPECT_EQ(verdict(sheet, sheet, {1.0000002f, 0, 0}), Verdict::separated);
    EXPECT_EQ(verdict(sheet, sheet, {0.3f, 0.3f, 1e-7f}), Verdict::separated);
    EXPECT_EQ(verdict(box, sheet, {0.3f, 0.3f, 1}), Verdict::overlapping); // the sheet on a face
    EXPECT_EQ(verdict(box, sheet, {0.3f, 0.3f, -1e-7f}), Verdict::separated);
}

TEST(ExactQuery, SeesOneBodyInsideTheOther) {
    scenes::Random random(6);
    const Build ball = must_build(shapes::icosphere(3)),
                small = must_build(shapes::moved(shapes::icosphere(1), {}, 0.05f)),
                inverted = must_build(shapes::inverted(shapes::icosphere(3))),
                hollow = must_build(shapes::hollow_ball()),
                sheet = must_build(shapes::moved(shapes::sheet(1, 1, 4), {-0.05f, -0.05f, 0}, 0.1f));
    Mesh far_and_near = shapes::moved(shapes::icosphere(1), {3, 0, 0}, 0.05f);
    shapes::append(far_and_near, shapes::moved(shapes::icosphere(1), {}, 0.05f));
    const Build pieces = must_build(far_and_near);
    Mesh cup_mesh = shapes::icosphere(3);
    cup_mesh.triangles.pop_back();
    const Build cup = must_build(cup_mesh);
    const auto enclosed = [&](const Build& outer, const Build& inner, double away) {
        const Point d = random.direction();
        const Query q{{{}, random.rotation()},
                      {scenes::to_float({away * d[0], away * d[1], away * d[2]}), random.rotation()}};
        const CollideResult one = ask(outer, inner, q), other = ask(inner, outer, {q.b, q.a});
        EXPECT_EQ(one.verdict, other.verdict);
        EXPECT_EQ(one.enclosed, other.enclosed);
        EXPECT_EQ(one.enclosed, one.verdict == Verdict::overlapping); // no case of this test has surfaces that meet
        EXPECT_EQ(one.pair.triangle_a, kNoTriangle);
        for (uint32_t level = 0; one.enclosed && level < 3; ++level) // shallow covers do not meet either, and yet
            EXPECT_EQ(ask(outer, inner, q, {.max_level = level}).verdict, Verdict::overlapping);
        return one.enclosed;
    };
    for (int i = 0; i < 20; ++i) {
        EXPECT_TRUE(enclosed(ball, small, 0.5));
        EXPECT_TRUE(enclosed(inverted, small, 0.5));
        EXPECT_TRUE(enclosed(ball, sheet, 0.5));     // an open surface inside a solid
        EXPECT_FALSE(enclosed(hollow, small, 0.5));  // in the cavity
        EXPECT_TRUE(enclosed(hollow, small, 0.895)); // in the wall
        EXPECT_FALSE(enclosed(cup, small, 0.5));     // an open mesh encloses nothing
        EXPECT_TRUE(enclosed(ball, pieces, 0.2));    // one piece of it
    }
}

TEST(ExactQuery, AgainstATreeWithoutTriangles) {
    BuildOptions options;
    options.levels = 2, options.quality = Quality::fast;
    const auto proxy_of = [&](const Mesh& mesh) { return std::move(*build(mesh.view(), options)); };
    const Mesh torus = shapes::torus(1, 0.3f, 20, 10), grain = shapes::moved(shapes::icosphere(1), {}, 0.05f);
    const Build proxy = proxy_of(torus), exact_torus = must_build(torus), exact = must_build(shapes::icosphere(1));
    const TreeView tree = proxy.tree.view(), ball = exact.tree.view();
    scenes::Random random(8);
    uint32_t apart = 0, meeting = 0;
    for (int i = 0; i < 80; ++i) {
        const Query q = at(between(random), random.in(0.3, 0.8));
        const CollideResult result = ask(exact, proxy, q), other = ask(proxy, exact, {q.b, q.a});
        EXPECT_EQ(result.verdict, other.verdict);
        EXPECT_EQ(result.pair.triangle_a, other.pair.triangle_b);
        EXPECT_EQ(result.pair.triangle_b, kNoTriangle);
        // Truth: each leaf ellipsoid against each triangle.
        bool meets = false, unclear = false;
        tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t n) { // its leaves
            for (uint32_t t = 0; t < ball.triangle_count(); ++t) {
                const auto [x, y, z] = ball.triangle(t);
                const auto corners =
                    reference::placed({ball.vertex(x), ball.vertex(y), ball.vertex(z)}, q.a, q.a.translation);
                const auto radius = reference::radius(corners, tree.ellipsoid(n), q.b, q.a.translation);
                meets |= radius < 1;
                unclear |= std::abs(radius - 1) < 1e-9L;
            }
        });
        if (unclear) continue;
        EXPECT_EQ(result.verdict == Verdict::overlapping && !result.enclosed, meets);
        if (meets) {
            EXPECT_NE(result.pair.triangle_a, kNoTriangle);
        }
        apart += !meets, meeting += meets;
    }
    EXPECT_GT(apart, 15u);
    EXPECT_GT(meeting, 15u);

    const Build small = proxy_of(grain);
    const CollideResult inside = ask(exact, small, {{}, {{0.3f, 0, 0}, {}}});
    EXPECT_EQ(inside.verdict, Verdict::overlapping);
    EXPECT_TRUE(inside.enclosed);
    EXPECT_EQ(ask(exact_torus, small, {}).verdict, Verdict::separated); // in the torus' hole
}

TEST(ExactQuery, ABudgetIsExactAndDeeperNeverRevokesSeparated) {
    const auto all = bodies();
    scenes::Random random(9);
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 4; ++i) {
                const Query q = at(between(random), random.in(0.5, 1));
                const CollideResult full = ask(a.built, b.built, q);
                const uint64_t need = full.stats.tests();
                for (uint64_t budget = 0; budget <= need + 1; budget += 1 + budget / 4) {
                    const CollideResult result = ask(a.built, b.built, q, {.max_pair_tests = budget});
                    ASSERT_EQ(result.verdict, budget < need ? Verdict::undecided : full.verdict);
                    ASSERT_LE(result.stats.tests(), std::min(budget, need));
                }
                Verdict before = Verdict::overlapping;
                for (uint32_t level = 0; level < 6; ++level) {
                    const Verdict verdict = ask(a.built, b.built, q, {.max_level = level}).verdict;
                    ASSERT_FALSE(before == Verdict::separated && verdict != Verdict::separated);
                    before = verdict;
                }
                ASSERT_EQ(before, full.verdict);
            }
}

// ---- boxes ----

TEST(ExactQuery, BoxesOfRootsAreNotFartherApartThanWhatTheyHold) {
    const auto all = bodies();
    scenes::Random random(31);
    QueryContext context;
    uint32_t apart = 0, tight = 0;
    for (const Body& a : all)
        for (const Body& b : all)
            for (int i = 0; i < 40; ++i) {
                Query q = at(between(random), random.in(0.3, 2));
                if (i % 2 == 0) q.a.rotation = q.b.rotation = {}; // axes and flats are parallel
                const TreeView ta = *a.built.tree.view().scaled(i % 3 == 0 ? 3.0f : 1.0f), tb = b.built.tree.view();
                const double gap = query::gap_of_boxes(ta, tb, query::relative_pose(q.a, q.b));
                const double distance = prolate::distance(ta, q.a, tb, q.b, context).upper;
                ASSERT_LE(gap, distance);
                apart += gap > 0, tight += gap > 0.99 * distance && gap > 0;
                if (gap > 0) {
                    ASSERT_EQ(collide(ta, q.a, tb, q.b, context).verdict, Verdict::separated);
                }
            }
    EXPECT_GT(apart, 100u);
    EXPECT_GT(tight, 10u);
}

// How much longer than the least one a side of the body's box is, at most; below 0 if it does not hold the body.
double longer_than_need_be(const TreeView& tree, const Pose& pose) {
    const auto rows = scenes::rotation_rows(pose.rotation);
    const Bounds box = bounds(tree, pose);
    const double lower[] = {box.lower.x, box.lower.y, box.lower.z}, upper[] = {box.upper.x, box.upper.y, box.upper.z};
    double longest = 0;
    for (size_t k = 0; k < 3; ++k) {
        double least = HUGE_VAL, most = -HUGE_VAL;
        for (uint32_t v = 0; v < tree.vertex_count(); ++v) { // each belongs to a triangle
            const Vec3 p = tree.vertex(v);
            const double at = rows[k][0] * p.x + rows[k][1] * p.y + rows[k][2] * p.z;
            least = std::min(least, at), most = std::max(most, at);
        }
        if (lower[k] > least || upper[k] < most) return -1;
        longest = std::max(longest, (upper[k] - lower[k]) / (most - least) - 1);
    }
    return longest;
}

TEST(ExactBoxes, AreWithinAPercentOfTheLeastOnes) {
    const std::pair<const char*, Mesh> meshes[] = {
        {"cube", shapes::box()},
        {"plate", shapes::box(10, 10, 0.001f)},
        {"ball", shapes::icosphere(4)},
        {"torus", shapes::torus(1, 0.3f, 60, 30)},
        {"far", shapes::moved(shapes::torus(1, 0.3f, 40, 20), {300, -200, 100})},
        {"pieces", shapes::two_pieces()},
        {"spiral", spiral()}};
    scenes::Random random(1);
    for (const auto& [name, mesh] : meshes) {
        SCOPED_TRACE(name);
        const Build built = must_build(mesh);
        for (int i = 0; i < 200; ++i) {
            const double by =
                longer_than_need_be(built.tree.view(), {{}, i == 0 ? Quat{0, 0, 0, 1} : random.rotation()});
            EXPECT_GE(by, 0);
            EXPECT_LT(by, 0.01);
        }
    }
    const Build sheet = must_build(shapes::sheet(1, 1, 40));
    for (int i = 0; i < 200; ++i) EXPECT_LT(longer_than_need_be(sheet.tree.view(), {{}, random.rotation()}), 0.01);
}

} // namespace
} // namespace prolate

// The picture command: exact silhouettes and sections, inherited hues, colours that tell distances, reproducible
// pixels, refused options.
#include "cli/render/heat.hpp"
#include "cli/render/palette.hpp"
#include "cli/render/panel.hpp"
#include "cli/render/scene_cut.hpp"
#include "cli/render/scene_mesh.hpp"
#include "cli/render/scene_moved.hpp"
#include "cli/render/sheet.hpp"
#include "cli/render/solid.hpp"
#include "src/format.hpp"
#include "tests/query/deform/moving_bodies.hpp"

#include <prolate/tools.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace {

using namespace prolate;
using namespace prolate::cli;
using glm::dmat3;
using glm::dvec3;

struct TestNode {
    double center[3];
    double factor[6]; // l11, l21, l22, l31, l32, l33
    uint8_t children = 0;
};

// `shift` moves all along each axis.
Tree make_tree(const std::vector<std::vector<TestNode>>& levels, uint32_t degree, double shift = 0) {
    const double low[3] = {shift - 4, shift - 4, shift - 4}, high[3] = {shift + 4, shift + 4, shift + 4};
    const format::Lattice lattice = format::lattice_for(low, high);
    std::vector<format::PackedLevel> packed;
    for (const auto& level : levels) {
        auto& to = packed.emplace_back();
        for (const TestNode& node : level) {
            format::PackedNode n;
            const double center[3] = {node.center[0] + shift, node.center[1] + shift, node.center[2] + shift};
            format::quantise(n, lattice, center, node.factor);
            n.child_count = node.children;
            to.nodes.push_back(n);
        }
    }
    BakeInfo info;
    info.solid_volume = 1;
    auto tree = Tree::open(format::encode(info, degree, lattice, packed));
    EXPECT_TRUE(tree) << tree.error().what << " at " << tree.error().where;
    return std::move(*tree);
}

// A root, `degree` children on a circle around it, as many around each of them, and so on.
Tree nested_circles(uint8_t degree, size_t depth = 3, double shift = 0) {
    std::vector<std::vector<TestNode>> levels(depth);
    levels[0].push_back({{0, 0, 0}, {3, 0.5, 2, 0.2, -0.4, 2.5}});
    for (size_t l = 1; l < depth; ++l)
        for (TestNode& parent : levels[l - 1]) {
            parent.children = degree;
            const double s = std::pow(0.4, static_cast<double>(l));
            for (int i = 0; i < degree; ++i) {
                const double a = 2 * std::numbers::pi * i / degree, *c = parent.center;
                levels[l].push_back({{c[0] + 4 * s * std::cos(a), c[1] + 4 * s * std::sin(a), c[2] + s * (i % 2)},
                                     {2 * s, 0.3 * s, 1.6 * s, 0.2 * s, 0.5 * s, 1.4 * s}});
            }
        }
    return make_tree(levels, degree, shift);
}

// Of the cut of a tree at one level, with all that its scene needs.
struct Cut {
    std::vector<uint32_t> nodes;
    Frame frame;
    std::vector<float> growth;
    CutScene scene;

    Cut(const TreeView& tree, uint32_t level) : Cut(tree, level, nodes_of(tree, level)) {}

private:
    static std::vector<uint32_t> nodes_of(const TreeView& tree, uint32_t level) {
        std::vector<uint32_t> nodes;
        tree.for_each_in_cut(level, [&](uint32_t node) { nodes.push_back(node); });
        return nodes;
    }
    static Frame frame_of(const TreeView& tree, const std::vector<uint32_t>& nodes) {
        Box box;
        for (const uint32_t node : nodes) box.add(tree.ellipsoid(node));
        return box.frame();
    }
    static std::vector<float> growth_of(const TreeView& tree) {
        std::vector<float> growth(tree.slot_count());
        node_growth(tree, growth);
        return growth;
    }
    Cut(const TreeView& tree, uint32_t level, std::vector<uint32_t> of)
        : nodes(std::move(of)), frame(frame_of(tree, nodes)), growth(growth_of(tree)),
          scene(tree, level, growth, frame) {}
};

Paint grey() {
    return [](const Hit&, const dvec3&) { return dvec3(0.5); };
}

CleanMesh cleaned(const Mesh& mesh) {
    return *clean(mesh.view());
}

Mesh box_mesh(float half) {
    Mesh mesh;
    for (unsigned i = 0; i < 8; ++i)
        mesh.vertices.push_back({i & 1 ? half : -half, i & 2 ? half : -half, i & 4 ? half : -half});
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return mesh;
}

// Whether the ray meets the ellipsoid, from the shape matrix alone: with o = eye - center, the quadratic form Q^-1 must
// satisfy (d.o)^2 >= (d.d)(o.o - 1). Independent of the renderer's triangular solves.
bool meets(const Ellipsoid& e, const Frame& frame, const Camera& camera, double u, double v) {
    const dmat3 factor = frame.scale * dmat3(e.l11, e.l21, e.l31, 0, e.l22, e.l32, 0, 0, e.l33); // column by column
    const dmat3 inverse = glm::inverse(factor * glm::transpose(factor));
    const dvec3 o = camera.eye - frame(e.center), d = camera.direction(u, v);
    const double dd = glm::dot(d, inverse * d), oo = glm::dot(o, inverse * o), od = glm::dot(o, inverse * d);
    return od * od >= dd * (oo - 1);
}

PanelSettings settings_for(const View& view) {
    PanelSettings s;
    s.camera = make_camera(view);
    s.up = up_vector(view.up);
    s.width = 120;
    s.height = 90;
    s.grid = 4;
    return s;
}

TEST(Render, SilhouetteIsTheEllipsoids) {
    const TestNode tilted = {{0.3, -0.2, 0.5}, {2, 0.7, 0.5, -0.3, 0.8, 1}};
    const TestNode sphere = {{0, 0, 0}, {1, 0, 1, 0, 0, 1}};
    const TestNode needle = {{1, 2, 3}, {0.05, 0.9, 0.04, 1.5, -0.02, 0.06}};
    const TestNode apart[] = {{{-2, 0, 0}, {0.1, 0.6, 0.2, 0.9, 0.5, 0.1}},
                              {{2, 1, -1}, {0.2, -0.5, 0.1, 0.2, 1, 0.1}}};
    for (const std::vector<TestNode>& shapes :
         {std::vector{tilted}, std::vector{sphere}, std::vector{needle}, std::vector{apart[0], needle, apart[1]}}) {
        TestNode root = sphere;
        root.children = static_cast<uint8_t>(shapes.size());
        const Tree tree = make_tree({{root}, shapes}, 3);
        const Cut cut(tree.view(), 1);
        std::vector<Ellipsoid> ellipsoids;
        for (const uint32_t node : cut.nodes) ellipsoids.push_back(tree.view().ellipsoid(node));
        for (const View& view : {View{30, 18, UpAxis::y}, View{-100, -40, UpAxis::z}, View{200, 70, UpAxis::minus_x}}) {
            PanelSettings s = settings_for(view);
            const Window tight = cut.scene.window(s.camera);
            const double du = tight.u1 - tight.u0, dv = tight.v1 - tight.v0;
            s.window = {tight.u0 - 0.1 * du, tight.u1 + 0.1 * du, tight.v0 - 0.1 * dv, tight.v1 + 0.1 * dv};
            PanelImage image;
            s.floor_shadow = view.elevation > 0;
            ASSERT_TRUE(render_panel({.scene = &cut.scene, .paint = grey()}, s, nullptr, image));

            constexpr int kFine = 12;
            int inside = 0, outside = 0, partial = 0;
            for (uint32_t y = 0; y < s.height; ++y)
                for (uint32_t x = 0; x < s.width; ++x) {
                    int hits = 0;
                    for (int i = 0; i <= kFine; ++i)
                        for (int j = 0; j <= kFine; ++j) {
                            const double px = (x + double(i) / kFine) / s.width;
                            const double py = (y + double(j) / kFine) / s.height;
                            const double u = s.window.u0 + px * (s.window.u1 - s.window.u0);
                            const double v = s.window.v1 - py * (s.window.v1 - s.window.v0);
                            hits += std::any_of(ellipsoids.begin(), ellipsoids.end(), [&](const Ellipsoid& e) {
                                return meets(e, cut.frame, s.camera, u, v);
                            });
                        }
                    const double truth = hits / double((kFine + 1) * (kFine + 1));
                    const double seen = image.coverage[size_t{s.width} * y + x];
                    if (truth == 1) {
                        ++inside;
                        ASSERT_EQ(seen, 1) << x << "," << y;
                    } else if (truth == 0) {
                        ++outside;
                        ASSERT_LE(seen, 1 / 16.0) << x << "," << y; // a sliver may slip between the points
                    } else {
                        ++partial;
                        ASSERT_NEAR(seen, truth, 0.3) << x << "," << y;
                    }
                }
            EXPECT_GT(inside, 100);
            EXPECT_GT(outside, 1000);
            EXPECT_GT(partial, 50);
        }
    }
}

// Rays, shadows and points of the runtime's cut, against all of its ellipsoids one by one; also far from the origin.
TEST(Render, CutsAreTracedAsTheirEllipsoids) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto any_point = [&] { return dvec3(normal(random), normal(random), normal(random)); };
    int met = 0, missed = 0, held = 0, shared = 0;
    for (const double shift : {0.0, 5000.0}) {
        const Tree tree = nested_circles(12, 4, shift);
        for (const uint32_t level : {0u, 2u, 3u}) {
            const Cut cut(tree.view(), level);
            for (int n = 0; n < 400; ++n) {
                const dvec3 origin = 2.0 * glm::normalize(any_point()), target = 0.4 * any_point();
                const dvec3 direction = glm::normalize(target - origin);
                double first = HUGE_VAL, least = 1;
                uint32_t deepest = kNothing;
                int holders = 0;
                for (const uint32_t node : cut.nodes) {
                    const Ellipsoid e = tree.view().ellipsoid(node);
                    const dmat3 factor(e.l11, e.l21, e.l31, 0, e.l22, e.l32, 0, 0, e.l33); // column by column
                    const dmat3 to_ball = glm::inverse(cut.frame.scale * factor);
                    const dvec3 c = cut.frame(e.center);
                    const dvec3 o = to_ball * (origin - c), d = to_ball * direction, p = to_ball * (target - c);
                    const double od = glm::dot(o, d), dd = glm::dot(d, d);
                    const double root = std::sqrt(od * od - dd * (glm::dot(o, o) - 1)); // NaN: no hit
                    if (const double t = (-od - root) / dd; t > 0) first = std::min(first, t);
                    if (glm::dot(p, p) < least) least = glm::dot(p, p), deepest = node;
                    holders += glm::dot(p, p) < 1;
                }
                const Hit hit = cut.scene.first_hit(origin, direction, {});
                ASSERT_EQ(hit.id != kNothing, first < HUGE_VAL);
                ASSERT_EQ(cut.scene.blocked(origin, direction, {}), first < HUGE_VAL);
                ASSERT_EQ(cut.scene.place_of(target).id, deepest);
                ++(first < HUGE_VAL ? met : missed);
                held += deepest != kNothing, shared += holders > 1;
                if (first == HUGE_VAL) continue;
                ASSERT_NEAR(hit.distance, first, 2e-3); // where it grazes
                ASSERT_LT(glm::dot(hit.normal, direction), 1e-6);
                // What lies before a part of the ray, or behind it, does not count.
                ASSERT_FALSE(cut.scene.blocked(origin, direction, {0, first - 1e-2}));
                ASSERT_GE(cut.scene.first_hit(origin, direction, {first + 1e-4, HUGE_VAL}).distance, first);
            }
        }
    }
    EXPECT_GT(met, 500);
    EXPECT_GT(missed, 300);
    EXPECT_GT(held, 300);
    EXPECT_GT(shared, 20);
}

// A camera on the z-axis looks at a section across it: every pixel is the colour of what the plane cuts there.
TEST(Render, SectionsShowWhatThePlaneCuts) {
    std::vector<TestNode> balls = {{{-0.6, 0, 0.1}, {1.4, 0, 1.4, 0, 0, 1.4}},
                                   {{0.9, 0.3, -0.2}, {1.2, 0.2, 1, 0.1, 0.3, 1.1}},
                                   {{0, -1, 0}, {0.8, 0.1, 1.2, 0, 0, 0.9}}};
    const Tree tree = make_tree({{{{0, 0, 0}, {3, 0, 3, 0, 0, 3}, 3}}, balls}, 3);
    const Cut cut(tree.view(), 1);
    const Mesh mesh = box_mesh(0.5f);
    const Solid solid(mesh.view(), true);
    const MeshScene mesh_scene(mesh.view(), cut.frame, &solid);
    const std::vector<dvec3> colours = {{0.9, 0.1, 0.1}, {0.1, 0.8, 0.2}, {0.2, 0.1, 0.7}};
    const dvec3 mesh_colour(0.25, 0.5, 0.75);
    const Paint paint = [&](const Hit& hit, const dvec3&) {
        return hit.id == kMeshId ? mesh_colour
                                 : colours[std::find(cut.nodes.begin(), cut.nodes.end(), hit.id) - cut.nodes.begin()];
    };
    PanelSettings s = settings_for({0, 0, UpAxis::y});
    const double height = 0.1; // of the plane, in the model
    s.section = HalfSpace{{0, 0, 1}, (height - cut.frame.center.z) * cut.frame.scale};
    s.window = {-0.2, 0.2, -0.15, 0.15};
    s.floor_shadow = false;
    PanelImage image;
    ASSERT_TRUE(render_panel({.scene = &cut.scene, .paint = paint, .mesh = &mesh_scene}, s, nullptr, image));
    const auto at_plane = [&](double x, double y) { // of the picture, in pixels: what the plane shows there
        const double u = s.window.u0 + x / s.width * (s.window.u1 - s.window.u0);
        const double v = s.window.v1 - y / s.height * (s.window.v1 - s.window.v0);
        const dvec3 d = s.camera.direction(u, v);
        const dvec3 shown = s.camera.eye + (s.section->offset - s.camera.eye.z) / d.z * d;
        const dvec3 p = shown / cut.frame.scale + cut.frame.center;
        if (std::max(std::abs(p.x), std::abs(p.y)) < 0.5) return kMeshId;
        double least = 1;
        uint32_t deepest = kNothing;
        for (const uint32_t node : cut.nodes) {
            const Ellipsoid e = tree.view().ellipsoid(node);
            const dmat3 factor(e.l11, e.l21, e.l31, 0, e.l22, e.l32, 0, 0, e.l33);
            const dvec3 w = glm::inverse(factor) * (p - dvec3(e.center.x, e.center.y, e.center.z));
            if (glm::dot(w, w) < least) least = glm::dot(w, w), deepest = node;
        }
        return deepest;
    };
    int seen[5] = {};
    for (uint32_t y = 0; y < s.height; ++y)
        for (uint32_t x = 0; x < s.width; ++x) {
            const uint32_t id = at_plane(x + 0.5, y + 0.5);
            bool plain = true; // nothing else near, whose outline may be drawn here
            for (int i = -3; i <= 3; ++i)
                for (int j = -3; j <= 3; ++j) plain = plain && at_plane(x + 0.5 + i, y + 0.5 + j) == id;
            if (!plain) continue;
            const glm::vec3 colour = image.colour[size_t{s.width} * y + x];
            if (id == kNothing) {
                // The ellipsoids are widest near the plane, so behind it nothing of them is seen at any distance from
                // it.
                seen[4] += image.coverage[size_t{s.width} * y + x] == 0;
                continue;
            }
            Hit hit;
            hit.id = id;
            ASSERT_LT(glm::distance(dvec3(colour), paint(hit, {})), 1e-5) << x << "," << y;
            ++seen[id == kMeshId ? 3 : std::find(cut.nodes.begin(), cut.nodes.end(), id) - cut.nodes.begin()];
        }
    for (const int count : seen) EXPECT_GT(count, 100);
}

// What is kept of a ray, against the plane itself.
TEST(Render, SectionsClipRays) {
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    const auto any_point = [&] { return dvec3(normal(random), normal(random), normal(random)); };
    int empty = 0, from_outside = 0, to_outside = 0;
    for (int n = 0; n < 1000; ++n) {
        const HalfSpace half{glm::normalize(any_point()), normal(random)};
        const dvec3 o = any_point(), d = any_point();
        const Reach reach = half.clip(o, d);
        empty += reach.empty(), from_outside += reach.from > 0, to_outside += !reach.empty() && reach.to < HUGE_VAL;
        for (const double t : {0.0, 0.3, 1.0, 5.0, 100.0}) {
            const double excess = glm::dot(half.normal, o + t * d) - half.offset;
            if (std::abs(excess) < 1e-9) continue;
            ASSERT_EQ(t >= reach.from && t <= reach.to && !reach.empty(), excess < 0);
        }
    }
    EXPECT_GT(empty, 100);
    EXPECT_GT(from_outside, 100);
    EXPECT_GT(to_outside, 100);
}

// A blue ball around a green box: the box is seen through it, and the paper too.
TEST(Render, OverlaysLetTheMeshBeSeen) {
    const Tree tree = make_tree({{{{0, 0, 0}, {2, 0, 2, 0, 0, 2}}}}, 2);
    const Cut cut(tree.view(), 0);
    const Mesh mesh = box_mesh(0.7f);
    const MeshScene mesh_scene(mesh.view(), cut.frame);
    const Paint paint = [](const Hit& hit, const dvec3&) {
        return hit.id == kMeshId ? dvec3(0, 1, 0) : dvec3(0, 0, 1);
    };
    PanelSettings s = settings_for({30, 20, UpAxis::y});
    s.window = {-0.2, 0.2, -0.15, 0.15};
    s.floor_shadow = false;
    PanelContent content{.scene = &cut.scene, .paint = paint, .mesh = &mesh_scene, .see_through = true};
    PanelImage overlay, solid, alone;
    ASSERT_TRUE(render_panel(content, s, nullptr, overlay));
    content.see_through = false;
    ASSERT_TRUE(render_panel(content, s, nullptr, solid));
    content = {.scene = &mesh_scene, .paint = paint};
    ASSERT_TRUE(render_panel(content, s, nullptr, alone));
    EXPECT_EQ(overlay.coverage, solid.coverage);
    int inside = 0, around = 0;
    for (size_t i = 0; i < overlay.colour.size(); ++i) {
        if (solid.coverage[i] < 1) continue;
        ASSERT_LT(solid.colour[i].g, 0.15f); // gloss
        if (alone.coverage[i] == 1) {
            ++inside;
            ASSERT_LT(overlay.colour[i].r, 0.15f);
            ASSERT_GT(overlay.colour[i].g, 0.3f * alone.colour[i].g);
            ASSERT_LT(overlay.colour[i].g, alone.colour[i].g);
        } else if (alone.coverage[i] == 0) {
            ++around;
            ASSERT_GE(overlay.colour[i].r, solid.colour[i].r - 0.01f); // of the paper
        }
    }
    EXPECT_GT(inside, 300);
    EXPECT_GT(around, 300);
}

TEST(Render, SolidsTellDistances) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> range(-2, 2);
    Mesh open = box_mesh(1);
    const Solid solid(open.view(), true);
    open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 2);
    const Solid without_a_side(open.view(), false);
    int inside = 0;
    for (int n = 0; n < 1000; ++n) {
        const dvec3 p(range(random), range(random), range(random));
        const dvec3 beyond = glm::max(glm::abs(p) - 1.0, 0.0);
        ASSERT_NEAR(solid.outside_distance(p), glm::length(beyond), 1e-6);
        ASSERT_EQ(solid.holds(p), glm::length(beyond) == 0);
        inside += solid.holds(p);
        if (p.z > 0.2 && glm::length(beyond) == 0) { // far from the hole
            ASSERT_TRUE(without_a_side.holds(p));
        }
    }
    EXPECT_GT(inside, 50);
    EXPECT_NEAR(solid.diagonal(), std::sqrt(12.0), 1e-6);
    // A ball of radius 2 around the box: farthest beyond the middles of its sides.
    const Solid::Closeness close = solid.closeness(std::vector<Ellipsoid>{{{0, 0, 0}, 2, 0, 2, 0, 0, 2}});
    EXPECT_NEAR(close.max, 1, 0.01);
    EXPECT_GT(close.mean, 2 - std::sqrt(3));
    EXPECT_LT(close.mean, 1);
}

TEST(Render, WindowTouchesTheSilhouette) {
    const Tree tree = make_tree({{{{0.3, -0.2, 0.5}, {2, 0.7, 0.5, -0.3, 0.8, 1}}}}, 2);
    const Ellipsoid e = tree.view().ellipsoid(0);
    const Cut cut(tree.view(), 0);
    const Frame& frame = cut.frame;
    const Camera camera = make_camera({40, 25, UpAxis::y});
    const Window w = cut.scene.window(camera);
    // No ray beyond an edge meets the ellipsoid, and some ray just within it does.
    const auto any_in_column = [&](double u) {
        bool any = false;
        for (int i = 0; i <= 20000; ++i) any |= meets(e, frame, camera, u, w.v0 + (w.v1 - w.v0) * i / 20000);
        return any;
    };
    const auto any_in_row = [&](double v) {
        bool any = false;
        for (int i = 0; i <= 20000; ++i) any |= meets(e, frame, camera, w.u0 + (w.u1 - w.u0) * i / 20000, v);
        return any;
    };
    constexpr double kStep = 1e-5;
    EXPECT_TRUE(any_in_column(w.u0 + kStep) && any_in_column(w.u1 - kStep));
    EXPECT_FALSE(any_in_column(w.u0 - kStep) || any_in_column(w.u1 + kStep));
    EXPECT_TRUE(any_in_row(w.v0 + kStep) && any_in_row(w.v1 - kStep));
    EXPECT_FALSE(any_in_row(w.v0 - kStep) || any_in_row(w.v1 + kStep));
}

double hue_difference(double a, double b) {
    return std::abs(std::remainder(a - b, 2 * std::numbers::pi));
}

TEST(Render, DescendantsKeepTheHue) {
    for (const uint8_t degree : {uint8_t{2}, uint8_t{8}, uint8_t{13}}) {
        const Tree tree = nested_circles(degree, 4);
        const TreeView view = tree.view();
        const auto colours = node_colours(view);
        ASSERT_EQ(colours.size(), view.slot_count());
        EXPECT_LT(colours[0].chroma, 0.01); // the root is grey
        // The node of level 1 that each node descends from, by its own walk down the tree.
        std::vector<uint32_t> branch(view.slot_count());
        view.for_each_node([&](uint32_t node) {
            const ChildRange range = view.children(node);
            for (uint32_t child = range.first; child < range.first + range.count; ++child)
                branch[child] = node == 0 ? child : branch[node];
            // Siblings of one hue differ in lightness.
            if (node != 0 && range.count > 1) {
                EXPECT_GT(std::abs(colours[range.first].lightness - colours[range.first + 1].lightness), 0.02);
            }
        });
        view.for_each_node([&](uint32_t node) {
            if (node == 0) return;
            const Oklch c = to_oklch(to_linear_rgb(colours[node]));
            const Oklch top = to_oklch(to_linear_rgb(colours[branch[node]]));
            EXPECT_LT(hue_difference(c.hue, top.hue), 0.01) << "node " << node << " below " << branch[node];
            EXPECT_NEAR(c.lightness, top.lightness, 0.1);
            EXPECT_GT(c.chroma, 0.03);
        });
    }
}

TEST(Render, BranchesAreDistinct) {
    for (const uint32_t n : {2u, 8u, 9u, 20u, 64u})
        for (uint32_t i = 0; i < n; ++i)
            for (uint32_t j = 0; j < i; ++j) {
                const Oklch a = to_oklch(to_linear_rgb(branch_colour(i, n)));
                const Oklch b = to_oklch(to_linear_rgb(branch_colour(j, n)));
                const double da = a.chroma * std::cos(a.hue) - b.chroma * std::cos(b.hue);
                const double db = a.chroma * std::sin(a.hue) - b.chroma * std::sin(b.hue);
                // 0.02 is about one just noticeable difference in OKLab.
                EXPECT_GT(std::hypot(a.lightness - b.lightness, da, db), n <= 8 ? 0.1 : 0.02) << i << " " << j;
            }
}

TEST(Render, PaletteMatchesKnownValues) {
    // Okabe and Ito's blue is #0072B2.
    const dvec3 blue = to_linear_rgb(branch_colour(0, 8));
    EXPECT_NEAR(255 * srgb_encode(blue.x), 0x00, 0.5);
    EXPECT_NEAR(255 * srgb_encode(blue.y), 0x72, 0.5);
    EXPECT_NEAR(255 * srgb_encode(blue.z), 0xB2, 0.5);
    // OKLab's own example values: white is (1, 0, 0), red's lightness 0.628.
    EXPECT_NEAR(to_oklch({1, 1, 1}).lightness, 1, 1e-4);
    EXPECT_NEAR(to_oklch({1, 1, 1}).chroma, 0, 1e-4);
    EXPECT_NEAR(to_oklch({1, 0, 0}).lightness, 0.628, 1e-3);
    // A colour outside of sRGB keeps its lightness and hue.
    const Oklch wanted{0.7, 0.4, 2.0}, got = to_oklch(to_linear_rgb(wanted));
    EXPECT_NEAR(got.lightness, wanted.lightness, 1e-3);
    EXPECT_LT(hue_difference(got.hue, wanted.hue), 1e-2);
    EXPECT_LT(got.chroma, 0.3);
}

TEST(Render, HeatRisesInEvenSteps) {
    double before = 0, least = 1, most = 0;
    for (int i = 0; i <= 20; ++i) {
        const double lightness = to_oklch(heat_colour(i / 20.0)).lightness;
        if (i > 0) least = std::min(least, lightness - before), most = std::max(most, lightness - before);
        before = lightness;
    }
    EXPECT_GT(least, 0.02); // always lighter, so that it can be read in grey, ...
    EXPECT_LT(most, 2 * least);
    EXPECT_EQ(heat_colour(-1), heat_colour(0)); // ... and ends at the ends
    EXPECT_EQ(heat_colour(2), heat_colour(1));
    for (const double percent : {0.003, 0.9, 1.0, 1.1, 7.2, 9.9, 120.0}) {
        const double top = HeatScale::round_up(percent);
        EXPECT_GE(top, percent);
        EXPECT_LE(top, 1.6 * percent);
        const HeatScale scale{top, false};
        EXPECT_EQ(scale.share(0), 0);
        EXPECT_EQ(scale.share(top), 1);
        EXPECT_LT(scale.share(top / 3), scale.share(top / 2));
    }
}

SheetOptions small_sheet() {
    SheetOptions o;
    o.width = 320;
    o.height = 200;
    o.levels = {1, 2};
    o.samples = 16;
    return o;
}

Mesh tetrahedron() {
    return {{{-1, -1, -1}, {1, -1, 1}, {-1, 1, 1}, {1, 1, -1}}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}};
}

TEST(Render, SameBytesForAnyNumberOfThreads) {
    const Tree tree = nested_circles(6);
    const CleanMesh mesh = cleaned(tetrahedron());
    std::vector<std::byte> first;
    for (const uint32_t threads : {1u, 2u, 4u, 1u}) {
        SheetOptions o = small_sheet();
        o.threads = threads;
        o.heat = true;
        o.section = SectionPlane{};
        const auto sheet = render_sheet(tree.view(), &mesh, o);
        ASSERT_TRUE(sheet) << sheet.error().what;
        EXPECT_EQ(sheet->rgb.size(), size_t{3} * o.width * o.height);
        const auto png = encode_png(*sheet);
        ASSERT_TRUE(png);
        if (first.empty()) first = *png;
        EXPECT_TRUE(first == *png) << threads << " threads";
    }
    ASSERT_GT(first.size(), 8u);
    EXPECT_EQ(static_cast<char>(first[1]), 'P');
    EXPECT_EQ(static_cast<char>(first[2]), 'N');
    EXPECT_EQ(static_cast<char>(first[3]), 'G');
}

// Of the pixels that are not grey, how many have the hue that belongs to a distance, and is there a legend?
TEST(Render, HeatTellsTheDistance) {
    const double radius = 1.5;
    const Tree tree = make_tree({{{{0, 0, 0}, {radius, 0, radius, 0, 0, radius}}}}, 2);
    Mesh ball; // of radius 1: a fine grid on a sphere
    constexpr int kRings = 30, kAround = 60;
    for (int i = 0; i <= kRings; ++i)
        for (int j = 0; j < kAround; ++j) {
            const double a = std::numbers::pi * i / kRings, b = 2 * std::numbers::pi * j / kAround;
            ball.vertices.push_back({static_cast<float>(std::sin(a) * std::cos(b)),
                                     static_cast<float>(std::sin(a) * std::sin(b)), static_cast<float>(std::cos(a))});
        }
    for (uint32_t i = 0; i < kRings; ++i)
        for (uint32_t j = 0; j < kAround; ++j) {
            const uint32_t a = i * kAround + j, b = i * kAround + (j + 1) % kAround;
            ball.triangles.push_back({a, a + kAround, b});
            ball.triangles.push_back({b, a + kAround, b + kAround});
        }
    const CleanMesh mesh = cleaned(ball);
    const double percent = 100 * (radius - 1) / std::sqrt(12.0);
    for (const double top : {0.0, 4 * percent}) {
        SheetOptions o = small_sheet();
        o.levels = {0};
        o.heat = true;
        o.heat_top = top;
        o.mesh_style = MeshStyle::hidden;
        const auto sheet = render_sheet(tree.view(), &mesh, o);
        ASSERT_TRUE(sheet) << sheet.error().what;
        const HeatScale scale{top > 0 ? top : HeatScale::round_up(percent), false};
        const auto pixel = [&](uint32_t x, uint32_t y) {
            const uint8_t* const p = &sheet->rgb[(size_t{o.width} * y + x) * 3];
            return dvec3(srgb_decode(p[0] / 255.0), srgb_decode(p[1] / 255.0), srgb_decode(p[2] / 255.0));
        };
        // Light scales a colour, and gloss adds grey.
        const auto has_colour = [](const dvec3& seen, const dvec3& c) {
            const dvec3 differences(seen.x - seen.y, seen.y - seen.z, seen.z - seen.x),
                of(c.x - c.y, c.y - c.z, c.z - c.x);
            return glm::length(differences) > 0.02 && glm::dot(glm::normalize(differences), glm::normalize(of)) > 0.999;
        };
        uint32_t legend = 0;
        int right = 0, wrong = 0;
        const dvec3 expected = scale.colour(percent);
        for (uint32_t y = 0; y < o.height; ++y) {
            double lightest = -1;
            int rising = 0;
            for (uint32_t x = 0; x < o.width; ++x) {
                const dvec3 c = pixel(x, y);
                const Oklch lch = to_oklch(c);
                if (lch.chroma > 0.04 && lch.lightness > lightest) lightest = lch.lightness, ++rising;
            }
            if (rising > 60) legend = legend > 0 ? legend : y;
            if (legend > 0) continue;
            for (uint32_t x = 0; x < o.width; ++x)
                if (to_oklch(pixel(x, y)).chroma > 0.04) ++(has_colour(pixel(x, y), expected) ? right : wrong);
        }
        EXPECT_GT(legend, o.height / 2);
        EXPECT_GT(right, 3000);
        EXPECT_LT(wrong, right / 50);
    }
}

// A body that deforms: its cuts hold the mesh as it moves, and rays meet them where they begin.
TEST(Render, MovedScenesHoldTheMesh) {
    const moving::Moving& body = moving::torus();
    const TreeView tree = moving::torus_cover().view();
    scenes::Random random(7);
    for (uint32_t level = 0; level < tree.level_count(); ++level)
        for (int round = 0; round < 4; ++round) {
            const std::vector<float> q = body.random_q(random);
            Box box;
            tree.for_each_in_cut(level, [&](uint32_t node) { box.add(moved_ellipsoid(tree, node, q)); });
            const Frame frame = box.frame();
            const MovedScene scene(tree, level, q, frame);
            const Camera camera = make_camera({});
            const Window window = scene.window(camera);
            for (uint32_t v = 0; v < body.mesh.vertices.size(); v += 7) {
                const moving::Point moved = body.moved(v, q);
                const dvec3 p = (dvec3(moved[0], moved[1], moved[2]) - frame.center) * frame.scale;
                EXPECT_NE(scene.place_of(p).id, kNothing);
                const dvec3 towards = glm::normalize(p - camera.eye);
                const double depth = glm::dot(towards, camera.forward);
                EXPECT_GT(glm::dot(towards, camera.right) / depth, window.u0);
                EXPECT_LT(glm::dot(towards, camera.right) / depth, window.u1);
                EXPECT_LT(glm::dot(camera.up, p), scene.extent(camera.up));
                const Hit hit = scene.first_hit(camera.eye, towards, {});
                ASSERT_NE(hit.id, kNothing);
                EXPECT_LT(hit.distance, glm::distance(p, camera.eye));
                EXPECT_LE(glm::dot(hit.normal, towards), 0);
                EXPECT_EQ(scene.place_of(camera.eye + (hit.distance - 1e-6) * towards).id, kNothing);
                EXPECT_NE(scene.place_of(camera.eye + (hit.distance + 1e-6) * towards).id, kNothing);
                EXPECT_TRUE(scene.blocked(camera.eye, towards, {}));
                EXPECT_FALSE(scene.blocked(camera.eye, towards, {0, hit.distance - 1e-6}));
            }
        }
}

TEST(Render, SheetsShowBodiesAsTheyMove) {
    const moving::Moving& body = moving::torus();
    const TreeView tree = moving::torus_cover().view();
    const CleanMesh mesh = cleaned(body.mesh);
    SheetOptions o = small_sheet();
    o.levels = {tree.level_count() - 1};
    o.mesh_style = MeshStyle::overlay;
    const std::vector<float> most = body.ranges;
    o.at = {most};
    const auto without = render_sheet(tree, &mesh, o);
    ASSERT_TRUE(without) << without.error().what;
    o.displacements = body.displacements; // cleaning has moved no vertex of this mesh
    ASSERT_EQ(mesh.mesh.vertices.size(), body.mesh.vertices.size());
    const auto with = render_sheet(tree, &mesh, o);
    ASSERT_TRUE(with) << with.error().what;
    EXPECT_NE(without->rgb, with->rgb);
    const auto code = [&](auto&& change) {
        SheetOptions changed = o;
        change(changed);
        const auto sheet = render_sheet(tree, &mesh, changed);
        return sheet ? ErrorCode{} : sheet.error().code;
    };
    EXPECT_EQ(code([](SheetOptions& c) { c.at[0].pop_back(); }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& c) { c.at[0][1] *= 1.01f; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& c) { c.at[0][1] = NAN; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& c) { c.displacements.pop_back(); }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& c) { c.heat = true, c.mesh_style = MeshStyle::beside; }), ErrorCode::bad_options);
    o.displacements.clear(), o.mesh_style = MeshStyle::hidden;
    EXPECT_EQ(render_sheet(nested_circles(3).view(), nullptr, o).error().code, ErrorCode::bad_options);
}

// Nothing may be cut off: the outermost pixels are paper, whatever the shape and the view.
TEST(Render, SheetBorderIsPaper) {
    const Tree tree = nested_circles(5);
    for (const View& view :
         {View{30, 18, UpAxis::y}, View{77, 60, UpAxis::x}, View{-20, -30, UpAxis::minus_z}, View{30, 18, UpAxis::z}}) {
        SheetOptions o = small_sheet();
        if (view.up == UpAxis::z) o.width = 100; // the floor shadow reaches beyond a narrow picture
        o.levels = {0};
        o.view = view;
        const auto sheet = render_sheet(tree.view(), nullptr, o);
        ASSERT_TRUE(sheet) << sheet.error().what;
        int ink = 0;
        for (uint32_t y = 0; y < o.height; ++y)
            for (uint32_t x = 0; x < o.width; ++x) {
                const uint8_t value = sheet->rgb[(size_t{o.width} * y + x) * 3];
                ink += value < 200;
                const bool border = x == 0 || y == 0 || x + 1 == o.width || y + 1 == o.height;
                ASSERT_TRUE(!border || value == 255) << x << "," << y;
            }
        EXPECT_GT(ink, 2000);
    }
}

TEST(Render, RefusesBadOptions) {
    const Tree tree = nested_circles(3);
    const auto code = [&tree](auto change) {
        SheetOptions o = small_sheet();
        change(o);
        const auto sheet = render_sheet(tree.view(), nullptr, o);
        return sheet ? ErrorCode{} : sheet.error().code;
    };
    EXPECT_EQ(code([](SheetOptions&) {}), ErrorCode{});
    EXPECT_EQ(code([](SheetOptions& o) { o.width = 0; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.width = 95; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.height = 8193; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.samples = 15; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.samples = 1025; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.levels.clear(); }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.levels = {3}; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.view.elevation = 90; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.view.azimuth = NAN; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) {
                  o.width = o.height = 96;
                  o.levels = {0, 1, 2, 0, 1, 2};
              }),
              ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.heat = true; }), ErrorCode::bad_options); // no mesh
    EXPECT_EQ(code([](SheetOptions& o) { o.mesh_style = MeshStyle::overlay; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.heat_top = -1; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.section = {3, 0.5}; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.section = {0, 1.5}; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.section = {0, NAN}; }), ErrorCode::bad_options);
    SheetOptions both = small_sheet();
    both.heat = true, both.mesh_style = MeshStyle::overlay;
    const CleanMesh mesh = cleaned(tetrahedron());
    EXPECT_EQ(render_sheet(tree.view(), &mesh, both).error().code, ErrorCode::bad_options);
    EXPECT_EQ(code([](SheetOptions& o) { o.progress = [](double) { return false; }; }), ErrorCode::cancelled);
}

} // namespace

// The picture command: exact silhouettes, inherited hues, reproducible pixels, refused options.
#include "cli/render_palette.hpp"
#include "cli/render_sheet.hpp"
#include "src/format.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

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

Tree make_tree(const std::vector<std::vector<TestNode>>& levels, uint32_t degree) {
    const double low[3] = {-4, -4, -4}, high[3] = {4, 4, 4};
    const format::Lattice lattice = format::lattice_for(low, high);
    std::vector<format::PackedLevel> packed;
    for (const auto& level : levels) {
        auto& to = packed.emplace_back();
        for (const TestNode& node : level) {
            format::PackedNode n;
            format::quantise(n, lattice, node.center, node.factor);
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
Tree nested_circles(uint8_t degree, size_t depth = 3) {
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
    return make_tree(levels, degree);
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
        std::vector<Ellipsoid> ellipsoids;
        std::vector<uint32_t> nodes;
        Box box;
        tree.view().for_each_node(1, [&](uint32_t node) {
            nodes.push_back(node);
            box.add(ellipsoids.emplace_back(tree.view().ellipsoid(node)));
        });
        const Frame frame = box.frame();
        const Scene scene(tree.view(), nodes, frame);
        for (const View& view : {View{30, 18, UpAxis::y}, View{-100, -40, UpAxis::z}, View{200, 70, UpAxis::minus_x}}) {
            PanelSettings s = settings_for(view);
            const Window tight = scene.window(s.camera);
            const double du = tight.u1 - tight.u0, dv = tight.v1 - tight.v0;
            s.window = {tight.u0 - 0.1 * du, tight.u1 + 0.1 * du, tight.v0 - 0.1 * dv, tight.v1 + 0.1 * dv};
            PanelImage image;
            s.floor_shadow = view.elevation > 0;
            ASSERT_TRUE(render_panel(scene, std::vector(nodes.size(), dvec3(0.5)), s, nullptr, image));

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
                            hits += std::any_of(ellipsoids.begin(), ellipsoids.end(),
                                                [&](const Ellipsoid& e) { return meets(e, frame, s.camera, u, v); });
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

TEST(Render, WindowTouchesTheSilhouette) {
    const Tree tree = make_tree({{{{0.3, -0.2, 0.5}, {2, 0.7, 0.5, -0.3, 0.8, 1}}}}, 2);
    const Ellipsoid e = tree.view().ellipsoid(0);
    Box box;
    box.add(e);
    const Frame frame = box.frame();
    const Camera camera = make_camera({40, 25, UpAxis::y});
    const Window w = Scene(tree.view(), {0}, frame).window(camera);
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
    const Mesh mesh = tetrahedron();
    std::vector<std::byte> first;
    for (const uint32_t threads : {1u, 2u, 4u, 1u}) {
        SheetOptions o = small_sheet();
        o.threads = threads;
        const auto sheet = render_sheet(tree.view(), mesh.view(), o);
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

// Nothing may be cut off: the outermost pixels are paper, whatever the shape and the view.
TEST(Render, SheetBorderIsPaper) {
    const Tree tree = nested_circles(5);
    for (const View& view :
         {View{30, 18, UpAxis::y}, View{77, 60, UpAxis::x}, View{-20, -30, UpAxis::minus_z}, View{30, 18, UpAxis::z}}) {
        SheetOptions o = small_sheet();
        if (view.up == UpAxis::z) o.width = 100; // the floor shadow reaches beyond a narrow picture
        o.levels = {0};
        o.view = view;
        const auto sheet = render_sheet(tree.view(), std::nullopt, o);
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
        const auto sheet = render_sheet(tree.view(), std::nullopt, o);
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
    EXPECT_EQ(code([](SheetOptions& o) { o.progress = [](double) { return false; }; }), ErrorCode::cancelled);
}

} // namespace

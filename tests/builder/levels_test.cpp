// Trees of a number of levels: their leaves against flat sets of the same number, for solids that few ellipsoids fit
// badly and many fit well.
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/shapes.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace prolate {
namespace {

Mesh shell() { // free in the middle up to 0.894
    Mesh mesh = shapes::icosphere(3);
    shapes::append(mesh, shapes::inverted(shapes::moved(shapes::icosphere(3), {}, 0.9f)));
    return mesh;
}

// Many of `part` in the unit cube.
Mesh strewn(const Mesh& part, int count) {
    Mesh mesh;
    scenes::Random random(3);
    const auto anywhere = [&] { return static_cast<float>(random.in(0, 1)); };
    for (int i = 0; i < count; ++i) {
        const float x = anywhere(), y = anywhere(), z = anywhere();
        shapes::append(mesh, shapes::moved(part, {x, y, z}));
    }
    return mesh;
}

struct Model {
    const char* name;
    Mesh mesh;
};
void PrintTo(const Model& model, std::ostream* out) {
    *out << model.name;
}

class LevelsOf : public testing::TestWithParam<Model> {};

TEST_P(LevelsOf, LeavesAreAboutAsTightAsAFlatSet) {
    double product = 1; // of the ratios: one seed's sets of loose parts may be twice as tight as another's
    for (const uint64_t seed : {1, 2, 3}) {
        BuildOptions options = quick(2);
        options.seed = seed;
        const Build built = must_build(GetParam().mesh, options);
        const TreeView tree = built.tree.view();
        const LevelReport& leaves = built.levels.back();
        EXPECT_TRUE(built.goal_reached);
        EXPECT_EQ(built.levels.size(), 3u);
        EXPECT_GT(leaves.nodes, 32u);
        tree.for_each_node([&](uint32_t n) { EXPECT_LE(tree.children(n).count, options.degree); });
        options.levels = 0, options.ellipsoids = leaves.nodes;
        const LevelReport flat = must_build(GetParam().mesh, options).levels.back();
        product *= built.solid_volume > 0 ? leaves.outside_ratio / flat.outside_ratio
                                          : leaves.union_volume / flat.union_volume;
    }
    EXPECT_LE(std::cbrt(product), 1.3);
}

INSTANTIATE_TEST_SUITE_P(Meshes, LevelsOf,
                         testing::Values(Model{"shell", shell()}, Model{"sheet", shapes::box(1, 1, 1e-4f)},
                                         Model{"loose_boxes", strewn(shapes::box(0.03f, 0.03f, 0.03f), 200)},
                                         Model{"loose_rods", strewn(shapes::box(0.4f, 0.01f, 0.01f), 60)},
                                         Model{"scan_of_loose_parts", strewn(shapes::sheet(0.1f, 0.05f, 2), 60)}),
                         [](const auto& model) { return std::string(model.param.name); });

TEST(Levels, AShellIsNotFilled) {
    const Build built = must_build(shell(), quick(0)); // as many levels as there are by default
    EXPECT_EQ(built.levels.size(), 4u);
    QueryContext context;
    EXPECT_EQ(overlap(built.tree.view(), {}, Sphere{{}, 0.85f}, context).verdict, Verdict::separated);
    EXPECT_EQ(overlap(built.tree.view(), {}, Sphere{{}, 0.95f}, context).verdict, Verdict::overlapping);
}

} // namespace
} // namespace prolate

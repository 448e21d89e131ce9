// The .etree format: golden bytes, every truncation, every single-byte change, decoding and quantising, files.
//
// The expected numbers are the format's (src/FORMAT.md). If one of these tests fails because the layout changed, the
// format version must change too, and the old golden file stays.
#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "src/hull.hpp"
#include "src/slab.hpp"
#include "tests/scenes.hpp"

#include <prolate/tree.hpp>
#include <prolate/types.hpp>
#include <prolate/version.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>
#include <sys/stat.h>

namespace prolate {
namespace {

namespace fs = std::filesystem;
using format::Lattice;
using format::PackedLevel;
using format::PackedNode;
using scenes::Random;
using Bytes = std::vector<std::byte>;

constexpr OpenOptions kNoHash{.check_hash = false};
constexpr size_t kTable = 304, kRow = 60;
constexpr size_t kBounding = 512;               // of the golden tree: 304 + 3 * 60 and zeros up to a multiple of 64
constexpr size_t kBlocks = kBounding + 2 * 256; // of the exact one, which has no bounding blocks, kBounding
constexpr size_t kBlock1 = kBlocks + 256, kBlock2 = kBlock1 + 256, kEnd = kBlock2 + 256, kGoldenBlocks = 3;
constexpr size_t kExactBlock1 = kBounding + 256, kExactBlock2 = kExactBlock1 + 256, kExactEnd = kExactBlock2 + 256;
constexpr size_t kGoldenHash = kExactEnd + kGoldenBlocks * 64; // what follows its hulls
constexpr Lattice kGoldenLattice{{-30, 7, 1000}, -4};

std::vector<PackedLevel> golden_levels() {
    std::vector<PackedLevel> levels(3);
    levels[0] = {{{.center = {10, 20, 30},
                   .fraction = {16, 1, 31},
                   .diagonal = {40000, 50000, 60000},
                   .off_diagonal = {-1000, 2000, -3000},
                   .exponent = 1,
                   .child_count = 2}},
                 {2.5, 0.125, 2.5, 43.75, 0.75, 0.625, 0.25, 0.5}};
    levels[1] = {{{.center = {0, 0, 0},
                   .fraction = {0, 8, 3},
                   .diagonal = {1, 2, 65535},
                   .off_diagonal = {32767, -32768, 0},
                   .exponent = 0,
                   .child_count = 3},
                  {.center = {65535, 1, 2}, .diagonal = {300, 200, 100}, .exponent = -7}},
                 {1.25, 0.0625, 1.5, 28.125, 0.5, 0.375, 0.125, 0.3125}};
    levels[2] = {{{.center = {1, 2, 3}, .diagonal = {33000, 34000, 35000}, .exponent = -3},
                  {.center = {4, 5, 6}, .diagonal = {36000, 37000, 38000}, .exponent = -4},
                  {.center = {7, 8, 9}, .diagonal = {39000, 40000, 41000}, .exponent = -5}},
                 {.union_volume = 1e300, .surface_error = 0.25}};
    return levels;
}
// The same tree with triangles in its leaves: a tetrahedron, and one triangle apart from it.
constexpr Vec3 kGoldenVertices[] = {{0, 0, 0}, {5, 5, 5}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {6, 5, 5}, {5, 6, 5}};
constexpr Triangle kGoldenTriangles[] = {{1, 5, 6}, {0, 3, 2}, {0, 2, 4}, {0, 4, 3}, {2, 3, 4}};
constexpr uint32_t kGoldenSlots[] = {0, 8, 9, 16, 17, 18}; // its nodes: one block a level
constexpr uint8_t kGoldenLeaves[] = {1, 2, 1, 1};          // triangles of the last four, which are the leaves

BakeInfo golden_info() {
    return {.source_hash = 0x0123456789abcdefu,
            .options_hash = 0xfedcba9876543210u,
            .surface_mode = true,
            .proved = true,
            .goal_reached = false,
            .solid_volume = 12.5,
            .solid_volume_error = 0.03125f,
            .mass = {12.25, {1, -2, 3}, {4, 5, 6, -0.5, 0.25, -0.125}, 0.0625, 0.03125, 0.015625},
            .diagonal = 17.25,
            .method = Method::analytic,
            .primitive = Primitive::ellipsoid,
            .quality = Quality::best,
            .alpha = 0.25f,
            .beta = 0.75f,
            .tolerance = 0.125f,
            .distance = 1.5f,
            .levels = 2,
            .ellipsoids = 9,
            .seed = 42,
            .resolution = 96,
            .placement = {{0.001, -0.001, 0.001}, {500000, -0.5, 5400000}},
            .weld = 0.0625f};
}
Bytes golden() {
    return format::encode(golden_info(), 3, kGoldenLattice, golden_levels());
}
Bytes golden_exact() {
    BakeInfo info = golden_info();
    info.exact = true;
    auto levels = golden_levels();
    levels[1].nodes[1].triangle_count = kGoldenLeaves[0];
    for (size_t i = 0; i < 3; ++i) levels[2].nodes[i].triangle_count = kGoldenLeaves[i + 1];
    Bytes bytes = format::encode(info, 3, kGoldenLattice, levels, {kGoldenVertices, kGoldenTriangles, 2});
    Bytes hulls(kGoldenBlocks * kHullBytes); // block 1: the root's children
    for (size_t i = 0; i < 48; ++i) hulls[kHullBytes + i] = static_cast<std::byte>((5 * i + 136) % 256);
    hulls[kHullBytes + 48] = std::byte{17};
    std::byte* const slab = hulls.data() + kHullBytes; // not one that its triangles lie in
    store_le(slab + kHullNormal + 1, int8_t{-127});
    store_le(slab + kHullPlane, uint32_t{2});
    store_le(slab + kHullLow, -0.25f), store_le(slab + kHullHigh, 0.5f);
    format::store_hulls(bytes, hulls);
    return bytes;
}

Bytes read(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto* const data = reinterpret_cast<const std::byte*>(text.data());
    return {data, data + text.size()};
}

// PROLATE_WRITE_GOLDEN=1 format_test --gtest_filter=Format.Golden* writes the files anew, for a new version.
Bytes golden_file(const char* name, const Bytes& now) {
    const fs::path path = fs::path(PROLATE_TEST_DATA) / name;
    if (std::getenv("PROLATE_WRITE_GOLDEN") != nullptr) {
        EXPECT_TRUE(save(path.c_str(), now));
    }
    return read(path);
}

// A copy in an allocation of exactly its size, so that a read beyond the end is seen by AddressSanitizer.
struct Exact {
    explicit Exact(std::span<const std::byte> from) : size(from.size()), data(new std::byte[from.size()]) {
        if (size) std::memcpy(data.get(), from.data(), size);
    }
    std::span<const std::byte> bytes() const { return {data.get(), size}; }
    size_t size;
    std::unique_ptr<std::byte[]> data;
};

void expect_finite(const Ellipsoid& e) {
    for (const float x : {e.center.x, e.center.y, e.center.z, e.l11, e.l21, e.l22, e.l31, e.l32, e.l33})
        ASSERT_TRUE(std::isfinite(x));
    ASSERT_TRUE(e.l11 > 0 && e.l22 > 0 && e.l33 > 0);
    ASSERT_TRUE(std::isfinite(volume(e)) && volume(e) > 0);
    const PrincipalAxes axes = principal_axes(e);
    for (const double r : axes.radii) ASSERT_TRUE(std::isfinite(r));
}

// Everything an accessor can answer about an opened tree is in range.
void expect_sound(const TreeView& tree) {
    ASSERT_GE(tree.level_count(), 1u);
    ASSERT_LE(tree.level_count(), kMaxLevels);
    uint32_t nodes = 0, blocks = 0;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelInfo level = tree.level(l);
        ASSERT_EQ(level.first_slot, kBlockLanes * blocks);
        ASSERT_TRUE(tree.is_node(level.first_slot));
        uint32_t seen = 0;
        tree.for_each_node(l, [&](uint32_t) { ++seen; });
        ASSERT_EQ(level.node_count, seen);
        nodes += level.node_count;
        blocks += level.block_count;
        for (const double figure :
             {level.outside_ratio, level.outside_ratio_error, level.sum_outside_ratio, level.union_volume,
              level.surface_error, level.hausdorff_max, level.hausdorff_mean, level.hausdorff_p99})
            ASSERT_TRUE(std::isnan(figure) || (std::isfinite(figure) && figure >= 0));
        ASSERT_LE(level.end_byte, tree.bytes().size());
        ASSERT_EQ(tree.bytes().data() + level.end_byte, tree.raw().block(0) + kBlockBytes * blocks);
    }
    ASSERT_EQ(nodes, tree.node_count());
    ASSERT_EQ(blocks, tree.block_count());
    ASSERT_EQ(tree.slot_count(), kBlockLanes * blocks);
    ASSERT_EQ((tree.raw().block(0) - tree.bytes().data()) % 64, 0);
    const BakeInfo info = tree.bake_info();
    ASSERT_EQ(tree.has_triangles(), info.exact && !tree.is_prefix());
    uint32_t children_seen = 0, next_block = 1, next_triangle = 0;
    for (uint32_t n = 0; n < tree.slot_count(); ++n) {
        if (!tree.is_node(n)) continue;
        expect_finite(tree.ellipsoid(n));
        expect_finite(tree.bound(n));
        ASSERT_TRUE(!tree.is_leaf(n) || tree.bound(n) == tree.ellipsoid(n));
        const ChildRange children = tree.children(n);
        const TriangleRange triangles = tree.triangles(n);
        ASSERT_LE(children.count, tree.degree());
        ASSERT_LE(triangles.count, kMaxLeafTriangles);
        ASSERT_EQ(triangles.count > 0, tree.has_triangles() && children.count == 0);
        if (triangles.count > 0) {
            ASSERT_EQ(triangles.first, next_triangle);
            next_triangle += triangles.count;
        }
        if (children.count == 0) continue;
        ASSERT_EQ(children.first, kBlockLanes * next_block);
        const uint32_t its_blocks = (children.count + kBlockLanes - 1) / kBlockLanes;
        for (uint32_t i = 0; i < kBlockLanes * its_blocks; ++i)
            ASSERT_EQ(tree.is_node(children.first + i), i < children.count);
        children_seen += children.count;
        next_block += its_blocks;
    }
    ASSERT_EQ(children_seen + 1, nodes);
    ASSERT_EQ(next_block, blocks);
    ASSERT_EQ(next_triangle, tree.triangle_count());
    ASSERT_LE(tree.component_count(), tree.vertex_count());
    for (uint32_t v = 0; v < tree.vertex_count(); ++v) {
        const Vec3 p = tree.vertex(v);
        ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
    for (uint32_t t = 0; t < tree.triangle_count(); ++t)
        for (const uint32_t corner : tree.triangle(t)) ASSERT_LT(corner, tree.vertex_count());
    ASSERT_TRUE(std::isfinite(info.alpha) && std::isfinite(info.beta) && std::isfinite(info.tolerance));
    ASSERT_TRUE(info.method <= Method::analytic && info.primitive <= Primitive::sphere &&
                info.quality <= Quality::best);
}

TEST(Format, GoldenExactFile) {
    const Bytes file = golden_file("golden_v8_exact.etree", golden_exact());
    ASSERT_EQ(file.size(), kGoldenHash + 8 + 7 * 12 + 5 * 6);
    EXPECT_EQ(golden_exact(), file);
    const auto tree = TreeView::open(file);
    ASSERT_TRUE(tree) << tree.error().what;
    expect_sound(*tree);
    EXPECT_TRUE(tree->has_triangles() && tree->bake_info().exact && !tree->is_prefix());
    EXPECT_EQ(tree->component_count(), 2u);
    ASSERT_EQ(tree->vertex_count(), std::size(kGoldenVertices));
    for (uint32_t v = 0; v < tree->vertex_count(); ++v) EXPECT_EQ(tree->vertex(v), kGoldenVertices[v]);
    ASSERT_EQ(tree->triangle_count(), std::size(kGoldenTriangles));
    for (uint32_t t = 0; t < tree->triangle_count(); ++t) EXPECT_EQ(tree->triangle(t), kGoldenTriangles[t]);
    EXPECT_EQ(tree->triangles(0).count, 0u);
    for (size_t i = 0; i < 4; ++i) {
        EXPECT_TRUE(tree->is_leaf(kGoldenSlots[i + 2]));
        EXPECT_EQ(tree->triangles(kGoldenSlots[i + 2]).count, kGoldenLeaves[i]);
    }
    EXPECT_EQ(tree->triangles(17).first, 3u);
    EXPECT_EQ(tree->raw().hull(1), tree->bytes().data() + kExactEnd + 64);
    EXPECT_EQ(tree->raw().hull(1)[1], std::byte{141});
    EXPECT_EQ(tree->raw().hull(1)[48], std::byte{17});
    EXPECT_EQ(tree->raw().hull(2)[48], std::byte{0});
    ASSERT_TRUE(has_slab(tree->raw().hull(1)) && !has_slab(tree->raw().hull(2)));
    const Slab slab = slab_of(*tree, tree->raw().hull(1)); // in the plane of triangle 2: 0, 2, 4
    EXPECT_EQ(slab.low, -0.25);
    EXPECT_EQ(slab.high, 0.5);
    const double apart[3] = {0, 0.75, 0};
    EXPECT_EQ(std::abs(slab.height(apart)), 0.75);
}

TEST(Format, IndicesTakeFourBytesFromVertex65536On) {
    for (const uint32_t count : {65536u, 65537u}) {
        std::vector<Vec3> vertices(count);
        for (uint32_t v = 0; v < count; ++v) vertices[v].x = static_cast<float>(v);
        const Triangle triangle{count - 1, 0, 1};
        BakeInfo info;
        info.exact = true;
        PackedLevel root{{{.triangle_count = 1}}};
        const Bytes bytes = format::encode(info, 8, {}, std::span(&root, 1), {vertices, std::span(&triangle, 1), 1});
        EXPECT_EQ(bytes.size(), 384 + 256 + 64 + 8 + 12 * count + (count > 65536 ? 12 : 6));
        const auto tree = TreeView::open(bytes);
        ASSERT_TRUE(tree) << tree.error().what;
        EXPECT_EQ(tree->triangle(0), triangle);
        EXPECT_EQ(tree->vertex(count - 1).x, static_cast<float>(count - 1));
    }
}

TEST(Format, GoldenFile) {
    const Bytes file = golden_file("golden_v8.etree", golden());
    ASSERT_EQ(file.size(), kEnd);
    EXPECT_EQ(golden(), file);
    const auto tree = TreeView::open(file);
    ASSERT_TRUE(tree) << tree.error().what;
    expect_sound(*tree);
    EXPECT_EQ(tree->node_count(), 6u);
    EXPECT_EQ(tree->block_count(), 3u);
    for (uint32_t slot = 0; slot < 24; ++slot)
        EXPECT_EQ(tree->is_node(slot), std::ranges::count(kGoldenSlots, slot) == 1) << slot;
    EXPECT_EQ(tree->raw().block(1), file.data() + kBlock1);
    EXPECT_TRUE(std::ranges::equal(tree->raw().lattice().origin, kGoldenLattice.origin));
    EXPECT_EQ(tree->raw().lattice().step_exponent, kGoldenLattice.step_exponent);
    EXPECT_EQ(tree->level_count(), 3u);
    EXPECT_EQ(tree->degree(), 3u);
    EXPECT_FALSE(tree->is_prefix());
    // By hand: (origin + q + f / 32) / 16, d^2 2^(e - 30), o |o| 2^(e - 30).
    EXPECT_EQ(tree->ellipsoid(0), (Ellipsoid{{-19.5f / 16, (27 + 1 / 32.f) / 16, (1030 + 31 / 32.f) / 16},
                                             4e4f * 4e4f * 0x1p-29f,
                                             -1e3f * 1e3f * 0x1p-29f,
                                             5e4f * 5e4f * 0x1p-29f,
                                             2e3f * 2e3f * 0x1p-29f,
                                             -3e3f * 3e3f * 0x1p-29f,
                                             6e4f * 6e4f * 0x1p-29f}));
    EXPECT_EQ(tree->ellipsoid(8), (Ellipsoid{{-30 / 16.f, 7.25f / 16, (1000 + 3 / 32.f) / 16},
                                             0x1p-30f,
                                             32767.f * 32767.f * 0x1p-30f,
                                             4 * 0x1p-30f,
                                             -1.f,
                                             0.f,
                                             65535.f * 65535.f * 0x1p-30f}));
    EXPECT_EQ(tree->children(0).first, 8u);
    EXPECT_EQ(tree->children(8).first, 16u);
    EXPECT_EQ(tree->children(8).count, 3u);
    EXPECT_TRUE(tree->is_leaf(9));
    EXPECT_EQ(tree->level(1).first_slot, 8u);
    EXPECT_EQ(tree->level(1).block_count, 1u);
    EXPECT_EQ(tree->level(1).node_count, 2u);
    EXPECT_EQ(tree->level(1).end_byte, kBlock2);
    const LevelInfo level = tree->level(1);
    EXPECT_EQ(level.outside_ratio, 1.25);
    EXPECT_EQ(level.outside_ratio_error, 0.0625);
    EXPECT_EQ(level.sum_outside_ratio, 1.5);
    EXPECT_EQ(level.union_volume, 28.125);
    EXPECT_EQ(level.surface_error, 0.5);
    EXPECT_EQ(level.hausdorff_max, 0.375);
    EXPECT_EQ(level.hausdorff_mean, 0.125);
    EXPECT_EQ(level.hausdorff_p99, 0.3125);
    EXPECT_TRUE(std::isnan(tree->level(2).outside_ratio));
    EXPECT_TRUE(std::isnan(tree->level(2).hausdorff_p99));
    EXPECT_EQ(tree->level(2).union_volume, 1e300);
    const BakeInfo info = tree->bake_info(), expected = golden_info();
    EXPECT_EQ(info.source_hash, expected.source_hash);
    EXPECT_EQ(info.options_hash, expected.options_hash);
    EXPECT_EQ(info.surface_mode, expected.surface_mode);
    EXPECT_EQ(info.proved, expected.proved);
    EXPECT_EQ(info.goal_reached, expected.goal_reached);
    EXPECT_EQ(info.solid_volume, expected.solid_volume);
    EXPECT_EQ(info.solid_volume_error, expected.solid_volume_error);
    EXPECT_EQ(info.placement, expected.placement);
    EXPECT_EQ(info.weld, expected.weld);
    EXPECT_EQ(info.mass, expected.mass);
    EXPECT_EQ(info.diagonal, expected.diagonal);
    EXPECT_EQ(info.method, expected.method);
    EXPECT_EQ(info.quality, expected.quality);
    EXPECT_EQ(info.alpha, expected.alpha);
    EXPECT_EQ(info.beta, expected.beta);
    EXPECT_EQ(info.tolerance, expected.tolerance);
    EXPECT_EQ(info.distance, expected.distance);
    EXPECT_EQ(info.levels, expected.levels);
    EXPECT_EQ(info.ellipsoids, expected.ellipsoids);
    EXPECT_EQ(info.seed, expected.seed);
    EXPECT_EQ(info.resolution, expected.resolution);
}

TEST(Format, FlagsDecodeByThemselves) {
    for (const unsigned flags : {0u, 1u, 4u, 5u, 8u, 9u, 12u, 13u}) {
        BakeInfo info = golden_info();
        info.surface_mode = flags & 1, info.proved = flags & 4, info.goal_reached = !(flags & 8);
        const Bytes bytes = format::encode(info, 3, kGoldenLattice, golden_levels());
        EXPECT_EQ(bytes[12], std::byte(flags));
        const BakeInfo read_back = TreeView::open(bytes)->bake_info();
        EXPECT_EQ(read_back.surface_mode, info.surface_mode);
        EXPECT_EQ(read_back.proved, info.proved);
        EXPECT_EQ(read_back.goal_reached, info.goal_reached);
    }
}

TEST(Format, ABallFillsOrPasses) {
    for (const auto& [fill, keep_holes] : {std::pair{0.25f, 0.0f}, {0.0f, 0.25f}, {0.0f, 0.0f}}) {
        BakeInfo info = golden_info();
        info.fill = fill, info.keep_holes = keep_holes;
        const Bytes bytes = format::encode(info, 3, kGoldenLattice, golden_levels());
        const BakeInfo read_back = TreeView::open(bytes)->bake_info();
        EXPECT_EQ(read_back.fill, fill);
        EXPECT_EQ(read_back.keep_holes, keep_holes);
    }
}

// The places of a block's numbers, as vector code loads them.
TEST(Format, ABlockIsAStructureOfArrays) {
    const Bytes bytes = golden_exact();
    const auto expect_row = [&](size_t at, size_t width, const std::vector<int64_t>& lanes) {
        for (size_t lane = 0; lane < 8; ++lane) {
            const auto value = static_cast<uint64_t>(lane < lanes.size() ? lanes[lane] : 0);
            for (size_t i = 0; i < width; ++i)
                EXPECT_EQ(bytes[at + width * lane + i], std::byte(value >> (8 * i) & 0xff)) << at << " lane " << lane;
        }
    };
    expect_row(kExactBlock1 + 0, 2, {0, 65535}); // center
    expect_row(kExactBlock1 + 16, 2, {0, 1});
    expect_row(kExactBlock1 + 32, 2, {0, 2});
    expect_row(kExactBlock1 + 48, 2, {1, 300}); // diagonal
    expect_row(kExactBlock1 + 64, 2, {2, 200});
    expect_row(kExactBlock1 + 80, 2, {65535, 100});
    expect_row(kExactBlock1 + 96, 2, {32767}); // off-diagonal
    expect_row(kExactBlock1 + 112, 2, {-32768});
    expect_row(kExactBlock1 + 128, 2, {});
    expect_row(kExactBlock1 + 144, 1, {0, -7});            // exponent
    expect_row(kExactBlock1 + 152, 1, {3, 129});           // three children; a leaf of one triangle
    expect_row(kExactBlock1 + 160, 2, {8 << 5 | 3 << 10}); // fractions
    expect_row(kExactBlock1 + 176, 1, {});                 // blocks of children before
    expect_row(kExactBlock2 + 152, 1, {130, 129, 129});
    const auto expect_words = [&](size_t at, uint32_t children, uint32_t triangles) { // where they begin
        EXPECT_EQ(load_le<uint32_t>(bytes.data() + at + 184), children);
        EXPECT_EQ(load_le<uint32_t>(bytes.data() + at + 188), triangles);
    };
    expect_words(kBounding, 1, 0);
    expect_words(kExactBlock1, 2, 0);
    expect_words(kExactBlock2, 3, 1);
}

// Against a plain sum, for all that open() accepts: up to 127 triangles a lane, leaves and inner nodes in any mix.
TEST(Format, TrianglesOfALaneFollowThoseOfTheLanesBefore) {
    Random random(7);
    std::array<std::byte, kBlockBytes> block{};
    for (int i = 0; i < 20'000; ++i) {
        const uint32_t begin = random.below(1u << 31), leaves = random.below(3), most = random.below(2);
        store_le(block.data() + kBlockTriangles, begin);
        uint32_t before = 0;
        for (size_t lane = 0; lane < kBlockLanes; ++lane) {
            ASSERT_EQ(first_triangle(block.data(), lane), begin + before) << i << ' ' << lane;
            uint32_t count = random.below(kMaxDegree + 1);
            if (leaves == 0 || (leaves == 1 && random.below(2) != 0)) {
                const uint32_t triangles = most != 0 ? kMaxLeafTriangles : 1 + random.below(kMaxLeafTriangles);
                before += triangles;
                count = kTriangleLeaf + triangles;
            }
            store_le(block.data() + kBlockCount + lane, static_cast<uint8_t>(count));
        }
    }
}

// Of centers, files hold what a float can: 24 bits from the coordinate origin on, within the lattice.
TEST(Format, CentersTakeTheBitsThatAFloatHolds) {
    for (const int32_t origin : {0, -65535, 1 << 18, (1 << 19) - 65535, (1 << 19) - 65534, -(1 << 19), -(1 << 19) - 1,
                                 1 << 20, (1 << 23) - 65535, (1 << 23) - 65534, (1 << 24) - 65536, 1 - (1 << 24)}) {
        const int bits = format::fraction_bits(origin);
        for (const auto& [q, fraction] : std::initializer_list<std::pair<uint16_t, uint8_t>>{
                 {0, 1}, {0, 2}, {0, 16}, {1, 31}, {32768, 8}, {65534, 31}, {65535, 0}, {65535, 1}}) {
            PackedLevel root{{{.center = {q, 0, 0}, .fraction = {fraction, 0, 0}, .diagonal = {7, 7, 7}}}};
            const Lattice lattice{{origin, 0, 0}, 0};
            const auto tree = Tree::open(format::encode({}, 8, lattice, std::span(&root, 1)));
            const double x = origin + q + fraction / 32.0;
            const bool fits = static_cast<float>(x) == x && q + fraction / 32.0 <= 65535;
            ASSERT_EQ(tree.has_value(), fits) << origin << ' ' << q << ' ' << int{fraction};
            // A writer's grid holds what is on it, and nothing finer would be held all over the lattice.
            EXPECT_TRUE(fits || fraction % (32 >> bits) != 0 || q == 65535);
            if (fits) {
                EXPECT_EQ(tree->view().ellipsoid(0).center.x, x);
            } else {
                EXPECT_EQ(tree.error().where, 384u + 160);
                EXPECT_STREQ(tree.error().what,
                             q == 65535 ? "a center lies beyond the lattice" : "a center has more bits than a float");
            }
        }
        const double next = origin + 65535 - std::ldexp(1, -bits - 1), low = origin + std::ldexp(1, -bits - 1);
        EXPECT_TRUE(bits == 5 || static_cast<float>(next) != next || static_cast<float>(low) != low) << origin;
    }
}

TEST(Format, MoreThanEightSiblingsTakeSeveralBlocks) {
    const PackedNode leaf{.diagonal = {7, 7, 7}};
    std::vector<PackedLevel> levels(3);
    levels[0].nodes = {{.child_count = 3}};
    levels[1].nodes = {{.child_count = 9}, leaf, {.child_count = 8}};
    levels[2].nodes.assign(17, leaf);
    const Bytes bytes = format::encode({}, 9, {}, levels);
    const auto tree = TreeView::open(bytes);
    ASSERT_TRUE(tree) << tree.error().what;
    expect_sound(*tree);
    EXPECT_EQ(tree->block_count(), 5u); // one, one, and two and one
    EXPECT_EQ(tree->node_count(), 21u);
    EXPECT_EQ(tree->children(8).first, 16u);
    EXPECT_EQ(tree->children(8).count, 9u);
    EXPECT_EQ(tree->children(10).first, 32u);
    EXPECT_EQ(tree->raw().block(1)[176 + 2], std::byte{2}); // blocks of the first node's children
    std::vector<uint32_t> last;
    tree->for_each_node(2, [&](uint32_t n) { last.push_back(n); });
    EXPECT_EQ(last, (std::vector<uint32_t>{16, 17, 18, 19, 20, 21, 22, 23, 24, 32, 33, 34, 35, 36, 37, 38, 39}));
}

TEST(Format, TheDescriptionIsOfThisVersion) {
    const Bytes file = read(fs::path(PROLATE_TEST_DATA) / "../../src/FORMAT.md");
    const std::string text(reinterpret_cast<const char*>(file.data()), file.size());
    const std::string version = std::to_string(kFormatVersion);
    for (const std::string& words : {"format, version " + version, "| version | " + version + " if",
                                     "golden_v" + version + ".etree", "| " + version + " | 0.1.0 |"})
        EXPECT_NE(text.find(words), std::string::npos) << words;
}

TEST(Format, OlderVersionsAreRefusedInWords) {
    for (const char* name :
         {"golden_v1.etree", "golden_v2.etree", "golden_v2_exact.etree", "golden_v3.etree", "golden_v3_exact.etree",
          "golden_v4.etree", "golden_v4_exact.etree", "golden_v5.etree", "golden_v5_exact.etree", "golden_v6.etree",
          "golden_v6_exact.etree", "golden_v7.etree", "golden_v7_exact.etree"}) {
        const Bytes file = read(fs::path(PROLATE_TEST_DATA) / name);
        ASSERT_FALSE(file.empty());
        for (const OpenOptions& options : {OpenOptions{}, kNoHash}) {
            const auto tree = TreeView::open(file, options);
            ASSERT_FALSE(tree);
            EXPECT_EQ(tree.error().code, ErrorCode::bad_file);
            EXPECT_STREQ(tree.error().what, "written by an older format version than this library reads");
        }
    }
}

TEST(Format, CutsTakeLeavesFromAbove) {
    const Bytes bytes = golden();
    const TreeView tree = *TreeView::open(bytes);
    const auto cut = [&](uint32_t l) {
        std::vector<uint32_t> nodes;
        tree.for_each_in_cut(l, [&](uint32_t n) { nodes.push_back(n); });
        return nodes;
    };
    EXPECT_EQ(cut(0), (std::vector<uint32_t>{0}));
    EXPECT_EQ(cut(1), (std::vector<uint32_t>{8, 9}));
    EXPECT_EQ(cut(2), (std::vector<uint32_t>{9, 16, 17, 18}));
    std::vector<uint32_t> all;
    tree.for_each_node([&](uint32_t n) { all.push_back(n); });
    EXPECT_TRUE(std::ranges::equal(all, kGoldenSlots));
}

void expect_prefixes(const Bytes& bytes, size_t block_1) {
    for (const OpenOptions& options : {OpenOptions{}, kNoHash})
        for (size_t n = 0; n < bytes.size(); ++n) {
            const Exact part({bytes.data(), n});
            const auto tree = TreeView::open(part.bytes(), options);
            const uint32_t levels = n == block_1         ? 1
                                    : n == block_1 + 256 ? 2
                                    : n == block_1 + 512 ? 3 // without the triangles
                                                         : 0;
            ASSERT_EQ(tree.has_value(), levels > 0) << n;
            if (!tree) {
                ASSERT_EQ(tree.error().code, ErrorCode::bad_file) << n;
                continue;
            }
            EXPECT_EQ(tree->level_count(), levels);
            EXPECT_TRUE(tree->is_prefix());
            expect_sound(*tree);
        }
    Bytes longer = bytes;
    longer.push_back(std::byte{0});
    EXPECT_FALSE(TreeView::open(longer));
    EXPECT_FALSE(TreeView::open(longer, kNoHash));
    EXPECT_FALSE(TreeView::open({}));
}
TEST(Format, EveryPrefixIsRefusedUnlessALevelEndsThere) {
    expect_prefixes(golden(), kBlock1);
    expect_prefixes(golden_exact(), kExactBlock1);
}

void expect_changes_found(Bytes bytes) {
    for (size_t at = 0; at < bytes.size(); ++at)
        for (unsigned flip = 1; flip < 256; ++flip) {
            bytes[at] ^= std::byte(flip);
            ASSERT_FALSE(TreeView::open(bytes)) << "byte " << at << " xor " << flip;
            bytes[at] ^= std::byte(flip);
        }
    EXPECT_TRUE(TreeView::open(bytes));
}
TEST(Format, EverySingleByteChangeIsFound) {
    expect_changes_found(golden());
    expect_changes_found(golden_exact());
}

void expect_refused_or_sound(const Bytes& bytes) {
    const Exact copy(bytes);
    uint32_t accepted = 0, refused = 0;
    for (size_t at = 0; at < bytes.size(); ++at)
        for (unsigned flip = 1; flip < 256; ++flip) {
            copy.data[at] ^= std::byte(flip);
            const auto tree = TreeView::open(copy.bytes(), kNoHash);
            if (tree) expect_sound(*tree);
            if (testing::Test::HasFatalFailure()) FAIL() << "byte " << at << " xor " << flip;
            ++(tree ? accepted : refused);
            copy.data[at] ^= std::byte(flip);
        }
    EXPECT_GT(accepted, 10'000u);
    EXPECT_GT(refused, 10'000u);
}
TEST(Format, WithoutHashesEveryChangeIsRefusedOrSound) {
    expect_refused_or_sound(golden());
    expect_refused_or_sound(golden_exact());
}

// The golden tree with an inner cover, and a section of a kind that nobody knows.
Bytes golden_inner() {
    BakeInfo info = golden_info();
    info.surface_mode = false, info.inner = true;
    auto levels = golden_levels();
    levels.pop_back();
    levels[1].nodes[0].child_count = 0;
    return format::encode(info, 2, {{-30, 7, 900}, -3}, levels);
}
constexpr size_t kSection = kEnd, kContent = kSection + 64; // the golden tree ends at a multiple of 64
size_t second_section() {
    return (kContent + golden_inner().size() + 63) / 64 * 64;
}
Bytes golden_with_sections() {
    Bytes bytes = golden();
    format::append_section(bytes, {'I', 'N', 'N', 'R'}, golden_inner());
    const std::byte unknown[] = {std::byte{7}, std::byte{8}, std::byte{9}};
    format::append_section(bytes, {'T', 'e', 's', 't'}, unknown);
    return bytes;
}

TEST(Format, GoldenFileWithSections) {
    const Bytes file = golden_file("golden_v9.etree", golden_with_sections());
    ASSERT_EQ(file.size(), second_section() + 128);
    EXPECT_EQ(golden_with_sections(), file);
    const auto tree = TreeView::open(file);
    ASSERT_TRUE(tree) << tree.error().what;
    expect_sound(*tree);
    EXPECT_EQ(tree->format_version(), 9);
    EXPECT_FALSE(tree->is_prefix() || tree->bake_info().inner);
    ASSERT_EQ(tree->section_count(), 2u);
    EXPECT_EQ(std::string(tree->section(0).kind, 4), "INNR");
    EXPECT_EQ(std::string(tree->section(1).kind, 4), "Test");
    EXPECT_EQ(tree->section(1).content.size(), 3u);
    EXPECT_EQ(tree->section(1).content[2], std::byte{9});
    const auto inner = tree->inner();
    ASSERT_TRUE(inner);
    expect_sound(*inner);
    EXPECT_TRUE(inner->bake_info().inner);
    EXPECT_TRUE(std::ranges::equal(inner->bytes(), golden_inner()));
    const auto alone = TreeView::open(inner->bytes());
    ASSERT_TRUE(alone) << alone.error().what;
    EXPECT_EQ(alone->node_count(), 3u);
    EXPECT_EQ(inner->node_count(), alone->node_count());
    EXPECT_EQ(inner->block_count(), alone->block_count());
    EXPECT_EQ(inner->degree(), 2u);
    alone->for_each_node([&](uint32_t node) {
        EXPECT_EQ(inner->ellipsoid(node), alone->ellipsoid(node));
        EXPECT_EQ(inner->bound(node), alone->bound(node));
    });
    EXPECT_EQ(inner->root_bound(), alone->root_bound());
    EXPECT_EQ(tree->scaled(2)->inner()->scale(), 2);
    EXPECT_EQ(tree->rounded(0.5f)->inner()->radius(), 0.5f);
    // The tree itself is as in a file without sections.
    const Bytes plain = golden();
    EXPECT_EQ(TreeView::open(plain)->format_version(), 8);
    EXPECT_FALSE(TreeView::open(plain)->inner());
    EXPECT_TRUE(std::ranges::equal(std::span(plain).subspan(kTable), std::span(file).subspan(kTable, kEnd - kTable)));
}

TEST(Format, ChangesOfSectionsAreFound) {
    const Bytes file = golden_with_sections();
    Exact copy(file);
    for (const size_t at : {size_t{8}, size_t{12}, size_t{16}, size_t{24}}) {
        copy.data[at] ^= std::byte{1};
        EXPECT_FALSE(TreeView::open(copy.bytes())) << at;
        copy.data[at] ^= std::byte{1};
    }
    for (size_t at = kEnd; at < file.size(); ++at)
        for (const unsigned flip : {1u, 2u, 0x41u, 0x80u, 0xffu}) {
            copy.data[at] ^= std::byte(flip);
            ASSERT_FALSE(TreeView::open(copy.bytes())) << "byte " << at << " xor " << flip;
            if (const auto tree = TreeView::open(copy.bytes(), kNoHash)) {
                expect_sound(*tree);
                if (const auto inner = tree->inner()) expect_sound(*inner);
                for (uint32_t s = 0; s < tree->section_count(); ++s)
                    ASSERT_LE(tree->section(s).content.data() + tree->section(s).content.size(),
                              copy.data.get() + copy.size);
            }
            if (testing::Test::HasFatalFailure()) FAIL() << "byte " << at << " xor " << flip;
            copy.data[at] ^= std::byte(flip);
        }
    EXPECT_TRUE(TreeView::open(copy.bytes()));
}

TEST(Format, APrefixHasNoSections) {
    const Bytes file = golden_with_sections();
    for (size_t n = kBlock2 + 1; n < file.size(); ++n) {
        const Exact part({file.data(), n});
        const auto tree = TreeView::open(part.bytes(), kNoHash);
        ASSERT_EQ(tree.has_value(), n == kEnd) << n;
        if (!tree) continue;
        EXPECT_TRUE(tree->is_prefix() && !tree->inner() && tree->section_count() == 0);
        EXPECT_EQ(tree->level_count(), 3u);
    }
}

TEST(Format, NamesOffencesOfSections) {
    struct Case {
        size_t at;
        std::vector<int> bytes;
        uint64_t where;
    };
    const size_t second = second_section(), end = second + 128;
    const Case cases[] = {
        {8, {8}, 12},                            // version 8 has no sections
        {12, {15}, 12},                          // nor has a file of version 9 none
        {16, {1}, 16},                           // no multiple of 64
        {kSection + 1, {' '}, kSection + 1},     // the kind
        {kSection + 4, {1}, kSection + 4},       // reserved
        {kSection + 8, {0, 0}, kSection + 8},    // no content
        {kSection + 12, {1}, kSection + 8},      // 4 GB of it
        {kSection + 63, {1}, kSection + 63},     // reserved
        {kContent + 12, {15}, kContent},         // an inner cover that is none
        {kContent + 12, {39}, kContent + 12},    // of triangles
        {kContent, {'E'}, kContent},             // no tree
        {second, {'I', 'N', 'N', 'R'}, second},  // another inner cover
        {second + 64 + 3, {1}, second + 64 + 3}, // behind the content
        {second + 8, {65}, second + 8},          // more than there is
        {end - 1, {1}, end - 1},
    };
    for (const Case& c : cases) {
        Bytes bytes = golden_with_sections();
        for (size_t i = 0; i < c.bytes.size(); ++i) bytes[c.at + i] = std::byte(c.bytes[i]);
        const auto tree = TreeView::open(bytes, kNoHash);
        ASSERT_FALSE(tree) << "byte " << c.at;
        EXPECT_EQ(tree.error().code, ErrorCode::bad_file) << "byte " << c.at << ": " << tree.error().what;
        EXPECT_EQ(tree.error().where, c.where) << "byte " << c.at << ": " << tree.error().what;
    }
}

TEST(Format, ACoarserTreeIsThatOfThePrefix) {
    for (const Bytes& file : {golden(), golden_exact(), golden_with_sections()}) {
        const TreeView whole = *TreeView::open(file);
        for (uint32_t last = 0; last < 2; ++last) {
            const TreeView tree = whole.coarser(last);
            const TreeView prefix = *TreeView::open(std::span(file).first(whole.level(last).end_byte));
            expect_sound(tree);
            EXPECT_TRUE(tree.is_prefix() && !tree.has_triangles() && !tree.inner());
            EXPECT_EQ(tree.bytes().size(), prefix.bytes().size());
            EXPECT_EQ(tree.node_count(), prefix.node_count());
            EXPECT_EQ(tree.root_bound(), prefix.root_bound());
            prefix.for_each_node([&](uint32_t node) {
                EXPECT_EQ(tree.is_leaf(node), prefix.is_leaf(node));
                EXPECT_EQ(tree.ellipsoid(node), prefix.ellipsoid(node));
                EXPECT_EQ(tree.bound(node), prefix.bound(node));
            });
        }
        EXPECT_EQ(whole.coarser(2).bytes().size(), file.size());
        for (const uint32_t beyond : {kMaxLevels, UINT32_MAX}) EXPECT_FALSE(whole.coarser(beyond).is_prefix());
    }
}

TEST(Format, NamesTheFirstOffence) {
    struct Case {
        size_t at;
        std::vector<int> bytes;
        ErrorCode code;
        uint64_t where;
    };
    const size_t counts = kBlock1 + 152, section = kGoldenHash; // counts of nodes 8 and 9
    const size_t exact_counts = kExactBlock1 + 152;
    const Case cases[] = {
        {0, {'E'}, ErrorCode::bad_file, 0},
        {8, {5}, ErrorCode::bad_file, 8},
        {kBlocks + 144, {18}, ErrorCode::bad_file, kBlocks + 144},         // 22 above the step exponent, -4
        {kBlocks + 144, {0xdd}, ErrorCode::bad_file, kBlocks + 144},       // 31 below
        {kBlocks + 240, {0, 0, 0, 1}, ErrorCode::bad_file, kBlocks + 240}, // a box origin of 2^24
        {8, {9}, ErrorCode::bad_file, 12},                                 // without sections
        {8, {10}, ErrorCode::newer_version, 10},
        {8, {0xff, 0xff}, ErrorCode::newer_version, 0xffff},
        {8, {0}, ErrorCode::bad_file, 8},
        {10, {128}, ErrorCode::bad_file, 10},
        {12, {16}, ErrorCode::bad_file, 12}, // unknown flag
        {16, {1}, ErrorCode::bad_file, 16},  // total size
        {48, {7}, ErrorCode::bad_file, 48},  // node count
        {52, {0}, ErrorCode::bad_file, 52},  // no level
        {52, {33}, ErrorCode::bad_file, 52}, // too many levels
        {54, {1}, ErrorCode::bad_file, 54},  // degree
        {54, {65}, ErrorCode::bad_file, 54},
        {56, {0, 0, 0, 1}, ErrorCode::bad_file, 56},                   // origin 2^24
        {68, {61}, ErrorCode::bad_file, 68},                           // step
        {70, {1}, ErrorCode::bad_file, 70},                            // reserved
        {72, {0, 0, 0, 0, 0, 0, 0xf0, 0x7f}, ErrorCode::bad_file, 72}, // infinite volume
        {80, {2}, ErrorCode::bad_file, 80},
        {81, {2}, ErrorCode::bad_file, 81},
        {82, {3}, ErrorCode::bad_file, 82},
        {83, {1}, ErrorCode::bad_file, 83},
        {84, {0, 0, 0xc0, 0x7f}, ErrorCode::bad_file, 84}, // alpha not a number
        {88, {0, 0, 0x80, 0xbf}, ErrorCode::bad_file, 88}, // beta negative
        {116, {1}, ErrorCode::bad_file, 116},              // reserved
        {127, {1}, ErrorCode::bad_file, 116},
        {12, {3}, ErrorCode::bad_file, 116},                              // exact, without triangles
        {128, {0, 0, 0, 0, 0, 0, 0xf0, 0x7f}, ErrorCode::bad_file, 128},  // infinite diagonal
        {136, {0, 0, 0x80, 0xbf}, ErrorCode::bad_file, 136},              // negative error
        {140, {0, 0, 0xc0, 0x7f}, ErrorCode::bad_file, 140},              // distance not a number
        {152, {0, 0, 0, 0, 0, 0, 0, 0x80}, ErrorCode::bad_file, 152},     // a scale of 0
        {160, {0, 0, 0, 0, 0, 0, 0xf8, 0x7f}, ErrorCode::bad_file, 160},  // a scale that is no number
        {184, {0, 0, 0, 0, 0, 0, 0xf0, 0x7f}, ErrorCode::bad_file, 184},  // an infinite mesh origin
        {192, {0, 0, 0x80, 0x7f}, ErrorCode::bad_file, 192},              // an infinite weld
        {196, {0, 0, 0x80, 0xff}, ErrorCode::bad_file, 196},              // an infinite ball
        {kTable, {1}, ErrorCode::bad_file, kTable},                       // first block of level 0
        {kTable + 4, {2}, ErrorCode::bad_file, kTable + 4},               // two roots
        {kTable + kRow + 4, {0}, ErrorCode::bad_file, kTable + kRow + 4}, // an empty level
        {kTable + kRow + 4, {9}, ErrorCode::bad_file, kTable + kRow + 4}, // more nodes than lanes
        {kTable + 8, {1}, ErrorCode::bad_file, kTable + 8},
        {kTable + 8, {0, 6}, ErrorCode::bad_file, kTable + 8},                  // two blocks of roots
        {kTable + kRow + 8, {0x81, 5}, ErrorCode::bad_file, kTable + kRow + 8}, // no whole number of blocks
        {kTable + kRow + 8, {0x80, 4}, ErrorCode::bad_file, kTable + kRow + 8}, // no block
        {kTable + 31, {0xc0}, ErrorCode::bad_file, kTable + 24},                // negative union volume
        {kTable + 35, {0xc0}, ErrorCode::bad_file, kTable + 24},                // negative outside ratio
        {kTable + 56, {0, 0, 0x80, 0x7f}, ErrorCode::bad_file, kTable + 24},    // infinite distance
        {207, {0xc0}, ErrorCode::bad_file, 200},                                // mass: a negative volume
        {214, {0xf0, 0x7f}, ErrorCode::bad_file, 208},                          // an infinite centre
        {278, {0xf8, 0x7f}, ErrorCode::bad_file, 272},                          // inertia that is no number
        {303, {0x80}, ErrorCode::bad_file, 296},                                // a negative error
        {kBounding - 4, {1}, ErrorCode::bad_file, kBounding - 4},               // padding
        {kBounding - 1, {1}, ErrorCode::bad_file, kBounding - 1},
        {kBounding + 152, {3}, ErrorCode::bad_file, kBounding + 152}, // other children than in the block
        {kBounding + 184, {2}, ErrorCode::bad_file, kBounding + 184}, // in other places
        {kBounding + 188, {1}, ErrorCode::bad_file, kBounding + 188},
        {kBounding + 48, {0, 0}, ErrorCode::bad_file, kBounding + 48},    // no extent
        {kBounding + 144, {101}, ErrorCode::bad_file, kBounding + 144},   // exponent
        {kBounding + 192, {255}, ErrorCode::bad_file, kBounding + 192},   // lower corner above the upper one
        {kBounding + 243, {16}, ErrorCode::bad_file, kBounding + 240},    // box origin
        {kBounding + 50, {1}, ErrorCode::bad_file, kBounding + 50},       // beside the root
        {kBounding + 256 + 2, {1}, ErrorCode::bad_file, kBounding + 258}, // another center of a leaf
        {kBounding + 256 + 162, {1}, ErrorCode::bad_file, kBounding + 258},
        {kBounding + 163, {1}, ErrorCode::bad_file, kBounding + 163}, // beside the root: fraction
        {kBounding + 176, {1}, ErrorCode::bad_file, kBounding + 176}, // another first child
        {kBounding + 183, {1}, ErrorCode::bad_file, kBounding + 183}, // beside the root
        {kBlocks + 161, {0x80}, ErrorCode::bad_file, kBlocks + 160},  // the bit that no coordinate has
        {kBlocks + 176, {1}, ErrorCode::bad_file, kBlocks + 176},     // first child
        {kBlock1 + 177, {1}, ErrorCode::bad_file, kBlock1 + 177},     // of a leaf
        {kBlocks + 184, {2}, ErrorCode::bad_file, kBlocks + 184},     // where the children begin
        {kBlocks + 188, {1}, ErrorCode::bad_file, kBlocks + 188},     // and the triangles
        {counts, {4}, ErrorCode::bad_file, counts},                   // more children than the degree
        {counts, {2}, ErrorCode::bad_file, kBlock1},                  // children that are not the next level
        {kBlock1 + 144, {101}, ErrorCode::bad_file, kBlock1 + 144},   // exponent
        {kBlock1 + 48, {0, 0}, ErrorCode::bad_file, kBlock1 + 48},    // no extent
        {kBlock1 + 66, {0, 0}, ErrorCode::bad_file, kBlock1 + 66},    // of the other, along y
        {kBlock1 + 162, {1}, ErrorCode::bad_file, kBlock1 + 162},     // a center beyond the lattice
        {counts + 1, {128}, ErrorCode::bad_file, counts + 1},         // a leaf of no triangles
        {counts + 1, {129}, ErrorCode::bad_file, counts + 1},         // triangles in a tree without
        {kBlocks + 2, {1}, ErrorCode::bad_file, kBlocks + 2},         // beside the root: center
        {kBlocks + 80 + 15, {1}, ErrorCode::bad_file, kBlocks + 95},  // diagonal of the last lane
        {kBlock1 + 96 + 4, {1}, ErrorCode::bad_file, kBlock1 + 100},  // off-diagonal
        {kBlock1 + 144 + 2, {1}, ErrorCode::bad_file, kBlock1 + 146}, // exponent
        {counts + 2, {1}, ErrorCode::bad_file, counts + 2},           // count
        {kBlock2 + 175, {1}, ErrorCode::bad_file, kBlock2 + 175},     // fraction
        {kBlock2 + 183, {1}, ErrorCode::bad_file, kBlock2 + 183},     // blocks before
        {kBlock2 + 187, {1}, ErrorCode::bad_file, kBlock2 + 184},     // where children begin, of the last level
        {kBlocks + 193, {1}, ErrorCode::bad_file, kBlocks + 193},     // box
        {kBlock1 + 192, {255}, ErrorCode::bad_file, kBlock1 + 192},   // lower corner above the upper one
        {kBlocks + 243, {16}, ErrorCode::bad_file, kBlocks + 240},    // box origin
        {kBlocks + 252, {23}, ErrorCode::bad_file, kBlocks + 252},    // box step
        {kBlocks + 255, {1}, ErrorCode::bad_file, kBlocks + 255},     // reserved
    };
    const Case exact_cases[] = {
        {12, {1}, ErrorCode::bad_file, 116},                                  // triangle counts of a tree without
        {116, {0}, ErrorCode::bad_file, 116},                                 // no vertices
        {116, {8}, ErrorCode::bad_file, 16},                                  // more than the size says
        {120, {0}, ErrorCode::bad_file, 120},                                 // no triangles
        {124, {0}, ErrorCode::bad_file, 124},                                 // no component
        {124, {8}, ErrorCode::bad_file, 124},                                 // more than vertices
        {exact_counts + 1, {0}, ErrorCode::bad_file, exact_counts + 1},       // a leaf of none
        {exact_counts + 1, {128}, ErrorCode::bad_file, exact_counts + 1},     // another of none
        {exact_counts + 1, {130}, ErrorCode::bad_file, kExactBlock2 + 188},   // one that the next leaf has too
        {kExactBlock2 + 154, {130}, ErrorCode::bad_file, 120},                // one more than there are
        {exact_counts, {131}, ErrorCode::bad_file, kExactBlock1},             // an inner node's children as triangles
        {kExactEnd + 64 + 50, {0}, ErrorCode::bad_file, kExactEnd + 64 + 52}, // a slab without a normal
        {kExactEnd + 2 * 64 + 63, {1}, ErrorCode::bad_file, kExactEnd + 2 * 64 + 63},  // likewise
        {kExactEnd + 64 + 52, {5}, ErrorCode::bad_file, kExactEnd + 64 + 52},          // its triangle does not exist
        {kExactEnd + 64 + 58, {0xc0, 0x7f}, ErrorCode::bad_file, kExactEnd + 64 + 56}, // its height is a NaN
        {kExactEnd + 64 + 62, {0x80, 0xbf}, ErrorCode::bad_file, kExactEnd + 64 + 56}, // its top below its bottom
        {section + 8 + 3, {0x7f, 0, 0, 0x80, 0x7f}, ErrorCode::bad_file, section + 8}, // not finite
        {section + 8 + 7 * 12 + 2 * 6 + 4, {7}, ErrorCode::bad_file, section + 8 + 7 * 12 + 12}, // no such vertex
    };
    const auto check = [](const Case& c, Bytes bytes) {
        for (size_t i = 0; i < c.bytes.size(); ++i) bytes[c.at + i] = std::byte(c.bytes[i]);
        const auto tree = TreeView::open(bytes, kNoHash);
        ASSERT_FALSE(tree) << "byte " << c.at;
        EXPECT_EQ(tree.error().code, c.code) << "byte " << c.at << ": " << tree.error().what;
        EXPECT_EQ(tree.error().where, c.where) << "byte " << c.at << ": " << tree.error().what;
    };
    for (const Case& c : cases) check(c, golden());
    for (const Case& c : exact_cases) check(c, golden_exact());
}

TEST(Format, DecodingIsExact) {
    Random random(1);
    const auto bits16 = [&] { return static_cast<uint16_t>(random.next()); };
    for (int i = 0; i < 100'000; ++i) {
        Lattice lattice;
        for (int32_t& o : lattice.origin)
            o = static_cast<int32_t>(random.below(2 * format::kMaxCoordinate - 65536)) - format::kMaxCoordinate + 1;
        lattice.step_exponent = static_cast<int32_t>(random.below(173)) - 112;
        PackedNode node;
        node.exponent = static_cast<int8_t>(static_cast<int>(random.below(191)) - 90);
        for (size_t k = 0; k < 3; ++k) {
            node.center[k] = static_cast<uint16_t>(random.below(65535));
            node.fraction[k] =
                static_cast<uint8_t>((random.next() << (5 - format::fraction_bits(lattice.origin[k]))) % 32);
            node.diagonal[k] = std::max<uint16_t>(1, bits16());
            node.off_diagonal[k] = static_cast<int16_t>(bits16());
        }
        const Ellipsoid e = format::decode(node, lattice);
        const float center[3] = {e.center.x, e.center.y, e.center.z}, diagonal[3] = {e.l11, e.l22, e.l33},
                    off[3] = {e.l21, e.l31, e.l32};
        for (size_t k = 0; k < 3; ++k) {
            ASSERT_EQ(center[k],
                      std::ldexp(lattice.origin[k] + node.center[k] + node.fraction[k] / 32.0, lattice.step_exponent));
            // One rounding, to a float.
            const auto d = static_cast<float>(node.diagonal[k]), o = static_cast<float>(node.off_diagonal[k]);
            ASSERT_EQ(diagonal[k], std::ldexp(d * d, node.exponent - 30));
            ASSERT_EQ(off[k], std::ldexp(o * std::abs(o), node.exponent - 30));
        }
    }
}

TEST(Format, QuantisingTakesTheNearest) {
    Random random(2);
    for (int i = 0; i < 100'000; ++i) {
        const double size = random.log_in(1e-30, 1e15);
        const double away = random.below(2) ? size * random.log_in(1, 1e6) : 0;
        double low[3], high[3], center[3];
        for (size_t k = 0; k < 3; ++k) {
            low[k] = away * random.in(-1, 1) - size * random.unit();
            high[k] = low[k] + size * random.unit();
            center[k] = random.below(8) ? random.in(low[k], high[k]) : random.below(2) ? low[k] : high[k];
        }
        const Lattice lattice = format::lattice_for(low, high);
        const double step = std::ldexp(1, lattice.step_exponent);
        for (size_t k = 0; k < 3; ++k) {
            ASSERT_GT(lattice.origin[k], -format::kMaxCoordinate);
            ASSERT_LT(lattice.origin[k], format::kMaxCoordinate - UINT16_MAX);
        }
        const scenes::Point r = scenes::radii(random, 1000);
        const Ellipsoid shape = scenes::ellipsoid({}, r, random.rotation());
        const double s = size * random.log_in(1e-3, 1);
        const double factor[6] = {s * shape.l11, s * shape.l21, s * shape.l22,
                                  s * shape.l31, s * shape.l32, s * shape.l33};
        PackedNode node;
        format::quantise(node, lattice, center, factor);
        const Ellipsoid e = format::decode(node, lattice);
        const float decoded[3] = {e.center.x, e.center.y, e.center.z};
        for (size_t k = 0; k < 3; ++k) { // 21 bits across, and 24 from zero
            ASSERT_LE(std::abs(decoded[k] - center[k]),
                      std::ldexp(step / 2, -format::fraction_bits(lattice.origin[k])));
            ASSERT_LE(std::abs(decoded[k] - center[k]),
                      std::max(step / 64, (std::max(std::abs(low[k]), std::abs(high[k])) + 65536 * step) * 0x1p-24));
        }
        const double unit = std::ldexp(1, node.exponent - 30);
        const float decoded_factor[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
        double largest = 0;
        for (size_t k = 0; k < 6; ++k) {
            const bool diagonal = k == 0 || k == 2 || k == 5;
            largest = std::max(largest, std::abs(factor[k]) / (diagonal ? 4 : 1));
            const double error = std::abs(decoded_factor[k] - factor[k]), root = std::sqrt(std::abs(factor[k]) / unit);
            // Half of the gap between two squares; the least integer of the diagonal is 1.
            ASSERT_LE(error, (root < 1 && diagonal ? 1 : root + 0.5001) * unit + 0x1p-24 * std::abs(factor[k])) << i;
        }
        ASSERT_LE(unit, std::max(largest, 0x1p-90) * 0x1p-29 * 1.001) << i; // 16 bits are used
        // The lattice is no coarser than 16 bits across or 24 bits from zero ask for.
        double extent = 0, reach = 0;
        for (size_t k = 0; k < 3; ++k) {
            extent = std::max(extent, high[k] - low[k]);
            reach = std::max({reach, std::abs(low[k]), std::abs(high[k])});
        }
        ASSERT_LE(step, std::max({extent * 0x1p-14, reach * 0x1p-22, 0x1p-112})) << i;
    }
}

TEST(Format, LatticeOfABoxBeyondTheFormatStaysDefined) {
    const double low[3] = {-1e38, 1e38, 0}, high[3] = {1e38, 1e38, 0};
    const Lattice lattice = format::lattice_for(low, high);
    EXPECT_EQ(lattice.step_exponent, format::kMaxStepExponent);
    for (const int32_t o : lattice.origin) {
        EXPECT_GT(o, -format::kMaxCoordinate);
        EXPECT_LT(o, format::kMaxCoordinate - UINT16_MAX);
    }
}

// Found by fuzz_open: the thin axis came out as NaN, from a negative eigenvalue of L L^T.
TEST(Format, PrincipalAxesOfTheFlattestNodes) {
    Random random(4);
    for (int i = 0; i < 20'000; ++i) {
        PackedNode node;
        for (size_t k = 0; k < 3; ++k) {
            node.diagonal[k] = static_cast<uint16_t>(1 + random.below(3));
            node.off_diagonal[k] = static_cast<int16_t>(random.next());
        }
        const Ellipsoid e = format::decode(node, {});
        const PrincipalAxes axes = principal_axes(e);
        ASSERT_TRUE(axes.radii[0] >= axes.radii[1] && axes.radii[1] >= axes.radii[2] && axes.radii[2] >= 0);
        // The squares of the radii sum to the trace of L L^T.
        const double trace = double{e.l11} * e.l11 + double{e.l21} * e.l21 + double{e.l22} * e.l22 +
                             double{e.l31} * e.l31 + double{e.l32} * e.l32 + double{e.l33} * e.l33;
        double sum = 0;
        for (const double r : axes.radii) sum += r * r;
        ASSERT_NEAR(sum, trace, 1e-12 * trace);
    }
}

TEST(Format, RandomTreesOpen) {
    Random random(3);
    for (uint32_t degree = 2; degree <= kMaxDegree; ++degree) {
        const auto scene = scenes::tree(random, scenes::cloud(random, 300),
                                        {.degree = degree, .levels = 1 + random.below(6), .stop_probability = 0.2});
        const auto tree = TreeView::open(scene.bytes);
        ASSERT_TRUE(tree) << tree.error().what;
        expect_sound(*tree);
    }
}

// A folder of its own for each test.
class Files : public testing::Test {
protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "prolate-format-XXXXXX").string();
        ASSERT_NE(mkdtemp(name.data()), nullptr);
        folder_ = name;
    }
    void TearDown() override { fs::remove_all(folder_); }
    std::string path(const char* name) const { return (folder_ / name).string(); }
    size_t entries() const { return static_cast<size_t>(std::distance(fs::directory_iterator(folder_), {})); }
    fs::path folder_;
};

TEST_F(Files, SaveThenLoad) {
    const Bytes bytes = golden();
    ASSERT_TRUE(save(path("a.etree").c_str(), bytes));
    EXPECT_EQ(read(path("a.etree")), bytes);
    auto tree = load(path("a.etree").c_str());
    ASSERT_TRUE(tree);
    EXPECT_TRUE(std::ranges::equal(tree->bytes(), bytes));
    const Tree moved = std::move(*tree);
    expect_sound(moved.view());
    EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, SaveReplacesAndKeepsPermissions) {
    const Bytes bytes = golden();
    std::ofstream(path("a.etree")) << "old";
    fs::permissions(path("a.etree"), fs::perms(0640));
    ASSERT_TRUE(save(path("a.etree").c_str(), bytes));
    EXPECT_EQ(read(path("a.etree")), bytes);
    EXPECT_EQ(fs::status(path("a.etree")).permissions(), fs::perms(0640));
    EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, ANewFileObeysTheUmask) {
    const mode_t before = umask(027);
    const auto saved = save(path("a.etree").c_str(), golden());
    umask(before);
    ASSERT_TRUE(saved);
    EXPECT_EQ(fs::status(path("a.etree")).permissions(), fs::perms(0640));
}

TEST_F(Files, AFailedSaveLeavesTheOldFileAndNothingElse) {
    std::ofstream(path("a.etree")) << "old";
    // A file size limit stands for a full disk.
    struct rlimit before {};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    struct rlimit small = before;
    small.rlim_cur = 100;
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const auto saved = save(path("a.etree").c_str(), golden());
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    ASSERT_FALSE(saved);
    EXPECT_EQ(saved.error().code, ErrorCode::io);
    EXPECT_EQ(saved.error().where, static_cast<uint64_t>(EFBIG));
    EXPECT_EQ(fs::file_size(path("a.etree")), 3u);
    EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, ErrorsNameTheirCause) {
    const auto expect_io = [](const auto& result, int number) {
        ASSERT_FALSE(result);
        EXPECT_EQ(result.error().code, ErrorCode::io);
        EXPECT_EQ(result.error().where, static_cast<uint64_t>(number));
    };
    expect_io(save("/dev/full", golden()), ENOSPC);
    expect_io(save(folder_.c_str(), golden()), EISDIR);
    expect_io(save(path("missing/a.etree").c_str(), golden()), ENOENT);
    expect_io(load(folder_.c_str()), EISDIR);
    expect_io(load(path("missing.etree").c_str()), ENOENT);
    EXPECT_TRUE(save("/dev/null", golden()));
    EXPECT_EQ(entries(), 0u);
    std::ofstream(path("b.etree")) << "not a tree";
    const auto tree = load(path("b.etree").c_str());
    ASSERT_FALSE(tree);
    EXPECT_EQ(tree.error().code, ErrorCode::bad_file);
}

TEST(Version, HeaderAndLibraryAgree) {
    EXPECT_EQ(library_version(), kHeaderVersion);
    EXPECT_EQ(kFormatVersion, 9); // a new version needs a new golden file and a row in FORMAT.md
}

} // namespace
} // namespace prolate

// libFuzzer target: whatever the bytes, open() refuses them or every accessor and query answers, in range and finite.
//
//   cmake -S . -B build-fuzz -DCMAKE_CXX_COMPILER=clang++ -DPROLATE_BUILD_FUZZ=ON
//   cmake --build build-fuzz --target fuzz_open
//   build-fuzz/tests/fuzz_open -max_total_time=60 -max_len=4096 corpus tests/data
//
// Hashes are not checked, so that the fuzzer gets past them.
#include "src/block.hpp"
#include "src/bytes.hpp"

#include <prolate/collide.hpp>
#include <prolate/deform.hpp>
#include <prolate/solids.hpp>
#include <prolate/tree.hpp>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

using namespace prolate;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

void check(const Ellipsoid& e) {
    for (const float x : {e.center.x, e.center.y, e.center.z, e.l11, e.l21, e.l22, e.l31, e.l32, e.l33})
        require(std::isfinite(x));
    require(e.l11 > 0 && e.l22 > 0 && e.l33 > 0);
    require(std::isfinite(volume(e)));
    const PrincipalAxes axes = principal_axes(e);
    for (const double r : axes.radii) require(std::isfinite(r));
}

// Bytes that open() accepts may put a box anywhere.
bool root_box_holds_center(const TreeView& tree) {
    const std::byte* const block = tree.raw().bounding_block(0);
    for (size_t i = 0; i < 3; ++i) {
        const auto at = [&](size_t array) { return int64_t{load_le<uint8_t>(block + array + kBlockLanes * i)}; };
        const int64_t origin = load_le<int32_t>(block + kBlockBoxOrigin + 4 * i);
        const int64_t center = stored_center(block, i, 0) - origin * kCenterUnits;
        const auto exponent = load_le<uint8_t>(block + kBlockBoxExponent + i);
        if (center < (at(kBlockBoxLow) << exponent) * kCenterUnits ||
            center > (at(kBlockBoxHigh) << exponent) * kCenterUnits)
            return false;
    }
    return true;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const auto bytes = std::as_bytes(std::span(data, size));
    const auto opened = TreeView::open(bytes, {.check_hash = false});
    const auto hashed = TreeView::open(bytes);
    require(opened || !hashed); // checking more never accepts more
    if (!opened) {
        require(opened.error().code == ErrorCode::bad_file || opened.error().code == ErrorCode::newer_version);
        return 0;
    }
    const TreeView& tree = *opened;
    uint64_t seen = 0;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        require(tree.level(l).end_byte <= size);
        tree.for_each_in_cut(l, [&](uint32_t) { ++seen; });
    }
    require(seen >= tree.level_count() && tree.degree() >= 2 && tree.degree() <= kMaxDegree);
    (void)tree.bake_info();
    for (uint32_t s = 0; s < tree.section_count(); ++s) {
        const std::span<const std::byte> content = tree.section(s).content;
        require(!content.empty() && content.data() + content.size() <= bytes.data() + size);
    }
    if (const auto inner = tree.inner()) {
        require(inner->bake_info().inner && inner->section_count() == 0);
        inner->for_each_node([&](uint32_t n) { check(inner->ellipsoid(n)), check(inner->bound(n)); });
    }
    check(tree.coarser(data[size - 4] % 40u).root_bound());
    const auto holds_node = [&tree](uint32_t slot) { return slot < tree.slot_count() && tree.is_node(slot); };
    require(holds_node(0) && tree.raw().block(0) + kBlockBytes * tree.block_count() <= bytes.data() + size);
    uint32_t nodes = 0;
    tree.for_each_node([&](uint32_t n) {
        ++nodes;
        check(tree.ellipsoid(n));
        check(tree.bound(n));
        const ChildRange children = tree.children(n);
        require(children.count == 0 || children.first > n);
        for (uint32_t i = 0; i < children.count; ++i) require(holds_node(children.first + i));
        const TriangleRange triangles = tree.triangles(n);
        require((triangles.count > 0) == (tree.has_triangles() && children.count == 0));
        require(uint64_t{triangles.first} + triangles.count <= tree.triangle_count());
    });
    require(nodes == tree.node_count());
    for (uint32_t t = 0; t < tree.triangle_count(); ++t)
        for (const uint32_t corner : tree.triangle(t)) {
            require(corner < tree.vertex_count());
            const Vec3 p = tree.vertex(corner);
            require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
        }

    // Poses: the end of the input, as floats of any kind, and tamer ones of the tree's size.
    QueryContext context;
    const QueryOptions options{.max_level = data[size - 1] % 40u, .max_pair_tests = 500};
    Pose wild[2];
    std::memcpy(wild, data + size - sizeof wild, sizeof wild);
    const Ellipsoid root = tree.ellipsoid(0);
    const float reach = static_cast<float>(data[size - 2]) / 64 * root.l11;
    const Pose tame{{reach, -reach, reach / 2}, {1, static_cast<float>(data[size - 3]), 3, 4}};
    float q[kMaxModes];
    uint32_t modes = 0;
    if (const auto deformation = tree.deformation())
        for (; modes < deformation->mode_count(); ++modes) q[modes] = deformation->range(modes);
    BoneMatrix bones[kMaxBones];
    const uint32_t bone_count = tree.skin() ? tree.skin()->bone_count() : 0;
    for (uint32_t b = 0; b < bone_count; ++b) // each moved by another length
        bones[b].m[b % 3][3] = reach * static_cast<float>(b),
                       bones[b].m[0][1] = static_cast<float>(data[b % size]) / 64;
    const auto ask = [&](const Pose& a, const Pose& b) {
        const Solid solid(tree, options.max_level);
        const SolidsOptions limits{.max_pair_tests = options.max_pair_tests};
        require(collide(solid, a, solid, b, context, limits).stats.tests() <= limits.max_pair_tests);
        ContactManifolds of_solids;
        require(contacts(solid, a, solid, b, of_solids, context, limits).stats.tests() <= limits.max_pair_tests);
        const DeformedBody moved{tree, a, {q, modes}, {bones, bone_count}};
        require(collide(moved, {tree, b}, context, options).stats.tests() <= options.max_pair_tests);
        const DeformedDistanceResult d = distance(
            moved, {tree, b}, context, {.max_level = options.max_level, .max_pair_tests = options.max_pair_tests});
        require(d.stats.tests() <= options.max_pair_tests && d.lower <= d.upper);
        require(raycast(moved, {b.translation, {1, 2, 3}}, context, options).stats.tests() <= options.max_pair_tests);
        const CollideResult ab = collide(tree, a, tree, b, context, options);
        const CollideResult ba = collide(tree, b, tree, a, context, options);
        require(ab.verdict == ba.verdict && ab.stats.pair_tests == ba.stats.pair_tests);
        require(ab.stats.tests() <= options.max_pair_tests && ab.stats.deepest_level < tree.level_count());
        require(holds_node(ab.pair.node_a) && holds_node(ab.pair.node_b));
        // A root never lies apart from itself, unless moved, or its box lies beside it. (Children may lie apart from
        // their parents here, and level 0 asks their boxes.)
        const bool root_only = tree.level_count() == 1 && root_box_holds_center(tree);
        require(!root_only || std::memcmp(&a, &b, sizeof a) != 0 || ab.verdict != Verdict::separated);
    };
    ask(wild[0], wild[1]);
    ask(tame, tame);
    ask({}, tame);
    return 0;
}

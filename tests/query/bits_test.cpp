// Determinism: the same input gives the same bits on every instruction set and from every compiler. Each kind of query
// has a known hash of all that it answered in a few hundred scenes. A change that means to alter answers (another order
// of the descent, say, which names another pair) puts the new number here; no other change may.
#include "src/bytes.hpp"
#include "src/deformation.hpp"
#include "src/format.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/deform.hpp>
#include <prolate/distance.hpp>
#include <prolate/half_space.hpp>
#include <prolate/pairs.hpp>
#include <prolate/points.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/solids.hpp>
#include <prolate/sweep.hpp>

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

namespace prolate {
namespace {

using scenes::Random;

// FNV-1a over 64-bit words.
class Bits {
public:
    template <class T>
    requires std::is_arithmetic_v<T>
    void add(T value) {
        if constexpr (std::is_same_v<T, double>)
            word(std::bit_cast<uint64_t>(value));
        else if constexpr (std::is_same_v<T, float>)
            word(std::bit_cast<uint32_t>(value));
        else
            word(static_cast<uint64_t>(value));
    }
    void add(Verdict v) { add(static_cast<int>(v)); }
    void add(const Vec3& v) { add(v.x), add(v.y), add(v.z); }
    void add(const MeetingPair& p) { add(p.node_a), add(p.node_b), add(p.triangle_a), add(p.triangle_b); }
    void add(const QueryStats& s) {
        add(s.pair_tests), add(s.block_tests), add(s.triangle_tests), add(s.deepest_level);
    }
    template <class... Ts> void add_all(const Ts&... values) { (add(values), ...); }
    uint64_t hash() const { return hash_; }

private:
    void word(uint64_t w) { hash_ = (hash_ ^ w) * 0x100000001b3u; }
    uint64_t hash_ = 0xcbf29ce484222325u;
};

// Pairs of bodies near contact: ellipsoids alone, triangles, and one of each.
struct Scenes {
    struct Pair {
        const TreeView a, b;
        Pose pose_a, pose_b;
    };
    std::vector<std::vector<std::byte>> bytes;
    std::vector<Pair> pairs;

    Scenes() {
        Random random(77);
        bytes.push_back(scenes::tree(random, scenes::cloud(random, 4000), {}).bytes);
        bytes.push_back(
            scenes::tree(random, scenes::cloud(random, 900), {.degree = 12, .stop_probability = 0.1}).bytes);
        bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.4f, 64, 24)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::icosphere(3)).bytes);
        const auto view = [&](size_t i) { return *TreeView::open(bytes[i]); };
        for (uint32_t n = 0; n < 320; ++n) {
            Pair p{view(n % 4), view(n / 4 % 4), {}, {}};
            p.pose_a = {scenes::to_float(random.in_ball()), random.rotation()};
            const scenes::Point d = random.direction();
            const double far = random.in(0.2, 2.4);
            p.pose_b = {{p.pose_a.translation.x + static_cast<float>(far * d[0]),
                         p.pose_a.translation.y + static_cast<float>(far * d[1]),
                         p.pose_a.translation.z + static_cast<float>(far * d[2])},
                        random.rotation()};
            pairs.push_back(p);
        }
    }
};
const Scenes& all_scenes() {
    static const Scenes out;
    return out;
}

// visit(bits, pair) adds the answer of a query. The verdicts must not all be the same.
template <class Visit> void expect_bits(uint64_t known, Visit&& visit) {
    targets::for_each([&](const char* target) {
        Bits bits;
        for (const Scenes::Pair& pair : all_scenes().pairs) visit(bits, pair);
        EXPECT_EQ(bits.hash(), known) << target;
    });
}

QueryContext& context() {
    static const auto out = std::make_unique<QueryContext>();
    return *out;
}

TEST(Bits, ScenesAreNeitherAllApartNorAllMeeting) {
    uint32_t separated = 0;
    for (const auto& [a, b, pose_a, pose_b] : all_scenes().pairs)
        separated += collide(a, pose_a, b, pose_b, context()).verdict == Verdict::separated;
    EXPECT_GT(separated, 60u);
    EXPECT_LT(separated, 260u);
}

TEST(Bits, Collide) {
    expect_bits(9749661599211173981u, [](Bits& bits, const Scenes::Pair& p) {
        const CollideResult r = collide(p.a, p.pose_a, p.b, p.pose_b, context());
        bits.add_all(r.verdict, r.enclosed, r.pair, r.stats);
        PairCache cache;
        Pose pose = p.pose_b;
        for (int step = 0; step < 3; ++step, pose.translation.x += 0.01f) {
            const CollideResult s = collide(p.a, p.pose_a, p.b, pose, context(), {.margin = 0.01f}, &cache);
            bits.add_all(s.verdict, s.pair, s.stats, cache.distance);
        }
    });
}

TEST(Bits, CollideAll) {
    expect_bits(15877235305506680823u, [](Bits& bits, const Scenes::Pair& p) {
        MeetingPair pairs[16];
        const CollideAllResult r = collide_all(p.a, p.pose_a, p.b, p.pose_b, pairs, context());
        bits.add_all(r.verdict, r.enclosed, r.found, r.stats);
        for (size_t i = 0; i < std::min<uint64_t>(r.found, std::size(pairs)); ++i) bits.add(pairs[i]);
    });
}

TEST(Bits, HalfSpace) {
    expect_bits(1114871461955767402u, [](Bits& bits, const Scenes::Pair& p) {
        const HalfSpace ground{p.pose_b.translation, 0.1f};
        const DistanceResult d = distance(p.a, p.pose_a, ground, context());
        bits.add_all(d.verdict, d.lower, d.upper, d.point_a, d.point_b, d.normal, d.pair.node_a, d.stats);
        ContactManifolds manifolds;
        const ContactResult c = contacts(p.a, p.pose_a, ground, manifolds, context(), {.margin = 0.05f});
        bits.add_all(c.verdict, c.found, c.stats, manifolds.count);
        for (uint32_t k = 0; k < manifolds.count * manifolds.manifolds[0].count; ++k) {
            const ContactPoint& point = manifolds.manifolds[0].points[k];
            bits.add_all(point.point_a, point.point_b, point.depth, point.id);
        }
    });
}

TEST(Bits, Points) {
    expect_bits(13696370635778702647u, [](Bits& bits, const Scenes::Pair& p) {
        const Vec3 points[] = {p.pose_b.translation, p.pose_a.translation, {0.1f, 0.7f, -0.3f}};
        SignedDistance out[3];
        signed_distance(p.a, p.pose_a, points, out, context());
        for (const SignedDistance& r : out)
            bits.add_all(r.verdict, r.lower, r.upper, r.point, r.gradient, r.node, r.triangle, r.stats);
    });
}

TEST(Bits, Distance) {
    expect_bits(17493517942719200044u, [](Bits& bits, const Scenes::Pair& p) {
        const DistanceResult r = distance(p.a, p.pose_a, p.b, p.pose_b, context());
        bits.add_all(r.verdict, r.enclosed, r.lower, r.upper, r.point_a, r.point_b, r.normal, r.pair, r.stats);
    });
}

TEST(Bits, Contacts) {
    expect_bits(10802575758187684427u, [](Bits& bits, const Scenes::Pair& p) {
        ContactManifolds manifolds;
        const ContactResult r = contacts(p.a, p.pose_a, p.b, p.pose_b, manifolds, context(), {.margin = 0.01f});
        bits.add_all(r.verdict, r.enclosed, r.found, r.stats, manifolds.count);
        for (uint32_t m = 0; m < manifolds.count; ++m) {
            const Manifold& manifold = manifolds.manifolds[m];
            bits.add_all(manifold.normal, manifold.count);
            for (uint32_t i = 0; i < manifold.count; ++i) {
                const ContactPoint& c = manifold.points[i];
                bits.add_all(c.point_a, c.point_b, c.depth, c.age, c.id);
            }
        }
    });
}

// The nodes of a tree's level 1, at half their size, below the first: an inner cover as far as the format knows.
std::vector<std::byte> with_inner(std::vector<std::byte> bytes) {
    const TreeView tree = *TreeView::open(bytes);
    const Ellipsoid& root = tree.root_bound();
    const double low[] = {root.center.x - 3.0, root.center.y - 3.0, root.center.z - 3.0},
                 high[] = {root.center.x + 3.0, root.center.y + 3.0, root.center.z + 3.0};
    const format::Lattice lattice = format::lattice_for(low, high);
    std::vector<format::PackedLevel> levels(2);
    tree.for_each_node(1, [&](uint32_t node) {
        const Ellipsoid e = tree.ellipsoid(node);
        const double center[] = {e.center.x, e.center.y, e.center.z};
        const double factor[] = {0.5 * e.l11, 0.5 * e.l21, 0.5 * e.l22, 0.5 * e.l31, 0.5 * e.l32, 0.5 * e.l33};
        format::quantise(levels[1].nodes.emplace_back(), lattice, center, factor);
    });
    levels[0].nodes.push_back(levels[1].nodes[0]);
    levels[0].nodes[0].child_count = static_cast<uint8_t>(levels[1].nodes.size());
    BakeInfo info = tree.bake_info();
    info.inner = true;
    format::append_section(bytes, {'I', 'N', 'N', 'R'}, format::encode(info, 12, lattice, levels));
    return bytes;
}

TEST(Bits, Solids) {
    std::vector<std::vector<std::byte>> bytes;
    for (size_t i = 0; i < 2; ++i) bytes.push_back(with_inner(all_scenes().bytes[i]));
    const Solid a(*TreeView::open(bytes[0])), b(*TreeView::open(bytes[1]));
    ASSERT_TRUE(a.inner() && b.inner());
    uint32_t counts[3] = {};
    expect_bits(14287475617092980122u, [&](Bits& bits, const Scenes::Pair& p) {
        const SolidsResult r = collide(a, p.pose_a, b, p.pose_b, context(), {.margin = 0.01f});
        const SolidsDistance d = distance(a, p.pose_a, b, p.pose_b, context());
        ContactManifolds manifolds;
        const SolidsContacts c = contacts(a, p.pose_a, b, p.pose_b, manifolds, context());
        bits.add_all(r.verdict, r.out_of_budget, r.stats, d.verdict, d.lower, d.upper, d.point_a, d.point_b, d.stats);
        bits.add_all(c.verdict, c.depth_lower, c.depth_upper, c.way_out, c.found, c.stats, manifolds.count);
        ++counts[static_cast<int>(r.verdict)];
    });
    for (const uint32_t count : counts) EXPECT_GT(count, 10u);
}

// Two modes that shift, enlarge and round nodes, and displace points, by whatever comes.
std::vector<std::byte> with_modes(std::vector<std::byte> bytes, uint64_t seed) {
    constexpr uint32_t kModes = 2;
    const TreeView tree = *TreeView::open(bytes);
    const bool exact = tree.has_triangles();
    const uint32_t points = exact ? tree.vertex_count() : 1;
    std::vector<std::byte> content(static_cast<size_t>(deformation_bytes(kModes, tree.slot_count(), points, exact)));
    store_le(content.data() + kModeCount, kModes), store_le(content.data() + kPointCount, points);
    for (size_t row = kModeRows; row < motions_begin(kModes); row += kModeRowBytes) {
        store_le(content.data() + row + kModeRange, 0.5f);
        for (const size_t step : {kShiftStep, kGrowthStep, kRadiusStep})
            store_le(content.data() + row + step, 0x1p-16f);
    }
    Random random(seed);
    tree.for_each_node([&](uint32_t node) {
        for (uint32_t mode = 0; mode < kModes; ++mode) {
            std::byte* const at =
                content.data() + motions_begin(kModes) + (size_t{node} * kModes + mode) * kMotionBytes;
            for (size_t i = 0; i < 3; ++i)
                store_le(at + kShift + 2 * i, static_cast<int16_t>(static_cast<int>(random.below(20000)) - 10000));
            store_le(at + kGrowth, static_cast<uint16_t>(random.below(6000) | random.below(2) * kIsRadius));
        }
    });
    for (size_t at = static_cast<size_t>(points_begin(kModes, tree.slot_count())); at < content.size(); at += 4)
        store_le(content.data() + at, static_cast<float>(random.in(-0.1, 0.1)));
    format::append_section(bytes, kDeformationKind, content);
    return bytes;
}

TEST(Bits, Deformed) {
    std::vector<std::vector<std::byte>> bytes;
    for (size_t i = 0; i < all_scenes().bytes.size(); ++i) bytes.push_back(with_modes(all_scenes().bytes[i], i));
    const auto moving = [&](const TreeView& tree) { // the same with modes
        for (size_t i = 0; i < bytes.size(); ++i)
            if (tree.bytes().data() == all_scenes().bytes[i].data()) return *TreeView::open(bytes[i]);
        return tree;
    };
    uint32_t counts[3] = {};
    expect_bits(17898674127223268724u, [&](Bits& bits, const Scenes::Pair& p) {
        const float q_a[] = {p.pose_a.rotation.x / 2, p.pose_a.rotation.y / 2}, q_b[] = {0, p.pose_b.rotation.z / 2};
        const DeformedBody a{moving(p.a), p.pose_a, q_a}, b{moving(p.b), p.pose_b, q_b};
        const DeformedCollideResult r = collide(a, b, context(), {.max_pair_tests = 20000, .margin = 0.01f});
        bits.add_all(r.verdict, r.enclosed, r.pair, r.stats);
        const DeformedDistanceResult d =
            distance(a, b, context(), {.tolerance_relative = 1e-3, .max_pair_tests = 20000});
        bits.add_all(d.verdict, d.enclosed, d.lower, d.upper, d.point_a, d.point_b, d.normal, d.pair, d.stats);
        const Vec3 from = p.pose_a.translation, to = p.pose_b.translation;
        const DeformedRaycastResult hit =
            raycast(b, {from, {to.x - from.x, to.y - from.y, to.z - from.z}, 2}, context());
        bits.add_all(hit.verdict, hit.t, hit.clear, hit.point, hit.normal, hit.node, hit.triangle, hit.stats);
        const Bounds box = bounds(a);
        bits.add_all(box.lower, box.upper);
        ++counts[static_cast<int>(d.verdict)];
    });
    EXPECT_GT(counts[0], 50u);
    EXPECT_GT(counts[1], 50u);
}

TEST(Bits, Sweep) {
    expect_bits(1940080605202444642u, [](Bits& bits, const Scenes::Pair& p) {
        const Vec3 from = p.pose_b.translation, to = p.pose_a.translation;
        const Motion a{p.pose_a, {}, {0.3f, -1, 0.2f}, {}};
        const Motion b{p.pose_b, {to.x - from.x, to.y - from.y, to.z - from.z}, {1, 2, -0.5f}, {}};
        const SweepResult r = sweep(p.a, a, p.b, b, context(), {.tolerance = 1e-3});
        bits.add_all(r.verdict, r.enclosed, r.time_lower, r.time_upper, r.distance, r.point_a, r.point_b, r.normal,
                     r.pair, r.stats);
    });
}

TEST(Bits, Raycast) {
    expect_bits(15639186168566921961u, [](Bits& bits, const Scenes::Pair& p) {
        const Vec3 from = p.pose_a.translation, to = p.pose_b.translation;
        const Ray ray{from, {to.x - from.x, to.y - from.y, to.z - from.z}, 2};
        for (const float margin : {0.0f, 0.05f}) {
            const RaycastResult r = raycast(p.b, p.pose_b, ray, context(), {.margin = margin});
            bits.add_all(r.verdict, r.t, r.clear, r.point, r.normal, r.node, r.triangle, r.stats);
        }
    });
}

TEST(Bits, Overlap) {
    expect_bits(7552293217359177587u, [](Bits& bits, const Scenes::Pair& p) {
        const Vec3 from = p.pose_a.translation, to = p.pose_b.translation;
        const auto add = [&](const auto& shape) {
            const OverlapResult r = overlap(p.b, p.pose_b, shape, context());
            bits.add_all(r.verdict, r.enclosed, r.node, r.triangle, r.stats);
        };
        add(Sphere{from, 0.5f});
        add(Capsule{from, {(from.x + to.x) / 2, (from.y + to.y) / 2, (from.z + to.z) / 2}, 0.1f});
        add(Box{p.pose_a, {0.2f, 0.4f, 0.6f}});
        add(HalfSpace{{to.x - from.x, to.y - from.y, to.z - from.z}, 0.5f});
    });
}

TEST(Bits, PairsOfEllipsoids) {
    expect_bits(17873534165635833303u, [](Bits& bits, const Scenes::Pair& p) {
        const Ellipsoid a = p.a.ellipsoid(0), b = p.b.ellipsoid(0);
        const PairDistance d = distance(a, p.pose_a, b, p.pose_b);
        bits.add_all(collide(a, p.pose_a, b, p.pose_b), d.lower, d.upper, d.normal, d.point_a, d.point_b);
    });
}

TEST(Bits, BatchesOfEllipsoids) {
    targets::for_each([&](const char* target) {
        std::vector<Ellipsoid> shapes;
        std::vector<Pose> poses;
        std::vector<IndexPair> pairs;
        for (const Scenes::Pair& p : all_scenes().pairs) {
            const auto n = static_cast<uint32_t>(shapes.size());
            shapes.push_back(p.a.ellipsoid(0)), shapes.push_back(p.b.ellipsoid(0));
            poses.push_back(p.pose_a), poses.push_back(p.pose_b);
            pairs.push_back({n, n + 1});
        }
        std::vector<WorldEllipsoid> world(shapes.size());
        place(shapes, poses, world);
        std::vector<Verdict> verdicts(pairs.size());
        std::vector<PairDistance> distances(pairs.size());
        collide({shapes, poses, world}, pairs, verdicts);
        distance({shapes, poses, world}, pairs, distances, 1e-3f);
        Bits bits;
        for (const Verdict v : verdicts) bits.add(v);
        for (const PairDistance& d : distances) bits.add_all(d.lower, d.upper, d.normal, d.point_a, d.point_b);
        EXPECT_EQ(bits.hash(), 5758939381866085698u) << target;
    });
}

TEST(Bits, Bounds) {
    expect_bits(2981268794259395762u, [](Bits& bits, const Scenes::Pair& p) {
        const Bounds box = bounds(p.a, p.pose_a);
        bits.add_all(box.lower, box.upper);
    });
}

} // namespace
} // namespace prolate

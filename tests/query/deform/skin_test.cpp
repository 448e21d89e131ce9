// Bodies that bones move: what nodes stand for stays in them at any matrices, and queries miss nothing.
#include "query/deform/body.hpp"
#include "query/ellipsoid/nearest_direction.hpp"
#include "query/triangle/separation.hpp"
#include "src/skin.hpp"
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/deform.hpp>
#include <prolate/rig.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace prolate {
namespace {

using glm::dvec3;
using scenes::Random;

// A mesh whose bones stand along x, one a unit; vertices between two of them take parts of both, and some a little of a
// third. With modes, if asked for.
struct Skinned {
    explicit Skinned(Mesh surface, uint32_t bone_count, uint32_t modes = 0, uint64_t seed = 1)
        : mesh(std::move(surface)), bones(bone_count) {
        Random random(seed);
        for (const Vec3& v : mesh.vertices) {
            const double at = std::clamp(double{v.x} + 0.5 * (bones - 1), 0.0, bones - 1.0);
            const auto low = static_cast<uint16_t>(std::min(std::floor(at), bones - 2.0));
            const double t = std::clamp(2 * (at - low) - 0.5, 0.0, 1.0), little = v.y > 0.1f ? 0.1 : 0;
            const auto third = static_cast<uint16_t>((low + 2) % bones);
            const double parts[] = {(1 - t) * (1 - little), t * (1 - little), little};
            const uint16_t which[] = {low, static_cast<uint16_t>(low + 1), third == low ? uint16_t{0} : third};
            for (size_t i = 0; i < 3; ++i) {
                const bool twice = i == 2 && (which[2] == which[0] || which[2] == which[1]);
                indices.push_back(which[i]), weights.push_back(twice ? 0 : static_cast<float>(parts[i]));
            }
            if (which[2] == which[0] || which[2] == which[1])
                weights[weights.size() - 3] += static_cast<float>(parts[2]);
        }
        for (uint32_t m = 0; m < modes; ++m) {
            const scenes::Point along = random.direction(), to = random.direction();
            for (const Vec3& v : mesh.vertices)
                for (const double x : to)
                    displacements.push_back(
                        static_cast<float>(0.1 * x * std::sin(2 * (along[0] * v.x + along[1] * v.y + along[2] * v.z))));
            ranges.push_back(1);
        }
    }

    BoneWeights skin() const { return {bones, 3, indices, weights}; }
    Modes modes() const { return {displacements, ranges}; }
    // By the words of skin.hpp and deformation.hpp.
    dvec3 moved(uint32_t v, const std::vector<float>& q, const std::vector<BoneMatrix>& at) const {
        const Vec3& x = mesh.vertices[v];
        dvec3 rest(x.x, x.y, x.z), out(0);
        for (size_t m = 0; m < q.size(); ++m) {
            const float* const u = displacements.data() + 3 * (m * mesh.vertices.size() + v);
            rest += double{q[m]} * dvec3(u[0], u[1], u[2]);
        }
        if (at.empty()) return rest;
        double sum = 0;
        for (size_t i = 0; i < 3; ++i) {
            const double w = weights[3 * v + i];
            const auto& t = at[indices[3 * v + i]].m;
            for (int k = 0; k < 3; ++k)
                out[k] += w * (double{t[k][0]} * rest.x + double{t[k][1]} * rest.y + double{t[k][2]} * rest.z +
                               double{t[k][3]});
            sum += w;
        }
        return out / sum;
    }
    Tree bake(bool exact, uint32_t ellipsoids = 24) const {
        BuildOptions options = quick(0);
        options.exact = exact, options.threads = 1, options.degree = exact ? 8 : 4;
        if (!exact) options.ellipsoids = ellipsoids;
        Tree out = std::move(must_build(mesh, options).tree);
        const auto take = [&out](Result<Tree> tree) {
            if (!tree) throw std::runtime_error(tree.error().what);
            out = std::move(*tree);
        };
        if (!ranges.empty()) take(add_modes(out.view(), mesh.view(), modes()));
        take(add_skin(out.view(), mesh.view(), skin()));
        return out;
    }
    std::vector<float> random_q(Random& random) const {
        std::vector<float> q;
        for (const float r : ranges) q.push_back(static_cast<float>(random.in(-1, 1)) * r);
        return q;
    }

    Mesh mesh;
    uint32_t bones;
    std::vector<uint16_t> indices;
    std::vector<float> weights, displacements, ranges;
};

BoneMatrix matrix_of(const Quat& rotation, const dvec3& translation, const dvec3& scale = dvec3(1)) {
    const glm::dmat3 r = query::rotation_matrix(rotation);
    BoneMatrix out;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) out.m[i][k] = static_cast<float>(r[k][i] * scale[k]);
        out.m[i][3] = static_cast<float>(translation[i]);
    }
    return out;
}

// That turns by `rotation` more than the bone before, about the point (`joint`, 0, 0) of the mesh.
BoneMatrix joined_to(const BoneMatrix& before, const Quat& rotation, double joint) {
    glm::dmat3 linear;
    dvec3 at;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) linear[k][i] = double{before.m[i][k]};
        at[i] = double{before.m[i][0]} * joint + double{before.m[i][3]};
    }
    linear = linear * query::rotation_matrix(rotation);
    BoneMatrix out;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) out.m[i][k] = static_cast<float>(linear[k][i]);
        out.m[i][3] = static_cast<float>(at[i] - linear[0][i] * joint);
    }
    return out;
}

// Of many kinds: bent at the joints by any angle, any rotation of each, scales, shears, mirrored, flat, all to a point.
std::vector<BoneMatrix> random_bones(Random& random, uint32_t count) {
    std::vector<BoneMatrix> out;
    const uint32_t kind = random.below(4);
    for (uint32_t b = 0; b < count; ++b) {
        const Quat rotation = random.rotation();
        if (kind == 3 && b > 0) { // a chain
            out.push_back(joined_to(out.back(), rotation, b - 0.5 - 0.5 * (count - 1)));
            continue;
        }
        dvec3 scale(1), to(random.in(-0.5, 0.5), random.in(-0.5, 0.5), random.in(-0.5, 0.5));
        if (kind == 1) scale = {random.in(-2, 2), random.in(-2, 2), random.in(0, 2)};
        if (kind == 2 && random.below(3) == 0) scale = dvec3(0);
        out.push_back(matrix_of(rotation, to, scale));
    }
    return out;
}

Mesh bar() {
    Mesh out = shapes::icosphere(3);
    for (Vec3& v : out.vertices) v = {2 * v.x, 0.3f * v.y, 0.3f * v.z};
    return out;
}
const Skinned& limb() {
    static const Skinned out(bar(), 4);
    return out;
}
const Tree& limb_cover() {
    static const Tree out = limb().bake(false);
    return out;
}
const Tree& limb_exact() {
    static const Tree out = limb().bake(true);
    return out;
}
const Skinned& ring() { // with modes, too
    static const Skinned out(shapes::torus(1, 0.3f, 20, 10), 3, 2);
    return out;
}
const Tree& ring_cover() {
    static const Tree out = ring().bake(false, 16);
    return out;
}
const Tree& ring_exact() {
    static const Tree out = ring().bake(true);
    return out;
}

bool holds(const query::Bound& bound, const dvec3& x) {
    constexpr double kRounding = 1e-9;
    const dvec3 r = x - bound.core.center;
    if (glm::length(r) <= bound.radius + kRounding) return true;
    const glm::dmat3& f = bound.core.factor;
    const dvec3 n = glm::normalize(query::nearest_direction(f, f * glm::transpose(f), r));
    // Where the direction is not to be had, the point lies within.
    return !(glm::dot(n, r) - glm::length(n * f) > bound.radius + kRounding);
}

bool at_rest_in(const TreeView& tree, uint32_t node, const dvec3& x) {
    const Ellipsoid e = tree.bound(node);
    const dvec3 r = x - dvec3(e.center.x, e.center.y, e.center.z);
    const double u = r.x / e.l11, v = (r.y - e.l21 * u) / e.l22, w = (r.z - e.l31 * u - e.l32 * v) / e.l33;
    return u * u + v * v + w * w <= 1 + 1e-12;
}

// Moved into all nodes above the leaves that hold it at rest; `any` such leaf.
bool held_at_every_level(const query::Deformed& body, uint32_t node, const dvec3& rest, const dvec3& x, bool& any) {
    const ChildRange children = body.tree().children(node);
    bool below = false, all = true;
    for (uint32_t c = children.first; c < children.first + children.count; ++c) {
        bool here = false;
        all = held_at_every_level(body, c, rest, x, here) && all;
        below = below || here;
    }
    any = children.count == 0 ? at_rest_in(body.tree(), node, rest) : below;
    return all && (!any || holds(body.bound(node), x));
}

class SkinQuery : public testing::Test {
protected:
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    QueryContext& context() { return *context_; }
};

TEST_F(SkinQuery, PointsStayInTheNodesThatStandForThem) {
    Random random(3);
    const struct {
        const Skinned& body;
        const Tree& tree;
    } cases[] = {{limb(), limb_cover()}, {ring(), ring_cover()}};
    for (const auto& [body, tree] : cases)
        for (int i = 0; i < 200; ++i) {
            const auto q = body.random_q(random);
            const auto bones = random_bones(random, body.bones);
            const DeformedBody deformed{tree.view(), {}, q, bones};
            const query::Deformed moved(deformed, 99);
            ASSERT_TRUE(moved.in_range());
            for (int k = 0; k < 40; ++k) {
                const Triangle& t =
                    body.mesh.triangles[random.below(static_cast<uint32_t>(body.mesh.triangles.size()))];
                const double s = random.unit(), r = random.in(0, 1 - s), u = 1 - s - r;
                const auto mean = [&](const auto& of) { return s * of(t[0]) + r * of(t[1]) + u * of(t[2]); };
                const dvec3 rest = mean([&](uint32_t v) { return body.moved(v, {}, {}); }),
                            x = mean([&](uint32_t v) { return body.moved(v, q, bones); });
                bool any = false;
                ASSERT_TRUE(held_at_every_level(moved, 0, rest, x, any)) << i;
                EXPECT_TRUE(any) << i; // in some leaf
            }
        }
}

TEST_F(SkinQuery, TrianglesOfExactTreesStayInAllNodesAboveThem) {
    Random random(4);
    const struct {
        const Skinned& body;
        const Tree& tree;
    } cases[] = {{limb(), limb_exact()}, {ring(), ring_exact()}};
    for (const auto& [body, owned] : cases) {
        const TreeView tree = owned.view();
        std::vector<uint32_t> parent(tree.slot_count());
        tree.for_each_node([&](uint32_t node) {
            const ChildRange children = tree.children(node);
            for (uint32_t c = 0; c < children.count; ++c) parent[children.first + c] = node;
        });
        for (int i = 0; i < 100; ++i) {
            const auto q = body.random_q(random);
            const auto bones = random_bones(random, body.bones);
            const DeformedBody deformed{tree, {}, q, bones};
            const query::Deformed moved(deformed, 99);
            std::vector<query::Bound> bounds(tree.slot_count());
            tree.for_each_node([&](uint32_t node) { bounds[node] = moved.bound(node); });
            tree.for_each_node([&](uint32_t leaf) {
                const TriangleRange triangles = tree.triangles(leaf);
                for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t)
                    for (const dvec3& corner : moved.triangle(t).corner)
                        for (uint32_t node = leaf;; node = parent[node]) {
                            ASSERT_TRUE(holds(bounds[node], corner)) << i;
                            if (node == 0) break;
                        }
            });
        }
    }
}

// The moved triangles of a body in the world, all of them.
std::vector<query::PlacedTriangle> placed(const Skinned& body, const std::vector<float>& q,
                                          const std::vector<BoneMatrix>& bones, const Pose& pose) {
    const glm::dmat3 rotation = query::rotation_matrix(pose.rotation);
    std::vector<query::PlacedTriangle> out;
    for (const Triangle& t : body.mesh.triangles) {
        query::PlacedTriangle p{};
        for (size_t c = 0; c < 3; ++c)
            p.corner[c] = rotation * body.moved(t[c], q, bones) + query::to_double(pose.translation);
        p.reach = 20;
        out.push_back(p);
    }
    return out;
}

bool meet(const std::vector<query::PlacedTriangle>& a, const std::vector<query::PlacedTriangle>& b) {
    const auto low = [](const query::PlacedTriangle& t) {
        return glm::min(t.corner[0], glm::min(t.corner[1], t.corner[2]));
    };
    const auto high = [](const query::PlacedTriangle& t) {
        return glm::max(t.corner[0], glm::max(t.corner[1], t.corner[2]));
    };
    for (const auto& x : a)
        for (const auto& y : b) {
            if (glm::any(glm::greaterThan(low(x), high(y))) || glm::any(glm::greaterThan(low(y), high(x)))) continue;
            if (!query::separated(x, y)) return true;
        }
    return false;
}

TEST_F(SkinQuery, CollideAndDistanceMissNothingThatMovedTrianglesMeet) {
    Random random(5);
    int counts[2] = {};
    for (int i = 0; i < 300; ++i) {
        const auto bones_a = random_bones(random, limb().bones), bones_b = random_bones(random, ring().bones);
        const auto q_b = ring().random_q(random);
        const scenes::Point d = random.direction();
        const double r = random.in(0, 4);
        const Pose pose_a{{}, random.rotation()}, pose_b{scenes::to_float({r * d[0], r * d[1], r * d[2]}), {}};
        const bool truth = meet(placed(limb(), {}, bones_a, pose_a), placed(ring(), q_b, bones_b, pose_b));
        ++counts[truth];
        for (const bool exact_a : {false, true})
            for (const bool exact_b : {false, true}) {
                const DeformedBody a{(exact_a ? limb_exact() : limb_cover()).view(), pose_a, {}, bones_a},
                    b{(exact_b ? ring_exact() : ring_cover()).view(), pose_b, q_b, bones_b};
                const auto found = collide(a, b, context());
                ASSERT_EQ(found.reason, Undecided::no);
                const auto apart = distance(a, b, context());
                if (truth) {
                    ASSERT_EQ(found.verdict, Verdict::overlapping) << i;
                    ASSERT_EQ(apart.lower, 0) << i;
                } else if (exact_a && exact_b && !found.enclosed) {
                    EXPECT_EQ(found.verdict, Verdict::separated) << i;
                }
                EXPECT_EQ(collide(b, a, context()).verdict, found.verdict);
                const auto shallow = collide(a, b, context(), {.max_level = static_cast<uint32_t>(i) % 3u}).verdict;
                if (truth) {
                    EXPECT_EQ(shallow, Verdict::overlapping);
                }
            }
    }
    EXPECT_GT(counts[0], 60);
    EXPECT_GT(counts[1], 60);
}

// Bounds are not so large that nothing is apart: a limb bent at its joints, beside a ball.
TEST_F(SkinQuery, CoversTellMostBentLimbsApart) {
    Random random(9);
    const Build ball = must_build(shapes::moved(shapes::icosphere(2), {}, 0.5f), quick(1));
    int by_exact = 0, by_cover = 0;
    for (int i = 0; i < 500; ++i) {
        std::vector<BoneMatrix> bones(1);
        for (uint32_t b = 1; b < limb().bones; ++b) {
            const scenes::Point axis = random.direction();
            const double half = random.in(0, 0.4), s = std::sin(half); // by up to 46 degrees
            const Quat bend{static_cast<float>(s * axis[0]), static_cast<float>(s * axis[1]),
                            static_cast<float>(s * axis[2]), static_cast<float>(std::cos(half))};
            bones.push_back(joined_to(bones.back(), bend, b - 0.5 - 0.5 * (limb().bones - 1)));
        }
        const scenes::Point d = random.direction();
        const double r = random.in(0.5, 3);
        const DeformedBody other{ball.tree.view(), {scenes::to_float({r * d[0], r * d[1], r * d[2]}), {}}};
        const auto apart = [&](const Tree& tree) {
            return collide({tree.view(), {}, {}, bones}, other, context()).verdict == Verdict::separated;
        };
        by_exact += apart(limb_exact());
        by_cover += apart(limb_cover());
    }
    EXPECT_GT(by_exact, 100);
    EXPECT_GT(by_cover, by_exact / 2) << by_exact;
}

TEST_F(SkinQuery, RaysHitWhatBonesMoved) {
    Random random(6);
    for (int i = 0; i < 300; ++i) {
        const auto bones = random_bones(random, ring().bones);
        const auto q = ring().random_q(random);
        const Triangle& t = ring().mesh.triangles[random.below(static_cast<uint32_t>(ring().mesh.triangles.size()))];
        const dvec3 to =
            (ring().moved(t[0], q, bones) + ring().moved(t[1], q, bones) + ring().moved(t[2], q, bones)) / 3.0;
        const scenes::Point d = random.direction();
        const dvec3 origin = 8.0 * dvec3(d[0], d[1], d[2]);
        const Ray ray{query::to_float(origin), query::to_float(to - origin)};
        const auto exact = raycast({ring_exact().view(), {}, q, bones}, ray, context());
        const auto cover = raycast({ring_cover().view(), {}, q, bones}, ray, context());
        ASSERT_EQ(cover.verdict, Verdict::overlapping) << i;
        if (exact.verdict == Verdict::overlapping) { // or a float's rounding misses a triangle of no area
            EXPECT_LE(cover.t, exact.t + 1e-6);
        }
        const double area = glm::length(glm::cross(ring().moved(t[1], q, bones) - ring().moved(t[0], q, bones),
                                                   ring().moved(t[2], q, bones) - ring().moved(t[0], q, bones)));
        if (area > 1e-4) {
            ASSERT_EQ(exact.verdict, Verdict::overlapping) << i;
            EXPECT_LE(exact.t, 1 + 1e-3);
        }
    }
}

// Where all bones move alike, nothing is lost: the body is that of a pose.
TEST_F(SkinQuery, AnAffineMapOfAllBonesIsExact) {
    Random random(7);
    for (int i = 0; i < 200; ++i) {
        const Quat rotation = random.rotation();
        const dvec3 by(random.in(-1, 1), random.in(-1, 1), random.in(-1, 1));
        const std::vector<BoneMatrix> bones(limb().bones, matrix_of(rotation, by));
        const Pose pose{query::to_float(by), rotation};
        for (const TreeView& tree : {limb_cover().view(), limb_exact().view()}) {
            const DeformedBody skinned{tree, {}, {}, bones}, other{ring_cover().view(), {{2, 1, 0}, {}}};
            const double by_bones = distance(skinned, other, context()).lower,
                         by_pose = distance(DeformedBody{tree, pose}, other, context()).lower;
            EXPECT_NEAR(by_bones, by_pose, 2e-6 * (1 + by_pose)) << i;
        }
    }
}

TEST_F(SkinQuery, ScaledTreesAreScaledBodies) {
    Random random(8);
    const TreeView tree = limb_cover().view(), large = *tree.scaled(2);
    for (int i = 0; i < 100; ++i) {
        const auto bones = random_bones(random, limb().bones);
        const Pose pose{{1.5f, 0, static_cast<float>(random.in(0, 2))}, {}},
            doubled{{3, 0, 2 * pose.translation.z}, {}};
        EXPECT_EQ(collide({large, {}, {}, bones}, {large, doubled}, context()).verdict,
                  collide({tree, {}, {}, bones}, {tree, pose}, context()).verdict);
    }
}

TEST_F(SkinQuery, MatricesThatNothingHoldsForAreUndecided) {
    const TreeView tree = limb_cover().view();
    const DeformedBody far{ring_cover().view(), {{100, 0, 0}, {}}};
    const auto reason = [&](const std::vector<BoneMatrix>& bones) {
        const DeformedBody body{tree, {}, {}, bones};
        const auto found = collide(body, far, context());
        EXPECT_EQ(found.verdict, found.reason == Undecided::no ? Verdict::separated : Verdict::undecided);
        EXPECT_EQ(raycast(body, Ray{}, context()).reason, found.reason);
        EXPECT_EQ(distance(body, far, context()).reason, found.reason);
        return found.reason;
    };
    EXPECT_EQ(reason({}), Undecided::no);
    EXPECT_EQ(reason(std::vector<BoneMatrix>(4)), Undecided::no);
    EXPECT_EQ(reason(std::vector<BoneMatrix>(3)), Undecided::coordinates);
    EXPECT_EQ(reason(std::vector<BoneMatrix>(5)), Undecided::coordinates);
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), HUGE_VALF, -HUGE_VALF, 1025.0f}) {
        std::vector<BoneMatrix> bones(4);
        bones[3].m[1][2] = bad;
        EXPECT_EQ(reason(bones), Undecided::coordinates);
    }
    std::vector<BoneMatrix> bones(4);
    bones[0].m[2][3] = 3e22f;
    EXPECT_EQ(reason(bones), Undecided::coordinates);
    // Of a tree without a skin there are none.
    const Build rigid = must_build(shapes::icosphere(1), quick(1));
    EXPECT_EQ(collide({rigid.tree.view(), {}, {}, bones}, far, context()).reason, Undecided::coordinates);
}

TEST_F(SkinQuery, BonesThatMapAllToAPointMakeOne) {
    const std::vector<BoneMatrix> zero(3, BoneMatrix{.m = {}});
    for (const Tree* point : {&ring_cover(), &ring_exact()})
        for (const Tree* bar : {&limb_cover(), &limb_exact()}) {
            const DeformedBody a{point->view(), {}, {}, zero}, apart{bar->view(), {{0, 1, 0}, {}}}, around{bar->view()};
            EXPECT_EQ(collide(a, apart, context()).verdict, Verdict::separated);
            EXPECT_EQ(collide(apart, a, context()).verdict, Verdict::separated);
            EXPECT_EQ(collide(a, around, context()).verdict, Verdict::overlapping);
            EXPECT_EQ(collide(around, a, context()).verdict, Verdict::overlapping);
            const DeformedDistanceResult found = distance(a, apart, context()), swapped = distance(apart, a, context());
            EXPECT_EQ(found.verdict, Verdict::separated);
            EXPECT_NEAR(found.lower, found.upper, 1e-6);
            EXPECT_NEAR(swapped.upper, found.upper, 1e-6);
            EXPECT_EQ(bounds(a).lower.x, -bounds(a).upper.x);
            EXPECT_LT(bounds(a).upper.x, 1e-12f);
            const Ray from_afar{{0, 5, 0}, {0, -1, 0}}, without_direction{{0, 0, 0}, {0, 0, 0}, 1};
            EXPECT_NEAR(raycast(a, from_afar, context()).t, 5, 1e-6);
            EXPECT_EQ(raycast(a, without_direction, context()).reason, Undecided::input);
        }
}

TEST(Skin, ProofNoticesWhatIsTooSmall) {
    const TreeView tree = limb_cover().view();
    const auto proof = verify_skin(tree, limb().mesh.view(), limb().skin());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->proved);
    const auto content = tree.section(0).content;
    ASSERT_EQ(std::memcmp(tree.section(0).kind, kSkinKind, 4), 0);
    const auto begin = static_cast<size_t>(content.data() - tree.bytes().data());
    const auto planted = [&](size_t at, auto value) {
        std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
        std::memcpy(bytes.data() + begin + at, &value, sizeof value);
        const auto other = TreeView::open(bytes, {.check_hash = false});
        if (!other) throw std::runtime_error(other.error().what);
        return *verify_skin(*other, limb().mesh.view(), limb().skin());
    };
    size_t at = static_cast<size_t>(influences_begin(tree.slot_count()));
    uint32_t found = 0;
    tree.for_each_node([&](uint32_t node) {
        for (uint32_t i = 0; i < tree.skin()->influence_count(node); ++i, at += kInfluenceBytes) {
            const Skin::Influence of = tree.skin()->influence(node, i);
            const auto is_this = [&](const SkinProof& p) { return !p.proved && p.node == node && p.bone == of.bone; };
            if (of.radius > 0) {
                EXPECT_TRUE(is_this(planted(at + kInfluenceRadius, static_cast<float>(of.radius * 0.99999))));
            }
            if (of.spread * kWeightSteps < 2) continue; // also of a leaf that stands for no surface
            const auto spread = static_cast<uint16_t>(of.spread * kWeightSteps);
            EXPECT_TRUE(is_this(planted(at + kInfluenceSpread, static_cast<uint16_t>(spread - 1 - (spread > 9)))));
            ++found;
        }
    });
    EXPECT_GT(found, 20u);
    // A weight of a point of the mesh.
    EXPECT_FALSE(planted(content.size() - 3 * 6, 0.75f).proved);
}

TEST(Skin, BadWeightsAreRefused) {
    const Skinned& body = limb();
    const Build built = must_build(body.mesh, quick(1));
    const auto error = [&](BoneWeights weights, uint64_t where = 0) {
        const auto tree = add_skin(built.tree.view(), body.mesh.view(), weights);
        if (!tree) {
            EXPECT_EQ(tree.error().where, where);
        }
        return tree ? std::string() : std::string(tree.error().what);
    };
    const auto mentions = [](const std::string& text, const char* word) { return text.find(word) != text.npos; };
    EXPECT_EQ(error(body.skin()), "");
    BoneWeights weights = body.skin();
    weights.bones = 3;
    const auto named = std::find(body.indices.begin(), body.indices.end(), 3) - body.indices.begin();
    EXPECT_TRUE(mentions(error(weights, static_cast<uint64_t>(named) / 3), "does not exist"));
    weights.bones = 0;
    EXPECT_TRUE(mentions(error(weights), "1 to 1024"));
    weights = body.skin(), weights.each = 9;
    EXPECT_TRUE(mentions(error(weights, 9), "1 to 8"));
    weights = body.skin(), weights.weights = weights.weights.first(6);
    EXPECT_TRUE(mentions(error(weights, body.mesh.vertices.size()), "number of vertices"));
    const auto with = [&](size_t at, float value) {
        std::vector<float> other = body.weights;
        other[at] = value;
        return error({body.bones, 3, body.indices, other}, at / 3);
    };
    EXPECT_TRUE(mentions(with(15, std::numeric_limits<float>::quiet_NaN()), "not finite"));
    EXPECT_TRUE(mentions(with(15, -0.25f), "below 0"));
    EXPECT_TRUE(mentions(with(15, 1.5f), "add up to 1"));
    std::vector<uint16_t> twice = body.indices;
    const auto two = static_cast<size_t>(
        std::adjacent_find(body.weights.begin(), body.weights.end(), [](float a, float b) { return a > 0 && b > 0; }) -
        body.weights.begin());
    twice[two + 1] = twice[two];
    EXPECT_TRUE(mentions(error({body.bones, 3, twice, body.weights}, two / 3), "two weights"));
    EXPECT_FALSE(add_skin(limb_cover().view(), body.mesh.view(), body.skin())); // has one already
    EXPECT_FALSE(add_skin(built.tree.view(), ring().mesh.view(), ring().skin()));
}

// Every byte that is damaged is found, with hashes; and without, what is opened answers without harm.
TEST_F(SkinQuery, DamagedSectionsAreRefusedOrHarmless) {
    Random random(11);
    int opened = 0;
    for (const Tree* tree : {&limb_cover(), &ring_exact()}) {
        const TreeView whole = tree->view();
        const auto content = whole.section(whole.section_count() - 1).content;
        const auto begin = static_cast<size_t>(content.data() - whole.bytes().data());
        for (int i = 0; i < 1500; ++i) {
            std::vector<std::byte> bytes(whole.bytes().begin(), whole.bytes().end());
            const size_t at =
                begin + (i % 2 == 0 ? random.below(80) : random.below(static_cast<uint32_t>(content.size())));
            bytes[at] ^= static_cast<std::byte>(1 + random.below(255));
            EXPECT_FALSE(TreeView::open(bytes));
            const auto view = TreeView::open(bytes, {.check_hash = false});
            if (!view || !view->skin()) continue;
            ++opened;
            const auto bones = random_bones(random, view->skin()->bone_count());
            const auto found = collide({*view, {}, {}, bones}, {*view, {{2, 0, 0}, {}}}, context());
            EXPECT_EQ(found.reason, Undecided::no);
            raycast({*view, {}, {}, bones}, Ray{{-4, 0, 0}, {1, 0, 0}}, context());
        }
    }
    EXPECT_GT(opened, 300);
}

} // namespace
} // namespace prolate

#include "viewer/query_module.hpp"

#include <prolate/collide.hpp>
#include <prolate/distance.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <optional>

namespace {

using namespace prolate;

// query.js and query_bits.mjs count on it.
static_assert(sizeof(ViewerAnswer) == sizeof(double) * (20 + 2 * kAnswerLevels + 1));

// Deeply overlapping bodies have more pairs than anyone wants to wait for.
constexpr uint64_t kBudget = 1'000'000;

struct Body {
    std::unique_ptr<std::byte[]> bytes;
    uint32_t size = 0;
    std::optional<TreeView> tree;
    Pose pose;
    float pose_numbers[7] = {0, 0, 0, 0, 0, 0, 1};

    void read_pose() {
        const float* p = pose_numbers;
        pose = {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
    }
};

Body bodies[2];
QueryContext context;
MeetingPair meeting[kAnswerPairs];
uint32_t meeting_nodes[2 * kAnswerPairs];
ViewerAnswer answer;

void fill_collide(const TreeView& a, const TreeView& b) {
    const CollideResult found = collide(a, bodies[0].pose, b, bodies[1].pose, context);
    answer.verdict = static_cast<double>(found.verdict);
    answer.enclosed = found.enclosed;
    answer.node_a = found.pair.node_a, answer.node_b = found.pair.node_b;
    answer.triangle_a = found.pair.triangle_a, answer.triangle_b = found.pair.triangle_b;
    answer.pair_tests = static_cast<double>(found.stats.pair_tests);
    answer.block_tests = static_cast<double>(found.stats.block_tests);
    answer.triangle_tests = static_cast<double>(found.stats.triangle_tests);
}

void fill_distance(const TreeView& a, const TreeView& b) {
    const DistanceResult found = distance(a, bodies[0].pose, b, bodies[1].pose, context);
    answer.lower = found.lower, answer.upper = found.upper;
    const auto copy = [](const Vec3& p, double(&to)[3]) { to[0] = p.x, to[1] = p.y, to[2] = p.z; };
    copy(found.point_a, answer.point_a), copy(found.point_b, answer.point_b);
    answer.has_points = !found.enclosed && std::isfinite(found.upper);
    answer.distance_pair_tests = static_cast<double>(found.stats.pair_tests);
}

void fill_levels(const TreeView& a, const TreeView& b, uint32_t level) {
    const uint32_t levels = std::max(a.level_count(), b.level_count());
    answer.level_count = levels;
    for (uint32_t l = 0; l < levels; ++l) {
        const bool listed = l == std::min(level, levels - 1);
        const CollideAllResult found =
            collide_all(a, bodies[0].pose, b, bodies[1].pose, {meeting, listed ? size_t{kAnswerPairs} : 0}, context,
                        {.max_level = l, .max_pair_tests = kBudget});
        answer.level_tests[l] = static_cast<double>(found.stats.pair_tests);
        answer.level_verdict[l] = static_cast<double>(found.verdict);
        if (!listed) continue;
        const auto count = static_cast<uint32_t>(std::min<uint64_t>(found.found, kAnswerPairs));
        answer.pair_count = count;
        for (uint32_t i = 0; i < count; ++i)
            meeting_nodes[2 * i] = meeting[i].node_a, meeting_nodes[2 * i + 1] = meeting[i].node_b;
    }
}

} // namespace

std::byte* viewer_allocate(uint32_t body, uint32_t bytes) {
    bodies[body].tree.reset();
    bodies[body].bytes.reset(new (std::nothrow) std::byte[bytes]);
    bodies[body].size = bytes;
    return bodies[body].bytes.get();
}

uint32_t viewer_open(uint32_t body) {
    const auto opened = TreeView::open({bodies[body].bytes.get(), bodies[body].size});
    if (opened) bodies[body].tree = *opened;
    return opened ? 1 : 0;
}

float* viewer_pose(uint32_t body) {
    return bodies[body].pose_numbers;
}

const ViewerAnswer* viewer_query(uint32_t level) {
    answer = {};
    if (!bodies[0].tree || !bodies[1].tree) return &answer;
    for (Body& body : bodies) body.read_pose();
    const TreeView &a = *bodies[0].tree, &b = *bodies[1].tree;
    fill_collide(a, b);
    fill_distance(a, b);
    fill_levels(a, b, level);
    return &answer;
}

const uint32_t* viewer_pairs() {
    return meeting_nodes;
}

uint32_t viewer_collide(uint32_t times) {
    auto verdict = Verdict::undecided;
    if (!bodies[0].tree || !bodies[1].tree) return static_cast<uint32_t>(verdict);
    for (Body& body : bodies) body.read_pose();
    for (uint32_t i = 0; i < times; ++i)
        verdict = collide(*bodies[0].tree, bodies[0].pose, *bodies[1].tree, bodies[1].pose, context).verdict;
    return static_cast<uint32_t>(verdict);
}

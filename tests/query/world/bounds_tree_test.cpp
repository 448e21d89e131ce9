// The dynamic tree of boxes: its invariants, and what walks find against all boxes in a row.
#include "query/world/bounds_tree.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <vector>

namespace prolate {
namespace {

using query::BoundsTree;
using scenes::Random;

Bounds random_box(Random& random, double spread) {
    const double size = random.below(8) ? random.log_in(1e-3, 1) : random.log_in(1, 30);
    Bounds box;
    const auto side = [&](float& lower, float& upper) {
        const double at = random.in(-spread, spread);
        lower = static_cast<float>(at), upper = static_cast<float>(at + size * random.unit());
    };
    side(box.lower.x, box.upper.x), side(box.lower.y, box.upper.y), side(box.lower.z, box.upper.z);
    return box;
}

// Checks links and boxes from the root down; returns the leaves' depth, at most.
uint32_t check(const BoundsTree& tree, const std::map<uint32_t, Bounds>& leaves) {
    std::set<uint32_t> seen;
    uint32_t deepest = 0;
    struct Place {
        uint32_t node, parent, depth;
    };
    std::vector<Place> todo;
    if (tree.root() != BoundsTree::kNone) todo.push_back({tree.root(), BoundsTree::kNone, 0});
    uint32_t nodes = 0;
    while (!todo.empty()) {
        const auto [node, parent, depth] = todo.back();
        todo.pop_back();
        ++nodes, deepest = std::max(deepest, depth);
        EXPECT_EQ(tree.parent(node), parent);
        if (tree.is_leaf(node)) {
            const uint32_t item = tree.item(node);
            EXPECT_TRUE(seen.insert(item).second);
            EXPECT_TRUE(leaves.contains(item) && leaves.at(item) == tree.box(node));
            continue;
        }
        EXPECT_EQ(tree.box(node), query::join(tree.box(tree.child(node, 0)), tree.box(tree.child(node, 1))));
        for (const uint32_t i : {0u, 1u}) todo.push_back({tree.child(node, i), node, depth + 1});
    }
    EXPECT_EQ(seen.size(), leaves.size());
    EXPECT_EQ(nodes, leaves.empty() ? 0 : 2 * leaves.size() - 1);
    EXPECT_EQ(tree.node_count(), nodes);
    return deepest;
}

TEST(BoundsTree, KeepsItsInvariantsAndFindsWhatIsThere) {
    Random random(1);
    for (const uint32_t most : {1u, 2u, 3u, 40u, 400u}) {
        BoundsTree tree(std::pmr::get_default_resource());
        std::map<uint32_t, Bounds> leaves;
        std::map<uint32_t, uint32_t> nodes;
        uint32_t next = 0, hits = 0;
        for (uint32_t i = 0; i < 4000; ++i) {
            const auto some = [&] {
                return std::next(leaves.begin(), random.below(static_cast<uint32_t>(leaves.size())))->first;
            };
            const uint32_t what = random.below(leaves.size() < most ? 8 : 4);
            if (leaves.empty() || what >= 4) {
                leaves[next] = random_box(random, 1.5);
                nodes[next] = tree.insert(leaves[next], next);
                ++next;
            } else if (what < 3) {
                const uint32_t item = some();
                leaves[item] = random_box(random, 1.5);
                tree.move(nodes[item], leaves[item]);
            } else {
                const uint32_t item = some();
                tree.remove(nodes[item]);
                leaves.erase(item), nodes.erase(item);
            }
            if (i % 16 == 0) check(tree, leaves);
            const Bounds box = random_box(random, 1.5);
            std::set<uint32_t> found, truth;
            tree.walk([&](const Bounds& other) { return overlap(box, other); },
                      [&](const Bounds& first, const Bounds& second) { return second.lower.x < first.lower.x; },
                      [&](uint32_t item) {
                          EXPECT_TRUE(found.insert(item).second);
                          return true;
                      });
            for (const auto& [item, other] : leaves)
                if (overlap(box, other)) truth.insert(item);
            ASSERT_EQ(found, truth);
            hits += static_cast<uint32_t>(truth.size());
        }
        EXPECT_TRUE(most < 10 || hits > 3000) << most << ' ' << hits;
    }
}

TEST(BoundsTree, StaysShallowForBodiesSpreadAbout) {
    Random random(2);
    BoundsTree tree(std::pmr::get_default_resource());
    std::map<uint32_t, Bounds> leaves;
    std::vector<uint32_t> nodes;
    for (uint32_t i = 0; i < 4096; ++i) {
        leaves[i] = random_box(random, 100);
        nodes.push_back(tree.insert(leaves[i], i));
    }
    EXPECT_LE(check(tree, leaves), 40u);
    for (uint32_t round = 0; round < 4; ++round)
        for (uint32_t i = 0; i < 4096; ++i) tree.move(nodes[i], leaves[i] = random_box(random, 100));
    EXPECT_LE(check(tree, leaves), 40u);
}

// Depth may become anything; walks must not mind. Each box holds all before it.
TEST(BoundsTree, WalksTreesOfAnyDepth) {
    BoundsTree tree(std::pmr::get_default_resource());
    std::map<uint32_t, Bounds> leaves;
    for (uint32_t i = 0; i < 2000; ++i) {
        const float r = static_cast<float>(i + 1);
        leaves[i] = {{-r, -r, -r}, {r, r, r}};
        tree.insert(leaves[i], i);
    }
    check(tree, leaves);
    uint32_t found = 0;
    tree.walk([](const Bounds&) { return true; }, [&](uint32_t) { return ++found < 1500; }); // and they stop when told
    EXPECT_EQ(found, 1500u);
}

TEST(BoundsTree, DoesNotMindBoxesInsideOut) {
    BoundsTree tree(std::pmr::get_default_resource());
    std::vector<uint32_t> nodes;
    for (uint32_t i = 0; i < 100; ++i) nodes.push_back(tree.insert({{1, 1, 1}, {-1, -1, static_cast<float>(i)}}, i));
    uint32_t found = 0;
    tree.walk([](const Bounds&) { return true; }, [&](uint32_t) { return ++found, true; });
    EXPECT_EQ(found, 100u);
    for (const uint32_t node : nodes) tree.remove(node);
    EXPECT_EQ(tree.root(), BoundsTree::kNone);
}

} // namespace
} // namespace prolate

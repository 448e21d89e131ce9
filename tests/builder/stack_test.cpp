// From sets to a tree: every part once, no family too large, and what is near together.
#include "builder/random.hpp"
#include "builder/stack.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace prolate {
namespace {

// A set of balls at these places; each one's piece is its number.
FlatSet set_at(const std::vector<Vec>& places, double radius) {
    FlatSet out;
    for (const Vec& place : places)
        out.parts.push_back({Fit(place, Mat(radius * Mat::Identity())), {static_cast<uint32_t>(out.parts.size())}});
    return out;
}

std::vector<Vec> random_places(Random& random, size_t count) {
    std::vector<Vec> out;
    while (out.size() < count) {
        const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
        out.emplace_back(x, y, z);
    }
    return out;
}

TEST(Stack, HasEachPartOnceAndNoLargeFamilies) {
    Random random(5);
    for (const uint32_t degree : {2u, 3u, 8u, 16u})
        for (const std::vector<size_t>& counts :
             {std::vector<size_t>{1}, {1, 2}, {1, 2, 4, 8}, {1, 2, 2, 3}, {1, 1, 2}}) {
            std::vector<FlatSet> sets;
            for (const size_t count : counts) sets.push_back(set_at(random_places(random, count), 0.1));
            const std::vector<GrownNode> nodes = stack(sets, degree);
            size_t first = 0, next = 1;
            for (uint32_t level = 0; level < counts.size(); ++level) {
                std::set<uint32_t> pieces;
                for (size_t n = first; n < first + counts[level]; ++n) {
                    ASSERT_LT(n, nodes.size());
                    EXPECT_EQ(nodes[n].level, level);
                    pieces.insert(nodes[n].pieces.begin(), nodes[n].pieces.end());
                    EXPECT_LE(nodes[n].child_count, degree);
                    EXPECT_EQ(nodes[n].child_count == 0, level + 1 == counts.size());
                    if (nodes[n].child_count > 0) {
                        EXPECT_EQ(nodes[n].first_child, next);
                    }
                    next += nodes[n].child_count;
                }
                EXPECT_EQ(pieces.size(), counts[level]);
                first += counts[level];
            }
            EXPECT_EQ(first, nodes.size());
        }
}

TEST(Stack, KeepsTogetherWhatIsNear) {
    // Four heaps, far from each other, full to the last place; the sets know nothing of them.
    Random random(6);
    std::vector<FlatSet> sets{set_at({Vec::Zero()}, 10)};
    std::vector<Vec> heaps{{0, 0, 0}, {5, 0, 0}, {0, 5, 0}, {5, 5, 1}};
    sets.push_back(set_at(heaps, 1));
    for (const size_t each : {4u, 16u}) {
        std::vector<Vec> places;
        for (const Vec& place : random_places(random, 4 * each)) places.push_back(heaps[places.size() % 4] + place);
        sets.push_back(set_at(places, 0.3));
    }
    const std::vector<GrownNode> nodes = stack(sets, 4);
    for (const GrownNode& node : nodes)
        for (uint32_t c = 0; c < node.child_count; ++c)
            if (node.level > 0) {
                EXPECT_LT((nodes[node.first_child + c].fit.center - node.fit.center).norm(), 4);
            }
}

} // namespace
} // namespace prolate

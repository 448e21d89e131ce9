// Things to groups of limited size, against all ways to do it.
#include "builder/assignment.hpp"
#include "builder/random.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

struct Problem {
    uint32_t things;
    std::vector<GroupSize> groups;
    std::vector<double> costs; // by things

    double cost(uint32_t thing, uint32_t group) const { return costs[thing * groups.size() + group]; }
    std::vector<uint32_t> answer() const {
        return assign(things, groups, [this](uint32_t thing, uint32_t group) { return cost(thing, group); });
    }
    double sum(const std::vector<uint32_t>& groups_of) const {
        double out = 0;
        for (uint32_t thing = 0; thing < things; ++thing) out += cost(thing, groups_of[thing]);
        return out;
    }
    bool admits(const std::vector<uint32_t>& groups_of) const {
        for (uint32_t g = 0; g < groups.size(); ++g) {
            const auto count = std::count(groups_of.begin(), groups_of.end(), g);
            if (count < groups[g].least || count > groups[g].most) return false;
        }
        return true;
    }
    double least() const {
        double out = HUGE_VAL;
        std::vector<uint32_t> groups_of(things, 0);
        for (;;) {
            if (admits(groups_of)) out = std::min(out, sum(groups_of));
            uint32_t thing = 0;
            while (thing < things && ++groups_of[thing] == groups.size()) groups_of[thing++] = 0;
            if (thing == things) return out;
        }
    }
};

Problem random_problem(Random& random, uint32_t things, std::vector<GroupSize> groups) {
    Problem out{things, std::move(groups), {}};
    for (size_t i = 0; i < things * out.groups.size(); ++i) out.costs.push_back(random.symmetric());
    return out;
}

TEST(Assign, IsTheLeastOfAllWays) {
    Random random(1);
    for (int round = 0; round < 200; ++round)
        for (const std::vector<GroupSize>& groups :
             {std::vector<GroupSize>{{0, 7}}, {{0, 3}, {0, 4}}, {{0, 2}, {0, 2}, {0, 3}}, {{0, 7}, {0, 1}, {0, 1}}}) {
            const Problem problem = random_problem(random, 7, groups);
            const std::vector<uint32_t> answer = problem.answer();
            EXPECT_TRUE(problem.admits(answer));
            EXPECT_NEAR(problem.sum(answer), problem.least(), 1e-12);
        }
}

TEST(Assign, KeepsToBothLimits) {
    Random random(2);
    for (int round = 0; round < 100; ++round) {
        const Problem problem = random_problem(random, 7, {{1, 3}, {2, 2}, {1, 4}});
        const std::vector<uint32_t> answer = problem.answer();
        EXPECT_TRUE(problem.admits(answer));
        EXPECT_LE(problem.sum(answer), problem.least() + 1); // it is not sought, but is not far
    }
    // All want the same group, and it is the last one: of equal costs, some are moved all the same.
    const Problem crowded{8, {{1, 2}, {1, 8}, {1, 3}}, std::vector<double>(24, 0.5)};
    EXPECT_TRUE(crowded.admits(crowded.answer()));
}

} // namespace
} // namespace prolate

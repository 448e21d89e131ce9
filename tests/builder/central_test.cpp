// The tree of centers against asking every ellipsoid.
#include "builder/border.hpp"
#include "builder/central.hpp"
#include "builder/random.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace prolate {
namespace {

Vec random_point(Random& random, double size) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return size * Vec(x, y, z);
}

// Some of them twice, so that there are equals.
std::vector<Fit> random_fits(Random& random, size_t count) {
    std::vector<Fit> out;
    while (out.size() < count) {
        const Vec center = random_point(random, 1);
        Vec radii;
        for (int a = 0; a < 3; ++a) radii[a] = 0.2 * std::exp(3 * random.symmetric());
        const Mat rotation = random_rotation(random);
        const Mat factor = rotation * radii.asDiagonal();
        out.emplace_back(center, cholesky(factor * factor.transpose()));
        if (out.size() % 5 == 0 && out.size() < count) out.push_back(out[out.size() / 2]);
    }
    return out;
}

TEST(CentralTree, FindsWhatAskingEachFinds) {
    Random random(7);
    int found = 0, none = 0;
    for (const size_t count : {1u, 2u, 4u, 5u, 8u, 33u, 500u}) {
        const std::vector<Fit> fits = random_fits(random, count);
        const CentralTree tree(fits);
        for (int trial = 0; trial < 2000; ++trial) {
            const Vec p = random_point(random, 2);
            double least = 30 * random.uniform();
            const auto answer = tree.find(p, least);
            std::optional<uint32_t> truth;
            for (uint32_t i = 0; i < fits.size(); ++i)
                if (const double radial = fits[i].radial_squared(p); radial < least) least = radial, truth = i;
            ASSERT_EQ(answer, truth) << count << " ellipsoids, trial " << trial;
            ++(truth ? found : none);
        }
    }
    EXPECT_GT(found, 4000); // both answers occur often
    EXPECT_GT(none, 1000);
}

TEST(CentralTree, IsEmptyForNone) {
    const CentralTree tree({});
    EXPECT_FALSE(tree.find(Vec::Zero(), HUGE_VAL));
}

TEST(CentralTree, TakesTheFirstOfEquals) {
    const std::vector<Fit> fits(100, Fit(Vec::Zero(), Mat::Identity()));
    const CentralTree tree(fits);
    EXPECT_EQ(tree.find({2, 0, 0}, HUGE_VAL), 0u);
    EXPECT_FALSE(tree.find({2, 0, 0}, 4)) << "as central is not more central";
}

} // namespace
} // namespace prolate

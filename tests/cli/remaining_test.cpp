// The estimate of the remaining time: right for steady work, between old and new when speeds change, silent without a
// basis.
#include "cli/remaining.hpp"

#include <gtest/gtest.h>

namespace prolate::cli {
namespace {

TEST(RemainingTime, IsRightForSteadyWork) {
    RemainingTime remaining;
    for (int i = 1; i <= 200; ++i) { // 20 seconds
        const double seconds = 0.1 * i;
        const auto left = remaining.after(seconds, seconds / 20);
        ASSERT_EQ(left.has_value(), i >= 20) << seconds;
        if (left) {
            EXPECT_NEAR(*left, 20 - seconds, 1e-3 * *left);
        }
    }
}

TEST(RemainingTime, FollowsAChangeOfSpeed) {
    // Half of the work in 10 seconds, the other half at a quarter of the speed: in 40.
    RemainingTime remaining;
    for (int i = 1; i <= 100; ++i) remaining.after(0.1 * i, 0.05 * 0.1 * i);
    double last = 10;
    for (int i = 1; i <= 300; ++i) {
        const auto left = remaining.after(10 + 0.1 * i, 0.5 + 0.0125 * 0.1 * i);
        ASSERT_TRUE(left);
        if (i == 50) {
            EXPECT_GT(*left, last); // it has noticed
        }
        last = *left;
    }
    EXPECT_NEAR(last, 10, 3.5); // 10 seconds are left; the fast start still counts a little
}

TEST(RemainingTime, SaysNothingWithoutABasis) {
    RemainingTime early;
    EXPECT_FALSE(early.after(0, 0));
    EXPECT_FALSE(early.after(1, 0.5));  // too soon
    EXPECT_FALSE(early.after(9, 0.51)); // seen too few steps
    RemainingTime still;
    for (int i = 1; i <= 100; ++i) still.after(0.1 * i, 0.01 * 0.1 * i);
    EXPECT_TRUE(still.after(11, 0.1));
    EXPECT_FALSE(still.after(20, 0.1)); // nothing has moved for half of the time
}

TEST(RemainingTime, IsRoundedToWhatItCanPromise) {
    EXPECT_EQ(rounded_time(0), "1 s");
    EXPECT_EQ(rounded_time(8.4), "8 s");
    EXPECT_EQ(rounded_time(9.6), "10 s");
    EXPECT_EQ(rounded_time(43), "45 s");
    EXPECT_EQ(rounded_time(58), "1 min");
    EXPECT_EQ(rounded_time(100), "1.5 min");
    EXPECT_EQ(rounded_time(1000), "17 min");
    EXPECT_EQ(rounded_time(3600), "1.0 h");
    EXPECT_EQ(rounded_time(9000), "2.5 h");
}

} // namespace
} // namespace prolate::cli

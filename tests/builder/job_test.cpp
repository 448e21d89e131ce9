// Calls that can be stopped, and that no ratio of the input makes long: every stage of a bake and a proof asks often
// whether to go on, ends when told, and ends by itself on needles, sheets and specks.
#include "builder/job.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>
#include <set>
#include <string>
#include <vector>

namespace prolate {
namespace {

// Seconds of all threads together: unlike wall time, no matter what else the machine does.
double work_done() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

TEST(Job, RunsWhatIsNotStopped) {
    Job job(2, {});
    std::atomic<int> sum = 0;
    EXPECT_EQ(job.run([&] {
        parallel_for(0, 100, [&](int i) { sum += i; });
        parallel_invoke([&] { ++sum; }, [&] { ++sum; });
        return Job::current();
    }),
              &job);
    EXPECT_EQ(sum, 4952);
    EXPECT_EQ(Job::current(), nullptr);
    checkpoint(); // outside of jobs: nothing
}

TEST(Job, EndsAtTheNextCheckpointsOfAllThreads) {
    std::atomic<int> asked = 0;
    Job job(2, [&] { return ++asked < 3; });
    const auto forever = [](int) {
        for (;;) checkpoint();
    };
    EXPECT_THROW(job.run([&] { parallel_for(0, 8, [&](int) { parallel_for(0, 8, forever); }); }), Cancelled);
    EXPECT_EQ(asked, 3);
    EXPECT_THROW(job.run(checkpoint), Cancelled); // and it stays stopped
    EXPECT_EQ(asked, 3);
}

BuildOptions quick(bool exact) {
    BuildOptions options;
    options.quality = Quality::fast;
    options.exact = exact;
    options.levels = exact ? 0 : 2;
    options.threads = 2;
    return options;
}

constexpr double kMostWork = 1.5; // seconds of two threads

TEST(Build, AsksOftenAtEveryStage) {
    const Mesh mesh = shapes::icosphere(6);
    for (const bool exact : {false, true}) {
        double last = work_done();
        std::string before = "start";
        const auto built = build(mesh.view(), quick(exact), [&](const BuildProgress& progress) {
            const double now = work_done();
            EXPECT_LT(now - last, kMostWork) << before << " -> " << progress.stage;
            last = now, before = progress.stage;
            return true;
        });
        ASSERT_TRUE(built);
        EXPECT_LT(work_done() - last, kMostWork) << before << " -> end";
    }
}

TEST(Build, EndsSoonWhenStoppedAtAnyStage) {
    const Mesh mesh = shapes::torus(1, 0.3f, 96, 48);
    for (const bool exact : {false, true}) {
        std::set<std::string> stages;
        for (bool more = true; more;) { // stops at the first stage at which it was not stopped yet
            more = false;
            double stopped = 0;
            const auto built = build(mesh.view(), quick(exact), [&](const BuildProgress& progress) {
                EXPECT_FALSE(more) << "asked again";
                more = stages.insert(progress.stage).second;
                stopped = work_done();
                return !more;
            });
            if (!more) {
                EXPECT_TRUE(built);
                continue;
            }
            ASSERT_FALSE(built);
            EXPECT_EQ(built.error().code, ErrorCode::cancelled);
            EXPECT_LT(work_done() - stopped, kMostWork);
        }
        EXPECT_GE(stages.size(), 3u); // a short one may pass between two questions
    }
}

TEST(Verify, EndsSoonWhenStopped) {
    const Mesh mesh = shapes::torus(1, 0.3f, 96, 48);
    for (const bool exact : {false, true}) {
        const auto built = build(mesh.view(), quick(exact));
        ASSERT_TRUE(built);
        VerifyOptions options;
        int asked = 0;
        options.progress = [&](double) { return ++asked < 2; };
        if (exact) { // too quick to be asked on so small a mesh
            EXPECT_TRUE(verify(built->tree.view(), mesh.view(), options)->covered);
            continue;
        }
        const auto proof = verify(built->tree.view(), mesh.view(), options);
        ASSERT_FALSE(proof);
        EXPECT_EQ(proof.error().code, ErrorCode::cancelled);
        EXPECT_EQ(asked, 2);
    }
}

// A prism of `sides` around the z-axis.
Mesh needle(float radius, float height, uint32_t sides) {
    Mesh mesh{{{0, 0, 0}, {0, 0, height}}, {}};
    for (uint32_t i = 0; i < sides; ++i) {
        const double angle = 2 * std::numbers::pi * i / sides;
        for (const float z : {0.0f, height})
            mesh.vertices.push_back(
                {static_cast<float>(radius * std::cos(angle)), static_cast<float>(radius * std::sin(angle)), z});
    }
    for (uint32_t i = 0; i < sides; ++i) {
        const uint32_t a = 2 + 2 * i, b = 2 + 2 * ((i + 1) % sides);
        mesh.triangles.insert(mesh.triangles.end(), {{0, b, a}, {1, a + 1, b + 1}, {a, b, b + 1}, {a, b + 1, a + 1}});
    }
    return mesh;
}

Mesh along(Mesh mesh, size_t axis) {
    for (Vec3& v : mesh.vertices) v = axis == 0 ? Vec3{v.z, v.x, v.y} : axis == 1 ? Vec3{v.y, v.z, v.x} : v;
    return mesh;
}

TEST(Build, BakesNeedlesInSeconds) {
    for (size_t axis = 0; axis < 3; ++axis) {
        const Mesh mesh = along(needle(1e-4f, 1, 12), axis);
        for (const bool exact : {false, true}) {
            const double start = work_done();
            const auto built = build(mesh.view(), quick(exact));
            ASSERT_TRUE(built);
            EXPECT_TRUE(built->levels.back().covered);
            EXPECT_LT(work_done() - start, 20);
        }
    }
}

TEST(Build, BakesSpecksAndGiantsOrSaysThatTheyAreTooSmallOrLarge) {
    for (const float size : {1e-38f, 1e-30f, 1e-22f, 1e-15f, 1e15f, 1e21f, 1e30f, 1e37f})
        for (const bool exact : {false, true}) {
            BuildOptions options = quick(exact);
            if (!exact) options.levels = 1;
            const auto built = build(shapes::moved(shapes::torus(1, 0.3f, 16, 8), {}, size).view(), options);
            if (size < 1e-24f || size > 1e22f) {
                ASSERT_FALSE(built) << size;
                EXPECT_EQ(built.error().code, ErrorCode::bad_mesh);
                EXPECT_NE(std::string(built.error().what).find("another unit"), std::string::npos);
            } else {
                ASSERT_TRUE(built) << size << ": " << built.error().what;
                EXPECT_TRUE(built->levels.back().covered);
                EXPECT_TRUE(exact || built->levels.back().outside_ratio < 0.4) << size;
            }
        }
}

// Sheets, blades and needles in random attitudes: one ellipsoid, about the least that there is.
TEST(Build, ThinBoxesHaveThinRoots) {
    scenes::Random random(3);
    for (const double thin : {1e-1, 1e-2, 1e-3, 1e-4})
        for (const double other : {1.0, 0.3 * thin + 0.7 * std::sqrt(thin), thin}) {
            const Quat turn = random.rotation();
            Mesh mesh = shapes::box(1, static_cast<float>(other), static_cast<float>(thin));
            for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(turn, {v.x, v.y, v.z}));
            BuildOptions options = quick(false);
            options.levels = 0, options.ellipsoids = 1;
            const auto built = build(mesh.view(), options);
            ASSERT_TRUE(built);
            const double least = std::numbers::pi * std::numbers::sqrt3 / 2 - 1; // of the minimum ellipsoid
            EXPECT_LE(volume(built->tree.view().ellipsoid(0)) / (other * thin) - 1, 1.1 * least)
                << other << " " << thin;
        }
}

// What a column would measure of an open mesh takes a winding number for each of its intervals.
TEST(Build, MeasuresNoVolumeOfAnOpenExactTree) {
    Mesh mesh = shapes::torus(1, 0.3f, 96, 48);
    const auto closed = build(mesh.view(), quick(true));
    mesh.triangles.pop_back();
    const auto open = build(mesh.view(), quick(true));
    ASSERT_TRUE(closed && open);
    EXPECT_GT(closed->solid_volume, 0);
    EXPECT_EQ(open->solid_volume, 0);
    EXPECT_TRUE(open->surface_mode && open->levels.back().covered);
}

} // namespace
} // namespace prolate

// Poses to matrices and back, through matrix.hpp, Eigen and GLM.
#include <prolate/eigen.hpp>
#include <prolate/glm.hpp>
#include <prolate/matrix.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

namespace prolate {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

// Turns in all octants, half turns about each axis and between axes, and none.
std::vector<Pose> poses() {
    std::vector<Pose> out;
    std::mt19937 random(1);
    std::normal_distribution<float> normal;
    for (int i = 0; i < 1000; ++i)
        out.push_back({{normal(random), normal(random), normal(random)},
                       {normal(random), normal(random), normal(random), normal(random)}});
    for (const Quat& q : {Quat{1, 0, 0, 0}, Quat{0, 1, 0, 0}, Quat{0, 0, 1, 0}, Quat{0, 0, 0, 1}, Quat{1, 1, 0, 0},
                          Quat{0, -3, 3, 0}, Quat{1, 1, 1, 1}, Quat{1, 0, 0, 1e-7f}, Quat{0, 0, 0, -1e-20f}})
        out.push_back({{1, -2, 3}, q});
    return out;
}

// Up to sign, and for quaternions of any length.
double difference(const Quat& a, const Quat& b) {
    const Eigen::Vector4d u = Eigen::Vector4d(a.x, a.y, a.z, a.w).normalized();
    const Eigen::Vector4d v = Eigen::Vector4d(b.x, b.y, b.z, b.w).normalized();
    return std::min((u - v).norm(), (u + v).norm());
}

TEST(Matrix, TurnsAndMovesPointsAsThePoseDoes) {
    for (const Pose& pose : poses()) {
        const Eigen::Quaterniond q = to_eigen(pose.rotation).cast<double>().normalized();
        const Eigen::Vector3d point(0.3, -0.7, 2), moved = q * point + to_eigen(pose.translation).cast<double>();
        ASSERT_LT((to_eigen(pose) * point - moved).norm(), 1e-14);
        const glm::dvec4 by_glm = to_glm(pose) * glm::dvec4(point.x(), point.y(), point.z(), 1);
        ASSERT_LT(std::hypot(by_glm.x - moved.x(), by_glm.y - moved.y(), by_glm.z - moved.z()), 1e-14);
        ASSERT_EQ(by_glm.w, 1);
    }
}

TEST(Matrix, ComesBackToItsPose) {
    const auto expect = [](const Result<Pose>& back, const Pose& pose, double accuracy, const Vec3& translation) {
        ASSERT_TRUE(back) << back.error().what;
        ASSERT_EQ(back->translation, translation);
        ASSERT_LT(difference(back->rotation, pose.rotation), accuracy);
        const Quat& q = back->rotation;
        ASSERT_NEAR(std::hypot(std::hypot(q.x, q.y), std::hypot(q.z, q.w)), 1, 2e-7);
    };
    for (const Pose& pose : poses()) {
        const Vec3 &moved = pose.translation, none{};
        expect(pose_from_matrix(to_matrix(pose)), pose, 1e-7, moved);
        const Eigen::Isometry3d eigen = to_eigen(pose);
        expect(pose_from_eigen(eigen), pose, 1e-7, moved);
        expect(pose_from_eigen(eigen.matrix()), pose, 1e-7, moved);
        expect(pose_from_eigen(eigen.affine()), pose, 1e-7, moved);
        expect(pose_from_eigen(eigen.linear()), pose, 1e-7, none);
        expect(pose_from_eigen(eigen.cast<float>()), pose, 1e-6, moved);
        expect(pose_from_eigen(Eigen::AffineCompact3f(eigen.cast<float>())), pose, 1e-6, moved);
        const glm::dmat4 glm = to_glm(pose);
        expect(pose_from_glm(glm), pose, 1e-7, moved);
        expect(pose_from_glm(glm::mat4(glm)), pose, 1e-6, moved);
        expect(pose_from_glm(glm::mat4x3(glm)), pose, 1e-6, moved);
        expect(pose_from_glm(glm::dmat3(glm)), pose, 1e-7, none);
    }
}

TEST(Matrix, WhatIsNotRigidIsRefusedByName) {
    const auto refused = [](const Matrix4& matrix, std::string_view why) {
        const auto pose = pose_from_matrix(matrix);
        ASSERT_FALSE(pose) << why;
        EXPECT_EQ(pose.error().code, ErrorCode::bad_options);
        EXPECT_NE(std::string_view(pose.error().what).find(why), std::string_view::npos) << pose.error().what;
    };
    const Pose pose{{1, 2, 3}, {0.1f, -0.7f, 0.2f, 0.5f}};
    const Matrix4 rigid = to_matrix(pose);
    for (size_t r = 0; r < 4; ++r)
        for (size_t c = 0; c < 4; ++c)
            for (const double bad : {kNan, kInfinity, -kInfinity}) {
                Matrix4 m = rigid;
                m.m[r][c] = bad;
                refused(m, "not finite");
            }
    for (const double factor : {0.0, 0.5, 0.999, 1.001, 2.0, 1e200}) {
        Matrix4 all = rigid, one = rigid;
        for (size_t r = 0; r < 3; ++r) {
            for (size_t c = 0; c < 3; ++c) all.m[r][c] *= factor;
            one.m[r][1] *= factor;
        }
        refused(all, "scales");
        refused(one, "scales");
    }
    Matrix4 sheared = rigid, mirrored = rigid, projected = rigid, far = rigid;
    for (size_t r = 0; r < 3; ++r) {
        sheared.m[r][1] = std::cos(0.01) * rigid.m[r][1] + std::sin(0.01) * rigid.m[r][0]; // still of unit length
        mirrored.m[r][2] = -rigid.m[r][2];
    }
    projected.m[3][2] = 0.5;
    far.m[1][3] = 1e39;
    refused(sheared, "shears");
    refused(mirrored, "mirrors");
    refused(projected, "not affine");
    refused(far, "beyond the range");

    Matrix4 almost = rigid; // what rounding leaves of a product of many floats
    for (auto& row : almost.m) row[0] *= 1 + 4e-5;
    const auto accepted = pose_from_matrix(almost);
    ASSERT_TRUE(accepted);
    EXPECT_LT(difference(accepted->rotation, pose.rotation), 1e-4);
}

TEST(Matrix, PosesWithoutAMeaningGiveNan) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    for (const Pose& pose : {Pose{{}, {0, 0, 0, 0}}, Pose{{}, {nan, 0, 0, 1}}, Pose{{}, {0, infinity, 0, 1}},
                             Pose{{0, nan, 0}, {}}, Pose{{0, 0, infinity}, {}}}) {
        const Matrix4 matrix = to_matrix(pose);
        for (const auto& row : matrix.m)
            for (const double entry : row) EXPECT_TRUE(std::isnan(entry));
        EXPECT_FALSE(pose_from_matrix(matrix));
    }
}

} // namespace
} // namespace prolate

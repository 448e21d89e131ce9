// Bones for a mesh that has none, by a rule, so that every mesh is a character.
//
// Their middles are spread over the vertices: first the vertex nearest to the middle of all, then always the one
// farthest from those before; then ten rounds of Lloyd's algorithm. The shortest tree that connects the middles, from
// the first on, is the skeleton, with joints half-way. Of the four nearest middles a vertex has weights as d^-8, those
// below 0.02 left out.
#pragma once

#include "tests/scenes.hpp"

#include <prolate/rig.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace prolate::bench {

using scenes::Point;

class Rig {
public:
    static constexpr uint32_t kEach = 4;

    Rig() = default;
    Rig(const Mesh& mesh, uint32_t bones) : parent_(bones), joint_(bones) {
        for (const Vec3& v : mesh.vertices) points_.push_back({v.x, v.y, v.z});
        find_middles(bones);
        connect();
        for (const Point& p : points_) weigh(p);
    }

    BoneWeights weights() const { return {static_cast<uint32_t>(parent_.size()), kEach, indices_, weights_}; }

    /// Each bone turned about its joint against the one before, by up to `angle` around a random axis.
    std::vector<BoneMatrix> random_pose(scenes::Random& random, double angle) const {
        std::vector<BoneMatrix> out(parent_.size());
        for (const uint32_t b : order_) {
            if (b == order_[0]) continue;
            const Point axis = random.direction();
            const double half = random.in(0, angle) / 2, s = std::sin(half);
            const Quat turn{static_cast<float>(s * axis[0]), static_cast<float>(s * axis[1]),
                            static_cast<float>(s * axis[2]), static_cast<float>(std::cos(half))};
            const BoneMatrix& before = out[parent_[b]];
            for (size_t k = 0; k < 4; ++k) {
                // before (joint + turn (x - joint)), column by column
                Point e{k == 0 ? 1.0 : 0, k == 1 ? 1.0 : 0, k == 2 ? 1.0 : 0};
                if (k == 3) e = {-joint_[b][0], -joint_[b][1], -joint_[b][2]};
                Point column = scenes::rotate(turn, e);
                for (size_t i = 0; i < 3; ++i) column[i] += k == 3 ? joint_[b][i] : 0;
                for (size_t i = 0; i < 3; ++i) {
                    double x = k == 3 ? double{before.m[i][3]} : 0;
                    for (size_t j = 0; j < 3; ++j) x += double{before.m[i][j]} * column[j];
                    out[b].m[i][k] = static_cast<float>(x);
                }
            }
        }
        return out;
    }

    void move(const std::vector<BoneMatrix>& bones, std::vector<Point>& out) const {
        for (size_t v = 0; v < points_.size(); ++v) {
            Point x{};
            double sum = 0;
            for (size_t n = kEach * v; n < kEach * (v + 1); ++n) {
                const double w = weights_[n];
                if (w == 0) continue;
                const auto& m = bones[indices_[n]].m;
                for (size_t i = 0; i < 3; ++i)
                    x[i] += w * (double{m[i][0]} * points_[v][0] + double{m[i][1]} * points_[v][1] +
                                 double{m[i][2]} * points_[v][2] + double{m[i][3]});
                sum += w;
            }
            for (size_t i = 0; i < 3; ++i) out[v][i] = x[i] / sum;
        }
    }

private:
    static double squared(const Point& a, const Point& b) {
        return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
    }
    size_t nearest(const Point& p) const {
        const auto nearer = [&p](const Point& a, const Point& b) { return squared(p, a) < squared(p, b); };
        return static_cast<size_t>(std::min_element(middles_.begin(), middles_.end(), nearer) - middles_.begin());
    }

    void find_middles(uint32_t bones) {
        Point middle{};
        for (const Point& p : points_)
            for (size_t i = 0; i < 3; ++i) middle[i] += p[i] / static_cast<double>(points_.size());
        const auto nearer = [&](const Point& a, const Point& b) { return squared(a, middle) < squared(b, middle); };
        middles_ = {*std::min_element(points_.begin(), points_.end(), nearer)};
        while (middles_.size() < bones) {
            const auto lonelier = [this](const Point& a, const Point& b) {
                return squared(a, middles_[nearest(a)]) < squared(b, middles_[nearest(b)]);
            };
            middles_.push_back(*std::max_element(points_.begin(), points_.end(), lonelier));
        }
        for (int round = 0; round < 10; ++round) {
            std::vector<Point> sums(bones, Point{});
            std::vector<double> counts(bones);
            for (const Point& p : points_) {
                const size_t b = nearest(p);
                for (size_t i = 0; i < 3; ++i) sums[b][i] += p[i];
                ++counts[b];
            }
            for (size_t b = 0; b < bones; ++b)
                for (size_t i = 0; i < 3 && counts[b] > 0; ++i) middles_[b][i] = sums[b][i] / counts[b];
        }
    }

    // Prim's algorithm.
    void connect() {
        std::vector<bool> in(middles_.size());
        order_ = {0}, in[0] = true;
        while (order_.size() < middles_.size()) {
            double least = std::numeric_limits<double>::infinity();
            uint32_t from = 0, to = 0;
            for (const uint32_t a : order_)
                for (uint32_t b = 0; b < middles_.size(); ++b)
                    if (!in[b] && squared(middles_[a], middles_[b]) < least)
                        least = squared(middles_[a], middles_[b]), from = a, to = b;
            in[to] = true, parent_[to] = from, order_.push_back(to);
            for (size_t i = 0; i < 3; ++i) joint_[to][i] = (middles_[from][i] + middles_[to][i]) / 2;
        }
    }

    void weigh(const Point& p) {
        std::vector<std::pair<double, uint16_t>> by_distance;
        for (size_t b = 0; b < middles_.size(); ++b)
            by_distance.emplace_back(squared(p, middles_[b]), static_cast<uint16_t>(b));
        std::sort(by_distance.begin(), by_distance.end());
        by_distance.resize(kEach, {std::numeric_limits<double>::infinity(), uint16_t{0}});
        std::array<double, kEach> w{};
        double sum = 0;
        for (size_t i = 0; i < kEach; ++i)
            sum += w[i] = std::pow((by_distance[0].first + 1e-30) / (by_distance[i].first + 1e-30), 4);
        double kept = 0;
        for (double& x : w) kept += x = x / sum < 0.02 ? 0 : x / sum;
        for (size_t i = 0; i < kEach; ++i) {
            indices_.push_back(by_distance[i].second);
            weights_.push_back(static_cast<float>(w[i] / kept));
        }
    }

    std::vector<Point> points_, middles_;
    std::vector<uint32_t> parent_, order_; // a bone comes behind its parent
    std::vector<Point> joint_;
    std::vector<uint16_t> indices_;
    std::vector<float> weights_;
};

} // namespace prolate::bench

#include "builder/border.hpp"

#include "builder/random.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {

std::vector<Vec> even_directions(int count) {
    // Cosine and sine of the golden angle pi (3 - sqrt 5), and no others: libraries differ in their last digits.
    constexpr double kCos = -0.73736887807831985597, kSin = 0.67549029426152362732;
    std::vector<Vec> out;
    double c = 1, s = 0;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, r = std::sqrt(1 - z * z);
        out.emplace_back(r * c, r * s, z);
        const double turned = c * kCos - s * kSin;
        s = s * kCos + c * kSin, c = turned;
        const double length = std::sqrt(c * c + s * s);
        c /= length, s /= length;
    }
    return out;
}

Mat random_rotation(Random& random) {
    for (;;) { // a unit quaternion, by rejection
        double q[4], norm = 0;
        for (double& x : q) x = random.symmetric(), norm += x * x;
        if (norm > 1 || norm < 1e-3) continue;
        norm = std::sqrt(norm);
        const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
        Mat out;
        out << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), //
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),    //
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
        return out;
    }
}

namespace {

// `points` in halves, these in halves, and so on, down to blocks.
void order_by_place(std::span<Vec> points, size_t block) {
    if (points.size() <= block) return;
    Box box;
    for (const Vec& p : points) box.add(p);
    int axis = 0;
    box.size().maxCoeff(&axis);
    std::ranges::stable_sort(points, {}, [axis](const Vec& p) { return p[axis]; });
    const size_t half = (points.size() / 2 + block - 1) / block * block;
    order_by_place(points.first(half), block);
    order_by_place(points.subspan(half), block);
}

std::vector<Vec> even_directions_by_place(int count, size_t block) {
    std::vector<Vec> out = even_directions(count);
    order_by_place(out, block);
    return out;
}

} // namespace

// What hides: the point `fit.center + fit.factor u` has the radial coordinates a u + b in it, where a is lower
// triangular, and it holds only such with normal . u >= least.
struct BorderSamples::Hider {
    Hider(const Fit& fit, const Fit& other)
        : a((other.inverse * fit.factor).cast<float>()), b(other.radial(fit.center).cast<float>()) {
        const Vec y = fit.radial(other.center);
        const double far = y.norm();
        if (far == 0) return; // no cap: all of the border may be hidden
        normal = y / far;
        least = far - ((fit.inverse * other.factor).transpose() * normal).norm();
    }

    void hide(const Block& block, uint32_t* hidden) const {
        const float a00 = a(0, 0), a10 = a(1, 0), a11 = a(1, 1), a20 = a(2, 0), a21 = a(2, 1), a22 = a(2, 2);
        const float b0 = b.x(), b1 = b.y(), b2 = b.z();
        for (size_t i = 0; i < kBlock; ++i) {
            const float p = a00 * block.x[i] + b0, q = a10 * block.x[i] + a11 * block.y[i] + b1,
                        r = a20 * block.x[i] + a21 * block.y[i] + a22 * block.z[i] + b2;
            hidden[i] |= p * p + q * q + r * r < 1 ? 1u : 0u;
        }
    }

    Eigen::Matrix3f a;
    Eigen::Vector3f b;
    Vec normal = Vec::Zero();
    double least = -HUGE_VAL;
};

BorderSamples::BorderSamples(int count)
    : even_(even_directions_by_place(count, kBlock)), turned_(even_), blocks_((even_.size() + kBlock - 1) / kBlock) {
    turn(Mat::Identity());
}

void BorderSamples::turn(const Mat& rotation) {
    for (size_t i = 0; i < even_.size(); ++i) turned_[i] = rotation * even_[i];
    for (size_t k = 0; k < blocks_.size(); ++k) {
        Block& block = blocks_[k];
        block.middle = Vec::Zero(), block.radius = 0;
        const auto at = [&](size_t i) { return turned_[std::min(k * kBlock + i, turned_.size() - 1)]; };
        for (size_t i = 0; i < kBlock; ++i) {
            const Eigen::Vector3f u = at(i).cast<float>();
            block.x[i] = u.x(), block.y[i] = u.y(), block.z[i] = u.z();
            block.middle += at(i) / double{kBlock};
        }
        for (size_t i = 0; i < kBlock; ++i) block.radius = std::max(block.radius, (at(i) - block.middle).norm());
    }
}

std::vector<uint32_t> BorderSamples::hidden(const Fit& fit, std::span<const Fit> fits,
                                            std::span<const uint32_t> others) const {
    constexpr double kSlack = 1e-4; // floats may take points for held that just are not
    std::vector<Hider> hiders;
    hiders.reserve(others.size());
    for (const uint32_t other : others) {
        const Hider hider(fit, fits[other]);
        if (hider.least < 1 + kSlack) hiders.push_back(hider);
    }
    std::vector<uint32_t> out(blocks_.size() * kBlock, 0);
    for (size_t k = 0; k < blocks_.size(); ++k) {
        const Block& block = blocks_[k];
        uint32_t* const of_block = &out[k * kBlock];
        for (const Hider& hider : hiders) {
            if (hider.normal.dot(block.middle) + block.radius < hider.least - kSlack) continue;
            hider.hide(block, of_block);
            uint32_t count = 0;
            for (size_t i = 0; i < kBlock; ++i) count += of_block[i];
            if (count == kBlock) break;
        }
    }
    return out;
}

double depth(const Fit& fit, const Fit& other, double margin) {
    const Vec y = fit.radial(other.center);
    const double far = y.norm();
    if (far == 0) return HUGE_VAL;
    return margin * (1 + ((fit.inverse * other.factor).transpose() * y).norm() / far) - far;
}

} // namespace prolate

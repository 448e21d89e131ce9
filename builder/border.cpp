#include "builder/border.hpp"

#include "builder/random.hpp"

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

BorderSamples::BorderSamples(int count)
    : even_(even_directions(count)), turned_(even_), x_(even_.size()), y_(even_.size()), z_(even_.size()) {
    turn(Mat::Identity());
}

void BorderSamples::turn(const Mat& rotation) {
    for (size_t i = 0; i < even_.size(); ++i) {
        turned_[i] = rotation * even_[i];
        x_[i] = static_cast<float>(turned_[i].x());
        y_[i] = static_cast<float>(turned_[i].y());
        z_[i] = static_cast<float>(turned_[i].z());
    }
}

void BorderSamples::hide(const Fit& fit, const Fit& other, std::span<uint32_t> hidden) const {
    // other.radial(fit.center + fit.factor u) = a u + b, where a is lower triangular, too.
    const Eigen::Matrix3f a = (other.inverse * fit.factor).cast<float>();
    const Eigen::Vector3f b = other.radial(fit.center).cast<float>();
    const float a00 = a(0, 0), a10 = a(1, 0), a11 = a(1, 1), a20 = a(2, 0), a21 = a(2, 1), a22 = a(2, 2);
    const float b0 = b.x(), b1 = b.y(), b2 = b.z();
    const float *const x = x_.data(), *const y = y_.data(), *const z = z_.data();
    uint32_t* const out = hidden.data();
    for (size_t i = 0; i < x_.size(); ++i) {
        const float p = a00 * x[i] + b0, q = a10 * x[i] + a11 * y[i] + b1,
                    r = a20 * x[i] + a21 * y[i] + a22 * z[i] + b2;
        out[i] |= p * p + q * q + r * r < 1 ? 1u : 0u;
    }
}

bool apart(const Fit& fit, const Fit& other, double margin) {
    const Vec y = fit.radial(other.center);
    const double far = y.norm();
    const Vec normal = fit.inverse.transpose() * y;
    return far * far > margin * (far + (other.factor.transpose() * normal).norm());
}

} // namespace prolate

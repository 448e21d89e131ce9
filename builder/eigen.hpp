// The builder's only gateway to Eigen: the vector types that its files share.
#pragma once

#include <Eigen/Core>

#include <prolate/types.hpp>

#include <algorithm>

namespace prolate {

using Vec = Eigen::Vector3d;
using Mat = Eigen::Matrix3d;

inline Vec to_vec(const Vec3& v) {
    return {v.x, v.y, v.z};
}

inline bool lexicographically_before(const Vec& a, const Vec& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Axis-aligned box; empty until something is added.
struct Box {
    Vec low = Vec::Constant(HUGE_VAL), high = Vec::Constant(-HUGE_VAL);
    void add(const Vec& p) { low = low.cwiseMin(p), high = high.cwiseMax(p); }
    void add(const Box& b) { low = low.cwiseMin(b.low), high = high.cwiseMax(b.high); }
    Vec center() const { return 0.5 * (low + high); }
    Vec size() const { return high - low; }
    Vec corner(unsigned i) const {
        return {i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z()};
    }
};

} // namespace prolate

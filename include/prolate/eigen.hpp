// Conversions to and from Eigen, inline, for programs that use it.
#pragma once

#include <prolate/types.hpp>

#include <Eigen/Geometry>

namespace prolate {

inline Eigen::Vector3f to_eigen(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 from_eigen(const Eigen::Vector3f& v) {
    return {v.x(), v.y(), v.z()};
}
inline Eigen::Quaternionf to_eigen(const Quat& q) {
    return {q.w, q.x, q.y, q.z};
}
inline Quat from_eigen(const Eigen::Quaternionf& q) {
    return {q.x(), q.y(), q.z(), q.w()};
}

} // namespace prolate

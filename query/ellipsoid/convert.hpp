// Between the floats of the public interface and the doubles that decisions are made in.
#pragma once

#include <prolate/types.hpp>

#include <glm/vec3.hpp>

namespace prolate::query {

inline glm::dvec3 to_double(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 to_float(const glm::dvec3& v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

} // namespace prolate::query

// Conversions to and from GLM, inline, for programs that use it. Memory layouts are never reinterpreted, because GLM's
// build macros change them (quaternion order, vec3 size).
#pragma once

#include <prolate/types.hpp>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace prolate {

inline glm::vec3 to_glm(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 from_glm(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}
inline glm::quat to_glm(const Quat& q) {
    glm::quat out;
    out.x = q.x, out.y = q.y, out.z = q.z, out.w = q.w;
    return out;
}
inline Quat from_glm(const glm::quat& q) {
    return {q.x, q.y, q.z, q.w};
}

} // namespace prolate

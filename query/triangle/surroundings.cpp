#include "query/triangle/surroundings.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {

using glm::dvec3;

Feature Surrounded::highest(const dvec3& up) const noexcept {
    const dvec3(&p)[3] = triangle.corner;
    const double h[3] = {glm::dot(up, p[0]), glm::dot(up, p[1]), glm::dot(up, p[2])};
    return static_cast<Feature>(std::max_element(h, h + 3) - h);
}

Climb Surrounded::climb(Feature from, const dvec3& up) const noexcept {
    const bool edge = from >= kFirstEdge;
    const uint32_t first = edge ? from - kFirstEdge : from, second = edge ? (first + 1) % 3 : first;
    return {hills, rotation != nullptr ? up * *rotation : up, // the transpose times it
            corners[first], corners[second], hills != nullptr ? kClimbSteps : 0};
}

} // namespace prolate::query

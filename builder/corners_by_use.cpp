#include "builder/corners_by_use.hpp"

#include <algorithm>
#include <limits>

namespace prolate {

CornersByUse::CornersByUse(std::span<const Triangle> triangles, std::span<const Vec3> vertices)
    : triangles_(triangles.begin(), triangles.end()) {
    constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
    std::vector<uint32_t> number(vertices.size(), kUnused);
    const auto count = [this] { return static_cast<uint32_t>(vertices_.size()); };
    used_.reserve(triangles.size() + 1);
    for (Triangle& triangle : triangles_) {
        used_.push_back(count());
        for (uint32_t& corner : triangle) {
            if (number[corner] == kUnused) {
                number[corner] = count();
                vertices_.push_back(to_vec(vertices[corner]));
            }
            corner = number[corner];
        }
    }
    used_.push_back(count());
}

std::vector<Vec> CornersByUse::of(uint32_t begin, uint32_t end) const {
    const uint32_t first = used_[begin];
    std::vector<uint32_t> border;
    for (uint32_t t = begin; t < end; ++t)
        for (const uint32_t v : triangles_[t])
            if (v < first) border.push_back(v);
    std::sort(border.begin(), border.end());
    border.erase(std::unique(border.begin(), border.end()), border.end());
    std::vector<Vec> out;
    out.reserve(border.size() + used_[end] - first);
    for (const uint32_t v : border) out.push_back(vertices_[v]);
    out.insert(out.end(), vertices_.begin() + first, vertices_.begin() + used_[end]);
    return out;
}

} // namespace prolate

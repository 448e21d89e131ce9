// Halving by place.
#pragma once

#include "builder/eigen.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace prolate {

/// The lower `count` of `items` along the longest side of the box of their places, and the rest. place(item) is a Vec.
template <class Place>
std::pair<std::vector<uint32_t>, std::vector<uint32_t>> divide(std::vector<uint32_t> items, size_t count,
                                                               Place&& place) {
    Box box;
    for (const uint32_t item : items) box.add(place(item));
    int axis = 0;
    box.size().maxCoeff(&axis);
    std::stable_sort(items.begin(), items.end(),
                     [&](uint32_t a, uint32_t b) { return place(a)[axis] < place(b)[axis]; });
    const auto middle = items.begin() + static_cast<std::ptrdiff_t>(count);
    return {{items.begin(), middle}, {middle, items.end()}};
}

} // namespace prolate

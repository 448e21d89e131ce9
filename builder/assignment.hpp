// Things to groups of limited size, at the least sum of costs: the transportation problem.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace prolate {

/// How many things a group takes.
struct GroupSize {
    uint32_t least, most;
};

/// The group of each of `count` things. The sizes must admit that many. Each thing starts in its cheapest group; what
/// is too much somewhere then moves along the cheapest chains of single moves (successive shortest paths: Ahuja,
/// Magnanti and Orlin, Network Flows, 1993, section 9.7), so with no lower limits the sum is least.
/// O(n m) and, for each of the things too much, O(n + m^3), with n things and m groups.
std::vector<uint32_t> assign(uint32_t count, const std::vector<GroupSize>& groups,
                             const std::function<double(uint32_t thing, uint32_t group)>& cost);

} // namespace prolate

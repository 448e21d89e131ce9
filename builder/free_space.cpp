#include "builder/free_space.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr int kBlock = 16;                  // nodes of a task, along each axis
constexpr double kDistanceRounding = 1e-12; // of the largest coordinate: of measured distances
constexpr float kRoundingOfFloat = 1 - 0x1p-22f;

} // namespace

double round_pitch(double length) {
    int exponent = 0;
    const double fraction = std::frexp(length, &exponent); // 0.5 ... 1
    return std::ldexp(std::ceil(8 * fraction) / 8, exponent);
}

FreeSpace::FreeSpace(const TriangleTree& surface, const Box& region, double pitch, double from, double to)
    : pitch_(pitch), from_(from), to_(to),
      rounding_(kDistanceRounding * std::max(region.low.cwiseAbs().maxCoeff(), region.high.cwiseAbs().maxCoeff())) {
    std::array<int, 3> blocks{};
    for (size_t a = 0; a < 3; ++a) {
        first_[a] = std::floor(region.low[int(a)] / pitch) - 1;
        size_[a] = static_cast<int>(std::ceil(region.high[int(a)] / pitch) - first_[a]) + 1;
        blocks[a] = (size_[a] + kBlock - 1) / kBlock;
    }
    distance_.resize(index(size_[0] - 1, size_[1] - 1, size_[2] - 1) + 1);
    parallel_for(0, blocks[0] * blocks[1] * blocks[2], [&](int b) {
        const std::array<int, 3> at{b / (blocks[1] * blocks[2]), b / blocks[2] % blocks[1], b % blocks[2]};
        Block block{};
        for (size_t a = 0; a < 3; ++a)
            block.low[a] = at[a] * kBlock, block.high[a] = std::min(size_[a], block.low[a] + kBlock);
        measure(surface, block);
    });
}

// All of a block at once if its nodes are wholly beyond the range that matters, else in halves.
void FreeSpace::measure(const TriangleTree& surface, const Block& block) {
    checkpoint();
    const std::array<int, 3> last{block.high[0] - 1, block.high[1] - 1, block.high[2] - 1};
    const Vec low = node(block.low), high = node(last), center = 0.5 * (low + high);
    const double radius = 0.5 * (high - low).norm();
    const double distance = surface.distance(center, 2 * to_ + 2 * radius) - rounding_;
    const bool near = distance + 2 * rounding_ + radius < from_, far = distance - radius >= to_;
    if (near || far || radius == 0) {
        for (int i = block.low[0]; i < block.high[0]; ++i)
            for (int j = block.low[1]; j < block.high[1]; ++j)
                for (int k = block.low[2]; k < block.high[2]; ++k) {
                    const double here = near ? 0 : distance - (node({i, j, k}) - center).norm();
                    distance_[index(i, j, k)] = std::max(0.0f, kRoundingOfFloat * static_cast<float>(here));
                }
        return;
    }
    size_t longest = 0;
    for (size_t a = 1; a < 3; ++a)
        if (block.high[a] - block.low[a] > block.high[longest] - block.low[longest]) longest = a;
    Block below = block, above = block;
    below.high[longest] = above.low[longest] = (block.low[longest] + block.high[longest]) / 2;
    measure(surface, below);
    measure(surface, above);
}

} // namespace prolate

// The builder's own random numbers: the same on every platform, unlike the distributions of <random>.
#pragma once

#include <cstdint>

namespace prolate {

/// splitmix64 (Steele, Lea and Flood 2014): any seed is a good one, and streams of different seeds are independent.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed) {}

    uint64_t bits() {
        uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    /// Uniform in [0, 1).
    double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
    /// Uniform in [-1, 1).
    double symmetric() { return 2 * uniform() - 1; }

private:
    uint64_t state_;
};

} // namespace prolate

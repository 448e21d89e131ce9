#include "bench/covers/published.hpp"

namespace prolate::bench {
namespace {

constexpr double kNone = kUnknown;

constexpr Published kPublished[] = {
    {"horse", 96966, 8, 1.39, 0.576, 3.94, 0.85},      {"horse", 96966, 32, kNone, 0.372, kNone, 0.21},
    {"horse", 96966, 64, 0.46, 0.337, 0.57, 0.13},     {"horse", 96966, 200, kNone, kNone, kNone, 0.07},
    {"horse", 96966, 512, 0.25, kNone, 0.139, 0.045},  {"homer", 12000, 8, 1.0, 0.404, 1.74, 0.52},
    {"homer", 12000, 32, kNone, 0.343, kNone, 0.18},   {"homer", 12000, 64, 0.41, 0.316, 0.34, 0.12},
    {"homer", 12000, 200, kNone, kNone, kNone, 0.065}, {"homer", 12000, 512, 0.24, kNone, 0.054, 0.035},
    {"bunny", 69666, 8, 0.83, 0.234, 1.17, 0.4},       {"bunny", 69666, 32, kNone, 0.195, kNone, 0.15},
    {"bunny", 69666, 64, 0.38, 0.176, 0.33, 0.105},    {"bunny", 69666, 200, kNone, kNone, kNone, 0.055},
    {"bunny", 69666, 512, 0.19, kNone, 0.100, 0.035},  {"knight", 1000, 8, 1.96, 0.833, 3.46, 1.4},
    {"knight", 1000, 32, kNone, 0.533, kNone, 0.55},   {"knight", 1000, 64, 0.77, 0.463, 0.94, 0.3},
    {"knight", 1000, 200, kNone, kNone, kNone, 0.16},  {"knight", 1000, 512, 0.32, kNone, 0.232, 0.1}};

} // namespace

std::span<const Published> all_published() {
    return kPublished;
}

Published published(const std::string& model, uint32_t triangles, uint32_t count) {
    for (const Published& p : kPublished)
        if (p.model == model && p.triangles == triangles && p.count == count) return p;
    return {"", 0, 0, kNone, kNone, kNone, kNone};
}

} // namespace prolate::bench

// Blocks of nodes for tests of the kernels: eight ellipsoids as the file stores them, and as they decode.
#pragma once

#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/tree.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate::scenes {

/// Eight nodes of one lattice: needles and discs up to `ratio`, sizes from two steps to the whole lattice. Their body
/// has a size from 1e-3 to 1e6, and lies up to 20 sizes from the origin.
struct Block {
    std::array<std::byte, kBlockBytes> bytes{};
    LatticeInfo lattice{};
    Ellipsoid ellipsoids[kBlockLanes]; ///< metres
};
inline Block block(Random& random, double ratio) {
    Block out;
    const double size = random.log_in(1e-3, 1e6), shift = size * random.in(0, 20);
    const Point away = random.direction();
    double low[3], high[3];
    for (size_t i = 0; i < 3; ++i) low[i] = shift * away[i] - size / 2, high[i] = low[i] + size;
    out.lattice = format::lattice_for(low, high);
    std::vector<format::PackedNode> nodes;
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
        double center[3];
        for (size_t i = 0; i < 3; ++i) center[i] = random.in(low[i], high[i]);
        const Point axes = radii(random, ratio);
        const double s = size * random.log_in(3e-5, 0.7);
        const Ellipsoid e = ellipsoid({}, {s * axes[0], s * axes[1], s * axes[2]}, random.rotation());
        const double factor[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
        format::PackedNode packed;
        format::quantise(packed, out.lattice, center, factor);
        out.ellipsoids[lane] = format::decode(packed, out.lattice);
        format::store_node(out.bytes.data(), lane, packed);
        nodes.push_back(packed);
    }
    format::store_boxes(out.bytes.data(), nodes, out.lattice);
    return out;
}

inline reference::Matrix factor_of(const Ellipsoid& e) {
    return {{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
}

} // namespace prolate::scenes

#include "query/node/lattice.hpp"

#include <cmath>
#include <cstddef>

namespace prolate::query {

LatticePose lattice_pose(const RelativePose& from_to, const LatticeInfo& from, const LatticeInfo& to) noexcept {
    constexpr double kFarthestCenter = 65535 * 1.7320508075688773;
    const double step_from = step_of(from), per_step_to = steps_per_metre(to);
    const double scale = step_from * per_step_to;
    const double from_origin[] = {double(from.origin[0]), double(from.origin[1]), double(from.origin[2])};
    const double to_origin[] = {double(to.origin[0]), double(to.origin[1]), double(to.origin[2])};
    LatticePose out{};
    out.scale = static_cast<float>(scale);
    out.exponent_from = from.step_exponent;
    double origin_from = 0, origin_to = 0;
    for (size_t r = 0; r < 3; ++r) {
        const auto row = static_cast<glm::length_t>(r);
        double turned = 0;
        for (size_t c = 0; c < 3; ++c) {
            const double entry = from_to.rotation[static_cast<glm::length_t>(c)][row];
            out.linear[c][r] = scale * entry;
            out.linear_rounded[c][r] = static_cast<float>(out.linear[c][r]);
            turned += entry * from_origin[c];
        }
        out.offset[r] = (turned * scale + from_to.translation[row] * per_step_to) - to_origin[r];
        origin_from += from_origin[r] * from_origin[r], origin_to += to_origin[r] * to_origin[r];
    }
    for (size_t c = 0; c < 3; ++c) {
        out.linear[c][3] = out.linear[c][0];
        out.linear_rounded[c][3] = out.linear_rounded[c][0];
    }
    out.offset[3] = out.offset[0];
    out.reach =
        scale * (kFarthestCenter + std::sqrt(origin_from)) + from_to.distance * per_step_to + std::sqrt(origin_to);
    return out;
}

} // namespace prolate::query

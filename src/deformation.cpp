#include "src/deformation.hpp"

#include "src/bytes.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

Vec3 load_point(const std::byte* from) {
    return {load_le<float>(from), load_le<float>(from + 4), load_le<float>(from + 8)};
}

Error bad_section(const char* what, uint64_t where) {
    return {ErrorCode::bad_file, what, where};
}

// Ranges and steps: what they can make of a node stays finite, and within the format's range.
Result<void> check_rows(std::span<const std::byte> content, uint32_t modes) {
    for (uint32_t m = 0; m < modes; ++m) {
        const size_t at = kModeRows + size_t{m} * kModeRowBytes;
        const std::byte* const row = content.data() + at;
        const float range = load_le<float>(row + kModeRange), shift = load_le<float>(row + kShiftStep),
                    growth = load_le<float>(row + kGrowthStep), radius = load_le<float>(row + kRadiusStep);
        if (!(range > 0 && range <= std::numeric_limits<float>::max()))
            return bad_section("the range of a mode is not above 0 and finite", at + kModeRange);
        // Rounded up by half.
        const auto within = [range](float step, double most) {
            return step >= 0 && double{range} * step * kMostMotionSteps <= 1.5 * most;
        };
        if (!within(shift, double{kLargestCoordinate}))
            return bad_section("the step of a mode's shifts is out of range", at + kShiftStep);
        if (!within(growth, kMostMotionGrowth))
            return bad_section("the step of a mode's growths is out of range", at + kGrowthStep);
        if (!within(radius, double{kLargestCoordinate}))
            return bad_section("the step of a mode's radii is out of range", at + kRadiusStep);
    }
    return {};
}

} // namespace

uint32_t Deformation::mode_count() const noexcept {
    return load_le<uint32_t>(content_.data() + kModeCount);
}

uint32_t Deformation::point_count() const noexcept {
    return load_le<uint32_t>(content_.data() + kPointCount);
}

float Deformation::range(uint32_t mode) const noexcept {
    assert(mode < mode_count());
    return load_le<float>(content_.data() + kModeRows + size_t{mode} * kModeRowBytes + kModeRange);
}

// A step is a float, and its multiples are exact in double precision.
Deformation::Motion Deformation::motion(uint32_t slot, uint32_t mode) const noexcept {
    const uint32_t modes = mode_count();
    assert(slot < slots_ && mode < modes);
    const std::byte* const row = content_.data() + kModeRows + size_t{mode} * kModeRowBytes;
    const std::byte* const at = content_.data() + motions_begin(modes) + (size_t{slot} * modes + mode) * kMotionBytes;
    const double step = load_le<float>(row + kShiftStep);
    Motion out{};
    for (size_t i = 0; i < 3; ++i) out.shift[i] = load_le<int16_t>(at + kShift + 2 * i) * step;
    const auto steps = load_le<uint16_t>(at + kGrowth);
    if ((steps & kIsRadius) != 0)
        out.radius = (steps & kMostMotionSteps) * double{load_le<float>(row + kRadiusStep)};
    else
        out.growth = steps * double{load_le<float>(row + kGrowthStep)};
    return out;
}

Deformation::Moved Deformation::moved(uint32_t slot, std::span<const float> q) const noexcept {
    const size_t modes = q.size();
    assert(slot < slots_ && modes == mode_count());
    const std::byte* row = content_.data() + kModeRows;
    const std::byte* at = content_.data() + motions_begin(mode_count()) + size_t{slot} * modes * kMotionBytes;
    Moved out;
    for (size_t m = 0; m < modes; ++m, row += kModeRowBytes, at += kMotionBytes) {
        const double step = double{q[m]} * load_le<float>(row + kShiftStep);
        for (size_t i = 0; i < 3; ++i) {
            const double shift = load_le<int16_t>(at + kShift + 2 * i) * step;
            out.shift[i] += shift, out.lengths[i] += std::abs(shift);
        }
        const auto steps = load_le<uint16_t>(at + kGrowth);
        const bool is_radius = (steps & kIsRadius) != 0;
        const float unit = load_le<float>(row + (is_radius ? kRadiusStep : kGrowthStep));
        (is_radius ? out.radius : out.growth) += std::abs(double{q[m]}) * ((steps & kMostMotionSteps) * double{unit});
    }
    return out;
}

Vec3 Deformation::point(uint32_t p) const noexcept {
    assert(p < point_count() && !exact_);
    return load_point(content_.data() + static_cast<size_t>(points_begin(mode_count(), slots_)) +
                      size_t{p} * kPointBytes);
}

Vec3 Deformation::displacement(uint32_t p, uint32_t mode) const noexcept {
    const uint32_t modes = mode_count();
    assert(p < point_count() && mode < modes);
    return load_point(content_.data() + static_cast<size_t>(displacements_begin(modes, slots_, point_count(), exact_)) +
                      (size_t{p} * modes + mode) * kPointBytes);
}

Deformation::Moved Deformation::displaced(uint32_t p, std::span<const float> q) const noexcept {
    const uint32_t modes = mode_count();
    assert(p < point_count() && q.size() == modes);
    const std::byte* at = content_.data() +
                          static_cast<size_t>(displacements_begin(modes, slots_, point_count(), exact_)) +
                          size_t{p} * modes * kPointBytes;
    Moved out;
    for (size_t m = 0; m < modes; ++m)
        for (size_t i = 0; i < 3; ++i, at += sizeof(float)) {
            const double shift = double{q[m]} * load_le<float>(at); // exact
            out.shift[i] += shift, out.lengths[i] += std::abs(shift);
        }
    return out;
}

Result<void> check_deformation(std::span<const std::byte> content, const TreeView& tree) noexcept {
    if (content.size() < kModeRows) return bad_section("wrong size of a deformation", 0);
    const auto modes = load_le<uint32_t>(content.data() + kModeCount),
               points = load_le<uint32_t>(content.data() + kPointCount);
    const bool exact = tree.has_triangles();
    if (modes < 1 || modes > kMaxModes) return bad_section("a deformation has 1 to 64 modes", kModeCount);
    if (exact ? points != tree.vertex_count() : points < 1)
        return bad_section("a deformation of other points than the tree's", kPointCount);
    if (load_le<uint64_t>(content.data() + kModeZeros) != 0)
        return bad_section("reserved bytes are not zero", kModeZeros);
    if (content.size() != deformation_bytes(modes, tree.slot_count(), points, exact))
        return bad_section("wrong size of a deformation", 0);
    if (const auto sound = check_rows(content, modes); !sound) return sound;
    for (uint32_t slot = 0; slot < tree.slot_count(); ++slot) {
        const size_t bytes = size_t{modes} * kMotionBytes, at = motions_begin(modes) + slot * bytes;
        const auto row = content.subspan(at, bytes);
        if (!tree.is_node(slot) && std::any_of(row.begin(), row.end(), [](std::byte b) { return b != std::byte{0}; }))
            return bad_section("a lane without a node is not zero", at);
    }
    for (auto at = static_cast<size_t>(points_begin(modes, tree.slot_count())); at < content.size(); at += 4)
        if (!(std::abs(load_le<float>(content.data() + at)) <= kLargestCoordinate)) // also a NaN
            return bad_section("a point or a displacement is not finite, or beyond the largest coordinate (2^74 m)",
                               at);
    return {};
}

} // namespace prolate

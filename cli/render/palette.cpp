// OKLab is B. Ottosson's perceptual space (2020, https://bottosson.github.io/posts/oklab/); constants are his.
#include "cli/render/palette.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace prolate::cli {
namespace {

using glm::dvec3;

// glm matrices are given column by column; these are written as rows and multiplied from the right: v * M.
constexpr glm::dmat3 kRgbToLms = {0.4122214708, 0.5363325363, 0.0514459929, 0.2119034982, 0.6806995451,
                                  0.1073969566, 0.0883024619, 0.2817188376, 0.6299787005};
constexpr glm::dmat3 kLmsToLab = {0.2104542553, 0.7936177850, -0.0040720468, 1.9779984951, -2.4285922050,
                                  0.4505937099, 0.0259040371, 0.7827717662,  -0.8086757660};
constexpr glm::dmat3 kLabToLms = {1, 0.3963377774,  0.2158037573, 1, -0.1055613458, -0.0638541728,
                                  1, -0.0894841775, -1.2914855480};
constexpr glm::dmat3 kLmsToRgb = {4.0767416621,  -3.3077115913, 0.2309699292,  -1.2684380046, 2.6097574011,
                                  -0.3413193965, -0.0041960863, -0.7034186147, 1.7076147010};

dvec3 unclipped_rgb(const Oklch& c) {
    const dvec3 lab(c.lightness, c.chroma * std::cos(c.hue), c.chroma * std::sin(c.hue));
    const dvec3 root = lab * kLabToLms;
    return (root * root * root) * kLmsToRgb;
}

bool in_gamut(const dvec3& rgb) {
    constexpr double kSlack = 1e-6;
    return std::min({rgb.x, rgb.y, rgb.z}) >= -kSlack && std::max({rgb.x, rgb.y, rgb.z}) <= 1 + kSlack;
}

// In the order in which neighbours differ most.
constexpr std::array<uint32_t, 8> kUniversal = {0x0072B2, 0xE69F00, 0x009E73, 0xCC79A7,
                                                0x56B4E9, 0xD55E00, 0xF0E442, 0x882255};

// Every eighth of the map; between them it is straight enough, to 3 of 255.
constexpr std::array<uint32_t, 9> kViridis = {0x440154, 0x472C7A, 0x3B518B, 0x2C718E, 0x21908D,
                                              0x27AD81, 0x5CC863, 0xAADC32, 0xFDE725};

// "0xRRGGBB" in 0 ... 1, as encoded.
dvec3 channels(uint32_t rgb) {
    return dvec3(rgb >> 16 & 255, rgb >> 8 & 255, rgb & 255) / 255.0;
}

dvec3 decoded(const dvec3& encoded) {
    return {srgb_decode(encoded.x), srgb_decode(encoded.y), srgb_decode(encoded.z)};
}

// 0, 1/2, 1/4, 3/4, 1/8, ...: any first few are far apart.
double van_der_corput(uint32_t i) {
    double value = 0;
    for (double bit = 0.5; i != 0; i >>= 1, bit /= 2)
        if (i & 1) value += bit;
    return value;
}

} // namespace

double srgb_encode(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double srgb_decode(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

Oklch to_oklch(const dvec3& linear_rgb) {
    const dvec3 lms = linear_rgb * kRgbToLms;
    const dvec3 lab = dvec3(std::cbrt(lms.x), std::cbrt(lms.y), std::cbrt(lms.z)) * kLmsToLab;
    return {lab.x, std::hypot(lab.y, lab.z), std::atan2(lab.z, lab.y)};
}

dvec3 to_linear_rgb(Oklch colour) {
    if (!in_gamut(unclipped_rgb(colour))) {
        double low = 0, high = colour.chroma;
        for (int i = 0; i < 40; ++i) {
            colour.chroma = (low + high) / 2;
            (in_gamut(unclipped_rgb(colour)) ? low : high) = colour.chroma;
        }
        colour.chroma = low;
    }
    return glm::clamp(unclipped_rgb(colour), 0.0, 1.0);
}

Oklch branch_colour(uint32_t i, uint32_t n) {
    if (n <= kUniversal.size()) return to_oklch(decoded(channels(kUniversal[i % kUniversal.size()])));
    static constexpr double kLightness[3] = {0.62, 0.78, 0.5};
    // Around the circle, the last must differ from the first, too.
    const uint32_t shade = i + 1 == n && n % 3 == 1 ? 1 : i % 3;
    return {kLightness[shade], 0.13, 2 * std::numbers::pi * i / n};
}

std::vector<Oklch> node_colours(const TreeView& tree) {
    std::vector<Oklch> colours(tree.slot_count(), kNeutral);
    std::vector<Oklch> ancestor(colours);
    tree.for_each_node([&](uint32_t node) {
        const ChildRange range = tree.children(node);
        for (uint32_t i = 0; i < range.count; ++i) {
            const uint32_t child = range.first + i;
            if (node == 0) {
                colours[child] = ancestor[child] = branch_colour(i, range.count);
                continue;
            }
            // Up to 0.09 lighter or darker, always relative to level 1, so that deep levels do not drift.
            ancestor[child] = ancestor[node];
            colours[child] = ancestor[node];
            const double shift = 0.18 * (van_der_corput(i + 1) - 0.5);
            colours[child].lightness = std::clamp(ancestor[node].lightness + shift, 0.25, 0.93);
        }
    });
    return colours;
}

dvec3 heat_colour(double share) {
    const double at = std::clamp(share, 0.0, 1.0) * (kViridis.size() - 1);
    const size_t i = std::min(static_cast<size_t>(at), kViridis.size() - 2);
    return decoded(glm::mix(channels(kViridis[i]), channels(kViridis[i + 1]), at - static_cast<double>(i)));
}

} // namespace prolate::cli

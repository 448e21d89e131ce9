#include "cli/render/heat.hpp"
#include "cli/render/palette.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace prolate::cli {
namespace {

constexpr const char* kTitle = "outside distance, % of the mesh's diagonal";
constexpr uint8_t kFrameGrey = 90;

struct Tick {
    double percent;
    std::string label;
};

// The ends first, then from the top down: in this order they are given room.
std::vector<Tick> ticks(const HeatScale& scale) {
    std::vector<Tick> out = {{0, "0"}, {scale.top, fmt::format("{:g}{}", scale.top, scale.beyond ? "+" : "")}};
    const int digits = static_cast<int>(std::floor(std::log10(scale.top)));
    for (int power = digits; power >= digits - 2; --power)
        for (const double first : {5.0, 2.0, 1.0})
            if (const double percent = first * std::pow(10.0, power); percent < scale.top)
                out.push_back({percent, fmt::format("{:g}", percent)});
    return out;
}

void draw_box(Sheet& sheet, uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1, const glm::u8vec3& colour) {
    for (uint32_t y = y0; y < std::min(y1, sheet.height); ++y)
        for (uint32_t x = x0; x < std::min(x1, sheet.width); ++x)
            for (int channel = 0; channel < 3; ++channel)
                sheet.rgb[(size_t{sheet.width} * y + x) * 3 + static_cast<size_t>(channel)] = colour[channel];
}

} // namespace

double HeatScale::round_up(double percent) {
    if (!(percent > 0)) return 1;
    const double unit = std::pow(10.0, std::floor(std::log10(percent)));
    for (const double first : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0})
        if (percent <= first * unit) return first * unit;
    return 10 * unit;
}

double HeatScale::share(double percent) const {
    return std::cbrt(std::clamp(percent / top, 0.0, 1.0));
}

glm::dvec3 HeatScale::colour(double percent) const {
    return heat_colour(share(percent));
}

uint32_t legend_height(uint32_t text) {
    return 4 * text + text / 2;
}

void draw_legend(Sheet& sheet, const Font& font, const HeatScale& scale, uint32_t text, uint32_t top) {
    const TextImage title = font.draw(kTitle, text);
    const uint32_t gap = text, bar_height = text + text / 4, edge = std::max(1u, text / 20);
    const uint32_t room = sheet.width - std::min(sheet.width, title.width + 4 * gap);
    const uint32_t bar = std::clamp(sheet.width * 2 / 5, std::min(room, 4 * text), room);
    if (bar < 2) return;
    const uint32_t left = (sheet.width - (title.width + gap + bar)) / 2, x0 = left + title.width + gap;
    const uint32_t y0 = top + text;
    draw_line(sheet, title, left, y0 + bar_height / 2 - title.height / 2);

    const glm::u8vec3 grey(kFrameGrey);
    draw_box(sheet, x0 - edge, y0 - edge, x0 + bar + edge, y0 + bar_height + edge, grey);
    for (uint32_t x = 0; x < bar; ++x) {
        const glm::dvec3 linear = heat_colour((x + 0.5) / bar);
        const glm::dvec3 encoded(srgb_encode(linear.x), srgb_encode(linear.y), srgb_encode(linear.z));
        draw_box(sheet, x0 + x, y0, x0 + x + 1, y0 + bar_height, glm::u8vec3(glm::round(255.0 * encoded)));
    }
    std::vector<std::pair<uint32_t, uint32_t>> taken; // by labels, along x
    for (const Tick& tick : ticks(scale)) {
        const TextImage label = font.draw(tick.label, text);
        const auto at = x0 + static_cast<uint32_t>(std::lround(scale.share(tick.percent) * (bar - 1)));
        const uint32_t from = at - std::min(at, label.width / 2), to = from + label.width;
        const bool fits = std::none_of(taken.begin(), taken.end(), [&](const auto& other) {
            return from < other.second + text / 2 && other.first < to + text / 2;
        });
        if (!fits) continue;
        taken.emplace_back(from, to);
        const uint32_t below = y0 + bar_height + edge;
        draw_box(sheet, at, below, at + edge, below + text / 4, grey);
        draw_line(sheet, label, from, below + text / 4);
    }
}

} // namespace prolate::cli

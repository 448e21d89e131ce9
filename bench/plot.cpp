#include "bench/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace prolate::bench {
namespace {

constexpr double kWide = 400, kHigh = 300;           // of a panel's axes
constexpr double kLeft = 75, kTop = 70, kBelow = 55; // margins around them
constexpr double kLegendLine = 20;
constexpr std::array kColours = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                 "#E69F00", "#56B4E9", "#000000", "#999999"};

// A decimal logarithm's range onto pixels.
struct Axis {
    double low, high, from, to;
    double operator()(double value) const { return from + (std::log10(value) - low) / (high - low) * (to - from); }
};

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
    return out;
}

std::string words(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                       escaped(text));
}

// "0.1", "1", "1,000".
std::string power(int exponent) {
    if (exponent < 0) return fmt::format("{:.{}f}", std::pow(10, exponent), -exponent);
    std::string digits = "1";
    for (int k = exponent; k > 0; --k) digits += (k % 3 == 0) ? ",0" : "0";
    return digits;
}

std::string marker(size_t which, double x, double y) {
    const char* const colour = kColours[which];
    switch (which % 4) {
    case 0:
        return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x, y, colour);
    case 1:
        return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"8\" height=\"8\" fill=\"{}\"/>\n", x - 4, y - 4,
                           colour);
    case 2:
        return fmt::format("<path d=\"M{:.1f} {:.1f}l5 9h-10z\" fill=\"{}\"/>\n", x, y - 5.5, colour);
    default:
        return fmt::format("<path d=\"M{:.1f} {:.1f}l5 5l-5 5l-5 -5z\" fill=\"{}\"/>\n", x, y - 5, colour);
    }
}

// The whole decades around the values.
std::pair<double, double> decades(double low, double high) {
    const double first = std::floor(std::log10(low) + 1e-9), last = std::ceil(std::log10(high) - 1e-9);
    return {first, std::max(last, first + 1)};
}

std::string ticks(const Axis& x, const Axis& y) {
    std::string out;
    for (int e = static_cast<int>(std::ceil(x.low)); e <= x.high; ++e) {
        const double at = x(std::pow(10, e));
        out += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#ddd\"/>\n", at, y.from, y.to);
        out += words(at, y.from + 18, "middle", power(e));
    }
    for (int e = static_cast<int>(std::ceil(y.low)); e <= y.high; ++e) {
        const double at = y(std::pow(10, e));
        out += fmt::format("<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#ddd\"/>\n", x.from, at, x.to);
        out += words(x.from - 7, at + 4, "end", power(e));
    }
    for (int e = static_cast<int>(x.low); e < x.high; ++e) // 2 to 9 times each power, without labels
        for (int k = 2; k < 10; ++k)
            out += fmt::format("<path d=\"M{:.1f} {:.1f}v-4\" stroke=\"#444\"/>\n", x(k * std::pow(10, e)), y.from);
    for (int e = static_cast<int>(y.low); e < y.high; ++e)
        for (int k = 2; k < 10; ++k)
            out += fmt::format("<path d=\"M{:.1f} {:.1f}h4\" stroke=\"#444\"/>\n", x.from, y(k * std::pow(10, e)));
    return out;
}

} // namespace

std::string log_log_plot(const std::string& title, const std::string& x_label, const std::vector<Panel>& panels) {
    double x_low = std::numeric_limits<double>::infinity(), x_high = 0;
    std::vector<std::string> labels;
    for (const Panel& panel : panels)
        for (const Series& s : panel.series) {
            if (std::ranges::find(labels, s.label) == labels.end()) labels.push_back(s.label);
            for (const auto& p : s.points) x_low = std::min(x_low, p.first), x_high = std::max(x_high, p.first);
        }
    if (x_high == 0) x_low = x_high = 1;

    const double width = static_cast<double>(panels.size()) * (kWide + kLeft) + 25;
    const double legend = kTop + kHigh + kBelow;
    const double height = legend + kLegendLine * static_cast<double>(labels.size() + 1) + 10;
    std::string out = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                                  "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"12\">\n"
                                  "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                                  width, height);
    out += words(width / 2, 24, "middle", title, " font-size=\"16\"");
    for (size_t at = 0; at < panels.size(); ++at) {
        const Panel& panel = panels[at];
        double y_low = std::numeric_limits<double>::infinity(), y_high = 0;
        for (const Series& s : panel.series)
            for (const auto& p : s.points) y_low = std::min(y_low, p.second), y_high = std::max(y_high, p.second);
        if (y_high == 0) y_low = y_high = 1;
        const auto [x0, x1] = decades(x_low, x_high);
        const auto [y0, y1] = decades(y_low, y_high);
        const double left = static_cast<double>(at) * (kWide + kLeft) + kLeft;
        const Axis x{x0, x1, left, left + kWide}, y{y0, y1, kTop + kHigh, kTop};
        out += ticks(x, y);
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
                           "stroke=\"#444\"/>\n",
                           left, kTop, kWide, kHigh);
        out += words(left + kWide / 2, kTop - 12, "middle", panel.title, " font-weight=\"bold\"");
        out += words(left + kWide / 2, kTop + kHigh + 38, "middle", x_label);
        out += words(
            0, 0, "middle", panel.y_label,
            fmt::format(" transform=\"translate({:.1f} {:.1f}) rotate(-90)\"", left - 55, kTop + kHigh / 2).c_str());
        // y = x, moved to run through the lower left corner, as far as the panel goes.
        const double far = std::min(x1 - x0, y1 - y0);
        out += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#888\" stroke-dasharray=\"2 4\"/>\n",
                           x.from, y.from, x(std::pow(10, x0 + far)), y(std::pow(10, y0 + far)));
        for (const Series& s : panel.series) {
            const auto which =
                static_cast<size_t>(std::ranges::find(labels, s.label) - labels.begin()) % kColours.size();
            std::string path, markers;
            for (const auto& [px, py] : s.points) {
                path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(px), y(py));
                markers += marker(which, x(px), y(py));
            }
            if (!path.empty())
                out += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>\n{}", path,
                                   kColours[which], markers);
        }
    }
    for (size_t k = 0; k < labels.size(); ++k) {
        const double y = legend + kLegendLine * static_cast<double>(k + 1) - 4;
        const size_t which = k % kColours.size();
        out += fmt::format("<path d=\"M{0:.1f} {1:.1f}h30\" stroke=\"{2}\" stroke-width=\"2\"/>\n{3}", kLeft, y,
                           kColours[which], marker(which, kLeft + 15, y));
        out += words(kLeft + 40, y + 4, "start", labels[k]);
    }
    const double y = legend + kLegendLine * static_cast<double>(labels.size() + 1) - 4;
    out += fmt::format("<path d=\"M{:.1f} {:.1f}h30\" stroke=\"#888\" stroke-dasharray=\"2 4\"/>\n", kLeft, y);
    out += words(kLeft + 40, y + 4, "start", "linear");
    return out + "</svg>\n";
}

} // namespace prolate::bench

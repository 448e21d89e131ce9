#include "bench/covers/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace prolate::bench {
namespace {

constexpr double kWide = 300, kHigh = 230;                       // of a panel's axes
constexpr double kLeft = 75, kTop = 34, kBelow = 55, kHead = 36; // margins around them
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

// 0.1, 1, 1,000: a number of one digit and its zeros.
std::string plain(int digit, int exponent) {
    if (exponent < 0) return fmt::format("{:.{}f}", digit * std::pow(10, exponent), -exponent);
    std::string digits = std::to_string(digit);
    for (int k = exponent; k > 0; --k) digits += (k % 3 == 0) ? ",0" : "0";
    return digits;
}

// A hollow one is larger: it may lie on another.
std::string marker(size_t which, double x, double y, bool hollow) {
    const double r = hollow ? 7 : 4;
    const std::string look = hollow ? fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"2\"", kColours[which])
                                    : fmt::format("fill=\"{}\"", kColours[which]);
    switch (which % 4) {
    case 0:
        return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" {}/>\n", x, y, r, look);
    case 1:
        return fmt::format("<rect x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2}\" height=\"{2}\" {3}/>\n", x - r, y - r,
                           2 * r, look);
    case 2:
        return fmt::format("<path d=\"M{:.1f} {:.1f}l{} {}h{}z\" {}/>\n", x, y - 1.4 * r, 1.25 * r, 2.25 * r, -2.5 * r,
                           look);
    default:
        return fmt::format("<path d=\"M{0:.1f} {1:.1f}l{2} {2}l-{2} {2}l-{2} -{2}z\" {3}/>\n", x, y - 1.25 * r,
                           1.25 * r, look);
    }
}

// The values' range, widened to the next 1, 2 or 5 times a power of ten, as logarithms.
struct Range {
    double low = std::numeric_limits<double>::infinity(), high = 0;
    void add(double value) { low = std::min(low, value), high = std::max(high, value); }
    std::pair<double, double> limits() const {
        if (high == 0) return {0, 1};
        double first = 0, last = 0;
        for (int e = -12; e < 12; ++e)
            for (const int digit : {1, 2, 5}) {
                const double tick = digit * std::pow(10, e);
                if (tick <= low * (1 + 1e-9)) first = tick;
                if (tick < high * (1 - 1e-9)) last = tick;
            }
        const double digit = last / std::pow(10, std::floor(std::log10(last) + 1e-9));
        last *= digit > 1.5 && digit < 3 ? 2.5 : 2;
        return {std::log10(first), std::log10(last)};
    }
};

// Lines at 1, 2 and 5 times each power of ten, where there are many decades at powers alone; short strokes at the
// others.
std::string ticks(const Axis& x, const Axis& y) {
    std::string out;
    const auto along = [](const Axis& axis, const auto& draw) {
        for (int e = static_cast<int>(std::floor(axis.low)); e <= axis.high; ++e)
            for (int digit = 1; digit < 10; ++digit) {
                const double value = digit * std::pow(10, e), at = std::log10(value);
                if (at < axis.low - 1e-9 || at > axis.high + 1e-9) continue;
                const bool line = digit == 1 || (axis.high - axis.low < 2.6 && (digit == 2 || digit == 5));
                const bool labelled = line && (digit == 1 || value < 1000); // long numbers would touch
                draw(axis(value), line, labelled ? plain(digit, e) : "");
            }
    };
    along(x, [&](double at, bool line, const std::string& label) {
        if (!line)
            out += fmt::format("<path d=\"M{:.1f} {:.1f}v-4\" stroke=\"#444\"/>\n", at, y.from);
        else
            out += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#ddd\"/>\n", at, y.from, y.to) +
                   words(at, y.from + 18, "middle", label);
    });
    along(y, [&](double at, bool line, const std::string& label) {
        if (!line)
            out += fmt::format("<path d=\"M{:.1f} {:.1f}h4\" stroke=\"#444\"/>\n", x.from, at);
        else
            out += fmt::format("<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#ddd\"/>\n", x.from, at, x.to) +
                   words(x.from - 7, at + 4, "end", label);
    });
    return out;
}

std::string curve(const Series& s, size_t which, const Axis& x, const Axis& y) {
    std::string path, markers;
    const bool alone = s.points.size() == 1;
    for (const auto& [px, py] : s.points) {
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(px), y(py));
        markers += marker(which, x(px), y(py), alone);
    }
    if (!alone)
        path = fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>\n", path, kColours[which]);
    else
        path.clear();
    return path + markers;
}

} // namespace

std::string log_log_plot(const std::string& title, const std::string& x_label, const std::vector<Panel>& panels,
                         const PlotOptions& options) {
    std::map<std::string, Range> x_ranges, y_ranges;
    std::vector<std::string> labels;
    std::map<std::string, bool> curved; // which labels are those of curves, and not of single points alone
    for (const Panel& panel : panels)
        for (const Series& s : panel.series) {
            if (std::ranges::find(labels, s.label) == labels.end()) labels.push_back(s.label);
            curved[s.label] |= s.points.size() > 1;
            for (const auto& p : s.points) x_ranges[panel.x_label].add(p.first), y_ranges[panel.y_label].add(p.second);
        }
    const auto style = [&labels](const Series& s) {
        return static_cast<size_t>(std::ranges::find(labels, s.label) - labels.begin()) % kColours.size();
    };

    const size_t columns = options.columns ? options.columns : panels.size(),
                 rows = (panels.size() + columns - 1) / columns;
    const double width = static_cast<double>(columns) * (kWide + kLeft) + 25;
    const double legend = kHead + static_cast<double>(rows) * (kTop + kHigh + kBelow);
    const double height = legend + kLegendLine * static_cast<double>(labels.size() + options.slope_of_one) + 10;
    std::string out = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                                  "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"12\">\n"
                                  "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                                  width, height);
    out += words(width / 2, 24, "middle", title, " font-size=\"16\"");
    for (size_t at = 0; at < panels.size(); ++at) {
        const Panel& panel = panels[at];
        const auto [x0, x1] = x_ranges[panel.x_label].limits();
        const auto [y0, y1] = y_ranges[panel.y_label].limits();
        const size_t row = at / columns, column = at % columns;
        const double left = static_cast<double>(column) * (kWide + kLeft) + kLeft;
        const double top = kHead + static_cast<double>(row) * (kTop + kHigh + kBelow) + kTop;
        const Axis x{x0, x1, left, left + kWide}, y{y0, y1, top + kHigh, top};
        out += ticks(x, y);
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
                           "stroke=\"#444\"/>\n",
                           left, top, kWide, kHigh);
        out += words(left + kWide / 2, top - 12, "middle", panel.title, " font-weight=\"bold\"");
        out += words(left + kWide / 2, top + kHigh + 38, "middle", panel.x_label.empty() ? x_label : panel.x_label);
        out += words(
            0, 0, "middle", panel.y_label,
            fmt::format(" transform=\"translate({:.1f} {:.1f}) rotate(-90)\"", left - 55, top + kHigh / 2).c_str());
        if (options.slope_of_one) { // y = x, moved to run through the lower left corner, as far as the panel goes
            const double far = std::min(x1 - x0, y1 - y0);
            out += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#888\" stroke-dasharray=\"2 4\"/>\n",
                               x.from, y.from, x(std::pow(10, x0 + far)), y(std::pow(10, y0 + far)));
        }
        for (const Series& s : panel.series) out += curve(s, style(s), x, y);
    }
    double y = legend + kLegendLine - 4;
    for (size_t k = 0; k < labels.size(); ++k, y += kLegendLine) {
        const size_t which = k % kColours.size();
        if (curved[labels[k]])
            out += fmt::format("<path d=\"M{:.1f} {:.1f}h30\" stroke=\"{}\" stroke-width=\"2\"/>\n", kLeft, y,
                               kColours[which]);
        out += marker(which, kLeft + 15, y, !curved[labels[k]]);
        out += words(kLeft + 40, y + 4, "start", labels[k]);
    }
    if (options.slope_of_one) {
        out += fmt::format("<path d=\"M{:.1f} {:.1f}h30\" stroke=\"#888\" stroke-dasharray=\"2 4\"/>\n", kLeft, y);
        out += words(kLeft + 40, y + 4, "start", "linear");
    }
    return out + "</svg>\n";
}

} // namespace prolate::bench

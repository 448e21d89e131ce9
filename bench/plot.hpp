// Plots with two logarithmic axes, as SVG.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace prolate::bench {

struct Series {
    std::string label;
    std::vector<std::pair<double, double>> points; ///< x and y, both above 0
};

/// Axes side by side over the same x, with one legend below: a label has the same colour and marker in all panels.
struct Panel {
    std::string title, y_label;
    std::vector<Series> series;
};

/// The text of an SVG file. White ground, the colours of Okabe and Ito (told apart by the colour-blind, too), and a
/// marker of its own for each series. In each panel a dotted line of slope 1: what is linear runs along it. At most
/// eight series.
std::string log_log_plot(const std::string& title, const std::string& x_label, const std::vector<Panel>& panels);

} // namespace prolate::bench

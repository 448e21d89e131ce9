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

/// One pair of axes. Panels of the same label share their range of x, or of y, and a series' label has the same colour
/// and marker in all.
struct Panel {
    std::string title, y_label;
    std::vector<Series> series;
    std::string x_label = {}; ///< "": the plot's
};

struct PlotOptions {
    size_t columns = 0;        ///< of panels; 0: all side by side
    bool slope_of_one = false; ///< in each panel a dotted line of slope 1: what is linear runs along it
};

/// The text of an SVG file, with one legend below all panels. White ground, the colours of Okabe and Ito (told apart by
/// the colour-blind, too), and a marker of its own for each series. At most eight series. A series of one point is a
/// hollow marker.
std::string log_log_plot(const std::string& title, const std::string& x_label, const std::vector<Panel>& panels,
                         const PlotOptions& options = {});

} // namespace prolate::bench

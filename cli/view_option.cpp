#include "cli/view_option.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <vector>

namespace prolate::cli {

void declare_view(CLI::App& command, ViewWords& words, const std::string& prefix) {
    command.add_option("--view", words.view,
                       prefix + "where the viewer stands: azimuth and elevation, degrees (default: 30,18)");
    command.add_option("--up", words.up, prefix + "the model's axis that points up")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(kUpAxes), std::end(kUpAxes))))
        ->capture_default_str();
}

Outcome<View> view_of(const ViewWords& words) {
    View view;
    view.up = static_cast<UpAxis>(std::find(std::begin(kUpAxes), std::end(kUpAxes), words.up) - std::begin(kUpAxes));
    if (words.view.empty()) return view;
    const char* const end = words.view.data() + words.view.size();
    const auto [comma, first] = std::from_chars(words.view.data(), end, view.azimuth);
    const bool second = first == std::errc() && comma != end && *comma == ',';
    const auto [rest, error] = std::from_chars(second ? comma + 1 : end, end, view.elevation);
    if (second && error == std::errc() && rest == end && std::isfinite(view.azimuth) && std::abs(view.elevation) <= 89)
        return view;
    return Failure{kUsage, "--view", "not an azimuth and an elevation of -89 to 89 degrees", "write it as 30,18"};
}

} // namespace prolate::cli

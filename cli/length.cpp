#include "cli/length.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace prolate::cli {
namespace {

constexpr LengthUnit kUnits[] = {{"mm", 0.001}, {"cm", 0.01}, {"m", 1}, {"in", 0.0254}, {"ft", 0.3048}};
constexpr const char* kLengthAdvice = "write a length with its unit: mm, cm, m, in or ft, as in 5mm";

std::string rounded(double metres, const LengthUnit& unit, double (*round)(double)) {
    const double value = metres / unit.metres;
    const double step = std::pow(10, std::floor(std::log10(value)) - 2);
    return fmt::format("{:.3g}{}", round(value / step) * step, unit.name);
}

} // namespace

std::span<const LengthUnit> length_units() {
    return kUnits;
}

const LengthUnit* find_length_unit(std::string_view name) {
    const auto* const found = std::ranges::find(kUnits, name, &LengthUnit::name);
    return found == std::end(kUnits) ? nullptr : found;
}

Outcome<Length> read_length(const std::string& option, const std::string& text) {
    const auto refuse = [&option](const std::string& what, const std::string& advice = kLengthAdvice) {
        return Failure{kUsage, option, what, advice};
    };
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (end == text.c_str()) return refuse(fmt::format("'{}' is no length", text));
    std::string_view name = end;
    name.remove_prefix(std::min(name.find_first_not_of(' '), name.size()));
    if (name.empty()) return refuse(fmt::format("'{}' has no unit", text));
    if (name == "%")
        return refuse(fmt::format("'{}' is no length", text),
                      fmt::format("{} % of the mesh's diagonal is --distance {}", value, value));
    const LengthUnit* const unit = find_length_unit(name);
    if (unit == nullptr) return refuse(fmt::format("there is no unit '{}'", name));
    if (!(value > 0) || !std::isfinite(value)) return refuse(fmt::format("'{}' is not above 0", text));
    return Length{value * unit->metres, unit};
}

std::string rounded_up(double metres, const LengthUnit& unit) {
    return rounded(metres, unit, [](double x) { return std::ceil(x); });
}

std::string rounded_down(double metres, const LengthUnit& unit) {
    return rounded(metres, unit, [](double x) { return std::floor(x); });
}

} // namespace prolate::cli

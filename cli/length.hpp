// Lengths as people write them: "5mm", "0.2in".
#pragma once

#include "cli/failure.hpp"

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace prolate::cli {

/// A unit of length and what it is in metres.
struct LengthUnit {
    const char* name;
    double metres;
};
/// All that the command knows.
std::span<const LengthUnit> length_units();
/// The one of this name, if there is one.
const LengthUnit* find_length_unit(std::string_view name);

/// A length with the unit that it was given in.
struct Length {
    double metres;
    const LengthUnit* unit;
};

/// Reads a number above 0 with a unit behind it. `option` is what a failure is about.
Outcome<Length> read_length(const std::string& option, const std::string& text);

/// `metres` in that unit, rounded up (or down) to three digits, as read_length() takes it.
std::string rounded_up(double metres, const LengthUnit& unit);
std::string rounded_down(double metres, const LengthUnit& unit);

} // namespace prolate::cli

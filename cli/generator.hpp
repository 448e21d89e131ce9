// The name by which prolate's files say who made them; outputs.cpp looks for it.
#pragma once

#include <prolate/version.hpp>

#include <string>

namespace prolate::cli {

/// "prolate 0.1.0"
inline std::string generator() {
    return "prolate " + std::to_string(PROLATE_VERSION_MAJOR) + '.' + std::to_string(PROLATE_VERSION_MINOR) + '.' +
           std::to_string(PROLATE_VERSION_PATCH);
}

} // namespace prolate::cli

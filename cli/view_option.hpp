// The option --view of pictures: where the viewer stands.
#pragma once

#include "cli/failure.hpp"
#include "cli/render/camera.hpp"

#include <string>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace prolate::cli {

/// The words of --view and --up.
struct ViewWords {
    std::string view, up = "y";
};

/// Declares both; `prefix` begins what they say of themselves.
void declare_view(CLI::App& command, ViewWords& words, const std::string& prefix = "");

/// What they say.
Outcome<View> view_of(const ViewWords& words);

} // namespace prolate::cli

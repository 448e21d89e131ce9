// The option --pose: where body B is in the frame of body A.
#pragma once

#include <prolate/types.hpp>

#include <optional>
#include <string_view>

namespace prolate::cli {

/// "tx,ty,tz" or "tx,ty,tz,qx,qy,qz,qw": three or seven finite numbers with commas between them, the last four not all
/// zero.
std::optional<Pose> parse_pose(std::string_view text);

/// Reports a --pose that parse_pose() refuses, and returns the exit code.
int complain_of_pose();

} // namespace prolate::cli

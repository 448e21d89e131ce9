// The option --pose: where body B is in the frame of body A.
#pragma once

#include "cli/failure.hpp"

#include <prolate/types.hpp>

#include <string_view>

namespace prolate::cli {

/// "tx,ty,tz" or "tx,ty,tz,qx,qy,qz,qw": three or seven finite numbers with commas between them, the last four not all
/// zero.
Outcome<Pose> parse_pose(std::string_view text);

} // namespace prolate::cli

// What the command asks before long work; save() itself is in <prolate/tree.hpp>.
#pragma once

#include <prolate/error.hpp>

namespace prolate {

/// Could save() write to `path` now? Finds out what need not wait until the work is done: a missing folder,
/// permissions, a name that is too long, a full disk. Leaves everything as it is. Fails as save() would.
Result<void> can_save(const char* path);

} // namespace prolate

// How long queries of a tree take, for tables that people compare by.
#pragma once

#include <prolate/tree.hpp>

namespace prolate::cli {

/// What `collide` takes for a body and itself that are just apart: the median over random directions and attitudes, at
/// a hundredth of the size from contact.
double nanoseconds_a_query(const TreeView& tree);

} // namespace prolate::cli

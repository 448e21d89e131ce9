// Does one of two bodies whose surfaces do not meet hold a part of the other?
#pragma once

#include "query/ellipsoid/separation.hpp"

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate::query {

/// overlapping if so: a closed exact tree encloses a vertex of the other's surface, or of a tree without triangles the
/// center of a leaf. Ask only if the surfaces do not meet. Counts what it looks at in `stats`, and is
/// undecided if that would exceed `most_tests`.
Verdict look_inside(const TreeView& a, const TreeView& b, const RelativePose& b_to_a, QueryStats& stats,
                    uint64_t most_tests) noexcept;

} // namespace prolate::query

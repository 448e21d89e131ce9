// contacts() of two bodies with its one threshold, so that tests can compare with the answer from all pairs.
#pragma once

#include <prolate/contacts.hpp>

#include <cstdint>

namespace prolate::query {

/// Pairs that meet, more than most bodies have: from then on contacts() leaves out what adds nothing.
inline constexpr uint64_t kMany = 64;

/// The public contacts(), which leaves out nothing before `many` pairs meet.
ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, Scratch context, const QueryOptions& options,
                       uint64_t many) noexcept;

} // namespace prolate::query

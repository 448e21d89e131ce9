// Runs a check once for every instruction set that this machine has and the library was compiled for.
#pragma once

#include "query/simd/targets.hpp"

#include <hwy/highway.h>
#include <hwy/targets.h>

namespace prolate::targets {

template <class Check> void for_each(Check&& check) {
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        check(hwy::TargetName(target));
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

} // namespace prolate::targets

// How many threads the system gives.
#pragma once

namespace prolate::cli {

/// From here on, parallel work uses no more threads than the system is found to give; oneTBB would otherwise fail
/// halfway, or wait forever for a thread that never started. Says so if they are fewer than the cores.
void use_available_threads();

} // namespace prolate::cli

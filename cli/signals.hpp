// Signals that ask to stop: Ctrl-C (SIGINT), SIGTERM, SIGHUP. One that the command's caller ignores stays ignored.
#pragma once

namespace prolate::cli {

/// From here on, one of these signals ends the program with a line on stderr and the exit code 128 + its number: at
/// once, or where a GracefulStop lives, when the work has seen interrupted(). A second one ends it at once in any case.
/// `command` is for the line. Also, writing into a closed pipe or beyond the file size limit is an error of write().
void catch_signals(const char* command);

/// That line is followed by the same as JSON, written to this file; -1, as in the beginning: it is not.
void interruption_as_json(int file) noexcept;

/// Has such a signal come while a GracefulStop lived? Its number, or 0.
int interrupted() noexcept;
/// For work that asks whether to go on.
inline bool not_interrupted() noexcept {
    return interrupted() == 0;
}

/// While one lives, the first signal only sets interrupted(), and the work in progress must look at it, or be short.
class GracefulStop {
public:
    GracefulStop() noexcept;
    ~GracefulStop();
    GracefulStop(const GracefulStop&) = delete;
    GracefulStop& operator=(const GracefulStop&) = delete;
};

} // namespace prolate::cli

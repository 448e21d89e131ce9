// Why a command could not do its work. The one error system of the command: what can fail returns an Outcome, and the
// failure travels up to main(), which prints it.
#pragma once

#include <prolate/error.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace prolate::cli {

/// Exit codes; `prolate --help` lists them, scripts depend on them.
enum ExitCode : int {
    kDone = 0,
    kNo = 1,       ///< the work was done and the answer is "no" (verify; collide --exit-code: they meet), or some of
                   ///< it failed (bake --manifest)
    kUsage = 2,    ///< the command line asks for what does not exist
    kBadInput = 3, ///< a file's content cannot be used
    kIo = 4,       ///< reading or writing failed, or the machine has too little memory, space or threads
    kInternal = 5, ///< a promise of the program did not hold
    kUnknown = 6,  ///< collide --exit-code: undecided within the budget
    kInterrupted = 130, ///< Ctrl-C; 128 and the signal's number for others that ask to stop (signals.hpp)
};

/// The exit code, and the parts of the line "prolate: <subject>: <what>; <advice>". `advice` may be empty.
struct Failure {
    int code = kInternal;
    std::string subject, what, advice;
};

/// Either a T or a Failure. The member names are those of prolate::Result.
template <class T = std::monostate> class [[nodiscard]] Outcome {
public:
    Outcome(T value) : content_(std::move(value)) {}
    Outcome(Failure failure) : content_(std::move(failure)) {}

    explicit operator bool() const noexcept { return std::holds_alternative<T>(content_); }
    T& operator*() { return std::get<T>(content_); }
    const T& operator*() const { return std::get<T>(content_); }
    T* operator->() { return &**this; }
    const T* operator->() const { return &**this; }
    const Failure& error() const { return std::get<Failure>(content_); }

private:
    std::variant<T, Failure> content_;
};

/// The value of an Outcome<> that succeeded.
inline constexpr std::monostate kSuccess;

/// A library's error about `subject`, a file name or an option, with the exit code that belongs to it. `detail` adds
/// the words of a third party. Advice that the error brings itself, behind a "; ", goes before `advice`, and that
/// before what is usual for such errors.
Failure failure_of(std::string_view subject, const Error& error, std::string_view detail = {},
                   std::string_view advice = {});

/// `failure` with one more piece of advice, behind a "; ".
Failure advised(Failure failure, std::string_view advice);

/// The words of an error, with what its `where` means in it.
std::string words_of(const Error& error, std::string_view detail = {});

/// What the exception means that is being handled: out of memory, out of threads, or an error in prolate itself.
Failure caught();

/// Returns what `work` does, an Outcome; an exception becomes a failure.
template <class Work> auto guarded(const Work& work) -> decltype(work()) {
    try {
        return work();
    } catch (...) {
        return caught();
    }
}

/// {"error": {"code", "subject", "what", "advice"}}, indented, with a line's end.
std::string as_json(const Failure& failure);

} // namespace prolate::cli

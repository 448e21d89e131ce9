#include "cli/console.hpp"

#include "cli/signals.hpp"
#include "cli/words.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <utility>

#include <unistd.h>

namespace prolate::cli {
namespace {

int output_errno = 0; // of the first failed write to standard output
bool printed = false, output_taken = false, quiet = false, json_errors = false;
std::string part_of_work;

void print_line(std::string_view subject, std::string_view what, std::string_view advice) {
    std::string line = fmt::format("prolate: {}{}: {}", part_of_work, subject, what);
    if (!advice.empty()) line += fmt::format("; {}", advice);
    line = visible(line) + '\n'; // a file name or a reader's words may hold anything
    std::fwrite(line.data(), 1, line.size(), stderr);
}

// Flushes standard output; the errno of the first write to it that failed since the last time, or 0.
int flushed() {
    if (std::fflush(stdout) != 0 && output_errno == 0) output_errno = errno;
    return std::exchange(output_errno, 0);
}

Failure output_failure(int number) {
    return failure_of("standard output", {ErrorCode::io, "cannot write all of it", static_cast<uint64_t>(number)});
}

// A signal's JSON goes where a failure's would.
void direct_signals() {
    interruption_as_json(!json_errors || printed ? -1 : output_taken ? STDERR_FILENO : STDOUT_FILENO);
}

} // namespace

void be_quiet() {
    quiet = true;
}

bool is_quiet() {
    return quiet;
}

void note(std::string_view subject, std::string_view text) {
    if (!quiet) print_line(subject, text, "");
}

void tell(const Failure& failure) {
    print_line(failure.subject, failure.what, failure.advice);
}

PartOfWork::PartOfWork(std::string part) {
    part_of_work = std::move(part) + ": ";
}
PartOfWork::~PartOfWork() {
    part_of_work.clear();
}

void print(std::string_view text) {
    printed = true;
    direct_signals();
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() && output_errno == 0) output_errno = errno;
}

Outcome<> flush_output() {
    if (const int number = flushed(); number != 0) return output_failure(number);
    return kSuccess;
}

void take_standard_output() {
    output_taken = true;
    direct_signals();
}

void errors_as_json() {
    json_errors = true;
    direct_signals();
}

int finish(const Outcome<ExitCode>& outcome) {
    int code = outcome ? *outcome : outcome.error().code;
    if (!outcome) {
        Failure failure = outcome.error();
        if (code == kInterrupted && interrupted()) failure.code = code = 128 + interrupted();
        tell(failure);
        if (json_errors && !printed && !output_taken)
            print(as_json(failure));
        else if (json_errors && !printed)
            fmt::print(stderr, "{}", as_json(failure));
    }
    const int number = flushed();
    if (number == 0 || number == EPIPE) return code; // a reader that has closed its pipe has read enough
    tell(output_failure(number));
    return kIo;
}

} // namespace prolate::cli

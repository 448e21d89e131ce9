// All that the command prints: answers on standard output, failures and notes on stderr, a line each.
#pragma once

#include "cli/failure.hpp"

#include <string>
#include <string_view>

namespace prolate::cli {

/// From here on notes, the progress line and tables that only accompany a file are left out: --quiet.
void be_quiet();
bool is_quiet();

/// Prints the line "prolate: <subject>: <text>" on stderr, unless quiet; no error.
void note(std::string_view subject, std::string_view text);

/// Prints the line "prolate: <subject>: <what>; <advice>" on stderr, everything made visible().
void tell(const Failure& failure);

/// While it lives, lines of tell() and note() begin with "prolate: <part>: ": the work is one part of many.
class PartOfWork {
public:
    explicit PartOfWork(std::string part);
    ~PartOfWork();
    PartOfWork(const PartOfWork&) = delete;
    PartOfWork& operator=(const PartOfWork&) = delete;
};

/// Adds `text` to standard output. Failure shows in flush_output().
void print(std::string_view text);

/// Flushes standard output. Fails if a write failed since the last time.
Outcome<> flush_output();

/// From here on standard output carries a file: what else would be printed goes to stderr.
void take_standard_output();

/// From here on, the failure that ends the program is printed as JSON, too (--json), on standard output if there is no
/// answer there yet; a signal does the same.
void errors_as_json();

/// At the program's end: tells the failure if there is one, flushes standard output, and returns the exit code.
int finish(const Outcome<ExitCode>& outcome);

} // namespace prolate::cli

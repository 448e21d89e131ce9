// One error system for the whole library: Result<T> holds a value or an Error. No exception crosses the interface.
#pragma once

#include <cassert>
#include <cstdint>
#include <optional>
#include <utility>

namespace prolate {

/// What went wrong. Values are stable and never reused.
enum class ErrorCode : uint8_t {
    bad_options = 1,   ///< an option or argument is out of its range
    bad_mesh = 2,      ///< the mesh cannot be baked (no triangles, indices out of range, not finite, no extent)
    bad_file = 3,      ///< not a sound .etree or mesh file, or an .etree of an older format version
    newer_version = 4, ///< an .etree of a later format version than this library reads
    io = 5,            ///< the operating system refused to read or write
    cancelled = 6,     ///< the progress callback asked to stop
    unsupported = 7,   ///< a valid request that this version does not carry out
    internal = 8,      ///< a promise of the library did not hold; please report it
    out_of_memory = 9, ///< the system or the memory resource has no more; nothing has changed
    bad_id = 10,       ///< an id that names nothing, or nothing any more
    busy = 14,         ///< not from within a call of the caller's function (11 to 13 are statuses of prolate.h)
};

/// A failure.
struct Error {
    ErrorCode code{};
    const char* what = ""; ///< static text in plain words
    uint64_t where = 0;    ///< the byte offset, index, option's value or errno that `what` is about; 0 if there is none
};

/// Either a T or an Error. The member names are those of std::expected, which can replace it in C++23.
template <class T> class [[nodiscard]] Result {
public:
    Result(T value) : value_(std::move(value)) {}
    Result(Error error) : error_(error) {}

    explicit operator bool() const noexcept { return value_.has_value(); }
    bool has_value() const noexcept { return value_.has_value(); }

    T& value() & noexcept { return checked(); }
    const T& value() const& noexcept { return const_cast<Result*>(this)->checked(); }
    T&& value() && noexcept { return std::move(checked()); }
    T& operator*() & noexcept { return checked(); }
    const T& operator*() const& noexcept { return value(); }
    T&& operator*() && noexcept { return std::move(checked()); }
    T* operator->() noexcept { return &checked(); }
    const T* operator->() const noexcept { return &value(); }

    const Error& error() const noexcept {
        assert(!value_);
        return error_;
    }

private:
    T& checked() noexcept {
        assert(value_ && "Result holds an error: test it before use");
        return *value_;
    }
    std::optional<T> value_;
    Error error_{};
};

/// Success or an Error.
template <> class [[nodiscard]] Result<void> {
public:
    Result() = default;
    Result(Error error) : error_(error), failed_(true) {}
    explicit operator bool() const noexcept { return !failed_; }
    bool has_value() const noexcept { return !failed_; }
    const Error& error() const noexcept { return error_; }

private:
    Error error_{};
    bool failed_ = false;
};

} // namespace prolate

#include "cli/failure.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>

namespace prolate::cli {
namespace {

int exit_code(ErrorCode code) {
    switch (code) {
    case ErrorCode::bad_options:
    case ErrorCode::unsupported:
        return kUsage;
    case ErrorCode::bad_mesh:
    case ErrorCode::bad_file:
    case ErrorCode::newer_version:
        return kBadInput;
    case ErrorCode::io:
    case ErrorCode::out_of_memory:
        return kIo;
    case ErrorCode::cancelled:
        return kInterrupted;
    case ErrorCode::internal:
    case ErrorCode::bad_id:
    case ErrorCode::busy:
        break;
    }
    return kInternal;
}

constexpr const char* kMemoryAdvice = "take a smaller mesh, fewer levels or ellipsoids, or a lower --quality";
constexpr const char* kReportAdvice = "please report this, with the input";

std::string_view advice_for_errno(int number) {
    switch (number) {
    case ENOENT:
        return "check the path";
    case ENOTDIR:
    case EISDIR:
        return "name a file";
    case ENAMETOOLONG:
        return "take a shorter name";
    case EAGAIN:
        return "raise the limit on processes (ulimit -u)";
    case EACCES:
    case EPERM:
    case EROFS:
        return "check the permissions";
    case ENOSPC:
    case EDQUOT:
        return "free some space";
    case EFBIG:
        return "raise the file size limit (ulimit -f)";
    default:
        return "";
    }
}

std::string_view advice_for(const Error& error) {
    switch (error.code) {
    case ErrorCode::bad_options:
        return "see the command's --help";
    case ErrorCode::bad_mesh:
        return "repair the mesh";
    case ErrorCode::bad_file:
        return "check the file";
    case ErrorCode::newer_version:
        return "bake it again or use a newer prolate";
    case ErrorCode::io:
        return advice_for_errno(static_cast<int>(error.where));
    case ErrorCode::internal:
        return kReportAdvice;
    case ErrorCode::out_of_memory:
        return kMemoryAdvice;
    case ErrorCode::unsupported: // says itself what to use
    case ErrorCode::cancelled:
    case ErrorCode::bad_id: // these come from worlds, which the command has none of
    case ErrorCode::busy:
        break;
    }
    return "";
}

} // namespace

std::string words_of(const Error& error, std::string_view detail) {
    std::string what = error.what;
    if (error.code == ErrorCode::io && error.where != 0)
        what += fmt::format(": {}", std::strerror(static_cast<int>(error.where)));
    if (error.code == ErrorCode::newer_version) what += fmt::format(" (version {})", error.where);
    if (error.code == ErrorCode::bad_mesh && (what.starts_with("vertex") || what.starts_with("triangle")))
        what += fmt::format(" (index {})", error.where);
    if (!detail.empty())
        what += fmt::format(" ({})", detail);
    else if (error.code == ErrorCode::bad_file && error.where != 0)
        what += fmt::format(" (at byte {})", error.where);
    return what;
}

Failure failure_of(std::string_view subject, const Error& error, std::string_view detail, std::string_view advice) {
    if (error.code == ErrorCode::cancelled)
        return {kInterrupted, std::string(subject), "interrupted", "nothing was written"};
    const std::string_view what = error.what;
    const size_t own = what.find("; ");
    if (own != what.npos)
        advice = what.substr(own + 2);
    else if (advice.empty())
        advice = advice_for(error);
    const std::string before(what.substr(0, own));
    return {exit_code(error.code), std::string(subject), words_of({error.code, before.c_str(), error.where}, detail),
            std::string(advice)};
}

Failure advised(Failure failure, std::string_view advice) {
    if (!failure.advice.empty()) failure.advice += "; ";
    failure.advice += advice;
    return failure;
}

Failure caught() {
    Failure no_memory{kIo, "memory", "there is not enough of it", kMemoryAdvice};
    try {
        throw;
    } catch (const std::bad_alloc&) {
        return no_memory;
    } catch (const std::length_error&) { // a container that would be larger than any memory
        return no_memory;
    } catch (const std::exception& e) {
        // oneTBB's words when the system gives no thread; its exception says nothing else.
        if (std::string_view(e.what()).starts_with("pthread_"))
            return {kIo, "threads", e.what(), std::string(advice_for_errno(EAGAIN))};
        return {kInternal, "internal error", e.what(), kReportAdvice};
    }
}

std::string as_json(const Failure& failure) {
    const nlohmann::ordered_json error{
        {"error",
         {{"code", failure.code}, {"subject", failure.subject}, {"what", failure.what}, {"advice", failure.advice}}}};
    return error.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
}

} // namespace prolate::cli

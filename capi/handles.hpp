// How the C interface's structs become the C++ ones: checks of pointers, sizes and versions in one place.
#pragma once

#include <prolate/distance.hpp>
#include <prolate/error.hpp>
#include <prolate/jobs.hpp>
#include <prolate/prolate.h>
#include <prolate/query.hpp>
#include <prolate/sweep.hpp>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <type_traits>

namespace prolate::capi {

/// The status of an Error, whose text goes to `error` unless that is null.
inline prolate_status failed(const Error& from, prolate_error* error) {
    if (error != nullptr) *error = {from.what, from.where};
    return static_cast<prolate_status>(from.code);
}
inline prolate_status failed(prolate_status status, prolate_error* error) {
    if (error != nullptr) *error = {prolate_status_text(status), 0};
    return status;
}

/// PROLATE_INIT, which is C.
template <class T> T fresh() {
    T out{};
    out.size = sizeof out, out.version = PROLATE_API_VERSION;
    return out;
}
/// May a struct that begins with its size and version be written or read?
template <class T> bool is_sound(const T* x) {
    return x->version == PROLATE_API_VERSION && x->size >= 2 * sizeof(uint32_t) && x->size <= 1u << 16;
}
/// Copies as much of a caller's struct as both know; null leaves the defaults.
template <class T> bool read(const T* from, T& to) {
    if (from == nullptr) return true;
    if (!is_sound(from)) return false;
    std::memcpy(&to, from, std::min<size_t>(from->size, sizeof(T)));
    return true;
}
/// Hands out an answer, but not its first two fields.
template <class T> void write(const T& from, T* to) {
    constexpr size_t kHead = 2 * sizeof(uint32_t);
    std::memcpy(reinterpret_cast<std::byte*>(to) + kHead, reinterpret_cast<const std::byte*>(&from) + kHead,
                std::min<size_t>(to->size, sizeof(T)) - kHead);
}

/// The same numbers as another type of the same layout.
template <class To, class From> To same(const From& from) {
    static_assert(std::is_trivially_copyable_v<To> && std::is_trivially_copyable_v<From> && sizeof(To) == sizeof(From));
    return std::bit_cast<To>(from);
}

/// What a prolate_tree holds, and a mark that it was opened.
struct TreeHandle {
    static constexpr uint64_t kOpened = 0x7072'6f6c'6174'6521;
    uint64_t mark;
    TreeView view;
};
static_assert(sizeof(TreeHandle) <= sizeof(prolate_tree) && alignof(TreeHandle) <= alignof(prolate_tree));
static_assert(std::is_trivially_copyable_v<TreeView>);

/// Null if there is none, or it was not opened.
inline const TreeView* view_of(const prolate_tree* tree) {
    if (tree == nullptr || tree->opaque[0] != TreeHandle::kOpened) return nullptr;
    return &reinterpret_cast<const TreeHandle*>(tree)->view;
}
inline void hold(const TreeView& view, prolate_tree* tree) {
    *tree = {};
    new (static_cast<void*>(tree)) TreeHandle{TreeHandle::kOpened, view};
}

/// The caller's memory.
inline Scratch scratch_of(void* memory, size_t size) {
    return Scratch(std::span(static_cast<std::byte*>(memory), memory != nullptr ? size : 0));
}
/// As `count` contexts, of which workers take one each; null if it will not do.
inline QueryContext* contexts_of(void* memory, size_t size, size_t count) {
    const bool aligned = reinterpret_cast<uintptr_t>(memory) % alignof(QueryContext) == 0;
    return memory != nullptr && aligned && count > 0 && size / sizeof(QueryContext) >= count
               ? static_cast<QueryContext*>(memory)
               : nullptr;
}
inline Jobs jobs_of(const prolate_jobs* jobs) {
    return jobs != nullptr ? Jobs{jobs->run, jobs->user, jobs->workers} : Jobs{};
}
template <class T> prolate_status status_of(const Result<T>& result) {
    return result ? PROLATE_OK : static_cast<prolate_status>(result.error().code);
}

inline prolate_stats stats_of(const QueryStats& s) {
    return {s.pair_tests, s.block_tests, s.triangle_tests, s.deepest_level};
}
inline prolate_verdict verdict_of(Verdict v) {
    return static_cast<prolate_verdict>(v);
}
inline uint64_t tests_of(uint64_t most) {
    return most == 0 ? UINT64_MAX : most;
}
inline DistanceOptions options_of(const prolate_distance_options& o) {
    DistanceOptions out;
    out.tolerance_absolute = o.tolerance_absolute;
    if (o.tolerance_relative != 0) out.tolerance_relative = o.tolerance_relative;
    if (o.max_distance != 0) out.max_distance = o.max_distance;
    out.max_pair_tests = tests_of(o.max_tests);
    return out;
}
inline SweepOptions options_of(const prolate_sweep_options& o) {
    SweepOptions out;
    out.tolerance = o.tolerance, out.max_pair_tests = tests_of(o.max_tests), out.margin = o.margin;
    return out;
}
inline prolate_sweep_result result_of(const SweepResult& r) {
    auto out = fresh<prolate_sweep_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed;
    out.time_lower = r.time_lower, out.time_upper = r.time_upper, out.distance = r.distance;
    out.point_a = same<prolate_vec3>(r.point_a), out.point_b = same<prolate_vec3>(r.point_b);
    out.normal = same<prolate_vec3>(r.normal);
    out.pair = same<prolate_meeting_pair>(r.pair), out.stats = stats_of(r.stats);
    return out;
}
inline QueryOptions options_of(const prolate_query_options& o) {
    return {.max_level = o.max_level == 0 ? kMaxLevels : o.max_level - 1,
            .max_pair_tests = tests_of(o.max_tests),
            .margin = o.margin};
}

} // namespace prolate::capi

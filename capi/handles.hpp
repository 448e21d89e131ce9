// How the C interface's structs become the C++ ones: checks of pointers, sizes and versions in one place.
#pragma once

#include <prolate/error.hpp>
#include <prolate/prolate.h>
#include <prolate/query.hpp>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
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

/// The caller's memory as a context; null if it will not do.
inline QueryContext* context_of(void* scratch, size_t size, size_t count = 1) {
    const bool aligned = reinterpret_cast<uintptr_t>(scratch) % alignof(QueryContext) == 0;
    return scratch != nullptr && aligned && size / sizeof(QueryContext) >= count ? static_cast<QueryContext*>(scratch)
                                                                                 : nullptr;
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
inline QueryOptions options_of(const prolate_query_options& o) {
    return {.max_level = o.max_level == 0 ? kMaxLevels : o.max_level - 1,
            .max_pair_tests = tests_of(o.max_tests),
            .margin = o.margin};
}

} // namespace prolate::capi

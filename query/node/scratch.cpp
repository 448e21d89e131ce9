#include "query/node/scratch.hpp"

#include <algorithm>
#include <memory>

namespace prolate {
namespace {

constexpr uint32_t kLeastHeap = 32; // entries
// Stacks are written a lane at a time before it is known whether the lane stays.
constexpr uint32_t kBesides = kMaxDegree + kLeastHeap;
static_assert(kBesides + 2 * kMaxDegree * (kMaxLevels - 1) <= QueryContext::kEntries);

size_t bytes_for(uint32_t siblings) {
    return size_t{kBesides + siblings} * sizeof(Scratch::Entry) + alignof(Scratch::Entry);
}
uint32_t entries_for(uint32_t siblings) {
    return kBesides + siblings;
}

} // namespace

Scratch::Scratch(std::span<std::byte> memory) noexcept : entries_(nullptr), count_(0) {
    void* at = memory.data();
    size_t size = memory.size();
    if (at == nullptr || std::align(alignof(Entry), 0, at, size) == nullptr) return;
    entries_ = static_cast<Entry*>(at);
    count_ = static_cast<uint32_t>(std::min(size / sizeof(Entry), QueryContext::kEntries));
}

size_t scratch_size(const TreeView& tree) noexcept {
    return bytes_for(query::siblings_on_the_way(tree));
}
size_t scratch_size(const TreeView& a, const TreeView& b) noexcept {
    return bytes_for(query::siblings_on_the_way(a) + query::siblings_on_the_way(b));
}

bool query::suffices(const Scratch& scratch, const TreeView& tree) noexcept {
    return scratch.count() == QueryContext::kEntries || scratch.count() >= entries_for(siblings_on_the_way(tree));
}
bool query::suffices(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept {
    return scratch.count() == QueryContext::kEntries ||
           scratch.count() >= entries_for(siblings_on_the_way(a) + siblings_on_the_way(b));
}

} // namespace prolate

#include "query/node/scratch.hpp"

#include <algorithm>
#include <memory>

namespace prolate {
namespace {

constexpr uint32_t kLeastHeap = 32; // entries
// Stacks are written a lane at a time before it is known whether the lane stays.
constexpr uint32_t kBesides = kMaxDegree + kLeastHeap;
static_assert(kBesides + 2 * kMaxDegree * (kMaxLevels - 1) <= QueryContext::kEntries);

// Of the tree or its inner cover, whichever needs more.
uint32_t most_siblings(const TreeView& tree) {
    const uint32_t own = query::siblings_on_the_way(tree);
    const auto inner = tree.inner();
    return inner ? std::max(own, query::siblings_on_the_way(*inner)) : own;
}

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
    return bytes_for(most_siblings(tree));
}
size_t scratch_size(const TreeView& a, const TreeView& b) noexcept {
    return bytes_for(most_siblings(a) + most_siblings(b));
}

query::DividedScratch query::divide(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept {
    const std::span<std::byte> all(reinterpret_cast<std::byte*>(scratch.entries()),
                                   size_t{scratch.count()} * sizeof(Scratch::Entry));
    const size_t least = std::min(all.size(), size_t{entries_for(siblings_on_the_way(a) + siblings_on_the_way(b))} *
                                                  sizeof(Scratch::Entry));
    return {Scratch(all.first(least)), all.subspan(least)};
}

bool query::suffices(const Scratch& scratch, const TreeView& tree) noexcept {
    return scratch.count() == QueryContext::kEntries || scratch.count() >= entries_for(siblings_on_the_way(tree));
}
bool query::suffices(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept {
    return scratch.count() == QueryContext::kEntries ||
           scratch.count() >= entries_for(siblings_on_the_way(a) + siblings_on_the_way(b));
}

} // namespace prolate

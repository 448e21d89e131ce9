// A heap of pairs of nodes in the caller's scratch, the one that comes first in `Order` (the least bound) on top. Like
// std::push_heap, but with the same order of equal bounds from every standard library, and four children a node: half
// the levels to walk down.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate::query {

struct ByBound {
    static bool before(const Scratch::Entry& x, const Scratch::Entry& y) { return x.bound < y.bound; }
};

template <class Order = ByBound> class PairHeap {
public:
    using Entry = Scratch::Entry;

    explicit PairHeap(Entry* entries) : entries_(entries) {}
    bool empty() const { return size_ == 0; }
    uint32_t size() const { return size_; }
    const Entry& top() const { return entries_[0]; }

    void push(const Entry& entry) {
        uint32_t at = size_++;
        for (; at > 0 && Order::before(entry, entries_[(at - 1) / 4]); at = (at - 1) / 4)
            entries_[at] = entries_[(at - 1) / 4];
        entries_[at] = entry;
    }
    Entry pop() {
        const Entry top = entries_[0], last = entries_[--size_];
        uint32_t at = 0;
        for (uint32_t child = 1; child < size_; child = 4 * at + 1) {
            const uint32_t first = child + 4 <= size_ ? sooner(sooner(child, child + 1), sooner(child + 2, child + 3))
                                                      : first_until_end(child);
            if (!Order::before(entries_[first], last)) break;
            entries_[at] = entries_[first];
            at = first;
        }
        if (size_ > 0) entries_[at] = last;
        return top;
    }

private:
    // Of two indices, the lower one if their entries are equal. Without a branch: which it is cannot be foretold.
    uint32_t sooner(uint32_t low, uint32_t high) const {
        return low + (high - low) * static_cast<uint32_t>(Order::before(entries_[high], entries_[low]));
    }
    uint32_t first_until_end(uint32_t child) const {
        uint32_t first = child;
        for (uint32_t c = child + 1; c < size_; ++c) first = sooner(first, c);
        return first;
    }

    Entry* const entries_;
    uint32_t size_ = 0;
};

} // namespace prolate::query

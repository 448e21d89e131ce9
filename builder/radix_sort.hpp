// Sorting by whole numbers.
#pragma once

#include "builder/job.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace prolate {

/// Sorts by `key(item)`, 64 bits, and leaves equal ones in their order: least significant digit first, but for digits
/// in which all agree. O(n) time and memory; a checkpoint now and then.
template <class Item, class Key> void radix_sort(std::vector<Item>& items, Key&& key) {
    constexpr unsigned kBits = 11;
    constexpr uint64_t kDigits = uint64_t{1} << kBits;
    Checkpoints checkpoints;
    uint64_t varying = 0;
    for (const Item& item : items) varying |= key(item) ^ key(items.front());
    std::vector<Item> sorted(items.size());
    for (unsigned shift = 0; shift < 64; shift += kBits) {
        if ((varying >> shift & (kDigits - 1)) == 0) continue;
        const auto digit = [&](const Item& item) { return static_cast<size_t>(key(item) >> shift & (kDigits - 1)); };
        std::array<size_t, kDigits> next{}; // place of the next item with that digit
        for (const Item& item : items) checkpoints(), ++next[digit(item)];
        size_t before = 0;
        for (size_t& at : next) before += std::exchange(at, before);
        for (const Item& item : items) checkpoints(), sorted[next[digit(item)]++] = item;
        items.swap(sorted);
    }
}

} // namespace prolate

// What a prolate_world is.
#pragma once

#include <prolate/prolate.h>
#include <prolate/world.hpp>

#include <memory_resource>
#include <new>
#include <optional>

namespace prolate::capi {

/// The caller's functions.
class Memory final : public std::pmr::memory_resource {
public:
    explicit Memory(const prolate_allocator& allocator) : allocator_(allocator) {}

private:
    void* do_allocate(size_t size, size_t alignment) override {
        void* const out = allocator_.allocate(allocator_.user, size, alignment);
        if (out == nullptr) throw std::bad_alloc(); // World turns it into an Error
        return out;
    }
    void do_deallocate(void* memory, size_t size, size_t alignment) override {
        allocator_.release(allocator_.user, memory, size, alignment);
    }
    bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }

    const prolate_allocator allocator_;
};

} // namespace prolate::capi

struct prolate_world {
    prolate_allocator allocator;
    prolate::capi::Memory memory;
    std::optional<prolate::World> world;
};

// Trees of other libraries, refitted to a body that deforms, beside a rigid one.
#pragma once

#include "tests/scenes.hpp"

#include <prolate/mesh.hpp>
#include <prolate/types.hpp>

#include <memory>
#include <span>
#include <vector>

namespace prolate::bench {

class Refit {
public:
    virtual ~Refit() = default;
    /// The body's vertices are here now.
    virtual void refit(std::span<const scenes::Point> vertices) = 0;
    /// Does the other one meet it at this pose?
    virtual bool meet(const Pose& other) = 0;
};

struct RefitLibrary {
    const char* name;
    uint32_t most; ///< questions that it is asked: its time is no one's to waste
    std::unique_ptr<Refit> (*build)(const Mesh& body, const Mesh& other);
};
using RefitLibraries = std::vector<RefitLibrary>;

/// FCL's, if it was there at configure time. Coal's come from a module (bench/peers/main.cpp says why).
void add_fcl_refits(RefitLibraries& libraries);

} // namespace prolate::bench

// Convex decompositions by other libraries, through decompose.py and the Python that has them.
#pragma once

#include "bench/covers/measure.hpp"

#include <optional>
#include <string>
#include <vector>

namespace prolate::bench {

/// What one of them made of a mesh.
struct Decomposition {
    std::string version; ///< of the package
    uint32_t count = 0;  ///< hulls
    Mesh hulls;          ///< closed convex surfaces, oriented outwards, one after the other
    Cost cost;
};

class Decomposers {
public:
    /// `python` is the interpreter that ./run peers makes.
    explicit Decomposers(std::string python) : python_(std::move(python)) {}

    /// Those that are installed: "V-HACD", "CoACD", "Rapier". If none is, `why` says why.
    std::vector<std::string> names(std::string& why) const;
    /// At most `count` hulls of `mesh`, within `seconds` of wall time; nothing if that fails.
    std::optional<Decomposition> run(const std::string& name, MeshView mesh, uint32_t count, uint32_t seconds) const;

private:
    std::vector<std::string> lines_of(const std::string& arguments) const;
    std::string python_;
};

} // namespace prolate::bench

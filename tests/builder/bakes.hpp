// Bakes as tests make them.
#pragma once

#include <prolate/build.hpp>
#include <prolate/mesh.hpp>

#include <cstdint>
#include <stdexcept>
#include <utility>

namespace prolate {

inline BuildOptions quick(uint32_t levels) {
    BuildOptions options;
    options.levels = levels;
    options.quality = Quality::fast;
    return options;
}

inline Build must_build(const Mesh& mesh, const BuildOptions& options) {
    auto built = build(mesh.view(), options);
    if (!built) throw std::runtime_error(built.error().what);
    return std::move(*built);
}

} // namespace prolate

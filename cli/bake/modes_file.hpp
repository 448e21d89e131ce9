// Modes of a mesh from a file of numpy's.
#pragma once

#include "cli/failure.hpp"

#include <prolate/modes.hpp>

#include <array>
#include <string>
#include <vector>

namespace prolate::cli {

struct ModesFile {
    std::vector<float> displacements, ranges;
    Modes view() const noexcept { return {displacements, ranges}; }
};

/// Reads an .npy file, or the arrays "modes" and "ranges" of an .npz, compressed or not: float32 or float64, modes of
/// shape (M, V, 3) and ranges of shape (M,). `ranges`, one for all or one each, take the file's place. Displacements
/// are multiplied by `scale`, axis by axis, as the mesh's coordinates were.
Outcome<ModesFile> read_modes(const std::string& path, const std::vector<float>& ranges,
                              const std::array<double, 3>& scale);

} // namespace prolate::cli

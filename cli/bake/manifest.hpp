// prolate bake --manifest: many assets in one run. `prolate bake --help` describes the file.
#pragma once

#include "cli/bake/cache.hpp"
#include "cli/failure.hpp"
#include "cli/outputs.hpp"

#include <cstdint>
#include <string>

namespace prolate::cli {

struct ManifestOptions {
    bool rebake = false;  ///< bake even what is unchanged or cached
    bool json = false;    ///< print the summary as JSON
    uint32_t threads = 0; ///< of assets that do not say it themselves
    std::string report;   ///< also write the summary to this JSON file, unless empty
};

/// Bakes the assets one after the other, each with a line on stderr, and prints a summary. Fails with kNo if some
/// assets failed, with kInterrupted, or because of the manifest itself.
Outcome<ExitCode> bake_manifest(const std::string& path, Outputs& outputs, BakeCache& cache,
                                const ManifestOptions& options);

} // namespace prolate::cli

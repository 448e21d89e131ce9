// One asset: a mesh file, the options, the .etree file that they make. What `prolate bake` does once, and for each
// asset of a manifest.
#pragma once

#include "cli/bake/cache.hpp"
#include "cli/failure.hpp"
#include "cli/mesh_options.hpp"
#include "cli/outputs.hpp"

#include <prolate/build.hpp>

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace prolate::cli {

/// What the command line, or a manifest's entry, says of one asset.
struct Asset {
    std::string mesh, output, report;
    std::string method = "voxel", primitive = "ellipsoid", quality = "normal";
    std::optional<uint32_t> levels, ellipsoids;
    std::optional<float> tolerance, distance;
    std::string clearance, fill, keep_holes; ///< lengths with their units
    std::string modes;                       ///< a file
    std::vector<float> ranges;
    bool skin = false;
    MeshOptions mesh_options;
    BuildOptions options;
};

/// Declares the options of one asset on `app`. A manifest takes the same names, so this is the only list of them.
void declare_asset_options(CLI::App& app, Asset& asset);

/// Where a tree came from.
enum class Source {
    baked,
    unchanged, ///< the output file was already what this bake would make
    cached,    ///< a file of the cache folder
};
const char* name_of(Source source);

/// An asset that has its tree.
struct Baked {
    Source source;
    Tree tree;
    std::optional<MeshReport> diagnosis; ///< unless nobody had to look at the mesh
    std::vector<double> level_seconds;   ///< by level, if baked
    double hole_radius = 0;              ///< as in Build, if baked
    double seconds = 0;                  ///< all in all
};

/// The asset's options as the library takes them.
Outcome<BuildOptions> options_of(const Asset& asset);

/// Names the asset's inputs, or claims its outputs: all inputs of a run come before all outputs. `whose` is "", or
/// " of asset 2".
void name_inputs(const Asset& asset, Outputs& outputs, const std::string& whose = "");
Outcome<> claim_outputs(const Asset& asset, Outputs& outputs, const std::string& whose = "");

/// Makes sure that the output is what the mesh and the options make, at the least cost (`rebake`: by baking), with a
/// new date, and writes the report. If it fails, the output is what it was before. `label` is for the progress line.
Outcome<Baked> bake_asset(const Asset& asset, const Outputs& outputs, BakeCache& cache, bool rebake,
                          const std::string& label);

/// All figures, as --report and --json have them.
nlohmann::ordered_json report_of(const Asset& asset, const Baked& baked);

} // namespace prolate::cli

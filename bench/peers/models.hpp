// The meshes that the libraries are compared on: scaled to a bounding box of diagonal 1 around the origin, because "1 %
// of the size" must mean the same for all of them.
#pragma once

#include <prolate/mesh.hpp>

#include <optional>
#include <string>
#include <vector>

namespace prolate::bench::peers {

struct Model {
    std::string name;
    Mesh mesh; ///< diagonal 1, centered, clean
    bool closed = false;
};

/// Loads, cleans and scales the mesh in `path`, or the first of `paths` that exists; prints the reason if none will do.
std::optional<Model> load_model(const std::string& name, const std::vector<std::string>& paths);

/// A machined part: a plate with a wall, ribs, pads and drilled holes. 5,000 triangles or so, closed, most of its area
/// in large flats, with long thin triangles around and along the holes.
Model cad_model();

} // namespace prolate::bench::peers

// The meshes of a COLLADA file.
#pragma once

#include "builder/collada_document.hpp"

namespace prolate::collada {

/// A geometry in its own frame. Corners count its own points.
struct Shape {
    std::vector<Point> points;
    std::vector<uint32_t> corners, sizes;
    std::vector<uint64_t> lines; // where each face stands in the file
    uint64_t left_out = 0;
};

/// Appends what a <mesh> holds: triangles, polygons, strips and fans.
void read_mesh(const Document& document, const xml_node& mesh, Shape& out);

} // namespace prolate::collada

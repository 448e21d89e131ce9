// What a ball cannot reach from outside is inside: shells, bodies of cars and houses as solids.
//
// Let the ball of radius r go wherever it fits, from far outside, and never touch a triangle. The points that it never
// comes over are the closing of the surface by the ball (Serra, "Image Analysis and Mathematical Morphology", 1982),
// with all that it shuts in. The filled solid holds these, the surface among them, and is made of cells of a lattice:
// a cell is left out only if the ball, with its center at one place that it certainly gets to, is over all of the cell.
// So the solid sticks out of what cannot be reached, by less than about two cells, and leaves out nothing of it.
#pragma once

#include "builder/triangle_tree.hpp"

#include <prolate/mesh.hpp>

namespace prolate {

/// Width of the cells, metres.
double fill_pitch(const Box& box, double radius);

/// The surface of the filled solid: closed, oriented outwards, each side of a row of cells as few rectangles, so that
/// corners of some lie on edges of others. `radius` in metres, in the ball_range() of the mesh's box (build.hpp).
/// The same for any number of threads. Throws Cancelled.
Mesh fill(MeshView mesh, double radius);

} // namespace prolate

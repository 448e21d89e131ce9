// Proof that ellipsoids lie inside the solid.
#pragma once

#include "builder/winding.hpp"

#include <prolate/verify.hpp>

namespace prolate {

/// What rounding may cost in the proof, metres: ellipsoids keep so far from the surface.
double proof_margin(MeshView mesh);

/// Do no triangle, and no point within `margin` metres of one, meet the ellipsoid, and is its center inside? Then all
/// of it is: on a way that does not cross the surface the winding number stays the same. Thread-safe.
bool lies_inside(const Ellipsoid& ellipsoid, const Winding& winding, double margin);

/// Proves all nodes of an inner cover of the welded mesh, whose points have moved by at most `weld_distance`: completes
/// what `report` says of it.
void verify_inner(const TreeView& inner, MeshView mesh, double weld_distance, VerifyReport& report);

} // namespace prolate

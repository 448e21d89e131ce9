// Mass properties of the solid, from the triangles that bound it.
#pragma once

#include "builder/columns.hpp"

#include <prolate/mass.hpp>
#include <prolate/mesh.hpp>

namespace prolate {

/// Of the solid that `mesh` bounds if it is closed, and of that which `columns` found if it is not; zero if that cannot
/// be told from nothing. The columns are the mesh's: of a closed one, they correct for parts that overlap. The same
/// bits for any number of threads. O(triangles + columns).
MassProperties mass_of(MeshView mesh, bool closed, const Columns& columns);

} // namespace prolate

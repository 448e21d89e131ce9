// The files that a mesh is read from, when it is more than one.
#pragma once

#include <string>
#include <vector>

namespace prolate::cli {

/// The files that are read beside the mesh in `path`: those that the buffers of a glTF or GLB name. The other formats
/// that are read hold their triangles themselves (an OBJ's materials and a DAE's pictures are not looked at). None if
/// the file cannot be read, or makes no sense: reading the mesh will tell.
std::vector<std::string> files_beside(const std::string& path);

} // namespace prolate::cli

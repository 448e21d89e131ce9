// What Assimp lets pass but a promise of cover cannot: mesh files that end too early or name what they do not hold.
#pragma once

#include <prolate/error.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace prolate {

/// Checks the bytes of a mesh file whose name ends in `type` (".obj", in lower case). Returns the number of faces of
/// three or more corners that the reader must deliver, if the format says it. Fails with bad_file (`where` = byte
/// offset; `detail` = the line, for text), also for a type that load_mesh() does not read. Linear in the size.
Result<std::optional<uint64_t>> check_mesh_bytes(std::string_view type, std::string_view bytes, std::string& detail);

} // namespace prolate

// Words: names as a terminal may see them, typing errors, file names.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace prolate::cli {

/// `text` fit for a terminal and for one line: control characters, marks that turn the direction of writing, and bytes
/// that are no UTF-8 become "\\x1b".
std::string visible(std::string_view text);

/// The one of `known` that was probably meant by `word`; "" if none is near.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

/// The extension of a file name in lower case, without the dot: "Out.PLY" -> "ply"; "" if there is none.
std::string extension(const std::string& path);

} // namespace prolate::cli

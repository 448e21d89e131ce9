#include "cli/mesh_files.hpp"

#include "cli/inputs.hpp"
#include "cli/words.hpp"

#include "builder/polygons.hpp"

#include <nlohmann/json.hpp>

#include <filesystem>

namespace prolate::cli {
using Json = nlohmann::json;

std::vector<std::string> files_beside(const std::string& path) {
    const std::string type = '.' + extension(path);
    if (type != ".gltf" && type != ".glb") return {};
    const auto bytes = read_file(path);
    if (!bytes) return {};
    // Only the buffers are kept: the rest may be large.
    const auto keep = [](int depth, Json::parse_event_t event, const Json& parsed) {
        return depth != 1 || event != Json::parse_event_t::key || parsed == "buffers";
    };
    const Json root = Json::parse(gltf_json(type, *bytes), keep, false);
    std::vector<std::string> out;
    if (!root.is_object() || !root.contains("buffers")) return out;
    for (const Json& buffer : root["buffers"])
        if (buffer.is_object() && buffer.contains("uri") && buffer["uri"].is_string())
            if (const std::string uri = buffer["uri"]; !uri.starts_with("data:"))
                out.push_back((std::filesystem::path(path).parent_path() / without_escapes(uri)).string());
    return out;
}

} // namespace prolate::cli

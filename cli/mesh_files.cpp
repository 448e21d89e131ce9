#include "cli/mesh_files.hpp"

#include "cli/inputs.hpp"
#include "cli/words.hpp"

#include "builder/polygons.hpp"

#include <nlohmann/json.hpp>

#include <charconv>
#include <filesystem>

namespace prolate::cli {
namespace {

using Json = nlohmann::json;

// Without %20 and the like.
std::string without_escapes(const std::string& uri) {
    std::string out;
    for (size_t i = 0; i < uri.size(); ++i) {
        unsigned char c = 0;
        const char* const end = uri.data() + std::min(i + 3, uri.size());
        const bool is_escape =
            uri[i] == '%' && i + 2 < uri.size() && std::from_chars(uri.data() + i + 1, end, c, 16).ptr == end;
        out += is_escape ? static_cast<char>(c) : uri[i];
        if (is_escape) i += 2;
    }
    return out;
}

} // namespace

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

// glb: the binary form of glTF 2.0, after the Khronos specification (section 4.4 for the container).
//
// Core glTF gives a material to a mesh's part, not to a node, so there is a mesh for each colour; all of them share the
// one sphere's corners and triangles. The unit sphere's corners are its normals, too: one accessor serves as both.
#include "cli/export/formats.hpp"
#include "cli/export/little_endian.hpp"
#include "cli/export/sphere.hpp"
#include "cli/render/palette.hpp"

#include <prolate/version.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <glm/gtc/quaternion.hpp>

namespace prolate::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint32_t kGlbMagic = 0x46546C67, kJsonChunk = 0x4E4F534A,
                   kBinaryChunk = 0x004E4942; // "glTF", "JSON", "BIN\0"
enum Component { kUint16 = 5123, kFloat = 5126 };
enum Target { kVertices = 34962, kIndices = 34963 };

static_assert((kMaxSegments / 2) * (kMaxSegments / 2) + 2 < 0xFFFF, "indices have 16 bits, and the last is reserved");

// Chunks are multiples of four bytes long.
void pad(std::string& chunk, char with) {
    while (chunk.size() % 4 != 0) chunk += with;
}

using Corners = std::vector<std::array<double, 3>>;

void add_corners(Json& gltf, std::string& binary, const Corners& corners) {
    std::array<float, 3> low{}, high{};
    const size_t begin = binary.size();
    for (const auto& corner : corners)
        for (size_t i = 0; i < 3; ++i) {
            const auto x = static_cast<float>(corner[i]);
            append_little_endian(binary, x);
            low[i] = std::min(low[i], x), high[i] = std::max(high[i], x);
        }
    gltf["accessors"].push_back({{"bufferView", gltf["bufferViews"].size()},
                                 {"componentType", kFloat},
                                 {"count", corners.size()},
                                 {"type", "VEC3"},
                                 {"min", low},
                                 {"max", high}});
    gltf["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", binary.size() - begin}, {"target", kVertices}});
}

// Accessors: positions, indices, and normals where they are not the same as the positions.
void add_sphere(Json& gltf, std::string& binary, const SphereMesh& sphere, const Corners& normals) {
    add_corners(gltf, binary, sphere.vertices);
    const size_t begin = binary.size();
    for (const auto& triangle : sphere.triangles)
        for (const uint32_t corner : triangle) append_little_endian(binary, static_cast<uint16_t>(corner));
    gltf["accessors"].push_back({{"bufferView", 1},
                                 {"componentType", kUint16},
                                 {"count", 3 * sphere.triangles.size()},
                                 {"type", "SCALAR"},
                                 {"min", {0}},
                                 {"max", {sphere.vertices.size() - 1}}});
    gltf["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", binary.size() - begin}, {"target", kIndices}});
    pad(binary, '\0');
    if (!normals.empty()) add_corners(gltf, binary, normals);
    gltf["buffers"] = {{{"byteLength", binary.size()}}};
}

// The name of a colour: "#E69F00".
std::string hexadecimal(const glm::dvec3& colour) {
    std::string name = "#";
    for (int i = 0; i < 3; ++i) name += fmt::format("{:02X}", std::lround(255 * srgb_encode(colour[i])));
    return name;
}

// A reader in single precision makes a matrix of the rotation and the scale, and moves a corner by some 30 roundings,
// of numbers no larger than the corner's own.
constexpr int kReaderBits = 24 - 5;

Json node_of(const Piece& piece, size_t mesh, double growth) {
    PrincipalAxes axes = principal_axes(piece.shape);
    for (double& radius : axes.radii) radius *= growth;
    glm::dmat3 rotation; // by columns
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) rotation[column][row] = axes.rotation[row][column];
    const glm::dquat q = glm::normalize(glm::quat_cast(rotation));
    const Vec3& c = piece.shape.center;
    return {{"name", fmt::format("node {}", piece.node)},
            {"mesh", mesh},
            {"translation", {c.x, c.y, c.z}},
            {"rotation", {q.x, q.y, q.z, q.w}},
            {"scale", axes.radii}};
}

} // namespace

std::string as_glb(std::span<const Piece> pieces, uint32_t segments, Facets facets) {
    const SphereMesh sphere = sphere_mesh(segments, facets);
    const bool outer = facets == Facets::outer;
    Json gltf;
    std::string binary;
    gltf["asset"] = {{"version", "2.0"},
                     {"generator", fmt::format("prolate {}.{}.{}", PROLATE_VERSION_MAJOR, PROLATE_VERSION_MINOR,
                                               PROLATE_VERSION_PATCH)}};
    gltf["scene"] = 0;
    gltf["scenes"] = {{{"nodes", {0}}}};
    Json cover{{"name", "cover"}}, nodes = Json::array(), meshes = Json::array(), materials = Json::array();
    std::vector<std::string> colours;
    for (const Piece& piece : pieces) {
        const std::string name = hexadecimal(piece.colour);
        const auto mesh = static_cast<size_t>(std::find(colours.begin(), colours.end(), name) - colours.begin());
        if (mesh == colours.size()) {
            colours.push_back(name);
            materials.push_back({{"name", name},
                                 {"pbrMetallicRoughness",
                                  {{"baseColorFactor", {piece.colour.x, piece.colour.y, piece.colour.z, 1.0}},
                                   {"metallicFactor", 0.0},
                                   {"roughnessFactor", 0.6}}}});
            meshes.push_back({{"name", "sphere " + name},
                              {"primitives",
                               {{{"attributes", {{"POSITION", 0}, {"NORMAL", outer ? 2 : 0}}},
                                 {"indices", 1},
                                 {"material", mesh}}}}});
        }
        nodes.push_back(node_of(piece, mesh, outer ? growth_for_rounding(piece.shape, sphere, kReaderBits) : 1));
        cover["children"].push_back(nodes.size()); // after the cover itself
    }
    nodes.insert(nodes.begin(), cover);
    gltf["nodes"] = std::move(nodes);
    gltf["meshes"] = std::move(meshes);
    gltf["materials"] = std::move(materials);
    add_sphere(gltf, binary, sphere, outer ? sphere_mesh(segments).vertices : Corners());

    std::string text = gltf.dump();
    pad(text, ' ');
    std::string out;
    append_little_endian(out, kGlbMagic);
    append_little_endian(out, uint32_t{2}); // version
    append_little_endian(out, static_cast<uint32_t>(12 + 8 + text.size() + 8 + binary.size()));
    append_little_endian(out, static_cast<uint32_t>(text.size()));
    append_little_endian(out, kJsonChunk);
    out += text;
    append_little_endian(out, static_cast<uint32_t>(binary.size()));
    append_little_endian(out, kBinaryChunk);
    return out + binary;
}

} // namespace prolate::cli

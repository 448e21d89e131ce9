// What "prolate export" writes, read back: by Assimp and the mesh reader where they know the format, by strict readers
// of our own where they forgive too much.
#include "cli/export/formats.hpp"
#include "cli/export/sphere.hpp"
#include "cli/render/palette.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/mesh.hpp>

#include <assimp/Importer.hpp>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <regex>
#include <set>
#include <sstream>

#include <unistd.h>

namespace {

using namespace prolate;
using namespace prolate::cli;
using glm::dmat3;
using glm::dvec3;
using reference::operator*;
using Json = nlohmann::json;
namespace fs = std::filesystem;

// Far from the origin and near it, balls, needles and discs, in 13 colours.
std::vector<Piece> some_pieces(uint32_t count) {
    scenes::Random random(7);
    std::vector<Piece> pieces;
    for (uint32_t i = 0; i < count; ++i) {
        const auto size = [&] { return static_cast<float>(random.log_in(0.02, 2)); };
        const auto skew = [&] { return static_cast<float>(random.in(-0.5, 0.5)); };
        Piece piece{3 * i + 1, {}, to_linear_rgb(branch_colour(i % 13, 13))};
        piece.shape = {scenes::to_float(random.direction()), size(), skew(), size(), skew(), skew(), size()};
        if (i % 5 == 0) piece.shape = {{40, -7, 1e-3f}, 0.5f, 0, 0.5f, 0, 0, 0.5f}; // axes of a ball may point anywhere
        if (i % 5 == 1) piece.shape.l21 = piece.shape.l31 = piece.shape.l32 = 0;
        pieces.push_back(piece);
    }
    return pieces;
}

dmat3 factor_of(const Ellipsoid& e) {
    return {e.l11, e.l21, e.l31, 0, e.l22, e.l32, 0, 0, e.l33}; // column by column
}

// The ellipsoid {c + M u : |u| <= 1} is `e`: its center, and its shape matrix M M^T, which no rotation of u changes.
void expect_same(const Ellipsoid& e, const dvec3& c, const dmat3& m, double tolerance) {
    const dmat3 factor = factor_of(e), expected = factor * glm::transpose(factor), got = m * glm::transpose(m);
    const double size = expected[0][0] + expected[1][1] + expected[2][2];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(got[i][j], expected[i][j], tolerance * size);
    EXPECT_EQ(static_cast<float>(c.x), e.center.x);
    EXPECT_EQ(static_cast<float>(c.y), e.center.y);
    EXPECT_EQ(static_cast<float>(c.z), e.center.z);
}

class Export : public ::testing::Test {
protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "prolate-export-XXXXXX").string();
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        folder_ = name;
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string file(const std::string& name, const std::string& content) const {
        const std::string path = (folder_ / name).string();
        std::ofstream(path, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
        return path;
    }

    fs::path folder_;
};

// ---- the sphere ----

TEST(Sphere, IsRoundClosedAndTurnedOutwards) {
    for (const uint32_t segments : {4u, 8u, 9u, 32u, 100u, kMaxSegments}) {
        const SphereMesh sphere = sphere_mesh(segments);
        const uint32_t n = (segments + 3) / 4 * 4;
        EXPECT_EQ(sphere.vertices.size(), n * n / 4 + 2);
        EXPECT_EQ(sphere.triangles.size(), n * n / 2);
        Mesh mesh;
        double longest = 0, shortest = 9;
        for (const auto& v : sphere.vertices) {
            EXPECT_NEAR(std::hypot(v[0], v[1], v[2]), 1, 1e-15);
            mesh.vertices.push_back({static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])});
        }
        mesh.triangles = sphere.triangles;
        for (const Triangle& t : sphere.triangles) {
            dvec3 p[3];
            for (int i = 0; i < 3; ++i) {
                const auto& v = sphere.vertices[t[i]];
                p[i] = {v[0], v[1], v[2]};
            }
            EXPECT_GT(glm::dot(p[0], glm::cross(p[1], p[2])), 0) << "turned outwards";
            for (int i = 0; i < 3; ++i) {
                const double length = glm::length(p[i] - p[(i + 1) % 3]);
                longest = std::max(longest, length), shortest = std::min(shortest, length);
            }
        }
        EXPECT_LT(longest, 2 * shortest);
        EXPECT_LT(longest, 2 * 2 * std::numbers::pi / n);
        const auto cleaned = clean(mesh.view());
        ASSERT_TRUE(cleaned);
        EXPECT_TRUE(cleaned->report.closed);
        EXPECT_EQ(cleaned->report.merged_vertices, 0u);
        EXPECT_EQ(cleaned->report.unused_vertices, 0u);
        EXPECT_EQ(cleaned->report.degenerate_triangles, 0u);
    }
}

// ---- glb ----

uint32_t little_endian(const std::string& bytes, size_t at, size_t size = 4) {
    uint32_t value = 0;
    for (size_t i = 0; i < size; ++i)
        value |= static_cast<uint32_t>(static_cast<unsigned char>(bytes.at(at + i))) << 8 * i;
    return value;
}

// The two chunks of a GLB file, whose container must be just as the specification has it (section 4.4).
struct Chunks {
    Json gltf;
    std::string binary;
};
Chunks open_glb(const std::string& bytes) {
    Chunks out;
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(little_endian(bytes, 4), 2u);
    EXPECT_EQ(little_endian(bytes, 8), bytes.size());
    const uint32_t json_size = little_endian(bytes, 12);
    EXPECT_EQ(json_size % 4, 0u);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    const std::string text = bytes.substr(20, json_size);
    EXPECT_EQ(text.front(), '{');
    out.gltf = Json::parse(text); // takes trailing spaces, and nothing else, as padding
    const size_t second = 20 + json_size;
    const uint32_t binary_size = little_endian(bytes, second);
    EXPECT_EQ(binary_size % 4, 0u);
    EXPECT_EQ(bytes.substr(second + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(second + 8 + binary_size, bytes.size()) << "nothing follows";
    out.binary = bytes.substr(second + 8);
    return out;
}

// Views and accessors lie within the buffer, aligned; least and greatest values are those of the data.
void expect_sound_buffers(const Chunks& glb) {
    const Json& gltf = glb.gltf;
    ASSERT_EQ(gltf["buffers"].size(), 1u);
    EXPECT_FALSE(gltf["buffers"][0].contains("uri"));
    const size_t length = gltf["buffers"][0]["byteLength"];
    EXPECT_LE(length, glb.binary.size());
    EXPECT_LT(glb.binary.size() - length, 4u);
    std::set<size_t> views;
    for (const Json& accessor : gltf["accessors"]) {
        EXPECT_TRUE(views.insert(accessor["bufferView"].get<size_t>()).second) << "views that are shared need a stride";
        const Json& view = gltf["bufferViews"].at(accessor["bufferView"].get<size_t>());
        EXPECT_EQ(view["buffer"], 0);
        const bool floats = accessor["componentType"] == 5126;
        ASSERT_TRUE(floats || accessor["componentType"] == 5123);
        const size_t width = floats ? 4 : 2, parts = accessor["type"] == "VEC3" ? 3 : 1;
        const size_t begin = view["byteOffset"], size = view["byteLength"], count = accessor["count"];
        EXPECT_EQ(begin % 4, 0u);
        EXPECT_EQ(size, count * parts * width);
        ASSERT_LE(begin + size, length);
        std::vector<double> low(parts, INFINITY), high(parts, -INFINITY);
        for (size_t i = 0; i < count * parts; ++i) {
            const uint32_t bits = little_endian(glb.binary, begin + i * width, width);
            const double value = floats ? double{std::bit_cast<float>(bits)} : static_cast<double>(bits);
            low[i % parts] = std::min(low[i % parts], value), high[i % parts] = std::max(high[i % parts], value);
        }
        EXPECT_EQ(accessor["min"].get<std::vector<double>>(), low);
        EXPECT_EQ(accessor["max"].get<std::vector<double>>(), high);
    }
    EXPECT_EQ(views.size(), gltf["bufferViews"].size());
}

// Khronos' validator complains of what nobody refers to.
void expect_all_used(const Json& gltf) {
    std::map<std::string, std::set<size_t>> used;
    for (const Json& scene : gltf["scenes"])
        for (const Json& node : scene["nodes"]) used["nodes"].insert(node.get<size_t>());
    for (const Json& node : gltf["nodes"]) {
        EXPECT_TRUE(node.contains("mesh") || node.contains("children")) << "an empty node";
        if (node.contains("mesh")) used["meshes"].insert(node["mesh"].get<size_t>());
        for (const Json& child : node.value("children", Json::array())) used["nodes"].insert(child.get<size_t>());
    }
    for (const Json& mesh : gltf["meshes"])
        for (const Json& part : mesh["primitives"]) {
            used["materials"].insert(part["material"].get<size_t>());
            used["accessors"].insert(part["indices"].get<size_t>());
            for (const Json& attribute : part["attributes"]) used["accessors"].insert(attribute.get<size_t>());
        }
    for (const Json& accessor : gltf["accessors"]) used["bufferViews"].insert(accessor["bufferView"].get<size_t>());
    for (const auto& [kind, which] : used)
        EXPECT_TRUE(which.size() == gltf[kind].size() && *which.rbegin() + 1 == which.size()) << kind;
}

TEST_F(Export, GlbIsWhatTheSpecificationAsksFor) {
    const std::vector<Piece> pieces = some_pieces(100);
    for (const auto& [segments, facets] : {std::pair{4u, Facets::inscribed},
                                           {32u, Facets::outer},
                                           {100u, Facets::inscribed},
                                           {kMaxSegments, Facets::outer}}) {
        const Chunks glb = open_glb(as_glb(pieces, segments, facets));
        expect_sound_buffers(glb);
        const Json& gltf = glb.gltf;
        expect_all_used(gltf);
        const std::set<std::string> known{"asset",     "scene",   "scenes",      "nodes",    "meshes",
                                          "materials", "buffers", "bufferViews", "accessors"};
        for (const auto& [key, value] : gltf.items()) EXPECT_TRUE(known.contains(key)) << key;
        EXPECT_EQ(gltf["asset"]["version"], "2.0");
        EXPECT_EQ(gltf["scenes"].at(gltf["scene"].get<size_t>())["nodes"], Json::array({0}));
        // One node holds all others, each of which appears once: a tree, as is asked for.
        std::set<size_t> children;
        for (const Json& child : gltf["nodes"][0]["children"]) EXPECT_TRUE(children.insert(child.get<size_t>()).second);
        EXPECT_EQ(children.size(), pieces.size());
        EXPECT_EQ(gltf["nodes"].size(), pieces.size() + 1);
        EXPECT_EQ(*children.begin(), 1u);
        EXPECT_EQ(*children.rbegin(), pieces.size());
        EXPECT_EQ(gltf["materials"].size(), 13u);
        ASSERT_EQ(gltf["meshes"].size(), 13u);
        for (const Json& mesh : gltf["meshes"]) {
            const Json& part = mesh["primitives"].at(0);
            const Json& corners = gltf["accessors"].at(part["attributes"]["POSITION"].get<size_t>());
            const Json& normals = gltf["accessors"].at(part["attributes"]["NORMAL"].get<size_t>());
            const Json& indices = gltf["accessors"].at(part["indices"].get<size_t>());
            EXPECT_EQ(corners["type"], "VEC3");
            EXPECT_EQ(normals["count"], corners["count"]);
            EXPECT_EQ(indices["type"], "SCALAR");
            EXPECT_EQ(indices["count"].get<size_t>() % 3, 0u);
            EXPECT_LT(indices["max"][0].get<size_t>(), corners["count"].get<size_t>());
            EXPECT_LT(indices["max"][0].get<size_t>(), 65535u) << "restarts a strip";
            const auto target = [&](const Json& a) {
                return gltf["bufferViews"].at(a["bufferView"].get<size_t>())["target"];
            };
            EXPECT_EQ(target(corners), 34962);
            EXPECT_EQ(target(indices), 34963);
        }
        for (const Json& node : gltf["nodes"]) {
            if (!node.contains("mesh")) continue;
            double length = 0;
            for (const double x : node["rotation"]) {
                length += x * x;
                EXPECT_LE(std::abs(x), 1);
            }
            EXPECT_NEAR(length, 1, 1e-12);
            for (const double radius : node["scale"]) EXPECT_GT(radius, 0);
        }
        for (const Json& material : gltf["materials"])
            for (const double channel : material["pbrMetallicRoughness"]["baseColorFactor"])
                EXPECT_TRUE(channel >= 0 && channel <= 1);
    }
}

TEST_F(Export, AChangedByteOfAGlbIsFound) { // the check above is no formality
    Chunks glb = open_glb(as_glb(some_pieces(3), 8, Facets::inscribed));
    glb.binary[3] = static_cast<char>(0x7e); // of the first coordinate, now 4e37
    EXPECT_NONFATAL_FAILURE(expect_sound_buffers(glb), "max");
}

TEST_F(Export, AnUnusedMaterialOfAGlbIsFound) {
    Json gltf = open_glb(as_glb(some_pieces(3), 8, Facets::inscribed)).gltf;
    gltf["materials"].push_back(gltf["materials"][0]);
    EXPECT_NONFATAL_FAILURE(expect_all_used(gltf), "materials");
}

TEST_F(Export, AssimpFindsEveryEllipsoidInTheGlb) {
    const std::vector<Piece> pieces = some_pieces(200);
    Assimp::Importer importer;
    const aiScene* scene =
        importer.ReadFile(file("a.glb", as_glb(pieces, 16, Facets::inscribed)), aiProcess_ValidateDataStructure);
    ASSERT_NE(scene, nullptr) << importer.GetErrorString();
    for (const Piece& piece : pieces) {
        SCOPED_TRACE(piece.node);
        const aiNode* node = scene->mRootNode->FindNode(("node " + std::to_string(piece.node)).c_str());
        ASSERT_NE(node, nullptr);
        ASSERT_EQ(node->mNumMeshes, 1u);
        aiMatrix4x4 m = node->mTransformation;
        for (const aiNode* above = node->mParent; above; above = above->mParent) m = above->mTransformation * m;
        expect_same(piece.shape, {m.a4, m.b4, m.c4}, {m.a1, m.b1, m.c1, m.a2, m.b2, m.c2, m.a3, m.b3, m.c3}, 2e-6);
        EXPECT_GT(m.Determinant(), 0) << "no mirror";
        const aiMesh& sphere = *scene->mMeshes[node->mMeshes[0]];
        EXPECT_EQ(sphere.mNumVertices, 66u);
        for (uint32_t i = 0; i < sphere.mNumVertices; ++i) {
            EXPECT_NEAR(sphere.mVertices[i].Length(), 1, 1e-6);
            EXPECT_EQ(sphere.mVertices[i], sphere.mNormals[i]);
        }
        aiColor4D colour;
        ASSERT_EQ(scene->mMaterials[sphere.mMaterialIndex]->Get(AI_MATKEY_BASE_COLOR, colour), aiReturn_SUCCESS);
        EXPECT_NEAR(colour.r, piece.colour.r, 1e-6);
        EXPECT_NEAR(colour.g, piece.colour.g, 1e-6);
        EXPECT_NEAR(colour.b, piece.colour.b, 1e-6);
    }
}

// ---- ply and obj ----

// Each piece in turn is a closed mesh with its corners on the ellipsoid and `triangles` triangles.
void expect_meshes(const Mesh& all, const std::vector<Piece>& pieces, size_t triangles) {
    ASSERT_EQ(all.triangles.size(), triangles * pieces.size());
    for (size_t i = 0; i < pieces.size(); ++i) {
        SCOPED_TRACE(pieces[i].node);
        Mesh one{all.vertices, {}};
        one.triangles.assign(all.triangles.begin() + static_cast<ptrdiff_t>(i * triangles),
                             all.triangles.begin() + static_cast<ptrdiff_t>((i + 1) * triangles));
        const auto cleaned = clean(one.view());
        ASSERT_TRUE(cleaned);
        EXPECT_TRUE(cleaned->report.closed);
        const dmat3 inverse = glm::inverse(factor_of(pieces[i].shape));
        const Vec3& c = pieces[i].shape.center;
        double six = 0;
        for (const Triangle& t : cleaned->mesh.triangles) {
            dvec3 p[3];
            for (int k = 0; k < 3; ++k) {
                const Vec3& v = cleaned->mesh.vertices[t[k]];
                p[k] = dvec3(v.x, v.y, v.z) - dvec3(c.x, c.y, c.z);
                EXPECT_NEAR(glm::length(inverse * p[k]), 1, 2e-3); // needles, 40 m from the origin, in float
            }
            six += glm::dot(p[0], glm::cross(p[1], p[2]));
        }
        EXPECT_NEAR(six / 6 / volume(pieces[i].shape), 0.95, 0.05) << "turned outwards, and filled but for the facets";
    }
}

TEST_F(Export, PlyAndObjHoldTheEllipsoids) {
    const std::vector<Piece> pieces = some_pieces(20);
    for (const auto& [name, content] : {std::pair{"a.ply", as_ply(pieces, 30, Facets::inscribed)},
                                        {"a.obj", as_obj(pieces, 30, Facets::inscribed)}}) {
        SCOPED_TRACE(name);
        ImportReport report;
        const auto mesh = load_mesh(file(name, content).c_str(), {}, &report);
        ASSERT_TRUE(mesh) << mesh.error().what << report.detail;
        expect_meshes(*mesh, pieces, 32 * 32 / 2);
    }
}

TEST_F(Export, ColoursOfPlyAndObjAreThePieces) {
    const std::vector<Piece> pieces = some_pieces(20);
    const auto encoded = [](const dvec3& c) { return dvec3(srgb_encode(c.x), srgb_encode(c.y), srgb_encode(c.z)); };
    for (const auto& [name, content] :
         {std::pair{"a.ply", as_ply(pieces, 8, Facets::inscribed)}, {"a.obj", as_obj(pieces, 8, Facets::inscribed)}}) {
        SCOPED_TRACE(name);
        Assimp::Importer importer;
        const aiScene* scene = importer.ReadFile(file(name, content), 0);
        ASSERT_NE(scene, nullptr) << importer.GetErrorString();
        const bool obj = std::string(name) == "a.obj";
        ASSERT_EQ(scene->mNumMeshes, obj ? pieces.size() : 1);
        for (uint32_t i = 0; i < scene->mNumMeshes; ++i) {
            const aiMesh& mesh = *scene->mMeshes[i];
            ASSERT_TRUE(mesh.HasVertexColors(0));
            if (obj) {
                EXPECT_EQ(std::string(mesh.mName.C_Str()), "node_" + std::to_string(pieces[i].node));
            }
            // As many vertices a piece as it has, whether the reader shares them or not; in the pieces' order.
            for (uint32_t v = 0; v < mesh.mNumVertices; ++v) {
                const size_t which = obj ? i : size_t{v} * pieces.size() / mesh.mNumVertices;
                const aiColor4D& got = mesh.mColors[0][v];
                const dvec3 expected = encoded(pieces[which].colour);
                ASSERT_NEAR(got.r, expected.r, 0.003);
                ASSERT_NEAR(got.g, expected.g, 0.003);
                ASSERT_NEAR(got.b, expected.b, 0.003);
            }
        }
    }
}

// ---- outer facets ----

// Each piece in turn is a closed mesh of `triangles` triangles around its center, none of which enters the ellipsoid:
// the mesh holds it. Returns how many times larger than the ellipsoid a mesh is, at most.
double expect_to_hold(const Mesh& all, const std::vector<Piece>& pieces, size_t triangles) {
    EXPECT_EQ(all.triangles.size(), triangles * pieces.size());
    double largest = 0;
    for (size_t i = 0; i < pieces.size(); ++i) {
        SCOPED_TRACE(pieces[i].node);
        const Ellipsoid& e = pieces[i].shape;
        Mesh one{all.vertices, {}};
        one.triangles.assign(all.triangles.begin() + static_cast<ptrdiff_t>(i * triangles),
                             all.triangles.begin() + static_cast<ptrdiff_t>((i + 1) * triangles));
        const auto cleaned = clean(one.view());
        EXPECT_TRUE(cleaned && cleaned->report.closed);
        long double six = 0;
        uint32_t entering = 0;
        for (const Triangle& t : one.triangles) {
            const auto corners =
                reference::placed({one.vertices[t[0]], one.vertices[t[1]], one.vertices[t[2]]}, {}, e.center);
            entering += !(reference::radius(corners, e, {}, e.center) >= 1);
            six += reference::dot(corners[0], reference::cross(corners[1], corners[2]));
        }
        EXPECT_EQ(entering, 0u);
        largest = std::max(largest, static_cast<double>(six / 6 / volume(e)));
    }
    return largest;
}

// As some_pieces(), and such as single precision can hardly tell from points where they are.
std::vector<Piece> hard_pieces() {
    std::vector<Piece> pieces = some_pieces(12);
    pieces.push_back({900, {{1000, -3000, 0.5f}, 1e-3f, 0, 2e-3f, 0, 0, 1e-3f}, {}});
    pieces.push_back({901, {{1, 1, 1}, 1, 0.7f, 1e-3f, -0.3f, 0.2f, 1e-4f}, {}});
    pieces.push_back({902, {{0, 0, 0}, 1e-20f, 0, 2e-20f, 0, 0, 1e-20f}, {}});
    return pieces;
}

TEST_F(Export, OuterMeshesHoldTheEllipsoids) {
    for (const uint32_t segments : {4u, 12u, 32u}) {
        for (const auto& [name, content] : {std::pair{"a.ply", as_ply(hard_pieces(), segments, Facets::outer)},
                                            {"a.obj", as_obj(hard_pieces(), segments, Facets::outer)}}) {
            SCOPED_TRACE(name);
            ImportReport report;
            const auto mesh = load_mesh(file(name, content).c_str(), {}, &report);
            ASSERT_TRUE(mesh) << mesh.error().what << report.detail;
            expect_to_hold(*mesh, hard_pieces(), segments * segments / 2);
        }
        const std::vector<Piece> pieces = some_pieces(12);
        const auto mesh = load_mesh(file("b.ply", as_ply(pieces, segments, Facets::outer)).c_str());
        const double larger = expect_to_hold(*mesh, pieces, segments * segments / 2);
        EXPECT_LT(larger, segments == 4 ? 1.66 : segments == 12 ? 1.1 : 1.013);
    }
}

TEST_F(Export, TheCheckAboveNoticesCornersOnTheEllipsoids) {
    const std::vector<Piece> pieces = some_pieces(1);
    const auto mesh = load_mesh(file("a.ply", as_ply(pieces, 32, Facets::inscribed)).c_str());
    EXPECT_NONFATAL_FAILURE(expect_to_hold(*mesh, pieces, 512), "entering");
}

TEST_F(Export, AnOuterObjIsOneObjectForSimulators) {
    std::istringstream lines(as_obj(some_pieces(3), 8, Facets::outer));
    std::set<std::string> words;
    for (std::string line; std::getline(lines, line);) {
        words.insert(line.substr(0, line.find(' ')));
        if (line[0] == 'v') {
            EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 3) << line;
        }
    }
    EXPECT_EQ(words, (std::set<std::string>{"#", "v", "f"}));
}

// Assimp places the nodes in single precision.
TEST_F(Export, AnOuterGlbHoldsTheEllipsoidsAsReadersPlaceThem) {
    std::vector<Piece> pieces = hard_pieces();
    std::erase_if(pieces, [](const Piece& p) { return p.shape.l11 < 1e-10f; }); // Assimp loses such
    Assimp::Importer importer;
    const aiScene* scene =
        importer.ReadFile(file("a.glb", as_glb(pieces, 32, Facets::outer)), aiProcess_ValidateDataStructure);
    ASSERT_NE(scene, nullptr) << importer.GetErrorString();
    double largest = 0;
    for (const Piece& piece : pieces) {
        const aiNode* node = scene->mRootNode->FindNode(("node " + std::to_string(piece.node)).c_str());
        ASSERT_NE(node, nullptr);
        const aiMesh& sphere = *scene->mMeshes[node->mMeshes[0]];
        Mesh mesh;
        for (uint32_t i = 0; i < sphere.mNumVertices; ++i) {
            const aiVector3D v = node->mTransformation * sphere.mVertices[i];
            mesh.vertices.push_back({v.x, v.y, v.z});
            EXPECT_NEAR(sphere.mNormals[i].Length(), 1, 1e-6);
        }
        for (uint32_t i = 0; i < sphere.mNumFaces; ++i) {
            const unsigned* const f = sphere.mFaces[i].mIndices;
            mesh.triangles.push_back({f[0], f[1], f[2]});
        }
        const double larger = expect_to_hold(mesh, {piece}, 512);
        if (piece.node < 900) largest = std::max(largest, larger);
    }
    EXPECT_LT(largest, 1.06);
}

// ---- csv and json ----

// What a reader makes of center, radii and rotation, in double precision, holds the decoded ellipsoid; and what is
// single precision is exact.
TEST_F(Export, TablesHoldTheEllipsoids) {
    scenes::Random random(11);
    const auto scene = scenes::tree(random, scenes::cloud(random, 400), {});
    const TreeView tree = *TreeView::open(scene.bytes);
    const uint32_t last = tree.level_count() - 1;
    Selection cut;
    tree.for_each_in_cut(last, [&](uint32_t node) { cut.nodes.push_back(node), cut.levels.push_back(last); });
    std::istringstream csv(as_csv(tree, cut));
    const Json json = Json::parse(as_json(tree, cut));
    EXPECT_TRUE(json["precision"].contains("radii"));
    std::string line;
    std::getline(csv, line);
    double most = 0;
    for (size_t i = 0; i < cut.nodes.size(); ++i) {
        const Ellipsoid e = tree.ellipsoid(cut.nodes[i]);
        std::getline(csv, line);
        std::vector<double> row;
        std::istringstream cells(line);
        for (std::string cell; std::getline(cells, cell, ',');) row.push_back(std::stod(cell));
        ASSERT_EQ(row.size(), 16u);
        const Json& node = json["nodes"][i];
        EXPECT_EQ(node["center"], Json::array({row[1], row[2], row[3]}));
        EXPECT_EQ(node["radii"], Json::array({row[4], row[5], row[6]}));
        EXPECT_EQ(row[1], e.center.x);
        EXPECT_EQ(row[3], e.center.z);
        EXPECT_EQ(node["factor"], Json::array({e.l11, e.l21, e.l22, e.l31, e.l32, e.l33}));
        const reference::Matrix factor{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
        reference::Matrix axes; // R diag(r)
        for (size_t k = 0; k < 9; ++k) axes[k / 3][k % 3] = static_cast<long double>(row[7 + k]) * row[4 + k % 3];
        const reference::Matrix g = reference::inverse(axes) * factor;
        const auto squares = reference::eigen(g * reference::transposed(g)).first;
        for (const long double square : squares) {
            EXPECT_LE(square, 1);
            most = std::max(most, static_cast<double>(1 - square));
        }
    }
    EXPECT_LT(most, 1e-10);
}

// ---- pov ----

TEST_F(Export, PovHoldsEachEllipsoidToTheBit) {
    const std::vector<Piece> pieces = some_pieces(50);
    const std::string scene = as_pov(pieces, View{});
    const std::regex line(R"(sphere \{ 0, 1 matrix <([^>]*)> pigment \{ color rgb <([^>]*)> \} \} // node (\d+))");
    size_t found = 0;
    for (std::sregex_iterator at(scene.begin(), scene.end(), line), end; at != end; ++at, ++found) {
        ASSERT_LT(found, pieces.size());
        EXPECT_EQ((*at)[3], std::to_string(pieces[found].node));
        std::vector<float> m;
        std::istringstream numbers((*at)[1]);
        for (std::string number; std::getline(numbers, number, ',');) {
            m.push_back(std::stof(number));
            EXPECT_EQ(std::stod(number), m.back()) << "exact in either precision";
        }
        ASSERT_EQ(m.size(), 12u);
        // Rows are the images of the axes: the columns of the factor.
        EXPECT_EQ((Ellipsoid{{m[9], m[10], m[11]}, m[0], m[1], m[4], m[2], m[5], m[8]}), pieces[found].shape);
        EXPECT_EQ(m[3], 0);
        EXPECT_EQ(m[6], 0);
        EXPECT_EQ(m[7], 0);
    }
    EXPECT_EQ(found, pieces.size());
}

struct Picture {
    int width = 0, height = 0;
    std::string rgb;
    const unsigned char* at(double u, double v) const { // parts of width and height
        const auto x = static_cast<int>(u * width), y = static_cast<int>(v * height);
        return reinterpret_cast<const unsigned char*>(rgb.data()) + 3 * (y * width + x);
    }
};

// What POV-Ray makes of it, which must be without warnings.
std::optional<Picture> trace(const fs::path& folder, const std::string& scene) {
    if (std::system("povray --version >/dev/null 2>&1") != 0) return {};
    std::ofstream(folder / "a.pov") << scene;
    const std::string command =
        "cd '" + folder.string() + "' && povray +Ia.pov +Oa.ppm +FP +W160 +H120 -D -A +WT1 Work_Threads=1 >log 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0);
    std::ifstream log(folder / "log");
    for (std::string line; std::getline(log, line);) {
        std::string lower = line;
        std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
        if (lower.find("warning") != std::string::npos && !lower.starts_with("==== [") &&
            !lower.starts_with("  warning stream"))
            ADD_FAILURE() << line;
    }
    Picture out;
    std::ifstream in(folder / "a.ppm", std::ios::binary);
    const auto word = [&in] { // of the header, without its comments
        std::string text;
        while (in >> text && text.starts_with('#')) std::getline(in, text);
        return text;
    };
    EXPECT_EQ(word(), "P6");
    out.width = std::stoi(word()), out.height = std::stoi(word());
    EXPECT_EQ(word(), "255");
    in.get();
    out.rgb.assign(std::istreambuf_iterator<char>(in), {});
    EXPECT_EQ(out.rgb.size(), 3u * 160 * 120);
    return out;
}

TEST_F(Export, PovRayDrawsTheSceneTheRightWayRound) {
    // A red ball in the middle, a green one to the right, a blue one above, as "prolate render" would show them.
    std::vector<Piece> pieces(3);
    pieces[0] = {0, {{0, 0, 0}, 0.5f, 0, 0.5f, 0, 0, 0.5f}, {0.8, 0.02, 0.02}};
    pieces[1] = {1, {{2, 0, 0}, 0.5f, 0, 0.5f, 0, 0, 0.5f}, {0.02, 0.8, 0.02}};
    pieces[2] = {2, {{0, 2, 0}, 0.5f, 0, 0.5f, 0, 0, 0.5f}, {0.02, 0.02, 0.8}};
    const auto picture = trace(folder_, as_pov(pieces, {0, 5, UpAxis::y}));
    if (!picture) GTEST_SKIP() << "povray is not installed";
    // The box is a square of 3, whose center is at (1, 1), in a ball of radius 2.18 that fills most of the height.
    const double unit = 1 / (2 * 2.18 * 1.08);
    const auto expect_channel = [&](double x, double y, int channel) {
        const unsigned char* const p = picture->at(0.5 + (x - 1) * unit * 0.75, 0.5 - (y - 1) * unit);
        for (int other = 0; other < 3; ++other)
            if (other != channel) {
                EXPECT_GT(p[channel], p[other] + 40) << x << ", " << y;
            }
    };
    expect_channel(0, 0, 0);
    expect_channel(2, 0, 1);
    expect_channel(0, 2, 2);
    const unsigned char* const sky = picture->at(0.02, 0.02);
    EXPECT_GT(std::min({sky[0], sky[1], sky[2]}), 230);
}

TEST_F(Export, APovCoverServesAnotherScene) {
    file("cover.pov", as_pov(some_pieces(10), View{}));
    const auto picture = trace(folder_, "#version 3.7;\nglobal_settings { assumed_gamma 1 }\n"
                                        "#declare Only_Cover = true;\n#include \"cover.pov\"\n"
                                        "camera { location <0, 0, -9> look_at 0 }\n"
                                        "light_source { <9, 9, -9> color rgb 1 }\nobject { Cover }\n");
    if (!picture) GTEST_SKIP() << "povray is not installed";
    const unsigned char* const corner = picture->at(0, 0);
    EXPECT_EQ(corner[0] + corner[1] + corner[2], 0) << "no background and no ground of its own";
    EXPECT_TRUE(std::any_of(picture->rgb.begin(), picture->rgb.end(), [](char c) { return c != 0; }));
}

} // namespace

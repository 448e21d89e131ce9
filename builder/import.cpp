// load_mesh(): reads a mesh file through Assimp.
//
// Assimp is lenient where this library must not be: a hole in the mesh because half of the file is missing would be a
// solid that is not covered. builder/import_checks.cpp therefore looks at the bytes first.
//
// Coordinates stay as the file has them. Assimp puts its conversion of units and up axis (DAE, 3DS) into the transform
// of the scene's root, and that one is left out for those two formats.
//
// Known limits: Assimp reads decimal numbers to within one unit in the last place of a float, so the mesh, and the
// cover that is promised for it, is the text's mesh to that precision. Skinning and morphing are not applied.
#include "builder/import_checks.hpp"

#include "src/bytes.hpp"
#include "src/hash.hpp"

#include <prolate/mesh.hpp>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/version.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace prolate {
namespace {

Error io(const char* what) {
    return {ErrorCode::io, what, static_cast<uint64_t>(errno)};
}

// The extension in lower case, with the dot.
std::string extension(const std::string& path) {
    const size_t slash = path.rfind('/'), dot = path.rfind('.');
    if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return {};
    std::string out = path.substr(dot);
    for (char& c : out)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return out;
}

Result<std::string> read_all(const char* path) {
    struct Closer {
        int fd;
        ~Closer() {
            if (fd >= 0) ::close(fd);
        }
    };
    const Closer file{::open(path, O_RDONLY | O_CLOEXEC)};
    if (file.fd < 0) return io("cannot open the file");
    struct stat status {};
    if (::fstat(file.fd, &status) != 0) return io("cannot read the file");
    if (S_ISDIR(status.st_mode)) return Error{ErrorCode::io, "cannot read the file", EISDIR};
    if (!S_ISREG(status.st_mode)) // Assimp opens the name a second time
        return Error{ErrorCode::io, "a mesh can only be read from a regular file", ESPIPE};
    std::string bytes(static_cast<size_t>(status.st_size), '\0');
    size_t have = 0;
    while (have < bytes.size()) {
        const ssize_t n = ::read(file.fd, bytes.data() + have, bytes.size() - have);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io("cannot read the file");
        if (n == 0) break;
        have += static_cast<size_t>(n);
    }
    bytes.resize(have);
    return bytes;
}

// An affine map in double precision: Assimp's own products of matrices are rounded to float at each step.
struct Transform {
    double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};

    explicit Transform() = default;
    explicit Transform(const aiMatrix4x4& a)
        : m{{a.a1, a.a2, a.a3, a.a4}, {a.b1, a.b2, a.b3, a.b4}, {a.c1, a.c2, a.c3, a.c4}} {}

    Transform operator*(const Transform& inner) const {
        Transform out;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 4; ++j) {
                out.m[i][j] = j == 3 ? m[i][3] : 0;
                for (size_t k = 0; k < 3; ++k) out.m[i][j] += m[i][k] * inner.m[k][j];
            }
        return out;
    }
    Vec3 operator()(const aiVector3D& p) const {
        const auto row = [&](size_t i) {
            return static_cast<float>(m[i][0] * p.x + m[i][1] * p.y + m[i][2] * p.z + m[i][3]);
        };
        return {row(0), row(1), row(2)};
    }
    bool mirrors() const {
        return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                   m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) <
               0;
    }
};

// Appends one instance of `from`.
Result<void> append(Mesh& out, const aiMesh& from, const Transform& transform) {
    if (out.vertices.size() + from.mNumVertices > std::numeric_limits<uint32_t>::max())
        return Error{ErrorCode::bad_file, "the scene has too many vertices (2^32 or more)"};
    const uint32_t base = static_cast<uint32_t>(out.vertices.size());
    const size_t old_triangles = out.triangles.size();
    for (const aiFace& face : std::span(from.mFaces, from.mNumFaces)) {
        if (face.mNumIndices != 3) continue; // points and lines; polygons are triangles by now
        Triangle t;
        for (unsigned i = 0; i < 3; ++i) {
            if (face.mIndices[i] >= from.mNumVertices)
                return Error{ErrorCode::bad_file, "a face names a vertex that does not exist"};
            t[i] = base + face.mIndices[i];
        }
        if (transform.mirrors()) std::swap(t[1], t[2]);
        out.triangles.push_back(t);
    }
    if (out.triangles.size() == old_triangles) return {};
    for (const aiVector3D& p : std::span(from.mVertices, from.mNumVertices)) out.vertices.push_back(transform(p));
    return {};
}

// Every mesh of every node; a mesh named by two nodes is there twice. No recursion: files may nest deeply.
Result<Mesh> flatten(const aiScene& scene, bool skip_root_transform) {
    struct Item {
        const aiNode* node;
        Transform transform;
    };
    Mesh out;
    std::vector<Item> todo = {
        {scene.mRootNode, skip_root_transform ? Transform() : Transform(scene.mRootNode->mTransformation)}};
    while (!todo.empty()) {
        const Item item = todo.back();
        todo.pop_back();
        for (const unsigned index : std::span(item.node->mMeshes, item.node->mNumMeshes)) {
            if (index >= scene.mNumMeshes) return Error{ErrorCode::bad_file, "a node names a mesh that does not exist"};
            if (const auto done = append(out, *scene.mMeshes[index], item.transform); !done) return done.error();
        }
        for (unsigned i = item.node->mNumChildren; i-- > 0;) {
            const aiNode* child = item.node->mChildren[i];
            todo.push_back({child, item.transform * Transform(child->mTransformation)});
        }
    }
    return out;
}

// Faces of three or more corners, as check_mesh_bytes() counts them.
uint64_t count_faces(const aiScene& scene) {
    uint64_t faces = 0;
    for (const aiMesh* mesh : std::span(scene.mMeshes, scene.mNumMeshes))
        for (const aiFace& face : std::span(mesh->mFaces, mesh->mNumFaces)) faces += face.mNumIndices >= 3;
    return faces;
}

// Is there work for aiProcess_Triangulate? It aborts the program where a mesh is marked as having polygons and has
// none, and that is what a face of no corners leads to.
Result<bool> find_polygons(const aiScene& scene) {
    bool any = false;
    for (const aiMesh* mesh : std::span(scene.mMeshes, scene.mNumMeshes)) {
        bool here = false;
        for (const aiFace& face : std::span(mesh->mFaces, mesh->mNumFaces)) {
            if (face.mNumIndices == 0) return Error{ErrorCode::bad_file, "a face has no corners"};
            here |= face.mNumIndices > 3;
        }
        if (here != ((mesh->mPrimitiveTypes & aiPrimitiveType_POLYGON) != 0))
            return Error{ErrorCode::bad_file, "the reader contradicts itself on the file's polygons"};
        any |= here;
    }
    return any;
}

Result<Mesh> load_or_throw(const char* path, std::string& detail) {
    const std::string type = extension(path);
    auto bytes = read_all(path);
    if (!bytes) return bytes.error();
    if (bytes->empty()) return Error{ErrorCode::bad_file, "the file is empty"};
    const auto expected_faces = check_mesh_bytes(type, *bytes, detail);
    if (!expected_faces) return expected_faces.error();
    *bytes = {};

    Assimp::Importer importer;
    importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
    const aiScene* scene = importer.ReadFile(path, 0);
    if (scene) {
        if (*expected_faces && **expected_faces != count_faces(*scene))
            return Error{ErrorCode::bad_file, "the reader dropped some of the file's faces"};
        const auto polygons = find_polygons(*scene);
        if (!polygons) return polygons.error();
        if (*polygons) scene = importer.ApplyPostProcessing(aiProcess_Triangulate);
    }
    if (!scene || !scene->mRootNode) {
        detail = importer.GetErrorString();
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    }
    auto mesh = flatten(*scene, type == ".dae" || type == ".3ds");
    if (mesh && mesh->triangles.empty()) return Error{ErrorCode::bad_file, "the file has no triangles"};
    return mesh;
}

// The JSON of a glTF or GLB file. (GLB: a header of 12 bytes, then chunks of length, type, content; JSON is the first.)
std::string_view gltf_json(std::string_view type, std::string_view bytes) {
    if (type == ".gltf") return bytes;
    if (bytes.size() < 20) return {};
    const auto length = load_le<uint32_t>(std::as_bytes(std::span(bytes)).data() + 12);
    return bytes.substr(20, length);
}

} // namespace

std::optional<uint64_t> hash_mesh_file(const char* path) try {
    const std::string type = extension(path);
    const auto bytes = read_all(path);
    if (!bytes) return {};
    if (type == ".gltf" || type == ".glb") {
        // Buffers in other files are named by a "uri", which only an escape could hide. Images have one, too: then the
        // answer is needlessly empty, but never wrong. No other format reads triangles from a second file.
        const std::string_view json = gltf_json(type, *bytes);
        if (json.empty() || json.find("uri") != json.npos || json.find('\\') != json.npos) return {};
    }
    const unsigned version[] = {aiGetVersionMajor(), aiGetVersionMinor(), aiGetVersionPatch()};
    const uint64_t reader = hash_bytes(std::as_bytes(std::span(type)), hash_bytes(std::as_bytes(std::span(version))));
    return hash_bytes(std::as_bytes(std::span(*bytes)), reader);
} catch (const std::bad_alloc&) {
    return {};
}

Result<Mesh> load_mesh(const char* path, std::string* detail) {
    std::string unused;
    std::string& words = detail ? *detail : unused;
    try {
        words.clear();
        return load_or_throw(path, words);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "the mesh does not fit into memory"};
    } catch (const std::exception& e) {
        try {
            words = e.what();
        } catch (...) { // no memory left for the words
        }
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    } catch (...) {
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    }
}

} // namespace prolate

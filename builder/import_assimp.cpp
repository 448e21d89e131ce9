// Reads DAE and 3DS through Assimp, without its triangulation: that drops ears of concave polygons.
//
// Coordinates stay as the file has them. Assimp puts its conversion of units and up axis into the transform of the
// scene's root, and that one is left out; what it says is noted.
//
// Known limits: Assimp keeps positions in single precision, so a DAE's text is read to within a unit in the last place
// of a float. Skinning and morphing are not applied.
#include "builder/polygons.hpp"

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/version.h>

#include <cmath>
#include <cstdio>

namespace prolate {
namespace {

Affine affine(const aiMatrix4x4& a) {
    return {{{a.a1, a.a2, a.a3, a.a4}, {a.b1, a.b2, a.b3, a.b4}, {a.c1, a.c2, a.c3, a.c4}}};
}

// Appends one instance of `from`.
Result<void> append(Polygons& out, const aiMesh& from, const Affine& transform, uint64_t& left_out) {
    if (!out.can_hold(from.mNumVertices)) return Error{ErrorCode::bad_file, "too many vertices (2^32 or more)"};
    const auto base = static_cast<uint32_t>(out.points.size());
    const size_t old_faces = out.sizes.size();
    for (const aiFace& face : std::span(from.mFaces, from.mNumFaces)) {
        if (face.mNumIndices < 3) {
            ++left_out;
            continue;
        }
        out.begin_face(out.sizes.size() + 1);
        for (const unsigned corner : std::span(face.mIndices, face.mNumIndices)) {
            if (corner >= from.mNumVertices)
                return Error{ErrorCode::bad_file, "a face names a vertex that does not exist"};
            out.add_corner(base + corner);
        }
        if (transform.mirrors()) out.turn_last_face();
    }
    if (out.sizes.size() == old_faces) return {};
    for (const aiVector3D& p : std::span(from.mVertices, from.mNumVertices))
        out.points.push_back(transform({p.x, p.y, p.z}));
    return {};
}

// What the root's transform says of unit and up axis.
void note_frame(Polygons& out, std::string_view type, const Affine& root) {
    const double unit = std::hypot(root.m[0][0], root.m[1][0], root.m[2][0]);
    // Assimp turns the file's up axis to y: it is the row that y comes from.
    size_t up = 0;
    for (size_t k = 1; k < 3; ++k)
        if (std::abs(root.m[1][k]) > std::abs(root.m[1][up])) up = k;
    char words[200];
    if (type == ".dae")
        std::snprintf(words, sizeof words, "states a unit of %.6g m, and %c up: the axes are kept", unit,
                      static_cast<char>('x' + up));
    else
        std::snprintf(words, sizeof words, "has z up, as 3DS has it: the axes are kept");
    out.unit_is_ignored = type == ".dae" && std::abs(unit - 1) > 1e-6;
    out.notes.emplace_back(words);
}

} // namespace

uint64_t assimp_version() {
    return uint64_t{aiGetVersionMajor()} << 32 | uint64_t{aiGetVersionMinor()} << 16 | aiGetVersionPatch();
}

Result<Polygons> read_with_assimp(std::string_view type, const std::string& path, std::string& detail) {
    Assimp::Importer importer;
    const aiScene* scene = importer.ReadFile(path, 0);
    if (!scene || !scene->mRootNode) {
        detail = importer.GetErrorString();
        return Error{ErrorCode::bad_file, "cannot be read as a mesh"};
    }
    Polygons out;
    out.points_are_rounded = type == ".dae";
    note_frame(out, type, affine(scene->mRootNode->mTransformation));
    struct Item {
        const aiNode* node;
        Affine transform;
    };
    std::vector<Item> todo = {{scene->mRootNode, Affine()}};
    uint64_t left_out = 0;
    while (!todo.empty()) { // no recursion: files may nest deeply
        const Item item = todo.back();
        todo.pop_back();
        for (const unsigned index : std::span(item.node->mMeshes, item.node->mNumMeshes)) {
            if (index >= scene->mNumMeshes)
                return Error{ErrorCode::bad_file, "a node names a mesh that does not exist"};
            if (const auto done = append(out, *scene->mMeshes[index], item.transform, left_out); !done)
                return done.error();
        }
        for (unsigned i = item.node->mNumChildren; i-- > 0;) {
            const aiNode* child = item.node->mChildren[i];
            todo.push_back({child, item.transform * affine(child->mTransformation)});
        }
    }
    if (left_out > 0) out.notes.push_back(std::to_string(left_out) + " lines or points are left out");
    return out;
}

} // namespace prolate

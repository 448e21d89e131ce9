// Reads glTF and GLB: the default scene, all kinds of triangles, sparse, normalised and integer accessors
// (KHR_mesh_quantization), GPU instances (EXT_mesh_gpu_instancing), mirrored nodes. (Khronos, glTF 2.0 Specification.)
//
// A file that requires an extension which could change the surface, and is not handled here, is refused by name: its
// positions would be compressed data, or missing.
//
// A skinned mesh is taken in its bind pose, as its vertices are stored: its node's transform does not count (glTF 2.0,
// 3.7.3.3). Known limits, which are noted: the joints' pose and the weights of morph targets are not applied.
#include "builder/gltf_document.hpp"
#include "builder/gltf_rig.hpp"
#include "builder/job.hpp"
#include "builder/polygons.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

namespace prolate {
namespace {

using Numbers = std::vector<double>;
using Rows = GltfDocument::Rows;

// Does the extension leave the surface alone, or is it handled here?
bool is_harmless(std::string_view name) {
    constexpr std::string_view kNames[] = {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"};
    constexpr std::string_view kFamilies[] = {
        "KHR_materials_", "KHR_texture_", "EXT_texture_",   "MSFT_texture_",     "KHR_lights_",
        "EXT_lights_",    "KHR_xmp",      "KHR_animation_", "EXT_mesh_features", "EXT_structural_metadata"};
    const auto starts = [name](std::string_view family) { return name.starts_with(family); };
    return std::find(std::begin(kNames), std::end(kNames), name) != std::end(kNames) ||
           std::any_of(std::begin(kFamilies), std::end(kFamilies), starts);
}

void check_version_and_extensions(const GltfValue& root) {
    const GltfValue version = root["asset"]["version"];
    if (!version.text().starts_with("2")) version.fail("a glTF of a version other than 2; export it again");
    if (!root.has("extensionsRequired")) return;
    const GltfValue names = root["extensionsRequired"];
    for (uint64_t i = 0; i < names.size(); ++i) {
        const std::string& name = names.element(i).text();
        if (is_harmless(name)) continue;
        const bool packed = name.find("compression") != name.npos;
        throw GltfFailure{packed
                              ? "compressed geometry, which is not read; decompress it, as with 'gltf-transform copy'"
                              : "the file requires an extension that is not read; export it without",
                          name};
    }
}

// translation, rotation (x y z w) and scale
Affine transform_of(const Numbers& t, const Numbers& r, const Numbers& s) {
    const double x = r[0], y = r[1], z = r[2], w = r[3], two = 2 / std::max(x * x + y * y + z * z + w * w, 1e-300);
    const double rotation[3][3] = {{1 - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)},
                                   {two * (x * y + w * z), 1 - two * (x * x + z * z), two * (y * z - w * x)},
                                   {two * (x * z - w * y), two * (y * z + w * x), 1 - two * (x * x + y * y)}};
    Affine out;
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) out.m[i][j] = rotation[i][j] * s[j];
        out.m[i][3] = t[i];
    }
    return out;
}
const Numbers kNoTranslation = {0, 0, 0}, kNoRotation = {0, 0, 0, 1}, kNoScale = {1, 1, 1};

Affine transform_of(const GltfValue& node) {
    if (node.has("matrix")) { // column by column
        const Numbers m = node["matrix"].numbers(16);
        if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1) node["matrix"].fail("a matrix with a perspective");
        Affine out;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 4; ++j) out.m[i][j] = m[4 * j + i];
        return out;
    }
    const auto part = [&node](const char* name, const Numbers& otherwise) {
        return node.has(name) ? node[name].numbers(otherwise.size()) : otherwise;
    };
    return transform_of(part("translation", kNoTranslation), part("rotation", kNoRotation), part("scale", kNoScale));
}

enum Mode : uint64_t { kTriangles = 4, kStrip = 5, kFan = 6 }; // less: points and lines

class SceneReader {
public:
    SceneReader(GltfDocument& document, GltfRig* rig) : document_(document), root_(document.root()), rig_(rig) {}

    Polygons read() {
        check_version_and_extensions(root_);
        out_.place_word = "triangle";
        out_.notes.emplace_back("metres with y up, as glTF has it; the axes are kept");
        const uint64_t node_count = root_.has("nodes") ? root_["nodes"].size() : 0;
        std::vector<bool> seen(node_count);
        std::vector<Item> todo = roots(node_count);
        while (!todo.empty()) { // no recursion: files may nest deeply
            checkpoint();
            const Item item = todo.back();
            todo.pop_back();
            const GltfValue node = root_["nodes"].element(item.node);
            if (seen[item.node]) node.fail("a node that has two parents");
            seen[item.node] = true;
            const Affine transform = item.parent * transform_of(node);
            add_node(node, transform);
            if (node.has("children")) push_nodes(node["children"], transform, todo);
        }
        note_count(left_out_, "points or lines are left out");
        note_count(skinned_, "skinned meshes are taken in their bind pose: neither joints nor their nodes move them");
        note_count(morphed_, "parts with morph targets are taken in their base shape");
        if (rig_) rig_->finish(out_.points.size());
        return std::move(out_);
    }

private:
    struct Item {
        uint64_t node; // its number
        Affine parent;
    };
    struct Part { // of all points
        uint32_t first = 0;
        size_t count = 0;
        std::string moved_by = {}; // as GltfRig::movers() says
    };

    void note_count(uint64_t count, const char* words) {
        if (count > 0) out_.notes.push_back(std::to_string(count) + ' ' + words);
    }

    void push_nodes(const GltfValue& indices, const Affine& parent, std::vector<Item>& todo) const {
        for (uint64_t i = indices.size(); i-- > 0;) {
            const GltfValue index = indices.element(i);
            document_.named("nodes", index);
            todo.push_back({index.whole(), parent});
        }
    }

    // Nodes of the default scene; of the first, if none is; of a file without scenes, those that have no parent. The
    // last one comes first.
    std::vector<Item> roots(uint64_t node_count) const {
        std::vector<Item> out;
        if (root_.has("scenes") && root_["scenes"].size() > 0) {
            const GltfValue scene =
                root_.has("scene") ? document_.named("scenes", root_["scene"]) : root_["scenes"].element(0);
            if (scene.has("nodes")) push_nodes(scene["nodes"], {}, out);
            return out;
        }
        std::vector<bool> has_parent(node_count);
        for (uint64_t i = 0; i < node_count; ++i) {
            const GltfValue node = root_["nodes"].element(i);
            for (uint64_t k = node.has("children") ? node["children"].size() : 0; k-- > 0;)
                if (const uint64_t child = node["children"].element(k).whole(); child < node_count)
                    has_parent[child] = true;
        }
        for (uint64_t i = node_count; i-- > 0;)
            if (!has_parent[i]) out.push_back({i, {}});
        return out;
    }

    void add_node(const GltfValue& node, const Affine& transform) {
        if (!node.has("mesh")) return;
        const bool skinned = node.has("skin");
        skinned_ += skinned;
        const GltfValue mesh = document_.named("meshes", node["mesh"]);
        if (rig_) rig_->begin(node, mesh);
        if (!node.has("extensions") || !node["extensions"].has("EXT_mesh_gpu_instancing"))
            return add_mesh(mesh, skinned ? Affine() : transform);
        for (const Affine& place : instances(node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]))
            add_mesh(mesh, transform * place);
    }

    // Transforms of the instances, in the node's frame.
    std::vector<Affine> instances(const GltfValue& attributes) {
        std::optional<size_t> count;
        const auto read = [&](const char* name, Rows kind) {
            if (!attributes.has(name)) return Numbers();
            Numbers numbers = document_.rows(attributes[name], kind);
            const size_t rows = numbers.size() / static_cast<size_t>(kind);
            if (count && rows != *count) attributes.fail("instances whose attributes differ in number");
            count = rows;
            return numbers;
        };
        const Numbers t = read("TRANSLATION", Rows::vec3), r = read("ROTATION", Rows::vec4),
                      s = read("SCALE", Rows::vec3);
        if (!count) attributes.fail("instances without a translation, rotation or scale");
        const auto row = [](const Numbers& rows, size_t i, const Numbers& otherwise) {
            if (rows.empty()) return otherwise;
            const auto from = rows.begin() + static_cast<ptrdiff_t>(i * otherwise.size());
            return Numbers(from, from + static_cast<ptrdiff_t>(otherwise.size()));
        };
        std::vector<Affine> out;
        for (size_t i = 0; i < *count; ++i)
            out.push_back(transform_of(row(t, i, kNoTranslation), row(r, i, kNoRotation), row(s, i, kNoScale)));
        return out;
    }

    void add_mesh(const GltfValue& mesh, const Affine& transform) {
        std::map<uint64_t, Part> parts; // by position accessor: primitives may share one
        const GltfValue primitives = mesh["primitives"];
        for (uint64_t i = 0; i < primitives.size(); ++i) {
            const GltfValue primitive = primitives.element(i), attributes = primitive["attributes"];
            if (!attributes.has("POSITION")) continue; // the specification says to skip it
            const uint64_t mode = primitive.whole("mode", kTriangles);
            if (mode > kFan) primitive["mode"].fail("an unknown kind of triangles");
            if (mode < kTriangles) {
                ++left_out_;
                continue;
            }
            morphed_ += primitive.has("targets") && primitive["targets"].size() > 0;
            const GltfValue position = attributes["POSITION"];
            const auto [part, is_new] = parts.try_emplace(position.whole());
            if (is_new) part->second = add_points(position, transform);
            if (rig_) add_to_rig(primitive, part->second, transform);
            add_triangles(primitive, mode, part->second, transform.mirrors());
        }
    }

    // Primitives that share points share what moves them.
    void add_to_rig(const GltfValue& primitive, Part& part, const Affine& transform) {
        if (part.moved_by == GltfRig::movers(primitive)) return;
        if (!part.moved_by.empty()) primitive.fail("primitives that share positions, and not their weights");
        part.moved_by = GltfRig::movers(primitive);
        rig_->add(primitive, part.first, part.count, transform);
    }

    Part add_points(const GltfValue& position, const Affine& transform) {
        const Numbers numbers = document_.rows(position, Rows::vec3);
        Part part{static_cast<uint32_t>(out_.points.size()), numbers.size() / 3};
        if (!out_.can_hold(part.count)) position.fail("too many vertices (2^32 or more)");
        Checkpoints checkpoint;
        for (size_t i = 0; i < numbers.size(); i += 3) {
            checkpoint();
            out_.points.push_back(transform({numbers[i], numbers[i + 1], numbers[i + 2]}));
        }
        return part;
    }

    void add_triangles(const GltfValue& primitive, uint64_t mode, const Part& part, bool mirrored) {
        const bool has_indices = primitive.has("indices");
        const Numbers indices = has_indices ? document_.rows(primitive["indices"], Rows::scalar) : Numbers();
        const size_t count = has_indices ? indices.size() : part.count;
        for (const double index : indices)
            if (!(index >= 0 && index < static_cast<double>(part.count) && index == std::floor(index)))
                primitive["indices"].fail("a triangle names a vertex that does not exist");
        if (mode == kTriangles && count % 3 != 0) primitive.fail("a triangle without its corners");
        Checkpoints checkpoint;
        const auto add = [&](size_t a, size_t b, size_t c) {
            checkpoint();
            out_.begin_face(out_.sizes.size() + 1);
            if (mirrored) std::swap(b, c);
            for (const size_t i : {a, b, c})
                out_.add_corner(part.first + static_cast<uint32_t>(has_indices ? indices[i] : static_cast<double>(i)));
        };
        const size_t step = mode == kTriangles ? 3 : 1;
        for (size_t i = 0; i + 2 < count; i += step) {
            if (mode == kFan)
                add(0, i + 1, i + 2);
            else if (mode == kStrip && i % 2 == 1)
                add(i, i + 2, i + 1);
            else
                add(i, i + 1, i + 2);
        }
    }

    GltfDocument& document_;
    const GltfValue root_;
    GltfRig* const rig_;
    Polygons out_;
    uint64_t left_out_ = 0, skinned_ = 0, morphed_ = 0;
};

} // namespace

Result<Polygons> read_gltf(std::string_view type, std::string_view bytes, const std::string& path, ImportReport& report,
                           RiggedMesh* rig) try {
    GltfDocument document(type, bytes, path, report.files);
    if (!rig) return SceneReader(document, nullptr).read();
    GltfRig reader(document, *rig);
    return SceneReader(document, &reader).read();
} catch (const GltfFailure& failure) {
    report.detail = failure.place;
    return Error{ErrorCode::bad_file, failure.what};
}

} // namespace prolate

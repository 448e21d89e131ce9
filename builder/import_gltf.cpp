// Reads glTF and GLB through tinygltf: the default scene, all kinds of triangles, sparse, normalised and integer
// accessors (KHR_mesh_quantization), GPU instances (EXT_mesh_gpu_instancing), mirrored nodes.
//
// tinygltf parses and knows nothing of what extensions mean. A file that requires one which could change the surface,
// and is not handled here, is refused by name: its positions would be compressed data, or missing.
//
// Known limits, which are noted: skins and morph targets are not applied.
#include "builder/polygons.hpp"

#include <nlohmann/json.hpp>

#include <fstream> // which tiny_gltf.h needs, but does not include without its own file functions

// Compiled in here, as Debian's README.Debian offers: the layout of its shared library's classes is not that of the
// header (2.7.0+dfsg-2). Under a name of its own, so that a program may have another tinygltf.
#define tinygltf prolate_tinygltf // NOLINT(readability-identifier-naming): the header's name
#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_INCLUDE_JSON
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <utility>

namespace prolate {
namespace {

using Numbers = std::vector<double>;

Error bad(const char* what) {
    return {ErrorCode::bad_file, what};
}

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

// The names in "extensionsRequired". They are looked at before tinygltf reads the file, for it may well fail of them.
std::vector<std::string> required_extensions(std::string_view json) {
    using Json = nlohmann::json;
    const auto keep = [](int depth, Json::parse_event_t event, Json& parsed) {
        return depth != 1 || event != Json::parse_event_t::key || parsed == "extensionsRequired";
    };
    const Json root = Json::parse(json, keep, false);
    std::vector<std::string> out;
    if (!root.is_object() || !root.contains("extensionsRequired")) return out;
    for (const Json& name : root["extensionsRequired"])
        if (name.is_string()) out.push_back(name);
    return out;
}

// The rows of an accessor, of so many numbers each.
class Accessors {
public:
    explicit Accessors(const tinygltf::Model& model) : model_(model) {}

    Result<Numbers> read(int index, int type) const {
        if (index < 0 || static_cast<size_t>(index) >= model_.accessors.size())
            return bad("an accessor that does not exist");
        const tinygltf::Accessor& accessor = model_.accessors[static_cast<size_t>(index)];
        if (accessor.type != type) return bad("an accessor of another type than its use needs");
        const bool is_scalar = type == TINYGLTF_TYPE_SCALAR;
        const auto width = static_cast<size_t>(is_scalar ? 1 : type); // the constants of vectors are their sizes
        if (accessor.bufferView < 0 && !accessor.sparse.isSparse)
            return bad(
                "an accessor without data (is it compressed? decompress the file, as with 'gltf-transform copy')");
        Numbers out;
        if (accessor.bufferView >= 0) {
            auto dense = read_view(accessor.bufferView, accessor.byteOffset, accessor.componentType,
                                   accessor.normalized, accessor.count, width, true);
            if (!dense) return dense.error();
            out = std::move(*dense);
        } else {
            out.assign(checked_size(accessor.count * width), 0.0);
        }
        if (!accessor.sparse.isSparse) return out;
        const auto& sparse = accessor.sparse;
        if (sparse.count < 0 || sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0)
            return bad("a sparse accessor that makes no sense");
        const auto count = static_cast<size_t>(sparse.count);
        const auto at = read_view(sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset),
                                  sparse.indices.componentType, false, count, 1, false);
        const auto values = read_view(sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset),
                                      accessor.componentType, accessor.normalized, count, width, false);
        for (const auto* part : {&at, &values})
            if (!*part) return part->error();
        for (size_t i = 0; i < count; ++i) {
            if (!((*at)[i] >= 0 && (*at)[i] < static_cast<double>(accessor.count)))
                return bad("a sparse accessor that replaces what is not there");
            std::copy_n(values->begin() + static_cast<ptrdiff_t>(i * width), width,
                        out.begin() + static_cast<ptrdiff_t>(static_cast<size_t>((*at)[i]) * width));
        }
        return out;
    }

private:
    static size_t checked_size(size_t size) {
        if (size > size_t{1} << 34) throw std::bad_alloc(); // hostile: nothing stands behind so many zeros
        return size;
    }

    Result<Numbers> read_view(int index, size_t offset, int component, bool normalized, size_t count, size_t width,
                              bool may_stride) const {
        if (index < 0 || static_cast<size_t>(index) >= model_.bufferViews.size())
            return bad("a buffer view that does not exist");
        const tinygltf::BufferView& view = model_.bufferViews[static_cast<size_t>(index)];
        if (view.buffer < 0 || static_cast<size_t>(view.buffer) >= model_.buffers.size())
            return bad("a buffer that does not exist");
        const std::vector<unsigned char>& data = model_.buffers[static_cast<size_t>(view.buffer)].data;
        const int32_t bytes = tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(component));
        if (bytes <= 0 || component == TINYGLTF_COMPONENT_TYPE_DOUBLE) return bad("an unknown type of numbers");
        const size_t size = static_cast<size_t>(bytes), row = size * width;
        const size_t stride = may_stride && view.byteStride > 0 ? view.byteStride : row;
        // In this order, so that no sum overflows.
        if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset ||
            offset > view.byteLength ||
            (count > 0 && (view.byteLength - offset < row || (view.byteLength - offset - row) / stride < count - 1)))
            return bad("an accessor that reaches beyond its buffer");
        Numbers out;
        out.reserve(count * width);
        for (size_t i = 0; i < count; ++i)
            for (size_t k = 0; k < width; ++k)
                out.push_back(
                    number(data.data() + view.byteOffset + offset + i * stride + k * size, component, normalized));
        return out;
    }
    // glTF is little-endian.
    static double number(const unsigned char* from, int component, bool normalized) {
        const auto load = [from](size_t size) {
            uint32_t bits = 0;
            for (size_t i = size; i-- > 0;) bits = bits << 8 | from[i];
            return bits;
        };
        const auto scaled = [normalized](double value, double largest) {
            return normalized ? std::max(value / largest, -1.0) : value;
        };
        switch (component) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
            return scaled(static_cast<int8_t>(load(1)), 127);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return scaled(load(1), 255);
        case TINYGLTF_COMPONENT_TYPE_SHORT:
            return scaled(static_cast<int16_t>(load(2)), 32767);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return scaled(load(2), 65535);
        case TINYGLTF_COMPONENT_TYPE_INT:
            return scaled(static_cast<int32_t>(load(4)), 2147483647);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
            return scaled(load(4), 4294967295);
        default:
            return double{std::bit_cast<float>(load(4))};
        }
    }

    const tinygltf::Model& model_;
};

// translation, rotation (x y z w) and scale
Affine transform_of(const double* t, const double* r, const double* s) {
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
constexpr double kNoTranslation[] = {0, 0, 0}, kNoRotation[] = {0, 0, 0, 1}, kNoScale[] = {1, 1, 1};

Affine transform_of(const tinygltf::Node& node) {
    if (node.matrix.size() == 16) { // column by column
        Affine out;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 4; ++j) out.m[i][j] = node.matrix[4 * j + i];
        return out;
    }
    return transform_of(node.translation.size() == 3 ? node.translation.data() : kNoTranslation,
                        node.rotation.size() == 4 ? node.rotation.data() : kNoRotation,
                        node.scale.size() == 3 ? node.scale.data() : kNoScale);
}

class Reader {
public:
    Reader(const tinygltf::Model& model, std::string& detail) : model_(model), detail_(detail), accessors_(model) {}

    Result<Polygons> read() {
        out_.notes.push_back("metres with y up, as glTF has it; the axes are kept");
        struct Item {
            int node;
            Affine parent;
        };
        std::vector<Item> todo;
        for (const int root : roots()) todo.push_back({root, {}});
        std::reverse(todo.begin(), todo.end());
        std::vector<bool> seen(model_.nodes.size());
        while (!todo.empty()) { // no recursion: files may nest deeply
            const auto [index, parent] = todo.back();
            todo.pop_back();
            detail_ = "node " + std::to_string(index);
            if (index < 0 || static_cast<size_t>(index) >= seen.size()) return bad("a node that does not exist");
            if (seen[static_cast<size_t>(index)]) return bad("a node that has two parents");
            seen[static_cast<size_t>(index)] = true;
            const tinygltf::Node& node = model_.nodes[static_cast<size_t>(index)];
            const Affine transform = parent * transform_of(node);
            if (const auto added = add_node(node, transform); !added) return added.error();
            for (size_t i = node.children.size(); i-- > 0;) todo.push_back({node.children[i], transform});
        }
        detail_.clear();
        note_count(left_out_, "points or lines are left out");
        note_count(skinned_, "skinned meshes are taken at their nodes: joints do not move them");
        note_count(morphed_, "parts with morph targets are taken in their base shape");
        return std::move(out_);
    }

private:
    void note_count(uint64_t count, const char* words) {
        if (count > 0) out_.notes.push_back(std::to_string(count) + ' ' + words);
    }

    // Nodes of the default scene; of the first, if none is; of a file without scenes, those that have no parent.
    std::vector<int> roots() const {
        if (!model_.scenes.empty()) {
            const auto scene = static_cast<size_t>(std::max(model_.defaultScene, 0));
            return model_.scenes[std::min(scene, model_.scenes.size() - 1)].nodes;
        }
        std::vector<bool> has_parent(model_.nodes.size());
        for (const tinygltf::Node& node : model_.nodes)
            for (const int child : node.children)
                if (child >= 0 && static_cast<size_t>(child) < has_parent.size())
                    has_parent[static_cast<size_t>(child)] = true;
        std::vector<int> out;
        for (size_t i = 0; i < has_parent.size(); ++i)
            if (!has_parent[i]) out.push_back(static_cast<int>(i));
        return out;
    }

    Result<void> add_node(const tinygltf::Node& node, const Affine& transform) {
        if (node.mesh < 0) return {};
        if (static_cast<size_t>(node.mesh) >= model_.meshes.size()) return bad("a mesh that does not exist");
        detail_ = "mesh " + std::to_string(node.mesh);
        skinned_ += node.skin >= 0;
        const tinygltf::Mesh& mesh = model_.meshes[static_cast<size_t>(node.mesh)];
        const auto instancing = node.extensions.find("EXT_mesh_gpu_instancing");
        if (instancing == node.extensions.end()) return add_mesh(mesh, transform);
        const auto places = instances(instancing->second);
        if (!places) return places.error();
        for (const Affine& place : *places)
            if (const auto added = add_mesh(mesh, transform * place); !added) return added.error();
        return {};
    }

    // Transforms of the instances, in the node's frame.
    Result<std::vector<Affine>> instances(const tinygltf::Value& extension) const {
        const tinygltf::Value& attributes = extension.Get("attributes");
        size_t count = 0;
        bool first = true;
        const auto read = [&](const char* name, int type) -> Result<Numbers> {
            if (!attributes.Has(name)) return Numbers();
            auto numbers = accessors_.read(attributes.Get(name).GetNumberAsInt(), type);
            if (!numbers) return numbers;
            const size_t rows = numbers->size() / static_cast<size_t>(type);
            if (!first && rows != count) return bad("instances whose attributes differ in number");
            count = rows, first = false;
            return numbers;
        };
        const auto t = read("TRANSLATION", TINYGLTF_TYPE_VEC3);
        if (!t) return t.error();
        const auto r = read("ROTATION", TINYGLTF_TYPE_VEC4);
        if (!r) return r.error();
        const auto s = read("SCALE", TINYGLTF_TYPE_VEC3);
        if (!s) return s.error();
        if (first) return bad("instances without a translation, rotation or scale");
        std::vector<Affine> out;
        for (size_t i = 0; i < count; ++i)
            out.push_back(transform_of(t->empty() ? kNoTranslation : &(*t)[3 * i],
                                       r->empty() ? kNoRotation : &(*r)[4 * i], s->empty() ? kNoScale : &(*s)[3 * i]));
        return out;
    }

    Result<void> add_mesh(const tinygltf::Mesh& mesh, const Affine& transform) {
        std::map<int, uint32_t> bases; // of position accessors: primitives may share one
        for (const tinygltf::Primitive& primitive : mesh.primitives) {
            const auto position = primitive.attributes.find("POSITION");
            if (position == primitive.attributes.end()) continue; // the specification says to skip it
            const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
            if (mode < TINYGLTF_MODE_TRIANGLES) {
                ++left_out_;
                continue;
            }
            morphed_ += !primitive.targets.empty();
            const auto [base, is_new] = bases.emplace(position->second, static_cast<uint32_t>(out_.points.size()));
            if (is_new) {
                const auto numbers = accessors_.read(position->second, TINYGLTF_TYPE_VEC3);
                if (!numbers) return numbers.error();
                if (!out_.can_hold(numbers->size() / 3)) return bad("too many vertices (2^32 or more)");
                for (size_t i = 0; i < numbers->size(); i += 3)
                    out_.points.push_back(transform({(*numbers)[i], (*numbers)[i + 1], (*numbers)[i + 2]}));
            }
            const auto count = model_.accessors[static_cast<size_t>(position->second)].count;
            if (const auto added = add_triangles(primitive, mode, base->second, count, transform.mirrors()); !added)
                return added;
        }
        return {};
    }

    Result<void> add_triangles(const tinygltf::Primitive& primitive, int mode, uint32_t base, size_t points,
                               bool mirrored) {
        Numbers corners;
        if (primitive.indices >= 0) {
            auto read = accessors_.read(primitive.indices, TINYGLTF_TYPE_SCALAR);
            if (!read) return read.error();
            corners = std::move(*read);
        } else {
            for (size_t i = 0; i < points; ++i) corners.push_back(static_cast<double>(i));
        }
        for (const double corner : corners)
            if (!(corner >= 0 && corner < static_cast<double>(points)))
                return bad("a triangle names a vertex that does not exist");
        if (mode == TINYGLTF_MODE_TRIANGLES && corners.size() % 3 != 0) return bad("a triangle without its corners");
        const auto add = [&](size_t a, size_t b, size_t c) {
            out_.begin_face(out_.sizes.size() + 1);
            if (mirrored) std::swap(b, c);
            for (const size_t i : {a, b, c}) out_.add_corner(base + static_cast<uint32_t>(corners[i]));
        };
        const size_t step = mode == TINYGLTF_MODE_TRIANGLES ? 3 : 1;
        for (size_t i = 0; i + 2 < corners.size(); i += step) {
            if (mode == TINYGLTF_MODE_TRIANGLE_FAN)
                add(0, i + 1, i + 2);
            else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 == 1)
                add(i, i + 2, i + 1);
            else
                add(i, i + 1, i + 2);
        }
        return {};
    }

    const tinygltf::Model& model_;
    std::string& detail_;
    const Accessors accessors_;
    Polygons out_;
    uint64_t left_out_ = 0, skinned_ = 0, morphed_ = 0;
};

// Files that the JSON names are read as they are named: no "~", no wildcards.
bool file_exists(const std::string& path, void*) {
    return std::ifstream(path).good();
}
std::string same_path(const std::string& path, void*) {
    return path;
}
bool read_whole_file(std::vector<unsigned char>* out, std::string* error, const std::string& path, void*) {
    std::ifstream file(path, std::ios::binary);
    out->assign(std::istreambuf_iterator<char>(file), {});
    if (!file.bad() && file.is_open()) return true;
    *error += "cannot read " + path;
    return false;
}

// Pictures are of no interest: they stay undecoded, whatever they are.
bool ignore_image(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
    return true;
}

} // namespace

std::string_view gltf_json(std::string_view type, std::string_view bytes) {
    if (type == ".gltf") return bytes;
    // GLB: a header of 12 bytes, then chunks of length, type, content; JSON is the first.
    if (bytes.size() < 20) return {};
    uint32_t length = 0;
    for (size_t i = 4; i-- > 0;) length = length << 8 | static_cast<unsigned char>(bytes[12 + i]);
    return bytes.substr(20, length);
}

Result<Polygons> read_gltf(std::string_view type, std::string_view bytes, const std::string& path,
                           std::string& detail) {
    for (const std::string& name : required_extensions(gltf_json(type, bytes))) {
        if (is_harmless(name)) continue;
        detail = name;
        const bool packed = name.find("compression") != name.npos;
        return bad(packed ? "compressed geometry, which is not read; decompress it, as with 'gltf-transform copy'"
                          : "the file requires an extension that is not read; export it without");
    }
    if (bytes.size() > std::numeric_limits<uint32_t>::max()) return bad("a glTF file of 4 GiB or more");
    const auto size = static_cast<uint32_t>(bytes.size());
    const size_t slash = path.rfind('/');
    const std::string folder = slash == path.npos ? "." : path.substr(0, slash + 1);
    tinygltf::TinyGLTF loader;
    loader.SetFsCallbacks({file_exists, same_path, read_whole_file, nullptr, nullptr});
    loader.SetImageLoader(ignore_image, nullptr);
    tinygltf::Model model;
    std::string error, warning;
    const bool read =
        type == ".gltf"
            ? loader.LoadASCIIFromString(&model, &error, &warning, bytes.data(), size, folder)
            : loader.LoadBinaryFromMemory(&model, &error, &warning,
                                          reinterpret_cast<const unsigned char*>(bytes.data()), size, folder);
    if (!read) {
        while (!error.empty() && (error.back() == '\n' || error.back() == ' ')) error.pop_back();
        detail = error;
        return bad("cannot be read as glTF");
    }
    if (!model.asset.version.starts_with("2")) {
        detail = model.asset.version;
        return bad("a glTF of a version other than 2; export it again");
    }
    return Reader(model, detail).read();
}

} // namespace prolate

// Reader of 3DS (3D Studio, DOS): a tree of chunks, each of a number, its length and its content.
//
// Coordinates stay as the file has them, z up. The editor's chunk holds the meshes, whose vertices stand in the scene
// already. A keyframer's chunk, if there is one, places them anew: a mesh goes to where its node is at the first key,
// once for every node of its name. The vertices are first taken back into the mesh's own frame, whose matrix the file
// holds; where that mirrors, 3D Studio stores the vertices as if it did not, so x changes its sign. (As Assimp and
// lib3ds read it; the format has no published specification.) A mesh without a node stays where it stands.
//
// Known limits: the master scale, which 3D Studio shows lengths by, and all keys but the first are left out.
#include "builder/polygons.hpp"

#include "builder/job.hpp"

#include "src/bytes.hpp"

#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace prolate {
namespace {

// The part of the file that has not been read yet, of one chunk.
class Cursor {
public:
    Cursor(std::span<const std::byte> bytes, size_t at) : bytes_(bytes), at_(at) {}

    size_t at() const { return at_; } ///< in the file
    bool at_end() const { return bytes_.empty(); }

    template <class T> T get() {
        need(sizeof(T));
        const T value = load_le<T>(bytes_.data());
        skip(sizeof(T));
        return value;
    }
    Point get_point() {
        Point p;
        for (double& coordinate : p) coordinate = double{get<float>()};
        return p;
    }
    std::string get_name() {
        std::string name;
        while (const auto letter = static_cast<char>(get<uint8_t>())) name += letter;
        return name;
    }
    void skip(size_t size) {
        need(size);
        bytes_ = bytes_.subspan(size), at_ += size;
    }
    Cursor take(size_t size) {
        need(size);
        const Cursor part(bytes_.first(size), at_);
        skip(size);
        return part;
    }

private:
    void need(size_t size) const {
        if (size > bytes_.size())
            throw Error{ErrorCode::bad_file, "a chunk that ends too early (is the file cut short?)", at_};
    }

    std::span<const std::byte> bytes_;
    size_t at_;
};

enum ChunkId : uint16_t {
    kMain = 0x4d4d,
    kEditor = 0x3d3d,
    kObject = 0x4000,
    kMesh = 0x4100,
    kVertices = 0x4110,
    kFaces = 0x4120,
    kFrame = 0x4160,
    kKeyframer = 0xb000,
    kFirstNode = 0xb001, // of lights, cameras and objects
    kObjectNode = 0xb002,
    kLastNode = 0xb007,
    kNodeName = 0xb010,
    kPivot = 0xb013,
    kPositions = 0xb020,
    kRotations = 0xb021,
    kScales = 0xb022,
    kNodeId = 0xb030,
};

template <class Visit> void for_each_chunk(Cursor in, Visit&& visit) {
    while (!in.at_end()) {
        checkpoint();
        const auto id = in.get<uint16_t>();
        const auto length = in.get<uint32_t>();
        constexpr uint32_t kHeader = 6;
        if (length < kHeader) throw Error{ErrorCode::bad_file, "a chunk shorter than its header", in.at()};
        visit(id, in.take(length - kHeader));
    }
}

struct ObjectMesh {
    std::string name;
    std::vector<Point> points;
    std::vector<std::array<uint16_t, 3>> faces;
    Affine frame;
};

ObjectMesh read_mesh(Cursor chunk, const std::string& name) {
    ObjectMesh mesh;
    mesh.name = name;
    for_each_chunk(chunk, [&mesh](uint16_t id, Cursor in) {
        if (id == kVertices) {
            mesh.points.resize(in.get<uint16_t>());
            for (Point& p : mesh.points) p = in.get_point();
        } else if (id == kFaces) { // other chunks follow in it: materials, smoothing
            mesh.faces.resize(in.get<uint16_t>());
            for (auto& face : mesh.faces) {
                for (uint16_t& corner : face) corner = in.get<uint16_t>();
                in.skip(2); // which edges are seen
            }
        } else if (id == kFrame) { // column by column
            for (size_t j = 0; j < 4; ++j) {
                const Point column = in.get_point();
                for (size_t i = 0; i < 3; ++i) mesh.frame.m[i][j] = column[i];
            }
        }
    });
    for (const auto& face : mesh.faces)
        for (const uint16_t corner : face)
            if (corner >= mesh.points.size())
                throw Error{ErrorCode::bad_file, "a face names a vertex that does not exist", chunk.at()};
    return mesh;
}

struct Node3ds {
    std::string name;
    uint16_t id = 0, parent = kNoParent;
    Point pivot = {};
    Affine to_parent;

    static constexpr uint16_t kNoParent = 0xffff;
};

// The value of the earliest key of a track, of so many numbers; if there is none, `otherwise`.
template <size_t kNumbers>
std::array<double, kNumbers> first_key(Cursor track, const std::array<double, kNumbers>& otherwise) {
    track.skip(10); // flags, and what is not used
    const auto count = track.get<uint32_t>();
    auto out = otherwise;
    for (uint32_t i = 0, earliest = 0; i < count; ++i) {
        const auto frame = track.get<uint32_t>();
        const auto extras = track.get<uint16_t>(); // tension, continuity, bias, ease to and from, a bit each
        for (unsigned bit = 0; bit < 5; ++bit)
            if (extras >> bit & 1) track.skip(sizeof(float));
        std::array<double, kNumbers> value;
        for (double& number : value) number = double{track.get<float>()};
        if (i == 0 || frame < earliest) earliest = frame, out = value;
    }
    return out;
}

// A turn by -angle around the axis, as 3D Studio counts angles.
Affine rotation(const std::array<double, 4>& angle_axis) {
    const auto [angle, x, y, z] = angle_axis;
    const double length = std::hypot(x, y, z);
    Affine out;
    if (!(length > 0)) return out;
    const double axis[3] = {x / length, y / length, z / length}, s = std::sin(-angle), c = std::cos(angle);
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) out.m[i][j] = (1 - c) * axis[i] * axis[j] + (i == j ? c : 0);
    for (size_t i = 0; i < 3; ++i) { // s times the cross product with the axis
        out.m[i][(i + 1) % 3] -= s * axis[(i + 2) % 3];
        out.m[(i + 1) % 3][i] += s * axis[(i + 2) % 3];
    }
    return out;
}

Node3ds read_node(Cursor chunk, size_t number) {
    Node3ds node;
    node.id = static_cast<uint16_t>(number);
    Point position = {}, scale = {1, 1, 1};
    std::array<double, 4> turn = {};
    for_each_chunk(chunk, [&](uint16_t id, Cursor in) {
        if (id == kNodeId) node.id = in.get<uint16_t>();
        if (id == kNodeName) node.name = in.get_name(), in.skip(4), node.parent = in.get<uint16_t>();
        if (id == kPivot) node.pivot = in.get_point();
        if (id == kPositions) position = first_key(in, position);
        if (id == kRotations) turn = first_key(in, turn);
        if (id == kScales) scale = first_key(in, scale);
    });
    node.to_parent = rotation(turn);
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) node.to_parent.m[i][j] *= scale[j];
        node.to_parent.m[i][3] = position[i];
    }
    return node;
}

// From where a mesh stands in the scene to its own frame.
Affine to_own_frame(const ObjectMesh& mesh) {
    const auto& m = mesh.frame.m;
    const double det = mesh.frame.determinant();
    if (!(std::abs(det) > 0))
        throw Error{ErrorCode::bad_file, "a mesh whose matrix is flat; export the scene without animation"};
    Affine out;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const size_t r = (j + 1) % 3, s = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            out.m[i][j] = (m[r][c] * m[s][d] - m[r][d] * m[s][c]) / det;
        }
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) out.m[i][3] -= out.m[i][j] * m[j][3];
    if (det < 0)
        for (double& number : out.m[0]) number = -number;
    return out;
}

class Scene {
public:
    explicit Scene(std::span<const std::byte> bytes) {
        Cursor file(bytes, 0);
        if (bytes.size() < 2 || load_le<uint16_t>(bytes.data()) != kMain)
            throw Error{ErrorCode::bad_file, "not a 3DS file"};
        for_each_chunk(file, [this](uint16_t id, Cursor main) {
            if (id != kMain) return;
            for_each_chunk(main, [this](uint16_t part, Cursor in) {
                if (part == kEditor) read_editor(in);
                if (part == kKeyframer) read_keyframer(in);
            });
        });
    }

    Polygons polygons() const {
        Polygons out;
        out.place_word = "triangle";
        out.notes.emplace_back("has z up, as 3DS has it: the axes are kept");
        for (const ObjectMesh& mesh : meshes_) {
            const auto [first, last] = by_name_.equal_range(mesh.name);
            if (first == last) add(out, mesh, {});
            for (auto named = first; named != last; ++named) {
                const Node3ds& node = nodes_.at(named->second);
                Affine pivot;
                for (size_t i = 0; i < 3; ++i) pivot.m[i][3] = -node.pivot[i];
                add(out, mesh, to_scene(node) * pivot * to_own_frame(mesh));
            }
        }
        return out;
    }

private:
    void read_editor(Cursor editor) {
        for_each_chunk(editor, [this](uint16_t id, Cursor in) {
            if (id != kObject) return;
            const std::string name = in.get_name();
            for_each_chunk(in, [this, &name](uint16_t part, Cursor content) {
                if (part == kMesh) meshes_.push_back(read_mesh(content, name));
            });
        });
    }
    void read_keyframer(Cursor keyframer) {
        for_each_chunk(keyframer, [this](uint16_t id, Cursor in) {
            if (id < kFirstNode || id > kLastNode) return;
            const size_t number = node_count_++;
            if (id != kObjectNode) return;
            const Node3ds node = read_node(in, number);
            if (!nodes_.emplace(node.id, node).second)
                throw Error{ErrorCode::bad_file, "two nodes of the same number", in.at()};
            by_name_.emplace(node.name, node.id);
        });
    }

    Affine to_scene(const Node3ds& node) const {
        Affine out = node.to_parent;
        uint16_t parent = node.parent;
        for (size_t steps = 0; parent != Node3ds::kNoParent; ++steps) {
            checkpoint();
            const auto found = nodes_.find(parent);
            if (found == nodes_.end())
                throw Error{ErrorCode::bad_file,
                            "a node whose parent is not an object; export the scene without animation"};
            if (steps > nodes_.size()) throw Error{ErrorCode::bad_file, "a node that is below itself"};
            out = found->second.to_parent * out;
            parent = found->second.parent;
        }
        return out;
    }

    static void add(Polygons& out, const ObjectMesh& mesh, const Affine& transform) {
        const bool mirrors = transform.mirrors();
        if (!out.can_hold(3 * mesh.faces.size())) throw Error{ErrorCode::bad_file, "too many vertices (2^32 or more)"};
        Checkpoints checkpoint;
        for (const auto& face : mesh.faces) {
            checkpoint();
            out.begin_face(out.sizes.size() + 1);
            for (const uint16_t corner : face) {
                out.add_corner(static_cast<uint32_t>(out.points.size()));
                out.points.push_back(transform(mesh.points[corner]));
            }
            if (mirrors) out.turn_last_face();
        }
    }

    std::vector<ObjectMesh> meshes_;
    std::map<uint16_t, Node3ds> nodes_; // those of objects, by id
    std::multimap<std::string, uint16_t> by_name_;
    size_t node_count_ = 0; // of any kind
};

} // namespace

Result<Polygons> read_3ds(std::string_view bytes, std::string& detail) try {
    return Scene(std::as_bytes(std::span(bytes))).polygons();
} catch (const Error& error) {
    if (error.where > 0) detail = "byte " + std::to_string(error.where);
    return error;
}

} // namespace prolate

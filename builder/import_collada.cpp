// Reader of DAE (COLLADA 1.4 and 1.5) over pugixml, in double precision: the meshes of the visual scene, with their
// nodes' transforms. (Khronos, COLLADA - Digital Asset Schema Release 1.4.1 and 1.5.0 Specification.)
//
// The file is not trusted: every reference must lead to one element, every accessor must stay within its array, every
// list must be as long as its counts say. What would be a surface and cannot be read (holes, references into other
// files, skewed nodes, boundary representations) is refused.
//
// Coordinates stay as the file has them: unit and up axis are noted, not applied. Known limit, which is noted: skins
// and morph targets are not applied.
#include "builder/collada_document.hpp"
#include "builder/collada_mesh.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <unordered_map>
#include <utility>

namespace prolate {
namespace collada {
namespace {

constexpr size_t kMostReferences = 100; // of nodes to nodes, one below the other: more is a circle
constexpr size_t kMostNodes = 10'000'000;

// ---- transforms ----

using Axis = std::array<double, 3>;

Axis cross(const Axis& a, const Axis& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Axis normalised(const Axis& a) {
    const double length = std::hypot(a[0], a[1], a[2]);
    return {a[0] / length, a[1] / length, a[2] / length};
}

Affine rotation(const Axis& axis, double degrees) {
    const double angle = degrees * std::numbers::pi / 180, s = std::sin(angle), c = std::cos(angle);
    const auto [x, y, z] = normalised(axis);
    return {{{c + (1 - c) * x * x, (1 - c) * x * y - s * z, (1 - c) * x * z + s * y, 0},
             {(1 - c) * x * y + s * z, c + (1 - c) * y * y, (1 - c) * y * z - s * x, 0},
             {(1 - c) * x * z - s * y, (1 - c) * y * z + s * x, c + (1 - c) * z * z, 0}}};
}

// The frame of who stands at `eye` and looks at `interest` along its -z.
Affine look_at(const Point& eye, const Point& interest, const Axis& up) {
    const Axis back = normalised({eye[0] - interest[0], eye[1] - interest[1], eye[2] - interest[2]});
    const Axis right = normalised(cross(up, back)), above = cross(back, right);
    Affine out;
    for (size_t i = 0; i < 3; ++i) {
        out.m[i][0] = right[i], out.m[i][1] = above[i], out.m[i][2] = back[i], out.m[i][3] = eye[i];
    }
    return out;
}

// One transform element of a node; none of any other element.
Affine transform_of(const xml_node& element) {
    const std::string_view name = element.name();
    const auto values = [&element](size_t count) {
        auto out = numbers_of<double>(element, "a transform that is not numbers");
        if (out.size() != count) fail(element, "a transform with the wrong number of numbers");
        return out;
    };
    Affine out;
    if (name == "matrix") {
        const auto v = values(16);
        if (v[12] != 0 || v[13] != 0 || v[14] != 0 || v[15] != 1) fail(element, "a matrix with a perspective");
        for (size_t i = 0; i < 12; ++i) out.m[i / 4][i % 4] = v[i];
    } else if (name == "translate") {
        const auto v = values(3);
        for (size_t i = 0; i < 3; ++i) out.m[i][3] = v[i];
    } else if (name == "scale") {
        const auto v = values(3);
        for (size_t i = 0; i < 3; ++i) out.m[i][i] = v[i];
    } else if (name == "rotate") {
        const auto v = values(4);
        if (v[3] != 0) out = rotation({v[0], v[1], v[2]}, v[3]); // exporters write 0 0 0 0, too
    } else if (name == "lookat") {
        const auto v = values(9);
        out = look_at({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8]});
    } else if (name == "skew") {
        fail(element, "a skew, which is not read; apply the transforms and export again");
    }
    return out;
}

// ---- the scene ----

class SceneReader {
public:
    explicit SceneReader(const Document& document) : document_(document) { out_.place_word = "line"; }

    Polygons read() {
        note_frame();
        const xml_node instance = document_.root().child("scene").child("instance_visual_scene");
        if (!instance) fail(document_.root(), "no scene that says what is to be seen");
        todo_.push_back({document_.target(instance, "url", "visual_scene"), {}, 0});
        while (!todo_.empty()) { // no recursion: files may nest deeply
            checkpoint();
            const Item item = todo_.back();
            todo_.pop_back();
            if (++visited_ > kMostNodes) fail(item.node, "more than 10 million nodes");
            visit(item);
        }
        note_left_out(out_, left_out_);
        if (deformed_ > 0)
            out_.notes.push_back(std::to_string(deformed_) +
                                 " skinned or morphed meshes are taken at their nodes, in their base shape");
        return std::move(out_);
    }

private:
    struct Item {
        xml_node node;
        Affine to_scene; // of its parent
        size_t references = 0;
    };

    void note_frame() {
        const xml_node asset = document_.root().child("asset"), unit = asset.child("unit");
        const double metres = unit.attribute("meter").as_double(1);
        const std::string_view axis = asset.child("up_axis").child_value();
        const char up = axis == "X_UP" ? 'x' : axis == "Z_UP" ? 'z' : 'y';
        char words[200];
        std::snprintf(words, sizeof words, "states a unit of %.6g m, and %c up: the axes are kept", metres, up);
        out_.notes.emplace_back(words);
        out_.unit_is_ignored = metres != 1;
    }

    void visit(const Item& item) {
        Affine to_scene = item.to_scene;
        const size_t first = todo_.size();
        for (const xml_node& child : item.node) {
            if (item.node.name() == std::string_view("node")) to_scene = to_scene * transform_of(child);
            const std::string_view name = child.name();
            if (name == "node") {
                todo_.push_back({child, to_scene, item.references});
            } else if (name == "instance_node") {
                if (item.references == kMostReferences) fail(child, "nodes that hold each other in a circle");
                todo_.push_back({document_.target(child, "url", "node"), to_scene, item.references + 1});
            } else if (name == "instance_geometry") {
                add(document_.target(child, "url", "geometry"), to_scene);
            } else if (name == "instance_controller") {
                ++deformed_;
                add(geometry_of(document_.target(child, "url", "controller")), to_scene);
            }
        }
        std::reverse(todo_.begin() + static_cast<ptrdiff_t>(first), todo_.end()); // in the file's order
    }

    // What a skin or morph deforms; that may be another one.
    xml_node geometry_of(xml_node controller) const {
        for (size_t i = 0; i < kMostReferences; ++i) {
            const xml_node skin = controller.child("skin"), by = skin ? skin : controller.child("morph");
            if (!document_.has_target(by, "source", "controller")) return document_.target(by, "source", "geometry");
            controller = document_.target(by, "source", "controller");
        }
        fail(controller, "controllers that hold each other in a circle");
    }

    void add(const xml_node& geometry, const Affine& transform) {
        const Shape& shape = shape_of(geometry);
        left_out_ += shape.left_out;
        if (shape.sizes.empty()) return;
        if (!out_.can_hold(shape.points.size())) fail(geometry, "too many vertices (2^32 or more)");
        const auto base = static_cast<uint32_t>(out_.points.size());
        const bool mirrors = transform.mirrors();
        Checkpoints checkpoint;
        for (const Point& p : shape.points) checkpoint(), out_.points.push_back(transform(p));
        auto corner = shape.corners.begin();
        for (size_t f = 0; f < shape.sizes.size(); ++f) {
            checkpoint();
            out_.begin_face(shape.lines[f]);
            for (uint32_t i = 0; i < shape.sizes[f]; ++i) out_.add_corner(base + *corner++);
            if (mirrors) out_.turn_last_face();
        }
    }

    const Shape& shape_of(const xml_node& geometry) {
        const auto [entry, is_new] = shapes_.try_emplace(geometry.internal_object());
        if (!is_new) return entry->second;
        for (const xml_node& kind : geometry) {
            const std::string_view name = kind.name();
            if (name == "brep") fail(kind, "a boundary representation, which is not read; export it as triangles");
            if (kind.attribute("convex_hull_of"))
                fail(kind, "a convex hull of another mesh, which is not read; export it as triangles");
            if (name == "mesh" || name == "convex_mesh") read_mesh(document_, kind, entry->second);
            if (name == "spline") ++entry->second.left_out;
        }
        return entry->second;
    }

    const Document& document_;
    std::unordered_map<const void*, Shape> shapes_; // of geometries
    std::vector<Item> todo_;
    size_t visited_ = 0;
    uint64_t left_out_ = 0, deformed_ = 0;
    Polygons out_;
};

} // namespace
} // namespace collada

Result<Polygons> read_collada(std::string_view bytes, std::string& detail) {
    std::optional<collada::Document> document;
    try {
        document.emplace(bytes);
        return collada::SceneReader(*document).read();
    } catch (const collada::Failure& failure) {
        if (failure.place) {
            detail = "line " + std::to_string(document->line_of(failure.place)) + ", <" + failure.place.name() + ">";
            return Error{ErrorCode::bad_file, failure.what};
        }
        detail = failure.what;
        return Error{ErrorCode::bad_file, "cannot be read as COLLADA"};
    }
}

} // namespace prolate

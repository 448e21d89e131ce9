// Reader of DAE (COLLADA 1.4 and 1.5) over pugixml, in double precision: the meshes of the visual scene, with their
// nodes' transforms. (Khronos, COLLADA - Digital Asset Schema Release 1.4.1 and 1.5.0 Specification.)
//
// The file is not trusted: every reference must lead to one element, every accessor must stay within its array, every
// list must be as long as its counts say. What would be a surface and cannot be read (holes, references into other
// files, skewed nodes, boundary representations) is refused.
//
// Coordinates stay as the file has them: unit and up axis are noted, not applied. Known limit, which is noted: skins
// and morph targets are not applied.
#include "builder/text.hpp"

#include <pugixml.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <unordered_map>
#include <utility>

namespace prolate {
namespace {

using pugi::xml_node;

constexpr size_t kMostReferences = 100; // of nodes to nodes, one below the other: more is a circle
constexpr size_t kMostNodes = 10'000'000;
constexpr uint64_t kMostInputs = 1000; // offsets within a corner's indices

struct Failure {
    const char* what;
    xml_node place;
};

[[noreturn]] void fail(const xml_node& place, const char* what) {
    throw Failure{what, place};
}

// The text of an element that holds nothing else.
std::string text_of(const xml_node& element) {
    std::string out;
    for (const xml_node& part : element) {
        if (part.type() != pugi::node_pcdata && part.type() != pugi::node_cdata)
            fail(element, "a list with other elements inside");
        out += part.value();
    }
    return out;
}

template <class T> std::vector<T> numbers_of(const xml_node& list, const char* what_else) {
    constexpr std::string_view kBlanks = " \t\r\n";
    const std::string text = text_of(list);
    std::vector<T> out;
    Checkpoints checkpoint;
    for (size_t begin = text.find_first_not_of(kBlanks); begin != text.npos;) {
        checkpoint();
        const size_t end = std::min(text.find_first_of(kBlanks, begin), text.size());
        const auto value = number<T>(std::string_view(text).substr(begin, end - begin));
        if (!value) fail(list, what_else);
        out.push_back(*value);
        begin = text.find_first_not_of(kBlanks, end);
    }
    return out;
}

uint64_t count_of(const xml_node& element, const char* attribute, std::optional<uint64_t> otherwise = {}) {
    const pugi::xml_attribute found = element.attribute(attribute);
    const auto value = found ? number<uint64_t>(found.value()) : otherwise;
    if (!value) fail(element, "a count that is missing, or no number");
    return *value;
}

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
        if (out.size() != count) fail(element, "a transform of another number of numbers than it needs");
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

// ---- meshes ----

/// A geometry in its own frame. Corners count its own points.
struct Shape {
    std::vector<Point> points;
    std::vector<uint32_t> corners, sizes;
    std::vector<uint64_t> lines; // where each face stands in the file
    uint64_t left_out = 0;
};

class Document {
public:
    explicit Document(std::string_view bytes) {
        for (size_t at = bytes.find('\n'); at != bytes.npos; at = bytes.find('\n', at + 1))
            line_ends_.push_back(static_cast<ptrdiff_t>(at));
        checkpoint();
        // The bytes are taken as they are, so that places in the document are places in the file.
        const auto parsed = document_.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8);
        if (!parsed) throw Failure{parsed.description(), {}};
        root_ = document_.child("COLLADA");
        if (!root_) throw Failure{"no COLLADA document", {}};
        checkpoint();
        index();
    }

    xml_node root() const { return root_; }

    uint64_t line_of(const xml_node& node) const {
        const auto before = std::lower_bound(line_ends_.begin(), line_ends_.end(), node.offset_debug());
        return static_cast<uint64_t>(before - line_ends_.begin()) + 1;
    }

    /// Does the file hold an element of this name that the attribute refers to?
    bool has_target(const xml_node& from, const char* attribute, const char* name) const {
        return by_id_.contains(name + std::string(from.attribute(attribute).value()));
    }
    /// That element.
    xml_node target(const xml_node& from, const char* attribute, const char* name) const {
        const std::string_view url = from.attribute(attribute).value();
        if (!url.empty() && !url.starts_with('#'))
            fail(from, "a part in another file, which is not read; put all into one");
        const auto found = by_id_.find(name + std::string(url));
        if (found == by_id_.end()) fail(from, "a reference to what does not exist");
        if (!found->second) fail(from, "a reference to an id that several elements have");
        return found->second;
    }

private:
    void index() {
        for (xml_node at = root_; at;) {
            checkpoint();
            if (const auto id = at.attribute("id")) {
                const auto [entry, is_new] = by_id_.emplace(std::string(at.name()) + '#' + id.value(), at);
                if (!is_new) entry->second = {};
            }
            if (at.first_child()) {
                at = at.first_child();
                continue;
            }
            while (at && at != root_ && !at.next_sibling()) at = at.parent();
            at = at == root_ ? xml_node() : at.next_sibling();
        }
    }

    std::vector<ptrdiff_t> line_ends_;
    pugi::xml_document document_;
    xml_node root_;
    std::unordered_map<std::string, xml_node> by_id_; // "name#id"; null: several have it
};

// Reads the primitives of one mesh.
class ShapeReader {
public:
    ShapeReader(const Document& document, Shape& out) : document_(document), out_(out) {}

    void read(const xml_node& mesh) {
        for (const xml_node& element : mesh) {
            const std::string_view kind = element.name();
            if (kind == "lines" || kind == "linestrips")
                out_.left_out += count_of(element, "count", 0);
            else if (kind == "triangles" || kind == "polylist" || kind == "polygons" || kind == "tristrips" ||
                     kind == "trifans")
                read_primitives(element, kind);
        }
    }

private:
    void read_primitives(const xml_node& element, std::string_view kind) {
        line_ = document_.line_of(element);
        take_inputs(element);
        if (element.child("ph")) fail(element, "polygons with holes (<ph>), which are not read; export triangles");
        std::vector<uint32_t> all;
        for (const xml_node& list : element.children("p")) {
            const std::vector<uint32_t> corners = corners_of(list);
            if (kind == "polygons")
                add_face(corners);
            else if (kind == "tristrips" || kind == "trifans")
                add_strip(corners, kind == "trifans");
            else
                all.insert(all.end(), corners.begin(), corners.end());
        }
        if (kind == "triangles") {
            const uint64_t count = count_of(element, "count");
            if (all.size() % 3 != 0 || all.size() / 3 != count)
                fail(element, "triangles of another number than it states");
            for (size_t i = 0; i < all.size(); i += 3) add_face(std::span(all).subspan(i, 3));
        } else if (kind == "polylist") {
            add_polygons(element, all);
        }
    }

    // Where a corner's indices have that of its position, and what it counts.
    void take_inputs(const xml_node& element) {
        xml_node vertices;
        width_ = 1;
        for (const xml_node& input : element.children("input")) {
            const uint64_t offset = count_of(input, "offset", 0);
            if (offset >= kMostInputs) fail(input, "an offset that makes no sense");
            width_ = std::max(width_, static_cast<size_t>(offset) + 1);
            if (std::string_view(input.attribute("semantic").value()) != "VERTEX") continue;
            vertices = document_.target(input, "source", "vertices");
            offset_ = static_cast<size_t>(offset);
        }
        if (!vertices) fail(element, "a surface without vertices");
        const auto known = std::find_if(bases_.begin(), bases_.end(),
                                        [&vertices](const Base& base) { return base.vertices == vertices; });
        if (known != bases_.end()) {
            base_ = *known;
            return;
        }
        const std::vector<Point> points = positions(vertices);
        if (points.size() + out_.points.size() > std::numeric_limits<uint32_t>::max())
            fail(vertices, "too many vertices (2^32 or more)");
        base_ = {vertices, out_.points.size(), points.size()};
        bases_.push_back(base_);
        out_.points.insert(out_.points.end(), points.begin(), points.end());
    }

    std::vector<Point> positions(const xml_node& vertices) const {
        xml_node source;
        for (const xml_node& input : vertices.children("input"))
            if (std::string_view(input.attribute("semantic").value()) == "POSITION")
                source = document_.target(input, "source", "source");
        if (!source) fail(vertices, "vertices without positions");
        const xml_node accessor = source.child("technique_common").child("accessor");
        if (!accessor) fail(source, "a source without an accessor");
        const xml_node array = document_.target(accessor, "source", "float_array");
        const std::vector<double> numbers = numbers_of<double>(array, "coordinates that are not numbers");
        if (numbers.size() != count_of(array, "count")) fail(array, "an array of another length than it states");

        std::array<std::optional<uint64_t>, 3> place; // of x, y and z in a row
        uint64_t params = 0;
        for (const xml_node& param : accessor.children("param")) {
            const std::string_view name = param.attribute("name").value();
            if (name.size() == 1 && name[0] >= 'X' && name[0] <= 'Z')
                place[static_cast<size_t>(name[0] - 'X')] = params;
            ++params;
        }
        if (!place[0] || !place[1] || !place[2]) fail(accessor, "positions without X, Y and Z");
        const uint64_t last = std::max({*place[0], *place[1], *place[2]}), count = count_of(accessor, "count"),
                       stride = count_of(accessor, "stride", 1), offset = count_of(accessor, "offset", 0);
        // In this order, so that nothing overflows.
        if (last >= stride || (count > 0 && (offset > numbers.size() || last >= numbers.size() - offset ||
                                             count - 1 > (numbers.size() - offset - last - 1) / stride)))
            fail(accessor, "an accessor that reaches beyond its array");
        std::vector<Point> out(count);
        for (size_t i = 0; i < count; ++i)
            for (size_t k = 0; k < 3; ++k) out[i][k] = numbers[offset + i * stride + *place[k]];
        return out;
    }

    std::vector<uint32_t> corners_of(const xml_node& list) const {
        const auto indices = numbers_of<uint64_t>(list, "indices that are not numbers");
        if (indices.size() % width_ != 0) fail(list, "a list of indices that ends within a corner");
        std::vector<uint32_t> out;
        out.reserve(indices.size() / width_);
        for (size_t i = offset_; i < indices.size(); i += width_) {
            if (indices[i] >= base_.count) fail(list, "a face names a vertex that does not exist");
            out.push_back(static_cast<uint32_t>(base_.first + indices[i]));
        }
        return out;
    }

    void add_polygons(const xml_node& element, std::span<const uint32_t> corners) {
        const auto sizes = numbers_of<uint32_t>(element.child("vcount"), "indices that are not numbers");
        if (sizes.size() != count_of(element, "count")) fail(element, "polygons of another number than it states");
        for (const uint32_t size : sizes) {
            if (size > corners.size()) fail(element, "a polygon without its corners (is the file cut short?)");
            add_face(corners.first(size));
            corners = corners.subspan(size);
        }
        if (!corners.empty()) fail(element, "corners that no polygon has");
    }
    void add_face(std::span<const uint32_t> corners) {
        checkpoint_();
        if (corners.size() < 3) {
            ++out_.left_out;
            return;
        }
        out_.sizes.push_back(static_cast<uint32_t>(corners.size()));
        out_.lines.push_back(line_);
        out_.corners.insert(out_.corners.end(), corners.begin(), corners.end());
    }
    void add_strip(std::span<const uint32_t> corners, bool is_fan) {
        for (size_t i = 2; i < corners.size(); ++i) {
            const bool odd = !is_fan && i % 2 == 1; // every second triangle of a strip runs the other way
            const uint32_t face[] = {corners[is_fan ? 0 : i - 2], corners[odd ? i : i - 1], corners[odd ? i - 1 : i]};
            add_face(face);
        }
    }

    struct Base {
        xml_node vertices;
        size_t first = 0, count = 0; // of the shape's points
    };

    const Document& document_;
    Shape& out_;
    std::vector<Base> bases_;
    Base base_;
    size_t width_ = 1, offset_ = 0;
    uint64_t line_ = 0;
    Checkpoints checkpoint_;
};

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
            if (name == "mesh" || name == "convex_mesh") ShapeReader(document_, entry->second).read(kind);
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

Result<Polygons> read_collada(std::string_view bytes, std::string& detail) {
    std::optional<Document> document;
    try {
        document.emplace(bytes);
        return SceneReader(*document).read();
    } catch (const Failure& failure) {
        if (failure.place) {
            detail = "line " + std::to_string(document->line_of(failure.place)) + ", <" + failure.place.name() + ">";
            return Error{ErrorCode::bad_file, failure.what};
        }
        detail = failure.what;
        return Error{ErrorCode::bad_file, "cannot be read as COLLADA"};
    }
}

} // namespace prolate

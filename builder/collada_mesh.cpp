#include "builder/collada_mesh.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <span>

namespace prolate::collada {
namespace {

constexpr uint64_t kMostInputs = 1000; // offsets within a corner's indices

class MeshReader {
public:
    MeshReader(const Document& document, Shape& out) : document_(document), out_(out) {}

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
            if (offset >= kMostInputs) fail(input, "an offset out of range");
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

} // namespace

void read_mesh(const Document& document, const xml_node& mesh, Shape& out) {
    MeshReader(document, out).read(mesh);
}

} // namespace prolate::collada

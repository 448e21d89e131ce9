// Readers of OBJ and OFF. Like those of STL and PLY they are simple and strict: every record complete, every index in
// range, every number read in double precision.
//
// What is no surface - lines, points, normals, colours, materials - is left out. What would be a surface and cannot be
// read (free-form ones of OBJ) is refused.
//
// Known limit: a text that is cut inside its very last number is still a sound text. A closed mesh then opens, which
// the diagnosis of clean() shows.
#include "builder/text.hpp"

#include <utility>

namespace prolate {
namespace {

// Wavefront OBJ. Indices are counted from 1, or backwards from the latest vertex if negative.
class Obj {
public:
    Obj(std::string_view bytes, std::string& detail) : detail_(detail), text_(bytes) { out_.place_word = "line"; }

    Result<Polygons> read() {
        do {
            if (const auto read = read_line(); !read) return read.error();
        } while (text_.next_line());
        if (largest_ > out_.points.size()) {
            detail_ = "line " + std::to_string(largest_line_);
            return Error{ErrorCode::bad_file, kBadIndex};
        }
        note_left_out(out_, left_out_);
        if (weighted_ > 0)
            out_.notes.push_back(std::to_string(weighted_) + " vertices have a weight w; x, y, z are divided by it");
        return std::move(out_);
    }

private:
    Result<void> read_line() {
        const std::string_view keyword = text_.word();
        if (keyword == "v") return read_vertex();
        if (keyword == "f" || keyword == "fo") return read_face();
        if (keyword == "l" || keyword == "p" || keyword == "curv") ++left_out_;
        if (keyword == "call") return bad("a part in another file (call); put all into one");
        if (keyword == "surf" || keyword == "bzp" || keyword == "bsp" || keyword == "cdp")
            return bad("a free-form surface; export it as polygons");
        return {};
    }

    Result<void> read_vertex() {
        auto p = three_coordinates(text_);
        if (!p) return bad(kBadVertex);
        // Behind x y z: nothing, a weight w, a colour r g b, or both.
        double more[5] = {};
        size_t count = 0;
        for (auto word = text_.word(); !word.empty() && count < 5; word = text_.word(), ++count) {
            const auto value = number<double>(word);
            if (!value) return bad(kBadVertex);
            more[count] = *value;
        }
        if ((count == 1 || count == 4) && more[0] != 1) {
            if (!std::isfinite(more[0]) || more[0] == 0) return bad("a vertex of weight 0");
            for (double& coordinate : *p) coordinate /= more[0];
            ++weighted_;
        }
        if (!out_.can_hold(1)) return bad(kTooMany);
        out_.points.push_back(*p);
        return {};
    }

    Result<void> read_face() {
        const uint64_t line = text_.line();
        out_.begin_face(line);
        const auto vertices = static_cast<int64_t>(out_.points.size());
        for (auto corner = text_.word(); !corner.empty(); corner = text_.word()) {
            const auto index = number<int64_t>(corner.substr(0, corner.find('/')));
            if (!index) return bad(kBadFace);
            if (*index == 0 || *index < -vertices || *index > int64_t{1} << 32) return bad(kBadIndex);
            const int64_t point = *index > 0 ? *index - 1 : vertices + *index;
            if (static_cast<uint64_t>(point) >= largest_)
                largest_ = static_cast<uint64_t>(point) + 1, largest_line_ = line;
            out_.add_corner(static_cast<uint32_t>(point));
        }
        if (out_.sizes.back() < 3) return bad(kBadFace);
        return {};
    }

    Error bad(const char* what) { return bad_line(text_, what, detail_); }

    std::string& detail_;
    Text text_;
    Polygons out_;
    uint64_t largest_ = 0, largest_line_ = 0; // the vertex furthest behind that a face names, from 1, and who does
    uint64_t left_out_ = 0, weighted_ = 0;
};

} // namespace

Result<Polygons> read_obj(std::string_view bytes, std::string& detail) {
    return Obj(bytes, detail).read();
}

// Object File Format: "OFF", counts, one vertex a line, one face a line.
Result<Polygons> read_off(std::string_view bytes, std::string& detail) {
    Text text(bytes);
    Polygons out;
    out.place_word = "line";
    std::string_view word = text.first_word();
    if (!word.ends_with("OFF")) return bad_line(text, "not an OFF file", detail);
    if (word.find_first_of("4n") != word.npos) return bad_line(text, "OFF with other than three coordinates", detail);
    word = text.first_word();
    const auto vertices = number<uint32_t>(word), faces = number<uint32_t>(text.word());
    if (!vertices || !faces) return bad_line(text, "a text OFF file without its counts", detail);
    for (uint32_t i = 0; i < *vertices; ++i) {
        text.next_line();
        Point p{};
        for (size_t k = 0; k < 3; ++k) {
            const auto value = number<double>(k == 0 ? text.first_word() : text.word());
            if (!value || !std::isfinite(*value)) return bad_line(text, kBadVertex, detail);
            p[k] = *value;
        }
        out.points.push_back(p);
    }
    uint64_t left_out = 0;
    for (uint32_t i = 0; i < *faces; ++i) {
        text.next_line();
        const auto corners = number<uint32_t>(text.first_word());
        if (!corners || *corners == 0) return bad_line(text, kBadFace, detail);
        if (*corners >= 3)
            out.begin_face(text.line());
        else
            ++left_out;
        for (uint32_t c = 0; c < *corners; ++c) {
            const auto index = number<uint64_t>(text.word());
            if (!index) return bad_line(text, kBadFace, detail);
            if (*index >= *vertices) return bad_line(text, kBadIndex, detail);
            if (*corners >= 3) out.add_corner(static_cast<uint32_t>(*index));
        }
    }
    note_left_out(out, left_out);
    return out;
}

} // namespace prolate

// Readers of OBJ, OFF, STL and PLY, which are simple and strict: every record complete, every index in range, every
// number read in double precision. (Assimp 5.2 reads floats, drops ears of concave polygons, and silently accepts a
// shortened OBJ or OFF and some shortened PLY and STL texts: half of a solid, uncovered.)
//
// What is no surface - lines, points, normals, colours, materials - is left out. What would be a surface and cannot be
// read (free-form ones of OBJ) is refused.
//
// Known limit: a text that is cut inside its very last number is still a sound text. A closed mesh then opens, which
// the diagnosis of clean() shows.
#include "builder/polygons.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

namespace prolate {
namespace {

// Lines and words of a text. A backslash at a line's end joins the next one (OBJ), '#' begins a comment.
class Text {
public:
    explicit Text(std::string_view bytes, size_t start = 0) : bytes_(bytes), at_(start) {}

    // The next word of this line, or "" at its end.
    std::string_view word() {
        for (;;) {
            while (at_ < bytes_.size() && is_blank(bytes_[at_])) ++at_;
            if (at_ >= bytes_.size() || bytes_[at_] != '\\') break;
            size_t next = at_ + 1;
            if (next < bytes_.size() && bytes_[next] == '\r') ++next;
            if (next >= bytes_.size() || bytes_[next] != '\n') break;
            at_ = next + 1;
            ++line_;
        }
        word_at_ = at_;
        if (at_ < bytes_.size() && bytes_[at_] == '#') return {};
        while (at_ < bytes_.size() && !is_blank(bytes_[at_]) && !is_line_end(bytes_[at_])) ++at_;
        return bytes_.substr(word_at_, at_ - word_at_);
    }
    // Goes to the start of the next line; false at the end of the text.
    bool next_line() {
        while (at_ < bytes_.size() && !is_line_end(bytes_[at_])) ++at_;
        if (at_ < bytes_.size()) {
            if (bytes_[at_] == '\r' && at_ + 1 < bytes_.size() && bytes_[at_ + 1] == '\n') ++at_;
            ++at_, ++line_;
        }
        return at_ < bytes_.size();
    }
    // The first word of the next line that has one; "" at the end of the text.
    std::string_view first_word() {
        for (;;) {
            if (const auto found = word(); !found.empty()) return found;
            if (!next_line()) return {};
        }
    }
    size_t word_at() const { return std::min(word_at_, bytes_.size()); }
    size_t at() const { return at_; }
    uint64_t line() const { return line_; } // counted from 1

private:
    static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
    static bool is_line_end(char c) { return c == '\n' || c == '\r'; }
    std::string_view bytes_;
    size_t at_ = 0, word_at_ = 0;
    uint64_t line_ = 1;
};

template <class T> std::optional<T> number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) return {};
    return value;
}

std::optional<Point> three_coordinates(Text& text) {
    Point p{};
    for (double& coordinate : p) {
        const auto value = number<double>(text.word());
        if (!value || !std::isfinite(*value)) return {};
        coordinate = *value;
    }
    return p;
}

// An error in the line that `text` is at.
Error bad_line(const Text& text, const char* what, std::string& detail) {
    detail = "line " + std::to_string(text.line());
    return {ErrorCode::bad_file, what, text.word_at()};
}

constexpr const char* kBadVertex = "a vertex without three finite numbers (is the file cut short?)";
constexpr const char* kBadFace = "a face without its corners (is the file cut short?)";
constexpr const char* kBadIndex = "a face names a vertex that does not exist";
constexpr const char* kTooShort = "the file is cut short";

constexpr const char* kTooMany = "too many vertices or corners (2^32 or more)";

// "3 lines and points are left out"
void note_left_out(Polygons& out, uint64_t count) {
    if (count > 0) out.notes.push_back(std::to_string(count) + " lines or points are left out");
}

// Wavefront OBJ. Indices are counted from 1, or backwards from the latest vertex if negative.
Result<Polygons> read_obj(std::string_view bytes, std::string& detail) {
    Text text(bytes);
    Polygons out;
    out.place_word = "line";
    uint64_t largest = 0, largest_line = 0, left_out = 0, weighted = 0;
    do {
        const std::string_view keyword = text.word();
        const uint64_t line = text.line();
        if (keyword == "v") {
            auto p = three_coordinates(text);
            if (!p) return bad_line(text, kBadVertex, detail);
            // Behind x y z: nothing, a weight w, a colour r g b, or both.
            double more[5] = {};
            size_t count = 0;
            for (auto word = text.word(); !word.empty() && count < 5; word = text.word(), ++count) {
                const auto value = number<double>(word);
                if (!value) return bad_line(text, kBadVertex, detail);
                more[count] = *value;
            }
            if ((count == 1 || count == 4) && more[0] != 1) {
                if (!std::isfinite(more[0]) || more[0] == 0) return bad_line(text, "a vertex of weight 0", detail);
                for (double& coordinate : *p) coordinate /= more[0];
                ++weighted;
            }
            if (!out.can_hold(1)) return bad_line(text, kTooMany, detail);
            out.points.push_back(*p);
        } else if (keyword == "f" || keyword == "fo") {
            out.begin_face(line);
            const auto vertices = static_cast<int64_t>(out.points.size());
            for (auto corner = text.word(); !corner.empty(); corner = text.word()) {
                const auto index = number<int64_t>(corner.substr(0, corner.find('/')));
                if (!index) return bad_line(text, kBadFace, detail);
                if (*index == 0 || *index < -vertices || *index > int64_t{1} << 32)
                    return bad_line(text, kBadIndex, detail);
                const int64_t point = *index > 0 ? *index - 1 : vertices + *index;
                if (static_cast<uint64_t>(point) >= largest)
                    largest = static_cast<uint64_t>(point) + 1, largest_line = line;
                out.add_corner(static_cast<uint32_t>(point));
            }
            if (out.sizes.back() < 3) return bad_line(text, kBadFace, detail);
        } else if (keyword == "l" || keyword == "p" || keyword == "curv") {
            ++left_out;
        } else if (keyword == "surf" || keyword == "bzp" || keyword == "bsp" || keyword == "cdp" || keyword == "call") {
            return bad_line(text,
                            keyword == "call" ? "a part in another file (call); put all into one"
                                              : "a free-form surface; export it as polygons",
                            detail);
        }
    } while (text.next_line());
    if (largest > out.points.size()) {
        detail = "line " + std::to_string(largest_line);
        return Error{ErrorCode::bad_file, kBadIndex};
    }
    note_left_out(out, left_out);
    if (weighted > 0)
        out.notes.push_back(std::to_string(weighted) + " vertices have a weight w; x, y, z are divided by it");
    return out;
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

uint32_t little_endian(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
}

// STL: binary if the size says so, else text, which must come to its "endsolid".
Result<Polygons> read_stl(std::string_view bytes, std::string& detail) {
    Polygons out;
    constexpr size_t kHeader = 84, kRecord = 50;
    if (bytes.size() >= kHeader && bytes.size() == kHeader + kRecord * uint64_t{little_endian(bytes, kHeader - 4)}) {
        if (!out.can_hold((bytes.size() - kHeader) / kRecord * 3)) return Error{ErrorCode::bad_file, kTooMany};
        for (size_t at = kHeader; at < bytes.size(); at += kRecord) {
            out.begin_face(out.sizes.size() + 1);
            for (size_t c = 0; c < 3; ++c) { // behind the normal
                Point p;
                for (size_t k = 0; k < 3; ++k)
                    p[k] = double{std::bit_cast<float>(little_endian(bytes, at + 12 * (c + 1) + 4 * k))};
                out.add_corner(static_cast<uint32_t>(out.points.size()));
                out.points.push_back(p);
            }
        }
        out.place_word = "triangle";
        return out;
    }
    Text text(bytes);
    if (text.first_word() != "solid")
        return Error{ErrorCode::bad_file, "neither a text STL nor a binary one of the size it states", bytes.size()};
    out.place_word = "line";
    bool ended = false, in_facet = false;
    while (text.next_line()) {
        const std::string_view keyword = text.word();
        if (keyword.empty()) continue;
        ended = keyword == "endsolid";
        if (keyword == "facet") {
            if (in_facet) return bad_line(text, kTooShort, detail);
            in_facet = true;
            out.begin_face(text.line());
        } else if (keyword == "endfacet") {
            if (!in_facet || out.sizes.back() != 3) return bad_line(text, "a facet without its three corners", detail);
            in_facet = false;
        } else if (keyword == "vertex") {
            const auto p = three_coordinates(text);
            if (!p || !in_facet) return bad_line(text, kBadVertex, detail);
            if (!out.can_hold(1)) return bad_line(text, kTooMany, detail);
            out.add_corner(static_cast<uint32_t>(out.points.size()));
            out.points.push_back(*p);
        }
    }
    if (!ended || in_facet) return bad_line(text, kTooShort, detail);
    return out;
}

// PLY: a header that declares elements and their properties, then the values, as text or binary.
class Ply {
public:
    Ply(std::string_view bytes, std::string& detail) : bytes_(bytes), detail_(detail), text_(bytes) {}

    Result<Polygons> read() {
        if (text_.word() != "ply") return bad_line(text_, "not a PLY file", detail_);
        if (!read_header()) return bad_line(text_, "a PLY header that cannot be read", detail_);
        for (const Element& element : elements_) {
            if (element.name == "vertex") vertices_ = element.count;
            if (element.properties.empty() && element.count > 0) // or a tiny file could ask for endless work
                return bad_line(text_, "a PLY element without properties", detail_);
        }
        for (const Element& element : elements_) {
            const auto has = [&](Role role) {
                return std::any_of(element.properties.begin(), element.properties.end(),
                                   [role](const Property& p) { return p.role == role; });
            };
            if (element.name == "vertex" && element.count > 0 && !(has(Role::x) && has(Role::y) && has(Role::z)))
                return bad_line(text_, "PLY vertices without x, y and z", detail_);
        }
        out_.place_word = is_text_ ? "line" : "face";
        for (const Element& element : elements_)
            for (uint64_t i = 0; i < element.count; ++i)
                if (const auto read = read_one(element, i); !read) return read.error();
        note_left_out(out_, left_out_);
        return std::move(out_);
    }

private:
    struct Type {
        size_t size;
        char kind; // 'i'nt, 'u'nsigned, 'f'loat
    };
    enum class Role { none, x, y, z, face, strips };
    struct Property {
        std::optional<Type> length; // of a list
        Type value;
        Role role;
    };
    struct Element {
        std::string_view name;
        uint64_t count;
        std::vector<Property> properties;
    };

    static std::optional<Type> type(std::string_view name) {
        static constexpr std::pair<std::string_view, Type> kTypes[] = {
            {"char", {1, 'i'}},  {"int8", {1, 'i'}},    {"uchar", {1, 'u'}},  {"uint8", {1, 'u'}},
            {"short", {2, 'i'}}, {"int16", {2, 'i'}},   {"ushort", {2, 'u'}}, {"uint16", {2, 'u'}},
            {"int", {4, 'i'}},   {"int32", {4, 'i'}},   {"uint", {4, 'u'}},   {"uint32", {4, 'u'}},
            {"float", {4, 'f'}}, {"float32", {4, 'f'}}, {"double", {8, 'f'}}, {"float64", {8, 'f'}}};
        for (const auto& [known, meaning] : kTypes)
            if (known == name) return meaning;
        return {};
    }

    static Role role(std::string_view element, bool is_list, std::string_view name) {
        if (element == "vertex" && !is_list)
            return name == "x" ? Role::x : name == "y" ? Role::y : name == "z" ? Role::z : Role::none;
        if (!is_list || (name != "vertex_index" && name != "vertex_indices")) return Role::none;
        return element == "face" ? Role::face : element == "tristrips" ? Role::strips : Role::none;
    }

    bool read_header() {
        bool has_format = false;
        while (text_.next_line()) {
            const std::string_view keyword = text_.word();
            if (keyword == "format") {
                const std::string_view format = text_.word();
                is_text_ = format == "ascii";
                is_big_endian_ = format == "binary_big_endian";
                has_format = is_text_ || is_big_endian_ || format == "binary_little_endian";
            } else if (keyword == "element") {
                const std::string_view name = text_.word();
                const auto count = number<uint32_t>(text_.word());
                if (!count) return false;
                elements_.push_back({name, *count, {}});
            } else if (keyword == "property") {
                if (elements_.empty()) return false;
                std::string_view word = text_.word();
                Property property{};
                if (word == "list") {
                    property.length = type(text_.word());
                    if (!property.length || property.length->kind == 'f') return false;
                    word = text_.word();
                }
                const auto value = type(word);
                if (!value) return false;
                property.value = *value;
                const std::string_view name = text_.word();
                property.role = role(elements_.back().name, property.length.has_value(), name);
                elements_.back().properties.push_back(property);
            } else if (keyword == "end_header") {
                // The values begin after one line end; Windows writes two bytes for it.
                const std::string_view rest = bytes_.substr(text_.at());
                data_ = text_.at() + (rest.starts_with("\r\n") ? 2 : 1);
                return has_format;
            }
        }
        return false;
    }

    Result<void> read_one(const Element& element, uint64_t number) {
        if (is_text_) { // one element a line: what writers do
            text_.next_line();
            pending_ = text_.first_word();
        }
        const uint64_t place = is_text_ ? text_.line() : number + 1;
        const bool is_vertex = element.name == "vertex";
        Point point{};
        for (const Property& property : element.properties) {
            if (!property.length) {
                const auto read = value(property.value);
                if (!read) return bad(kTooShort);
                if (property.role == Role::none) continue;
                if (!std::isfinite(*read)) return bad(kBadVertex);
                point[static_cast<size_t>(property.role) - static_cast<size_t>(Role::x)] = *read;
                continue;
            }
            const auto length = value(*property.length);
            constexpr double kMostEntries = 1e9; // no list is longer; more is damage
            if (!length || !(*length >= 0 && *length <= kMostEntries)) return bad(kTooShort);
            const auto entries = static_cast<uint64_t>(std::ceil(*length));
            if (property.role == Role::face && entries < 1) return bad(kBadFace);
            list_.clear();
            for (uint64_t i = 0; i < entries; ++i) {
                const auto index = value(property.value);
                if (!index) return bad(kTooShort);
                if (property.role == Role::none) continue;
                const bool is_restart = property.role == Role::strips && *index == -1;
                if (!is_restart && !(*index >= 0 && *index < static_cast<double>(vertices_))) return bad(kBadIndex);
                list_.push_back(is_restart ? kRestart : static_cast<uint32_t>(*index));
            }
            if (property.role == Role::face) add_face(place);
            if (property.role == Role::strips) add_strips(place);
        }
        if (is_vertex) out_.points.push_back(point);
        return {};
    }

    void add_face(uint64_t place) {
        if (list_.size() < 3) {
            ++left_out_;
            return;
        }
        out_.begin_face(place);
        for (const uint32_t corner : list_) out_.add_corner(corner);
    }
    // Triangle strips, one after the other; every second triangle runs the other way.
    void add_strips(uint64_t place) {
        size_t begin = 0;
        for (size_t i = 0; i < list_.size(); ++i) {
            if (list_[i] == kRestart) begin = i + 1;
            if (i < begin + 2 || list_[i] == kRestart) continue;
            out_.begin_face(place);
            const bool odd = (i - begin) % 2 == 1;
            for (const size_t j : {i - 2, odd ? i : i - 1, odd ? i - 1 : i}) out_.add_corner(list_[j]);
        }
    }

    Error bad(const char* what) {
        return is_text_ ? bad_line(text_, what, detail_) : Error{ErrorCode::bad_file, what, data_};
    }

    // The next value; every PLY integer fits into a double.
    std::optional<double> value(Type type) {
        if (is_text_) {
            const std::string_view word = pending_.empty() ? text_.word() : std::exchange(pending_, {});
            return number<double>(word);
        }
        if (data_ > bytes_.size() || bytes_.size() - data_ < type.size) return {};
        std::array<unsigned char, 8> raw{};
        std::memcpy(raw.data(), bytes_.data() + data_, type.size);
        data_ += type.size;
        if (is_big_endian_) std::reverse(raw.begin(), raw.begin() + static_cast<ptrdiff_t>(type.size));
        uint64_t bits = 0;
        for (size_t i = type.size; i-- > 0;) bits = bits << 8 | raw[i];
        if (type.kind == 'f')
            return type.size == 8 ? std::bit_cast<double>(bits)
                                  : double{std::bit_cast<float>(static_cast<uint32_t>(bits))};
        auto integer = static_cast<int64_t>(bits);
        const int64_t range = int64_t{1} << (8 * type.size);
        if (type.kind == 'i' && integer >= range / 2) integer -= range;
        return static_cast<double>(integer);
    }

    static constexpr uint32_t kRestart = 0xffffffff; // of a strip

    std::string_view bytes_;
    std::string& detail_;
    Text text_;
    std::vector<Element> elements_;
    std::string_view pending_; // first word of a text line, already taken
    size_t data_ = 0;          // next binary value
    uint64_t vertices_ = 0, left_out_ = 0;
    std::vector<uint32_t> list_;
    Polygons out_;
    bool is_text_ = false, is_big_endian_ = false;
};

} // namespace

Result<Polygons> read_text_or_binary(std::string_view type, std::string_view bytes, std::string& detail) {
    if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3); // the mark of UTF-8
    if (type == ".obj") return read_obj(bytes, detail);
    if (type == ".off") return read_off(bytes, detail);
    if (type == ".stl") return read_stl(bytes, detail);
    return Ply(bytes, detail).read();
}

} // namespace prolate

// Checks of mesh files before Assimp reads them.
//
// Tried with every prefix of a small file in each format, Assimp 5.2 refuses a shortened binary STL, glTF, GLB, 3DS and
// DAE. But it silently accepts a shortened OBJ or OFF and some shortened PLY and STL texts, moves OFF indices that are
// out of range to the nearest vertex, aborts on a face of no corners, and loops for ever on some shortened PLY. So
// those four are scanned here: every record complete, every index in range, and the faces counted, so that the caller
// can tell whether the reader dropped one.
//
// Known limit: a text that is cut inside its very last number is still a sound text. A closed mesh then opens, which
// the diagnosis of clean() shows.
#include "builder/import_checks.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <vector>

namespace prolate {
namespace {

using Check = Result<std::optional<uint64_t>>;

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
        }
        word_at_ = at_;
        if (at_ < bytes_.size() && bytes_[at_] == '#') return {};
        while (at_ < bytes_.size() && !is_blank(bytes_[at_]) && !is_line_end(bytes_[at_])) ++at_;
        return bytes_.substr(word_at_, at_ - word_at_);
    }
    // Goes to the start of the next line; false at the end of the text.
    bool next_line() {
        while (at_ < bytes_.size() && !is_line_end(bytes_[at_])) ++at_;
        if (at_ < bytes_.size()) ++at_;
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

private:
    static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
    static bool is_line_end(char c) { return c == '\n' || c == '\r'; }
    std::string_view bytes_;
    size_t at_ = 0, word_at_ = 0;
};

template <class T> std::optional<T> number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) return {};
    return value;
}

bool is_coordinate(std::string_view word) {
    const auto value = number<double>(word);
    return value && std::isfinite(*value);
}

bool three_coordinates(Text& text) {
    for (int i = 0; i < 3; ++i)
        if (!is_coordinate(text.word())) return false;
    return true;
}

// An error at byte `where` of a text, with its line in `detail`.
Error bad_text(std::string_view bytes, const char* what, size_t where, std::string& detail) {
    detail =
        "line " + std::to_string(1 + std::count(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(where), '\n'));
    return {ErrorCode::bad_file, what, where};
}

constexpr const char* kBadVertex = "a vertex without three finite numbers (is the file cut short?)";
constexpr const char* kBadFace = "a face without its corners (is the file cut short?)";
constexpr const char* kBadIndex = "a face names a vertex that does not exist";
constexpr const char* kTooShort = "the file is cut short";

// Wavefront OBJ. Indices are counted from 1, or backwards from the latest vertex if negative.
Check check_obj(std::string_view bytes, std::string& detail) {
    Text text(bytes);
    uint64_t faces = 0;
    int64_t vertices = 0, largest = 0;
    size_t largest_at = 0;
    do {
        const std::string_view keyword = text.word();
        const size_t line_at = text.word_at();
        if (keyword == "v") {
            if (!three_coordinates(text)) return bad_text(bytes, kBadVertex, line_at, detail);
            ++vertices;
        } else if (keyword == "f") {
            int corners = 0;
            for (auto corner = text.word(); !corner.empty(); corner = text.word(), ++corners) {
                const auto index = number<int64_t>(corner.substr(0, corner.find('/')));
                if (!index) return bad_text(bytes, kBadFace, line_at, detail);
                if (*index == 0 || *index < -vertices) return bad_text(bytes, kBadIndex, line_at, detail);
                if (*index > largest) largest = *index, largest_at = line_at;
            }
            if (corners < 3) return bad_text(bytes, kBadFace, line_at, detail);
            ++faces;
        }
    } while (text.next_line());
    if (largest > vertices) return bad_text(bytes, kBadIndex, largest_at, detail);
    return std::optional(faces);
}

// Object File Format: "OFF", counts, one vertex a line, one face a line.
Check check_off(std::string_view bytes, std::string& detail) {
    Text text(bytes);
    std::string_view word = text.first_word();
    if (!word.ends_with("OFF")) return bad_text(bytes, "not an OFF file", 0, detail);
    if (word.find_first_of("4n") != word.npos)
        return bad_text(bytes, "OFF with other than three coordinates", 0, detail);
    word = text.first_word();
    const auto vertices = number<uint32_t>(word), faces = number<uint32_t>(text.word());
    if (!vertices || !faces) return bad_text(bytes, "an OFF file without its counts", text.word_at(), detail);
    for (uint32_t i = 0; i < *vertices; ++i) {
        text.next_line();
        const bool first = is_coordinate(text.first_word());
        const size_t line_at = text.word_at();
        if (!first || !is_coordinate(text.word()) || !is_coordinate(text.word()))
            return bad_text(bytes, kBadVertex, line_at, detail);
    }
    uint64_t counted = 0;
    for (uint32_t i = 0; i < *faces; ++i) {
        text.next_line();
        const auto corners = number<uint32_t>(text.first_word());
        const size_t line_at = text.word_at();
        if (!corners || *corners == 0) return bad_text(bytes, kBadFace, line_at, detail);
        for (uint32_t c = 0; c < *corners; ++c) {
            const auto index = number<uint64_t>(text.word());
            if (!index) return bad_text(bytes, kBadFace, line_at, detail);
            if (*index >= *vertices) return bad_text(bytes, kBadIndex, line_at, detail);
        }
        counted += *corners >= 3;
    }
    return std::optional(counted);
}

// STL: binary if the size says so, else text, which must come to its "endsolid".
Check check_stl(std::string_view bytes, std::string& detail) {
    if (bytes.size() >= 84) {
        uint64_t facets = 0;
        for (size_t i = 4; i-- > 0;) facets = facets << 8 | static_cast<unsigned char>(bytes[80 + i]);
        if (bytes.size() == 84 + 50 * facets) return std::optional(facets);
    }
    Text text(bytes);
    if (text.first_word() != "solid")
        return Error{ErrorCode::bad_file, "neither a text STL nor a binary one of the size it states", bytes.size()};
    uint64_t facets = 0, corners = 0;
    bool ended = false;
    while (text.next_line()) {
        const std::string_view keyword = text.word();
        const size_t line_at = text.word_at();
        if (keyword.empty()) continue;
        ended = keyword == "endsolid";
        facets += keyword == "facet";
        if (keyword != "vertex") continue;
        if (!three_coordinates(text)) return bad_text(bytes, kBadVertex, line_at, detail);
        ++corners;
    }
    if (!ended || corners != 3 * facets) return bad_text(bytes, kTooShort, bytes.size(), detail);
    return std::optional(facets);
}

// PLY: a header that declares elements and their properties, then the values, as text or binary.
class Ply {
public:
    Ply(std::string_view bytes, std::string& detail) : bytes_(bytes), detail_(detail), text_(bytes) {}

    Check check() {
        if (text_.word() != "ply") return bad_text(bytes_, "not a PLY file", 0, detail_);
        if (!read_header()) return bad_text(bytes_, "a PLY header that cannot be read", text_.word_at(), detail_);
        uint64_t vertices = 0;
        for (const Element& element : elements_) {
            if (element.name == "vertex") vertices = element.count;
            if (element.properties.empty() && element.count > 0) // or a tiny file could ask for endless work
                return bad_text(bytes_, "a PLY element without properties", 0, detail_);
        }
        for (const Element& element : elements_) {
            for (uint64_t i = 0; i < element.count; ++i)
                if (const auto read = read_one(element, vertices); !read) return read.error();
        }
        return std::optional(faces_);
    }

private:
    struct Type {
        size_t size;
        char kind; // 'i'nt, 'u'nsigned, 'f'loat
    };
    struct Property {
        std::optional<Type> length; // of a list
        Type value;
        bool is_corners;
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
                property.is_corners = elements_.back().name == "face" && property.length &&
                                      (name == "vertex_index" || name == "vertex_indices");
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

    Result<void> read_one(const Element& element, uint64_t vertices) {
        size_t line_at = std::min(data_, bytes_.size());
        if (is_text_) { // one element a line: what writers do, and what the reader expects
            text_.next_line();
            pending_ = text_.first_word();
            line_at = text_.word_at();
        }
        for (const Property& property : element.properties) {
            if (!property.length) {
                if (!value(property.value)) return bad_text_or_bytes(kTooShort, line_at);
                continue;
            }
            const auto length = value(*property.length);
            constexpr double kMostEntries = 1e9; // no list is longer; more is damage
            if (!length || !(*length >= 0 && *length <= kMostEntries)) return bad_text_or_bytes(kTooShort, line_at);
            if (property.is_corners && *length < 1) return bad_text_or_bytes(kBadFace, line_at);
            faces_ += property.is_corners && *length >= 3;
            const auto entries = static_cast<uint64_t>(std::ceil(*length));
            for (uint64_t i = 0; i < entries; ++i) {
                const auto index = value(property.value);
                if (!index) return bad_text_or_bytes(kTooShort, line_at);
                if (property.is_corners && !(*index >= 0 && *index < static_cast<double>(vertices)))
                    return bad_text_or_bytes(kBadIndex, line_at);
            }
        }
        return {};
    }

    Error bad_text_or_bytes(const char* what, size_t where) {
        return is_text_ ? bad_text(bytes_, what, where, detail_) : Error{ErrorCode::bad_file, what, where};
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
        if (type.kind == 'f') return 0.0; // clean() looks at coordinates; only lengths and indices matter here
        if (is_big_endian_) std::reverse(raw.begin(), raw.begin() + static_cast<ptrdiff_t>(type.size));
        int64_t integer = 0;
        for (size_t i = type.size; i-- > 0;) integer = integer * 256 + raw[i];
        const int64_t range = int64_t{1} << (8 * type.size);
        if (type.kind == 'i' && integer >= range / 2) integer -= range;
        return static_cast<double>(integer);
    }

    std::string_view bytes_;
    std::string& detail_;
    Text text_;
    std::vector<Element> elements_;
    std::string_view pending_; // first word of a text line, already taken
    size_t data_ = 0;          // next binary value
    uint64_t faces_ = 0;
    bool is_text_ = false, is_big_endian_ = false;
};

} // namespace

Check check_mesh_bytes(std::string_view type, std::string_view bytes, std::string& detail) {
    if (type == ".obj") return check_obj(bytes, detail);
    if (type == ".off") return check_off(bytes, detail);
    if (type == ".stl") return check_stl(bytes, detail);
    if (type == ".ply") return Ply(bytes, detail).check();
    if (type == ".gltf" || type == ".glb" || type == ".3ds" || type == ".dae") return std::optional<uint64_t>();
    return Error{ErrorCode::bad_file, "unknown kind of mesh file"};
}

} // namespace prolate

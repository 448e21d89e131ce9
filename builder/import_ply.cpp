// Reader of PLY, text and binary of either byte order, with polygons and triangle strips.
#include "builder/text.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

namespace prolate {
namespace {

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

Result<Polygons> read_ply(std::string_view bytes, std::string& detail) {
    return Ply(bytes, detail).read();
}

} // namespace prolate

#include "builder/gltf_document.hpp"

#include "builder/job.hpp"
#include "builder/polygons.hpp"

#include "src/bytes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>

namespace prolate {
namespace {

using Json = nlohmann::json;

// Rows of an accessor without a buffer view: all zeros but the sparse ones. More are not worth their memory.
constexpr uint64_t kMostZeroRows = uint64_t{1} << 24;

// ---- GLB ----

constexpr size_t kGlbHeader = 12, kChunkHeader = 8; // magic, version, length; length, type
constexpr uint32_t kGlbMagic = 0x46546c67, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;

struct GlbChunk {
    uint32_t type = 0;
    std::string_view content;
    bool is_whole = false;
};

// The chunk that begins there.
GlbChunk chunk_at(std::string_view bytes, size_t at) {
    if (at > bytes.size() || bytes.size() - at < kChunkHeader) return {};
    const auto raw = std::as_bytes(std::span(bytes)).subspan(at);
    const auto length = load_le<uint32_t>(raw.data());
    return {load_le<uint32_t>(raw.data() + 4), bytes.substr(at + kChunkHeader, length),
            length <= bytes.size() - at - kChunkHeader};
}

// The JSON and the binary chunk.
std::pair<std::string_view, std::string_view> split_glb(std::string_view bytes) {
    const auto raw = std::as_bytes(std::span(bytes));
    if (bytes.size() < kGlbHeader || load_le<uint32_t>(raw.data()) != kGlbMagic)
        throw GltfFailure{"not a GLB file", ""};
    if (load_le<uint32_t>(raw.data() + 4) != 2)
        throw GltfFailure{"a GLB of a version other than 2; export it again", ""};
    if (load_le<uint32_t>(raw.data() + 8) > bytes.size()) throw GltfFailure{"the file is cut short", ""};
    const GlbChunk json = chunk_at(bytes, kGlbHeader);
    if (!json.is_whole || json.type != kJsonChunk) throw GltfFailure{"a GLB without its JSON", ""};
    const size_t next = kGlbHeader + kChunkHeader + json.content.size();
    if (next >= bytes.size()) return {json.content, {}};
    const GlbChunk binary = chunk_at(bytes, next);
    if (!binary.is_whole) throw GltfFailure{"the file is cut short", ""};
    return {json.content, binary.type == kBinaryChunk ? binary.content : std::string_view()};
}

// ---- buffers ----

std::string from_base64(std::string_view digits, const GltfValue& place) {
    static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::array<uint8_t, 256> value;
    value.fill(64);
    for (size_t i = 0; i < kDigits.size(); ++i) value[static_cast<unsigned char>(kDigits[i])] = static_cast<uint8_t>(i);
    while (digits.ends_with('=')) digits.remove_suffix(1);
    std::string out;
    out.reserve(digits.size() / 4 * 3 + 2);
    uint32_t bits = 0, count = 0;
    Checkpoints checkpoint;
    for (const char digit : digits) {
        checkpoint();
        const uint32_t six = value[static_cast<unsigned char>(digit)];
        if (six == 64) place.fail("data that is not base64");
        bits = bits << 6 | six, count += 6;
        if (count >= 8) count -= 8, out += static_cast<char>(bits >> count);
    }
    return out;
}

// ---- numbers ----

uint64_t size_of_component(const GltfValue& component) {
    switch (component.whole()) {
    case 5120:
    case 5121:
        return 1;
    case 5122:
    case 5123:
        return 2;
    case 5125:
    case 5126:
        return 4;
    default:
        component.fail("an unknown type of numbers");
    }
}

double number_at(const std::byte* from, uint64_t component, bool normalised) {
    const auto whole = [normalised]<class T>(T value) {
        return normalised
                   ? std::max(static_cast<double>(value) / static_cast<double>(std::numeric_limits<T>::max()), -1.0)
                   : static_cast<double>(value);
    };
    switch (component) {
    case 5120:
        return whole(static_cast<int8_t>(*from));
    case 5121:
        return whole(static_cast<uint8_t>(*from));
    case 5122:
        return whole(load_le<int16_t>(from));
    case 5123:
        return whole(load_le<uint16_t>(from));
    case 5125:
        return whole(load_le<uint32_t>(from));
    default:
        return double{load_le<float>(from)};
    }
}

} // namespace

std::string without_escapes(std::string_view uri) {
    const auto digit = [](char c) -> int {
        return c >= '0' && c <= '9' ? c - '0' : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
    };
    std::string out;
    for (size_t i = 0; i < uri.size(); ++i) {
        const bool is_escape = uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0;
        out += is_escape ? static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2])) : uri[i];
        if (is_escape) i += 2;
    }
    return out;
}

// ---- values ----

bool GltfValue::has(const char* member) const {
    if (!json_->is_object()) fail("a value that is not an object");
    return json_->contains(member);
}

GltfValue GltfValue::operator[](const char* member) const {
    std::string place = place_ + (place_.empty() ? "" : ".") + member;
    if (!has(member)) throw GltfFailure{"a value that is missing", std::move(place)};
    return {(*json_)[member], std::move(place)};
}

uint64_t GltfValue::size() const {
    if (!json_->is_array()) fail("a value that is not a list");
    return json_->size();
}

GltfValue GltfValue::element(uint64_t index) const {
    if (index >= size()) fail("a list that is too short");
    return {(*json_)[index], place_ + '[' + std::to_string(index) + ']'};
}

uint64_t GltfValue::whole() const {
    constexpr double kMost = 0x1p53;
    const double value = json_->is_number() ? json_->get<double>() : -1;
    if (!(value >= 0 && value <= kMost && value == std::floor(value)))
        fail("a value that is not a whole number from 0 to 2^53");
    return static_cast<uint64_t>(value);
}

double GltfValue::number() const {
    if (!json_->is_number() || !std::isfinite(json_->get<double>())) fail("a value that is not a number");
    return json_->get<double>();
}

bool GltfValue::truth() const {
    if (!json_->is_boolean()) fail("a value that is neither true nor false");
    return json_->get<bool>();
}

const std::string& GltfValue::text() const {
    if (!json_->is_string()) fail("a value that is not a string");
    return json_->get_ref<const std::string&>();
}

std::vector<double> GltfValue::numbers(uint64_t count) const {
    if (size() != count) fail("a list of a wrong length");
    std::vector<double> out;
    for (uint64_t i = 0; i < count; ++i) out.push_back(element(i).number());
    return out;
}

uint64_t GltfValue::whole(const char* member, uint64_t otherwise) const {
    return has(member) ? (*this)[member].whole() : otherwise;
}

// ---- the document ----

GltfDocument::GltfDocument(std::string_view type, std::string_view bytes, const std::string& path,
                           std::vector<std::string>& files)
    : files_(files) {
    std::string_view text = bytes;
    if (type == ".glb") std::tie(text, binary_) = split_glb(bytes);
    const auto keep = [](int, Json::parse_event_t, Json&) {
        checkpoint();
        return true;
    };
    json_ = Json::parse(text, keep, false);
    if (!json_.is_object()) throw GltfFailure{"not the JSON of a glTF file", ""};
    const size_t slash = path.rfind('/');
    folder_ = slash == path.npos ? "" : path.substr(0, slash + 1);
}

GltfValue GltfDocument::named(const char* array, const GltfValue& index) const {
    if (!root().has(array) || index.whole() >= root()[array].size()) index.fail("a reference to what does not exist");
    return root()[array].element(index.whole());
}

std::vector<double> GltfDocument::rows(const GltfValue& accessor_index, Rows kind) {
    const GltfValue accessor = named("accessors", accessor_index);
    const std::string_view type = kind == Rows::scalar ? "SCALAR"
                                  : kind == Rows::vec3 ? "VEC3"
                                  : kind == Rows::vec4 ? "VEC4"
                                                       : "MAT4";
    if (accessor["type"].text() != type) accessor["type"].fail("an accessor of another type than its use needs");
    const Layout layout{.offset = accessor.whole("byteOffset", 0),
                        .component = accessor["componentType"].whole(),
                        .component_size = size_of_component(accessor["componentType"]),
                        .count = accessor["count"].whole(),
                        .width = static_cast<uint64_t>(kind),
                        .normalised = accessor.has("normalized") && accessor["normalized"].truth()};
    std::vector<double> out;
    if (accessor.has("bufferView")) {
        out = read_view(accessor["bufferView"], layout, accessor);
    } else if (accessor.has("sparse")) {
        if (layout.count > kMostZeroRows) accessor["count"].fail("too many rows for an accessor without data");
        out.assign(layout.count * layout.width, 0.0);
    } else {
        accessor.fail(
            "an accessor without data (is it compressed? decompress the file, as with 'gltf-transform copy')");
    }
    if (accessor.has("sparse")) fill_in(accessor["sparse"], layout, out);
    return out;
}

void GltfDocument::fill_in(const GltfValue& sparse, const Layout& layout, std::vector<double>& rows) {
    const GltfValue indices = sparse["indices"], values = sparse["values"];
    const Layout of_indices{.offset = indices.whole("byteOffset", 0),
                            .component = indices["componentType"].whole(),
                            .component_size = size_of_component(indices["componentType"]),
                            .count = sparse["count"].whole(),
                            .width = 1,
                            .normalised = false};
    Layout of_values = layout;
    of_values.offset = values.whole("byteOffset", 0), of_values.count = of_indices.count;
    const auto at = read_view(indices["bufferView"], of_indices, indices);
    const auto to = read_view(values["bufferView"], of_values, values);
    const uint64_t width = layout.width;
    for (size_t i = 0; i < at.size(); ++i) {
        if (!(at[i] >= 0 && at[i] < static_cast<double>(layout.count) && at[i] == std::floor(at[i])))
            indices.fail("an index beyond the accessor's count");
        std::copy_n(to.begin() + static_cast<ptrdiff_t>(i * width), width,
                    rows.begin() + static_cast<ptrdiff_t>(static_cast<uint64_t>(at[i]) * width));
    }
}

std::vector<double> GltfDocument::read_view(const GltfValue& view_index, const Layout& layout, const GltfValue& owner) {
    const GltfValue view = named("bufferViews", view_index);
    const std::string_view data = buffer(view["buffer"]);
    const uint64_t begin = view.whole("byteOffset", 0), length = view["byteLength"].whole();
    if (begin > data.size() || length > data.size() - begin) view.fail("a buffer view that reaches beyond its buffer");
    const uint64_t size = layout.component_size, row = size * layout.width;
    const uint64_t stride = view.whole("byteStride", row);
    if (stride < row) view["byteStride"].fail("a stride of less than a row");
    // In this order, so that nothing overflows.
    if (layout.offset > length || (layout.count > 0 && (length - layout.offset < row ||
                                                        (length - layout.offset - row) / stride < layout.count - 1)))
        owner.fail("an accessor that reaches beyond its buffer view");
    const std::byte* from = std::as_bytes(std::span(data)).data() + begin + layout.offset;
    std::vector<double> out;
    out.reserve(layout.count * layout.width);
    Checkpoints checkpoint;
    for (uint64_t i = 0; i < layout.count; ++i) {
        checkpoint();
        for (uint64_t k = 0; k < layout.width; ++k)
            out.push_back(number_at(from + i * stride + k * size, layout.component, layout.normalised));
    }
    return out;
}

std::string_view GltfDocument::buffer(const GltfValue& index) {
    const GltfValue buffer = named("buffers", index);
    std::string_view out = binary_;
    if (buffer.has("uri")) {
        auto known = buffers_.find(index.whole());
        if (known == buffers_.end()) known = buffers_.emplace(index.whole(), content_of(buffer["uri"])).first;
        out = known->second;
    } else if (index.whole() != 0 || binary_.empty()) {
        buffer.fail("a buffer without data");
    }
    if (buffer["byteLength"].whole() > out.size())
        buffer.fail("a buffer shorter than it states (is the file cut short?)");
    return out;
}

// What a buffer's URI stands for: data within it, or a file.
std::string GltfDocument::content_of(const GltfValue& uri) {
    const std::string& text = uri.text();
    if (text.starts_with("data:")) {
        constexpr std::string_view kBase64 = ";base64,";
        const size_t at = text.find(kBase64);
        if (at == text.npos) uri.fail("data that is not base64");
        return from_base64(std::string_view(text).substr(at + kBase64.size()), uri);
    }
    if (text.find("://") != text.npos)
        uri.fail("data elsewhere in the net, which is not fetched; put all into one file");
    files_.push_back(text.starts_with('/') ? without_escapes(text) : folder_ + without_escapes(text));
    auto bytes = read_mesh_bytes(files_.back().c_str());
    if (!bytes) throw GltfFailure{"another file that cannot be read", text};
    return std::move(*bytes);
}

std::string_view gltf_json(std::string_view type, std::string_view bytes) {
    return type == ".gltf" ? bytes : chunk_at(bytes, kGlbHeader).content;
}

} // namespace prolate

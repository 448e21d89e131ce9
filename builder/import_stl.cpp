// Reader of STL: binary if the size says so, else text.
#include "builder/text.hpp"

#include "src/bytes.hpp"

namespace prolate {
namespace {

constexpr size_t kHeader = 84, kRecord = 50; // bytes of a binary file; its count of triangles ends the header

bool is_binary(std::span<const std::byte> bytes) {
    return bytes.size() >= kHeader &&
           bytes.size() == kHeader + kRecord * uint64_t{load_le<uint32_t>(&bytes[kHeader - 4])};
}

Result<Polygons> read_binary(std::span<const std::byte> bytes) {
    Polygons out;
    out.place_word = "triangle";
    if (!out.can_hold((bytes.size() - kHeader) / kRecord * 3)) return Error{ErrorCode::bad_file, kTooMany};
    Checkpoints checkpoint;
    for (size_t at = kHeader; at < bytes.size(); at += kRecord) {
        checkpoint();
        out.begin_face(out.sizes.size() + 1);
        for (size_t corner = 1; corner <= 3; ++corner) { // 0 is the normal
            float p[3];
            load_le(&bytes[at + 12 * corner], p);
            out.add_corner(static_cast<uint32_t>(out.points.size()));
            out.points.push_back({double{p[0]}, double{p[1]}, double{p[2]}});
        }
    }
    return out;
}

// Must come to its "endsolid".
Result<Polygons> read_text(std::string_view bytes, std::string& detail) {
    Polygons out;
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

} // namespace

Result<Polygons> read_stl(std::string_view bytes, std::string& detail) {
    const auto raw = std::as_bytes(std::span(bytes));
    return is_binary(raw) ? read_binary(raw) : read_text(bytes, detail);
}

} // namespace prolate

#include "cli/bake/modes_file.hpp"

#include <fmt/format.h>
#include <minizip/unzip.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>

namespace prolate::cli {
namespace {

constexpr const char* kModesAdvice = "write it with numpy.savez(path, modes=modes, ranges=ranges), modes of shape "
                                     "(modes, vertices, 3)";

struct Array {
    std::vector<size_t> shape;
    std::vector<float> values;
};

Failure bad(const std::string& path, std::string what) {
    return {kBadInput, path, std::move(what), kModesAdvice};
}

// The text between `begin` and the next `end` behind the dictionary's key.
std::string_view entry(std::string_view header, std::string_view key, char begin, char end) {
    size_t at = header.find(key);
    if (at == std::string_view::npos) return {};
    at = header.find(begin, at + key.size());
    if (at == std::string_view::npos) return {};
    const size_t to = header.find(end, at + 1);
    return to == std::string_view::npos ? std::string_view() : header.substr(at + 1, to - at - 1);
}

std::optional<std::vector<size_t>> shape_of(std::string_view text) {
    std::vector<size_t> out;
    const std::string copy(text);
    for (const char* at = copy.c_str(); *at != '\0';) {
        char* end = nullptr;
        const unsigned long long n = std::strtoull(at, &end, 10);
        if (end == at || n > UINT32_MAX) return {};
        out.push_back(static_cast<size_t>(n));
        at = end + std::strspn(end, ", ");
    }
    return out;
}

// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
Outcome<Array> parse_npy(const std::string& path, std::string_view bytes) {
    static constexpr std::string_view kMagic("\x93NUMPY", 6);
    if (bytes.size() < 12 || bytes.substr(0, 6) != kMagic) return bad(path, "is no array of numpy's");
    const auto byte = [&bytes](size_t at) { return size_t{static_cast<unsigned char>(bytes[at])}; };
    const size_t wide = byte(6) == 1 ? 2 : 4;
    size_t length = 0;
    for (size_t i = wide; i-- > 0;) length = length << 8 | byte(8 + i);
    if (length > bytes.size() - 8 - wide) return bad(path, "is cut off in its header");
    const std::string_view header = bytes.substr(8 + wide, length), data = bytes.substr(8 + wide + length);
    const std::string_view type = entry(header, "'descr':", '\'', '\'');
    const size_t size = type == "<f4" ? 4 : type == "<f8" ? 8 : 0;
    if (size == 0) return bad(path, fmt::format("holds numbers of type {}, not float32 or float64", type));
    if (header.find("'fortran_order': False") == std::string_view::npos) return bad(path, "is in Fortran's order");
    Array out;
    const auto shape = shape_of(entry(header, "'shape':", '(', ')'));
    if (!shape) return bad(path, "has no shape");
    out.shape = *shape;
    size_t count = 1;
    for (const size_t n : out.shape) {
        if (n != 0 && count > data.size() / n) return bad(path, "is cut off");
        count *= n;
    }
    if (data.size() != count * size) return bad(path, "holds another number of bytes than its shape says");
    static_assert(std::endian::native == std::endian::little);
    for (size_t i = 0; i < count; ++i) {
        double wide_number = 0;
        float number = 0;
        std::memcpy(size == 8 ? static_cast<void*>(&wide_number) : &number, data.data() + i * size, size);
        out.values.push_back(size == 8 ? static_cast<float>(wide_number) : number);
    }
    return out;
}

// A file of the archive; none if it has no such file, or it cannot be read.
std::optional<std::string> unzipped(const std::string& path, const char* name) {
    const std::unique_ptr<void, int (*)(unzFile)> archive(unzOpen64(path.c_str()), unzClose);
    unz_file_info64 info{};
    if (!archive || unzLocateFile(archive.get(), name, 1) != UNZ_OK ||
        unzGetCurrentFileInfo64(archive.get(), &info, nullptr, 0, nullptr, 0, nullptr, 0) != UNZ_OK ||
        unzOpenCurrentFile(archive.get()) != UNZ_OK)
        return {};
    constexpr size_t kPart = size_t{1} << 20; // sizes in the archive are not believed
    std::string out;
    for (int got = 1; got > 0;) {
        const size_t have = out.size();
        out.resize(have + kPart);
        got = unzReadCurrentFile(archive.get(), out.data() + have, kPart);
        out.resize(have + static_cast<size_t>(std::max(got, 0)));
        if (got < 0) return {};
    }
    if (unzCloseCurrentFile(archive.get()) != UNZ_OK || out.size() != info.uncompressed_size) return {}; // checksum
    return out;
}

Outcome<Array> read_array(const std::string& path, const std::string& content, const char* name) {
    if (!content.starts_with("PK")) return parse_npy(path, content);
    const auto bytes = unzipped(path, (std::string(name) + ".npy").c_str());
    if (!bytes) return bad(path, fmt::format("holds no array \"{}\" that can be read", name));
    return parse_npy(fmt::format("{}: {}", path, name), *bytes);
}

} // namespace

Outcome<ModesFile> read_modes(const std::string& path, const std::vector<float>& ranges,
                              const std::array<double, 3>& scale) {
    std::ifstream file(path, std::ios::binary);
    if (!file) return failure_of(path, Error{ErrorCode::io, "cannot open", static_cast<uint64_t>(errno)});
    const std::string content{std::istreambuf_iterator<char>(file), {}};
    auto modes = read_array(path, content, "modes");
    if (!modes) return modes.error();
    if (modes->shape.size() != 3 || modes->shape[2] != 3)
        return bad(path, "holds modes of another shape than (modes, vertices, 3)");
    ModesFile out;
    out.displacements = std::move(modes->values);
    for (size_t i = 0; i < out.displacements.size(); ++i)
        out.displacements[i] = static_cast<float>(out.displacements[i] * scale[i % 3]);
    out.ranges = ranges;
    if (ranges.size() == 1) out.ranges.assign(modes->shape[0], ranges[0]);
    if (ranges.empty()) {
        if (!content.starts_with("PK"))
            return Failure{kUsage, path, "says nothing of the modes' ranges", "give --range"};
        auto of_file = read_array(path, content, "ranges");
        if (!of_file) return advised(of_file.error(), "or give --range");
        out.ranges = std::move(of_file->values);
    }
    if (out.ranges.size() != modes->shape[0])
        return bad(path, fmt::format("{} ranges for {} modes", out.ranges.size(), modes->shape[0]));
    return out;
}

} // namespace prolate::cli

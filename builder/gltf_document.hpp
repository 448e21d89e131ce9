// A glTF file's JSON, buffers and accessors, read strictly: a member that is there is of the type, and in the range,
// that the specification gives it, or the file is refused. (tinygltf 2.7 takes optional members of a wrong type for
// absent ones and cuts numbers to 32 bits: coordinates that were zeros without a word.)
#pragma once

#include <nlohmann/json.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace prolate {

/// What is thrown where the file is wrong: static words, and the place, as in "accessors[3].count".
struct GltfFailure {
    const char* what;
    std::string place;
};

/// A value of the JSON, which knows its place. What it is asked for and is not, is a failure.
class GltfValue {
public:
    GltfValue(const nlohmann::json& json, std::string place) : json_(&json), place_(std::move(place)) {}

    bool has(const char* member) const;                ///< of an object
    GltfValue operator[](const char* member) const;    ///< of an object that has it
    uint64_t size() const;                             ///< of an array
    GltfValue element(uint64_t index) const;           ///< of an array that is long enough
    uint64_t whole() const;                            ///< a whole number from 0 to 2^53
    double number() const;                             ///< finite
    bool truth() const;                                ///< true or false
    const std::string& text() const;                   ///< a string
    std::vector<double> numbers(uint64_t count) const; ///< an array of so many numbers

    /// The member, or `otherwise` if there is none.
    uint64_t whole(const char* member, uint64_t otherwise) const;

    const std::string& place() const { return place_; }
    [[noreturn]] void fail(const char* what) const { throw GltfFailure{what, place_}; }

private:
    const nlohmann::json* json_;
    std::string place_;
};

class GltfDocument {
public:
    /// `type` is ".gltf" or ".glb"; `path` is where other files are sought beside, whose names are added to `files`.
    /// The bytes must outlive this.
    GltfDocument(std::string_view type, std::string_view bytes, const std::string& path,
                 std::vector<std::string>& files);

    GltfValue root() const { return {json_, ""}; }
    /// What `index` names of the root's array.
    GltfValue named(const char* array, const GltfValue& index) const;

    /// How many numbers a row of an accessor has.
    enum class Rows : uint64_t { scalar = 1, vec3 = 3, vec4 = 4, mat4 = 16 };
    /// The rows of an accessor, one after the other: sparse ones filled in, normalised integers as numbers.
    std::vector<double> rows(const GltfValue& accessor_index, Rows kind);

private:
    struct Layout { // of numbers in a buffer view
        uint64_t offset, component, component_size, count, width;
        bool normalised;
    };
    std::vector<double> read_view(const GltfValue& view_index, const Layout& layout, const GltfValue& owner);
    void fill_in(const GltfValue& sparse, const Layout& layout, std::vector<double>& rows);
    std::string_view buffer(const GltfValue& index);
    std::string content_of(const GltfValue& uri);

    nlohmann::json json_;
    std::string_view binary_; // of a GLB
    std::string folder_;
    std::vector<std::string>& files_;
    std::map<uint64_t, std::string> buffers_; // those from elsewhere, as far as they were asked for
};

} // namespace prolate

// A COLLADA file's XML, parsed by pugixml and looked at with suspicion.
#pragma once

#include "builder/text.hpp"

#include <pugixml.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace prolate::collada {

using pugi::xml_node;

/// What is thrown where the file is wrong: static words, and the element; none, if it is no COLLADA at all.
struct Failure {
    const char* what;
    xml_node place;
};
[[noreturn]] inline void fail(const xml_node& place, const char* what) {
    throw Failure{what, place};
}

/// The text of an element that holds nothing else.
std::string text_of(const xml_node& element);

/// All numbers of a list; `what_else` is the failure if something else is there.
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

/// A count that an attribute states; `otherwise`, or a failure, if it is not there.
uint64_t count_of(const xml_node& element, const char* attribute, std::optional<uint64_t> otherwise = {});

class Document {
public:
    explicit Document(std::string_view bytes);

    xml_node root() const { return root_; }
    uint64_t line_of(const xml_node& node) const;

    /// Does the file hold an element of this name that the attribute refers to?
    bool has_target(const xml_node& from, const char* attribute, const char* name) const;
    /// That element.
    xml_node target(const xml_node& from, const char* attribute, const char* name) const;

private:
    void index();

    std::vector<ptrdiff_t> line_ends_;
    pugi::xml_document document_;
    xml_node root_;
    std::unordered_map<std::string, xml_node> by_id_; // "name#id"; null: several have it
};

} // namespace prolate::collada

#include "builder/collada_document.hpp"

#include "builder/job.hpp"

#include <algorithm>

namespace prolate::collada {

std::string text_of(const xml_node& element) {
    std::string out;
    for (const xml_node& part : element) {
        if (part.type() != pugi::node_pcdata && part.type() != pugi::node_cdata)
            fail(element, "a list with other elements inside");
        out += part.value();
    }
    return out;
}

uint64_t count_of(const xml_node& element, const char* attribute, std::optional<uint64_t> otherwise) {
    const pugi::xml_attribute found = element.attribute(attribute);
    const auto value = found ? number<uint64_t>(found.value()) : otherwise;
    if (!value) fail(element, "a count that is missing or not a number");
    return *value;
}

Document::Document(std::string_view bytes) {
    for (size_t at = bytes.find('\n'); at != bytes.npos; at = bytes.find('\n', at + 1))
        line_ends_.push_back(static_cast<ptrdiff_t>(at));
    checkpoint();
    // The bytes are taken as they are, so that places in the document are places in the file.
    const auto parsed = document_.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8);
    if (!parsed) throw Failure{parsed.description(), {}};
    root_ = document_.child("COLLADA");
    if (!root_) throw Failure{"no COLLADA document", {}};
    checkpoint();
    index();
}

uint64_t Document::line_of(const xml_node& node) const {
    const auto before = std::lower_bound(line_ends_.begin(), line_ends_.end(), node.offset_debug());
    return static_cast<uint64_t>(before - line_ends_.begin()) + 1;
}

bool Document::has_target(const xml_node& from, const char* attribute, const char* name) const {
    return by_id_.contains(name + std::string(from.attribute(attribute).value()));
}

xml_node Document::target(const xml_node& from, const char* attribute, const char* name) const {
    const std::string_view url = from.attribute(attribute).value();
    if (!url.empty() && !url.starts_with('#'))
        fail(from, "a part in another file, which is not read; put all into one");
    const auto found = by_id_.find(name + std::string(url));
    if (found == by_id_.end()) fail(from, "a reference to what does not exist");
    if (!found->second) fail(from, "a reference to an id that several elements have");
    return found->second;
}

void Document::index() {
    for (xml_node at = root_; at;) {
        checkpoint();
        if (const auto id = at.attribute("id")) {
            const auto [entry, is_new] = by_id_.emplace(std::string(at.name()) + '#' + id.value(), at);
            if (!is_new) entry->second = {};
        }
        if (at.first_child()) {
            at = at.first_child();
            continue;
        }
        while (at && at != root_ && !at.next_sibling()) at = at.parent();
        at = at == root_ ? xml_node() : at.next_sibling();
    }
}

} // namespace prolate::collada

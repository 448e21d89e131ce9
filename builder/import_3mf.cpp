// Reads 3MF through lib3mf: what the build places, with components and transforms. Its unit is part of the format, so
// coordinates become metres.
//
// Known limits: beam lattices are no triangles; a file that has one is refused. lib3mf 1.8 itself looks at components
// within components once for every way that leads to them, and cannot be stopped: of groups that each hold the one
// before twice, it takes seconds from 24 on.
#include "builder/job.hpp"
#include "builder/polygons.hpp"

#include <Model/COM/NMR_DLLInterfaces.h>

#include <utility>

namespace prolate {
namespace {

using namespace NMR;

// An object of lib3mf's.
class Handle {
public:
    Handle() = default;
    ~Handle() {
        if (object_) lib3mf_release(object_);
    }
    Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
    Handle& operator=(Handle&& other) noexcept {
        std::swap(object_, other.object_);
        return *this;
    }
    PLib3MFBase* get() const { return object_; }
    PLib3MFBase** out() { return &object_; }

private:
    PLib3MFBase* object_ = nullptr;
};

struct Failed {}; // a call of lib3mf's went wrong

void need(LIB3MFRESULT result) {
    if (result != LIB3MF_OK) throw Failed{};
}

// lib3mf multiplies rows: x' = x * m, with the translation as its last row.
Affine affine(const MODELTRANSFORM& t) {
    Affine out;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 4; ++j) out.m[i][j] = double{t.m_fFields[i][j]};
    return out;
}

struct ComponentPart {
    Handle object;
    Affine transform;
    unsigned depth = 0;
};

constexpr unsigned kMostDepth = 100;      // components within components
constexpr size_t kMostParts = 10'000'000; // a few lines can ask for 2^100 of them

void add_mesh(Polygons& out, PLib3MFBase* object, const Affine& transform) {
    DWORD beams = 0, vertices = 0, triangles = 0;
    need(lib3mf_meshobject_getbeamcount(object, &beams));
    if (beams > 0) throw Error{ErrorCode::bad_file, "a beam lattice, which is not a mesh; export it as triangles"};
    need(lib3mf_meshobject_getvertexcount(object, &vertices));
    need(lib3mf_meshobject_gettrianglecount(object, &triangles));
    if (!out.can_hold(vertices)) throw Error{ErrorCode::bad_file, "too many vertices (2^32 or more)"};
    std::vector<MODELMESHVERTEX> points(vertices);
    std::vector<MODELMESHTRIANGLE> corners(triangles);
    if (vertices > 0) need(lib3mf_meshobject_getvertices(object, points.data(), vertices, nullptr));
    if (triangles > 0) need(lib3mf_meshobject_gettriangleindices(object, corners.data(), triangles, nullptr));
    const auto base = static_cast<uint32_t>(out.points.size());
    for (const MODELMESHVERTEX& p : points)
        out.points.push_back(transform({double{p.m_fPosition[0]}, double{p.m_fPosition[1]}, double{p.m_fPosition[2]}}));
    for (const MODELMESHTRIANGLE& t : corners) {
        out.begin_face(out.sizes.size() + 1);
        for (const DWORD corner : t.m_nIndices) {
            if (corner >= vertices) throw Error{ErrorCode::bad_file, "a triangle names a vertex that does not exist"};
            out.add_corner(base + corner);
        }
        if (transform.mirrors()) out.turn_last_face();
    }
}

// The transform of a build item or component, if it has one.
template <class Has, class Get> Affine placed(PLib3MFBase* object, Has&& has, Get&& get) {
    BOOL any = false;
    need(has(object, &any));
    if (!any) return {};
    MODELTRANSFORM transform{};
    need(get(object, &transform));
    return affine(transform);
}

void add_unit(Polygons& out, PLib3MFBase* model) {
    constexpr std::pair<double, const char*> kUnits[] = {{1e-6, "micrometres"}, {1e-3, "millimetres"},
                                                         {1e-2, "centimetres"}, {0.0254, "inches"},
                                                         {0.3048, "feet"},      {1, "metres"}};
    DWORD unit = 0;
    need(lib3mf_model_getunit(model, &unit));
    if (unit >= std::size(kUnits)) throw Failed{};
    out.unit = kUnits[unit].first;
    out.notes.push_back(std::string("states ") + kUnits[unit].second + ": made metres; z is up, the axes are kept");
}

// Appends all meshes of a build item: an object may be a group of others.
class ItemReader {
public:
    explicit ItemReader(Polygons& out) : out_(out) {}

    void read(PLib3MFBase* item) {
        ComponentPart whole;
        whole.transform = placed(item, lib3mf_builditem_hasobjecttransform, lib3mf_builditem_getobjecttransform);
        need(lib3mf_builditem_getobjectresource(item, whole.object.out()));
        todo_.push_back(std::move(whole));
        while (!todo_.empty()) {
            checkpoint();
            const ComponentPart part = std::move(todo_.back());
            todo_.pop_back();
            if (part.depth > kMostDepth) throw Error{ErrorCode::bad_file, "components nested too deeply"};
            if (++parts_ > kMostParts) throw Error{ErrorCode::bad_file, "more than 10 million components"};
            BOOL is_mesh = false, is_group = false;
            need(lib3mf_object_ismeshobject(part.object.get(), &is_mesh));
            if (is_mesh) add_mesh(out_, part.object.get(), part.transform);
            need(lib3mf_object_iscomponentsobject(part.object.get(), &is_group));
            if (is_group) push_components(part);
        }
    }

private:
    void push_components(const ComponentPart& group) {
        DWORD count = 0;
        need(lib3mf_componentsobject_getcomponentcount(group.object.get(), &count));
        for (DWORD i = count; i-- > 0;) {
            Handle component;
            need(lib3mf_componentsobject_getcomponent(group.object.get(), i, component.out()));
            ComponentPart child;
            child.transform =
                group.transform * placed(component.get(), lib3mf_component_hastransform, lib3mf_component_gettransform);
            child.depth = group.depth + 1;
            need(lib3mf_component_getobjectresource(component.get(), child.object.out()));
            todo_.push_back(std::move(child));
        }
    }

    Polygons& out_;
    std::vector<ComponentPart> todo_;
    size_t parts_ = 0;
};

Result<Polygons> read(std::string_view bytes, std::string& detail) {
    Handle model, reader, items;
    need(lib3mf_createmodel(model.out()));
    need(lib3mf_model_queryreader(model.get(), "3mf", reader.out()));
    auto* const data = reinterpret_cast<BYTE*>(const_cast<char*>(bytes.data())); // it is only read
    if (lib3mf_reader_readfrombuffer(reader.get(), data, bytes.size()) != LIB3MF_OK) {
        DWORD code = 0;
        LPCSTR words = nullptr;
        if (lib3mf_getlasterror(reader.get(), &code, &words) == LIB3MF_OK && words) detail = words;
        return Error{ErrorCode::bad_file, "cannot be read as 3MF"};
    }
    Polygons out;
    out.place_word = "triangle";
    add_unit(out, model.get());
    need(lib3mf_model_getbuilditems(model.get(), items.out()));
    ItemReader item_reader(out);
    for (BOOL more = false; lib3mf_builditemiterator_movenext(items.get(), &more) == LIB3MF_OK && more;) {
        Handle item;
        need(lib3mf_builditemiterator_getcurrent(items.get(), item.out()));
        item_reader.read(item.get());
    }
    return out;
}

} // namespace

Result<Polygons> read_3mf(std::string_view bytes, std::string& detail) try {
    return read(bytes, detail);
} catch (const Failed&) {
    return Error{ErrorCode::bad_file, "cannot be read as 3MF"};
} catch (const Error& error) {
    return error;
}

} // namespace prolate

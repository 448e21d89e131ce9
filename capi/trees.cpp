// Trees of the C interface: opened, loaded and made in the caller's memory.
#include "capi/handles.hpp"

#include <prolate/primitives.hpp>
#include <prolate/prolate.h>
#include <prolate/tree.hpp>

#include <cerrno>
#include <cstdio>
#include <memory>

using namespace prolate;
using namespace prolate::capi;

namespace {

prolate_status open_in(std::span<const std::byte> bytes, prolate_tree* tree, prolate_error* error) {
    const auto view = TreeView::open(bytes);
    if (!view) return failed(view.error(), error);
    hold(*view, tree);
    return PROLATE_OK;
}

// Copies a tree that was made into the caller's buffer.
prolate_status hand_over(const Result<Tree>& made, void* buffer, size_t capacity, size_t* needed, prolate_tree* tree,
                         prolate_error* error) {
    if (!made) return failed(made.error(), error);
    const std::span<const std::byte> bytes = made->bytes();
    if (needed != nullptr) *needed = bytes.size();
    if (bytes.size() > capacity) return failed(PROLATE_NO_ROOM, error);
    std::memcpy(buffer, bytes.data(), bytes.size());
    return open_in({static_cast<const std::byte*>(buffer), bytes.size()}, tree, error);
}

struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
};

} // namespace

const char* prolate_status_text(prolate_status status) {
    switch (status) {
    case PROLATE_OK:
        return "success";
    case PROLATE_BAD_OPTIONS:
        return "an option or argument is out of its range";
    case PROLATE_BAD_MESH:
        return "the mesh cannot be used";
    case PROLATE_BAD_FILE:
        return "not a sound .etree file, or one of an older format version";
    case PROLATE_NEWER_VERSION:
        return "an .etree file of a later format version than this library reads";
    case PROLATE_IO:
        return "the operating system refused to read or write";
    case PROLATE_CANCELLED:
        return "cancelled";
    case PROLATE_UNSUPPORTED:
        return "a valid request that this version does not carry out";
    case PROLATE_INTERNAL:
        return "a promise of the library did not hold; please report it";
    case PROLATE_OUT_OF_MEMORY:
        return "the system or the allocator has no more memory";
    case PROLATE_BAD_ID:
        return "an id that names nothing, or nothing any more";
    case PROLATE_BAD_ARGUMENT:
        return "a pointer is NULL, a tree is not open, or scratch is too small or not aligned";
    case PROLATE_BAD_STRUCT:
        return "the size or version of a struct is wrong: make it with PROLATE_INIT";
    case PROLATE_NO_ROOM:
        return "the buffer is too small";
    case PROLATE_BUSY:
        return "the world is calling a function of the caller's, and must not change";
    default:
        return "unknown status";
    }
}

uint32_t prolate_api_version(void) {
    return PROLATE_API_VERSION;
}

size_t prolate_scratch_size(void) {
    return sizeof(QueryContext);
}

size_t prolate_scratch_size_of(const prolate_tree* a, const prolate_tree* b) {
    const TreeView *const x = view_of(a), *const y = view_of(b);
    if (x == nullptr) return prolate_scratch_size();
    return y != nullptr ? scratch_size(*x, *y) : scratch_size(*x);
}

prolate_status prolate_tree_open(const void* bytes, size_t count, prolate_tree* tree, prolate_error* error) {
    if ((bytes == nullptr && count > 0) || tree == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    return open_in({static_cast<const std::byte*>(bytes), count}, tree, error);
}

prolate_status prolate_tree_load(const char* path, void* buffer, size_t capacity, size_t* needed, prolate_tree* tree,
                                 prolate_error* error) {
    if (path == nullptr || (buffer == nullptr && capacity > 0) || tree == nullptr)
        return failed(PROLATE_BAD_ARGUMENT, error);
    const auto io = [&](const char* what) {
        return failed(Error{ErrorCode::io, what, static_cast<uint64_t>(errno)}, error);
    };
    const std::unique_ptr<std::FILE, Closer> file(std::fopen(path, "rb"));
    if (!file) return io("cannot open the file");
    std::setvbuf(file.get(), nullptr, _IONBF, 0); // it is read at once
    if (std::fseek(file.get(), 0, SEEK_END) != 0) return io("cannot tell the file's size");
    const long end = std::ftell(file.get());
    if (end < 0 || std::fseek(file.get(), 0, SEEK_SET) != 0) return io("cannot tell the file's size");
    const auto size = static_cast<size_t>(end);
    if (needed != nullptr) *needed = size;
    if (size > capacity) return failed(PROLATE_NO_ROOM, error);
    if (std::fread(buffer, 1, size, file.get()) != size) return io("cannot read the file");
    return open_in({static_cast<const std::byte*>(buffer), size}, tree, error);
}

prolate_status prolate_tree_scale(const prolate_tree* tree, float scale, prolate_tree* scaled, prolate_error* error) {
    const TreeView* const view = view_of(tree);
    if (view == nullptr || scaled == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    const auto made = view->scaled(scale);
    if (!made) return failed(made.error(), error);
    hold(*made, scaled);
    return PROLATE_OK;
}

prolate_status prolate_tree_round(const prolate_tree* tree, float radius, prolate_tree* rounded, prolate_error* error) {
    const TreeView* const view = view_of(tree);
    if (view == nullptr || rounded == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    const auto made = view->rounded(radius);
    if (!made) return failed(made.error(), error);
    hold(*made, rounded);
    return PROLATE_OK;
}

prolate_status prolate_tree_coarser(const prolate_tree* tree, uint32_t last, prolate_tree* coarser) {
    const TreeView* const view = view_of(tree);
    if (view == nullptr || coarser == nullptr) return PROLATE_BAD_ARGUMENT;
    hold(view->coarser(last), coarser);
    return PROLATE_OK;
}

prolate_status prolate_tree_inner(const prolate_tree* tree, prolate_tree* inner) {
    const TreeView* const view = view_of(tree);
    if (view == nullptr || inner == nullptr) return PROLATE_BAD_ARGUMENT;
    const auto found = view->inner();
    if (!found) return PROLATE_UNSUPPORTED;
    hold(*found, inner);
    return PROLATE_OK;
}

prolate_status prolate_tree_describe(const prolate_tree* tree, prolate_tree_info* info) {
    const TreeView* const view = view_of(tree);
    if (view == nullptr || info == nullptr) return PROLATE_BAD_ARGUMENT;
    if (!is_sound(info)) return PROLATE_BAD_STRUCT;
    const BakeInfo bake = view->bake_info();
    auto out = fresh<prolate_tree_info>();
    out.nodes = view->node_count(), out.levels = view->level_count();
    out.triangles = view->triangle_count(), out.vertices = view->vertex_count();
    out.exact = bake.exact, out.surface_mode = bake.surface_mode, out.proved = bake.proved;
    out.prefix = view->is_prefix();
    out.volume = bake.mass.volume;
    std::copy(bake.mass.center.begin(), bake.mass.center.end(), out.center);
    std::copy(bake.mass.inertia.begin(), bake.mass.inertia.end(), out.inertia);
    out.volume_error = bake.mass.volume_error, out.center_error = bake.mass.center_error;
    out.inertia_error = bake.mass.inertia_error;
    if (const auto inner = view->inner()) out.inner_nodes = inner->node_count();
    write(out, info);
    return PROLATE_OK;
}

size_t prolate_primitive_size(void) {
    return size_t{16} * 1024;
}

prolate_status prolate_make_box(prolate_vec3 half, void* buffer, size_t capacity, size_t* needed, prolate_tree* tree,
                                prolate_error* error) {
    if ((buffer == nullptr && capacity > 0) || tree == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    return hand_over(box_tree(same<Vec3>(half)), buffer, capacity, needed, tree, error);
}

prolate_status prolate_make_sphere(float radius, void* buffer, size_t capacity, size_t* needed, prolate_tree* tree,
                                   prolate_error* error) {
    if ((buffer == nullptr && capacity > 0) || tree == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    return hand_over(sphere_tree(radius), buffer, capacity, needed, tree, error);
}

prolate_status prolate_make_cylinder(float radius, float half_height, uint32_t sides, void* buffer, size_t capacity,
                                     size_t* needed, prolate_tree* tree, prolate_error* error) {
    if ((buffer == nullptr && capacity > 0) || tree == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    return hand_over(cylinder_tree(radius, half_height, sides), buffer, capacity, needed, tree, error);
}

prolate_status prolate_make_capsule(prolate_vec3 a, prolate_vec3 b, float radius, void* buffer, size_t capacity,
                                    size_t* needed, prolate_tree* tree, prolate_error* error) {
    if ((buffer == nullptr && capacity > 0) || tree == nullptr) return failed(PROLATE_BAD_ARGUMENT, error);
    const prolate_status made =
        hand_over(capsule_tree(same<Vec3>(a), same<Vec3>(b), radius), buffer, capacity, needed, tree, error);
    return made == PROLATE_OK ? prolate_tree_round(tree, radius, tree, error) : made;
}

prolate_status prolate_make_convex(const prolate_vec3* points, size_t point_count, const uint32_t* triangles,
                                   size_t triangle_count, void* buffer, size_t capacity, size_t* needed,
                                   prolate_tree* tree, prolate_error* error) {
    if ((points == nullptr && point_count > 0) || (triangles == nullptr && triangle_count > 0) ||
        (buffer == nullptr && capacity > 0) || tree == nullptr)
        return failed(PROLATE_BAD_ARGUMENT, error);
    static_assert(sizeof(prolate_vec3) == sizeof(Vec3) && sizeof(Triangle) == 3 * sizeof(uint32_t));
    return hand_over(convex_tree({reinterpret_cast<const Vec3*>(points), point_count},
                                 {reinterpret_cast<const Triangle*>(triangles), triangle_count}),
                     buffer, capacity, needed, tree, error);
}

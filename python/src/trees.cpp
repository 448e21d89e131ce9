// Trees: opening bytes, and what they hold, as arrays.
#include "python/src/tree.hpp"

#include <prolate/matrix.hpp>

#include <array>
#include <cmath>
#include <cstring>

namespace prolate::python {
namespace {

using Info = nb::dict;

double norm(std::initializer_list<double> values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return std::sqrt(sum);
}

// A view of the bytes that `owner` holds.
HeldTree held_view(const TreeView& view, nb::handle owner) {
    const Ellipsoid& e = view.root_bound();
    const double radius = norm({e.l11, e.l21, e.l22, e.l31, e.l32, e.l33});
    return {view,
            nb::borrow(owner),
            {e.center.x, e.center.y, e.center.z},
            radius,
            norm({e.center.x, e.center.y, e.center.z}) + radius};
}

HeldTree open_tree(nb::handle buffer, bool check_hash) {
    const AnyArray array = import_array(buffer);
    if (!array.is_valid() || array.dtype() != nb::dtype<uint8_t>() || array.ndim() != 1 || !array.is_contiguous())
        type_error("buffer", "must be contiguous bytes");
    const auto* data = static_cast<const std::byte*>(array.data());
    const std::span<const std::byte> bytes(data, array.shape(0));
    const auto view = [&] {
        const nb::gil_scoped_release released;
        return TreeView::open(bytes, {.check_hash = check_hash});
    }();
    if (!view) throw Failure{view.error(), "at byte " + std::to_string(view.error().where)};
    return held_view(*view, buffer);
}

uint32_t level_of(const TreeView& tree, nb::handle level) {
    const int64_t count = tree.level_count();
    int64_t asked = 0;
    if (!nb::try_cast(level, asked, false)) type_error("level", "must be a whole number");
    const int64_t l = asked < 0 ? asked + count : asked;
    if (l < 0 || l >= count)
        value_error("level", "is " + std::to_string(asked) + "; the tree has levels 0 to " + std::to_string(count - 1));
    return static_cast<uint32_t>(l);
}

std::vector<int64_t> parents(const TreeView& tree) {
    std::vector<int64_t> out(tree.slot_count(), -1);
    tree.for_each_node([&](uint32_t node) {
        const ChildRange children = tree.children(node);
        for (uint32_t i = 0; i < children.count; ++i) out[children.first + i] = node;
    });
    return out;
}

// (center, radii, rotation, quaternion, factor, node, parent), read-only.
nb::tuple cut(const HeldTree& held, nb::handle level) {
    const TreeView& tree = held.view;
    std::vector<uint32_t> nodes;
    tree.for_each_in_cut(level_of(tree, level), [&](uint32_t node) { nodes.push_back(node); });
    const size_t n = nodes.size();
    const std::vector<int64_t> parent_of = parents(tree);
    auto center = new_array<double>(3 * n), radii = new_array<double>(3 * n), rotation = new_array<double>(9 * n),
         quaternions = new_array<double>(4 * n), factor = new_array<double>(9 * n);
    auto node = new_array<int64_t>(n), parent = new_array<int64_t>(n);
    for (size_t i = 0; i < n; ++i) {
        const Ellipsoid e = tree.ellipsoid(nodes[i]);
        const PrincipalAxes axes = outer_axes(e);
        const double l[9] = {e.l11, 0, 0, e.l21, e.l22, 0, e.l31, e.l32, e.l33};
        const double c[3] = {e.center.x, e.center.y, e.center.z};
        std::copy(std::begin(c), std::end(c), &center[3 * i]);
        std::copy(std::begin(l), std::end(l), &factor[9 * i]);
        std::copy(std::begin(axes.radii), std::end(axes.radii), &radii[3 * i]);
        std::copy(&axes.rotation[0][0], &axes.rotation[0][0] + 9, &rotation[9 * i]);
        const auto q = quaternion_of(axes.rotation);
        std::copy(q.begin(), q.end(), &quaternions[4 * i]);
        node[i] = nodes[i];
        parent[i] = parent_of[nodes[i]];
    }
    return nb::make_tuple(to_numpy(std::move(center), {n, 3}, true), to_numpy(std::move(radii), {n, 3}, true),
                          to_numpy(std::move(rotation), {n, 3, 3}, true),
                          to_numpy(std::move(quaternions), {n, 4}, true), to_numpy(std::move(factor), {n, 3, 3}, true),
                          to_numpy(std::move(node), {n}, true), to_numpy(std::move(parent), {n}, true));
}

// (vertices (V, 3) float32, faces (F, 3) uint32) of an exact tree, read-only.
nb::tuple mesh_of(const HeldTree& held) {
    const TreeView& tree = held.view;
    const size_t v = tree.vertex_count(), f = tree.triangle_count();
    auto vertices = new_array<float>(3 * v);
    auto faces = new_array<uint32_t>(3 * f);
    for (size_t i = 0; i < v; ++i) {
        const Vec3 p = tree.vertex(static_cast<uint32_t>(i));
        vertices[3 * i] = p.x, vertices[3 * i + 1] = p.y, vertices[3 * i + 2] = p.z;
    }
    for (uint32_t i = 0; i < f; ++i) {
        const Triangle t = tree.triangle(i);
        std::copy(t.begin(), t.end(), &faces[size_t{3} * i]);
    }
    return nb::make_tuple(to_numpy(std::move(vertices), {v, 3}, true), to_numpy(std::move(faces), {f, 3}, true));
}

const char* name_of(Method m) {
    return m == Method::analytic ? "analytic" : "voxel";
}
const char* name_of(Primitive p) {
    return p == Primitive::sphere ? "sphere" : "ellipsoid";
}
const char* name_of(Quality q) {
    return q == Quality::fast ? "fast" : q == Quality::best ? "best" : "normal";
}

nb::dict level_info(const TreeView& tree, uint32_t l) {
    const LevelInfo level = tree.level(l);
    uint32_t ellipsoids = 0;
    tree.for_each_in_cut(l, [&](uint32_t) { ++ellipsoids; });
    nb::dict out;
    out["ellipsoids"] = ellipsoids;
    out["nodes"] = level.node_count;
    out["bytes"] = level.end_byte;
    out["outside_ratio"] = level.outside_ratio;
    out["outside_ratio_error"] = level.outside_ratio_error;
    out["union_volume"] = level.union_volume;
    out["hausdorff_max"] = level.hausdorff_max;
    out["hausdorff_mean"] = level.hausdorff_mean;
    out["hausdorff_p99"] = level.hausdorff_p99;
    return out;
}

nb::tuple three(double a, double b, double c) {
    return nb::make_tuple(a, b, c);
}

nb::dict mass_dict(const MassProperties& m) {
    const auto& [xx, yy, zz, xy, xz, yz] = m.inertia;
    nb::dict out;
    out["volume"] = m.volume;
    out["center"] = three(m.center[0], m.center[1], m.center[2]);
    out["inertia"] = nb::make_tuple(three(xx, xy, xz), three(xy, yy, yz), three(xz, yz, zz));
    out["volume_error"] = m.volume_error;
    out["center_error"] = m.center_error;
    out["inertia_error"] = m.inertia_error;
    return out;
}

nb::dict asked_dict(const BakeInfo& info) { // None: not asked
    const auto or_none = [](auto value, bool asked) -> nb::object { return asked ? nb::cast(value) : nb::none(); };
    nb::dict out;
    out["levels"] = or_none(info.levels, info.levels > 0);
    out["ellipsoids"] = or_none(info.ellipsoids, info.ellipsoids > 0);
    out["tolerance"] = or_none(info.tolerance, info.tolerance > 0);
    out["distance"] = or_none(info.distance, info.distance > 0);
    out["keep_holes"] = or_none(info.keep_holes, info.keep_holes > 0);
    out["fill"] = or_none(info.fill, info.fill > 0);
    out["weld"] = or_none(info.weld, info.weld >= 0);
    out["alpha"] = info.alpha;
    out["beta"] = info.beta;
    return out;
}

nb::dict info_of(const HeldTree& held) {
    const TreeView& tree = held.view;
    const BakeInfo info = tree.bake_info();
    nb::list levels;
    for (uint32_t l = 0; l < tree.level_count(); ++l) levels.append(level_info(tree, l));
    nb::dict out;
    out["bytes"] = tree.bytes().size();
    out["degree"] = tree.degree();
    out["node_count"] = tree.node_count();
    out["triangle_count"] = tree.triangle_count();
    out["vertex_count"] = tree.vertex_count();
    out["is_prefix"] = tree.is_prefix();
    out["exact"] = info.exact;
    out["proved"] = info.proved;
    out["surface_mode"] = info.surface_mode;
    out["goal_reached"] = info.goal_reached;
    out["is_inner"] = info.inner;
    out["volume"] = info.solid_volume;
    out["volume_error"] = info.solid_volume * static_cast<double>(info.solid_volume_error);
    out["mass"] = mass_dict(info.mass);
    out["diagonal"] = info.diagonal;
    out["scale"] = three(info.placement.scale[0], info.placement.scale[1], info.placement.scale[2]);
    out["origin"] = three(info.placement.origin[0], info.placement.origin[1], info.placement.origin[2]);
    out["asked"] = asked_dict(info);
    out["primitive"] = name_of(info.primitive);
    out["quality"] = name_of(info.quality);
    out["method"] = name_of(info.method);
    out["seed"] = info.seed;
    out["resolution"] = info.resolution;
    out["source_hash"] = info.source_hash;
    out["options_hash"] = info.options_hash;
    out["levels"] = nb::tuple(levels);
    return out;
}

} // namespace

const HeldTree& tree_of(nb::handle value, const char* name) {
    const HeldTree* held = nullptr;
    if (!nb::try_cast(value, held, false) || !held) type_error(name, "must be a prolate.Tree, not " + type_text(value));
    return *held;
}

nb::object owned_bytes(std::span<const std::byte> bytes) {
    auto copy = new_array<uint8_t>(bytes.size());
    if (!bytes.empty()) std::memcpy(copy.get(), bytes.data(), bytes.size());
    return to_numpy(std::move(copy), {bytes.size()}, true);
}

void bind_tree(nb::module_& m) {
    nb::class_<HeldTree>(m, "Tree")
        .def(
            "__init__",
            [](HeldTree* self, nb::handle buffer, bool check_hash) {
                new (self) HeldTree(open_tree(buffer, check_hash));
            },
            nb::arg("buffer").none(), nb::arg("check_hash"))
        .def_prop_ro("buffer", [](const HeldTree& self) { return self.owner; })
        .def_prop_ro("level_count", [](const HeldTree& self) { return self.view.level_count(); })
        .def_prop_ro("node_count", [](const HeldTree& self) { return self.view.node_count(); })
        .def_prop_ro("has_triangles", [](const HeldTree& self) { return self.view.has_triangles(); })
        .def(
            "level_end",
            [](const HeldTree& self, nb::handle level) { return self.view.level(level_of(self.view, level)).end_byte; },
            nb::arg("level").none())
        .def("inner_range",
             [](const HeldTree& self) -> nb::object { // of its bytes, or None
                 const auto inner = self.view.inner();
                 if (!inner) return nb::none();
                 const size_t begin = static_cast<size_t>(inner->bytes().data() - self.view.bytes().data());
                 return nb::make_tuple(begin, begin + inner->bytes().size());
             })
        .def("mode_range_array",
             [](const HeldTree& self) { // float32 (M,), M = 0 without a deformation
                 std::vector<float> ranges;
                 if (const auto modes = self.view.deformation())
                     for (uint32_t i = 0; i < modes->mode_count(); ++i) ranges.push_back(modes->range(i));
                 return to_numpy(ranges, {ranges.size()});
             })
        .def("count_bones",
             [](const HeldTree& self) {
                 const auto skin = self.view.skin();
                 return skin ? skin->bone_count() : 0;
             })
        .def("info_dict", &info_of)
        .def("cut_arrays", &cut, nb::arg("level").none())
        .def("mesh_arrays", &mesh_of);
}

} // namespace prolate::python

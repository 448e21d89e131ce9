// Trees of simple solids, made on the spot. Sizes are rounded up to floats.
#include "python/src/tree.hpp"

#include <prolate/primitives.hpp>

#include <bit>

namespace prolate::python {
namespace {

nb::object bytes_of(Result<Tree>&& tree, const char* sizes) {
    if (!tree && tree.error().code == ErrorCode::bad_options) value_error(sizes, tree.error().what);
    return owned_bytes(value_or_throw(std::move(tree)).bytes());
}

std::array<float, 3> three_above_0(nb::handle value, const char* name) {
    const Rows<double> row = rows_of_doubles(value, name, 3, true);
    if (!row.single) value_error(name, "must have shape (3,)");
    std::array<float, 3> out{};
    for (size_t k = 0; k < 3; ++k) {
        if (!(row.values[k] > 0)) value_error(name, "must be above 0");
        out[k] = rounded_up(row.values[k]);
    }
    return out;
}
float above_0(nb::handle value, const char* name) {
    const double number = number_from_0(value, name);
    if (!(number > 0)) value_error(name, "must be above 0");
    return rounded_up(number);
}

nb::object convex(nb::handle points, nb::handle faces) {
    const Rows<double> rows = rows_of_doubles(points, "points", 3, false);
    std::vector<Vec3> corners(rows.count);
    for (size_t i = 0; i < rows.count; ++i) {
        const double* const p = &rows.values[3 * i];
        corners[i] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    }
    const nb::object array = as_numpy(faces, "faces", "int64");
    const AnyArray view = import_array(array);
    if (view.ndim() != 2 || view.shape(1) != 3)
        value_error("faces", "must have shape (M, 3), not " + view.shape_text());
    std::vector<Triangle> triangles(view.shape(0));
    const auto* const from = static_cast<const int64_t*>(view.data());
    for (size_t i = 0; i < 3 * triangles.size(); ++i) {
        if (from[i] < 0 || static_cast<uint64_t>(from[i]) >= corners.size())
            value_error("faces[" + std::to_string(i / 3) + "]", "has the index " + std::to_string(from[i]) +
                                                                    "; there are " + std::to_string(corners.size()) +
                                                                    " points");
        triangles[i / 3][i % 3] = static_cast<uint32_t>(from[i]);
    }
    auto tree = convex_tree(corners, triangles);
    if (!tree && tree.error().code == ErrorCode::bad_mesh)
        throw Failure{tree.error(), "faces[" + std::to_string(tree.error().where) + "]"};
    return bytes_of(std::move(tree), "points");
}

} // namespace

void bind_primitives(nb::module_& m) {
    m.def(
        "box_tree",
        [](nb::handle half) {
            const auto [x, y, z] = three_above_0(half, "half");
            return bytes_of(box_tree({x, y, z}), "half");
        },
        nb::arg("half").none());
    m.def(
        "cylinder_tree",
        [](nb::handle radius, nb::handle half_height, nb::handle sides) {
            const auto count = static_cast<uint32_t>(whole(sides, "sides", 8, 1024));
            if (!std::has_single_bit(count)) value_error("sides", "must be a power of two");
            return bytes_of(cylinder_tree(above_0(radius, "radius"), above_0(half_height, "half_height"), count),
                            "radius, half_height");
        },
        nb::arg("radius").none(), nb::arg("half_height").none(), nb::arg("sides").none());
    m.def("convex_tree", &convex, nb::arg("points").none(), nb::arg("faces").none());
    m.def(
        "ellipsoid_tree",
        [](nb::handle radii) {
            const auto [a, b, c] = three_above_0(radii, "radii");
            return bytes_of(ellipsoid_tree({.center = {}, .l11 = a, .l22 = b, .l33 = c}), "radii");
        },
        nb::arg("radii").none());
    m.def(
        "sphere_tree", [](nb::handle radius) { return bytes_of(sphere_tree(above_0(radius, "radius")), "radius"); },
        nb::arg("radius").none());
}

} // namespace prolate::python

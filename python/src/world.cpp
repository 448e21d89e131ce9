// The bodies of a world.
#include "python/src/world.hpp"

#include "python/src/poses.hpp"

#include <cmath>

namespace prolate::python {
namespace {

double slack_of(nb::handle slack) {
    const double value = number_from_0(slack, "slack");
    if (value > 1) value_error("slack", "must be 0 to 1");
    return value;
}

RoundedPose rounded(const Poses& poses, size_t i, double reach) {
    if (poses.floats()) return {poses.floats()[poses.index(i)], 0};
    return in_frame({}, poses.at(i), reach);
}

RoundedPose one_pose(nb::handle value, const char* name, nb::handle order, double reach) {
    const Poses poses(value, name, order);
    if (!poses.single()) value_error(name, "must be one pose");
    return rounded(poses, 0, reach);
}

std::vector<BodyId> ids_of(nb::handle ids) {
    const nb::object array = as_numpy(ids, "ids", "uint64");
    const AnyArray view = import_array(array);
    if (view.ndim() != 1) value_error("ids", "must have shape (N,), not " + view.shape_text());
    std::vector<BodyId> out;
    for (size_t i = 0; i < view.shape(0); ++i) out.push_back(id_of(static_cast<const uint64_t*>(view.data())[i]));
    return out;
}

uint64_t id_number(nb::handle id) {
    return whole(id, "id", 0, UINT64_MAX);
}

} // namespace

uint64_t number_of(BodyId id) noexcept {
    return uint64_t{id.generation} << 32 | id.index;
}
BodyId id_of(uint64_t number) noexcept {
    return {.index = static_cast<uint32_t>(number), .generation = static_cast<uint32_t>(number >> 32)};
}
uint32_t bits_of(nb::handle value, const char* name) {
    return static_cast<uint32_t>(whole(value, name, 0, UINT32_MAX));
}

HeldWorld::HeldWorld(nb::handle slack)
    : world_(value_or_throw(World::create({.slack = static_cast<float>(slack_of(slack))}))) {}

// `shape` is a tree, or the row of a half-space; `parts` a sequence of (tree, pose).
uint64_t HeldWorld::insert(nb::handle shape, nb::handle pose, nb::handle parts_, nb::handle margin, nb::handle layers,
                           nb::handle mask, nb::handle order) {
    Body body{.shape = HalfSpace{}, .pose = {}, .layers = bits_of(layers, "layers"), .mask = bits_of(mask, "mask")};
    std::vector<nb::object> trees;
    std::vector<Part> parts;
    double slack = 0;
    if (nb::isinstance<HeldTree>(shape)) {
        const HeldTree& held = tree_of(shape, "shape");
        const RoundedPose at = one_pose(pose, "pose", order, held.reach);
        body.shape = held.view;
        body.pose = at.pose;
        slack = at.slack;
        trees.push_back(nb::borrow(shape));
    } else {
        const Rows<double> row = rows_of_doubles(shape, "shape", 4, true);
        const double* const n = row.values.data();
        body.shape =
            HalfSpace{{static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])}, rounded_up(n[3])};
    }
    for (const nb::handle part : parts_) {
        const nb::object tree = part[0], local = part[1];
        const HeldTree& held = tree_of(tree, "parts");
        const RoundedPose at = one_pose(local, "parts", order, held.reach);
        parts.push_back({held.view, at.pose});
        slack = std::max(slack, at.slack);
        trees.push_back(tree);
    }
    body.margin = rounded_up(number_from_0(margin, "margin") + slack);
    if (!std::isfinite(body.margin)) value_error("margin", "must be finite");
    const uint64_t id = number_of(value_or_throw(locked([&] { return world_.insert(body, parts); })));
    trees_.emplace(id, std::move(trees));
    return id;
}

void HeldWorld::remove(nb::handle id) {
    const uint64_t number = id_number(id);
    check_done(locked([&] { return world_.remove(id_of(number)); }), "id " + std::to_string(number));
    trees_.erase(number);
}

void HeldWorld::move(nb::handle ids, nb::handle poses_, nb::handle order) {
    const std::vector<BodyId> bodies = ids_of(ids);
    const Poses poses(poses_, "poses", order);
    if (poses.count() != bodies.size()) value_error("poses", "must be as many as ids");
    std::vector<Pose> to(bodies.size());
    for (size_t i = 0; i < to.size(); ++i) to[i] = rounded(poses, i, 0).pose;
    const auto moved = locked([&] { return world_.move(bodies, to); });
    if (!moved) throw Failure{moved.error(), "ids[" + std::to_string(moved.error().where) + "]"};
}

void HeldWorld::refilter(nb::handle id, nb::handle layers, nb::handle mask) {
    const uint64_t number = id_number(id);
    const uint32_t in = bits_of(layers, "layers"), meets = bits_of(mask, "mask");
    check_done(locked([&] { return world_.refilter(id_of(number), in, meets); }), "id " + std::to_string(number));
}

uint64_t HeldWorld::body_of(nb::handle id) {
    const uint64_t number = id_number(id);
    return number_of(locked([&] { return world_.body_of(id_of(number)); }));
}
uint64_t HeldWorld::part(nb::handle id, nb::handle i) {
    const uint64_t number = id_number(id);
    const auto index = static_cast<uint32_t>(whole(i, "i", 0, UINT32_MAX));
    return number_of(locked([&] { return world_.part(id_of(number), index); }));
}
uint32_t HeldWorld::count() {
    return locked([&] { return world_.body_count(); });
}

void bind_world(nb::module_& m) {
    const auto any = [](const char* name) { return nb::arg(name).none(); };
    nb::class_<HeldWorld>(m, "World")
        .def(nb::init<nb::handle>(), any("slack"))
        .def("insert", &HeldWorld::insert, any("shape"), any("pose"), any("parts"), any("margin"), any("layers"),
             any("mask"), any("order"))
        .def("remove", &HeldWorld::remove, any("id"))
        .def("move", &HeldWorld::move, any("ids"), any("poses"), any("order"))
        .def("refilter", &HeldWorld::refilter, any("id"), any("layers"), any("mask"))
        .def("body_of", &HeldWorld::body_of, any("id"))
        .def("part", &HeldWorld::part, any("id"), any("i"))
        .def("__len__", &HeldWorld::count)
        .def("pairs", &HeldWorld::pairs)
        .def("collide", &HeldWorld::collide, any("margin"), any("max_level"), any("budget"), any("threads"))
        .def("collide_solids", &HeldWorld::collide_solids, any("margin"), any("budget"), any("threads"))
        .def("distance", &HeldWorld::distance, any("tolerance"), any("max_distance"), any("budget"), any("threads"))
        .def("contacts", &HeldWorld::contacts, any("margin"), any("budget"), any("threads"))
        .def("raycast", &HeldWorld::raycast, any("origins"), any("directions"), any("radius"), any("max_t"),
             any("mask"), any("budget"), any("threads"))
        .def("sweep", &HeldWorld::sweep, any("tree"), any("start"), any("end"), any("margin"), any("tolerance"),
             any("mask"), any("budget"), any("threads"), any("order"))
        .def("overlap_shapes", &HeldWorld::overlap_shapes, any("shapes"), any("margin"), any("mask"), any("budget"),
             any("threads"))
        .def("overlap_tree", &HeldWorld::overlap_tree, any("tree"), any("poses"), any("margin"), any("mask"),
             any("budget"), any("threads"), any("order"));
}

} // namespace prolate::python

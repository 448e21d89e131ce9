// prolate._core.Robot, RobotScene and RobotChecks: robots at many configurations.
#include "python/src/robot_checks.hpp"

#include <nanobind/stl/unique_ptr.h>

#include <cmath>

namespace prolate::python {
namespace {

std::unique_ptr<Robot> make_robot(nb::handle columns, nb::handle link_count, nb::handle nq, nb::handle trees,
                                  nb::handle slacks, nb::handle pairs_) {
    const size_t links = whole(link_count, "links", 1, 1u << 20);
    const auto column = [&](size_t i) { return nb::object(columns[i]); };
    auto out = std::make_unique<Robot>(Chain(column(0), column(1), column(2), column(3), column(4), column(5),
                                             column(6), column(7), links, whole(nq, "nq", 0, 1u << 20)));
    for (const nb::handle tree : trees) out->links.push_back(tree.is_none() ? nullptr : body_of_tree(tree, "trees"));
    if (out->links.size() != links) value_error("trees", "must be as many as links");
    const Rows<double> slack = rows_of_doubles(slacks, "slack", links, true);
    for (size_t link = 0; link < links; ++link)
        if (out->links[link]) out->links[link]->slack = slack.values[link];
    const nb::object array = as_numpy(pairs_, "pairs", "int64");
    const AnyArray view = import_array(array);
    const auto* const from = static_cast<const int64_t*>(view.data());
    for (size_t i = 0; i + 1 < view.size(); i += 2) {
        const auto a = static_cast<uint64_t>(from[i]), b = static_cast<uint64_t>(from[i + 1]);
        if (a >= links || b >= links) value_error("pairs[" + std::to_string(i / 2) + "]", "names no link");
        out->pairs.push_back({static_cast<uint32_t>(a), static_cast<uint32_t>(b)});
    }
    return out;
}

// (L, N, 7)
nb::object frames_of(const Robot& robot, nb::handle q_, nb::handle threads) {
    const Chain& chain = robot.chain;
    const Rows<double> q = configurations(q_, "q", chain);
    const size_t n = q.count, links = chain.link_count();
    auto out = new_array<double>(links * n * 7);
    for_eights(q, chain.nq(), thread_count(threads), [&](size_t first, size_t count, const auto& rows, QueryContext&) {
        std::vector<LinkFrames>& frames = robot_scratch().frames;
        frames.resize(links);
        chain.frames(rows, frames.data());
        for (size_t link = 0; link < links; ++link)
            for (size_t lane = 0; lane < count; ++lane) {
                const auto [t, r] = pose_in(frames[link], lane);
                const double norm = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
                double* const row = &out[7 * (link * n + first + lane)];
                for (size_t k = 0; k < 3; ++k) row[k] = t[k];
                for (size_t k = 0; k < 4; ++k) row[3 + k] = r[k] / norm;
            }
    });
    return to_numpy(std::move(out), {links, n, 7});
}

} // namespace

void bind_robot(nb::module_& m) {
    nb::class_<Robot>(m, "Robot")
        .def(nb::new_(&make_robot), nb::arg("columns"), nb::arg("links"), nb::arg("nq"), nb::arg("trees"),
             nb::arg("slack"), nb::arg("pairs"))
        .def("fk", &frames_of, nb::arg("q").none(), nb::arg("threads").none());
    nb::class_<RobotScene>(m, "RobotScene")
        .def(nb::init<>())
        .def("add_tree", &RobotScene::add_tree, nb::arg("tree").none(), nb::arg("pose").none())
        .def("add_box", &RobotScene::add_box, nb::arg("half").none(), nb::arg("pose").none())
        .def("add_capsule", &RobotScene::add_capsule, nb::arg("a").none(), nb::arg("b").none(),
             nb::arg("radius").none(), nb::arg("pose").none())
        .def("add_half_space", &RobotScene::add_half_space, nb::arg("row").none())
        .def("add_points", &RobotScene::add_points, nb::arg("points").none(), nb::arg("radius").none(),
             nb::arg("pose").none());
    nb::class_<RobotChecks>(m, "RobotChecks")
        .def(nb::init<nb::object, nb::object, nb::handle>(), nb::arg("robot"), nb::arg("scene"), nb::arg("allowed"))
        .def("pairs", &RobotChecks::pairs)
        .def("collide", &RobotChecks::collide, nb::arg("q").none(), nb::arg("each"), nb::arg("threads").none())
        .def("distance", &RobotChecks::distance, nb::arg("q").none(), nb::arg("tolerance").none(),
             nb::arg("max_distance").none(), nb::arg("threads").none())
        .def("motion", &RobotChecks::motion, nb::arg("q0").none(), nb::arg("q1").none(), nb::arg("depth").none(),
             nb::arg("budget").none(), nb::arg("threads").none());
}

} // namespace prolate::python

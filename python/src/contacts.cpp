// Contact manifolds at many poses, as ragged arrays: those of query i are rows offsets[i] ... offsets[i + 1] - 1.
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/contacts.hpp>

#include <cmath>

namespace prolate::python {
namespace {

// All points of the manifolds of one query, in the world.
struct Contact {
    Point point_a, point_b, normal;
    double depth;
    uint64_t id;
    uint32_t manifold;
};

void collect(const ContactManifolds& found, const PlacedBodies& at, std::vector<Contact>& out) {
    for (uint32_t m = 0; m < found.count; ++m) {
        const Manifold& manifold = found.manifolds[m];
        for (uint32_t p = 0; p < manifold.count; ++p) {
            const ContactPoint& point = manifold.points[p];
            out.push_back({at.to_world(point.point_a), at.to_world(point.point_b),
                           at.direction_to_world(manifold.normal), point.depth, point.id, m});
        }
    }
}

nb::tuple contact_arrays(const std::vector<std::vector<Contact>>& found) {
    const size_t n = found.size();
    auto offsets = new_array<int64_t>(n + 1);
    offsets[0] = 0;
    for (size_t i = 0; i < n; ++i) offsets[i + 1] = offsets[i] + static_cast<int64_t>(found[i].size());
    const auto m = static_cast<size_t>(offsets[n]);
    auto point_a = new_array<double>(3 * m), point_b = new_array<double>(3 * m), normal = new_array<double>(3 * m),
         depth = new_array<double>(m);
    auto id = new_array<uint64_t>(m);
    auto manifold = new_array<int64_t>(m);
    size_t row = 0;
    for (const auto& contacts : found)
        for (const Contact& c : contacts) {
            std::copy(c.point_a.begin(), c.point_a.end(), &point_a[3 * row]);
            std::copy(c.point_b.begin(), c.point_b.end(), &point_b[3 * row]);
            std::copy(c.normal.begin(), c.normal.end(), &normal[3 * row]);
            depth[row] = c.depth, id[row] = c.id, manifold[row] = c.manifold;
            ++row;
        }
    return nb::make_tuple(to_numpy(std::move(offsets), {n + 1}), to_numpy(std::move(point_a), {m, 3}),
                          to_numpy(std::move(point_b), {m, 3}), to_numpy(std::move(normal), {m, 3}),
                          to_numpy(std::move(depth), {m}), to_numpy(std::move(manifold), {m}),
                          to_numpy(std::move(id), {m}));
}

nb::tuple contacts_of(nb::handle a, nb::handle poses_a_, nb::handle b, nb::handle poses_b_, nb::handle margin,
                      nb::handle max_level, nb::handle budget, nb::handle threads, bool wxyz) {
    const HeldTree &tree_a = tree_of(a, "a"), &tree_b = tree_of(b, "b");
    const Poses poses_a(poses_a_, "poses_a", wxyz), poses_b(poses_b_, "poses_b", wxyz);
    const size_t count = broadcast(poses_a, "poses_a", poses_b, "poses_b");
    const double wide = number_from_0(margin, "margin");
    const auto level = static_cast<uint32_t>(whole_or(max_level, "max_level", 0, UINT32_MAX, kMaxLevels));
    const uint64_t tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    std::vector<std::vector<Contact>> found(count);
    auto verdict = new_array<uint8_t>(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = place(poses_a, tree_a.reach, poses_b, tree_b.reach, i);
        ContactManifolds manifolds;
        const ContactResult r =
            contacts(tree_a.view, at.a, tree_b.view, at.b, manifolds, context,
                     {.max_level = level, .max_pair_tests = tests, .margin = rounded_up(wide + at.slack)});
        verdict[i] = static_cast<uint8_t>(r.verdict);
        collect(manifolds, at, found[i]);
    });
    return nb::make_tuple(contact_arrays(found), to_numpy(std::move(verdict), {count}));
}

} // namespace

void bind_contacts(nb::module_& m) {
    m.def("contacts", &contacts_of, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("wxyz"));
}

} // namespace prolate::python

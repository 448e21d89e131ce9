// Contact manifolds at many poses, as ragged arrays: those of query i are rows offsets[i] ... offsets[i + 1] - 1.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/contacts.hpp>

#include <cmath>

namespace prolate::python {
namespace {

nb::tuple contacts_of(nb::handle a, nb::handle poses_a_, nb::handle b, nb::handle poses_b_, nb::handle margin,
                      nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle order) {
    const HeldTree &tree_a = tree_of(a, "a"), &tree_b = tree_of(b, "b");
    const Poses poses_a(poses_a_, "poses_a", order), poses_b(poses_b_, "poses_b", order);
    const size_t count = broadcast(poses_a, "poses_a", poses_b, "poses_b");
    const Limits limits(margin, max_level, budget);
    std::vector<std::vector<Contact>> found(count);
    auto verdict = new_array<uint8_t>(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = place(poses_a, tree_a.reach, poses_b, tree_b.reach, i);
        ContactManifolds manifolds;
        const ContactResult r =
            contacts(tree_a.view, at.a, tree_b.view, at.b, manifolds, context, limits.options(at.slack));
        verdict[i] = static_cast<uint8_t>(r.verdict);
        collect(manifolds, at, found[i]);
    });
    return nb::make_tuple(contact_arrays(found), to_numpy(std::move(verdict), {count}));
}

} // namespace

void bind_contacts(nb::module_& m) {
    m.def("contacts", &contacts_of, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python

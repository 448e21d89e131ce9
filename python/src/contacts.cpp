// Contact manifolds at many poses, as ragged arrays: those of query i are rows offsets[i] ... offsets[i + 1] - 1.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"

#include <prolate/contacts.hpp>

#include <cmath>

namespace prolate::python {
namespace {

nb::tuple contacts_of(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle margin,
                      nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle order) {
    const Bodies bodies(a, poses_a, b, poses_b, order);
    const Limits limits(margin, max_level, budget);
    std::vector<std::vector<Contact>> found(bodies.count());
    auto verdict = new_array<uint8_t>(found.size());
    for_all(found.size(), thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        ContactManifolds manifolds;
        const ContactResult r =
            contacts(bodies.a(), at.a, bodies.b(), at.b, manifolds, context, limits.options(at.slack));
        verdict[i] = static_cast<uint8_t>(r.verdict);
        collect(manifolds, at, found[i]);
    });
    return nb::make_tuple(contact_arrays(found), to_numpy(std::move(verdict), {found.size()}));
}

} // namespace

void bind_contacts(nb::module_& m) {
    m.def("contacts", &contacts_of, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python

// Bodies that deform, at many poses and coordinates: collide_deformed.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"

#include <prolate/deform.hpp>

#include <algorithm>

namespace prolate::python {
namespace {

// Rows of coordinates, rounded to float; none for a body at rest.
class Coordinates {
public:
    Coordinates(nb::handle value, const TreeView& tree, const char* name) {
        if (value.is_none()) return;
        const auto modes = tree.deformation();
        if (!modes) value_error(name, "the tree has no modes");
        columns_ = modes->mode_count();
        const Rows<double> rows = rows_of_doubles(value, name, columns_, true, false);
        count_ = rows.count, single_ = rows.single;
        for (const double x : rows.values) values_.push_back(static_cast<float>(x));
    }
    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return single_; }
    std::span<const float> row(size_t i) const noexcept {
        return std::span(values_).subspan(count_ == 1 ? 0 : i * columns_, columns_);
    }

private:
    std::vector<float> values_;
    size_t columns_ = 0, count_ = 1;
    bool single_ = true;
};

// How many queries there are: of each, one, or all as many.
size_t broadcast(const Bodies& bodies, const Coordinates& a, const Coordinates& b) {
    const size_t count = std::max({bodies.count(), a.count(), b.count()});
    const auto fits = [count](size_t n) { return n == 1 || n == count; };
    if (bodies.count() == 0 || a.count() == 0 || b.count() == 0) return 0;
    if (!fits(a.count()))
        value_error("q_a", "has " + std::to_string(a.count()) + " rows, not 1 or " + std::to_string(count));
    if (!fits(b.count()))
        value_error("q_b", "has " + std::to_string(b.count()) + " rows, not 1 or " + std::to_string(count));
    if (!fits(bodies.count()))
        value_error("poses_a",
                    "there are " + std::to_string(bodies.count()) + " poses, not 1 or " + std::to_string(count));
    return count;
}

nb::object collide_deformed(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle b, nb::handle poses_b,
                            nb::handle q_b, nb::handle margin, nb::handle max_level, nb::handle budget,
                            nb::handle threads, nb::handle order) {
    const Bodies bodies(a, poses_a, b, poses_b, order);
    const Coordinates of_a(q_a, bodies.a(), "q_a"), of_b(q_b, bodies.b(), "q_b");
    const Limits limits(margin, max_level, budget);
    const size_t count = broadcast(bodies, of_a, of_b);
    auto verdicts = new_array<uint8_t>(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(bodies.count() == 1 ? 0 : i);
        verdicts[i] = static_cast<uint8_t>(
            collide({bodies.a(), at.a, of_a.row(i)}, {bodies.b(), at.b, of_b.row(i)}, context, limits.options(at.slack))
                .verdict);
    });
    if (bodies.single() && of_a.single() && of_b.single()) return nb::int_(verdicts[0]);
    return to_numpy(std::move(verdicts), {count});
}

} // namespace

void bind_deform(nb::module_& m) {
    m.def("collide_deformed", &collide_deformed, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("q_a").none(),
          nb::arg("b").none(), nb::arg("poses_b").none(), nb::arg("q_b").none(), nb::arg("margin").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python

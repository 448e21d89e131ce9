#include "query/inside/enclosure.hpp"

#include "query/inside/inside.hpp"
#include "query/node/lattice.hpp"
#include "query/triangle/placed.hpp"
#include "src/block_box.hpp"

#include <glm/vector_relational.hpp>

namespace prolate::query {
namespace {

class InsideSearch {
public:
    InsideSearch(const TreeView& outer, const TreeView& inner, const RelativePose& to_outer, QueryStats& stats,
                 uint64_t most_tests)
        : outer_(outer), inner_(inner), to_outer_(to_outer), stats_(stats), most_tests_(most_tests) {}

    Verdict look() const {
        if (!outer_.has_triangles() || outer_.surface_mode() || a_sample_is_outside()) return Verdict::separated;
        Verdict verdict = Verdict::separated;
        for (uint32_t v = 0; v < inner_.component_count() && verdict == Verdict::separated; ++v)
            verdict = look(position(inner_, v));
        for (uint32_t n = 0; n < inner_.slot_count() && !inner_.has_triangles() && verdict == Verdict::separated; ++n)
            if (inner_.is_node(n) && inner_.is_leaf(n))
                verdict = look(to_double(inner_.ellipsoid(n).center) * double{inner_.scale()});
        return verdict;
    }

private:
    // A surface in one piece lies inside wholly or not at all: it does not if one of its vertices is outside the root's
    // box, which holds all that the surface of `outer` encloses. A few, spread over it, mostly save the ray.
    bool a_sample_is_outside() const {
        constexpr uint32_t kSamples = 8;
        if (inner_.component_count() != 1) return false;
        const LatticeInfo lattice = outer_.raw().lattice();
        const double step = step_of(lattice);
        const BlockBoxes boxes(outer_.raw().block(0));
        glm::dvec3 low, high; // metres, exact
        for (size_t i = 0; i < 3; ++i) {
            const double origin = static_cast<double>(lattice.origin[i]) + boxes.origin(i), box_step = boxes.step(i);
            low[static_cast<glm::length_t>(i)] = (origin + boxes.low(i, 0) * box_step) * step;
            high[static_cast<glm::length_t>(i)] = (origin + boxes.high(i, 0) * box_step) * step;
        }
        for (uint32_t i = 0; i < kSamples; ++i) {
            const auto v = static_cast<uint32_t>(uint64_t{inner_.vertex_count()} * i / kSamples);
            const PlacedPoint p = place(position(inner_, v), to_outer_);
            const glm::dvec3 slack(kSeparationMargin * p.reach);
            if (glm::any(glm::lessThan(p.position, low - slack)) ||
                glm::any(glm::greaterThan(p.position, high + slack)))
                return true;
        }
        return false;
    }
    Verdict look(const glm::dvec3& p) const {
        const auto winding = winding_number(outer_, place(p, to_outer_), stats_, most_tests_);
        return !winding ? Verdict::undecided : *winding != 0 ? Verdict::overlapping : Verdict::separated;
    }

    const TreeView& outer_;
    const TreeView& inner_;
    const RelativePose& to_outer_;
    QueryStats& stats_;
    const uint64_t most_tests_;
};

} // namespace

Verdict look_inside(const TreeView& a, const TreeView& b, const RelativePose& b_to_a, QueryStats& stats,
                    uint64_t most_tests) noexcept {
    if (!a.has_triangles() && !b.has_triangles()) return Verdict::separated;
    const Verdict first = InsideSearch(a, b, b_to_a, stats, most_tests).look();
    return first != Verdict::separated ? first : InsideSearch(b, a, inverse(b_to_a), stats, most_tests).look();
}

} // namespace prolate::query

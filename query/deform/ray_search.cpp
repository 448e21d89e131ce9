// Depth first, the nearest child first; nothing is opened beyond the best hit.
#include "query/deform/ray_search.hpp"

#include <algorithm>

namespace prolate::query {

PlacedRay place(const Ray& ray, const RelativePose& to_frame, const Deformed& body, double margin) noexcept {
    const Bound root = body.bound(0);
    // What the deformation adds to the rounding that ray.hpp accounts for.
    const double slack = kSeparationMargin * (root.core.reach + to_frame.distance);
    return place(ray, to_frame.rotation, to_frame.translation, to_frame.distance,
                 {root.core.center, root.core.size, root.core.reach}, margin + root.radius + slack);
}

// Is the node met, and from which parameter on, before the best hit?
bool RaySearch::test(uint32_t node_tested, double& enters) noexcept {
    if (stats.tests() >= most_tests) {
        out_of_tests_ = true;
        return false;
    }
    ++stats.pair_tests;
    stats.deepest_level = std::max(stats.deepest_level, body.tree().level_of(node_tested));
    const Bound bound = body.bound(node_tested);
    const double within = margin + bound.radius;
    const auto met =
        within > 0 ? hit_within(within, ray, bound.core, kDeformedRayMargin) : hit(ray, bound.core, kDeformedRayMargin);
    if (!met || (found && met->t > best.t)) return false;
    enters = met->t;
    if (body.ends_at(node_tested) && body.triangles(node_tested).count == 0) {
        found = true, best = *met, node = node_tested, triangle = kNoTriangle;
        return false;
    }
    return true;
}

void RaySearch::meet_triangles(uint32_t leaf, TriangleRange triangles) noexcept {
    for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t) {
        if (stats.tests() >= most_tests) {
            out_of_tests_ = true;
            return;
        }
        ++stats.triangle_tests;
        const PlacedTriangle placed = body.triangle(t);
        const auto met = margin > 0 ? hit_within(margin, ray, placed, kDeformedRayMargin)
                                    : hit(ray, placed, kDeformedTriangleMargin);
        if (!met || (found && met->t >= best.t)) continue;
        found = true, best = *met, node = leaf, triangle = t;
        if (any) return;
    }
}

// The nearest on top.
void RaySearch::push_children(uint32_t opened, uint32_t& size) noexcept {
    const ChildRange children = body.tree().children(opened);
    const uint32_t base = size;
    for (uint32_t c = children.first; c < children.first + children.count; ++c) {
        double enters = 0;
        if (!test(c, enters)) {
            if (out_of_tests_ || (found && any)) return;
            continue;
        }
        uint32_t at = size++;
        for (; at > base && stack[at - 1].bound < static_cast<float>(enters); --at) stack[at] = stack[at - 1];
        stack[at] = {c, 0, static_cast<float>(enters), 0}; // orders the search, and no more
    }
}

bool RaySearch::run() noexcept {
    uint32_t size = 0;
    double enters = 0;
    if (test(0, enters)) stack[size++] = {0, 0, 0, 0};
    while (size > 0 && !out_of_tests_ && !(found && any)) {
        const uint32_t top = stack[--size].node_a;
        if (body.ends_at(top))
            meet_triangles(top, body.triangles(top));
        else
            push_children(top, size);
    }
    return !out_of_tests_;
}

} // namespace prolate::query

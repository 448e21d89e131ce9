#include "query/deform/body.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

glm::dvec3 to_dvec3(const double (&x)[3]) {
    return {x[0], x[1], x[2]};
}

} // namespace

Deformed::Deformed(const DeformedBody& body, uint32_t max_level) noexcept
    : body_(body), modes_(body.tree.deformation()), skin_(body.tree.skin()),
      limit_from_(max_level < body.tree.level_count() ? body.tree.first_slot(max_level) : UINT32_MAX) {
    in_range_ = body.q.empty() || (modes_ && body.q.size() == modes_->mode_count());
    for (uint32_t m = 0; in_range_ && m < body.q.size(); ++m) in_range_ = std::abs(body.q[m]) <= modes_->range(m);
    if (body.bones.empty()) return;
    in_range_ = in_range_ && skin_ && body.bones.size() == skin_->bone_count() && are_sound(body.bones);
    if (in_range_) skinning_.emplace(*skin_, body.bones, double{body.tree.scale()});
}

bool Deformed::encloses() const noexcept {
    const bool rests = body_.q.empty() && body_.bones.empty(); // then leaves cover the inside, too
    return !tree().surface_mode() && (tree().has_triangles() || !rests) && witness_count() > 0;
}

Bound Deformed::bound(uint32_t node) const noexcept {
    const double scale = tree().scale();
    Bound out{place(tree().bound(node), scale), 0};
    ModeShift by;
    if (!body_.q.empty()) {
        const Deformation::Moved moved = modes_->moved(node, body_.q);
        out.radius = scale * moved.radius;
        by.shift = scale * to_dvec3(moved.shift), by.spread = moved.growth * out.core.size + out.radius;
        out.core.center += by.shift;
        out.core.reach += scale * glm::length(to_dvec3(moved.lengths)) + by.spread;
        out.core.factor *= 1 + moved.growth;
        out.core.size *= 1 + moved.growth;
    }
    return skinning_ ? skinning_->moved(node, out, by) : out;
}

PlacedPoint Deformed::moved(const glm::dvec3& at_rest, uint32_t point) const noexcept {
    PlacedPoint out{at_rest, glm::length(at_rest)};
    if (!body_.q.empty()) {
        const double scale = tree().scale();
        const Deformation::Moved moved = modes_->displaced(point, body_.q);
        out.position += scale * to_dvec3(moved.shift), out.reach += scale * glm::length(to_dvec3(moved.lengths));
    }
    return skinning_ ? skinning_->moved(point, out) : out;
}

PlacedTriangle Deformed::triangle(uint32_t t) const noexcept {
    PlacedTriangle out{};
    const Triangle corners = tree().triangle(t);
    for (size_t i = 0; i < 3; ++i) {
        const PlacedPoint corner = moved(position(tree(), corners[i]), corners[i]);
        out.corner[i] = corner.position;
        out.reach = std::max(out.reach, corner.reach);
    }
    return out;
}

uint32_t Deformed::witness_count() const noexcept {
    if (tree().has_triangles()) return tree().component_count();
    return modes_ ? modes_->point_count() : skin_ ? skin_->point_count() : 0;
}

PlacedPoint Deformed::witness(uint32_t w) const noexcept {
    if (tree().has_triangles()) return moved(position(tree(), w), w);
    return moved(to_double(modes_ ? modes_->point(w) : skin_->point(w)) * double{tree().scale()}, w);
}

Bound place(const Bound& of_b, const RelativePose& b_to_a) noexcept {
    Bound out = of_b;
    out.core.reach += b_to_a.distance;
    out.core.center = b_to_a.rotation * out.core.center + b_to_a.translation;
    out.core.factor = b_to_a.rotation * out.core.factor;
    return out;
}

PlacedTriangle place(const PlacedTriangle& of_b, const RelativePose& b_to_a) noexcept {
    PlacedTriangle out = of_b;
    for (glm::dvec3& corner : out.corner) corner = b_to_a.rotation * corner + b_to_a.translation;
    out.reach += b_to_a.distance;
    return out;
}

} // namespace prolate::query

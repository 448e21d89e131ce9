#include "query/deform/body.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {

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
    return !tree().surface_mode() && (witness_count() > 0);
}

Bound Deformed::bound(uint32_t node) const noexcept {
    const double scale = tree().scale();
    Bound out{place(tree().bound(node), scale), 0};
    double moved = 0, grown = 1;
    ModeShift by;
    for (uint32_t m = 0; m < body_.q.size(); ++m) {
        const double q = body_.q[m];
        if (q == 0) continue;
        const Deformation::Motion motion = modes_->motion(node, m);
        const glm::dvec3 shift = scale * q * glm::dvec3(motion.shift[0], motion.shift[1], motion.shift[2]);
        out.core.center += shift, by.shift += shift;
        moved += glm::length(shift);
        grown += std::abs(q) * motion.growth;
        out.radius += scale * std::abs(q) * motion.radius;
    }
    by.spread = (grown - 1) * out.core.size + out.radius;
    out.core.factor *= grown;
    out.core.reach += moved + by.spread;
    out.core.size *= grown;
    return skinning_ ? skinning_->moved(node, out, by) : out;
}

PlacedPoint Deformed::moved(const glm::dvec3& at_rest, uint32_t point) const noexcept {
    PlacedPoint out{at_rest, glm::length(at_rest)};
    for (uint32_t m = 0; m < body_.q.size(); ++m) {
        const double q = body_.q[m];
        if (q == 0) continue;
        const glm::dvec3 shift = double{tree().scale()} * q * to_double(modes_->displacement(point, m));
        out.position += shift;
        out.reach += glm::length(shift);
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

// What meets a box, or a box on its way: the queries that only need the bodies' boxes.
#include "query/world/path.hpp"
#include "query/world/state.hpp"

namespace prolate {

void World::visit_boxes(const Bounds& box, uint32_t mask, bool (*call)(void*, BodyId), void* user) const {
    const State& s = *state_;
    const State::Busy busy(s);
    const auto wanted = [&](uint32_t index) { return (s.marks[index].layers & mask) != 0; };
    const auto may_meet = [&](uint32_t index) {
        const Body& body = s.entries[index].body;
        return body.half_space() == nullptr || !query::certainly_apart(*body.half_space(), body.margin, box);
    };
    for (const uint32_t index : s.unbounded)
        if (wanted(index) && may_meet(index) && !call(user, s.id(index))) return;
    s.tree.walk([&](const Bounds& other) { return overlap(box, other); },
                [&](uint32_t index) { return !wanted(index) || call(user, s.id(index)); });
}

void World::cast_boxes(const Bounds& box, const Vec3& direction, float until, uint32_t mask,
                       float (*call)(void*, BodyId, float), void* user) const {
    const State& s = *state_;
    const auto show = [&](uint32_t index) {
        if ((s.marks[index].layers & mask) != 0) until = call(user, s.id(index), until);
        return !(until < 0);
    };
    if (until < 0) return;
    const State::Busy busy(s);
    for (const uint32_t index : s.unbounded)
        if (!show(index)) return;
    const query::Path path(box, direction);
    s.tree.walk([&](const Bounds& other) { return path.meets(other, until); },
                [&](const Bounds& first, const Bounds& second) { return path.second_first(first, second); }, show);
}

} // namespace prolate

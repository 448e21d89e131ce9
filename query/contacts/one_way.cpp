#include "query/contacts/one_way.hpp"

#include "query/triangle/support.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr size_t kAsked = 2, kSummed = 32; // pairs: for what they have by themselves, and for the mean of their faces
constexpr double kAgreement = 0.02;        // of faces: the length of their mean, at least
constexpr uint32_t kTurns = 2;             // directions that are not by climbs
// Cosines: of faces that are turned farther from the normal, or look so far the wrong way, there are no points.
constexpr double kSteep = 0.4, kAskew = 0.1;
// Shares of the way's depth.
constexpr double kConfirmed = 0.75;                         // something must lie as deep
constexpr double kNearlyAsDeep = 0.05;                      // of bodies that are apart, nearly
constexpr double kSlackOfWay = 0.02;                        // what pairs may overlap by more
constexpr double kOwnShorter = 0.7, kOwnMuchShorter = 0.25; // a pair whose own way is as short takes that, not this one
constexpr double kBeside = 1.5;          // by more, the deepest points of the two bodies do not lie opposite each other
constexpr double kLeanOutwards = 0x1p-6; // of what lies as far out, the deeper counts
constexpr double kOutline = 0x1p-10;     // of the extent: what lies farther out by less does not matter

double length_or_one(const dvec3& v) {
    const double length = glm::length(v);
    return length > 0 ? length : 1;
}

} // namespace

void FacesMean::add(const PlacedTriangle& a, const PlacedTriangle& b) noexcept {
    const dvec3 of_a = face_normal(a), of_b = face_normal(b);
    sum_ += of_a / length_or_one(of_a) - of_b / length_or_one(of_b), count_ += 2;
}

dvec3 FacesMean::direction() const noexcept {
    const double length = glm::length(sum_);
    return length > kAgreement * count_ ? sum_ / length : dvec3(0);
}

void OneWay::start(const Way& way, bool by_climbs) noexcept {
    way_ = way, points_ = Patch(way.normal, kLeanOutwards), by_climbs_ = by_climbs, beside_ = -HUGE_VAL, faces_ = {};
}

bool OneWay::begin(std::span<const MeetingPair> some) noexcept {
    const auto of_triangles = [](const MeetingPair& pair) {
        return pair.triangle_a != kNoTriangle && pair.triangle_b != kNoTriangle;
    };
    if (!std::all_of(some.begin(), some.end(), of_triangles)) return false;
    FacesMean faces;
    const size_t stride = (some.size() + kSummed - 1) / kSummed;
    for (size_t i = 0; i < some.size(); i += stride)
        faces.add(bodies_.triangle_a(some[i]), bodies_.triangle_b(some[i]));
    const dvec3 mean = faces.direction();
    if (mean == dvec3(0)) return false;
    const MeetingPair* from = nullptr;
    Way best{mean, HUGE_VAL};
    const auto look = [&](const dvec3& n, const MeetingPair& pair) {
        const double overlap = bodies_.overlap(n, pair, best.depth);
        if (overlap < best.depth) best = {n, overlap}, from = &pair;
    };
    look(mean, some[some.size() / 2]);
    for (size_t i = 0; i < kAsked; ++i) {
        const MeetingPair& pair = some[i * (some.size() - 1) / (kAsked - 1)];
        const TriangleContact own =
            contact(bodies_.surrounded_a(pair.triangle_a), bodies_.surrounded_b(pair.triangle_b), bodies_.margin);
        if (own.count == 0) continue;
        look(own.normal, pair);
        own_ = std::min(own_, own.overlap);
    }
    for (const bool of_a : {true, false}) { // of all faces those that are turned the least from their mean
        Way face{mean, -1};
        const MeetingPair* of = &some[0];
        for (const MeetingPair& pair : some) {
            const dvec3 outward = face_normal(of_a ? bodies_.triangle_a(pair) : bodies_.triangle_b(pair)),
                        n = (of_a ? outward : -outward) / length_or_one(outward);
            if (glm::dot(n, mean) > face.depth) face = {n, glm::dot(n, mean)}, of = &pair;
        }
        look(face.normal, *of);
    }
    if (from == nullptr) return false;
    const Way way = bodies_.shortest_way(best.normal, *from, HUGE_VAL);
    if (own_is_shorter(kOwnShorter, way.depth))
        start({mean, HUGE_VAL}, false), ++turns_;
    else
        start(way, true);
    return true;
}

bool OneWay::turn() noexcept {
    if (apart_) return false;
    const std::optional<Way> between = bodies_.margin > 0 ? bodies_.between_nearest() : std::nullopt;
    if (between) {
        apart_ = true, start(*between, true);
        return true;
    }
    const dvec3 n = by_climbs_ ? faces_.direction() : bears_;
    if (n == dvec3(0) || turns_ == kTurns) return false;
    start({n, HUGE_VAL}, false);
    ++turns_;
    return true;
}

void OneWay::take(const Contact& c) noexcept {
    points_.add(way_.normal, candidates_.of(c), 0, c.overlap, bodies_.same_point);
}

// Neither face may look the wrong way: there the bodies go through each other.
bool OneWay::clip(const MeetingPair& pair, const PlacedTriangle& a, const PlacedTriangle& b) noexcept {
    const dvec3 out_a = face_normal(a), out_b = face_normal(b);
    if (glm::dot(way_.normal, out_a) < -kAskew * glm::length(out_a)) return false;
    if (glm::dot(way_.normal, out_b) > kAskew * glm::length(out_b)) return false;
    const TriangleContact found = contact_along(way_.normal, a, b, bodies_.margin, kSteep);
    for (uint32_t i = 0; i < found.count; ++i) {
        const TriangleContact::Point& p = found.points[i];
        if (points_.may_take(0.5 * (p.on_a + p.on_b), p.depth, bodies_.same_point))
            take(bodies_.contact_of(found, i, pair));
    }
    return found.count > 0;
}

void OneWay::add(const MeetingPair& pair) noexcept {
    const PlacedTriangle a = bodies_.triangle_a(pair), b = bodies_.triangle_b(pair);
    faces_.add(a, b);
    const double overlap = support(a, way_.normal) + support(b, -way_.normal);
    const auto extent = [&](const dvec3& d) {
        return Extent{std::max(-support(a, -d), -support(b, -d)), std::min(support(a, d), support(b, d))};
    };
    const bool resolved = overlap <= most();
    if (by_climbs_ && resolved && !points_.empty() &&
        !(points_.gain(overlap, bodies_.same_point, kOutline, extent) > -2 * bodies_.same_point))
        return;
    if (clip(pair, a, b) && !by_climbs_) return;
    // Parts that are apart and lie beside each other are nearer along the way: a plane between all around them will do.
    const bool between = by_climbs_ && way_.depth < 0 && !resolved && overlap <= 0 && !(beside_ > most());
    beside_ = std::max(beside_, between && bodies_.overlap(way_.normal, pair, 0) <= 0 ? way_.depth : overlap);
}

bool OneWay::confirm() noexcept {
    return !points_.empty() && (by_climbs_ ? confirm_climbs() : confirm_inside());
}

// What pairs may overlap by, if this is the way.
double OneWay::most() const noexcept {
    return way_.depth + kSlackOfWay * std::abs(way_.depth) + bodies_.same_point;
}

// Of bodies that are apart, within the margin, no pair needs a way out at all.
bool OneWay::own_is_shorter(double share, double depth) const noexcept {
    return depth > 0 && own_ < share * depth - bodies_.same_point;
}

// Other parts of the bodies may be deeper than what was climbed.
bool OneWay::confirm_climbs() noexcept {
    if (points_.depth() > most() || beside_ > most()) return false;
    // Apart, and by more than climbs say: these are as near as hills of fine bodies let them come.
    if (way_.depth < 0 && !apart_ &&
        points_.depth() < way_.depth - kNearlyAsDeep * std::abs(way_.depth) - bodies_.same_point)
        return false;
    const Patch from = points_; // which it adds to
    bodies_.deepest(from, {way_.normal, HUGE_VAL}, [this](const Contact& c) { take(c); });
    if (points_.depth() < way_.depth - (1 - kConfirmed) * std::abs(way_.depth) - bodies_.same_point) return false;
    points_.deepen(way_.depth);
    way_.depth = points_.depth();
    return true;
}

bool OneWay::confirm_inside() noexcept {
    const Patch from = points_; // which it adds to
    if (own_is_shorter(kOwnMuchShorter, points_.depth())) return false;
    const TouchingBodies::Inside inside = bodies_.deepest_inside(from, way_, [this](const Contact& c) { take(c); });
    points_.deepen(std::min(inside.overlap, kBeside * points_.depth()));
    way_.depth = points_.depth();
    if (way_.depth > shortest_ + bodies_.same_point)
        return false; // than along the mean, from which this one was turned
    shortest_ = way_.depth;
    bears_ = inside.face;
    if (bears_ == dvec3(0)) { // points of pairs are the deepest
        FacesMean there;
        const MeetingPair& pair = points_.deepest().pair;
        there.add(bodies_.triangle_a(pair), bodies_.triangle_b(pair));
        bears_ = there.direction();
    }
    if (glm::dot(bears_, way_.normal) < 0) bears_ = -bears_;
    // Else another direction, or several.
    return glm::dot(bears_, way_.normal) >= kFacing && beside_ <= most() &&
           !own_is_shorter(kOwnMuchShorter, points_.depth());
}

} // namespace prolate::query

// The boxes' test is that of robot_cells.cpp, with the same slack, one link against one other body in eight
// configurations at a time.
#include "python/src/robot_checks.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace prolate::python {
namespace {

template <class T> PROLATE_ROBOT_INLINE Floats along(const Floats3& v, const Lanes3<T>& n) {
    return v.x * n.x + v.y * n.y + v.z * n.z;
}

PROLATE_ROBOT_CLONES void place_box(const RobotBody& body, const LinkFrames& at, PlacedBox<Floats>& out) {
    const Cells& cells = body.cells;
    const Doubles zero{};
    const Doubles3 center = {zero + double{cells.root.center[0]}, zero + double{cells.root.center[1]},
                             zero + double{cells.root.center[2]}};
    out.center = narrowed(at.t + rotated(at.q, center));
    const Floats x = narrowed(at.q[0]), y = narrowed(at.q[1]), z = narrowed(at.q[2]), w = narrowed(at.q[3]);
    out.axis[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)};
    out.axis[1] = {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)};
    out.axis[2] = {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)};
    const Floats slack = (narrowed(at.extent) + static_cast<float>(body.reach)) * kBoxSlack + rounded_up(body.slack);
    for (size_t k = 0; k < 3; ++k) out.half[k] = slack + cells.root.half[k];
    out.radius = slack + cells.radius;
}

// The gap along the best of six axes: the boxes are no nearer. Infinite where the ball around `a` is farther than
// `margin` from `b`.
template <class T>
PROLATE_ROBOT_INLINE Floats gap_of(const PlacedBox<Floats>& a, const PlacedBox<T>& b, const Floats& margin) {
    const Floats3 d = {a.center.x - b.center.x, a.center.y - b.center.y, a.center.z - b.center.z};
    const std::array<Floats, 3> in_b = {absolute(along(d, b.axis[0])), absolute(along(d, b.axis[1])),
                                        absolute(along(d, b.axis[2]))};
    Floats squares{};
    for (size_t i = 0; i < 3; ++i) {
        const Floats beyond = at_least_0(in_b[i] - b.half[i]);
        squares = squares + beyond * beyond;
    }
    const Floats near = a.radius + margin;
    const Ints apart = squares > near * near;
    if (bits(apart) == (1u << kLanes) - 1) return Floats{} + kInfinity;
    Floats turned[3][3]; // |b's axis i . a's axis k|
    for (size_t i = 0; i < 3; ++i)
        for (size_t k = 0; k < 3; ++k) turned[i][k] = absolute(along(a.axis[k], b.axis[i]));
    Floats gap = Floats{} - kInfinity;
    for (size_t i = 0; i < 3; ++i) {
        gap = greater(gap, in_b[i] - (b.half[i] + (a.half[0] * turned[i][0] + a.half[1] * turned[i][1] +
                                                   a.half[2] * turned[i][2])));
        gap = greater(
            gap, absolute(dot(d, a.axis[i])) -
                     (a.half[i] + (turned[0][i] * b.half[0] + turned[1][i] * b.half[1] + turned[2][i] * b.half[2])));
    }
    return apart ? Floats{} + kInfinity : gap;
}

PROLATE_ROBOT_INLINE Floats gap_of_ground(const PlacedBox<Floats>& a, const PlacedBox<float>& ground) {
    Floats low = along(a.center, ground.axis[0]) - ground.radius;
    for (size_t k = 0; k < 3; ++k) low = low - a.half[k] * absolute(along(a.axis[k], ground.axis[0]));
    return low;
}

PROLATE_ROBOT_INLINE void take(uint32_t pair, const Floats& gap, const Floats& margin,
                               std::array<std::vector<Candidate>, kLanes>& candidates) {
    for (uint32_t left = bits(!(gap > margin)); left != 0; left &= left - 1) {
        const auto lane = static_cast<size_t>(__builtin_ctz(left));
        const float known = gap[lane] == gap[lane] ? gap[lane] : -kInfinity; // beyond the range of floats: asked first
        candidates[lane].push_back({pair, known});
    }
}

struct PairLists {
    const RobotPair* pairs;
    const PlacedBox<Floats>* links;
    const PlacedBox<float>* bodies;
    const RobotBody* const* scene;
};
PROLATE_ROBOT_CLONES void find_candidates(const uint32_t* among, size_t count, const PairLists& lists,
                                          const OneFloats* margins,
                                          std::array<std::vector<Candidate>, kLanes>& candidates) {
    for (size_t i = 0; i < count; ++i) {
        const RobotPair& pair = lists.pairs[among[i]];
        const PlacedBox<Floats>& link = lists.links[pair.link];
        const Floats margin = margins ? margins[i].lanes : Floats{};
        if (!pair.in_scene)
            take(among[i], gap_of(link, lists.links[pair.other], margin), margin, candidates);
        else if (lists.scene[pair.other]->kind == RobotBody::Kind::half_space)
            take(among[i], gap_of_ground(link, lists.bodies[pair.other]), margin, candidates);
        else
            take(among[i], gap_of(link, lists.bodies[pair.other], margin), margin, candidates);
    }
}

// What stands around, for gap_of().
PlacedBox<float> standing(const RobotBody& body) {
    PlacedBox<float> out{};
    const auto vec = [](const Point& p) {
        return Lanes3<float>{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    };
    if (body.kind == RobotBody::Kind::half_space) {
        out.axis[0] = vec({body.plane[0], body.plane[1], body.plane[2]});
        out.radius = static_cast<float>(body.plane[3]) + 2 * kBoxSlack * static_cast<float>(std::abs(body.plane[3]));
        return out;
    }
    const Cell& root = body.cells.root;
    const Point center = transformed(body.pose, {root.center[0], root.center[1], root.center[2]});
    out.center = vec(center);
    float size = 0;
    for (size_t k = 0; k < 3; ++k) {
        Point unit{};
        unit[k] = 1;
        out.axis[k] = vec(rotated(body.pose, unit));
        size += static_cast<float>(std::abs(center[k])) + root.half[k];
    }
    for (size_t k = 0; k < 3; ++k) out.half[k] = root.half[k] + kBoxSlack * size;
    out.radius = body.cells.radius + kBoxSlack * size;
    return out;
}

bool moves(const ChainJoint& joint) noexcept {
    return joint.kind != JointKind::fixed;
}

} // namespace

RobotScratch& robot_scratch() {
    thread_local RobotScratch scratch;
    return scratch;
}

RobotChecks::RobotChecks(nb::object robot, nb::object scene, nb::handle allowed)
    : keep_robot_(std::move(robot)), keep_scene_(std::move(scene)), robot_(nb::cast<const Robot&>(keep_robot_)) {
    for (const auto& body : nb::cast<const RobotScene&>(keep_scene_).bodies()) {
        bodies_.push_back(body.get());
        boxes_.push_back(standing(*body));
    }
    find_pairs(allowed);
    decide_still_pairs();
}

void RobotChecks::find_pairs(nb::handle allowed) {
    const nb::object array = as_numpy(allowed, "allowed", "int64");
    const AnyArray free = import_array(array);
    const auto is_allowed = [&](uint32_t link, uint32_t body) {
        const auto* const at = static_cast<const int64_t*>(free.data());
        for (size_t i = 0; i + 1 < free.size(); i += 2)
            if (at[i] == int64_t{link} && at[i + 1] == int64_t{body}) return true;
        return false;
    };
    for (const auto& [a, b] : robot_.pairs)
        if (robot_.links[a] && robot_.links[b]) pairs_.push_back({.link = a, .other = b, .in_scene = false});
    for (uint32_t link = 0; link < robot_.links.size(); ++link)
        for (uint32_t body = 0; robot_.links[link] && body < bodies_.size(); ++body)
            if (!is_allowed(link, body)) pairs_.push_back({.link = link, .other = body, .in_scene = true});
    // How many joints up from the link is the first link that is also above the other, and does a joint between move?
    const auto climb = [&](uint32_t from, const std::vector<bool>& stop, bool& moving) {
        size_t steps = 0;
        for (uint32_t at = from; !stop[at] && robot_.chain.joint_of(at); ++steps) {
            moving = moving || moves(*robot_.chain.joint_of(at));
            at = robot_.chain.joint_of(at)->parent;
        }
        return steps;
    };
    const auto above = [&](uint32_t link) {
        std::vector<bool> out(robot_.chain.link_count());
        for (uint32_t at = link;; at = robot_.chain.joint_of(at)->parent) {
            out[at] = true;
            if (!robot_.chain.joint_of(at)) return out;
        }
    };
    for (uint32_t i = 0; i < pairs_.size(); ++i) {
        RobotPair& pair = pairs_[i];
        bool moving = false;
        if (pair.in_scene) {
            pair.joints = climb(pair.link, std::vector<bool>(robot_.chain.link_count()), moving);
        } else {
            pair.joints = climb(pair.link, above(pair.other), moving);
            pair.joints_other = climb(pair.other, above(pair.link), moving);
        }
        (moving ? moving_ : still_).push_back(i);
    }
}

// At any configuration, because they are still in all.
void RobotChecks::decide_still_pairs() {
    std::vector<double> q(std::max<size_t>(nq(), 1), 0);
    for (const ChainJoint& joint : robot_.chain.joints()) {
        if (joint.kind == JointKind::ball) q[joint.coordinate + 3] = 1;
        if (joint.kind == JointKind::floating) q[joint.coordinate + 6] = 1;
    }
    const double* rows[kLanes];
    std::fill(std::begin(rows), std::end(rows), q.data());
    RobotScratch& scratch = robot_scratch();
    place(rows, scratch);
    std::copy_if(still_.begin(), still_.end(), std::back_inserter(touching_),
                 [&](uint32_t i) { return touches(pairs_[i], 0, 0, scratch, thread_context()); });
}

void RobotChecks::place(const double* const (&q)[kLanes], RobotScratch& scratch) const noexcept {
    scratch.frames.resize(robot_.chain.link_count());
    scratch.boxes.resize(robot_.chain.link_count());
    scratch.tallies.resize(pairs_.size());
    robot_.chain.frames(q, scratch.frames.data());
    for (size_t link = 0; link < robot_.links.size(); ++link)
        if (const auto& body = robot_.links[link]) place_box(*body, scratch.frames[link], scratch.boxes[link]);
}

void RobotChecks::cull(std::span<const uint32_t> among, const OneFloats* margins,
                       RobotScratch& scratch) const noexcept {
    for (auto& lane : scratch.candidates) lane.clear();
    find_candidates(among.data(), among.size(), {pairs_.data(), scratch.boxes.data(), boxes_.data(), bodies_.data()},
                    margins, scratch.candidates);
}

RobotChecks::PairPoses RobotChecks::poses_of(const RobotPair& pair, size_t lane,
                                             const RobotScratch& scratch) const noexcept {
    const RobotBody& a = *robot_.links[pair.link];
    const RobotBody& b = pair.in_scene ? *bodies_[pair.other] : *robot_.links[pair.other];
    const LinkFrames& at = scratch.frames[pair.link];
    PairPoses out{a, b, pose_in(at, lane), b.pose, a.slack + rounding_in(at, lane, a.reach)};
    if (!pair.in_scene) {
        const LinkFrames& at_b = scratch.frames[pair.other];
        out.pose_b = pose_in(at_b, lane);
        out.rounding += b.slack + rounding_in(at_b, lane, b.reach);
    }
    return out;
}

bool RobotChecks::touches(const RobotPair& pair, size_t lane, double margin, const RobotScratch& scratch,
                          QueryContext& context) const noexcept {
    const PairPoses at = poses_of(pair, lane, scratch);
    return may_touch(at.a, at.pose_a, at.b, at.pose_b, margin + at.rounding, context);
}

bool RobotChecks::any_touches(size_t lane, RobotScratch& scratch, QueryContext& context) const noexcept {
    auto& found = scratch.candidates[lane];
    std::vector<Tally>& tallies = scratch.tallies;
    std::sort(found.begin(), found.end(), [&](const Candidate& a, const Candidate& b) {
        const float chance_a = tallies[a.pair].chance(), chance_b = tallies[b.pair].chance();
        return chance_a != chance_b ? chance_a > chance_b : a.gap < b.gap;
    });
    return std::any_of(found.begin(), found.end(), [&](const Candidate& candidate) {
        const bool meet = touches(pairs_[candidate.pair], lane, 0, scratch, context);
        tallies[candidate.pair].add(meet);
        return meet;
    });
}

DistanceRange RobotChecks::nearest(size_t lane, double tolerance, double most, RobotScratch& scratch,
                                   QueryContext& context, int64_t& which) const noexcept {
    auto& found = scratch.candidates[lane];
    for (const uint32_t i : still_) found.push_back({i, -kInfinity});
    std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) { return a.gap < b.gap; });
    DistanceRange best{most, std::numeric_limits<double>::infinity()};
    for (const Candidate& candidate : found) {
        if (candidate.gap > best.upper) break;
        const double bound = std::min(best.upper, most);
        const PairPoses at = poses_of(pairs_[candidate.pair], lane, scratch);
        const DistanceRange here =
            distance_of(at.a, at.pose_a, at.b, at.pose_b, bound + at.rounding, tolerance, context);
        best.lower = std::min(best.lower, std::max(here.lower - at.rounding, 0.0));
        if (here.upper + at.rounding < best.upper || which < 0) {
            best.upper = std::min(best.upper, here.upper + at.rounding);
            which = candidate.pair;
        }
        if (best.upper <= 0) break;
    }
    return best;
}

nb::object RobotChecks::pairs() const {
    auto out = new_array<int64_t>(3 * pairs_.size());
    for (size_t i = 0; i < pairs_.size(); ++i) {
        out[3 * i] = pairs_[i].link, out[3 * i + 1] = pairs_[i].other, out[3 * i + 2] = pairs_[i].in_scene;
    }
    return to_numpy(std::move(out), {pairs_.size(), 3});
}

nb::object RobotChecks::collide(nb::handle q_, bool each, nb::handle threads) const {
    const Rows<double> q = configurations(q_, "q", robot_.chain);
    const size_t columns = each ? pairs_.size() : 1;
    auto out = new_array<uint8_t>(q.count * columns);
    std::fill_n(out.get(), q.count * columns, uint8_t{0});
    for_eights(q, nq(), thread_count(threads),
               [&](size_t first, size_t count, const auto& rows, QueryContext& context) {
                   RobotScratch& scratch = robot_scratch();
                   if (!each && !touching_.empty()) {
                       std::fill_n(&out[first], count, uint8_t{1});
                       return;
                   }
                   place(rows, scratch);
                   cull(moving_, nullptr, scratch);
                   for (size_t lane = 0; lane < count; ++lane) {
                       uint8_t* const row = &out[(first + lane) * columns];
                       if (!each) {
                           *row = any_touches(lane, scratch, context);
                           continue;
                       }
                       for (const uint32_t i : touching_) row[i] = 1;
                       for (const Candidate& candidate : scratch.candidates[lane])
                           row[candidate.pair] = touches(pairs_[candidate.pair], lane, 0, scratch, context);
                   }
               });
    if (each) return to_numpy(std::move(out), {q.count, columns});
    return to_numpy(std::move(out), {q.count});
}

nb::tuple RobotChecks::distance(nb::handle q_, nb::handle tolerance, nb::handle max_distance,
                                nb::handle threads) const {
    const Rows<double> q = configurations(q_, "q", robot_.chain);
    const double near = number_from_0(tolerance, "tolerance");
    const double most =
        max_distance.is_none() ? std::numeric_limits<double>::infinity() : number_from_0(max_distance, "max_distance");
    const std::vector<OneFloats> margins(moving_.size(), OneFloats{Floats{} + rounded_up(most)});
    auto lower = new_array<double>(q.count), upper = new_array<double>(q.count);
    auto pair = new_array<int64_t>(q.count);
    for_eights(q, nq(), thread_count(threads),
               [&](size_t first, size_t count, const auto& rows, QueryContext& context) {
                   RobotScratch& scratch = robot_scratch();
                   place(rows, scratch);
                   cull(moving_, margins.data(), scratch);
                   for (size_t lane = 0; lane < count; ++lane) {
                       pair[first + lane] = -1;
                       const DistanceRange found = nearest(lane, near, most, scratch, context, pair[first + lane]);
                       lower[first + lane] = found.lower, upper[first + lane] = found.upper;
                   }
               });
    return nb::make_tuple(to_numpy(std::move(lower), {q.count}), to_numpy(std::move(upper), {q.count}),
                          to_numpy(std::move(pair), {q.count}));
}

} // namespace prolate::python

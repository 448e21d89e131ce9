// Is a straight motion in joint space free, between its ends, too? Conservative advancement by halving, in eights (B.
// Mirtich, "Impulse-based Dynamic Simulation of Rigid Body Systems", 1996, has the idea).
//
// In the middle of an interval, let m be how far any point of one body of a pair can move, as the other sees it, until
// an end. If the bodies are farther apart than m in the middle, they are so all along. Where they are not, the interval
// is cut into eight, for those pairs alone.
//
// How far is m? Let a link hang on joint j, which turns by at most w until the end of the interval. A point that is p
// in the child's frame in the middle, and p' at another time, moves in the parent's frame by at most |p' - p| + w d(p),
// d(p) being its distance from the axis: turn p, then add p' - p, turned. Along the chain, |p' - p| is what the joints
// below make of it. So m is the sum over the joints between the two links of w times the distance, in the middle, of
// the link's farthest point from the axis. Joints that shift add how far they shift.
#include "python/src/robot_checks.hpp"

#include <prolate/query.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::python {

// Of one motion: how far each joint turns and shifts, from its start to its end.
struct JointTravel {
    double turn = 0, shift = 0;
};

namespace {

size_t first_of_quaternion(const ChainJoint& joint) noexcept {
    return joint.coordinate + (joint.kind == JointKind::floating ? 3 : 0);
}

// q1's quaternion as a unit one, on q0's side of the sphere; returns half the angle between them.
double align(double* a, double* b) noexcept {
    const auto norm = [](const double* q) { return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]); };
    const double la = norm(a), lb = norm(b);
    for (size_t k = 0; k < 4; ++k) a[k] /= la, b[k] /= lb;
    if (a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0)
        for (size_t k = 0; k < 4; ++k) b[k] = -b[k];
    double less = 0, more = 0;
    for (size_t k = 0; k < 4; ++k) less += (a[k] - b[k]) * (a[k] - b[k]), more += (a[k] + b[k]) * (a[k] + b[k]);
    return 2 * std::atan2(std::sqrt(less), std::sqrt(more));
}

} // namespace

class MotionSearch {
public:
    MotionSearch(const RobotChecks& checks, const double* q0, const double* q1, size_t depth, uint64_t budget,
                 QueryContext& context)
        : checks_(checks), chain_(checks.robot_.chain), q0_(q0, q0 + chain_.nq()), q1_(q1, q1 + chain_.nq()),
          travel_(chain_.joints().size()), half_angles_(travel_.size()), depth_(depth), budget_(budget),
          context_(context) {
        for (size_t j = 0; j < travel_.size(); ++j) travel_[j] = travel_of(j);
    }

    Verdict run() {
        if (!checks_.touching_.empty()) return Verdict::overlapping;
        return search(0, 1, 0, checks_.moving_);
    }

private:
    JointTravel travel_of(size_t j) {
        const ChainJoint& joint = chain_.joints()[j];
        const size_t c = joint.coordinate;
        // The last term is more than what rounding of a configuration in between loses.
        const auto change = [&](size_t i) {
            return std::abs(q1_[i] - q0_[i]) + 0x1p-48 * (std::abs(q0_[i]) + std::abs(q1_[i]));
        };
        switch (joint.kind) {
        case JointKind::fixed:
            return {};
        case JointKind::revolute:
        case JointKind::continuous:
            return {.turn = std::abs(joint.multiplier) * change(c)};
        case JointKind::prismatic:
            return {.shift = std::abs(joint.multiplier) * change(c)};
        case JointKind::planar:
            return {.turn = change(c + 2), .shift = std::hypot(change(c), change(c + 1))};
        case JointKind::ball:
        case JointKind::floating:
            break;
        }
        const size_t first = first_of_quaternion(joint);
        half_angles_[j] = align(&q0_[first], &q1_[first]);
        const double turn = 2 * half_angles_[j] + 0x1p-46;
        if (joint.kind == JointKind::ball) return {.turn = turn};
        return {.turn = turn, .shift = std::hypot(change(c), change(c + 1), change(c + 2))};
    }

    void configuration(double s, double* out) const noexcept {
        for (size_t i = 0; i < q0_.size(); ++i) out[i] = q0_[i] + s * (q1_[i] - q0_[i]);
        for (size_t j = 0; j < travel_.size(); ++j) {
            const ChainJoint& joint = chain_.joints()[j];
            // Quaternions so near to each other need no even rate: they differ by less than rounding allows for.
            if (!has_quaternion(joint) || half_angles_[j] < 1e-8) continue;
            const double whole = std::sin(half_angles_[j]), a = std::sin((1 - s) * half_angles_[j]) / whole,
                         b = std::sin(s * half_angles_[j]) / whole;
            for (size_t i = first_of_quaternion(joint); i < first_of_quaternion(joint) + 4; ++i)
                out[i] = a * q0_[i] + b * q1_[i];
        }
    }

    // How far points of `link` move from the middle of an interval to its end, as the link `joints` above sees it;
    // `part` of the whole motion.
    Doubles reach_of_motion(uint32_t link, size_t joints, double part, const RobotScratch& scratch) const noexcept {
        const RobotBody& body = *checks_.robot_.links[link];
        const Doubles3 center = widened(scratch.boxes[link].center);
        const Doubles radius = __builtin_convertvector(scratch.boxes[link].radius, Doubles);
        Doubles out{};
        for (uint32_t at = link; joints > 0; --joints) {
            const ChainJoint& joint = *chain_.joint_of(at);
            const JointTravel& travel = travel_[static_cast<size_t>(&joint - chain_.joints().data())];
            if (travel.turn > 0) {
                const LinkFrames& frame = scratch.frames[at];
                const Doubles3 arm = center - (frame.t + rotated(frame.q, joint.anchor));
                const bool about_axis = !has_quaternion(joint);
                const Doubles3 lever = about_axis ? cross(rotated(frame.q, joint.axis), arm) : arm;
                out = out + (square_root(dot(lever, lever)) + radius) * travel.turn;
            }
            out = out + travel.shift;
            at = joint.parent;
        }
        // The center is in single precision; the ball's radius makes up for that, and this for the rest.
        return out * (part * (1 + 0x1p-40)) + 0x1p-46 * body.reach;
    }
    static Doubles3 widened(const Floats3& v) noexcept {
        return {__builtin_convertvector(v.x, Doubles), __builtin_convertvector(v.y, Doubles),
                __builtin_convertvector(v.z, Doubles)};
    }

    /// Of each pair: m in each of the eight intervals.
    std::vector<OneFloats> margins_of(std::span<const uint32_t> among, double part, const RobotScratch& scratch) const {
        std::vector<OneFloats> out(among.size());
        for (size_t i = 0; i < among.size(); ++i) {
            const RobotPair& pair = checks_.pairs_[among[i]];
            Doubles m = reach_of_motion(pair.link, pair.joints, part, scratch);
            if (!pair.in_scene) m = m + reach_of_motion(pair.other, pair.joints_other, part, scratch);
            out[i].lanes = narrowed(m) * (1 + 0x1p-20f);
        }
        return out;
    }

    // From `low` to `high` of the motion.
    Verdict search(double low, double high, size_t level, const std::vector<uint32_t>& among) {
        const double width = (high - low) / kLanes;
        std::vector<double> q(kLanes * std::max<size_t>(chain_.nq(), 1));
        const double* rows[kLanes];
        for (size_t lane = 0; lane < kLanes; ++lane) {
            rows[lane] = &q[lane * chain_.nq()];
            configuration(low + (static_cast<double>(lane) + 0.5) * width, &q[lane * chain_.nq()]);
        }
        RobotScratch& scratch = robot_scratch();
        checks_.place(rows, scratch);
        const std::vector<OneFloats> margins = margins_of(among, 0.5 * width, scratch);
        checks_.cull(among, margins.data(), scratch);

        std::array<std::vector<uint32_t>, kLanes> left; // pairs that are not settled
        for (size_t lane = 0; lane < kLanes; ++lane) {
            for (const Candidate& candidate : scratch.candidates[lane]) {
                const RobotPair& pair = checks_.pairs_[candidate.pair];
                const auto at = std::lower_bound(among.begin(), among.end(), candidate.pair) - among.begin();
                const double margin = double{margins[static_cast<size_t>(at)].lanes[lane]};
                if (budget_ == 0) return Verdict::undecided;
                --budget_;
                if (!checks_.touches(pair, lane, margin, scratch, context_)) continue;
                if (checks_.touches(pair, lane, 0, scratch, context_)) return Verdict::overlapping;
                left[lane].push_back(candidate.pair);
            }
        }
        for (size_t lane = 0; lane < kLanes; ++lane) {
            if (left[lane].empty()) continue;
            if (level + 1 >= depth_) return Verdict::undecided;
            const double from = low + static_cast<double>(lane) * width;
            if (const Verdict below = search(from, from + width, level + 1, left[lane]); below != Verdict::separated)
                return below;
        }
        return Verdict::separated;
    }

    const RobotChecks& checks_;
    const Chain& chain_;
    std::vector<double> q0_, q1_;
    std::vector<JointTravel> travel_;
    std::vector<double> half_angles_; ///< of joints with quaternions, between the ends
    size_t depth_;
    uint64_t budget_;
    QueryContext& context_;
};

nb::object RobotChecks::motion(nb::handle q0_, nb::handle q1_, nb::handle depth_, nb::handle budget_,
                               nb::handle threads) const {
    const Rows<double> q0 = configurations(q0_, "q0", robot_.chain), q1 = configurations(q1_, "q1", robot_.chain);
    if (q0.count != q1.count)
        value_error("q1", "has " + std::to_string(q1.count) + " configurations and q0 " + std::to_string(q0.count));
    const size_t depth = whole(depth_, "depth", 1, 16);
    const uint64_t budget = whole_or(budget_, "budget", 0, UINT64_MAX, UINT64_MAX);
    auto out = new_array<uint8_t>(q0.count);
    for_all(q0.count, thread_count(threads), [&](size_t i, QueryContext& context) {
        MotionSearch search(*this, q0.values.data() + i * nq(), q1.values.data() + i * nq(), depth, budget, context);
        out[i] = static_cast<uint8_t>(search.run());
    });
    return to_numpy(std::move(out), {q0.count});
}

} // namespace prolate::python

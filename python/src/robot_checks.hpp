// A robot among other bodies, at many configurations: which pairs of bodies can meet at all, and do they?
//
// Eight configurations are looked at together. Their links' frames are computed in double precision; then boxes around
// the links are compared, in single precision, with those of the other bodies of each pair. The pairs that are left are
// asked one by one (robot_bodies.hpp), the one whose boxes overlap most first, because it is likeliest to end the
// search.
#pragma once

#include "python/src/batch.hpp"
#include "python/src/robot_bodies.hpp"

#include <span>
#include <vector>

namespace prolate::python {

/// A box, the ball around it, and where they are: Floats in eight configurations, or floats in all.
template <class T> struct alignas(32) PlacedBox {
    Lanes3<T> center;
    std::array<Lanes3<T>, 3> axis; ///< unit vectors
    std::array<T, 3> half;
    T radius;
};

/// A link and what it may meet.
struct RobotPair {
    uint32_t link, other; ///< `other`: a link, or a body of the scene
    bool in_scene;
    size_t joints = 0, joints_other = 0; ///< from each up to the nearest link above both; to the root, in a scene
};

struct Candidate {
    uint32_t pair;
    float gap; ///< of the boxes, along one of their axes; negative where they overlap
};

/// How often a pair was asked lately, and met.
struct Tally {
    uint32_t asked = 0, met = 0;
    void add(bool meet) noexcept {
        if (asked == 1024) asked /= 2, met /= 2;
        ++asked, met += meet ? 1 : 0;
    }
    /// Its chance to meet (Laplace's rule of succession).
    float chance() const noexcept { return static_cast<float>(met + 1) / static_cast<float>(asked + 2); }
};

/// What a thread works in.
struct RobotScratch {
    std::vector<Tally> tallies; ///< of the pairs of the checks that were last asked; only the order depends on them
    std::vector<LinkFrames> frames;
    std::vector<PlacedBox<Floats>> boxes; ///< of links
    std::array<std::vector<Candidate>, kLanes> candidates;
};

class RobotChecks {
public:
    /// `allowed`, (n, 2): a link and a body of the scene that may touch.
    RobotChecks(nb::object robot, nb::object scene, nb::handle allowed);

    size_t nq() const noexcept { return robot_.chain.nq(); }
    /// (P, 3): link, other, whether the other is of the scene.
    nb::object pairs() const;

    /// uint8 (N,) or, with `each`, (N, P): may they touch?
    nb::object collide(nb::handle q, bool each, nb::handle threads) const;
    /// (lower (N,), upper (N,), pair int64 (N,))
    nb::tuple distance(nb::handle q, nb::handle tolerance, nb::handle max_distance, nb::handle threads) const;
    /// uint8 (N,), Verdicts: is the straight motion from q0 to q1 free?
    nb::object motion(nb::handle q0, nb::handle q1, nb::handle depth, nb::handle budget, nb::handle threads) const;

private:
    friend class MotionSearch;

    /// The frames and boxes of all links at eight configurations.
    void place(const double* const (&q)[kLanes], RobotScratch& scratch) const noexcept;
    /// Which of `among` may come within their margins, lane by lane; `margins` null: 0.
    void cull(std::span<const uint32_t> among, const OneFloats* margins, RobotScratch& scratch) const noexcept;
    /// May the pair come within `margin` in the configuration of this lane?
    bool touches(const RobotPair& pair, size_t lane, double margin, const RobotScratch& scratch,
                 QueryContext& context) const noexcept;
    bool any_touches(size_t lane, RobotScratch& scratch, QueryContext& context) const noexcept;
    DistanceRange nearest(size_t lane, double tolerance, double most, RobotScratch& scratch, QueryContext& context,
                          int64_t& which) const noexcept;
    struct PairPoses {
        const RobotBody &a, &b;
        DoublePose pose_a, pose_b;
        double rounding; ///< by what the bodies may really be nearer, metres
    };
    PairPoses poses_of(const RobotPair& pair, size_t lane, const RobotScratch& scratch) const noexcept;
    void find_pairs(nb::handle allowed);
    void decide_still_pairs();

    nb::object keep_robot_, keep_scene_;
    const Robot& robot_;
    std::vector<const RobotBody*> bodies_; ///< of the scene, as it was
    std::vector<RobotPair> pairs_;
    std::vector<uint32_t> moving_;        ///< pairs whose sides move against each other
    std::vector<uint32_t> still_;         ///< other pairs
    std::vector<uint32_t> touching_;      ///< of these, the ones that touch: always
    std::vector<PlacedBox<float>> boxes_; ///< of the scene's bodies; of a half-space, its normal and offset
};

/// The scratch of this thread.
RobotScratch& robot_scratch();

/// Calls work(first, count, rows, context) for eight configurations after the other; the last one is repeated where
/// there are fewer.
template <class Work> void for_eights(const Rows<double>& q, size_t nq, int threads, const Work& work) {
    for_all((q.count + kLanes - 1) / kLanes, threads, [&](size_t block, QueryContext& context) {
        const double* rows[kLanes];
        const size_t first = kLanes * block, count = std::min(kLanes, q.count - first);
        for (size_t lane = 0; lane < kLanes; ++lane)
            rows[lane] = q.values.data() + nq * (first + std::min(lane, count - 1));
        work(first, count, rows, context);
    });
}

} // namespace prolate::python

// The bodies that robots are asked about: links, and what stands around them.
#pragma once

#include "python/src/robot_cells.hpp"
#include "python/src/robot_chain.hpp"
#include "python/src/tree.hpp"

#include <prolate/distance.hpp>
#include <prolate/tree.hpp>

#include <memory>
#include <optional>
#include <vector>

namespace prolate::python {

struct RobotBody {
    enum class Kind : uint8_t { tree, box, half_space, points };

    Kind kind = Kind::tree;
    DoublePose pose;               ///< in the root's frame, of what stands around; a link's comes from the chain
    double slack = 0;              ///< what it stands for may stick out of it by as much, metres
    double reach = 0;              ///< no point of it is farther from its frame's origin, metres
    Cells cells;                   ///< none of a half-space
    std::optional<TreeView> view;  ///< of a tree or a box
    std::array<float, 3> half{};   ///< of a box
    std::array<double, 4> plane{}; ///< unit normal and offset, in the root's frame, of a half-space
    std::vector<Vec3> points;
    float radius = 0;          ///< of the points
    std::vector<uint32_t> ids; ///< the points of the cells' leaves
    nb::object keep;           ///< the tree's object
    std::optional<Tree> own;   ///< or the tree
};

std::unique_ptr<RobotBody> body_of_tree(nb::handle tree, const char* name);

/// What stands around a robot.
class RobotScene {
public:
    RobotScene() = default;
    RobotScene(const RobotScene&) = delete;
    void add_tree(nb::handle tree, nb::handle pose);
    void add_box(nb::handle half, nb::handle pose);
    void add_capsule(nb::handle a, nb::handle b, nb::handle radius, nb::handle pose);
    void add_half_space(nb::handle row);
    void add_points(nb::handle points, nb::handle radius, nb::handle pose);

    const std::vector<std::unique_ptr<RobotBody>>& bodies() const noexcept { return bodies_; }

private:
    void place(std::unique_ptr<RobotBody> body, nb::handle pose);
    std::vector<std::unique_ptr<RobotBody>> bodies_;
};

/// A robot: how it moves, its links' bodies, and which pairs of them are looked at.
struct Robot {
    Chain chain;
    std::vector<std::unique_ptr<RobotBody>> links; ///< null: nothing to hit
    std::vector<std::array<uint32_t, 2>> pairs;

    explicit Robot(Chain chain_) : chain(std::move(chain_)) {}
    Robot(const Robot&) = delete;
};

/// A link, and another body, placed for the runtime: one of them in the frame of the larger one.
struct PlacedPair {
    Pose a, b;
    double slack;       ///< rounding moves no point of them farther, metres
    bool in_b;          ///< the frame is b's; then b is at the identity, else a
    FloatPlace smaller; ///< in the frame of the larger
};
PlacedPair placed_pair(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b,
                       const DoublePose& pose_b) noexcept;

/// May link `a` come within `margin` of body `b`? False is certified, of the poses as they are.
bool may_touch(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b, const DoublePose& pose_b,
               double margin, QueryContext& context) noexcept;

struct DistanceRange {
    double lower, upper; ///< certified, metres
};
/// How far are they apart? Said only of what is nearer than `most`.
DistanceRange distance_of(const RobotBody& a, const DoublePose& pose_a, const RobotBody& b, const DoublePose& pose_b,
                          double most, double tolerance, QueryContext& context) noexcept;

} // namespace prolate::python

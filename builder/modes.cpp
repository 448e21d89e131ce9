// add_modes(): for each node and mode, a ball around all U(x). Its center is the shift, and its radius the radius, or
// where that is less the growth as seen from the node as the unit ball. Shifts are rounded first,
// and growths measured from the rounded ones.
#include <prolate/modes.hpp>

#include "builder/ball.hpp"
#include "builder/fit.hpp"
#include "builder/modal_mesh.hpp"
#include "src/bytes.hpp"
#include "src/deformation.hpp"
#include "src/format.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <utility>
#include <vector>

namespace prolate {
namespace {

// Growths are this much larger than measured, relatively, and by this share of |L^-1| times the lengths that enter:
// more than the inverse of a factor is wrong by (axis ratios reach 2^14), and far more than verify_modes() asks for.
constexpr double kMargin = 1e-9, kInverseMargin = 1e-10;

// A growth makes a node larger by less than this factor, or a radius is taken in its place.
constexpr double kMostOfOneMode = 8;

struct NodeMotion {
    Vec shift = Vec::Zero();
    double growth = 0, radius = 0; // one of them is 0
};

class Motions {
public:
    Motions(const TreeView& tree, const ModalMesh& mesh)
        : tree_(tree), mesh_(mesh), modes_(mesh.mode_count()), all_(size_t{tree.slot_count()} * modes_) {}

    // The content of the section.
    Result<std::vector<std::byte>> run() {
        for_each([](std::span<const Vec> u, const Fit& fit, NodeMotion& motion, uint32_t) {
            std::vector<Vec> seen;
            for (const Vec& x : u) seen.emplace_back(fit.inverse * x);
            motion.shift = fit.factor * middle_of(seen);
        });
        find_steps(
            shift_steps_, [](const NodeMotion& n) { return n.shift.cwiseAbs().maxCoeff(); },
            std::numeric_limits<int16_t>::max());
        for_each([this](std::span<const Vec> u, const Fit& fit, NodeMotion& motion, uint32_t m) {
            for (double& x : motion.shift) x = shift(x, m) * double{shift_steps_[m]};
            measure(u, fit, motion, mesh_.range(m));
        });
        find_steps(
            growth_steps_, [](const NodeMotion& n) { return n.growth; }, kMostMotionSteps);
        find_steps(
            radius_steps_, [](const NodeMotion& n) { return n.radius; }, kMostMotionSteps);
        if (const auto sound = check_growth(); !sound) return sound.error();
        return content();
    }

private:
    template <class Visit> void for_each(Visit&& visit) {
        std::vector<Vec> u;
        mesh_.mesh().for_each_node(tree_, [&](uint32_t node, std::span<const uint32_t> vertices) {
            if (vertices.empty()) return; // a leaf deep in the solid stands for no surface
            const Fit fit(tree_.bound(node));
            for (uint32_t m = 0; m < modes_; ++m) {
                u.clear();
                for (const uint32_t v : vertices) u.push_back(to_vec(mesh_.displacement(v, m)));
                visit(u, fit, all_[size_t{node} * modes_ + m], m);
            }
        });
    }

    // Growth or radius: what adds less to the mean extent, of which a ball's is its radius, and an ellipsoid's at most
    // |L| / sqrt(3).
    static void measure(std::span<const Vec> u, const Fit& fit, NodeMotion& motion, double range) {
        double growth = 0, radius = 0, lengths = motion.shift.norm();
        for (const Vec& x : u) {
            growth = std::max(growth, (fit.inverse * (x - motion.shift)).norm());
            radius = std::max(radius, (x - motion.shift).norm());
            lengths = std::max(lengths, x.norm());
        }
        growth += kMargin * growth + kInverseMargin * fit.inverse.norm() * lengths;
        radius += kMargin * radius;
        const bool grows = growth * fit.factor.norm() < std::sqrt(3.0) * radius && growth * range < kMostOfOneMode;
        (grows ? motion.growth : motion.radius) = grows ? growth : radius;
    }

    // Of each mode, so that `most` of them reach the largest.
    template <class Of> void find_steps(std::vector<float>& steps, Of&& of, int most) {
        for (uint32_t m = 0; m < modes_; ++m) {
            double largest = 0;
            for (size_t i = m; i < all_.size(); i += modes_) largest = std::max(largest, of(all_[i]));
            steps.push_back(round_up(largest / most));
        }
    }
    int16_t shift(double x, uint32_t m) const {
        return shift_steps_[m] > 0 ? static_cast<int16_t>(std::lround(x / double{shift_steps_[m]})) : int16_t{0};
    }

    // Of the root.
    Result<void> check_growth() const {
        const double size = Fit(tree_.root_bound()).factor.norm();
        double grown = 0;
        for (uint32_t m = 0; m < modes_; ++m)
            grown += (all_[m].growth + all_[m].radius / size) * double{mesh_.range(m)};
        if (grown < kMostMotionGrowth) return {};
        return Error{ErrorCode::bad_options,
                     "in these ranges the body would grow more than a thousandfold; give smaller ones", 0};
    }

    std::vector<std::byte> content() const {
        const bool exact = tree_.has_triangles();
        const std::vector<uint32_t> points = mesh_.mesh().witnesses();
        const auto count = static_cast<uint32_t>(points.size());
        std::vector<std::byte> out(static_cast<size_t>(deformation_bytes(modes_, tree_.slot_count(), count, exact)));
        std::byte* to = out.data();
        const auto put = [&to](auto value) {
            store_le(to, value);
            to += sizeof value;
        };
        const auto put_point = [&put](const Vec3& p) { put(p.x), put(p.y), put(p.z); };
        put(modes_), put(count), put(uint64_t{0});
        for (uint32_t m = 0; m < modes_; ++m)
            put(mesh_.range(m)), put(shift_steps_[m]), put(growth_steps_[m]), put(radius_steps_[m]);
        for (size_t i = 0; i < all_.size(); ++i) {
            const auto m = static_cast<uint32_t>(i % modes_);
            for (const double x : all_[i].shift) put(shift(x, m));
            const bool is_radius = all_[i].radius > 0;
            const double step = is_radius ? radius_steps_[m] : growth_steps_[m];
            const double size = is_radius ? all_[i].radius : all_[i].growth;
            const auto steps = static_cast<uint16_t>(step > 0 ? std::ceil(size / step) : 0);
            put(static_cast<uint16_t>(is_radius ? steps | kIsRadius : steps));
        }
        if (!exact)
            for (const uint32_t v : points) put_point(mesh_.mesh().vertices()[v]);
        for (const uint32_t v : points)
            for (uint32_t m = 0; m < modes_; ++m) put_point(mesh_.displacement(v, m));
        return out;
    }

    const TreeView& tree_;
    const ModalMesh& mesh_;
    const uint32_t modes_;
    std::vector<NodeMotion> all_; // by slots, then modes
    std::vector<float> shift_steps_, growth_steps_, radius_steps_;
};

Result<Tree> add(const TreeView& tree, MeshView mesh, const Modes& modes) {
    if (tree.deformation()) return Error{ErrorCode::unsupported, "the tree has a deformation already; bake it anew", 0};
    const auto moving = ModalMesh::of(tree, mesh, modes);
    if (!moving) return moving.error();
    const auto content = Motions(tree, *moving).run();
    if (!content) return content.error();
    std::vector<std::byte> file(tree.bytes().begin(), tree.bytes().end());
    format::append_section(file, kDeformationKind, *content);
    auto out = Tree::open(std::move(file));
    if (!out) return out.error();
    const auto proof = verify_modes(out->view(), mesh, modes);
    if (!proof) return proof.error();
    if (!proof->proved)
        return Error{ErrorCode::internal, "the bound of a node's motion could not be proved; please report this mesh",
                     proof->node};
    return out;
}

} // namespace

Result<Tree> add_modes(const TreeView& tree, MeshView mesh, const Modes& modes) {
    try {
        return add(tree, mesh, modes);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory", 0};
    }
}

} // namespace prolate

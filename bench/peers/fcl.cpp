// FCL: hierarchies of oriented boxes (OBB), and of those together with swept spheres (OBBRSS, which it recommends and
// which alone of the two answers distances).
#include "bench/peers/library.hpp"

#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/detail/traversal/collision/mesh_collision_traversal_node.h>
#include <fcl/narrowphase/detail/traversal/distance/mesh_distance_traversal_node.h>
#include <fcl/narrowphase/detail/traversal/traversal_recurse.h>
#include <fcl/narrowphase/distance.h>

#include <type_traits>

namespace prolate::bench::peers {
namespace {

using Transform = fcl::Transform3<double>;

Transform placed(const Pose& pose) {
    Transform out = Transform::Identity();
    const Quat& q = pose.rotation;
    out.linear() = fcl::Quaternion<double>(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
    out.translation() = fcl::Vector3<double>(pose.translation.x, pose.translation.y, pose.translation.z);
    return out;
}

template <class Volume> struct Nodes; // FCL's own traversals, which count what they test
template <> struct Nodes<fcl::OBB<double>> { using Collide = fcl::detail::MeshCollisionTraversalNodeOBB<double>; };
template <> struct Nodes<fcl::OBBRSS<double>> {
    using Collide = fcl::detail::MeshCollisionTraversalNodeOBBRSS<double>;
    using Distance = fcl::detail::MeshDistanceTraversalNodeOBBRSS<double>;
};

template <class Volume> class FclShape final : public Shape {
public:
    explicit FclShape(const Model& model) {
        std::vector<fcl::Vector3<double>> points;
        std::vector<fcl::Triangle> triangles;
        for (const Vec3& v : model.mesh.vertices) points.emplace_back(v.x, v.y, v.z);
        for (const Triangle& t : model.mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
        tree_.beginModel(static_cast<int>(triangles.size()), static_cast<int>(points.size()));
        tree_.addSubModel(points, triangles);
        tree_.endModel();
    }
    const fcl::BVHModel<Volume>& tree() const { return tree_; }

private:
    fcl::BVHModel<Volume> tree_;
};

template <class Volume> class FclScene final : public Scene {
public:
    FclScene(const FclShape<Volume>& a, const FclShape<Volume>& b, std::span<const Placement> poses)
        : a_(a.tree()), b_(b.tree()) {
        for (const Placement& p : poses) a_at_.push_back(placed(p.a)), b_at_.push_back(placed(p.b));
        distance_request_.enable_nearest_points = true; // as prolate's distance answers them
    }
    Contact collide(size_t i) override {
        fcl::CollisionResult<double> result;
        return fcl::collide(&a_, a_at_[i], &b_, b_at_[i], request_, result) > 0 ? Contact::meeting : Contact::separated;
    }
    double distance(size_t i) override {
        fcl::DistanceResult<double> result;
        return fcl::distance(&a_, a_at_[i], &b_, b_at_[i], distance_request_, result);
    }
    Work collide_work(size_t i) override {
        fcl::CollisionResult<double> result;
        typename Nodes<Volume>::Collide node;
        fcl::detail::initialize(node, a_, a_at_[i], b_, b_at_[i], request_, result);
        node.enable_statistics = true;
        fcl::detail::collide(&node);
        return {static_cast<uint64_t>(node.num_bv_tests), static_cast<uint64_t>(node.num_leaf_tests)};
    }
    Work distance_work(size_t i) override {
        if constexpr (requires { typename Nodes<Volume>::Distance; }) {
            fcl::DistanceResult<double> result;
            typename Nodes<Volume>::Distance node;
            fcl::detail::initialize(node, a_, a_at_[i], b_, b_at_[i], distance_request_, result);
            node.enable_statistics = true;
            fcl::detail::distance(&node);
            return {static_cast<uint64_t>(node.num_bv_tests), static_cast<uint64_t>(node.num_leaf_tests)};
        }
        return {};
    }

private:
    const fcl::BVHModel<Volume>&a_, &b_;
    std::vector<Transform> a_at_, b_at_;
    fcl::CollisionRequest<double> request_;
    fcl::DistanceRequest<double> distance_request_;
};

template <class Volume> class Fcl final : public Library {
public:
    explicit Fcl(const char* name) : name_(name) {}
    std::string name() const override { return name_; }
    std::string about() const override {
        return "FCL " FCL_VERSION " as Debian compiles it (-O2, SSE2), double precision, first contact only";
    }
    bool answers(Query query) const override {
        return query == Query::collide || (query == Query::distance && std::is_same_v<Volume, fcl::OBBRSS<double>>);
    }
    std::unique_ptr<Shape> build(const Model& model) const override {
        return std::make_unique<FclShape<Volume>>(model);
    }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<FclScene<Volume>>(static_cast<const FclShape<Volume>&>(a),
                                                  static_cast<const FclShape<Volume>&>(b), poses);
    }

private:
    const char* name_;
};

} // namespace

void add_fcl(Libraries& libraries) {
    libraries.push_back(std::make_unique<Fcl<fcl::OBBRSS<double>>>("fcl-obbrss"));
    libraries.push_back(std::make_unique<Fcl<fcl::OBB<double>>>("fcl-obb"));
}

} // namespace prolate::bench::peers

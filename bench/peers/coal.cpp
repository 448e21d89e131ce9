// Coal (formerly hpp-fcl): hierarchies of oriented boxes, alone (OBB) and together with swept spheres (OBBRSS).
//
// While bodies are apart, Coal also keeps a lower bound of their distance; `break_distance` says how near bounding
// volumes must come before it looks into them for the sake of that bound. The default is 1e-3; 0 asks for nothing but
// the answer, and is faster near contact.
#include "bench/peers/library.hpp"

#include <coal/BVH/BVH_model.h>
#include <coal/collision.h>
#include <coal/distance.h>
#include <coal/internal/traversal_node_bvhs.h>
#include <coal/internal/traversal_node_setup.h>
#include <coal/internal/traversal_recurse.h>

#include <type_traits>

namespace prolate::bench::peers {
namespace {

coal::Transform3s placed(const Pose& pose) {
    const Quat& q = pose.rotation;
    return {coal::Quatf(q.w, q.x, q.y, q.z).normalized(),
            coal::Vec3s(pose.translation.x, pose.translation.y, pose.translation.z)};
}

template <class Volume> class CoalShape final : public Shape {
public:
    explicit CoalShape(const Model& model) {
        std::vector<coal::Vec3s> points;
        std::vector<coal::Triangle> triangles;
        for (const Vec3& v : model.mesh.vertices) points.emplace_back(v.x, v.y, v.z);
        for (const Triangle& t : model.mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
        tree_.beginModel(static_cast<unsigned>(triangles.size()), static_cast<unsigned>(points.size()));
        tree_.addSubModel(points, triangles);
        tree_.endModel();
    }
    const coal::BVHModel<Volume>& tree() const { return tree_; }

private:
    coal::BVHModel<Volume> tree_;
};

template <class Volume> class CoalScene final : public Scene {
public:
    CoalScene(const CoalShape<Volume>& a, const CoalShape<Volume>& b, std::span<const Placement> poses,
              const coal::CollisionRequest& request)
        : a_(a.tree()), b_(b.tree()), request_(request) {
        for (const Placement& p : poses) a_at_.push_back(placed(p.a)), b_at_.push_back(placed(p.b));
    }
    Contact collide(size_t i) override {
        coal::CollisionResult result;
        return coal::collide(&a_, a_at_[i], &b_, b_at_[i], request_, result) > 0 ? Contact::meeting
                                                                                 : Contact::separated;
    }
    double distance(size_t i) override {
        coal::DistanceResult result;
        return coal::distance(&a_, a_at_[i], &b_, b_at_[i], distance_request_, result);
    }
    Work collide_work(size_t i) override {
        coal::CollisionResult result;
        coal::MeshCollisionTraversalNode<Volume, 0> node(request_);
        coal::initialize(node, a_, a_at_[i], b_, b_at_[i], result);
        node.enable_statistics = true;
        double squared_bound = 0;
        coal::collisionRecurse(&node, 0, 0, nullptr, squared_bound);
        return {static_cast<uint64_t>(node.num_bv_tests), static_cast<uint64_t>(node.num_leaf_tests)};
    }
    Work distance_work(size_t i) override {
        if constexpr (std::is_same_v<Volume, coal::OBBRSS>) {
            coal::DistanceResult result;
            coal::MeshDistanceTraversalNode<Volume, 0> node;
            coal::initialize(node, a_, a_at_[i], b_, b_at_[i], distance_request_, result);
            node.enable_statistics = true;
            node.preprocess();
            coal::distanceRecurse(&node, 0, 0, nullptr);
            return {static_cast<uint64_t>(node.num_bv_tests), static_cast<uint64_t>(node.num_leaf_tests)};
        }
        return {};
    }

private:
    const coal::BVHModel<Volume>&a_, &b_;
    std::vector<coal::Transform3s> a_at_, b_at_;
    coal::CollisionRequest request_;
    coal::DistanceRequest distance_request_{true, false};
};

template <class Volume> class Coal final : public Library {
public:
    Coal(const char* name, bool break_distance) : name_(name), request_(coal::NO_REQUEST, 1) {
        if (!break_distance) request_.break_distance = 0;
        default_ = break_distance;
    }
    std::string name() const override { return name_; }
    std::string about() const override {
        return "Coal " COAL_VERSION " of PyPI (" PROLATE_BENCH_COAL_COMPILER
               "), double precision, first contact only, break_distance " +
               std::string(default_ ? "by default" : "0");
    }
    // Distances do not depend on break_distance, and Coal answers none between trees of OBBs.
    bool answers(Query query) const override {
        return query == Query::collide ||
               (query == Query::distance && default_ && std::is_same_v<Volume, coal::OBBRSS>);
    }
    std::string form() const override { return std::is_same_v<Volume, coal::OBBRSS> ? "coal-obbrss" : "coal-obb"; }
    std::unique_ptr<Shape> build(const Model& model) const override {
        return std::make_unique<CoalShape<Volume>>(model);
    }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<CoalScene<Volume>>(static_cast<const CoalShape<Volume>&>(a),
                                                   static_cast<const CoalShape<Volume>&>(b), poses, request_);
    }

private:
    const char* name_;
    coal::CollisionRequest request_;
    bool default_;
};

} // namespace

// What main.cpp looks for in the module.
extern "C" void add_coal_meshes(Libraries& libraries) {
    libraries.push_back(std::make_unique<Coal<coal::OBBRSS>>("coal-obbrss", true));
    libraries.push_back(std::make_unique<Coal<coal::OBBRSS>>("coal-obbrss-break0", false));
    libraries.push_back(std::make_unique<Coal<coal::OBB>>("coal-obb", true));
    libraries.push_back(std::make_unique<Coal<coal::OBB>>("coal-obb-break0", false));
}

} // namespace prolate::bench::peers

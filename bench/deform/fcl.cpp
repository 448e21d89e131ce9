#include "bench/deform/refit.hpp"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/AABB.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>

#include <utility>

namespace prolate::bench {
namespace {

template <class Volume> class FclRefit final : public Refit {
public:
    FclRefit(const Mesh& body, const Mesh& other) : body_(of(body)), other_(of(other)) {}

    void refit(std::span<const scenes::Point> vertices) override {
        points_.clear();
        for (const scenes::Point& x : vertices) points_.emplace_back(x[0], x[1], x[2]);
        body_->beginReplaceModel();
        body_->replaceSubModel(points_);
        body_->endReplaceModel(true, true);
    }
    bool meet(const Pose& other) override {
        fcl::Transform3<double> at = fcl::Transform3<double>::Identity();
        const Quat& r = other.rotation;
        at.linear() = fcl::Quaternion<double>(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
        at.translation() = fcl::Vector3<double>(other.translation.x, other.translation.y, other.translation.z);
        fcl::CollisionResult<double> result;
        return fcl::collide(body_.get(), fcl::Transform3<double>::Identity(), other_.get(), at,
                            fcl::CollisionRequest<double>(), result) > 0;
    }

private:
    using Model = fcl::BVHModel<Volume>;
    static std::unique_ptr<Model> of(const Mesh& mesh) {
        auto out = std::make_unique<Model>();
        std::vector<fcl::Vector3<double>> points;
        for (const Vec3& v : mesh.vertices) points.emplace_back(v.x, v.y, v.z);
        std::vector<fcl::Triangle> triangles;
        for (const Triangle& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
        out->beginModel();
        out->addSubModel(points, triangles);
        out->endModel();
        return out;
    }
    std::unique_ptr<Model> body_, other_;
    std::vector<fcl::Vector3<double>> points_;
};

template <class Volume> std::unique_ptr<Refit> build_fcl(const Mesh& body, const Mesh& other) {
    return std::make_unique<FclRefit<Volume>>(body, other);
}

} // namespace

void add_fcl_refits(RefitLibraries& libraries) {
    libraries.push_back({"FCL, AABB", UINT32_MAX, build_fcl<fcl::AABB<double>>});
    libraries.push_back({"FCL, OBBRSS", 50, build_fcl<fcl::OBBRSS<double>>});
}

} // namespace prolate::bench

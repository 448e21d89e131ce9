#include "bench/deform/refit.hpp"

#include <coal/BVH/BVH_model.h>
#include <coal/collision.h>

namespace prolate::bench {
namespace {

template <class Volume> class CoalRefit final : public Refit {
public:
    CoalRefit(const Mesh& body, const Mesh& other) {
        fill(body, body_);
        fill(other, other_);
    }
    void refit(std::span<const scenes::Point> vertices) override {
        points_.clear();
        for (const scenes::Point& x : vertices) points_.emplace_back(x[0], x[1], x[2]);
        body_.beginReplaceModel();
        body_.replaceSubModel(points_);
        body_.endReplaceModel(true, true);
    }
    bool meet(const Pose& other) override {
        const Quat& q = other.rotation;
        const coal::Transform3s at(coal::Quatf(q.w, q.x, q.y, q.z).normalized(),
                                   coal::Vec3s(other.translation.x, other.translation.y, other.translation.z));
        coal::CollisionRequest request;
        request.break_distance = 0; // as bench/peers/coal.cpp: nothing but the answer
        coal::CollisionResult result;
        return coal::collide(&body_, coal::Transform3s(), &other_, at, request, result) > 0;
    }

private:
    static void fill(const Mesh& mesh, coal::BVHModel<Volume>& out) {
        std::vector<coal::Vec3s> points;
        std::vector<coal::Triangle> triangles;
        for (const Vec3& v : mesh.vertices) points.emplace_back(v.x, v.y, v.z);
        for (const Triangle& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
        out.beginModel(static_cast<unsigned>(triangles.size()), static_cast<unsigned>(points.size()));
        out.addSubModel(points, triangles);
        out.endModel();
    }
    coal::BVHModel<Volume> body_, other_;
    std::vector<coal::Vec3s> points_;
};

template <class Volume> std::unique_ptr<Refit> build_coal(const Mesh& body, const Mesh& other) {
    return std::make_unique<CoalRefit<Volume>>(body, other);
}

} // namespace

// What deform.cpp looks for in the module.
extern "C" void add_coal_refits(RefitLibraries& libraries) {
    libraries.push_back({"Coal, AABB", UINT32_MAX, build_coal<coal::AABB>});
    libraries.push_back({"Coal, OBBRSS", 50, build_coal<coal::OBBRSS>});
}

} // namespace prolate::bench

// Cost: one search of Embree's tree a ray, O(log n). Embree builds on one thread, so that the tree, and with it the
// choice between equally near triangles, is the same in every run.
#include "cli/render/scene_mesh.hpp"

#include <algorithm>
#include <new>

#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

// Rays start this far from where they must not hit again, in a scene of radius 1.
constexpr double kNear = 1e-5;

RTCRay make_ray(const dvec3& origin, const dvec3& direction, const Reach& reach) {
    const glm::vec3 o(origin), d(direction);
    RTCRay ray = {};
    ray.org_x = o.x;
    ray.org_y = o.y;
    ray.org_z = o.z;
    ray.dir_x = d.x;
    ray.dir_y = d.y;
    ray.dir_z = d.z;
    ray.tnear = static_cast<float>(std::max(kNear, reach.from));
    ray.tfar = static_cast<float>(reach.to);
    ray.mask = ~0u;
    return ray;
}

} // namespace

MeshScene::MeshScene(MeshView mesh, const Frame& frame, const Solid* solid) : frame_(frame), solid_(solid) {
    vertices_.reserve(mesh.vertices.size());
    for (const Vec3& p : mesh.vertices) vertices_.push_back(glm::vec3(frame(p)));
    device_.reset(rtcNewDevice(nullptr));
    if (device_) scene_.reset(rtcNewScene(device_.get()));
    if (!scene_) throw std::bad_alloc();
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    // Copied, because Embree reads a few bytes beyond the end of a shared buffer.
    std::copy(vertices_.begin(), vertices_.end(),
              static_cast<glm::vec3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                              sizeof(glm::vec3), vertices_.size())));
    std::copy(mesh.triangles.begin(), mesh.triangles.end(),
              static_cast<Triangle*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                             sizeof(Triangle), mesh.triangles.size())));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_.get(), geometry);
    rtcReleaseGeometry(geometry);
    // Join: on the threads of the current arena, of which there is one. The device's own setting "threads=1" would
    // limit the whole program.
    tbb::task_arena(1).execute([this] { rtcJoinCommitScene(scene_.get()); });
    // Embree reports only here; the geometry is sound, so all that can be missing is memory.
    if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) throw std::bad_alloc();
}

Hit MeshScene::first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit rayhit = {};
    rayhit.ray = make_ray(origin, direction, reach);
    rayhit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rayhit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_.get(), &context, &rayhit);
    if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    dvec3 normal = glm::normalize(dvec3(rayhit.hit.Ng_x, rayhit.hit.Ng_y, rayhit.hit.Ng_z));
    if (glm::dot(normal, direction) > 0) normal = -normal;
    return {rayhit.ray.tfar, kMeshId, false, normal};
}

bool MeshScene::blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray = make_ray(origin, direction, reach);
    rtcOccluded1(scene_.get(), &context, &ray);
    return ray.tfar < 0;
}

Place MeshScene::place_of(const dvec3& p) const {
    if (!solid_) return {};
    const dvec3 model = p / frame_.scale + frame_.center;
    return {solid_->holds(model) ? kMeshId : kNothing, solid_->distance(model) * frame_.scale};
}

Window MeshScene::window(const Camera& camera) const {
    Window window;
    for (const glm::vec3& p : vertices_) {
        const dvec3 d = dvec3(p) - camera.eye;
        const double depth = glm::dot(d, camera.forward);
        const double u = glm::dot(d, camera.right) / depth, v = glm::dot(d, camera.up) / depth;
        window.add({u, u, v, v});
    }
    return window;
}

double MeshScene::extent(const dvec3& direction) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const glm::vec3& p : vertices_) most = std::max(most, glm::dot(direction, dvec3(p)));
    return most;
}

} // namespace prolate::cli

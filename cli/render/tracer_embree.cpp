// By Embree. It builds on one thread, so that its tree, and with it the choice between equally near triangles, is the
// same in every run.
#include "cli/render/tracer.hpp"

#include <algorithm>
#include <new>

#include <embree3/rtcore.h>
#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

RTCRay make_ray(const dvec3& origin, const dvec3& direction, const Reach& reach) {
    const glm::vec3 o(origin), d(direction);
    RTCRay ray = {};
    ray.org_x = o.x;
    ray.org_y = o.y;
    ray.org_z = o.z;
    ray.dir_x = d.x;
    ray.dir_y = d.y;
    ray.dir_z = d.z;
    ray.tnear = static_cast<float>(reach.from);
    ray.tfar = static_cast<float>(reach.to);
    ray.mask = ~0u;
    return ray;
}

class EmbreeTracer final : public Tracer {
public:
    EmbreeTracer(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
        device_.reset(rtcNewDevice(nullptr));
        if (device_) scene_.reset(rtcNewScene(device_.get()));
        if (!scene_) throw std::bad_alloc();
        rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
        RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
        // Copied, because Embree reads a few bytes beyond the end of a shared buffer.
        std::copy(vertices.begin(), vertices.end(),
                  static_cast<Vec3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                             sizeof(Vec3), vertices.size())));
        std::copy(triangles.begin(), triangles.end(),
                  static_cast<Triangle*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 sizeof(Triangle), triangles.size())));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_.get(), geometry);
        rtcReleaseGeometry(geometry);
        // Join: on the threads of the current arena, of which there is one. The device's own setting "threads=1" would
        // limit the whole program.
        tbb::task_arena(1).execute([this] { rtcJoinCommitScene(scene_.get()); });
        // Embree reports only here; the geometry is sound, so all that can be missing is memory.
        if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) throw std::bad_alloc();
    }

    Hit first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const override {
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

    bool blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const override {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRay ray = make_ray(origin, direction, reach);
        rtcOccluded1(scene_.get(), &context, &ray);
        return ray.tfar < 0;
    }

private:
    struct Release {
        void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
        void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
    };
    std::unique_ptr<RTCDeviceTy, Release> device_; // destroyed after the scene
    std::unique_ptr<RTCSceneTy, Release> scene_;
};

} // namespace

std::unique_ptr<Tracer> make_tracer(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
    return std::make_unique<EmbreeTracer>(vertices, triangles);
}

} // namespace prolate::cli

// What the programs of this folder share: a mesh as Embree's scene, and how times are taken.
#pragma once

#include <prolate/mesh.hpp>

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

namespace prolate::embree {

inline float dot(const Vec3& a, const Vec3& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 minus(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 along(const Vec3& a, float t, const Vec3& d) {
    return {a.x + t * d.x, a.y + t * d.y, a.z + t * d.z};
}

/// A mesh, at rest in the world; one thread.
class Scene {
public:
    explicit Scene(const Mesh& mesh, RTCSceneFlags flags = RTC_SCENE_FLAG_NONE)
        : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
        rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
        rtcSetSceneFlags(scene_, flags);
        const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* const vertices = static_cast<Vec3*>(rtcSetNewGeometryBuffer(
            geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), mesh.vertices.size()));
        std::copy(mesh.vertices.begin(), mesh.vertices.end(), vertices);
        auto* const triangles = static_cast<Triangle*>(rtcSetNewGeometryBuffer(
            geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(Triangle), mesh.triangles.size()));
        std::copy(mesh.triangles.begin(), mesh.triangles.end(), triangles);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene_);
    }
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;
    ~Scene() {
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    RTCScene get() const { return scene_; }

private:
    RTCDevice device_;
    RTCScene scene_;
};

/// Of this thread, microseconds.
inline double cpu_time() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

/// Medians of CPU time, in microseconds a query, of runs that take turns, so that whatever else the machine does falls
/// upon all alike.
template <class... Runs> std::vector<double> medians(size_t queries, Runs&&... runs) {
    constexpr int kRounds = 15;
    std::vector<std::vector<double>> times(sizeof...(runs));
    for (int round = 0; round < kRounds; ++round) {
        size_t at = 0;
        const auto time = [&](auto&& run) {
            const double start = cpu_time();
            run();
            times[at++].push_back((cpu_time() - start) / static_cast<double>(queries));
        };
        (time(runs), ...);
    }
    std::vector<double> out;
    for (auto& t : times) {
        std::nth_element(t.begin(), t.begin() + kRounds / 2, t.end());
        out.push_back(t[kRounds / 2]);
    }
    return out;
}

} // namespace prolate::embree

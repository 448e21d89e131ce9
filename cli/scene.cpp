// Embree does the search; the ray-ellipsoid intersection is exact and in double precision.
//
// With y = L^-1 (o - c) and e = L^-1 d, the ray o + t d meets the ellipsoid where |y + t e| = 1:
//     t = (-y.e -+ sqrt(|e|^2 - |y x e|^2)) / |e|^2,
// the cross product being the form of the discriminant that does not cancel for far or thin bodies.
//
// Cost: one tree search a ray, O(log n). Embree builds on one thread, so that the tree, and with it the choice between
// equally near triangles, is the same in every run.
#include "cli/scene.hpp"

#include <algorithm>
#include <cmath>
#include <new>

#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

// Rays start this far from where they must not hit again, in a scene of radius 1.
constexpr float kNear = 1e-5f;

struct Crossing {
    double t = 0;
    bool found = false;
    dvec3 y{0.0}; // whitened hit point
};

Crossing cross_body(const Scene::Body& body, const RTCRay& ray) {
    const dvec3 y = body.whiten(dvec3(ray.org_x, ray.org_y, ray.org_z) - body.center);
    const dvec3 e = body.whiten({ray.dir_x, ray.dir_y, ray.dir_z});
    const double ee = glm::dot(e, e), ye = glm::dot(y, e);
    const dvec3 moment = glm::cross(y, e);
    const double discriminant = ee - glm::dot(moment, moment);
    if (!(discriminant >= 0)) return {};
    const double root = std::sqrt(discriminant);
    for (const double t : {(-ye - root) / ee, (-ye + root) / ee})
        if (t > ray.tnear && t < ray.tfar) return {t, true, y + t * e};
    return {};
}

void body_bounds(const RTCBoundsFunctionArguments* args) {
    const auto& body = static_cast<const Scene::Body*>(args->geometryUserPtr)[args->primID];
    // The support function along the axes, widened by more than the rounding to float.
    const dvec3 half = dvec3(body.l11, std::hypot(body.l21, body.l22), std::hypot(body.l31, body.l32, body.l33)) + 1e-6;
    const glm::vec3 low(body.center - half), high(body.center + half);
    *args->bounds_o = {low.x, low.y, low.z, 0, high.x, high.y, high.z, 0};
}

// Only rtcIntersect1 and rtcOccluded1 are called, so N is always 1 in the two callbacks below.
void intersect_body(const RTCIntersectFunctionNArguments* args) {
    if (!args->valid[0]) return;
    const auto& body = static_cast<const Scene::Body*>(args->geometryUserPtr)[args->primID];
    auto& rayhit = *reinterpret_cast<RTCRayHit*>(args->rayhit);
    const Crossing crossing = cross_body(body, rayhit.ray);
    if (!crossing.found) return;
    const glm::vec3 normal(glm::normalize(body.normal(crossing.y)));
    rayhit.ray.tfar = static_cast<float>(crossing.t);
    rayhit.hit.Ng_x = normal.x;
    rayhit.hit.Ng_y = normal.y;
    rayhit.hit.Ng_z = normal.z;
    rayhit.hit.u = rayhit.hit.v = 0;
    rayhit.hit.primID = args->primID;
    rayhit.hit.geomID = args->geomID;
    rayhit.hit.instID[0] = args->context->instID[0];
}

void occlude_body(const RTCOccludedFunctionNArguments* args) {
    if (!args->valid[0]) return;
    const auto& body = static_cast<const Scene::Body*>(args->geometryUserPtr)[args->primID];
    auto& ray = *reinterpret_cast<RTCRay*>(args->ray);
    if (cross_body(body, ray).found) ray.tfar = -std::numeric_limits<float>::infinity();
}

RTCRay make_ray(const dvec3& origin, const dvec3& direction) {
    const glm::vec3 o(origin), d(direction);
    RTCRay ray = {};
    ray.org_x = o.x;
    ray.org_y = o.y;
    ray.org_z = o.z;
    ray.dir_x = d.x;
    ray.dir_y = d.y;
    ray.dir_z = d.z;
    ray.tnear = kNear;
    ray.tfar = std::numeric_limits<float>::infinity();
    ray.mask = ~0u;
    return ray;
}

// The slopes s at which the plane through the eye with normal axis - s * forward touches the body seen at d:
// (n.d)^2 = |transpose(L) n|^2, a quadratic in s.
void tangent_slopes(const Scene::Body& body, const dvec3& d, const dvec3& axis, const dvec3& forward, double& low,
                    double& high) {
    const dvec3 la = body.transposed(axis), lf = body.transposed(forward);
    const double da = glm::dot(d, axis), df = glm::dot(d, forward);
    const double a = df * df - glm::dot(lf, lf), b = da * df - glm::dot(la, lf), c = da * da - glm::dot(la, la);
    const double root = std::sqrt(std::max(0.0, b * b - a * c));
    low = std::min(low, (b - root) / a);
    high = std::max(high, (b + root) / a);
}

} // namespace

void Box::add(const dvec3& a, const dvec3& b) {
    low = glm::min(low, a);
    high = glm::max(high, b);
}

void Box::add(MeshView mesh) {
    for (const Vec3& p : mesh.vertices) add({p.x, p.y, p.z}, {p.x, p.y, p.z});
}

void Box::add(const Ellipsoid& e) {
    const dvec3 center(e.center.x, e.center.y, e.center.z);
    const dvec3 half(e.l11, std::hypot(double{e.l21}, double{e.l22}),
                     std::hypot(double{e.l31}, double{e.l32}, double{e.l33}));
    add(center - half, center + half);
}

Frame Box::frame() const {
    return {(low + high) / 2.0, 2.0 / glm::length(high - low)};
}

void Window::add(const Window& other) {
    u0 = std::min(u0, other.u0);
    u1 = std::max(u1, other.u1);
    v0 = std::min(v0, other.v0);
    v1 = std::max(v1, other.v1);
}

void Scene::open_device() {
    device_.reset(rtcNewDevice(nullptr));
    if (device_) scene_.reset(rtcNewScene(device_.get()));
    if (!scene_) throw std::bad_alloc();
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
}

void Scene::commit(RTCGeometry geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_.get(), geometry);
    rtcReleaseGeometry(geometry);
    // Join: on the threads of the current arena, of which there is one. The device's own setting "threads=1" would
    // limit the whole program.
    tbb::task_arena(1).execute([this] { rtcJoinCommitScene(scene_.get()); });
    // Embree reports only here; the geometry is sound, so all that can be missing is memory.
    if (rtcGetDeviceError(device_.get()) != RTC_ERROR_NONE) throw std::bad_alloc();
}

Scene::Scene(MeshView mesh, const Frame& frame) : triangles_(mesh.triangles.begin(), mesh.triangles.end()) {
    vertices_.reserve(mesh.vertices.size());
    for (const Vec3& p : mesh.vertices) vertices_.push_back(glm::vec3(frame(p)));
    open_device();
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    // Copied, because Embree reads a few bytes beyond the end of a shared buffer.
    std::copy(vertices_.begin(), vertices_.end(),
              static_cast<glm::vec3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                              sizeof(glm::vec3), vertices_.size())));
    std::copy(triangles_.begin(), triangles_.end(),
              static_cast<Triangle*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                             sizeof(Triangle), triangles_.size())));
    commit(geometry);
}

Scene::Scene(const TreeView& tree, const std::vector<uint32_t>& nodes, const Frame& frame) {
    bodies_.reserve(nodes.size());
    for (const uint32_t node : nodes) {
        const Ellipsoid e = tree.ellipsoid(node);
        Body b{};
        b.center = frame(e.center);
        b.l11 = e.l11 * frame.scale;
        b.l21 = e.l21 * frame.scale;
        b.l22 = e.l22 * frame.scale;
        b.l31 = e.l31 * frame.scale;
        b.l32 = e.l32 * frame.scale;
        b.l33 = e.l33 * frame.scale;
        b.m11 = 1 / b.l11;
        b.m22 = 1 / b.l22;
        b.m33 = 1 / b.l33;
        b.m21 = -b.l21 * b.m11 * b.m22;
        b.m32 = -b.l32 * b.m22 * b.m33;
        b.m31 = -(b.l31 * b.m11 + b.l32 * b.m21) * b.m33;
        bodies_.push_back(b);
    }
    open_device();
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(bodies_.size()));
    rtcSetGeometryUserData(geometry, bodies_.data()); // moving a vector keeps its buffer, so a Scene may be moved
    rtcSetGeometryBoundsFunction(geometry, body_bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, intersect_body);
    rtcSetGeometryOccludedFunction(geometry, occlude_body);
    commit(geometry);
}

Hit Scene::first_hit(const dvec3& origin, const dvec3& direction) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit rayhit = {};
    rayhit.ray = make_ray(origin, direction);
    rayhit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rayhit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_.get(), &context, &rayhit);
    if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    dvec3 normal = glm::normalize(dvec3(rayhit.hit.Ng_x, rayhit.hit.Ng_y, rayhit.hit.Ng_z));
    if (glm::dot(normal, direction) > 0) normal = -normal;
    return {rayhit.ray.tfar, bodies_.empty() ? 0 : rayhit.hit.primID, normal};
}

bool Scene::blocked(const dvec3& origin, const dvec3& direction) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray = make_ray(origin, direction);
    rtcOccluded1(scene_.get(), &context, &ray);
    return ray.tfar < 0;
}

Window Scene::window(const Camera& camera) const {
    Window window;
    for (const glm::vec3& p : vertices_) {
        const dvec3 d = dvec3(p) - camera.eye;
        const double depth = glm::dot(d, camera.forward);
        const double u = glm::dot(d, camera.right) / depth, v = glm::dot(d, camera.up) / depth;
        window.add({u, u, v, v});
    }
    for (const Body& body : bodies_) {
        const dvec3 d = body.center - camera.eye;
        tangent_slopes(body, d, camera.right, camera.forward, window.u0, window.u1);
        tangent_slopes(body, d, camera.up, camera.forward, window.v0, window.v1);
    }
    return window;
}

double Scene::extent(const dvec3& direction) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const glm::vec3& p : vertices_) most = std::max(most, glm::dot(direction, dvec3(p)));
    for (const Body& body : bodies_)
        most = std::max(most, glm::dot(direction, body.center) + glm::length(body.transposed(direction)));
    return most;
}

} // namespace prolate::cli

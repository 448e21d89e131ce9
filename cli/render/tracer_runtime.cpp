// By an exact tree of the triangles. The same rays give the same hits on every machine.
#include "cli/render/tracer.hpp"

#include <prolate/build.hpp>
#include <prolate/raycast.hpp>

#include <new>
#include <stdexcept>
#include <utility>

namespace prolate::cli {
namespace {

using glm::dvec3;

Vec3 to_float(const dvec3& v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}
Ray to_ray(const dvec3& origin, const dvec3& direction, const Reach& reach) {
    return {to_float(origin + reach.from * direction), to_float(direction), static_cast<float>(reach.to - reach.from)};
}

class RuntimeTracer final : public Tracer {
public:
    explicit RuntimeTracer(Tree tree) : tree_(std::move(tree)) {}

    Hit first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const override {
        QueryContext context;
        const RaycastResult found = raycast(tree_.view(), {}, to_ray(origin, direction, reach), context);
        if (found.verdict != Verdict::overlapping) return {};
        const dvec3 normal(found.normal.x, found.normal.y, found.normal.z);
        return {reach.from + found.t, kMeshId, false, glm::dot(normal, direction) > 0 ? -normal : normal};
    }
    bool blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const override {
        QueryContext context;
        return raycast_any(tree_.view(), {}, to_ray(origin, direction, reach), context).verdict == Verdict::overlapping;
    }

private:
    Tree tree_;
};

} // namespace

std::unique_ptr<Tracer> make_tracer(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
    auto built = build({.vertices = vertices, .triangles = triangles, .placement = {}}, {.exact = true, .weld = 0});
    if (built) return std::make_unique<RuntimeTracer>(std::move(built->tree));
    if (built.error().code == ErrorCode::out_of_memory) throw std::bad_alloc();
    throw std::logic_error(built.error().what);
}

} // namespace prolate::cli

// Rays beside Embree's, on the same mesh, in one thread.
//
//   bench_rays MESH [--rays N]
//
// Prints for each set of rays the median CPU time of a ray: prolate's raycast() one by one and as a batch, and Embree's
// rtcIntersect1 and rtcIntersect8 on a robust scene, of runs over all rays that take turns. Then how many times
// Embree's time ours is, the share of rays that hit, on how many of them the two disagree, and how far t differs at
// most where both hit, in parts of the mesh's diagonal. (Embree computes in single precision.)
#include "bench/embree/scene.hpp"
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/raycast.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

using embree::along, embree::dot, embree::medians, embree::minus;

struct RaySet {
    const char* name;
    std::vector<Ray> rays;
};

struct Extent {
    Vec3 low, size;
    float diagonal() const { return std::sqrt(dot(size, size)); }
};
Extent extent_of(const Mesh& mesh) {
    Vec3 low = mesh.vertices[0], high = low;
    for (const Vec3& v : mesh.vertices) {
        low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
        high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    return {low, minus(high, low)};
}

// From anywhere on a sphere around the mesh to a point of its box; the pixels of a picture, row by row; and short ones
// from near the surface, as lines of sight and probes are.
std::vector<RaySet> ray_sets(const Mesh& mesh, size_t count) {
    scenes::Random random(1);
    const auto [low, size] = extent_of(mesh);
    const Vec3 middle = along(low, 0.5f, size);
    const float diagonal = extent_of(mesh).diagonal();
    const auto unit = [&] {
        const auto d = scenes::to_float(random.in_ball());
        return along({}, 1 / std::sqrt(dot(d, d)), d);
    };
    const auto between = [&](float from, float length) { return from + length * static_cast<float>(random.unit()); };
    std::vector<RaySet> sets{{"random", {}}, {"picture", {}}, {"short", {}}};
    const auto side = static_cast<size_t>(std::sqrt(static_cast<double>(count)));
    for (size_t i = 0; i < count; ++i) {
        const Vec3 origin = along(middle, diagonal, unit());
        const float x = between(low.x, size.x), y = between(low.y, size.y), z = between(low.z, size.z);
        sets[0].rays.push_back({origin, minus({x, y, z}, origin)});
        const Triangle& t = mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
        sets[2].rays.push_back({along(mesh.vertices[t[0]], 0.05f * diagonal, unit()), unit(), 0.1f * diagonal});
    }
    for (size_t i = 0; i < side * side; ++i) {
        const auto place = [&](size_t at) { return (static_cast<float>(at) + 0.5f) / static_cast<float>(side); };
        const Vec3 eye = along(middle, diagonal, {0, 0, 1});
        const Vec3 at{low.x + size.x * place(i % side), low.y + size.y * place(i / side), middle.z};
        sets[1].rays.push_back({eye, minus(at, eye)});
    }
    return sets;
}

RTCRayHit to_embree(const Ray& ray) {
    RTCRayHit out{};
    out.ray = {.org_x = ray.origin.x,
               .org_y = ray.origin.y,
               .org_z = ray.origin.z,
               .tnear = 0,
               .dir_x = ray.direction.x,
               .dir_y = ray.direction.y,
               .dir_z = ray.direction.z,
               .time = 0,
               .tfar = ray.max_t,
               .mask = ~0u,
               .id = 0,
               .flags = 0};
    out.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    return out;
}

// Parameters of the hits; infinite without.
void intersect1(RTCScene scene, const std::vector<Ray>& rays, std::vector<float>& out) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (size_t i = 0; i < rays.size(); ++i) {
        RTCRayHit ray = to_embree(rays[i]);
        rtcIntersect1(scene, &context, &ray);
        out[i] = ray.hit.geomID == RTC_INVALID_GEOMETRY_ID ? HUGE_VALF : ray.ray.tfar;
    }
}

void intersect8(RTCScene scene, const std::vector<Ray>& rays, std::vector<float>& out) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (size_t first = 0; first < rays.size(); first += 8) {
        RTCRayHit8 eight{};
        alignas(32) int valid[8] = {};
        const size_t count = std::min<size_t>(8, rays.size() - first);
        for (size_t i = 0; i < count; ++i) {
            const Ray& ray = rays[first + i];
            valid[i] = -1;
            eight.ray.org_x[i] = ray.origin.x, eight.ray.org_y[i] = ray.origin.y, eight.ray.org_z[i] = ray.origin.z;
            eight.ray.dir_x[i] = ray.direction.x, eight.ray.dir_y[i] = ray.direction.y;
            eight.ray.dir_z[i] = ray.direction.z, eight.ray.tfar[i] = ray.max_t, eight.ray.mask[i] = ~0u;
            eight.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, scene, &context, &eight);
        for (size_t i = 0; i < count; ++i)
            out[first + i] = eight.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? HUGE_VALF : eight.ray.tfar[i];
    }
}

int run(const std::string& path, size_t count) {
    const auto loaded = load_mesh(path.c_str());
    if (!loaded) return fmt::print(stderr, "bench_rays: {}\n", loaded.error().what), 1;
    const auto cleaned = clean(loaded->view());
    const auto built = build(loaded->view(), {.exact = true});
    if (!cleaned || !built) return fmt::print(stderr, "bench_rays: cannot bake {}\n", path), 1;
    const Mesh& mesh = cleaned->mesh;
    const TreeView tree = built->tree.view();
    const embree::Scene scene(mesh, RTC_SCENE_FLAG_ROBUST);
    const auto context = std::make_unique<QueryContext>();
    fmt::print("{}: {} triangles; median us of CPU time a ray\n", path, mesh.triangles.size());
    fmt::print("{:8} {:>8} {:>8} {:>9} {:>9} {:>8} {:>8} {:>6} {:>9} {:>10}\n", "rays", "single", "batch", "Embree 1",
               "Embree 8", "single/1", "batch/8", "hit", "disagree", "difference");
    for (const RaySet& set : ray_sets(mesh, count)) {
        const std::vector<Ray>& rays = set.rays;
        std::vector<RaycastResult> out(rays.size());
        std::vector<float> theirs(rays.size()), packets(rays.size());
        const auto times = medians(
            rays.size(),
            [&] {
                for (size_t i = 0; i < rays.size(); ++i) out[i] = raycast(tree, {}, rays[i], *context);
            },
            [&] { raycast(tree, {}, rays, out, *context); }, [&] { intersect1(scene.get(), rays, theirs); },
            [&] { intersect8(scene.get(), rays, packets); });
        double difference = 0;
        size_t hits = 0, disagree = 0;
        for (size_t i = 0; i < rays.size(); ++i) {
            const bool ours = out[i].verdict == Verdict::overlapping, embrees = theirs[i] < HUGE_VALF;
            hits += ours, disagree += ours != embrees;
            if (!ours || !embrees) continue;
            const double length = std::sqrt(dot(rays[i].direction, rays[i].direction));
            difference = std::max(difference, std::abs(out[i].t - double{theirs[i]}) * length);
        }
        fmt::print("{:8} {:8.3f} {:8.3f} {:9.3f} {:9.3f} {:8.2f} {:8.2f} {:6.2f} {:9} {:10.1e}\n", set.name, times[0],
                   times[1], times[2], times[3], times[0] / times[2], times[1] / times[3],
                   static_cast<double>(hits) / static_cast<double>(rays.size()), disagree,
                   difference / double{extent_of(mesh).diagonal()});
    }
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app("Rays against meshes, beside Embree");
    std::string mesh;
    size_t rays = 4096;
    app.add_option("mesh", mesh, "a mesh file")->required();
    app.add_option("--rays", rays, "of each set");
    CLI11_PARSE(app, argc, argv);
    return prolate::run(mesh, rays);
}

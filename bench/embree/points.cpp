// Nearest points and signs beside Embree's point query, on the same mesh and points, in one thread.
//
//   bench_points MESH [--points N]
//
// Prints for each set of points the median CPU time of one query, of runs over all points that take turns, Embree's
// over that of single queries, and how far the two distances are apart at most. Embree has no inside; what finds the
// nearest triangle there is the callback of its documentation (closest point of a triangle, in single precision).
#include "bench/embree/scene.hpp"
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/points.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

using embree::along, embree::dot, embree::medians, embree::minus;

// C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5.
Vec3 closest_point(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 ab = minus(b, a), ac = minus(c, a), ap = minus(p, a);
    const float d1 = dot(ab, ap), d2 = dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return a;
    const Vec3 bp = minus(p, b);
    const float d3 = dot(ab, bp), d4 = dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return b;
    const Vec3 cp = minus(p, c);
    const float d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return c;
    const float vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return along(a, d1 / (d1 - d3), ab);
    const float vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(a, d2 / (d2 - d6), ac);
    const float va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return along(b, (d4 - d3) / (d4 - d3 + d5 - d6), minus(c, b));
    const float sum = va + vb + vc;
    return along(along(a, vb / sum, ab), vc / sum, ac);
}

class Nearest {
public:
    explicit Nearest(const Mesh& mesh) : mesh_(mesh), scene_(mesh) {}

    float distance(const Vec3& p) const {
        RTCPointQuery query{p.x, p.y, p.z, 0, HUGE_VALF};
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(scene_.get(), &query, &context, visit, const_cast<Mesh*>(&mesh_));
        return query.radius;
    }

private:
    static bool visit(RTCPointQueryFunctionArguments* args) {
        const Mesh& mesh = *static_cast<const Mesh*>(args->userPtr);
        const Triangle& t = mesh.triangles[args->primID];
        const Vec3 p{args->query->x, args->query->y, args->query->z};
        const Vec3 d = minus(closest_point(p, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]), p);
        const float square = dot(d, d);
        if (!(square < args->query->radius * args->query->radius)) return false;
        args->query->radius = std::sqrt(square);
        return true;
    }

    const Mesh& mesh_;
    const embree::Scene scene_;
};

struct PointSet {
    const char* name;
    std::vector<Vec3> points;
};

// Anywhere in the mesh's box, enlarged by a fifth; within 1 % of the diagonal of the surface; and a walk of small
// steps.
std::vector<PointSet> point_sets(const Mesh& mesh, size_t count) {
    scenes::Random random(1);
    Vec3 low = mesh.vertices[0], high = low;
    for (const Vec3& v : mesh.vertices) {
        low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
        high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    const Vec3 size = minus(high, low);
    const float diagonal = std::sqrt(dot(size, size));
    const auto within = [&] {
        const auto pick = [&](float from, float length) {
            return from + length * static_cast<float>(random.in(-0.1, 1.1));
        };
        const float x = pick(low.x, size.x), y = pick(low.y, size.y), z = pick(low.z, size.z);
        return Vec3{x, y, z};
    };
    const auto step = [&](const Vec3& from, float length) {
        const Vec3 d = scenes::to_float(random.in_ball());
        return along(from, length, d);
    };
    std::vector<PointSet> sets{{"box", {}}, {"near", {}}, {"walk", {}}};
    for (size_t i = 0; i < count; ++i) {
        sets[0].points.push_back(within());
        const Triangle& t = mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
        sets[1].points.push_back(step(mesh.vertices[t[0]], 0.01f * diagonal));
        sets[2].points.push_back(i % 64 == 0 ? within() : step(sets[2].points.back(), 0.01f * diagonal));
    }
    return sets;
}

int run(const std::string& path, size_t count) {
    const auto loaded = load_mesh(path.c_str());
    if (!loaded) return fmt::print(stderr, "bench_points: {}\n", loaded.error().what), 1;
    const auto cleaned = clean(loaded->view());
    const auto built = build(loaded->view(), {.exact = true});
    if (!cleaned || !built) return fmt::print(stderr, "bench_points: cannot bake {}\n", path), 1;
    const Mesh& mesh = cleaned->mesh;
    const TreeView tree = built->tree.view();
    const Nearest nearest(mesh);
    const auto context = std::make_unique<QueryContext>();
    fmt::print("{}: {} triangles, {}; median us a query\n", path, mesh.triangles.size(),
               cleaned->report.closed ? "closed" : "open: no sides");
    fmt::print("{:6} {:>8} {:>8} {:>8} {:>8} {:>9} {:>7} {:>10}\n", "points", "single", "batch", "contains", "Embree",
               "ratio", "inside", "difference");
    for (const PointSet& set : point_sets(mesh, count)) {
        const std::vector<Vec3>& points = set.points;
        std::vector<SignedDistance> out(points.size());
        std::vector<Verdict> sides(points.size());
        std::vector<float> theirs(points.size());
        const auto times = medians(
            points.size(),
            [&] {
                for (size_t i = 0; i < points.size(); ++i) out[i] = signed_distance(tree, {}, points[i], *context);
            },
            [&] { signed_distance(tree, {}, points, out, *context); },
            [&] { contains(tree, {}, points, sides, *context); },
            [&] {
                for (size_t i = 0; i < points.size(); ++i) theirs[i] = nearest.distance(points[i]);
            });
        double difference = 0;
        size_t inside = 0;
        for (size_t i = 0; i < points.size(); ++i) {
            inside += sides[i] == Verdict::overlapping;
            difference = std::max(difference, std::abs(std::abs(out[i].upper) - double{theirs[i]}));
        }
        fmt::print("{:6} {:8.3f} {:8.3f} {:8.3f} {:8.3f} {:9.2f} {:7.2f} {:10.1e}\n", set.name, times[0], times[1],
                   times[2], times[3], times[3] / times[0],
                   static_cast<double>(inside) / static_cast<double>(points.size()), difference);
    }
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app("Points against meshes, beside Embree");
    std::string mesh;
    size_t points = 4096;
    app.add_option("mesh", mesh, "a mesh file")->required();
    app.add_option("--points", points, "of each set");
    CLI11_PARSE(app, argc, argv);
    return prolate::run(mesh, points);
}

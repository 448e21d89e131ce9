#include "cli/compare/choices.hpp"

#include "cli/compare/hull.hpp"
#include "cli/compare/query_time.hpp"
#include "cli/render/solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>

namespace prolate::cli {
namespace {

constexpr uint32_t kCounts[] = {8, 16, 32, 64};
constexpr uint32_t kSpheres = 64;
constexpr double kFineEnough = 0.001;  // of the diagonal: of a hull's clearance
constexpr size_t kMostParts = 100'000; // of its surface, to look at

// A part of a hull's surface.
struct SurfacePart {
    std::array<glm::dvec3, 3> corners;
    double bound; // no point of it is farther from the solid
    bool operator<(const SurfacePart& other) const { return bound < other.bound; }
};

// How far a surface sticks out of the solid, to kFineEnough: the part that may be farthest is cut in four, until it is
// no farther than what is known. The distance changes by no more than one moves.
double clearance_of(MeshView surface, const Solid& solid) {
    std::priority_queue<SurfacePart> parts;
    double known = 0;
    const auto add = [&](const std::array<glm::dvec3, 3>& c) {
        const glm::dvec3 middle = (c[0] + c[1] + c[2]) / 3.0;
        const double distance = solid.outside_distance(middle);
        known = std::max(known, distance);
        parts.push({c, distance + std::max({glm::distance(middle, c[0]), glm::distance(middle, c[1]),
                                            glm::distance(middle, c[2])})});
    };
    const auto corner = [&](uint32_t v) {
        return glm::dvec3(surface.vertices[v].x, surface.vertices[v].y, surface.vertices[v].z);
    };
    for (const auto& [a, b, c] : surface.triangles) add({corner(a), corner(b), corner(c)});
    for (size_t looked_at = 0; !parts.empty() && looked_at < kMostParts; ++looked_at) {
        const auto [c, bound] = parts.top();
        if (bound <= known + kFineEnough * solid.diagonal()) break;
        parts.pop();
        const glm::dvec3 ab = 0.5 * (c[0] + c[1]), bc = 0.5 * (c[1] + c[2]), ca = 0.5 * (c[2] + c[0]);
        add({c[0], ab, ca}), add({ab, c[1], bc}), add({ca, bc, c[2]}), add({ab, bc, ca});
    }
    return parts.empty() ? known : std::max(known, parts.top().bound);
}

// The convex hull as a choice: exact, because it is what it is.
Outcome<std::vector<Choice>> hull_choice(const std::string& path, const CleanMesh& mesh, const BuildOptions& options,
                                         double solid_volume) {
    auto hull = convex_hull(mesh.mesh.view());
    if (!hull) return std::vector<Choice>();
    auto built = build(hull->view(), {.exact = true, .threads = options.threads});
    if (!built) return failure_of(path, built.error());
    const Solid solid(mesh.mesh.view(), mesh.report.closed);
    Choice choice{"1 convex hull", std::move(built->tree), std::move(*hull), LevelFigures::kUnknown, 0, 0};
    if (solid_volume > 0) choice.outside_ratio = enclosed_volume(choice.hull.view()) / solid_volume - 1;
    choice.clearance = clearance_of(choice.hull.view(), solid);
    std::vector<Choice> out;
    out.push_back(std::move(choice));
    return out;
}

} // namespace

Outcome<std::vector<Choice>> make_choices(const std::string& path, const CleanMesh& mesh, BuildOptions options,
                                          const std::function<bool(const std::string&, double)>& progress) {
    options.levels = 0;
    std::vector<Choice> out;
    double solid_volume = 0;
    const auto add = [&](uint32_t count, Primitive primitive) -> Outcome<> {
        const std::string name = fmt::format("{} {}", count, primitive == Primitive::sphere ? "spheres" : "ellipsoids");
        options.ellipsoids = count, options.primitive = primitive;
        auto built =
            build(mesh.mesh.view(), options, [&](const BuildProgress& p) { return progress(name, p.fraction); });
        if (!built) return failure_of(path, built.error());
        const LevelReport& leaves = built->levels.back();
        solid_volume = built->solid_volume;
        out.push_back({name, std::move(built->tree), {}, leaves.outside_ratio, leaves.hausdorff_max, 0});
        return kSuccess;
    };
    for (const uint32_t count : kCounts)
        if (auto added = add(count, Primitive::ellipsoid); !added) return added.error();
    if (auto added = add(kSpheres, Primitive::sphere); !added) return added.error();
    progress("convex hull", 0);
    auto hull = hull_choice(path, mesh, options, solid_volume);
    if (!hull) return hull.error();
    for (Choice& choice : *hull) out.push_back(std::move(choice));
    for (Choice& choice : out) {
        if (!progress("queries", 0)) return failure_of(path, Error{ErrorCode::cancelled});
        choice.nanoseconds = nanoseconds_a_query(choice.tree.view());
    }
    return out;
}

} // namespace prolate::cli

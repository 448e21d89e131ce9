#include "cli/compare/hull.hpp"

#include <libqhull_r/qhull_ra.h>

#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace prolate::cli {
namespace {

// One run of Qhull. (Its C++ interface does not compile as C++20.)
class Hull {
public:
    explicit Hull(std::vector<double>& points) : silence_(std::fopen("/dev/null", "w"), std::fclose) {
        qh_zero(&state_, silence_.get());
        std::string command = "qhull Qt"; // triangles
        failed_ = qh_new_qhull(&state_, 3, static_cast<int>(points.size() / 3), points.data(), false, command.data(),
                               nullptr, silence_.get()) != 0;
    }
    ~Hull() {
        int blocks = 0, bytes = 0;
        qh_freeqhull(&state_, !qh_ALL);
        qh_memfreeshort(&state_, &blocks, &bytes);
    }
    Hull(const Hull&) = delete;
    Hull& operator=(const Hull&) = delete;

    bool failed() const { return failed_; }
    // Calls visit(numbers of three points, counter-clockwise seen from outside).
    template <class Visit> void for_each_triangle(Visit&& visit) {
        for (facetT* facet = state_.facet_list; facet && facet->next; facet = facet->next) {
            Triangle triangle{};
            for (int corner = 0; corner < 3; ++corner) {
                const auto* const vertex = static_cast<vertexT*>(facet->vertices->e[corner].p);
                triangle[static_cast<size_t>(corner)] = static_cast<uint32_t>(qh_pointid(&state_, vertex->point));
            }
            if (facet->toporient == qh_ORIENTclock) std::swap(triangle[1], triangle[2]);
            visit(triangle);
        }
    }

private:
    std::unique_ptr<FILE, int (*)(FILE*)> silence_;
    qhT state_{};
    bool failed_ = false;
};

} // namespace

std::optional<Mesh> convex_hull(MeshView mesh) {
    std::vector<double> points;
    points.reserve(3 * mesh.vertices.size());
    for (const Vec3& v : mesh.vertices) points.insert(points.end(), {double{v.x}, double{v.y}, double{v.z}});
    Hull hull(points);
    if (hull.failed()) return {};
    Mesh out;
    std::map<uint32_t, uint32_t> number; // of the mesh's vertices, here
    hull.for_each_triangle([&](Triangle triangle) {
        for (uint32_t& corner : triangle) {
            const auto [at, fresh] = number.try_emplace(corner, static_cast<uint32_t>(out.vertices.size()));
            if (fresh) out.vertices.push_back(mesh.vertices[corner]);
            corner = at->second;
        }
        out.triangles.push_back(triangle);
    });
    if (enclosed_volume(out.view()) < 0)
        for (Triangle& t : out.triangles) std::swap(t[1], t[2]);
    return out;
}

double enclosed_volume(MeshView mesh) {
    double six = 0;
    for (const auto& [i, j, k] : mesh.triangles) {
        const Vec3 &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
        const double ax = double{a.x}, ay = double{a.y}, az = double{a.z};
        six += ax * (double{b.y} * double{c.z} - double{b.z} * double{c.y}) +
               ay * (double{b.z} * double{c.x} - double{b.x} * double{c.z}) +
               az * (double{b.x} * double{c.y} - double{b.y} * double{c.x});
    }
    return six / 6;
}

} // namespace prolate::cli

// Poses at which much is equally near: flat sheets and plates that are parallel, a ball in a shell, a shaft in a bore.
// Bounding volumes whose bounds are never equal to the distance open everything there.
//
//   bench_cliffs [--seconds=0.1] [SCENE]...
//
// prolate and the libraries of bench_peers, in one process, on the same poses, in turns; medians of a pose in
// microseconds, and in brackets how many times that of prolate. Of two that measure the distance, the worst
// disagreement is printed if it is above 1e-6. `axes`: the bodies as baked; `turned`: both turned by the same random
// rotation; `baked`: their meshes turned, and so rounded, before they are built. Prints prolate's contacts(), too.
#include "bench/peers/library.hpp"
#include "bench/peers/sweep.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/contacts.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

namespace prolate::bench::peers {
namespace {

using scenes::Point;
using scenes::Random;

constexpr size_t kPoses = 12;

// Body b lies `gap` from a along z, or within it.
struct Cliff {
    std::string name;
    Mesh a, b;
    std::vector<double> gaps;
    double slide;                 // of b along x and y, at most
    double (*offset)(double gap); // of b along z, for a gap
    bool along_x = false;         // the offset is along x instead
};

Mesh grid(float size, uint32_t n) {
    return shapes::moved(shapes::sheet(size, size, n), {-size / 2, -size / 2, 0});
}

// A closed box around the origin, its faces of n x n quads.
Mesh plate(float x, float y, float z, uint32_t n) {
    Mesh out;
    const float size[3] = {x, y, z};
    for (uint32_t axis = 0; axis < 3; ++axis)
        for (const float side : {-0.5f, 0.5f}) {
            const uint32_t u = (axis + 1) % 3, v = (axis + 2) % 3;
            Mesh face = shapes::sheet(size[u], size[v], n);
            for (Vec3& p : face.vertices) {
                float q[3];
                q[u] = p.x - size[u] / 2, q[v] = p.y - size[v] / 2, q[axis] = side * size[axis];
                p = {q[0], q[1], q[2]};
            }
            shapes::append(out, side > 0 ? face : shapes::inverted(face));
        }
    return out;
}

// A tube around z, open at its ends, seen from outside.
Mesh tube(double radius, double length, uint32_t around, uint32_t along) {
    Mesh out = shapes::sheet(1, 1, 1);
    out.vertices.clear(), out.triangles.clear();
    for (uint32_t i = 0; i <= along; ++i)
        for (uint32_t j = 0; j < around; ++j) {
            const double angle = 2 * std::numbers::pi * j / around;
            out.vertices.push_back(scenes::to_float(
                {radius * std::cos(angle), radius * std::sin(angle), length * (double(i) / along - 0.5)}));
        }
    for (uint32_t i = 0; i < along; ++i)
        for (uint32_t j = 0; j < around; ++j) {
            const uint32_t p = i * around + j, q = i * around + (j + 1) % around;
            out.triangles.push_back({p, q, q + around});
            out.triangles.push_back({p, q + around, p + around});
        }
    return out;
}

Mesh shell(int subdivisions) {
    Mesh out = shapes::moved(shapes::icosphere(subdivisions), {}, 1.2f);
    shapes::append(out, shapes::inverted(shapes::icosphere(subdivisions)));
    return out;
}

std::vector<Cliff> cliffs() {
    const auto above = [](double gap) { return gap; };
    return {
        {"grids", grid(1, 100), grid(1, 97), {0.5, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6}, 0.3, above},
        {"plates",
         plate(1, 1, 0.1f, 40),
         plate(0.7f, 0.7f, 0.1f, 37),
         {1e-2, 1e-4, 1e-6, 0},
         0.3,
         [](double gap) { return double{0.05f} + double{0.05f} + gap; }},
        {"ball in shell",
         shell(5),
         shapes::moved(shapes::icosphere(5), {}, 0.9f),
         {0.1, 1e-2, 1e-4},
         0,
         [](double gap) { return 0.1 - gap; }},
        {"shaft in bore",
         shapes::inverted(tube(0.51, 4, 96, 48)),
         tube(0.5, 3, 80, 40),
         {1e-2, 1e-4},
         0,
         [](double gap) { return 0.01 - gap; },
         true},
    };
}

void turn(Mesh& mesh, const Quat& rotation) {
    for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(rotation, {v.x, v.y, v.z}));
}

std::vector<Placement> placements(const Cliff& cliff, double gap, const Quat& rotation, bool turned) {
    Random random(7);
    std::vector<Placement> out;
    for (size_t i = 0; i < kPoses; ++i) {
        const double off = cliff.offset(gap);
        Point at{random.in(-1, 1) * cliff.slide, random.in(-1, 1) * cliff.slide, 0};
        at[cliff.along_x ? 0 : 2] += off;
        const Quat own = turned ? rotation : Quat{0, 0, 0, 1};
        const bool moved = turned || rotation.w != 1;
        out.push_back({{{}, own}, {scenes::to_float(moved ? scenes::rotate(rotation, at) : at), own}, {}});
    }
    return out;
}

class Table {
public:
    explicit Table(double seconds) : seconds_(seconds) {
        add_prolate(libraries_);
#ifdef PROLATE_BENCH_FCL
        add_fcl(libraries_);
#endif
#ifdef PROLATE_BENCH_BULLET
        add_bullet(libraries_);
#endif
#ifdef PROLATE_BENCH_ODE
        add_ode(libraries_);
#endif
        fmt::print("{:44}", "");
        for (const auto& library : libraries_)
            if (library->answers(Query::collide)) fmt::print("{:>20}", library->name());
        fmt::print("\n");
    }

    void rows(Cliff cliff) {
        Random random(3);
        const Quat rotation = random.rotation();
        for (const char* how : {"axes", "turned", "baked"}) {
            const bool baked = how == std::string_view("baked"), turned = how == std::string_view("turned");
            if (baked) turn(cliff.a, rotation), turn(cliff.b, rotation);
            if (!turned) build(cliff);
            for (const double gap : cliff.gaps) {
                const auto at = placements(cliff, gap, turned || baked ? rotation : Quat{0, 0, 0, 1}, turned);
                for (const Query query : {Query::collide, Query::distance})
                    row(fmt::format("{} {}, {:g}, {}", query == Query::collide ? "collide" : "distance", cliff.name,
                                    gap, how),
                        query, at);
                contacts_row(fmt::format("contacts {}, {:g}, {}", cliff.name, gap, how), at);
            }
        }
    }

private:
    struct Built {
        const Library* library;
        std::unique_ptr<Shape> a, b;
    };

    void build(const Cliff& cliff) {
        built_.clear();
        for (const auto& library : libraries_)
            if (library->answers(Query::collide))
                built_.push_back(
                    {library.get(), library->build({"a", cliff.a, true}), library->build({"b", cliff.b, true})});
        const auto tree = [](const Mesh& mesh) {
            auto baked = prolate::build(mesh.view(), {.exact = true});
            if (!baked) std::fprintf(stderr, "%s\n", baked.error().what), std::exit(1);
            return std::move(baked->tree);
        };
        trees_.clear();
        trees_.push_back(tree(cliff.a)), trees_.push_back(tree(cliff.b));
    }

    void row(const std::string& name, Query query, const std::vector<Placement>& at) {
        std::vector<std::unique_ptr<Scene>> scenes;
        std::vector<std::function<void(size_t)>> queries;
        for (const Built& b : built_) {
            if (!b.library->answers(query)) continue;
            Scene* const scene = scenes.emplace_back(b.library->place(*b.a, *b.b, at)).get();
            if (query == Query::distance)
                queries.emplace_back([scene](size_t i) { scene->distance(i); });
            else
                queries.emplace_back([scene](size_t i) { scene->collide(i); });
        }
        const auto timings = time_in_sweeps(queries, at.size(), {.batch = false, .seconds = seconds_});
        fmt::print("{:44}", name);
        size_t k = 0;
        for (const Built& b : built_) {
            if (!b.library->answers(query)) {
                fmt::print("{:>20}", "-");
                continue;
            }
            const double us = timings[k].median * 1e-3, ratio = timings[k].median / timings[0].median;
            ++k;
            fmt::print("{:>20}", k == 1 ? fmt::format("{:.4g}", us) : fmt::format("{:.4g} ({:.3g})", us, ratio));
        }
        fmt::print("{}\n", disagreement(scenes, query, at.size()));
        std::fflush(stdout);
    }

    static std::string disagreement(const std::vector<std::unique_ptr<Scene>>& scenes, Query query, size_t poses) {
        if (query != Query::distance) {
            size_t differ = 0;
            for (size_t i = 0; i < poses; ++i)
                for (const auto& scene : scenes)
                    differ += (scene->collide(i) == Contact::meeting) != (scenes[0]->collide(i) == Contact::meeting);
            return differ > 0 ? fmt::format("  other answers: {}", differ) : "";
        }
        double worst = 0;
        for (size_t i = 0; i < poses; ++i)
            for (const auto& scene : scenes)
                worst = std::max(worst, std::abs(scene->distance(i) - scenes[0]->distance(i)));
        return worst > 1e-6 ? fmt::format("  differ by {:.2g}", worst) : "";
    }

    void contacts_row(const std::string& name, const std::vector<Placement>& at) {
        const auto context = std::make_unique<QueryContext>();
        ContactManifolds manifolds;
        uint64_t found = 0;
        const std::vector<std::function<void(size_t)>> queries{[&](size_t i) {
            manifolds = {};
            found = contacts(trees_[0].view(), at[i].a, trees_[1].view(), at[i].b, manifolds, *context).found;
        }};
        queries[0](0);
        if (found == 0) return;
        const auto timing = time_in_sweeps(queries, at.size(), {.batch = false, .seconds = seconds_})[0];
        queries[0](0);
        fmt::print("{:44}{:>20.4g}   {} pairs, {} manifolds\n", name, timing.median * 1e-3, found, manifolds.count);
    }

    double seconds_;
    Libraries libraries_;
    std::vector<Built> built_;
    std::vector<Tree> trees_;
};

} // namespace
} // namespace prolate::bench::peers

int main(int argc, char** argv) {
    using namespace prolate::bench::peers;
    double seconds = 0.1;
    std::vector<std::string> wanted;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word.starts_with("--seconds="))
            seconds = std::strtod(word.c_str() + 10, nullptr);
        else
            wanted.push_back(word);
    }
    Table table(seconds);
    for (Cliff& cliff : cliffs())
        if (wanted.empty() || std::ranges::find(wanted, cliff.name) != wanted.end()) table.rows(std::move(cliff));
    return 0;
}

// What each quality of an exact bake costs, and what queries gain by it.
//
//   bench_exact FILE...
//
// For a mesh, a row for each quality: CPU seconds of the bake in one thread, from the mesh in memory to the proved
// tree, and bytes. A file of a tree (.etree) is a row by itself, for other builders' trees. Then, for the tree against
// itself at two sets of poses (just apart, just touching) and for rays, what a query does on average: blocks tested,
// and CPU time as a share of the first row's, as medians of runs that take turns. All files are of one mesh, and the
// poses those that the first row's tree finds.
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

constexpr size_t kPoses = 256, kRays = 1024;
constexpr int kRounds = 11;

double cpu_seconds(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Row {
    std::string name;
    Tree tree;
    double seconds = 0; // of CPU
};

struct Scenes {
    std::vector<Pose> near, touching; // of the second body
    std::vector<Ray> rays;
};

Vec3 along(const Vec3& a, double t, const scenes::Point& d) {
    return {static_cast<float>(a.x + t * d[0]), static_cast<float>(a.y + t * d[1]), static_cast<float>(a.z + t * d[2])};
}

// Bodies in random attitudes, moved towards each other along a random direction until they are within 0.1 % of the
// diagonal of touching.
Scenes scenes_of(const TreeView& tree, QueryContext& context) {
    scenes::Random random(1);
    Scenes out;
    const Vec3 middle = tree.ellipsoid(0).center;
    const double diagonal = tree.bake_info().diagonal;
    for (size_t i = 0; i < kPoses; ++i) {
        const scenes::Point direction = random.direction();
        Pose pose{{}, random.rotation()};
        const scenes::Point turned = scenes::rotate(pose.rotation, {middle.x, middle.y, middle.z});
        const auto at = [&](double distance) {
            pose.translation = along(along(middle, -1, turned), distance, direction);
            return pose;
        };
        double meets = 0, apart = 2 * diagonal;
        while (apart - meets > 1e-3 * diagonal) {
            const double between = 0.5 * (meets + apart);
            const bool meeting = collide(tree, {}, tree, at(between), context).verdict == Verdict::overlapping;
            (meeting ? meets : apart) = between;
        }
        out.near.push_back(at(apart)), out.touching.push_back(at(meets));
    }
    for (size_t i = 0; i < kRays; ++i) {
        const Vec3 origin = along(middle, diagonal, random.direction()),
                   to = along(middle, 0.25 * diagonal, random.in_ball());
        out.rays.push_back({origin, {to.x - origin.x, to.y - origin.y, to.z - origin.z}});
    }
    return out;
}

// One after the other; the mean number of blocks tested.
template <class Items, class Ask> double blocks(const Items& items, Ask&& ask) {
    uint64_t sum = 0;
    for (const auto& item : items) sum += ask(item).stats.block_tests;
    return static_cast<double>(sum) / static_cast<double>(items.size());
}

constexpr const char* kQueries[] = {"collide near", "collide touching", "distance near", "rays"};

double blocks_of(size_t query, const TreeView& tree, const Scenes& at, QueryContext& context) {
    const auto meet = [&](const Pose& pose) { return collide(tree, {}, tree, pose, context); };
    const auto gap = [&](const Pose& pose) { return distance(tree, {}, tree, pose, context); };
    const auto hit = [&](const Ray& ray) { return raycast(tree, {}, ray, context); };
    return query == 0   ? blocks(at.near, meet)
           : query == 1 ? blocks(at.touching, meet)
           : query == 2 ? blocks(at.near, gap)
                        : blocks(at.rays, hit);
}

void measure(const std::vector<Row>& rows, const Scenes& at, QueryContext& context) {
    std::vector<std::vector<double>> count(std::size(kQueries), std::vector<double>(rows.size())), share = count;
    for (size_t q = 0; q < std::size(kQueries); ++q) {
        std::vector<std::vector<double>> shares(rows.size());
        for (int round = 0; round < kRounds; ++round) {
            double first = 0;
            for (size_t r = 0; r < rows.size(); ++r) {
                const double start = cpu_seconds(CLOCK_THREAD_CPUTIME_ID);
                count[q][r] = blocks_of(q, rows[r].tree.view(), at, context);
                const double time = cpu_seconds(CLOCK_THREAD_CPUTIME_ID) - start;
                if (r == 0) first = time;
                shares[r].push_back(time / first);
            }
        }
        for (size_t r = 0; r < rows.size(); ++r) {
            std::nth_element(shares[r].begin(), shares[r].begin() + kRounds / 2, shares[r].end());
            share[q][r] = shares[r][kRounds / 2];
        }
    }
    for (size_t r = 0; r < rows.size(); ++r) {
        fmt::print("{:28} {:6.2f} {:9}", rows[r].name, rows[r].seconds, rows[r].tree.bytes().size());
        for (size_t q = 0; q < std::size(kQueries); ++q) fmt::print(" {:9.2f} {:6.3f}", count[q][r], share[q][r]);
        fmt::print("\n");
    }
}

int run(const std::vector<std::string>& files) {
    std::vector<Row> rows;
    for (const std::string& file : files) {
        if (file.ends_with(".etree")) {
            auto tree = load(file.c_str());
            if (!tree) return fmt::print(stderr, "bench_exact: {}: {}\n", file, tree.error().what), 1;
            rows.push_back({file, std::move(*tree)});
            continue;
        }
        const auto mesh = load_mesh(file.c_str());
        if (!mesh) return fmt::print(stderr, "bench_exact: {}: {}\n", file, mesh.error().what), 1;
        for (const auto& [name, quality] : {std::pair("normal", Quality::normal), {"fast", Quality::fast}}) {
            const double start = cpu_seconds(CLOCK_PROCESS_CPUTIME_ID);
            auto built = build(mesh->view(), {.exact = true, .quality = quality, .threads = 1});
            if (!built) return fmt::print(stderr, "bench_exact: {}: {}\n", file, built.error().what), 1;
            rows.push_back({fmt::format("{} {}", file.substr(file.rfind('/') + 1), name), std::move(built->tree),
                            cpu_seconds(CLOCK_PROCESS_CPUTIME_ID) - start});
        }
    }
    if (rows.empty()) return 0;
    const auto context = std::make_unique<QueryContext>();
    fmt::print("{:28} {:>6} {:>9}", "tree", "CPU s", "bytes");
    for (const char* const query : kQueries) fmt::print(" {:>16}", query);
    fmt::print("   (blocks a query, share of the first row's time)\n");
    measure(rows, scenes_of(rows[0].tree.view(), *context), *context);
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app("Exact bakes at each quality: their cost, and that of queries about their trees");
    std::vector<std::string> files;
    app.add_option("files", files, "one mesh, or trees of it, or both")->required();
    CLI11_PARSE(app, argc, argv);
    return prolate::run(files);
}

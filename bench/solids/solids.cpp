// How much covers from outside and inside decide without a triangle, and at what price.
//
//   bench_solids MESH... [--ellipsoids N] [--inner N] [--poses N] [--quality fast|normal|best]
//
// A body meets itself: both are turned at random, and B comes along a random direction until the solids first meet, at
// t, by bisection with exact trees. Poses are then t plus a random part of +-1, 5 or 20 % of the diagonal. Printed
// are, for covers of ellipsoids and of as many spheres: the share of poses that collide() of solids decides, apart and
// meeting; the time of a query, and how many blocks of nodes it tests; what a query costs if exact trees are asked
// where covers do not decide; the mean width of the band that distance() of solids leaves, % of the diagonal; and the
// time of that, beside distance() of exact trees, both with a tolerance of 0.1 %; and the time of contacts() of the
// covers alone and of the solids, and what the bounds of the depth, where both are known, come to: the lower one's
// part of the upper one. Times are processor time of the thread, means over all poses, the best of some rounds through
// all of them: each pose is another than the one before, as in a program. Then the same of bodies of which one moves in
// steps of a thousandth of the diagonal, with caches and without. Every decision and every bound is compared with those
// of the exact trees; the program fails if one is wrong.
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/solids.hpp>

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

using scenes::Point;
using scenes::Random;

constexpr double kBands[] = {0.01, 0.05, 0.2}; // of the diagonal
constexpr DistanceOptions kDistance{.tolerance_relative = 1e-3};
constexpr int kBisections = 16;
constexpr int kRounds = 8; // through all poses, to be timed
constexpr int kSteps = 16; // of a motion, each a thousandth of the diagonal

struct Settings {
    uint32_t ellipsoids = 64, inner = 64, poses = 2000;
    std::string quality = "normal";
};

struct Placed {
    Pose a, b;
};

Build bake(const Mesh& mesh, const BuildOptions& options) {
    auto built = build(mesh.view(), options);
    if (!built) throw std::runtime_error(built.error().what);
    return std::move(*built);
}

// Processor time of this thread, seconds.
double thread_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

class Comparison {
public:
    Comparison(const Mesh& mesh, const Settings& settings) : settings_(settings) {
        BuildOptions exact;
        exact.exact = true;
        exact_ = std::make_unique<Build>(bake(mesh, exact));
        for (const Primitive primitive : {Primitive::ellipsoid, Primitive::sphere}) {
            BuildOptions options;
            options.ellipsoids = settings.ellipsoids, options.inner = settings.inner, options.primitive = primitive;
            options.quality = settings.quality == "fast"   ? Quality::fast
                              : settings.quality == "best" ? Quality::best
                                                           : Quality::normal;
            covers_.push_back(std::make_unique<Build>(bake(mesh, options)));
        }
        fmt::print("  outside ratio, share of the solid inside: ellipsoids {:.3f}, {:.3f}; spheres {:.3f}, {:.3f}; "
                   "bytes {} and {}, exact {}\n",
                   outside(0), inside(0), outside(1), inside(1), covers_[0]->tree.bytes().size(),
                   covers_[1]->tree.bytes().size(), exact_->tree.bytes().size());
        fmt::print("  {:>6} {:>10} {:>8} {:>8} {:>8} {:>8} {:>7} {:>10} {:>8} {:>12} {:>18} {:>7}\n", "within",
                   "covers", "decided", "apart", "meeting", "us", "blocks", "us in all", "band %", "distance us",
                   "contacts us", "depth");
    }

    // False if an answer was wrong.
    bool run(double band) {
        const std::vector<Placed> poses = poses_within(band);
        const TreeView exact = exact_->tree.view();
        std::vector<Verdict> truth;
        std::vector<DistanceResult> distances;
        uint64_t blocks = 0;
        for (const Placed& p : poses) {
            const CollideResult met = collide(exact, p.a, exact, p.b, *context_);
            truth.push_back(met.verdict), blocks += met.stats.block_tests;
            distances.push_back(distance(exact, p.a, exact, p.b, *context_, kDistance));
        }
        bool right = true;
        for (size_t k = 0; k < covers_.size(); ++k)
            right =
                compare(band, k == 0 ? "ellipsoids" : "spheres", covers_[k]->tree.view(), poses, truth, distances) &&
                right;
        const double collide_us =
            time(poses, [&](const Placed& p) { return collide(exact, p.a, exact, p.b, *context_).verdict; });
        const double distance_us = time(
            poses, [&](const Placed& p) { return distance(exact, p.a, exact, p.b, *context_, kDistance).verdict; });
        fmt::print("  {:>5.0f}% {:>10} {:>8} {:>8.3f} {:>8.3f} {:>8.2f} {:>7.1f} {:>10.2f} {:>8} {:>12.2f}\n",
                   100 * band, "exact", "", share(truth, Verdict::separated), share(truth, Verdict::overlapping),
                   collide_us, each(blocks, poses), collide_us, "", distance_us);
        print_levels(poses);
        print_moving(poses);
        return right;
    }

private:
    double outside(size_t k) const { return covers_[k]->levels.back().outside_ratio; }
    double inside(size_t k) const {
        const TreeView inner = *covers_[k]->tree.view().inner();
        return inner.level(inner.level_count() - 1).union_volume / covers_[k]->solid_volume;
    }
    static double share(const std::vector<Verdict>& verdicts, Verdict of) {
        return static_cast<double>(std::count(verdicts.begin(), verdicts.end(), of)) /
               static_cast<double>(verdicts.size());
    }
    static double each(uint64_t count, const std::vector<Placed>& poses) {
        return static_cast<double>(count) / static_cast<double>(poses.size());
    }
    // What each level of the ellipsoids decides, and how wide the band is there.
    void print_levels(const std::vector<Placed>& poses) {
        const TreeView tree = covers_[0]->tree.view();
        fmt::print("         levels, decided and band %:");
        for (uint32_t level = 0; level < tree.level_count(); ++level) {
            const Solid solid(tree, level);
            double decided = 0, width = 0;
            for (const Placed& p : poses) {
                decided += collide(solid, p.a, solid, p.b, *context_).verdict != Verdict::undecided;
                const SolidsDistance d = distance(solid, p.a, solid, p.b, *context_, kDistance);
                width += d.upper - d.lower;
            }
            const auto count = static_cast<double>(poses.size());
            fmt::print(" {:.3f} {:.2f}{}", decided / count, 100 * width / exact_->diagonal / count,
                       level + 1 < tree.level_count() ? "," : "\n");
        }
    }
    // The same from pose to pose of bodies that move, with a cache and without.
    void print_moving(const std::vector<Placed>& poses) {
        const TreeView exact = exact_->tree.view();
        const Solid solid(covers_[0]->tree.view());
        const auto step = static_cast<float>(1e-3 * exact_->diagonal);
        const auto along = [&]<class Cache>(Cache*, const auto& query) { // with a cache that is empty at first
            const auto motion = [&](const Placed& p) {
                Cache cache;
                Pose b = p.b;
                uint64_t sum = 0;
                for (int i = 0; i < kSteps; ++i, b.translation.z += step)
                    sum += static_cast<uint64_t>(query(p.a, b, &cache));
                return sum;
            };
            return time(poses, motion) / kSteps;
        };
        const auto of_solids = [&](const Pose& a, const Pose& b, SolidsCache* cache) {
            return collide(solid, a, solid, b, *context_, {}, cache).verdict;
        };
        const auto of_exact = [&](const Pose& a, const Pose& b, PairCache* cache) {
            return collide(exact, a, exact, b, *context_, {}, cache).verdict;
        };
        SolidsCache* const solids_cache = nullptr;
        PairCache* const pair_cache = nullptr;
        fmt::print("         moving, us: ellipsoids {:.2f}, with a cache {:.2f}; exact {:.2f}, with a cache {:.2f}\n",
                   along(solids_cache, [&](const Pose& a, const Pose& b, auto*) { return of_solids(a, b, nullptr); }),
                   along(solids_cache, of_solids),
                   along(pair_cache, [&](const Pose& a, const Pose& b, auto*) { return of_exact(a, b, nullptr); }),
                   along(pair_cache, of_exact));
    }
    // Microseconds of a call.
    template <class Query> double time(const std::vector<Placed>& poses, const Query& query) {
        double best = HUGE_VAL;
        for (int round = 0; round < kRounds; ++round) {
            const double start = thread_seconds();
            for (const Placed& p : poses) sink_ += static_cast<uint64_t>(query(p));
            best = std::min(best, thread_seconds() - start);
        }
        return 1e6 * best / static_cast<double>(poses.size());
    }

    std::vector<Placed> poses_within(double band) {
        const double diagonal = exact_->diagonal;
        const TreeView exact = exact_->tree.view();
        Random random(11);
        std::vector<Placed> out;
        while (out.size() < settings_.poses) {
            Placed p;
            p.a.rotation = random.rotation(), p.b.rotation = random.rotation();
            const Point d = random.direction();
            const Vec3 middle = exact.root().center; // both turn about their middles
            const Point from = scenes::rotate(p.a.rotation, {middle.x, middle.y, middle.z}),
                        to = scenes::rotate(p.b.rotation, {middle.x, middle.y, middle.z});
            const auto at = [&](double t) {
                p.b.translation = scenes::to_float(
                    {from[0] - to[0] + t * d[0], from[1] - to[1] + t * d[1], from[2] - to[2] + t * d[2]});
                return p;
            };
            const auto meet = [&](double t) {
                at(t);
                return collide(exact, p.a, exact, p.b, *context_).verdict == Verdict::overlapping;
            };
            if (!meet(0)) continue;
            double low = 0, high = 3 * diagonal;
            for (int i = 0; i < kBisections; ++i) {
                const double t = (low + high) / 2;
                (meet(t) ? low : high) = t;
            }
            out.push_back(at(high + band * diagonal * random.in(-1, 1)));
        }
        return out;
    }

    bool compare(double band, const char* name, const TreeView& tree, const std::vector<Placed>& poses,
                 const std::vector<Verdict>& truth, const std::vector<DistanceResult>& distances) {
        const Solid solid(tree);
        const TreeView exact = exact_->tree.view();
        std::vector<Verdict> verdicts;
        double width = 0, lower = 0, upper = 0;
        size_t wrong = 0;
        uint64_t blocks = 0;
        for (size_t i = 0; i < poses.size(); ++i) {
            const Placed& p = poses[i];
            const SolidsResult met = collide(solid, p.a, solid, p.b, *context_);
            const Verdict verdict = met.verdict;
            blocks += met.stats.block_tests;
            wrong += verdict != Verdict::undecided && verdict != truth[i];
            verdicts.push_back(verdict);
            const SolidsDistance d = distance(solid, p.a, solid, p.b, *context_, kDistance);
            wrong += d.lower > distances[i].upper || d.upper < distances[i].lower;
            width += d.upper - d.lower;
            ContactManifolds manifolds;
            const SolidsContacts c = contacts(solid, p.a, solid, p.b, manifolds, *context_);
            wrong += (c.depth_lower > 0 && truth[i] != Verdict::overlapping) || c.verdict != verdict;
            if (c.depth_lower > 0 && c.depth_upper < HUGE_VAL) lower += c.depth_lower, upper += c.depth_upper;
        }
        const auto of_solids = [&](const Placed& p) { return collide(solid, p.a, solid, p.b, *context_).verdict; };
        const auto in_all = [&](const Placed& p) {
            const Verdict verdict = of_solids(p);
            return verdict == Verdict::undecided ? collide(exact, p.a, exact, p.b, *context_).verdict : verdict;
        };
        ContactManifolds kept;
        fmt::print(
            "  {:>5.0f}% {:>10} {:>8.3f} {:>8.3f} {:>8.3f} {:>8.2f} {:>7.1f} {:>10.2f} {:>8.2f} {:>12.2f} {:>8.1f}, "
            "{:>8.1f} {:>7.2f}\n",
            100 * band, name, 1 - share(verdicts, Verdict::undecided), share(verdicts, Verdict::separated),
            share(verdicts, Verdict::overlapping), time(poses, of_solids), each(blocks, poses), time(poses, in_all),
            100 * width / exact_->diagonal / static_cast<double>(poses.size()),
            time(poses,
                 [&](const Placed& p) { return distance(solid, p.a, solid, p.b, *context_, kDistance).verdict; }),
            time(poses, [&](const Placed& p) { return contacts(tree, p.a, tree, p.b, kept, *context_).verdict; }),
            time(poses, [&](const Placed& p) { return contacts(solid, p.a, solid, p.b, kept, *context_).verdict; }),
            upper > 0 ? lower / upper : 0);
        if (wrong > 0) fmt::print("  {} of {} answers are WRONG\n", wrong, poses.size());
        return wrong == 0;
    }

    const Settings& settings_;
    std::unique_ptr<Build> exact_;
    std::vector<std::unique_ptr<Build>> covers_;
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    uint64_t sink_ = 0; // so that no query is left out
};

int run(const std::vector<std::string>& meshes, const Settings& settings) {
    bool right = true;
    for (const std::string& path : meshes) {
        const auto mesh = load_mesh(path.c_str());
        if (!mesh) return fmt::print(stderr, "{}: {}\n", path, mesh.error().what), 1;
        fmt::print("{}\n", path);
        Comparison comparison(*mesh, settings);
        for (const double band : kBands) right = comparison.run(band) && right;
    }
    return right ? 0 : 1;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app{"Covers from outside and inside, beside exact trees"};
    std::vector<std::string> meshes;
    prolate::Settings settings;
    app.add_option("mesh", meshes, "closed meshes")->required();
    app.add_option("--ellipsoids", settings.ellipsoids, "outside")->capture_default_str();
    app.add_option("--inner", settings.inner, "inside")->capture_default_str();
    app.add_option("--poses", settings.poses, "for each band")->capture_default_str();
    app.add_option("--quality", settings.quality, "of the outer covers")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        return prolate::run(meshes, settings);
    } catch (const std::exception& error) {
        return fmt::print(stderr, "{}\n", error.what()), 1;
    }
}

// Starts and polish: whatever the start was, the result covers every piece.
#include "builder/exchange.hpp"
#include "builder/flat_set.hpp"
#include "builder/neighbourhood_search.hpp"
#include "builder/polish.hpp"
#include "builder/random.hpp"
#include "builder/start.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <vector>

namespace prolate {
namespace {

constexpr double kMinRadius = 1e-5;

// A mesh and what is derived from it.
struct Scene {
    Mesh mesh;
    bool closed;
    Winding winding{mesh.view()};
    DistanceField field{mesh.view(), closed, winding, 40};
    Voxels cells{mesh.view(), closed, winding, 20};
    Pieces pieces{mesh.view(), closed, winding, 32};
    Columns columns = measuring_columns(mesh.view(), closed, &winding, 96);

    explicit Scene(Mesh m, bool is_closed = true) : mesh(std::move(m)), closed(is_closed) {}
    double outside(std::span<const Fit> fits) const {
        std::vector<Ellipsoid> ellipsoids;
        for (const Fit& fit : fits) ellipsoids.push_back(fit.ellipsoid());
        return measure_cover(columns, ellipsoids).outside.value;
    }
    std::vector<uint32_t> all_cells() const {
        std::vector<uint32_t> out(cells.cell_count());
        std::iota(out.begin(), out.end(), 0u);
        return out;
    }
    std::vector<Cluster> merged(std::span<const uint32_t> members, uint32_t k) const {
        return merge_start(cells, members, k, 16, kMinRadius,
                           [this](const Fit& fit) { return sampled_outside_volume(fit, field); });
    }
};

Mesh crowd() {
    Mesh mesh;
    for (const float x : {0.0f, 3.0f, 6.0f, 9.0f, 12.0f})
        shapes::append(mesh, shapes::moved(shapes::icosphere(1), {x, std::fmod(x, 2.0f), 0}, 0.4f));
    return mesh;
}

std::vector<std::unique_ptr<Scene>> scenes() {
    std::vector<std::unique_ptr<Scene>> out;
    out.push_back(std::make_unique<Scene>(shapes::torus(1, 0.3f, 40, 20)));
    out.push_back(std::make_unique<Scene>(shapes::box(1, 2, 0.02f)));
    out.push_back(std::make_unique<Scene>(crowd()));
    out.push_back(std::make_unique<Scene>(shapes::sheet(2, 1, 6), false));
    return out;
}

// --- starts ---------------------------------------------------------------------------------------------------------

void expect_partition(const Scene& scene, const std::vector<Cluster>& clusters, std::span<const uint32_t> cells) {
    std::vector<uint32_t> seen;
    for (const Cluster& cluster : clusters) {
        EXPECT_FALSE(cluster.cells.empty());
        EXPECT_TRUE(std::ranges::is_sorted(cluster.cells));
        EXPECT_TRUE(within_caps(cluster.fit, kMinRadius));
        seen.insert(seen.end(), cluster.cells.begin(), cluster.cells.end());
        // The ellipsoid is about where its cells are.
        Box box;
        for (const uint32_t cell : cluster.cells) box.add(scene.cells.box(cell));
        const Vec half = 0.5 * box.size() + Vec::Constant(scene.cells.pitch());
        EXPECT_TRUE(((cluster.fit.center - box.center()).cwiseAbs().array() <= half.array()).all());
    }
    std::ranges::sort(seen);
    EXPECT_TRUE(std::ranges::equal(seen, cells));
}

void expect_same(const std::vector<Cluster>& a, const std::vector<Cluster>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].cells, b[i].cells);
        EXPECT_EQ(a[i].fit.factor, b[i].fit.factor);
        EXPECT_EQ(a[i].fit.center, b[i].fit.center);
    }
}

TEST(Start, IsAPartitionInAsManyClustersAsAsked) {
    for (const auto& scene : scenes()) {
        const std::vector<uint32_t> all = scene->all_cells();
        std::vector<uint32_t> some;
        Random random(1);
        for (const uint32_t cell : all)
            if (random.uniform() < 0.4) some.push_back(cell);
        const std::vector<uint32_t> few(all.begin() + 3, all.begin() + 8), none;
        for (const std::vector<uint32_t>& cells : {all, some, few, none})
            for (const uint32_t k : {1u, 2u, 7u, 64u, 100u}) {
                const auto expected = std::min<size_t>(k, cells.size());
                if (k <= 64) {
                    const auto merged = scene->merged(cells, k);
                    EXPECT_EQ(merged.size(), expected);
                    expect_partition(*scene, merged, cells);
                    expect_same(merged, scene->merged(cells, k));
                }
                const auto spread = spread_start(scene->cells, cells, k, 5, kMinRadius);
                EXPECT_LE(spread.size(), expected);
                EXPECT_GE(static_cast<double>(spread.size()), 0.9 * static_cast<double>(expected));
                expect_partition(*scene, spread, cells);
                expect_same(spread, spread_start(scene->cells, cells, k, 5, kMinRadius));
            }
    }
}

TEST(Start, MergingFindsSeparateParts) {
    const Scene scene(crowd());
    const auto clusters = scene.merged(scene.all_cells(), 5);
    ASSERT_EQ(clusters.size(), 5u);
    for (const Cluster& cluster : clusters) {
        EXPECT_LT(cluster.fit.half_extents().maxCoeff(), 0.6);
        const double i = std::round(cluster.fit.center.x() / 3);
        EXPECT_LT((cluster.fit.center - Vec(3 * i, std::fmod(3 * i, 2), 0)).norm(), 0.1);
    }
}

TEST(SampledOutsideVolume, IsTheEllipsoidsVolumeOutsideTheSolid) {
    const Scene scene(shapes::icosphere(3));
    const double inner = shapes::enclosed_volume(scene.mesh);
    const auto of = [&](const Fit& fit) { return sampled_outside_volume(fit, scene.field); };
    EXPECT_NEAR(of(Fit(Vec::Zero(), 0.8 * Mat::Identity())), 0, 1e-9);
    EXPECT_NEAR(of(Fit(Vec(5, 0, 0), 0.5 * Mat::Identity())), Fit().volume() / 8, 1e-9);
    for (const double stretch : {1.2, 2.0, 3.0}) {
        const Fit fit(Vec::Zero(), Vec(1.1, stretch, 1.2).asDiagonal().toDenseMatrix());
        EXPECT_NEAR(of(fit), fit.volume() - inner, 0.05 * fit.volume());
    }
    const Fit fit(Vec(5, 0, 0), Mat::Identity()), same = fit, half(Vec(15, 0, 0), 10 * Mat::Identity());
    EXPECT_EQ(sampled_outside_volume(fit, scene.field, std::vector{&same}), 0);
    EXPECT_NEAR(sampled_outside_volume(fit, scene.field, std::vector{&half}), fit.volume() / 2, 0.1 * fit.volume());
}

TEST(Exchanges, GiveWhatIsTooMuchToWhereItIsMissing) {
    const Scene scene(crowd());
    const auto cells = scene.all_cells();
    // Two ellipsoids for the first ball, and one for the last two.
    std::vector<std::vector<uint32_t>> shares(5);
    for (const uint32_t cell : cells) {
        const Vec at = scene.cells.box(cell).center();
        const auto ball = static_cast<size_t>(std::lround(at.x() / 3));
        shares[ball == 0 ? (at.y() > 0 ? 4 : 0) : std::min<size_t>(ball, 3)].push_back(cell);
    }
    const std::vector<Fit> fits(5);
    const auto sets = exchanges(
        fits, shares, scene.cells, kMinRadius, [&](const Fit& fit) { return sampled_outside_volume(fit, scene.field); },
        3);
    ASSERT_EQ(sets.size(), 3u);
    ASSERT_EQ(sets[0].size(), 5u);
    const auto around = [](const Fit& fit) {
        return fit.half_extents().maxCoeff() < 0.6 && fit.factor != Fit().factor;
    };
    EXPECT_TRUE(around(sets[0][0])); // the merged one
    EXPECT_TRUE(around(sets[0][4])); // and the halves
    EXPECT_TRUE(around(sets[0][3]));
    EXPECT_LT(sets[0][0].center.head<2>().norm(), 0.1);
    EXPECT_NEAR(std::abs(sets[0][3].center.x() - sets[0][4].center.x()), 3, 0.1);
    EXPECT_EQ(sets[0][1].factor, fits[1].factor);
    EXPECT_EQ(sets[0][2].factor, fits[2].factor);
}

// --- polish ---------------------------------------------------------------------------------------------------------

std::vector<Fit> spread(const Scene& scene, uint32_t k, Primitive primitive, double scale = 1) {
    std::vector<Fit> set;
    for (const Cluster& cluster : spread_start(scene.cells, scene.all_cells(), k, 3, kMinRadius)) {
        const Fit fit =
            capped(cluster.fit.center, scale * scale * cluster.fit.factor * cluster.fit.factor.transpose(), kMinRadius);
        set.push_back(as_primitive(fit, primitive));
    }
    return set;
}

PolishOptions options_for(const Scene& scene, Primitive primitive, int sweeps = 6) {
    return {{0.5, 0.5, 0.2},
            primitive,
            sweeps,
            0.01,
            128,
            kMinRadius,
            {},
            [&scene](std::span<const Fit> fits) { return scene.outside(fits); },
            1};
}

void expect_cover(const std::vector<Fit>& set, const Pieces& pieces, const std::vector<uint32_t>& owner) {
    constexpr double kHeld = 1 + 1e-6;
    ASSERT_EQ(owner.size(), pieces.size());
    for (uint32_t piece = 0; piece < pieces.size(); ++piece) {
        ASSERT_LT(owner[piece], set.size());
        EXPECT_LE(set[owner[piece]].reach(pieces.points(piece)), kHeld);
    }
}

// The start, each ellipsoid enlarged until it has the pieces that it is nearest to.
std::vector<Fit> inflated(const std::vector<Fit>& set, const Pieces& pieces) {
    std::vector<double> reach(set.size(), 0);
    for (uint32_t piece = 0; piece < pieces.size(); ++piece) {
        size_t nearest = 0;
        double least = HUGE_VAL;
        for (size_t i = 0; i < set.size(); ++i)
            if (const double r = set[i].reach(pieces.points(piece)); r < least) least = r, nearest = i;
        reach[nearest] = std::max(reach[nearest], least);
    }
    std::vector<Fit> out;
    for (size_t i = 0; i < set.size(); ++i)
        if (reach[i] > 0) out.push_back(set[i].scaled(reach[i]));
    return out;
}

TEST(MergeGroups, PartitionsWithinTheLimit) {
    // Points in a row: what is next to each other fits together.
    constexpr uint32_t kCount = 40;
    std::vector<Sketch> row;
    std::vector<std::vector<uint32_t>> touching(kCount);
    for (uint32_t i = 0; i < kCount; ++i) {
        const double x = i + 0.3 * std::sin(7.0 * i);
        row.emplace_back(std::vector<Vec>{{x, 0, 0}, {x + 1, 0.5, 0}, {x + 1, 0, 0.5}});
        if (i > 0) touching[i] = {i - 1};
    }
    const auto volume = [](const Fit& fit) { return fit.volume(); };
    for (const bool connected : {true, false}) // without neighbours, everybody is one
        for (const uint32_t k : {1u, 2u, 7u, 39u, 40u, 41u})
            for (const size_t most : {size_t{1}, size_t{6}, size_t{12}, size_t{40}}) {
                const auto neighbours = connected ? touching : std::vector<std::vector<uint32_t>>(kCount);
                const auto groups = merge_groups(row, neighbours, k, most, kMinRadius, volume);
                ASSERT_EQ(groups.size(), std::min(k, kCount));
                std::vector<uint32_t> seen(kCount, 0);
                size_t largest = 0;
                for (const auto& group : groups) {
                    EXPECT_TRUE(std::is_sorted(group.begin(), group.end()));
                    largest = std::max(largest, group.size());
                    for (const uint32_t member : group) ++seen.at(member);
                    if (connected && most >= kCount) {
                        EXPECT_EQ(group.back() - group.front() + 1, group.size());
                    }
                }
                EXPECT_EQ(seen, std::vector<uint32_t>(kCount, 1));
                if (most * k >= 2 * kCount) { // then it can be kept, see kMostShare in grow.cpp
                    EXPECT_LE(largest, most);
                }
            }
}

TEST(Polish, CoversAllPiecesWithLessThanTheInflatedStart) {
    for (const auto& scene : scenes())
        for (const Primitive primitive : {Primitive::ellipsoid, Primitive::sphere})
            for (const uint32_t k : {1u, 2u, 9u, 40u}) {
                std::vector<Fit> set = spread(*scene, k, primitive);
                const double before = scene->outside(inflated(set, scene->pieces));
                const auto owner = polish(set, scene->pieces, scene->field, options_for(*scene, primitive));
                expect_cover(set, scene->pieces, owner);
                EXPECT_LE(scene->outside(set), before * (1 + 1e-6)) << k;
                for (const Fit& fit : set) {
                    EXPECT_TRUE(within_caps(fit, kMinRadius, kMaxAxisRatio));
                    if (primitive == Primitive::sphere) {
                        EXPECT_EQ(fit.factor, fit.factor(0, 0) * Mat::Identity());
                    }
                }
            }
}

TEST(Polish, CoversFromTheWorstOfStarts) {
    for (const auto& scene : scenes()) {
        // Much too small, much too large, and all in one corner.
        for (const double scale : {0.1, 3.0}) {
            std::vector<Fit> set = spread(*scene, 12, Primitive::ellipsoid, scale);
            expect_cover(set, scene->pieces,
                         polish(set, scene->pieces, scene->field, options_for(*scene, Primitive::ellipsoid)));
        }
        std::vector<Fit> set;
        const Vec corner = to_vec(scene->mesh.vertices[0]);
        for (int i = 0; i < 6; ++i) set.emplace_back(corner + 0.01 * i * Vec::Ones(), 0.02 * Mat::Identity());
        expect_cover(set, scene->pieces,
                     polish(set, scene->pieces, scene->field, options_for(*scene, Primitive::ellipsoid)));
    }
}

TEST(Polish, FindsTheBallThatTheSolidIs) {
    const Scene scene(shapes::icosphere(4));
    std::vector<Fit> set{Fit(Vec(0.02, 0, 0), Vec(1.08, 1, 1.04).asDiagonal().toDenseMatrix())};
    const auto owner = polish(set, scene.pieces, scene.field, options_for(scene, Primitive::ellipsoid, 40));
    expect_cover(set, scene.pieces, owner);
    EXPECT_LT(set[0].volume(), 1.02 * Fit().volume());
}

TEST(Polish, IsTheSameForAnyNumberOfThreads) {
    const Scene scene(shapes::torus(1, 0.3f, 40, 20));
    std::vector<Fit> sets[2] = {spread(scene, 30, Primitive::ellipsoid), spread(scene, 30, Primitive::ellipsoid)};
    std::vector<uint32_t> owners[2];
    for (const size_t run : {0u, 1u})
        tbb::task_arena(run == 0 ? 1 : 4).execute([&] {
            owners[run] = polish(sets[run], scene.pieces, scene.field, options_for(scene, Primitive::ellipsoid));
        });
    EXPECT_EQ(owners[0], owners[1]);
    for (size_t i = 0; i < sets[0].size(); ++i) {
        EXPECT_EQ(sets[0][i].center, sets[1][i].center);
        EXPECT_EQ(sets[0][i].factor, sets[1][i].factor);
    }
}

// Is the piece in an ellipsoid of this scale?
bool held(const std::vector<Fit>& set, const Pieces& pieces, uint32_t piece, double scale) {
    return std::ranges::any_of(set, [&](const Fit& fit) { return fit.reach(pieces.points(piece)) <= scale; });
}

TEST(RefineSeams, CutsWhatNobodyHoldsAndNothingElse) {
    Scene scene(shapes::torus(1, 0.3f, 40, 20));
    const std::vector<Fit> set = spread(scene, 20, Primitive::ellipsoid, 1.1);
    const uint32_t count = scene.pieces.size();
    std::vector<std::vector<Vec>> before;
    for (uint32_t piece = 0; piece < count; ++piece)
        before.emplace_back(scene.pieces.points(piece).begin(), scene.pieces.points(piece).end());
    std::vector<bool> kept(count);
    for (uint32_t piece = 0; piece < count; ++piece) kept[piece] = held(set, scene.pieces, piece, 1);
    refine_seams(scene.pieces, set);
    EXPECT_GT(scene.pieces.size(), count);
    for (uint32_t piece = 0; piece < count; ++piece)
        if (kept[piece]) {
            EXPECT_TRUE(std::ranges::equal(before[piece], scene.pieces.points(piece)));
        }
    for (uint32_t piece = 0; piece < scene.pieces.size(); ++piece)
        if (!held(set, scene.pieces, piece, 1.01)) {
            EXPECT_FALSE(scene.pieces.refine(piece));
        }
}

// --- neighbourhoods -------------------------------------------------------------------------------------------------

// What a search in neighbourhoods gets: a set that a short descent found, and points.
struct Rough {
    const Scene& scene;
    std::vector<Fit> fits;
    std::vector<Vec> points;

    explicit Rough(const Scene& s) : scene(s), fits(spread(s, 16, Primitive::ellipsoid)) {
        for (uint32_t piece = 0; piece < scene.pieces.size(); ++piece)
            scene.pieces.for_each_surface_point(piece, [this](const Vec& p) { points.push_back(p); });
    }
    double error(std::span<const Fit> some) const {
        std::vector<Ellipsoid> ellipsoids;
        for (const Fit& fit : some) ellipsoids.push_back(fit.ellipsoid());
        const CoverVolume v = measure_cover(scene.columns, ellipsoids);
        return v.outside.value + 50 * (v.solid.value - (v.whole.value - v.outside.value));
    }
    void search(int trials) {
        search_neighbourhoods(fits, scene.field, points,
                              {.descent = {.objective = {0.5, 0.5, 0.3},
                                           .primitive = Primitive::ellipsoid,
                                           .iterations = 100,
                                           .directions = 96,
                                           .min_radius = kMinRadius,
                                           .relocate = false,
                                           .first_kappa = 4,
                                           .seed = 7},
                               .size = 4,
                               .trials = trials,
                               .error = [this](std::span<const Fit> some) { return error(some); },
                               .progress = {}});
    }
};

TEST(NeighbourhoodSearch, LowersTheErrorTrialByTrial) {
    for (const auto& scene : scenes()) {
        double last = HUGE_VAL;
        for (const int trials : {0, 8, 64}) {
            Rough rough(*scene); // the longer search begins as the shorter one does
            rough.search(trials);
            const double error = rough.error(rough.fits);
            EXPECT_LE(error, last) << trials;
            EXPECT_EQ(rough.fits.size(), 16u);
            last = error;
        }
        EXPECT_LT(last, Rough(*scene).error(Rough(*scene).fits));
    }
}

TEST(NeighbourhoodSearch, IsTheSameForAnyNumberOfThreads) {
    const Scene scene(shapes::torus(1, 0.3f, 40, 20));
    Rough sets[2] = {Rough(scene), Rough(scene)};
    for (const size_t run : {0u, 1u}) tbb::task_arena(run == 0 ? 1 : 4).execute([&] { sets[run].search(24); });
    for (size_t i = 0; i < sets[0].fits.size(); ++i) {
        EXPECT_EQ(sets[0].fits[i].center, sets[1].fits[i].center);
        EXPECT_EQ(sets[0].fits[i].factor, sets[1].fits[i].factor);
    }
}

// --- flat sets ------------------------------------------------------------------------------------------------------

// However many are asked for, those that are of no use make nothing worse.
TEST(FlatSet, IsNoLooserWhereItIsSplit) {
    for (const auto& scene : scenes()) {
        const Solid solid{.pieces = scene->pieces,
                          .cells = scene->cells,
                          .field = scene->field,
                          .columns = scene->columns,
                          .area = 1,
                          .outside = nullptr,
                          .distance = nullptr};
        const BuildOptions options;
        FlatSetMaker sets(solid, options, effort_of(Quality::fast), kMinRadius);
        FlatSet set = sets.make(6, nullptr, [](double) {});
        for (const size_t count : {7u, 90u}) {
            const double before = set.outside;
            sets.split(set, count);
            EXPECT_EQ(set.parts.size(), count);
            EXPECT_LE(set.outside, before * (1 + 1e-6));
            EXPECT_EQ(set.outside, scene->outside(fits_of(set.parts)));
            std::vector<uint32_t> owner(scene->pieces.size(), UINT32_MAX);
            for (uint32_t part = 0; part < set.parts.size(); ++part)
                for (const uint32_t piece : set.parts[part].pieces) owner[piece] = part;
            expect_cover(fits_of(set.parts), scene->pieces, owner);
        }
    }
}

} // namespace
} // namespace prolate

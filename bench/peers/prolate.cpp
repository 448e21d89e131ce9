// prolate itself: the only file here that calls its queries.
#include "bench/peers/library.hpp"
#include "bench/peers/pairs.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/pairs.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <vector>

namespace prolate::bench::peers {
namespace {

class ProlateShape final : public Shape {
public:
    explicit ProlateShape(Tree tree) : tree_(std::move(tree)) {}
    size_t bytes() const override { return tree_.bytes().size(); }
    TreeView view() const { return tree_.view(); }

private:
    Tree tree_;
};

class ProlateScene : public Scene {
public:
    ProlateScene(TreeView a, TreeView b, std::span<const Placement> poses) : a_(a), b_(b), poses_(poses) {}
    Contact collide(size_t i) override {
        const CollideResult result = query(i);
        if (result.verdict == Verdict::separated) return Contact::separated;
        return result.enclosed ? Contact::enclosed : Contact::meeting;
    }
    double distance(size_t i) override { return distance_query(i).upper; }
    Work collide_work(size_t i) override { return work(query(i).stats); }
    Work distance_work(size_t i) override { return work(distance_query(i).stats); }

protected:
    virtual CollideResult query(size_t i) { return collide_at(i, poses_[i].b, nullptr); }
    CollideResult collide_at(size_t i, const Pose& b, PairCache* cache) {
        return prolate::collide(a_, poses_[i].a, b_, b, context_, {}, cache);
    }
    const Placement& pose(size_t i) const { return poses_[i]; }

private:
    static Work work(const QueryStats& stats) { return {stats.pair_tests, stats.triangle_tests}; }
    DistanceResult distance_query(size_t i) { return prolate::distance(a_, poses_[i].a, b_, poses_[i].b, context_); }
    TreeView a_, b_;
    std::span<const Placement> poses_;
    QueryContext context_;
};

// The queries of bodies that have moved a little since the last one, which left a cache.
class ProlateAgain final : public ProlateScene {
public:
    ProlateAgain(TreeView a, TreeView b, std::span<const Placement> poses) : ProlateScene(a, b, poses) {
        for (size_t i = 0; i < poses.size(); ++i) collide_at(i, poses[i].before, &caches_.emplace_back());
    }

private:
    CollideResult query(size_t i) override {
        PairCache cache = caches_[i]; // each sweep finds it as the query before has left it
        return collide_at(i, pose(i).b, &cache);
    }
    std::vector<PairCache> caches_;
};

class Prolate : public Library {
public:
    explicit Prolate(uint32_t leaves) : leaves_(leaves) {} // 0: an exact tree
    std::string name() const override { return "prolate"; }
    std::string about() const override {
        return "this checkout, exact trees of the default options, compiled portable by " PROLATE_BENCH_COMPILER
               "; distances to 1e-6, relative";
    }
    std::string form() const override { return leaves_ == 0 ? "prolate" : fmt::format("prolate-{}", leaves_); }
    bool answers(Query query) const override { return (query == Query::proxy) == (leaves_ != 0); }
    std::unique_ptr<Shape> build(const Model& model) const override {
        BuildOptions options;
        options.exact = leaves_ == 0, options.ellipsoids = leaves_;
        if (leaves_ > 0) options.quality = Quality::fast; // bakes must not take longer than the benchmarks
        auto built = prolate::build(model.mesh.view(), options);
        if (!built) {
            std::fprintf(stderr, "prolate cannot bake %s: %s\n", model.name.c_str(), built.error().what);
            return nullptr;
        }
        return std::make_unique<ProlateShape>(std::move(built->tree));
    }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<ProlateScene>(static_cast<const ProlateShape&>(a).view(),
                                              static_cast<const ProlateShape&>(b).view(), poses);
    }

private:
    uint32_t leaves_;
};

class ProlateCached final : public Prolate {
public:
    ProlateCached() : Prolate(0) {}
    std::string name() const override { return "prolate-cached"; }
    std::string about() const override { return "the same trees, with the PairCache that the query before has left"; }
    bool answers(Query query) const override { return query == Query::again; }
    std::unique_ptr<Scene> place(const Shape& a, const Shape& b, std::span<const Placement> poses) const override {
        return std::make_unique<ProlateAgain>(static_cast<const ProlateShape&>(a).view(),
                                              static_cast<const ProlateShape&>(b).view(), poses);
    }
};

// How pairs are asked for.
enum class Calls : uint8_t {
    batch,  // all at once, placed for it in the same time: bodies that lie in one pair only
    placed, // all at once, placed before: bodies that lie in many pairs
    single, // one by one
};

class ProlatePairs final : public PairScene {
public:
    ProlatePairs(std::span<const EllipsoidPair> pairs, Calls calls) : calls_(calls) {
        const auto add = [&](const std::array<float, 3>& r, const Pose& pose) {
            shapes_.push_back({.center = {}, .l11 = r[0], .l22 = r[1], .l33 = r[2]});
            poses_.push_back(pose);
        };
        for (const EllipsoidPair& p : pairs) {
            add(p.radii_a, p.a), add(p.radii_b, p.b);
            const auto last = static_cast<uint32_t>(shapes_.size());
            pairs_.push_back({last - 2, last - 1});
        }
        world_.resize(shapes_.size()), verdicts_.resize(pairs.size()), distances_.resize(pairs.size());
        prolate::place(shapes_, poses_, world_);
    }
    void meet(std::span<uint8_t> out) override {
        if (calls_ == Calls::single) {
            for (size_t i = 0; i < out.size(); ++i)
                verdicts_[i] = prolate::collide(shapes_[2 * i], poses_[2 * i], shapes_[2 * i + 1], poses_[2 * i + 1]);
        } else {
            if (calls_ == Calls::batch) prolate::place(shapes_, poses_, world_);
            prolate::collide({shapes_, poses_, world_}, pairs_, verdicts_);
        }
        for (size_t i = 0; i < out.size(); ++i) out[i] = verdicts_[i] != Verdict::separated;
    }
    void distance(std::span<double> out) override {
        if (calls_ == Calls::single) {
            for (size_t i = 0; i < out.size(); ++i)
                distances_[i] =
                    prolate::distance(shapes_[2 * i], poses_[2 * i], shapes_[2 * i + 1], poses_[2 * i + 1], kTolerance);
        } else {
            if (calls_ == Calls::batch) prolate::place(shapes_, poses_, world_);
            prolate::distance({shapes_, poses_, world_}, pairs_, distances_, kTolerance);
        }
        for (size_t i = 0; i < out.size(); ++i) out[i] = static_cast<double>(distances_[i].upper);
    }

private:
    static constexpr float kTolerance = 1e-5f; // that of the comparison
    Calls calls_;
    std::vector<Ellipsoid> shapes_;
    std::vector<Pose> poses_;
    std::vector<WorldEllipsoid> world_;
    std::vector<IndexPair> pairs_;
    std::vector<Verdict> verdicts_;
    std::vector<PairDistance> distances_;
};

class ProlatePairLibrary final : public PairLibrary {
public:
    ProlatePairLibrary(const char* name, const char* about, Calls calls) : name_(name), about_(about), calls_(calls) {}
    std::string name() const override { return name_; }
    std::string about() const override { return about_; }
    bool has_distance() const override { return true; }
    std::unique_ptr<PairScene> place(std::span<const EllipsoidPair> pairs) const override {
        return std::make_unique<ProlatePairs>(pairs, calls_);
    }

private:
    const char *name_, *about_;
    Calls calls_;
};

} // namespace

void add_prolate(PairLibraries& libraries) {
    const auto add = [&](const char* name, const char* about, Calls calls) {
        libraries.push_back(std::make_unique<ProlatePairLibrary>(name, about, calls));
    };
    add("prolate", "this checkout, one batch; placing the bodies counts", Calls::batch);
    add("prolate-placed", "this checkout, one batch of bodies that are placed before", Calls::placed);
    add("prolate-single", "this checkout, one call a pair, double precision", Calls::single);
}

void add_prolate(Libraries& libraries) {
    libraries.push_back(std::make_unique<Prolate>(0));
    libraries.push_back(std::make_unique<ProlateCached>());
}

void add_prolate_proxy(Libraries& libraries, uint32_t leaves) {
    libraries.push_back(std::make_unique<Prolate>(leaves));
}

} // namespace prolate::bench::peers

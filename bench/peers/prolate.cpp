// prolate itself: the only file here that calls its queries.
#include "bench/peers/library.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>

#include <cstdio>

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

class ProlateScene final : public Scene {
public:
    ProlateScene(TreeView a, TreeView b, std::span<const Placement> poses) : a_(a), b_(b), poses_(poses) {}
    Contact collide(size_t i) override {
        const CollideResult result = query(i);
        if (result.verdict == Verdict::separated) return Contact::apart;
        return result.enclosed ? Contact::enclosed : Contact::meeting;
    }
    Work collide_work(size_t i) override {
        const QueryStats stats = query(i).stats;
        return {stats.pair_tests, stats.triangle_tests};
    }

private:
    CollideResult query(size_t i) { return prolate::collide(a_, poses_[i].a, b_, poses_[i].b, context_); }
    TreeView a_, b_;
    std::span<const Placement> poses_;
    QueryContext context_;
};

class Prolate final : public Library {
public:
    std::string name() const override { return "prolate"; }
    std::string about() const override {
        return "this checkout, exact trees of the default options, compiled portable by " PROLATE_BENCH_COMPILER;
    }
    std::unique_ptr<Shape> build(const Model& model) const override {
        BuildOptions options;
        options.exact = true;
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
};

} // namespace

void add_prolate(Libraries& libraries) {
    libraries.push_back(std::make_unique<Prolate>());
}

} // namespace prolate::bench::peers

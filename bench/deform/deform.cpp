// A deforming body near another one: the bounded deformation tree against trees that are refitted each frame.
//
//   bench_deform BODY OTHER [--ellipsoids N] [--modes M] [--queries N] [--truth N] [--amplitude A]
//
// BODY moves by M smooth modes (a bend, and waves along random directions; their ranges together move a vertex by about
// A of the diagonal), OTHER is rigid and turned at random, near to where it first meets BODY at rest. Printed are the
// median time of a query of covers and of exact trees, each at new coordinates and a new pose; and what FCL takes for
// the first of these (if it was there at configure time): moving the vertices, refitting its trees of AABB, or for 50
// of them of OBBRSS, and its query. The program fails if covers call separated what exact trees or FCL say meets, or
// exact trees what FCL says does.
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/deform.hpp>
#include <prolate/modes.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#ifdef PROLATE_BENCH_FCL
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/AABB.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>
#endif

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace prolate {
namespace {

using Clock = std::chrono::steady_clock;
using scenes::Point;
using scenes::Random;

struct Settings {
    uint32_t ellipsoids = 64, modes = 10, queries = 10000, truth = 300;
    double amplitude = 0.05;
    std::string quality = "fast";
};

double microseconds(Clock::time_point since) {
    return std::chrono::duration<double, std::micro>(Clock::now() - since).count();
}
double median(std::vector<double> x) {
    if (x.empty()) return 0;
    std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
    return x[x.size() / 2];
}

struct Box {
    Point low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    explicit Box(const Mesh& mesh) {
        for (const Vec3& v : mesh.vertices) {
            const double x[3] = {v.x, v.y, v.z};
            for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], x[i]), high[i] = std::max(high[i], x[i]);
        }
    }
    Point center() const { return {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2}; }
    double diagonal() const { return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]); }
};

// A mesh, its modes, and where it is.
struct Body {
    Mesh mesh;
    std::vector<float> displacements, ranges;

    void add_modes(uint32_t count, double amplitude) {
        Random random(17);
        const Box box(mesh);
        const Point middle = box.center();
        const double diagonal = box.diagonal();
        for (uint32_t m = 0; m < count; ++m) {
            const Point along = random.direction(), to = random.direction();
            const double phase = random.in(0, 6), waves = random.in(1, 6) / diagonal;
            for (const Vec3& v : mesh.vertices) {
                const double at =
                    along[0] * (v.x - middle[0]) + along[1] * (v.y - middle[1]) + along[2] * (v.z - middle[2]);
                const double by = m == 0 ? 4 * at * at / diagonal : diagonal * std::sin(waves * at + phase);
                for (const double x : to) displacements.push_back(static_cast<float>(by * x));
            }
            ranges.push_back(static_cast<float>(amplitude / count));
        }
    }
    Modes modes() const { return {displacements, ranges}; }
    void move(const std::vector<float>& q, std::vector<Point>& out) const {
        const size_t n = mesh.vertices.size();
        for (size_t v = 0; v < n; ++v) out[v] = {mesh.vertices[v].x, mesh.vertices[v].y, mesh.vertices[v].z};
        for (size_t m = 0; m < q.size(); ++m) {
            const float* u = displacements.data() + 3 * m * n;
            for (size_t v = 0; v < n; ++v, u += 3)
                for (size_t i = 0; i < 3; ++i) out[v][i] += double{q[m]} * u[i];
        }
    }
};

Tree bake(const Body& body, bool exact, const Settings& settings) {
    BuildOptions options;
    options.exact = exact, options.threads = 1;
    options.quality = settings.quality == "best"     ? Quality::best
                      : settings.quality == "normal" ? Quality::normal
                                                     : Quality::fast;
    if (!exact) options.ellipsoids = settings.ellipsoids;
    auto built = build(body.mesh.view(), options);
    if (!built) throw std::runtime_error(built.error().what);
    if (body.ranges.empty()) return std::move(built->tree);
    const auto start = Clock::now();
    auto out = add_modes(built->tree.view(), body.mesh.view(), body.modes());
    if (!out) throw std::runtime_error(out.error().what);
    fmt::print("{}: {} bytes without modes, {} with; modes took {:.2f} s\n", exact ? "exact" : "cover",
               built->tree.bytes().size(), out->bytes().size(), microseconds(start) * 1e-6);
    return std::move(*out);
}

struct Question {
    std::vector<float> q;
    Pose pose; // of the other body
};
// The other body comes along a random direction until it first meets the body at rest, at t, by bisection with exact
// trees, and is put -2 to 5 % of the body's diagonal beyond.
Question ask(const Body& body, const TreeView& exact, const TreeView& other, Random& random, QueryContext& context) {
    constexpr int kBisections = 14;
    Question out;
    for (const float r : body.ranges) out.q.push_back(static_cast<float>(random.in(-1, 1)) * r);
    const Box box(body.mesh);
    const Point to = random.direction(), middle = box.center();
    const Quat rotation = random.rotation();
    const Vec3 c = other.root_bound().center;
    const Point center = scenes::rotate(rotation, {c.x, c.y, c.z});
    const auto at = [&](double t) {
        Point x{};
        for (size_t i = 0; i < 3; ++i) x[i] = middle[i] + t * to[i] - center[i];
        return Pose{scenes::to_float(x), rotation};
    };
    double low = 0, high = 2 * box.diagonal();
    for (int i = 0; i < kBisections; ++i) {
        const double t = (low + high) / 2;
        (collide(exact, Pose{}, other, at(t), context).verdict == Verdict::separated ? high : low) = t;
    }
    out.pose = at(high + random.in(-0.02, 0.05) * box.diagonal());
    return out;
}

// Median time and verdicts.
struct Answers {
    std::vector<Verdict> verdicts;
    double time = 0, tests = 0;
    uint32_t separated = 0;
};
Answers answer(const TreeView& body, const TreeView& other, const std::vector<Question>& questions) {
    Answers out;
    const auto context = std::make_unique<QueryContext>();
    std::vector<double> times;
    for (const Question& question : questions) {
        const auto start = Clock::now();
        const DeformedCollideResult r = collide({body, {}, question.q}, {other, question.pose}, *context);
        times.push_back(microseconds(start));
        out.verdicts.push_back(r.verdict);
        out.separated += r.verdict == Verdict::separated;
        out.tests += static_cast<double>(r.stats.tests()) / static_cast<double>(questions.size());
    }
    out.time = median(times);
    return out;
}

#ifdef PROLATE_BENCH_FCL
template <class Volume> class Refitted {
public:
    using Model = fcl::BVHModel<Volume>;
    Refitted(const Body& body, const Body& other)
        : body_(body), points_(body.mesh.vertices.size()), moved_(points_.size()), model_(of(body.mesh)),
          other_(of(other.mesh)) {}

    bool meet(const Question& question) {
        auto start = Clock::now();
        body_.move(question.q, moved_);
        for (size_t v = 0; v < moved_.size(); ++v) points_[v] = {moved_[v][0], moved_[v][1], moved_[v][2]};
        moving.push_back(microseconds(start));
        start = Clock::now();
        model_->beginReplaceModel();
        model_->replaceSubModel(points_);
        model_->endReplaceModel(true, true);
        refitting.push_back(microseconds(start));
        const Quat& r = question.pose.rotation;
        fcl::Transform3<double> at = fcl::Transform3<double>::Identity();
        at.linear() = fcl::Quaternion<double>(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
        at.translation() =
            fcl::Vector3<double>(question.pose.translation.x, question.pose.translation.y, question.pose.translation.z);
        start = Clock::now();
        fcl::CollisionResult<double> result;
        const bool out = fcl::collide(model_.get(), fcl::Transform3<double>::Identity(), other_.get(), at,
                                      fcl::CollisionRequest<double>(), result) > 0;
        asking.push_back(microseconds(start));
        return out;
    }
    std::vector<double> moving, refitting, asking;

private:
    static std::unique_ptr<Model> of(const Mesh& mesh) {
        auto out = std::make_unique<Model>();
        std::vector<fcl::Vector3<double>> points;
        for (const Vec3& v : mesh.vertices) points.emplace_back(v.x, v.y, v.z);
        std::vector<fcl::Triangle> triangles;
        for (const Triangle& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
        out->beginModel();
        out->addSubModel(points, triangles);
        out->endModel();
        return out;
    }
    const Body& body_;
    std::vector<fcl::Vector3<double>> points_;
    std::vector<Point> moved_;
    std::unique_ptr<Model> model_, other_;
};

// Number of contacts that were missed.
template <class Volume>
uint32_t compare(const char* name, const Body& body, const Body& other, const std::vector<Question>& questions,
                 const Answers& cover, const Answers& exact, size_t count) {
    Refitted<Volume> refitted(body, other);
    uint32_t missed = 0, meeting = 0, disagree = 0;
    for (size_t i = 0; i < count; ++i) {
        const bool meet = refitted.meet(questions[i]);
        meeting += meet;
        missed += meet && (cover.verdicts[i] == Verdict::separated || exact.verdicts[i] == Verdict::separated);
        disagree += meet != (exact.verdicts[i] == Verdict::overlapping);
    }
    const double moving = median(refitted.moving), refit = median(refitted.refitting), asking = median(refitted.asking);
    fmt::print(
        "FCL, {}: {:.0f} us to move the vertices, {:.0f} to refit, {:.1f} to ask; refit and ask {:.0f} times the "
        "cover's query, {:.0f} times the exact tree's\n",
        name, moving, refit, asking, (refit + asking) / cover.time, (refit + asking) / exact.time);
    fmt::print("  of {} questions {} meet; {} missed; exact trees and FCL disagree on {}\n", count, meeting, missed,
               disagree);
    return missed;
}
#endif

int run(const std::string& body_file, const std::string& other_file, const Settings& settings) {
    const auto read = [](const std::string& file) {
        auto mesh = load_mesh(file.c_str());
        if (!mesh) throw std::runtime_error(file + ": " + mesh.error().what);
        return Body{std::move(*mesh), {}, {}};
    };
    Body body = read(body_file);
    const Body other = read(other_file);
    body.add_modes(settings.modes, settings.amplitude);
    fmt::print("{} triangles, {} modes, against {} triangles\n", body.mesh.triangles.size(), settings.modes,
               other.mesh.triangles.size());
    const Tree cover = bake(body, false, settings), exact = bake(body, true, settings),
               other_cover = bake(other, false, settings), other_exact = bake(other, true, settings);
    Random random(5);
    std::vector<Question> questions;
    const auto context = std::make_unique<QueryContext>();
    for (uint32_t i = 0; i < settings.queries; ++i)
        questions.push_back(ask(body, exact.view(), other_exact.view(), random, *context));
    const Answers of_cover = answer(cover.view(), other_cover.view(), questions),
                  of_exact = answer(exact.view(), other_exact.view(), questions);
    fmt::print("{} + {} leaves: {:.2f} us a query, {:.1f} tests, {:.1f} % separated\n", settings.ellipsoids,
               settings.ellipsoids, of_cover.time, of_cover.tests,
               100.0 * of_cover.separated / static_cast<double>(questions.size()));
    fmt::print("exact: {:.2f} us a query, {:.1f} tests, {:.1f} % separated\n", of_exact.time, of_exact.tests,
               100.0 * of_exact.separated / static_cast<double>(questions.size()));
    uint32_t missed = 0; // by covers, of what exact trees know
    for (size_t i = 0; i < questions.size(); ++i)
        missed += of_exact.verdicts[i] == Verdict::overlapping && of_cover.verdicts[i] == Verdict::separated;
    fmt::print("covers call separated {} of {} that meet by exact trees\n", missed,
               questions.size() - of_exact.separated);
#ifdef PROLATE_BENCH_FCL
    const size_t count = std::min<size_t>(settings.truth, questions.size());
    missed += compare<fcl::AABB<double>>("AABB", body, other, questions, of_cover, of_exact, count);
    missed +=
        compare<fcl::OBBRSS<double>>("OBBRSS", body, other, questions, of_cover, of_exact, std::min<size_t>(count, 50));
#else
    fmt::print("FCL is skipped: it was not there at configure time\n");
#endif
    return missed == 0 ? 0 : 1;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app{"A deforming body near another one"};
    prolate::Settings settings;
    std::string body, other;
    app.add_option("body", body)->required();
    app.add_option("other", other)->required();
    app.add_option("--ellipsoids", settings.ellipsoids)->capture_default_str();
    app.add_option("--modes", settings.modes)->capture_default_str();
    app.add_option("--queries", settings.queries)->capture_default_str();
    app.add_option("--truth", settings.truth, "queries that FCL is asked, too")->capture_default_str();
    app.add_option("--amplitude", settings.amplitude, "of all modes together, part of the diagonal")
        ->capture_default_str();
    app.add_option("--quality", settings.quality)->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        return prolate::run(body, other, settings);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench_deform: {}\n", e.what());
        return 1;
    }
}

// A deforming body near another one: the bounded deformation tree against trees that are refitted each frame.
//
//   bench_deform BODY OTHER [--ellipsoids N] [--modes M] [--bones B] [--queries N] [--truth N] [--amplitude A]
//
// BODY moves by M smooth modes (a bend, and waves along random directions; their ranges together move a vertex by about
// A of the diagonal), or by B bones (rig.hpp), each of which turns by up to --angle degrees about its joint; OTHER is
// rigid and turned at random, near to where it first meets BODY at rest. Printed are the median thread CPU time of a
// query of covers and of exact trees, each at new coordinates and a new pose; and what FCL and Coal take for the first
// of these, if they were there at configure time: moving the vertices, refitting their trees of AABB, or for 50 of them
// of OBBRSS, and their query. The program fails if covers call separated what exact trees or the other libraries say
// meets, or exact trees what these say does.
#include "bench/deform/refit.hpp"
#include "bench/deform/rig.hpp"
#include "tests/scenes.hpp"

#include <prolate/build.hpp>
#include <prolate/collide.hpp>
#include <prolate/deform.hpp>
#include <prolate/modes.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#ifdef PROLATE_BENCH_COAL
#include <dlfcn.h>
#endif
#include <time.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

struct Settings {
    uint32_t ellipsoids = 64, modes = 10, bones = 0, queries = 10000, truth = 300;
    double amplitude = 0.05, angle = 30;
    std::string quality = "fast";
};

// Of this thread's CPU: the machine may have other work to do.
double microseconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}
double microseconds(double since) {
    return microseconds() - since;
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

// How a body is deformed.
struct Shape {
    std::vector<float> q;
    std::vector<BoneMatrix> bones;
};

// A mesh, and its modes or its bones.
struct Body {
    Mesh mesh;
    std::vector<float> displacements, ranges;
    bench::Rig rig;
    uint32_t bones = 0;
    double angle = 0;

    void add_bones(uint32_t count, double degrees) {
        rig = bench::Rig(mesh, count), bones = count, angle = degrees * std::acos(-1.0) / 180;
    }
    Shape random_shape(Random& random) const {
        Shape out;
        for (const float r : ranges) out.q.push_back(static_cast<float>(random.in(-1, 1)) * r);
        if (bones > 0) out.bones = rig.random_pose(random, angle);
        return out;
    }

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
    void move(const Shape& shape, std::vector<Point>& out) const {
        const std::vector<float>& q = shape.q;
        if (bones > 0) return rig.move(shape.bones, out);
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
    if (body.ranges.empty() && body.bones == 0) return std::move(built->tree);
    const double start = microseconds();
    auto out = body.bones > 0 ? add_skin(built->tree.view(), body.mesh.view(), body.rig.weights())
                              : add_modes(built->tree.view(), body.mesh.view(), body.modes());
    if (!out) throw std::runtime_error(out.error().what);
    const char* const what = body.bones > 0 ? "bones" : "modes";
    fmt::print("{}: {} bytes without {}, {} with; {} took {:.2f} s\n", exact ? "exact" : "cover",
               built->tree.bytes().size(), what, out->bytes().size(), what, microseconds(start) * 1e-6);
    if (const auto skin = out->view().skin()) {
        std::vector<double> movers;
        out->view().for_each_node([&](uint32_t node) {
            if (out->view().is_leaf(node)) movers.push_back(skin->influence_count(node));
        });
        fmt::print("  {} bones move a leaf (median)\n", median(movers));
    }
    return std::move(*out);
}

struct Question {
    Shape shape;
    Pose pose; // of the other body
};
// The other body comes along a random direction until it first meets the body at rest, at t, by bisection with exact
// trees, and is put -2 to 5 % of the body's diagonal beyond.
Question ask(const Body& body, const TreeView& exact, const TreeView& other, Random& random, QueryContext& context) {
    constexpr int kBisections = 14;
    Question out;
    out.shape = body.random_shape(random);
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
        const double start = microseconds();
        const DeformedCollideResult r =
            collide({body, {}, question.shape.q, question.shape.bones}, {other, question.pose}, *context);
        times.push_back(microseconds(start));
        out.verdicts.push_back(r.verdict);
        out.separated += r.verdict == Verdict::separated;
        out.tests += static_cast<double>(r.stats.tests()) / static_cast<double>(questions.size());
    }
    out.time = median(times);
    return out;
}

// What distance() takes for them. False if a bound contradicts a verdict.
bool measure_distances(const char* name, const TreeView& body, const TreeView& other,
                       const std::vector<Question>& questions, const Answers& known) {
    const auto context = std::make_unique<QueryContext>();
    std::vector<double> times;
    double tests = 0;
    uint32_t undecided = 0;
    bool sound = true;
    const size_t count = std::min<size_t>(questions.size(), 10'000);
    for (size_t i = 0; i < count; ++i) {
        const double start = microseconds();
        const Shape& shape = questions[i].shape;
        const DeformedDistanceResult r =
            distance({body, {}, shape.q, shape.bones}, {other, questions[i].pose}, *context);
        times.push_back(microseconds(start));
        tests += static_cast<double>(r.stats.tests()) / static_cast<double>(count);
        undecided += r.verdict == Verdict::undecided;
        sound = sound && (r.verdict == known.verdicts[i] || r.verdict == Verdict::undecided) && r.lower <= r.upper;
    }
    fmt::print("{}: distance in {:.1f} us, {:.1f} tests, {} undecided\n", name, median(times), tests, undecided);
    return sound;
}

bench::RefitLibraries other_libraries() {
    bench::RefitLibraries out;
#ifdef PROLATE_BENCH_FCL
    add_fcl_refits(out);
#else
    fmt::print("FCL is skipped: libfcl-dev was not there at configure time\n");
#endif
#ifdef PROLATE_BENCH_COAL
    void* const module = dlopen(PROLATE_BENCH_COAL, RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    void* const add = module != nullptr ? dlsym(module, "add_coal_refits") : nullptr;
    if (add != nullptr)
        reinterpret_cast<void (*)(bench::RefitLibraries&)>(add)(out);
    else
        fmt::print("Coal is skipped: {}\n", dlerror());
#else
    fmt::print("Coal is skipped: libcoal of PyPI was not there at configure time; ./run peers installs it\n");
#endif
    return out;
}

// Number of contacts that were missed.
uint32_t compare(const bench::RefitLibrary& library, const Body& body, const Body& other,
                 const std::vector<Question>& questions, const Answers& cover, const Answers& exact, size_t most) {
    const auto refitted = library.build(body.mesh, other.mesh);
    const size_t count = std::min({size_t{library.most}, most, questions.size()});
    std::vector<double> moving, refitting, asking;
    std::vector<Point> moved(body.mesh.vertices.size());
    uint32_t missed = 0, meeting = 0, disagree = 0;
    for (size_t i = 0; i < count; ++i) {
        double start = microseconds();
        body.move(questions[i].shape, moved);
        moving.push_back(microseconds(start));
        start = microseconds();
        refitted->refit(moved);
        refitting.push_back(microseconds(start));
        start = microseconds();
        const bool meet = refitted->meet(questions[i].pose);
        asking.push_back(microseconds(start));
        meeting += meet;
        missed += meet && (cover.verdicts[i] == Verdict::separated || exact.verdicts[i] == Verdict::separated);
        disagree += meet != (exact.verdicts[i] == Verdict::overlapping);
    }
    const double refit = median(refitting), ask = median(asking);
    fmt::print("{}: {:.0f} us to move the vertices, {:.0f} to refit, {:.1f} to ask; refit and ask {:.0f} times the "
               "cover's query, {:.0f} times the exact tree's\n",
               library.name, median(moving), refit, ask, (refit + ask) / cover.time, (refit + ask) / exact.time);
    fmt::print("  of {} questions {} meet; {} missed; exact trees disagree on {}\n", count, meeting, missed, disagree);
    return missed;
}

int run(const std::string& body_file, const std::string& other_file, const Settings& settings) {
    const auto read = [](const std::string& file) {
        auto mesh = load_mesh(file.c_str());
        if (!mesh) throw std::runtime_error(file + ": " + mesh.error().what);
        Body out;
        out.mesh = std::move(*mesh);
        return out;
    };
    Body body = read(body_file);
    const Body other = read(other_file);
    if (settings.bones > 0)
        body.add_bones(settings.bones, settings.angle);
    else
        body.add_modes(settings.modes, settings.amplitude);
    fmt::print("{} triangles, {} {}, against {} triangles\n", body.mesh.triangles.size(),
               settings.bones > 0 ? settings.bones : settings.modes, settings.bones > 0 ? "bones" : "modes",
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
    bool sound = measure_distances("covers", cover.view(), other_cover.view(), questions, of_cover);
    sound = measure_distances("exact", exact.view(), other_exact.view(), questions, of_exact) && sound;
    if (!sound) fmt::print("distance() contradicts collide()\n");
    uint32_t missed = 0; // by covers, of what exact trees know
    for (size_t i = 0; i < questions.size(); ++i)
        missed += of_exact.verdicts[i] == Verdict::overlapping && of_cover.verdicts[i] == Verdict::separated;
    fmt::print("covers call separated {} of {} that meet by exact trees\n", missed,
               questions.size() - of_exact.separated);
    for (const bench::RefitLibrary& library : other_libraries())
        missed += compare(library, body, other, questions, of_cover, of_exact, settings.truth);
    return missed == 0 && sound ? 0 : 1;
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
    app.add_option("--bones", settings.bones, "in the place of modes");
    app.add_option("--angle", settings.angle, "by which a bone turns at most, degrees")->capture_default_str();
    app.add_option("--queries", settings.queries)->capture_default_str();
    app.add_option("--truth", settings.truth, "queries that other libraries are asked, too")->capture_default_str();
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

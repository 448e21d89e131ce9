#include "bench/peers/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <malloc.h>

namespace prolate::bench::peers {
namespace {

constexpr double kDistanceError = 1e-6; // of the diagonal, or of the distance if that is larger: as asked for

// Means of what the library told of each pose; empty if it did not.
void add(std::optional<double>& sum, const std::optional<uint64_t>& value, size_t poses) {
    if (value) sum = sum.value_or(0) + static_cast<double>(*value) / static_cast<double>(poses);
}

size_t heap_in_use() {
    const auto info = mallinfo2();
    return info.uordblks + info.hblkhd;
}

} // namespace

std::string model_name(const std::string& path_or_name) {
    return std::filesystem::path(path_or_name).stem().string();
}

std::string Subject::name() const {
    const char* const verbs[] = {"collide", "distance", "collide-again", "collide-proxy"};
    const std::string name =
        fmt::format("{}/{}-{}/{}", verbs[static_cast<size_t>(query)], model_name(a), model_name(b), kind);
    return leaves > 0 ? fmt::format("{}-{}", name, leaves) : name;
}

Comparison::Comparison(ComparisonOptions options, Libraries libraries)
    : options_(std::move(options)), libraries_(std::move(libraries)) {}

Comparison::Entry& Comparison::entry(const std::string& name) {
    const auto [at, fresh] = models_.try_emplace(name);
    Entry& out = at->second;
    if (!fresh) return out;
    if (name == "cad") {
        out.model = cad_model();
    } else if (name.find('.') != std::string::npos || name.find('/') != std::string::npos) {
        out.model = load_model(model_name(name), {name});
    } else {
        const std::string debian = "/usr/share/glmark2/models/" + name;
        out.model = load_model(name, {options_.data + "/" + name + ".obj", debian + ".obj", debian + ".3ds"});
    }
    return out;
}

bool Comparison::available(const Subject& subject) {
    return entry(subject.a).model.has_value() && entry(subject.b).model.has_value();
}

const Libraries& Comparison::libraries_for(const Subject& subject) {
    if (subject.query != Query::proxy) return libraries_;
    const auto [at, fresh] = proxies_.try_emplace(subject.leaves);
    if (fresh) at->second = proxy_libraries(subject.leaves, options_.python);
    return at->second;
}

std::vector<std::string> Comparison::able(const Subject& subject) {
    std::vector<std::string> out;
    for (const auto& library : libraries_for(subject))
        if (library->answers(subject.query)) out.push_back(library->name());
    return out;
}

const Shape* Comparison::shape(const std::string& model, const Library& library) {
    Entry& e = entry(model);
    const auto [at, fresh] = e.shapes.try_emplace(library.form());
    Entry::Built& built = at->second;
    if (fresh) {
        const size_t before = heap_in_use();
        built.shape = library.build(*e.model);
        built.bytes = built.shape && built.shape->bytes() > 0 ? built.shape->bytes() : heap_in_use() - before;
    }
    return built.shape.get();
}

bool Comparison::reference_meets(const Subject& subject, const Placement& at) {
    for (const std::string* name : {&subject.a, &subject.b})
        if (Entry& e = entry(*name); !e.reference) e.reference = std::make_unique<Reference>(e.model->mesh.view());
    return meet(*entry(subject.a).reference, *entry(subject.b).reference, at);
}

const std::vector<Placement>& Comparison::poses(const Subject& subject) {
    const bool aligned = subject.kind.ends_with("-aligned");
    const std::string key = fmt::format("{}\n{}\n{}{}", subject.a, subject.b, subject.leaves, aligned ? "a" : "");
    const auto [at, fresh] = poses_.try_emplace(key);
    if (fresh && subject.leaves == 0)
        at->second = make_poses([&](const Placement& p) { return reference_meets(subject, p); }, options_.poses,
                                options_.seed, aligned);
    if (fresh && subject.leaves > 0) { // no mesh tells where covers meet: the first library judges itself
        const Library& library = *libraries_for(subject).front();
        const Shape *a = shape(subject.a, library), *b = shape(subject.b, library);
        const auto meets = [&](const Placement& p) {
            return library.place(*a, *b, {&p, 1})->collide(0) != Contact::separated;
        };
        at->second = make_poses(meets, options_.poses, options_.seed, aligned);
    }
    const PoseSets& sets = at->second;
    const std::vector<Placement>& plain = subject.kind.starts_with("far")    ? sets.far
                                          : subject.kind.starts_with("near") ? sets.near
                                                                             : sets.touching;
    if (subject.query != Query::again) return plain;
    const auto [then, first] = moved_.try_emplace(subject.name());
    if (first) then->second = moved(plain, options_.seed);
    return then->second;
}

// Where the libraries agree, what they say; else the reference's word, and always at each 25th pose.
std::vector<double> Comparison::expected_distances(const Subject& subject,
                                                   std::span<const std::unique_ptr<Scene>> scenes) {
    const auto& at = poses(subject);
    std::vector<double> out(at.size());
    for (size_t i = 0; i < at.size(); ++i) {
        double least = INFINITY, most = 0;
        for (const auto& scene : scenes) {
            const double d = scene->distance(i);
            least = std::min(least, d), most = std::max(most, d);
        }
        const bool agree = most - least <= kDistanceError && i % 25 != 0;
        out[i] = agree ? least : distance(*entry(subject.a).reference, *entry(subject.b).reference, at[i]);
    }
    return out;
}

// What the poses were made for; after a move the reference has to tell.
std::vector<Contact> Comparison::expected_contacts(const Subject& subject) {
    const auto& at = poses(subject);
    std::vector<Contact> out(at.size(), subject.kind.starts_with("touching") ? Contact::meeting : Contact::separated);
    if (subject.query == Query::again)
        for (size_t i = 0; i < at.size(); ++i)
            out[i] = reference_meets(subject, at[i]) ? Contact::meeting : Contact::separated;
    return out;
}

// Counts wrong answers, and what the queries looked at.
void Comparison::judge(const Subject& subject, Scene& scene, const Truth& truth, Outcome& outcome) {
    const size_t count = poses(subject).size();
    const bool measures = subject.query == Query::distance;
    size_t enclosed = 0, missed = 0;
    double worst = 0;
    for (size_t i = 0; i < count; ++i) {
        const Work work = measures ? scene.distance_work(i) : scene.collide_work(i);
        add(outcome.volume_tests, work.volume_tests, count);
        add(outcome.triangle_tests, work.triangle_tests, count);
        if (measures) {
            const double error = std::abs(scene.distance(i) - truth.distances[i]);
            worst = std::max(worst, error);
            outcome.wrong += !(error <= kDistanceError * std::max(1.0, truth.distances[i]));
        } else {
            const Contact now = scene.collide(i), expected = truth.contacts[i];
            if (now == expected) continue;
            const bool inside = now == Contact::enclosed && expected == Contact::separated;
            enclosed += inside, outcome.wrong += !inside, missed += !inside && expected == Contact::meeting;
        }
    }
    const std::string who = subject.name() + "/" + outcome.library;
    if (enclosed > 0)
        std::fprintf(stderr, "%s: a part of one solid lies inside the other at %zu poses\n", who.c_str(), enclosed);
    if (outcome.wrong == 0) return;
    const std::string how = measures ? fmt::format(", by up to {:.3g}", worst)
                                     : fmt::format(": {} contacts missed, {} reported where surfaces do not meet",
                                                   missed, outcome.wrong - missed);
    std::fprintf(stderr, "%s: WRONG at %zu of %zu poses%s\n", who.c_str(), outcome.wrong, count, how.c_str());
}

std::vector<Outcome> Comparison::run(const Subject& subject, const std::vector<std::string>& names) {
    std::vector<Outcome> out;
    std::vector<std::unique_ptr<Scene>> scenes;
    for (const auto& library : libraries_for(subject)) {
        if (std::ranges::find(names, library->name()) == names.end()) continue;
        const Shape *const a = shape(subject.a, *library), *const b = shape(subject.b, *library);
        if (a == nullptr || b == nullptr) continue;
        scenes.push_back(library->place(*a, *b, poses(subject)));
        out.push_back({library->name(), {}, {}, {}, 0});
    }

    const bool measures = subject.query == Query::distance;
    Truth truth;
    if (measures)
        truth.distances = expected_distances(subject, scenes);
    else
        truth.contacts = expected_contacts(subject);
    std::vector<std::function<void(size_t)>> queries;
    for (size_t k = 0; k < scenes.size(); ++k) {
        Scene* const scene = scenes[k].get();
        judge(subject, *scene, truth, out[k]);
        if (measures)
            queries.emplace_back([scene](size_t i) { scene->distance(i); });
        else
            queries.emplace_back([scene](size_t i) { scene->collide(i); });
    }
    const bool batch = !measures && subject.kind.starts_with("far");
    const auto timings = time_in_sweeps(queries, poses(subject).size(), {.batch = batch, .seconds = options_.seconds});
    for (size_t k = 0; k < out.size(); ++k) out[k].timing = timings[k];
    return out;
}

std::vector<Memory> Comparison::memory() const {
    std::vector<Memory> out;
    for (const auto& [model, e] : models_)
        for (const auto& [form, built] : e.shapes)
            if (built.shape) out.push_back({model_name(model), form, e.model->mesh.triangles.size(), built.bytes});
    return out;
}

Libraries proxy_libraries(uint32_t leaves, [[maybe_unused]] const std::string& python) {
    Libraries out;
    add_prolate_proxy(out, leaves);
#ifdef PROLATE_BENCH_BULLET
    add_bullet_hulls(out, python);
#endif
    return out;
}

} // namespace prolate::bench::peers

#include "bench/peers/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

namespace prolate::bench::peers {
namespace {

constexpr double kDistanceError = 1e-6; // of the diagonal: what single precision allows

// Means of what the library told of each pose; empty if it did not.
void add(std::optional<double>& sum, const std::optional<uint64_t>& value, size_t poses) {
    if (value) sum = sum.value_or(0) + static_cast<double>(*value) / static_cast<double>(poses);
}

} // namespace

std::string model_name(const std::string& path_or_name) {
    return std::filesystem::path(path_or_name).stem().string();
}

std::string Subject::name() const {
    const char* const verb = query == Query::collide ? "collide/" : "distance/";
    return verb + model_name(a) + "-" + model_name(b) + "/" + kind;
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

const std::vector<Placement>& Comparison::poses(const Subject& subject) {
    const bool aligned = subject.kind.ends_with("-aligned");
    const auto [at, fresh] = poses_.try_emplace(subject.a + "\n" + subject.b + (aligned ? "\naligned" : ""));
    if (fresh) {
        for (const std::string* name : {&subject.a, &subject.b})
            if (Entry& e = entry(*name); !e.reference) e.reference = std::make_unique<Reference>(e.model->mesh.view());
        at->second = make_poses(*entry(subject.a).reference, *entry(subject.b).reference, options_.poses, options_.seed,
                                aligned);
    }
    const PoseSets& sets = at->second;
    return subject.kind.starts_with("far") ? sets.far : subject.kind.starts_with("near") ? sets.near : sets.touching;
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

std::vector<Outcome> Comparison::run(const Subject& subject, const std::vector<std::string>& names) {
    const auto& at = poses(subject);
    Entry &a = entry(subject.a), &b = entry(subject.b);
    std::vector<Outcome> out;
    std::vector<std::unique_ptr<Scene>> scenes;
    for (const auto& library : libraries_) {
        if (std::ranges::find(names, library->name()) == names.end()) continue;
        for (Entry* e : {&a, &b})
            if (auto& shape = e->shapes[library->name()]; !shape) shape = library->build(*e->model);
        const auto &shape_a = a.shapes[library->name()], &shape_b = b.shapes[library->name()];
        if (!shape_a || !shape_b) continue;
        scenes.push_back(library->place(*shape_a, *shape_b, at));
        out.push_back({library->name(), {}, {}, {}, 0});
    }

    const bool distances = subject.query == Query::distance;
    const Contact expected = subject.kind.starts_with("touching") ? Contact::meeting : Contact::apart;
    const auto expected_distance = distances ? expected_distances(subject, scenes) : std::vector<double>{};
    std::vector<std::function<void(size_t)>> queries;
    for (size_t k = 0; k < scenes.size(); ++k) {
        Scene* const scene = scenes[k].get();
        size_t enclosed = 0;
        double worst = 0;
        for (size_t i = 0; i < at.size(); ++i) {
            const Work work = distances ? scene->distance_work(i) : scene->collide_work(i);
            add(out[k].volume_tests, work.volume_tests, at.size());
            add(out[k].triangle_tests, work.triangle_tests, at.size());
            if (distances) {
                const double error = std::abs(scene->distance(i) - expected_distance[i]);
                worst = std::max(worst, error), out[k].wrong += !(error <= kDistanceError);
            } else {
                const Contact now = scene->collide(i);
                if (now == Contact::enclosed && expected == Contact::apart)
                    ++enclosed;
                else
                    out[k].wrong += now != expected;
            }
        }
        const std::string who = subject.name() + "/" + out[k].library;
        if (enclosed > 0)
            std::fprintf(stderr, "%s: a part of one solid lies inside the other at %zu poses\n", who.c_str(), enclosed);
        if (out[k].wrong > 0 && distances)
            std::fprintf(stderr, "%s: WRONG at %zu of %zu poses, by up to %g\n", who.c_str(), out[k].wrong, at.size(),
                         worst);
        else if (out[k].wrong > 0)
            std::fprintf(stderr, "%s: WRONG at %zu of %zu poses, where the surfaces %s\n", who.c_str(), out[k].wrong,
                         at.size(), expected == Contact::meeting ? "meet" : "do not meet");
        if (distances)
            queries.emplace_back([scene](size_t i) { scene->distance(i); });
        else
            queries.emplace_back([scene](size_t i) { scene->collide(i); });
    }
    const bool batch = !distances && subject.kind.starts_with("far");
    const auto timings = time_in_sweeps(queries, at.size(), {.batch = batch, .seconds = options_.seconds});
    for (size_t k = 0; k < out.size(); ++k) out[k].timing = timings[k];
    return out;
}

size_t Comparison::bytes(const std::string& library, const std::string& model) const {
    const auto at = models_.find(model);
    if (at == models_.end()) return 0;
    const auto shape = at->second.shapes.find(library);
    return shape == at->second.shapes.end() || !shape->second ? 0 : shape->second->bytes();
}

} // namespace prolate::bench::peers

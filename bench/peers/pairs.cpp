#include "bench/peers/pairs.hpp"

#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

namespace prolate::bench::peers {
namespace {

using reference::dot;
using reference::operator*;
using reference::operator-;
using reference::Real;
using reference::Vector;
using scenes::Point;
using scenes::Random;

constexpr Real kUndecided = 1e-9L;      // so near to contact, no answer counts as wrong
constexpr double kDistanceError = 1e-5; // of the largest radius

Ellipsoid ellipsoid(const std::array<float, 3>& radii) {
    return {.center = {}, .l11 = radii[0], .l22 = radii[1], .l33 = radii[2]};
}

reference::Pair placed(const EllipsoidPair& p) {
    return {ellipsoid(p.radii_a), p.a, ellipsoid(p.radii_b), p.b};
}

std::vector<EllipsoidPair> make_pairs(Query query, bool near, size_t count, uint64_t seed) {
    Random random(seed);
    std::vector<EllipsoidPair> out(count);
    for (EllipsoidPair& p : out) {
        for (auto* radii : {&p.radii_a, &p.radii_b}) {
            const Point r = scenes::radii(random, 10);
            for (size_t i = 0; i < 3; ++i) (*radii)[i] = static_cast<float>(r[i]);
        }
        p.a.rotation = random.rotation(), p.b.rotation = random.rotation();
        const Point origin = random.in_ball(), direction = random.direction();
        p.a.translation = scenes::to_float(origin);
        const auto move = [&](double t) {
            p.b.translation = scenes::to_float(
                {origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]});
        };
        const double spread = near ? 1e-3 : 0.9;
        const double low = query == Query::distance ? 1 + spread * 1e-2 : 1 - spread;
        move(1);
        move(random.in(low, 1 + spread) / static_cast<double>(reference::contact(placed(p))));
    }
    return out;
}

// The largest gap n.r - |L1^T n| - |L2^T n| over all unit n, by Newton's method on the sphere with step halving. The
// gap is concave along the way from r, which is less than 90 degrees from the best n, so there is nothing to get stuck
// at while the bodies are apart. NaN if the points of support do not confirm the result.
double distance_of(const reference::Pair& pair) {
    const auto scaled = [](const Vector& v, Real k) { return Vector{k * v[0], k * v[1], k * v[2]}; };
    const auto gap = [&](const Vector& n) {
        return dot(n, pair.r) - std::sqrt(dot(n, pair.q1 * n)) - std::sqrt(dot(n, pair.q2 * n));
    };
    Vector n = scaled(pair.r, 1 / std::sqrt(dot(pair.r, pair.r)));
    Vector apart{};
    for (int step = 0; step < 200; ++step) {
        const Vector u = pair.q1 * n, v = pair.q2 * n;
        const Real a = std::sqrt(dot(n, u)), b = std::sqrt(dot(n, v)), now = gap(n);
        reference::Matrix m; // minus the Hessian, made definite along n too
        for (size_t i = 0; i < 3; ++i) {
            apart[i] = pair.r[i] - u[i] / a - v[i] / b;
            for (size_t j = 0; j < 3; ++j)
                m[i][j] = pair.q1[i][j] / a - u[i] * u[j] / (a * a * a) + pair.q2[i][j] / b -
                          v[i] * v[j] / (b * b * b) + (i == j ? std::abs(now) + 1e-12L : 0) + n[i] * n[j];
        }
        const Vector slope = apart - scaled(n, dot(apart, n));
        const Vector d = reference::inverse(m) * slope;
        Real k = 1;
        Vector next = n;
        for (; k > 1e-12L; k /= 2) {
            for (size_t i = 0; i < 3; ++i) next[i] = n[i] + k * d[i];
            next = scaled(next, 1 / std::sqrt(dot(next, next)));
            if (gap(next) > now) break;
        }
        if (!(gap(next) > now)) break;
        n = next;
    }
    const Real low = gap(n), high = std::sqrt(dot(apart, apart));
    return high - low < 1e-9L ? static_cast<double>(low) : NAN;
}

struct Truth {
    std::vector<Real> contact;     // for the boolean question
    std::vector<double> distances; // for the other
};

Truth truth(Query query, std::span<const EllipsoidPair> pairs) {
    Truth out;
    size_t unknown = 0;
    for (const EllipsoidPair& p : pairs) {
        if (query == Query::collide)
            out.contact.push_back(reference::contact(placed(p)));
        else
            unknown += std::isnan(out.distances.emplace_back(distance_of(placed(p))));
    }
    if (unknown > 0) std::fprintf(stderr, "%zu pairs of ellipsoids have no certain distance\n", unknown);
    return out;
}

void judge(PairScene& scene, const Truth& true_answers, const std::string& who, Outcome& outcome) {
    const size_t contacts = true_answers.contact.size(), distances = true_answers.distances.size();
    if (contacts > 0) {
        std::vector<uint8_t> answers(contacts);
        scene.meet(answers);
        size_t missed = 0;
        for (size_t i = 0; i < contacts; ++i) {
            const Real s = true_answers.contact[i];
            if (std::abs(s - 1) <= kUndecided || (answers[i] != 0) == (s < 1)) continue;
            ++outcome.wrong, missed += s < 1;
        }
        if (outcome.wrong > 0)
            std::fprintf(stderr, "%s: WRONG at %zu of %zu pairs, of which %zu meet\n", who.c_str(), outcome.wrong,
                         contacts, missed);
        return;
    }
    std::vector<double> answers(distances);
    scene.distance(answers);
    double over = 0, under = 0;
    for (size_t i = 0; i < distances; ++i) {
        const double error = answers[i] - true_answers.distances[i];
        if (std::isnan(true_answers.distances[i])) continue;
        over = std::max(over, error), under = std::max(under, -error);
        outcome.wrong += !(std::abs(error) <= kDistanceError);
    }
    std::fprintf(stderr, "%s: up to %.2g over, %.2g under; %s at %zu of %zu pairs\n", who.c_str(), over, under,
                 outcome.wrong > 0 ? "WRONG" : "wrong", outcome.wrong, distances);
}

template <class Sweep> size_t sweeps_of_a_millisecond(const Sweep& sweep) {
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    size_t times = 0;
    for (; Clock::now() - start < std::chrono::milliseconds(1); ++times) sweep();
    return times;
}

} // namespace

std::string pairs_name(Query query, bool near) {
    return std::string(query == Query::collide ? "pair-boolean/" : "pair-distance/") + (near ? "near" : "random");
}

std::vector<Outcome> compare_pairs(const PairLibraries& libraries, Query query, bool near, size_t count, uint64_t seed,
                                   double seconds, const std::vector<std::string>& names) {
    const auto pairs = make_pairs(query, near, count, seed);
    const Truth true_answers = truth(query, pairs);
    std::vector<Outcome> out;
    std::vector<std::unique_ptr<PairScene>> scenes;
    std::vector<std::function<void(size_t)>> queries;
    std::vector<size_t> sweeps; // in each of them
    std::vector<uint8_t> answers(count);
    std::vector<double> distances(count);
    for (const auto& library : libraries) {
        if (std::ranges::find(names, library->name()) == names.end()) continue;
        scenes.push_back(library->place(pairs));
        out.push_back({library->name(), {}, {}, {}, 0});
        PairScene* const scene = scenes.back().get();
        judge(*scene, true_answers, pairs_name(query, near) + "/" + library->name(), out.back());
        const auto sweep = [scene, query, &answers, &distances] {
            if (query == Query::collide)
                scene->meet(answers);
            else
                scene->distance(distances);
        };
        sweeps.push_back(sweeps_of_a_millisecond(sweep));
        queries.emplace_back([sweep, times = sweeps.back()](size_t) {
            for (size_t i = 0; i < times; ++i) sweep();
        });
    }
    const auto timings = time_in_sweeps(queries, 1, {.batch = true, .seconds = seconds});
    for (size_t k = 0; k < out.size(); ++k) {
        const double each = 1 / static_cast<double>(count * sweeps[k]);
        const Timing& t = timings[k];
        out[k].timing = {each * t.median, each * t.mean, each * t.p99, t.sweeps};
    }
    return out;
}

} // namespace prolate::bench::peers

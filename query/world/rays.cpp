#include "query/world/rays.hpp"

#include "query/node/limits.hpp"
#include "query/world/path.hpp"
#include "query/world/state.hpp"
#include "query/world/two_bodies.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace prolate::query {
namespace {

constexpr uint32_t kNoBody = BoundsTree::kNone;
constexpr size_t kFewest = 4, kTogether = 16; // rays that are cast against a body in one call

// The float above: whatever is hit at t is hit before it.
float above_hit(double t) {
    return std::nextafter(static_cast<float>(t), std::numeric_limits<float>::infinity());
}

bool is_ray(const Ray& ray) {
    const glm::dvec3 o = to_double(ray.origin), d = to_double(ray.direction);
    return std::isfinite(glm::length(o) + glm::length(d)) && d != glm::dvec3(0) && !std::isnan(ray.max_t);
}

// What a ray with the margin begins as.
Bounds begin_of(const Ray& ray, double margin) {
    const glm::dvec3 o = to_double(ray.origin), low = o - margin, high = o + margin;
    return {{round_down(low.x), round_down(low.y), round_down(low.z)},
            {round_up(high.x), round_up(high.y), round_up(high.z)}};
}

// A ray, and how far it has come.
class RayUnderWay {
public:
    RayUnderWay(const World::State& s, const Ray& ray, double margin, RayHit& out)
        : ray_(ray), out_(out), path_(begin_of(ray, margin), ray.direction), walk_(s.tree), clear_(ray.max_t) {
        out_ = {};
    }

    // The next body that it may hit before what it has hit; kNoBody at the end.
    uint32_t next(const World::State& s, uint32_t mask) {
        const auto wanted = [&](uint32_t index) { return (s.marks[index].layers & mask) != 0; };
        while (unbounded_ < s.unbounded.size())
            if (const uint32_t index = s.unbounded[unbounded_++]; wanted(index)) return index;
        for (;;) {
            const uint32_t index = walk_.next(
                s.tree, [&](const Bounds& box) { return path_.meets(box, ray_.max_t); },
                [&](const Bounds& first, const Bounds& second) { return path_.second_first(first, second); });
            if (index == kNoBody || wanted(index)) return index;
        }
    }
    // As far as it has to be looked at.
    const Ray& ray() const { return ray_; }
    // What it finds at a body.
    void take(BodyId id, const RaycastResult& r) {
        add(r.stats, stats_);
        if (r.verdict == Verdict::undecided) undecided_ = true;
        if (r.verdict != Verdict::separated) clear_ = std::min(clear_, r.clear);
        const bool first =
            out_.body == BodyId{} || r.t < out_.result.t || (r.t == out_.result.t && id.index < out_.body.index);
        if (r.verdict != Verdict::overlapping || !first) return;
        out_ = {.body = id, .result = r};
        ray_.max_t = std::min(ray_.max_t, above_hit(r.t));
    }
    void finish() {
        if (out_.body == BodyId{} && !undecided_) out_.result.verdict = Verdict::separated;
        out_.result.clear = clear_, out_.result.stats = stats_;
    }

private:
    Ray ray_;
    RayHit& out_;
    Path path_;
    BoundsTree::Walk walk_;
    uint32_t unbounded_ = 0; // of these, which one is next
    bool undecided_ = false;
    double clear_;
    QueryStats stats_;
};

// The rays that have come to a body, which is a tree: `at` are their places in `all`.
void cast_together(const World::State& s, uint32_t index, std::span<const uint64_t> at, RayUnderWay* all,
                   Scratch context, const QueryOptions& options) {
    const Body& body = s.entries[index].body;
    Ray rays[kTogether];
    RaycastResult results[kTogether];
    for (; !at.empty(); at = at.subspan(std::min(at.size(), kTogether))) {
        const size_t count = std::min(at.size(), kTogether);
        const auto ray = [&](size_t i) -> RayUnderWay& { return all[static_cast<uint32_t>(at[i])]; };
        for (size_t i = 0; i < count; ++i) rays[i] = ray(i).ray();
        prolate::raycast(*body.tree(), body.pose, std::span(rays).first(count), results, context, options);
        for (size_t i = 0; i < count; ++i) ray(i).take(s.id(index), results[i]);
    }
}

void cast_alone(const World::State& s, uint32_t index, RayUnderWay& ray, Scratch context, const QueryOptions& options) {
    ray.take(s.id(index), query::raycast(s.entries[index].body, ray.ray(), context, options));
}

// Have neighbours among the rays mostly come to the same body? Else they have little in common, and to go on together
// would only cost them what is in the cache.
bool are_alike(std::span<const uint64_t> to) {
    size_t alike = 0;
    for (size_t k = 1; k < to.size(); ++k) alike += to[k] >> 32 == to[k - 1] >> 32;
    return 2 * alike >= to.size();
}

// No more than kRaysUnderWay.
void cast_some_rays(const World::State& s, std::span<const Ray> rays, std::span<RayHit> out, Scratch context,
                    const QueryOptions& options, uint32_t mask) {
    alignas(RayUnderWay) std::byte memory[kRaysUnderWay * sizeof(RayUnderWay)];
    auto* const all = reinterpret_cast<RayUnderWay*>(memory);
    uint32_t going[kRaysUnderWay], count = 0; // places of those that have not come to an end
    for (uint32_t i = 0; i < rays.size(); ++i) {
        std::construct_at(all + i, s, rays[i], double{options.margin}, out[i]);
        if (!is_ray(rays[i])) continue;
        if (rays[i].max_t < 0)
            all[i].finish();
        else
            going[count++] = i;
    }
    while (count > 0) {
        uint64_t to[kRaysUnderWay]; // the body, and the ray's place
        uint32_t still = 0;
        for (uint32_t k = 0; k < count; ++k) {
            const uint32_t i = going[k], index = all[i].next(s, mask);
            if (index == kNoBody)
                all[i].finish();
            else
                to[still] = uint64_t{index} << 32 | i, going[still++] = i;
        }
        count = still;
        if (!are_alike({to, count})) {
            for (uint32_t k = 0; k < count; ++k) {
                RayUnderWay& ray = all[going[k]];
                for (auto index = static_cast<uint32_t>(to[k] >> 32); index != kNoBody; index = ray.next(s, mask))
                    cast_alone(s, index, ray, context, options);
                ray.finish();
            }
            return;
        }
        std::sort(to, to + count);
        for (uint32_t begin = 0, end = 0; begin < count; begin = end) {
            const auto index = static_cast<uint32_t>(to[begin] >> 32);
            while (end < count && to[end] >> 32 == index) ++end;
            if (end - begin >= kFewest && s.entries[index].body.tree() != nullptr)
                cast_together(s, index, std::span(to).subspan(begin, end - begin), all, context, options);
            else
                for (uint32_t k = begin; k < end; ++k)
                    cast_alone(s, index, all[static_cast<uint32_t>(to[k])], context, options);
        }
    }
}

} // namespace

void cast_rays(const World& world, std::span<const Ray> rays, std::span<RayHit> out, Scratch context,
               const QueryOptions& options, uint32_t mask) noexcept {
    const World::State& s = state_of(world);
    const World::State::Busy busy(s);
    for (size_t i = 0; i < rays.size(); i += kRaysUnderWay) {
        const size_t count = std::min<size_t>(rays.size() - i, kRaysUnderWay);
        cast_some_rays(s, rays.subspan(i, count), out.subspan(i, count), context, options, mask);
    }
}

} // namespace prolate::query

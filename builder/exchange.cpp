#include "builder/exchange.hpp"

#include "builder/job.hpp"
#include "builder/start.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace prolate {
namespace {

struct Merged {
    std::array<uint32_t, 2> from;
    Fit into;
    double growth; // of what sticks out
};

struct Halved {
    uint32_t from;
    std::array<Fit, 2> into;
    double gain; // what sticks out less
};

class Exchanger {
public:
    Exchanger(std::span<const std::vector<uint32_t>> shares, const Voxels& cells, double min_radius,
              const std::function<double(const Fit&)>& outside)
        : shares_(shares), cells_(cells), min_radius_(min_radius), outside_(outside) {
        for (const std::vector<uint32_t>& share : shares) {
            sketches_.push_back(sketch_of(share));
            errors_.push_back(share.empty() ? 0 : outside(fit_to(sketches_.back())));
        }
    }

    std::vector<Merged> merged() const {
        std::vector<Merged> out;
        for (uint32_t a = 0; a < shares_.size(); ++a)
            for (uint32_t b = a + 1; b < shares_.size(); ++b) {
                if (shares_[a].empty() || shares_[b].empty()) continue;
                Sketch both = sketches_[a];
                both.add(sketches_[b]);
                const Fit fit = fit_to(both);
                out.push_back({{a, b}, fit, outside_(fit) - errors_[a] - errors_[b]});
            }
        std::ranges::stable_sort(out, {}, &Merged::growth);
        return out;
    }

    std::vector<Halved> halved() const {
        std::vector<Halved> out;
        for (uint32_t i = 0; i < shares_.size(); ++i) {
            const std::vector<Cluster> two = spread_start(cells_, shares_[i], 2, 1, min_radius_);
            if (two.size() < 2) continue;
            const Fit a = fit_to(sketch_of(two[0].cells)), b = fit_to(sketch_of(two[1].cells));
            out.push_back({i, {a, b}, errors_[i] - outside_(a) - outside_(b)});
        }
        std::ranges::stable_sort(out, std::ranges::greater(), &Halved::gain);
        return out;
    }

private:
    Sketch sketch_of(std::span<const uint32_t> share) const {
        Sketch out;
        for (const uint32_t cell : share) out.add(cells_.points(cell));
        return out;
    }
    Fit fit_to(const Sketch& sketch) const {
        checkpoint();
        const Fit least = enclosing_ellipsoid(sketch.points(), min_radius_);
        return capped(least.center, least.factor * least.factor.transpose(), min_radius_);
    }

    std::span<const std::vector<uint32_t>> shares_;
    const Voxels& cells_;
    const double min_radius_;
    const std::function<double(const Fit&)>& outside_;
    std::vector<Sketch> sketches_; // of each share
    std::vector<double> errors_;   // E_vol of the ellipsoid around each
};

} // namespace

std::vector<std::vector<Fit>> exchanges(std::span<const Fit> fits, std::span<const std::vector<uint32_t>> shares,
                                        const Voxels& cells, double min_radius,
                                        const std::function<double(const Fit&)>& outside, size_t most) {
    const Exchanger exchanger(shares, cells, min_radius, outside);
    const std::vector<Merged> merged = exchanger.merged();
    const std::vector<Halved> halved = exchanger.halved();
    struct Pair {
        const Merged* less;
        const Halved* more;
        double change() const { return less->growth - more->gain; }
    };
    std::vector<Pair> pairs;
    for (const Merged& less : merged)
        for (const Halved& more : halved)
            if (more.from != less.from[0] && more.from != less.from[1]) pairs.push_back({&less, &more});
    std::ranges::stable_sort(pairs, {}, &Pair::change);
    pairs.resize(std::min(pairs.size(), most));
    std::vector<std::vector<Fit>> out;
    for (const Pair& pair : pairs) {
        std::vector<Fit>& set = out.emplace_back(fits.begin(), fits.end());
        set[pair.less->from[0]] = pair.less->into;
        set[pair.less->from[1]] = pair.more->into[0];
        set[pair.more->from] = pair.more->into[1];
    }
    return out;
}

} // namespace prolate

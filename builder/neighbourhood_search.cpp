#include "builder/neighbourhood_search.hpp"

#include "builder/central.hpp"
#include "builder/job.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr double kBesideMargin = 1.2; // ellipsoids whose boxes, so much larger, meet may come to touch in a trial
constexpr size_t kBatch = 4;          // places that are tried at the same time, at most: they are apart

// Ellipsoids that descend together, what they see, and what they come to.
struct Trial {
    std::vector<uint32_t> chosen, beside; // of the set
    uint64_t seed;
    std::vector<Fit> fits; // of the chosen ones
};

class NeighbourhoodSearcher {
public:
    NeighbourhoodSearcher(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
                          const NeighbourhoodSearch& options)
        : fits_(fits), field_(field), points_(points), options_(options), random_(options.descent.seed),
          order_(fits.size()), error_(options.error(fits)) {
        std::iota(order_.begin(), order_.end(), 0u);
    }

    void run() {
        for (int done = 0; done < options_.trials;) {
            std::vector<Trial> batch = next_batch(static_cast<size_t>(options_.trials - done));
            parallel_for(size_t{0}, batch.size(), [&](size_t b) { descend_again(batch[b]); });
            for (const Trial& place : batch) keep_if_better(place);
            done += static_cast<int>(batch.size());
            if (options_.progress) options_.progress(static_cast<double>(done) / options_.trials);
        }
    }

private:
    // Ellipsoids take turns, in another order each time.
    uint32_t center() {
        if (turn_ == 0)
            for (size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[random_.bits() % i]);
        return order_[turn_];
    }

    std::vector<Trial> next_batch(size_t most) {
        const std::vector<std::vector<uint32_t>> neighbours = neighbours_of(fits_, kBesideMargin);
        std::vector<bool> moving(fits_.size(), false), seen(fits_.size(), false);
        std::vector<Trial> out;
        while (out.size() < std::min(kBatch, most)) {
            Trial place = place_around(center(), neighbours);
            const auto in = [](const std::vector<uint32_t>& some, const std::vector<bool>& marked) {
                return std::ranges::any_of(some, [&](uint32_t i) { return marked[i]; });
            };
            if (in(place.chosen, moving) || in(place.chosen, seen) || in(place.beside, moving)) break;
            for (const uint32_t i : place.chosen) moving[i] = true;
            for (const uint32_t i : place.beside) seen[i] = true;
            turn_ = (turn_ + 1) % order_.size();
            place.seed = random_.bits();
            out.push_back(std::move(place));
        }
        return out;
    }

    // The ellipsoid and those neighbours that are most in the middle of it, or it of them.
    Trial place_around(uint32_t center, const std::vector<std::vector<uint32_t>>& neighbours) const {
        std::vector<std::pair<double, uint32_t>> near;
        for (const uint32_t other : neighbours[center]) {
            const double there = fits_[center].radial_squared(fits_[other].center),
                         back = fits_[other].radial_squared(fits_[center].center);
            near.emplace_back(std::min(there, back), other);
        }
        std::ranges::sort(near);
        near.resize(std::min(near.size(), options_.size - 1));
        Trial out;
        out.chosen.push_back(center);
        for (const auto& [radial, other] : near) out.chosen.push_back(other);
        for (const uint32_t i : out.chosen) {
            out.fits.push_back(fits_[i]);
            for (const uint32_t other : neighbours[i])
                if (std::ranges::find(out.chosen, other) == out.chosen.end()) out.beside.push_back(other);
        }
        std::ranges::sort(out.beside);
        out.beside.erase(std::unique(out.beside.begin(), out.beside.end()), out.beside.end());
        return out;
    }

    void descend_again(Trial& place) const {
        std::vector<Fit> fixed;
        for (const uint32_t i : place.beside) fixed.push_back(fits_[i]);
        const auto [points, owner] = points_of(place, fixed);
        DescentOptions options = options_.descent;
        options.seed = place.seed, options.fixed = fixed, options.relocate = false, options.progress = {};
        descend(place.fits, field_, points, owner, options);
    }

    // The points that are the place's to cover, and which of its ellipsoids has each most centrally.
    std::pair<std::vector<Vec>, std::vector<uint32_t>> points_of(const Trial& place, std::span<const Fit> fixed) const {
        Box box;
        for (const Fit& fit : place.fits) {
            const Vec half = kBesideMargin * fit.half_extents();
            box.add(fit.center - half), box.add(fit.center + half);
        }
        std::pair<std::vector<Vec>, std::vector<uint32_t>> out;
        for (const Vec& p : points_) {
            if (((p - box.low).array() < 0).any() || ((box.high - p).array() < 0).any()) continue;
            double least = HUGE_VAL;
            uint32_t owner = 0;
            for (uint32_t k = 0; k < place.fits.size(); ++k)
                if (const double radial = place.fits[k].radial_squared(p); radial < least) least = radial, owner = k;
            const double free = std::max(1.0, least); // others that have it so centrally cover it, or are to
            if (std::ranges::any_of(fixed, [&](const Fit& fit) { return fit.radial_squared(p) < free; })) continue;
            out.first.push_back(p), out.second.push_back(owner);
        }
        return out;
    }

    void keep_if_better(const Trial& place) {
        std::vector<Fit> next = fits_;
        for (size_t k = 0; k < place.chosen.size(); ++k) next[place.chosen[k]] = place.fits[k];
        const double error = options_.error(next);
        if (error < error_) error_ = error, fits_.swap(next);
    }

    std::vector<Fit>& fits_;
    const DistanceField& field_;
    const std::span<const Vec> points_;
    const NeighbourhoodSearch& options_;
    Random random_;
    std::vector<uint32_t> order_;
    size_t turn_ = 0;
    double error_;
};

} // namespace

void search_neighbourhoods(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
                           const NeighbourhoodSearch& options) {
    if (fits.size() > 1) NeighbourhoodSearcher(fits, field, points, options).run();
}

} // namespace prolate

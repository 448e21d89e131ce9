#include "builder/flat_set.hpp"

#include "builder/central.hpp"
#include "builder/divide.hpp"
#include "builder/exchange.hpp"
#include "builder/job.hpp"
#include "builder/neighbourhood_search.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace prolate {
namespace {

// Merging starts cost more than they give for sets of more ellipsoids than this.
constexpr uint32_t kMergeLimit = 64;
// Up to so many ellipsoids they are the first choice.
constexpr uint32_t kFew = 16;
// Sets of fewer ellipsoids than kManyStarts have more starts than usual, up to kMostStarts times as many: they cost
// little, and more depends on where they start.
constexpr uint32_t kManyStarts = 64;
constexpr int kMostStarts = 4;
constexpr uint32_t kPiecesPerCluster[] = {16, 32, 8, 24, 12}; // of the merging starts, in turn
constexpr double kUncoveredWeight = 50;                       // per volume outside, when descents are compared
// Objective::scale of solids: in sides of a cube that has an ellipsoid's share of the volume.
constexpr double kShapeScale = 0.35;
// Of thin ones, and of surfaces that enclose nothing: in sides of a square that has its share of the area.
constexpr double kThinShapeScale = 0.1;
constexpr double kPointsPerEllipsoid = 250, kLeastPoints = 15000; // of the surface, for descents
constexpr double kPull = 20, kPullIterations = 500; // of longer descents of many, uncovered points pull less
// Of a descent. Of many ellipsoids, or balls, the others hide most of the border, and what is seen of it has to do.
constexpr int kDirectionsOfMany = 256;
constexpr int kPolishDirections = 256;
// A set whose ellipsoids start below those of the set above may have so much more error than one that starts alone.
constexpr double kMostLoss = 1.15;
constexpr int kLeastIterations = 75; // that tell anything
constexpr double kReheat = 10;       // kappa at the start of a cycle
// Of a trial in a neighbourhood: how many descend together, for how long, from which kappa.
constexpr size_t kTrialSize = 6;
constexpr int kTrialIterations = 200;
constexpr double kTrialKappa = 6;
constexpr double kSearchShare = 0.9, kDescentShare = 0.6; // of the time: the latter where there are such trials
constexpr double kLeastWorth = 0.5;                       // of a further ellipsoid, in means of those that are there

} // namespace

std::vector<Fit> fits_of(std::span<const Part> parts) {
    std::vector<Fit> out;
    out.reserve(parts.size());
    for (const Part& part : parts) out.push_back(part.fit);
    return out;
}

std::vector<Ellipsoid> ellipsoids_of(std::span<const Fit> fits) {
    std::vector<Ellipsoid> out;
    out.reserve(fits.size());
    for (const Fit& fit : fits) out.push_back(fit.ellipsoid());
    return out;
}

void follow_cuts(FlatSet& set, const Pieces& pieces) {
    std::vector<uint32_t> owner(pieces.size());
    for (uint32_t n = 0; n < set.parts.size(); ++n)
        for (const uint32_t piece : set.parts[n].pieces) owner[piece] = n;
    for (; set.piece_count < pieces.size(); ++set.piece_count) {
        const uint32_t piece = set.piece_count;
        owner[piece] = owner[pieces.cut_from(piece)];
        set.parts[owner[piece]].pieces.push_back(piece);
    }
}

FlatSetMaker::FlatSetMaker(const Solid& solid, const BuildOptions& options, const Effort& effort, double min_radius)
    : solid_(solid), options_(options), effort_(effort), min_radius_(min_radius),
      solid_volume_(solid.columns.volume().value) {
    for (uint32_t piece = 0; piece < solid.pieces.size(); ++piece)
        solid.pieces.for_each_surface_point(piece, [this](const Vec& p) { surface_.push_back(p); });
}

FlatSet FlatSetMaker::single() const {
    std::vector<uint32_t> all(solid_.pieces.size());
    std::iota(all.begin(), all.end(), 0u);
    std::vector<Fit> fits{fit_pieces(solid_.pieces, all, min_radius_)};
    if (options_.primitive == Primitive::sphere) {
        fits[0] = as_primitive(fits[0], Primitive::sphere);
        polish_set(fits, effort_.search);
    }
    return {{{fits[0], std::move(all)}}, outside_of(fits), solid_.pieces.size()};
}

FlatSet FlatSetMaker::make(uint32_t count, const FlatSet* above, const std::function<void(double)>& progress) {
    const Search& search = count > kMergeLimit ? effort_.many : count > kFew ? effort_.search : effort_.few;
    FlatSet best;
    for (std::vector<Fit>& fits : approach(count, search, above, progress)) {
        FlatSet set = settle(std::move(fits), count, search);
        if (!best.parts.empty()) follow_cuts(best, solid_.pieces);
        if (best.parts.empty() || set.outside < best.outside) best = std::move(set);
    }
    return best;
}

// Sets that all but cover: the best ones that the descents found.
std::vector<std::vector<Fit>> FlatSetMaker::approach(uint32_t count, const Search& search, const FlatSet* above,
                                                     const std::function<void(double)>& progress) const {
    int starts = search.starts * std::clamp(static_cast<int>(kManyStarts / count), 1, kMostStarts);
    if (above && above->parts.size() == 1) above = nullptr;
    int iterations = search.iterations;
    const std::vector<Vec> points = points_for(count);
    if (above && count > kMergeLimit && starts == 1) {
        if (better_alone(count, *above, points, iterations)) above = nullptr;
        iterations = iterations * 3 / 4; // as many in all
    } else if (above)
        starts = std::max(starts, 2); // the last one knows of no set above
    const int exchanges = count <= kFew ? search.exchanges : 0, rounds = starts + search.cycles + exchanges;
    const double share = search.trials > 0 ? kDescentShare : kSearchShare;
    std::vector<Start> best; // best first
    std::vector<double> least;
    const auto attempt = [&](Start now, int round, int length, double kappa) {
        descend_from(now, points, length, kappa, round,
                     [&](double done) { progress(share * (round + done) / rounds); });
        double error = approximate_error(now.fits);
        if (above && now.family.empty()) error *= kMostLoss;
        const auto place = std::ranges::upper_bound(least, error) - least.begin();
        best.insert(best.begin() + place, std::move(now)), least.insert(least.begin() + place, error);
        if (best.size() > static_cast<size_t>(search.finalists)) best.pop_back(), least.pop_back();
        return place == 0;
    };
    int round = 0;
    for (; round < starts; ++round)
        attempt(start(count, starts > 1 && round == starts - 1 ? nullptr : above, round, points), round, iterations, 1);
    for (; round < starts + search.cycles; ++round) attempt(best.front(), round, iterations / 2, kReheat);
    std::vector<std::vector<Fit>> near;
    for (bool better = true; round < rounds; ++round) {
        if (better) near = next_to(best.front().fits, static_cast<size_t>(rounds - round));
        if (near.empty()) break;
        better = attempt(start_at(std::move(near.front()), points), round, iterations / 2, kReheat);
        near.erase(near.begin());
    }
    std::vector<std::vector<Fit>> out;
    out.reserve(best.size());
    for (Start& one : best) {
        if (search.trials > 0)
            improve_places(one.fits, search, points,
                           [&](double done) { progress(share + (kSearchShare - share) * done); });
        out.push_back(std::move(one.fits));
    }
    return out;
}

// Is a set much tighter if it knows of none above? By short descents.
bool FlatSetMaker::better_alone(uint32_t count, const FlatSet& above, std::span<const Vec> points,
                                int iterations) const {
    const auto error = [&](const FlatSet* known) {
        Start one = start(count, known, 0, points);
        descend_from(one, points, std::max(iterations / 8, kLeastIterations), 1, 0, {});
        return approximate_error(one.fits);
    };
    return kMostLoss * error(nullptr) < error(&above);
}

void FlatSetMaker::improve_places(std::vector<Fit>& fits, const Search& search, std::span<const Vec> points,
                                  const std::function<void(double)>& progress) const {
    search_neighbourhoods(fits, solid_.field, points,
                          {.descent = descent_options(fits.size(), kTrialIterations, kTrialKappa, 0),
                           .size = kTrialSize,
                           .trials = search.trials * static_cast<int>(fits.size()),
                           .error = [this](std::span<const Fit> some) { return approximate_error(some); },
                           .progress = progress});
}

// Where one ellipsoid less in one place and one more in another may be tighter.
std::vector<std::vector<Fit>> FlatSetMaker::next_to(std::span<const Fit> fits, size_t most) const {
    auto out = exchanges(
        fits, share_cells(fits), solid_.cells, min_radius_, [this](const Fit& fit) { return outside_volume(fit); },
        most);
    for (std::vector<Fit>& set : out)
        for (Fit& fit : set) fit = as_primitive(fit, options_.primitive);
    return out;
}

FlatSet FlatSetMaker::settle(std::vector<Fit> fits, size_t count, const Search& search) {
    refine_seams(solid_.pieces, fits);
    const std::vector<uint32_t> owner = polish_set(fits, search);
    FlatSet set;
    set.piece_count = solid_.pieces.size();
    for (const Fit& fit : fits) set.parts.push_back({fit, {}});
    for (uint32_t piece = 0; piece < owner.size(); ++piece) set.parts[owner[piece]].pieces.push_back(piece);
    std::erase_if(set.parts, [](const Part& part) { return part.pieces.empty(); });
    set.outside = outside_of(fits_of(set.parts));
    // Places of those that were redundant go to halves, where one more is worth about as much as the others.
    halve(set, count, kLeastWorth * set.outside / static_cast<double>(set.parts.size()));
    return set;
}

void FlatSetMaker::split(FlatSet& set, size_t count) const {
    if (set.parts.size() >= count) return;
    halve(set, count, 0);
    // Nothing is gained any more: as many as were asked for, but none that sticks out where its whole did not.
    while (set.parts.size() < count) {
        Part& most = *std::ranges::max_element(set.parts, {}, [](const Part& part) { return part.pieces.size(); });
        if (most.pieces.size() < 2) return;
        auto [a, b] = halves_of(most);
        Part rest{smaller(most.fit, b), std::move(b)};
        most = {smaller(most.fit, a), std::move(a)};
        set.parts.push_back(std::move(rest));
    }
    set.outside = outside_of(fits_of(set.parts));
}

// Halves the part that alone sticks out most, and then the next, until there are `count`: only such as then stick out
// by at least `worth` cubic metres less, by a rough measure. If the set does not, by a finer one, it is left as it is.
void FlatSetMaker::halve(FlatSet& set, size_t count, double worth) const {
    FlatSet halved = set;
    std::vector<Part>& parts = halved.parts;
    std::vector<std::vector<uint32_t>> neighbours = neighbours_of(fits_of(parts), 1);
    const auto alone = [&](const Fit& fit, size_t i) {
        std::vector<const Fit*> others;
        for (const uint32_t j : neighbours[i]) others.push_back(&parts[j].fit);
        return sampled_outside_volume(fit, solid_.field, others);
    };
    std::vector<double> outside(parts.size());
    parallel_for(size_t{0}, parts.size(), [&](size_t i) { outside[i] = alone(parts[i].fit, i); });
    while (parts.size() < count) {
        const auto most = static_cast<size_t>(std::ranges::max_element(outside) - outside.begin());
        if (outside.empty() || outside[most] < 0) break;
        if (parts[most].pieces.size() < 2) {
            outside[most] = -1;
            continue;
        }
        auto [a, b] = halves_of(parts[most]);
        const auto measure = [&](const Fit& fit) { return alone(fit, most); };
        Part low{part_of(parts[most].fit, a, measure), std::move(a)};
        Part high{part_of(parts[most].fit, b, measure), std::move(b)};
        const double first = measure(low.fit), second = measure(high.fit);
        if (first + second + worth >= outside[most]) {
            outside[most] = -1;
            continue;
        }
        const auto next = static_cast<uint32_t>(parts.size());
        outside[most] = first, outside.push_back(second);
        parts[most] = std::move(low), parts.push_back(std::move(high));
        neighbours.push_back(neighbours[most]);
        for (const uint32_t j : neighbours[most]) neighbours[j].push_back(next);
        neighbours[most].push_back(next), neighbours[next].push_back(static_cast<uint32_t>(most));
    }
    if (parts.size() == set.parts.size()) return;
    halved.outside = outside_of(fits_of(parts));
    if (halved.outside < set.outside) set = std::move(halved);
}

// The part's pieces, in two.
std::pair<std::vector<uint32_t>, std::vector<uint32_t>> FlatSetMaker::halves_of(const Part& part) const {
    return divide(part.pieces, part.pieces.size() / 2, [this](uint32_t piece) { return solid_.pieces.center(piece); });
}

// `whole`, as small as these of the pieces that it holds let it be.
Fit FlatSetMaker::smaller(const Fit& whole, std::span<const uint32_t> pieces) const {
    const Fit fit = whole.scaled(reach_of(whole, solid_.pieces, pieces));
    return within_caps(fit, min_radius_) ? fit : whole;
}

// For some of the pieces that `whole` holds: a fit of their own, or, if that sticks out more, a smaller `whole`.
Fit FlatSetMaker::part_of(const Fit& whole, std::span<const uint32_t> pieces,
                          const std::function<double(const Fit&)>& outside) const {
    const Fit less = smaller(whole, pieces), own = fit_around(pieces);
    return outside(less) < outside(own) ? less : own;
}

Fit FlatSetMaker::fit_around(std::span<const uint32_t> pieces) const {
    const Fit fit = as_primitive(fit_pieces(solid_.pieces, pieces, min_radius_), options_.primitive);
    return fit.scaled(reach_of(fit, solid_.pieces, pieces));
}

double FlatSetMaker::outside_volume(const Fit& fit) const {
    return solid_.outside ? solid_.outside(fit).volume : sampled_outside_volume(fit, solid_.field);
}
CoverVolume FlatSetMaker::measure(std::span<const Fit> fits) const {
    return measure_cover(solid_.columns, ellipsoids_of(fits));
}
double FlatSetMaker::outside_of(std::span<const Fit> fits) const {
    return measure(fits).outside.value;
}
double FlatSetMaker::approximate_error(std::span<const Fit> fits) const {
    const CoverVolume volume = measure(fits);
    const double uncovered = volume.solid.value - (volume.whole.value - volume.outside.value);
    return volume.outside.value + kUncoveredWeight * uncovered;
}

FlatSetMaker::Start FlatSetMaker::start(uint32_t count, const FlatSet* above, int number,
                                        std::span<const Vec> points) const {
    const bool merging = count <= kMergeLimit && (number % 2 == 0) == (count <= kFew);
    const uint32_t blocks = kPiecesPerCluster[static_cast<size_t>(number) / 2 % std::size(kPiecesPerCluster)];
    const auto seed = options_.seed + static_cast<uint64_t>(number);
    const std::vector<std::vector<uint32_t>> shares = share_cells(above ? fits_of(above->parts) : std::vector<Fit>(1));
    std::vector<std::vector<Cluster>> clusters(shares.size());
    parallel_for(size_t{0}, shares.size(), [&](size_t s) {
        const auto k = static_cast<uint32_t>(count * (s + 1) / shares.size() - count * s / shares.size());
        clusters[s] = merging ? merge_start(solid_.cells, shares[s], k, blocks, min_radius_,
                                            [this](const Fit& fit) { return outside_volume(fit); })
                              : spread_start(solid_.cells, shares[s], k, seed, min_radius_);
    });
    Start out;
    std::vector<uint32_t> of_cell(solid_.cells.cell_count(), 0);
    for (uint32_t share = 0; share < shares.size(); ++share)
        for (const Cluster& cluster : clusters[share]) {
            for (const uint32_t cell : cluster.cells) of_cell[cell] = static_cast<uint32_t>(out.fits.size());
            out.fits.push_back(as_primitive(cluster.fit, options_.primitive));
            if (above) out.family.push_back(share);
        }
    for (const Vec& p : points) {
        const uint32_t cell = solid_.cells.cell_at(p);
        out.owner.push_back(cell == Voxels::kNoCell ? 0 : of_cell[cell]);
    }
    return out;
}

// Of ellipsoids that know of no set above.
FlatSetMaker::Start FlatSetMaker::start_at(std::vector<Fit> fits, std::span<const Vec> points) const {
    Start out{std::move(fits), {}, {}};
    const CentralTree tree(out.fits);
    out.owner.reserve(points.size());
    for (const Vec& p : points) out.owner.push_back(tree.find(p, HUGE_VAL).value_or(0));
    return out;
}

// The cells, each to the one of `fits` that has it most centrally.
std::vector<std::vector<uint32_t>> FlatSetMaker::share_cells(std::span<const Fit> fits) const {
    const CentralTree tree(fits);
    std::vector<std::vector<uint32_t>> out(fits.size());
    for (uint32_t cell = 0; cell < solid_.cells.cell_count(); ++cell)
        out[tree.find(solid_.cells.box(cell).center(), HUGE_VAL).value_or(0)].push_back(cell);
    return out;
}

// What descents look at.
std::vector<Vec> FlatSetMaker::points_for(uint32_t count) const {
    const auto wanted = static_cast<size_t>(std::max(kLeastPoints, kPointsPerEllipsoid * count));
    const size_t stride = std::max<size_t>(1, surface_.size() / wanted);
    std::vector<Vec> points;
    for (size_t at = 0; at < surface_.size(); at += stride) points.push_back(surface_[at]);
    return points;
}

Objective FlatSetMaker::objective(size_t count) const {
    const double n = static_cast<double>(count), by_volume = kShapeScale * std::cbrt(solid_volume_ / n),
                 by_area = kThinShapeScale * std::sqrt(solid_.area / n);
    return {double{options_.alpha}, double{options_.beta}, std::max(by_volume, by_area)};
}

DescentOptions FlatSetMaker::descent_options(size_t count, int iterations, double kappa, int number) const {
    const double directions = std::clamp(800 / std::sqrt(static_cast<double>(count)), 96.0, 384.0);
    return {.objective = objective(count),
            .primitive = options_.primitive,
            .iterations = iterations,
            .directions = count > kMergeLimit ? kDirectionsOfMany : static_cast<int>(directions),
            .min_radius = min_radius_,
            .relocate = count > kFew,
            .first_kappa = kappa,
            .pull = count > kMergeLimit ? kPull * std::min(1.0, kPullIterations / iterations) : kPull,
            .seed = Random(options_.seed + static_cast<uint64_t>(number)).bits()};
}

void FlatSetMaker::descend_from(Start& start, std::span<const Vec> points, int iterations, double kappa, int number,
                                const std::function<void(double)>& progress) const {
    DescentOptions options = descent_options(start.fits.size(), iterations, kappa, number);
    options.family = start.family, options.progress = progress;
    descend(start.fits, solid_.field, points, start.owner, options);
}

std::vector<uint32_t> FlatSetMaker::polish_set(std::vector<Fit>& fits, const Search& search) const {
    const PolishOptions options{.objective = objective(fits.size()),
                                .primitive = options_.primitive,
                                .sweeps = search.sweeps,
                                .first_step = search.polish_step,
                                .directions = kPolishDirections,
                                .min_radius = min_radius_,
                                .outside = solid_.outside,
                                .error = [this](std::span<const Fit> some) { return outside_of(some); },
                                .seed = options_.seed};
    return polish(fits, solid_.pieces, solid_.field, options);
}

} // namespace prolate

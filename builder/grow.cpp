#include "builder/grow.hpp"

#include "builder/job.hpp"
#include "builder/random.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numeric>

namespace prolate {
namespace {

constexpr uint32_t kNobody = UINT32_MAX;
constexpr uint32_t kMaxLeaves = 65536;
constexpr uint32_t kMergeLimit = 64; // clusters, up to which merging is a start; it costs more than it gives above
constexpr uint32_t kFew = 16;        // ellipsoids, up to which it is the first choice
constexpr uint32_t kManyStarts = 64; // children of one parent, below which there are more starts than usual,
constexpr int kMostStarts = 4;       // up to so many times
constexpr uint32_t kPiecesPerCluster[] = {16, 32, 8, 24, 12}; // of the merging starts, in turn
constexpr double kUncoveredWeight = 50;                       // per volume outside, when descents are compared
// Objective::scale: in sides of a cube with an ellipsoid's share of the solid, of a square with its share of the
// surface.
constexpr double kShapeScale = 0.35, kThinShapeScale = 0.1;
constexpr double kPointsPerEllipsoid = 250, kLeastPoints = 15000; // of the surface, for descents
constexpr double kMostShare = 2; // of a child's leaves, times its equal share of its parent's; the two smallest of
constexpr double kMostShareOfAll = 2.0 / 3; // degree + 1 parts have less: such parts are always found
constexpr size_t kMostUnits = 512;          // that merge into the groups of a node; of more leaves, some are one unit
constexpr double kReheat = 10;              // kappa at the start of a cycle
constexpr int kRounds = 12;                 // at most, of a search for the count that meets a limit
constexpr double kLeastWorth = 0.5;         // of a further leaf, in means of those that are there
constexpr double kMet = 0.999;              // of a limit: quantisation will add a little
constexpr double kCountTolerance = 1.1;     // the search ends this close to the least count
constexpr double kLeastGain = 0.999;        // a level must bring the outside volume down to less than this much
// What a tree's leaves may have outside, times what as many have that nothing above them limits. build.hpp
// promises 1.3; the rest is for what is estimated on the way.
constexpr double kMostLoss = 1.27;
constexpr double kMostFewer = 1.25;   // leaves; with fewer still, there is room for more
constexpr double kMostSettling = 1.4; // a set that all but covers seldom gains more volume when it has to cover

class Grower {
public:
    Grower(const Solid& solid, const GrowOptions& options)
        : solid_(solid), pieces_(solid.pieces), options_(options), solid_volume_(solid.columns.volume().value),
          outside_volume_([this](const Fit& fit) {
              return solid_.outside ? solid_.outside(fit).volume : sampled_outside_volume(fit, solid_.field);
          }),
          started_(Clock::now()), seed_(options.build.seed) {
        for (uint32_t piece = 0; piece < pieces_.size(); ++piece)
            pieces_.for_each_surface_point(piece, [this](const Vec& p) { surface_.push_back(p); });
    }

    Grown run() {
        grow_root();
        const BuildOptions& goal = options_.build;
        if (goal.ellipsoids)
            grow_upwards(goal.ellipsoids > 1 ? solve_flat(goal.ellipsoids, [this](double done) { report(done); })
                                             : std::vector<Leaf>{});
        else if (goal.tolerance > 0 || goal.distance > 0)
            grow_upwards(meet_limits());
        else
            grow_levels(goal.levels ? goal.levels : 3);
        tidy();
        return std::move(grown_);
    }

private:
    using Clock = std::chrono::steady_clock;

    struct Leaf {
        Fit fit;
        std::vector<uint32_t> pieces;
        uint32_t parent = 0; // among those of its task
    };
    // A set of ellipsoids that all but covers, as descents leave it.
    struct Approach {
        EllipsoidSet set;
        double error = HUGE_VAL; // see approximate_error()
    };
    // One that covers.
    struct Solved {
        std::vector<Leaf> leaves;
        std::vector<std::vector<Fit>> chains; // as the task's, perhaps larger
        double outside = HUGE_VAL;            // cubic metres
        double settling = 1;                  // times the volume outside before it was made to cover
    };
    // What a set is made for: some parents, each with its cells and the number of children it is to have.
    struct Task {
        std::vector<std::vector<uint32_t>> cells; // of each parent, rising
        uint32_t children;
        std::vector<std::vector<Fit>> chains; // see EllipsoidSet; empty if the one parent limits nothing
    };

    void report(double done) const {
        if (options_.progress) options_.progress(done, static_cast<uint32_t>(grown_.nodes.size()));
    }
    void end_level(uint32_t level) {
        if (grown_.seconds.size() <= level) grown_.seconds.resize(level + 1, 0);
        const auto now = Clock::now();
        grown_.seconds[level] += std::chrono::duration<double>(now - started_).count();
        started_ = now;
    }

    // Thin solids, and surfaces that enclose none, are measured by their area.
    double scale_by_volume(size_t count) const {
        return kShapeScale * std::cbrt(solid_volume_ / static_cast<double>(count));
    }
    double scale_by_area(size_t count) const {
        return kThinShapeScale * std::sqrt(solid_.area / static_cast<double>(count));
    }
    bool thin(size_t count) const { return scale_by_area(count) > scale_by_volume(count); }
    Objective objective(size_t count) const {
        const double scale = std::max(scale_by_volume(count), scale_by_area(count));
        return {double{options_.build.alpha}, double{options_.build.beta}, scale};
    }

    void grow_root() {
        GrownNode root;
        own_all(root);
        root.fit = fit_pieces(pieces_, root.pieces, options_.min_radius);
        if (options_.build.primitive == Primitive::sphere) {
            EllipsoidSet one{{as_primitive(root.fit, Primitive::sphere)}, {}, {}};
            polish_set(one);
            root.fit = one.fits[0];
        }
        grown_.nodes.push_back(std::move(root));
        end_level(0);
    }

    // --- one set ----------------------------------------------------------------------------------------------------

    Solved solve(const Task& task, const Effort& effort, const std::function<void(double)>& progress) {
        return settle(task, approach(task, effort, progress));
    }

    Approach approach(const Task& task, Effort effort, const std::function<void(double)>& progress) {
        if (task.cells.size() == 1) // few ellipsoids cost little, and more depends on where they start
            effort.starts *= std::clamp(static_cast<int>(kManyStarts / task.children), 1, kMostStarts);
        const int rounds = effort.starts + effort.cycles;
        Approach best;
        std::vector<uint32_t> best_owner;
        gather_points(task);
        for (int start = 0; start < effort.starts; ++start) {
            std::vector<uint32_t> owner;
            EllipsoidSet set = start_set(task, start, owner);
            descend_set(set, owner, effort.iterations, 1, start,
                        [&](double done) { progress(0.9 * (start + done) / rounds); });
            const double error = approximate_error(set);
            if (error < best.error || best.set.fits.empty()) best = {std::move(set), error}, best_owner.swap(owner);
        }
        for (int cycle = 0; cycle < effort.cycles; ++cycle) {
            EllipsoidSet set = best.set;
            descend_set(set, best_owner, effort.iterations / 2, kReheat, effort.starts + cycle,
                        [&](double done) { progress(0.9 * (effort.starts + cycle + done) / rounds); });
            const double error = approximate_error(set);
            if (error < best.error) best = {std::move(set), error};
        }
        return best;
    }

    Solved settle(const Task& task, Approach approach) {
        EllipsoidSet& set = approach.set;
        refine_seams(pieces_, set);
        const std::vector<uint32_t> owner = polish_set(set);
        std::vector<std::vector<Leaf>> below(task.cells.size());
        std::vector<Leaf> all(set.fits.size());
        for (size_t i = 0; i < all.size(); ++i) all[i] = {set.fits[i], {}, set.parent.empty() ? 0 : set.parent[i]};
        for (uint32_t piece = 0; piece < owner.size(); ++piece) all[owner[piece]].pieces.push_back(piece);
        std::erase_if(all, [](const Leaf& leaf) { return leaf.pieces.empty(); });
        const double outside = outside_of(fits_of(all));
        // Places of those that were redundant go to halves, where one more is worth about as much as the others.
        for (const Leaf& leaf : all) below[leaf.parent].push_back(leaf);
        Solved out;
        for (std::vector<Leaf>& leaves : below) {
            halve(leaves, task.children, kLeastWorth * outside / static_cast<double>(all.size()));
            std::ranges::move(leaves, std::back_inserter(out.leaves));
        }
        if (out.leaves.size() > all.size()) out.outside = outside_of(fits_of(out.leaves));
        if (!(out.outside < outside)) out.leaves = std::move(all), out.outside = outside;
        out.settling = outside / approach.error;
        out.chains = std::move(set.chains);
        return out;
    }

    static std::vector<Fit> fits_of(std::span<const Leaf> leaves) {
        std::vector<Fit> out;
        out.reserve(leaves.size());
        for (const Leaf& leaf : leaves) out.push_back(leaf.fit);
        return out;
    }

    // Halves the leaf that sticks out most, and then the next, until there are `count`: only such as then stick out by
    // at least `worth` cubic metres less.
    void halve(std::vector<Leaf>& leaves, size_t count, double worth) const {
        if (leaves.size() >= count) return;
        std::vector<double> outside;
        const auto look = [&](const Leaf& leaf) { return leaf.pieces.size() > 1 ? outside_volume_(leaf.fit) : -1; };
        outside.reserve(leaves.size());
        for (const Leaf& leaf : leaves) outside.push_back(look(leaf));
        while (leaves.size() < count) {
            const auto most = static_cast<size_t>(std::ranges::max_element(outside) - outside.begin());
            if (outside.empty() || outside[most] < 0) return;
            const Leaf whole = leaves[most];
            const auto place = [&](uint32_t piece) { return pieces_.center(piece); };
            const auto [a, b] = divide(whole.pieces, place, whole.pieces.size() / 2);
            Leaf low{part_of(whole.fit, a), a, whole.parent}, high{part_of(whole.fit, b), b, whole.parent};
            if (outside_volume_(low.fit) + outside_volume_(high.fit) + worth > outside[most]) {
                outside[most] = -1;
                continue;
            }
            outside[most] = look(low), outside.push_back(look(high));
            leaves[most] = std::move(low), leaves.push_back(std::move(high));
        }
    }

    double approximate_error(const EllipsoidSet& set) const {
        const CoverVolume volume = measure(set.fits);
        const double uncovered = volume.solid.value - (volume.whole.value - volume.outside.value);
        return volume.outside.value + kUncoveredWeight * uncovered;
    }

    static std::vector<Ellipsoid> ellipsoids_of(std::span<const Fit> fits) {
        std::vector<Ellipsoid> out;
        out.reserve(fits.size());
        for (const Fit& fit : fits) out.push_back(fit.ellipsoid());
        return out;
    }
    CoverVolume measure(std::span<const Fit> fits) const { return measure_cover(solid_.columns, ellipsoids_of(fits)); }
    double outside_of(std::span<const Fit> fits) const { return measure(fits).outside.value; }

    static bool merges(const Task& task) { return task.children * task.cells.size() <= kMergeLimit; }

    EllipsoidSet start_set(const Task& task, int start, std::vector<uint32_t>& owner) const {
        const bool few = task.children <= kFew && task.cells.size() == 1;
        const bool merging = merges(task) && (start % 2 == 0) == few;
        const auto seed = seed_ + static_cast<uint64_t>(start);
        const uint32_t pieces_per_cluster =
            kPiecesPerCluster[static_cast<size_t>(start) / 2 % std::size(kPiecesPerCluster)];
        std::vector<std::vector<Cluster>> clusters(task.cells.size());
        parallel_for(size_t{0}, task.cells.size(), [&](size_t p) {
            if (merging)
                clusters[p] = merge_start(solid_.cells, task.cells[p], task.children, pieces_per_cluster,
                                          options_.min_radius, outside_volume_);
            else
                clusters[p] = spread_start(solid_.cells, task.cells[p], task.children, seed, options_.min_radius);
        });
        EllipsoidSet set;
        set.chains = task.chains;
        std::vector<uint32_t> of_cell(solid_.cells.cell_count(), 0);
        for (uint32_t p = 0; p < clusters.size(); ++p)
            for (const Cluster& cluster : clusters[p]) {
                for (const uint32_t cell : cluster.cells) of_cell[cell] = static_cast<uint32_t>(set.fits.size());
                set.fits.push_back(as_primitive(cluster.fit, options_.build.primitive));
                if (!task.chains.empty()) set.parent.push_back(p);
            }
        owner.resize(points_.size());
        for (size_t p = 0; p < points_.size(); ++p) {
            const uint32_t cell = solid_.cells.cell_at(points_[p]);
            owner[p] = cell == Voxels::kNoCell ? 0 : of_cell[cell];
        }
        return set;
    }

    void gather_points(const Task& task) {
        const double ellipsoids = static_cast<double>(task.children) * static_cast<double>(task.cells.size());
        const auto wanted = static_cast<size_t>(std::max(kLeastPoints, kPointsPerEllipsoid * ellipsoids));
        const size_t stride = std::max<size_t>(1, surface_.size() / wanted);
        points_.clear();
        for (size_t at = 0; at < surface_.size(); at += stride) points_.push_back(surface_[at]);
    }

    void descend_set(EllipsoidSet& set, std::vector<uint32_t> owner, int iterations, double kappa, uint64_t seed,
                     const std::function<void(double)>& progress) const {
        const size_t n = set.fits.size();
        DescentOptions options{objective(n),
                               options_.build.primitive,
                               iterations,
                               static_cast<int>(std::clamp(800 / std::sqrt(static_cast<double>(n)), 96.0, 384.0)),
                               options_.min_radius,
                               n > kFew,
                               kappa,
                               Random(seed_ + seed).bits(),
                               progress};
        descend(set, solid_.field, points_, std::move(owner), options);
    }

    std::vector<uint32_t> polish_set(EllipsoidSet& set) const {
        const PolishOptions options{objective(set.fits.size()),
                                    options_.build.primitive,
                                    options_.effort.sweeps,
                                    256,
                                    options_.min_radius,
                                    solid_.outside,
                                    [this](std::span<const Fit> fits) { return outside_of(fits); },
                                    seed_};
        return polish(set, pieces_, solid_.field, options);
    }

    std::vector<uint32_t> all_cells() const {
        std::vector<uint32_t> out(solid_.cells.cell_count());
        std::iota(out.begin(), out.end(), 0u);
        return out;
    }

    // --- downwards --------------------------------------------------------------------------------------------------

    // Level by level. Where a level of so many nodes gains nothing, the next one is split off the same parents: what a
    // shell's eight children cannot do, their 64 children can, and a ball's cannot either. The levels left out are then
    // grown upwards between the two.
    void grow_levels(uint32_t levels) {
        const double root_outside = outside_of({&grown_.nodes[0].fit, 1});
        work_ = most_nodes(levels);
        for (uint32_t l = 1; l <= levels; ++l) work_ += most_nodes(l);
        Levels grown = split_levels(levels, root_outside);
        if (grown.level > 0 && (grown.level < levels || grown.limited)) {
            // Seams of the levels above are seams of the leaves: that costs some volume. Too much, or all that a level
            // could have gained, and other levels are tried; then the tree is grown upwards from a set that nothing
            // limits.
            const auto keep = [&](double free_outside, size_t free_count) {
                if (grown.level < levels) return kLeastGain * grown.outside <= free_outside;
                const double steepness = std::log(root_outside / free_outside) / std::log(free_count); // as errors fall
                const double fewer =
                    std::min(static_cast<double>(free_count) / static_cast<double>(grown.count), kMostFewer);
                return grown.outside <= kMostLoss * free_outside * std::pow(fewer, std::clamp(steepness, 0.0, 1.0));
            };
            const uint32_t piece_count = pieces_.size();
            Effort effort = options_.effort;
            effort.starts = 1, effort.cycles = 0;
            const Task task = task_below({0}, levels);
            Approach free = approach(task, effort, step(most_nodes(levels)));
            const double estimate = std::clamp(grown.settling, 1.0, kMostSettling) * free.error;
            // The estimate does not see what is left uncovered of thin parts.
            if (thin(task.children) || !keep(estimate, free.set.fits.size())) {
                const Solved plain = settle(task, std::move(free));
                const auto enough = [&] { return keep(plain.outside, plain.leaves.size()); };
                follow_cuts(grown_.nodes, piece_count);
                if (!enough() && grown.level == levels) {
                    start_over();
                    ++seed_;
                    grown = split_levels(levels, root_outside);
                }
                if (!enough()) {
                    effort.starts = 2; // of either kind: for loose parts one may be several times as good as the other
                    start_over();
                    attach(solve(task, effort, step(most_nodes(levels))), {0}, levels);
                    grown.level = levels;
                }
            }
            end_level(grown.level);
        }
        grown_.goal_reached = grown.level == levels;
    }

    // The root alone, with all pieces as they are cut by now.
    void start_over() {
        grown_.nodes.resize(1);
        grown_.nodes[0].first_child = grown_.nodes[0].child_count = 0;
        own_all(grown_.nodes[0]);
    }
    void own_all(GrownNode& root) const {
        root.pieces.resize(pieces_.size());
        std::iota(root.pieces.begin(), root.pieces.end(), 0u);
    }

    // Progress of `share` of the work.
    std::function<void(double)> step(double share) const {
        return [this, share](double part) { report(std::min(1.0, (done_ + part * share) / work_)); };
    }

    // What levels below the root came to.
    struct Levels {
        uint32_t level = 0;   // the lowest one
        double outside;       // its volume
        double settling = 1;  // Solved's
        size_t count = 1;     // of its nodes
        bool limited = false; // by nodes above it
    };
    Levels split_levels(uint32_t levels, double root_outside) {
        Levels grown{.outside = root_outside};
        std::vector<uint32_t> parents{0};
        for (uint32_t l = 1; l <= levels; ++l) {
            const uint32_t piece_count = pieces_.size();
            const Task task = task_below(parents, l - grown.level);
            Effort effort = options_.effort;
            if (l == levels && !task.chains.empty() && !merges(task)) // the set that nothing limits stands in for one
                effort.starts = std::max(1, effort.starts - 1);
            const Solved solved = solve(task, effort, step(most_nodes(l)));
            done_ += most_nodes(l);
            if (solved.outside >= kLeastGain * grown.outside) {
                follow_cuts(grown_.nodes, piece_count);
                continue;
            }
            grown.outside = solved.outside, grown.settling = solved.settling, grown.count = solved.leaves.size();
            if (grown.count == 1) { // the root itself, a little better
                grown_.nodes[0].fit = solved.leaves[0].fit;
                follow_cuts(grown_.nodes, piece_count);
                continue;
            }
            grown.limited = !task.chains.empty();
            parents = attach(solved, parents, l - grown.level);
            grown.level = l;
            end_level(l);
        }
        return grown;
    }

    // Of a level, by the degree.
    double most_nodes(uint32_t level) const { return std::pow(options_.build.degree, level); }

    // Sets of so many levels below the parents.
    Task task_below(const std::vector<uint32_t>& parents, uint32_t levels) const {
        Task task;
        const double most = std::max<double>(options_.build.degree, kMaxLeaves / static_cast<double>(parents.size()));
        task.children = static_cast<uint32_t>(std::min(most_nodes(levels), most));
        if (parents.size() == 1 && parents[0] == 0) {
            task.cells = {all_cells()};
            return task;
        }
        for (const uint32_t p : parents) { // the root covers everything: it is no limit
            task.chains.emplace_back();
            for (uint32_t node = p; node != 0; node = grown_.nodes[node].parent)
                task.chains.back().push_back(grown_.nodes[node].fit);
        }
        task.cells = share_cells(parents);
        return task;
    }

    // Each cell to the parent that has it most centrally.
    std::vector<std::vector<uint32_t>> share_cells(const std::vector<uint32_t>& parents) const {
        const Voxels& cells = solid_.cells;
        std::vector<uint32_t> owner(cells.cell_count(), kNobody);
        std::vector<double> nearest(cells.cell_count(), HUGE_VAL);
        const auto offer = [&](uint32_t p, uint32_t cell) {
            const Fit& fit = grown_.nodes[parents[p]].fit;
            const double radial = fit.radial_squared(cells.box(cell).center());
            if (radial < nearest[cell]) nearest[cell] = radial, owner[cell] = p;
        };
        for (uint32_t p = 0; p < parents.size(); ++p) {
            const Fit& fit = grown_.nodes[parents[p]].fit;
            const Vec half = fit.half_extents();
            cells.for_each_in({fit.center - half, fit.center + half}, [&](uint32_t cell) { offer(p, cell); });
        }
        std::vector<std::vector<uint32_t>> out(parents.size());
        for (uint32_t cell = 0; cell < cells.cell_count(); ++cell) {
            if (owner[cell] == kNobody)
                for (uint32_t p = 0; p < parents.size(); ++p) offer(p, cell);
            out[owner[cell]].push_back(cell);
        }
        return out;
    }

    // Makes nodes of the ellipsoids that own something, `levels` below `parents`. Returns the new leaves.
    std::vector<uint32_t> attach(const Solved& solved, const std::vector<uint32_t>& parents, uint32_t levels) {
        for (size_t p = 0; p < solved.chains.size(); ++p) { // the polish may have enlarged them
            uint32_t node = parents[p];
            for (const Fit& fit : solved.chains[p]) {
                if (fit.volume() > grown_.nodes[node].fit.volume()) grown_.nodes[node].fit = fit;
                node = grown_.nodes[node].parent;
            }
        }
        std::vector<Group> groups(parents.size());
        for (size_t p = 0; p < parents.size(); ++p) groups[p].node = parents[p];
        for (uint32_t i = 0; i < solved.leaves.size(); ++i) groups[solved.leaves[i].parent].members.push_back(i);
        return grow_between(std::move(groups), solved.leaves, levels);
    }

    // Pieces that were cut since `count` there were belong to whom their wholes belong. Owners: nodes or leaves.
    template <class Owner> void follow_cuts(std::vector<Owner>& owners, uint32_t count) const {
        std::vector<uint32_t> owner_of(pieces_.size(), kNobody);
        for (uint32_t n = 0; n < owners.size(); ++n)
            for (const uint32_t piece : owners[n].pieces) owner_of[piece] = n;
        for (uint32_t piece = count; piece < pieces_.size(); ++piece) {
            owner_of[piece] = owner_of[pieces_.cut_from(piece)];
            owners[owner_of[piece]].pieces.push_back(piece);
        }
    }

    // Drops nodes that own nothing, and lets each node own what its children do.
    void tidy() {
        std::vector<GrownNode>& nodes = grown_.nodes;
        if (nodes.size() == 1) {
            own_all(nodes[0]);
            return;
        }
        for (uint32_t n = static_cast<uint32_t>(nodes.size()); n-- > 1;) // children come after their parents
            nodes[nodes[n].parent].pieces.insert(nodes[nodes[n].parent].pieces.end(), nodes[n].pieces.begin(),
                                                 nodes[n].pieces.end());
        std::vector<uint32_t> renumbered(nodes.size(), kNobody);
        std::vector<GrownNode> kept;
        for (uint32_t n = 0; n < nodes.size(); ++n) {
            if (nodes[n].pieces.empty()) continue;
            renumbered[n] = static_cast<uint32_t>(kept.size());
            kept.push_back(std::move(nodes[n]));
            GrownNode& node = kept.back();
            node.child_count = 0;
            std::sort(node.pieces.begin(), node.pieces.end());
            node.parent = renumbered[node.parent];
            if (renumbered[n] == 0) continue;
            GrownNode& parent = kept[node.parent];
            if (parent.child_count++ == 0) parent.first_child = renumbered[n];
        }
        nodes.swap(kept);
    }

    // --- upwards ----------------------------------------------------------------------------------------------------

    std::vector<Leaf> solve_flat(uint32_t count, const std::function<void(double)>& progress) {
        Task task;
        task.children = count;
        task.cells = {all_cells()};
        std::vector<Leaf> leaves = solve(task, options_.effort, progress).leaves;
        halve(leaves, count, -HUGE_VAL); // the count is what was asked for
        if (leaves.size() < count) grown_.goal_reached = false;
        return leaves;
    }

    // For some of the pieces that `whole` holds: a fit of their own, or, if that sticks out more, a smaller `whole`.
    Fit part_of(const Fit& whole, std::span<const uint32_t> pieces) const {
        const Fit smaller = whole.scaled(reach_of(whole, pieces_, pieces)), own = fit_around(pieces);
        return within_caps(smaller, options_.min_radius) && outside_volume_(smaller) < outside_volume_(own) ? smaller
                                                                                                            : own;
    }

    Fit fit_around(std::span<const uint32_t> pieces) const {
        const Fit fit = as_primitive(fit_pieces(pieces_, pieces, options_.min_radius), options_.build.primitive);
        return fit.scaled(reach_of(fit, pieces_, pieces));
    }

    // The lower `count` of `items` along the longest side of their places' box, and the rest.
    template <class Place>
    static std::pair<std::vector<uint32_t>, std::vector<uint32_t>> divide(std::vector<uint32_t> items, Place&& place,
                                                                          size_t count) {
        Box box;
        for (const uint32_t item : items) box.add(place(item));
        int axis = 0;
        box.size().maxCoeff(&axis);
        std::stable_sort(items.begin(), items.end(),
                         [&](uint32_t a, uint32_t b) { return place(a)[axis] < place(b)[axis]; });
        const auto middle = items.begin() + static_cast<std::ptrdiff_t>(count);
        return {{items.begin(), middle}, {middle, items.end()}};
    }

    // How far the cover is from what was asked: above 1, not there yet.
    double excess(std::span<const Fit> fits) const {
        const BuildOptions& goal = options_.build;
        double out = 0;
        if (goal.tolerance > 0) out = outside_of(fits) / solid_volume_ / goal.tolerance;
        if (goal.distance > 0)
            out = std::max(out, solid_.distance(ellipsoids_of(fits)) / (0.01 * goal.distance * options_.diagonal));
        return out;
    }

    // The fewest leaves that meet the limits, to about a tenth: errors fall about like a power of the count.
    std::vector<Leaf> meet_limits() {
        uint32_t low = 1, count = 8; // low: known to be too few
        double low_excess = excess({&grown_.nodes[0].fit, 1});
        if (low_excess <= kMet) return {};
        std::vector<Leaf> best;
        for (int round = 0; round < kRounds; ++round) {
            const uint32_t piece_count = pieces_.size();
            std::vector<Leaf> leaves = solve_flat(count, [&](double part) { report((round + part) / kRounds); });
            if (!best.empty()) follow_cuts(best, piece_count);
            const double now = excess(fits_of(leaves)), most = static_cast<double>(best.size()); // 0: unknown
            const bool met = now <= kMet;
            if (met) {
                best = std::move(leaves);
                if (count <= low * kCountTolerance + 1) return best;
            } else if (count == kMaxLeaves || leaves.size() < count ||
                       (!best.empty() && count * kCountTolerance >= most)) {
                if (!best.empty()) return best;
                grown_.goal_reached = false;
                return leaves;
            }
            const double steepness =
                std::clamp(std::log(low_excess / now) / std::log(static_cast<double>(count) / low), 0.4, 1.5);
            if (!met) low = count, low_excess = now;
            const double guess = low * std::pow(low_excess / (0.97 * kMet), 1 / steepness);
            const double limit =
                best.empty() ? std::min<double>(kMaxLeaves, low * 8.0) : static_cast<double>(best.size()) - 1;
            count = static_cast<uint32_t>(std::clamp(std::ceil(guess), low + 1.0, std::max(low + 1.0, limit)));
        }
        if (best.empty()) grown_.goal_reached = false;
        return best;
    }

    // A tree over `leaves`, about as high as the degree needs.
    void grow_upwards(const std::vector<Leaf>& leaves) {
        if (leaves.size() < 2) return;
        std::vector<Group> root(1);
        root[0].members.resize(leaves.size());
        std::iota(root[0].members.begin(), root[0].members.end(), 0u);
        grow_between(std::move(root), leaves, 0);
    }

    // Some leaves that are to be below a node.
    struct Group {
        uint32_t node = 0;
        std::vector<uint32_t> members; // rising
    };

    // Makes nodes of `leaves`, below those of their groups, whose pieces become theirs, and of the groups between:
    // those merge that fit together best. The leaves are at most `levels` below; 0: as many as it takes. Returns their
    // nodes.
    std::vector<uint32_t> grow_between(std::vector<Group> groups, const std::vector<Leaf>& leaves, uint32_t levels) {
        std::vector<Sketch> sketches(leaves.size());
        std::vector<Fit> fits;
        std::vector<std::vector<uint32_t>> touching;
        if (levels != 1) {
            for (size_t i = 0; i < leaves.size(); ++i) {
                for (const uint32_t piece : leaves[i].pieces) sketches[i].add(pieces_.points(piece));
                fits.push_back(leaves[i].fit);
            }
            touching = neighbours_of(fits, 1);
        }
        for (const Group& group : groups) grown_.nodes[group.node].pieces.clear();
        std::vector<uint32_t> made;
        for (uint32_t left = levels; !groups.empty(); --left) { // breadth-first: children of a node are consecutive
            std::vector<std::vector<std::vector<uint32_t>>> parts(groups.size());
            const size_t most = levels == 0 ? 0 : static_cast<size_t>(std::min(most_nodes(left - 1), 0x1p32));
            parallel_for(size_t{0}, groups.size(),
                         [&](size_t g) { parts[g] = parts_of(groups[g].members, most, fits, sketches, touching); });
            std::vector<Group> next;
            uint32_t level = 0;
            for (size_t g = 0; g < groups.size(); ++g) {
                const uint32_t parent = groups[g].node;
                level = grown_.nodes[parent].level + 1;
                grown_.nodes[parent].first_child = static_cast<uint32_t>(grown_.nodes.size());
                grown_.nodes[parent].child_count = static_cast<uint32_t>(parts[g].size());
                for (std::vector<uint32_t>& part : parts[g]) {
                    const auto index = static_cast<uint32_t>(grown_.nodes.size());
                    GrownNode node;
                    node.level = level;
                    node.parent = parent;
                    if (part.size() == 1) {
                        node.fit = leaves[part[0]].fit;
                        node.pieces = leaves[part[0]].pieces;
                        made.push_back(index);
                    } else {
                        std::vector<uint32_t> pieces;
                        for (const uint32_t leaf : part)
                            pieces.insert(pieces.end(), leaves[leaf].pieces.begin(), leaves[leaf].pieces.end());
                        node.fit = fit_around(pieces);
                        next.push_back({index, std::move(part)});
                    }
                    grown_.nodes.push_back(std::move(node));
                }
            }
            groups.swap(next);
            if (groups.empty() && levels == 0) end_level(level);
        }
        return made;
    }

    // Some leaves in as many groups as a node has children, of at most `most` leaves each; 0: none of them much larger
    // than its share, if that can be.
    std::vector<std::vector<uint32_t>> parts_of(const std::vector<uint32_t>& members, size_t most,
                                                std::span<const Fit> fits, std::span<const Sketch> sketches,
                                                std::span<const std::vector<uint32_t>> touching) const {
        const uint32_t degree = options_.build.degree;
        if (members.size() <= degree) return singly(members);
        const std::vector<std::vector<uint32_t>> units = halved(members, fits, std::min(members.size(), kMostUnits));
        std::vector<Sketch> own(units.size());
        std::map<uint32_t, uint32_t> unit_of; // of each leaf
        for (uint32_t unit = 0; unit < units.size(); ++unit)
            for (const uint32_t leaf : units[unit]) own[unit].add(sketches[leaf]), unit_of[leaf] = unit;
        std::vector<std::vector<uint32_t>> neighbours(units.size());
        for (const auto& [leaf, unit] : unit_of)
            for (const uint32_t other : touching[leaf])
                if (const auto found = unit_of.find(other); found != unit_of.end() && found->second != unit)
                    neighbours[unit].push_back(found->second);

        const double share = std::min(kMostShare / degree, kMostShareOfAll) * static_cast<double>(units.size());
        const size_t most_units =
            most ? std::max<size_t>(1, most * units.size() / members.size()) : static_cast<size_t>(std::ceil(share));
        std::vector<std::vector<uint32_t>> parts;
        for (const std::vector<uint32_t>& group :
             merge_groups(own, neighbours, degree, most_units, options_.min_radius, outside_volume_)) {
            std::vector<uint32_t>& part = parts.emplace_back();
            for (const uint32_t unit : group) part.insert(part.end(), units[unit].begin(), units[unit].end());
            std::sort(part.begin(), part.end());
        }
        const auto too_large = [&](const std::vector<uint32_t>& part) { return most && part.size() > most; };
        // Merging gets stuck where all are nearly full. Equal shares fit.
        return std::ranges::any_of(parts, too_large) ? halved(members, fits, degree) : parts;
    }

    static std::vector<std::vector<uint32_t>> singly(const std::vector<uint32_t>& leaves) {
        std::vector<std::vector<uint32_t>> out;
        out.reserve(leaves.size());
        for (const uint32_t leaf : leaves) out.push_back({leaf});
        return out;
    }

    // Leaves in `count` units of about the same size, by place.
    static std::vector<std::vector<uint32_t>> halved(const std::vector<uint32_t>& leaves, std::span<const Fit> fits,
                                                     size_t count) {
        if (count == 1) return {leaves};
        const auto [low, high] = divide(
            leaves, [&](uint32_t leaf) { return fits[leaf].center; }, leaves.size() * (count / 2) / count);
        std::vector<std::vector<uint32_t>> out = halved(low, fits, count / 2);
        for (std::vector<uint32_t>& unit : halved(high, fits, count - count / 2)) out.push_back(std::move(unit));
        return out;
    }

    const Solid& solid_;
    Pieces& pieces_;
    const GrowOptions& options_;
    Grown grown_;
    const double solid_volume_;
    const std::function<double(const Fit&)> outside_volume_; // E_vol
    Clock::time_point started_;
    uint64_t seed_;              // of the sets
    double work_ = 1, done_ = 0; // of a tree of levels, in nodes
    std::vector<Vec> surface_;   // points of it, as even as the pieces are before they are cut at seams
    std::vector<Vec> points_;    // of these, what a descent looks at
};

} // namespace

Effort effort_of(Quality quality) {
    switch (quality) {
    case Quality::fast:
        return {64, 1, 300, 0, 4};
    case Quality::normal:
        return {96, 2, 500, 0, 8};
    case Quality::best:
        return {192, 3, 1500, 2, 12};
    }
    return effort_of(Quality::normal);
}

Grown grow(const Solid& solid, const GrowOptions& options) {
    return Grower(solid, options).run();
}

} // namespace prolate

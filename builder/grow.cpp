#include "builder/grow.hpp"

#include "builder/random.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <numeric>
#include <set>

namespace prolate {
namespace {

constexpr uint32_t kMaxLeaves = 65536;

class Grower {
public:
    Grower(const Voxels& voxels, const GrowOptions& options) : voxels_(voxels), options_(options) {}

    Grown run() {
        std::vector<uint32_t> all(voxels_.cell_count());
        std::iota(all.begin(), all.end(), 0u);
        const Fit root = fit_cells(voxels_, all, options_.split.min_radius);
        add({root, std::move(all)}, 0, 0);

        const BuildOptions& goal = options_.build;
        if (goal.ellipsoids)
            grow_to_count(goal.ellipsoids);
        else if (goal.tolerance > 0)
            grow_to_tolerance(goal.tolerance);
        else
            grow_to_level(goal.levels ? goal.levels : 3);
        return std::move(grown_);
    }

private:
    using Clock = std::chrono::steady_clock;

    bool cancelled() const { return options_.split.cancelled->load(std::memory_order_relaxed); }

    // A leaf that splitting can make finer.
    bool splittable(uint32_t leaf) const {
        const GrownNode& node = grown_.nodes[leaf];
        return node.level + 1 < kMaxLevels && node.cluster.cells.size() > 1 && !exhausted_.contains(leaf);
    }

    std::vector<uint32_t> leaves() const {
        std::vector<uint32_t> out;
        for (uint32_t i = 0; i < grown_.nodes.size(); ++i)
            if (grown_.nodes[i].child_count == 0) out.push_back(i);
        return out;
    }

    void add(Cluster cluster, uint32_t level, uint32_t parent) {
        GrownNode node;
        node.level = level;
        node.parent = parent;
        node.outside = outside_volume(cluster.fit, voxels_);
        node.surface_error = surface_error(cluster.fit, voxels_, cluster.cells);
        node.cluster = std::move(cluster);
        grown_.nodes.push_back(std::move(node));
    }

    // Splits each node of `parents` into up to degrees[i] children; `share` maps the round's progress to the whole.
    template <class Share>
    void split_all(const std::vector<uint32_t>& parents, const std::vector<uint32_t>& degrees, Share&& share) {
        const auto start = Clock::now();
        std::vector<Split> children(parents.size());
        size_t done_cells = 0, all_cells = 0;
        for (const uint32_t p : parents) all_cells += grown_.nodes[p].cluster.cells.size();
        auto made = static_cast<uint32_t>(grown_.nodes.size());
        std::mutex reporting;
        // Largest first, so that the last one running is small.
        std::vector<size_t> order(parents.size());
        std::iota(order.begin(), order.end(), size_t{0});
        std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
            return grown_.nodes[parents[a]].cluster.cells.size() > grown_.nodes[parents[b]].cluster.cells.size();
        });
        tbb::parallel_for(
            tbb::blocked_range<size_t>(0, order.size(), 1),
            [&](const tbb::blocked_range<size_t>& range) {
                for (size_t o = range.begin(); o != range.end(); ++o) {
                    if (cancelled()) return;
                    const size_t i = order[o];
                    const std::vector<uint32_t>& cells = grown_.nodes[parents[i]].cluster.cells;
                    SplitOptions own = options_.split;
                    own.seed = Random(own.seed + parents[i]).bits();
                    // At the root a bad start costs most, and it has all the threads.
                    if (parents.size() > 1) own.starts = (own.starts + 1) / 2;
                    const auto report = [&](double part_of_this) {
                        if (!options_.progress) return;
                        const std::lock_guard lock(reporting);
                        const double part =
                            static_cast<double>(done_cells) + part_of_this * static_cast<double>(cells.size());
                        options_.progress(share(part / static_cast<double>(all_cells)), made);
                    };
                    own.progress = report;
                    children[i] = split(voxels_, cells, degrees[i], own);
                    {
                        const std::lock_guard lock(reporting);
                        done_cells += cells.size(), made += static_cast<uint32_t>(children[i].clusters.size());
                    }
                    report(0);
                }
            },
            tbb::simple_partitioner());
        if (cancelled()) return;
        uint32_t deepest = 0;
        for (size_t i = 0; i < parents.size(); ++i) {
            // Nothing gained, as for a ball: stays a leaf and is not tried again - unless the count is all that
            // matters.
            const Split& split = children[i];
            const bool gains = split.outside < grown_.nodes[parents[i]].outside || options_.build.ellipsoids > 0;
            if (split.clusters.size() < 2 || !gains) {
                exhausted_.insert(parents[i]);
                continue;
            }
            const uint32_t level = grown_.nodes[parents[i]].level + 1;
            grown_.nodes[parents[i]].first_child = static_cast<uint32_t>(grown_.nodes.size());
            grown_.nodes[parents[i]].child_count = static_cast<uint32_t>(split.clusters.size());
            for (Cluster& child : children[i].clusters) add(std::move(child), level, parents[i]);
            deepest = std::max(deepest, level);
        }
        if (grown_.seconds.size() <= deepest) grown_.seconds.resize(deepest + 1);
        grown_.seconds[deepest] += std::chrono::duration<double>(Clock::now() - start).count();
    }

    void grow_to_level(uint32_t levels) {
        for (uint32_t level = 0; level < levels && !cancelled(); ++level) {
            std::vector<uint32_t> parents;
            for (const uint32_t leaf : leaves())
                if (grown_.nodes[leaf].level == level && splittable(leaf)) parents.push_back(leaf);
            if (parents.empty()) {
                grown_.goal_reached = false; // no leaf can be improved
                return;
            }
            const auto before = static_cast<uint32_t>(grown_.nodes.size());
            split_all(parents, std::vector<uint32_t>(parents.size(), options_.build.degree),
                      [&](double done) { return (level + done / 2) / levels; });
            if (level > 0) optimise_level(before, [&](double done) { return (level + 0.5 + done / 2) / levels; });
        }
    }

    // The nodes from `first` on, all of one level, once more together: now each sees the others' volume, not only its
    // siblings', and may own any cell that its parent's ellipsoid holds and its parent might have owned. That is still
    // a hierarchy: cells move with their node from one parent to another, and every ancestor covers what it is given.
    template <class Share> void optimise_level(uint32_t first, Share&& share) {
        const auto end = static_cast<uint32_t>(grown_.nodes.size());
        if (end - first < 2 || cancelled()) return;
        const auto start = Clock::now();
        std::vector<uint32_t> cells;
        std::vector<Cluster> clusters;
        for (uint32_t n = first; n < end; ++n) {
            clusters.push_back(grown_.nodes[n].cluster);
            cells.insert(cells.end(), clusters.back().cells.begin(), clusters.back().cells.end());
        }
        std::sort(cells.begin(), cells.end());
        std::map<uint32_t, std::vector<uint32_t>> by_parent;
        std::vector<Domain> domains;
        for (uint32_t n = first; n < end; ++n) {
            const auto [domain, fresh] = by_parent.try_emplace(grown_.nodes[n].parent);
            if (fresh) domain->second = held_by_ancestors(n, cells);
            domains.push_back(domain->second);
        }
        SplitOptions own = options_.split;
        own.seed = Random(own.seed + first).bits();
        own.progress = [&](double done) {
            if (options_.progress) options_.progress(share(done), end);
        };
        Split joint = optimise(voxels_, cells, clusters, domains, own);
        if (!cancelled()) replace(first, std::move(joint.clusters));
        grown_.seconds.back() += std::chrono::duration<double>(Clock::now() - start).count();
    }

    // Positions of the cells that every ancestor of `node` covers.
    std::vector<uint32_t> held_by_ancestors(uint32_t node, std::span<const uint32_t> cells) const {
        std::vector<uint32_t> out(cells.size());
        std::iota(out.begin(), out.end(), 0u);
        while (node != 0) {
            node = grown_.nodes[node].parent;
            const Cluster& ancestor = grown_.nodes[node].cluster;
            std::erase_if(out, [&](uint32_t c) {
                return !std::binary_search(ancestor.cells.begin(), ancestor.cells.end(), cells[c]) &&
                       ancestor.fit.reach(voxels_.points(cells[c])) > 1;
            });
        }
        return out;
    }

    // Gives the nodes from `first` on, all leaves of one level, new clusters, drops those without cells, and lets their
    // ancestors own what they own. Does nothing if a parent would lose all of its children.
    void replace(uint32_t first, std::vector<Cluster> clusters) {
        std::map<uint32_t, std::vector<size_t>> kept; // by parent
        for (size_t i = 0; i < clusters.size(); ++i) {
            std::vector<size_t>& children = kept[grown_.nodes[first + i].parent];
            if (!clusters[i].cells.empty()) children.push_back(i);
        }
        for (const auto& [parent, children] : kept)
            if (children.empty()) return;
        const uint32_t level = grown_.nodes[first].level;
        grown_.nodes.resize(first);
        for (const auto& [parent, children] : kept) {
            grown_.nodes[parent].first_child = static_cast<uint32_t>(grown_.nodes.size());
            grown_.nodes[parent].child_count = static_cast<uint32_t>(children.size());
            for (const size_t i : children) add(std::move(clusters[i]), level, parent);
        }
        for (uint32_t n = first; n-- > 0;) { // children come after their parents
            GrownNode& node = grown_.nodes[n];
            if (node.child_count == 0) continue;
            node.cluster.cells.clear();
            for (uint32_t c = node.first_child; c < node.first_child + node.child_count; ++c)
                node.cluster.cells.insert(node.cluster.cells.end(), grown_.nodes[c].cluster.cells.begin(),
                                          grown_.nodes[c].cluster.cells.end());
            std::sort(node.cluster.cells.begin(), node.cluster.cells.end());
        }
    }

    // The leaves that stick out most: all within a factor of 2 of the worst, so that a round has work for every thread.
    std::vector<uint32_t> worst_leaves() const {
        std::vector<uint32_t> out;
        for (const uint32_t leaf : leaves())
            if (splittable(leaf)) out.push_back(leaf);
        std::stable_sort(out.begin(), out.end(),
                         [&](uint32_t a, uint32_t b) { return grown_.nodes[a].outside > grown_.nodes[b].outside; });
        size_t keep = 0;
        while (keep < out.size() && grown_.nodes[out[keep]].outside >= 0.5 * grown_.nodes[out[0]].outside) ++keep;
        out.resize(keep);
        return out;
    }

    void grow_to_count(uint32_t count) {
        auto leaf_count = static_cast<uint32_t>(leaves().size());
        while (leaf_count < count && !cancelled()) {
            std::vector<uint32_t> parents = worst_leaves();
            if (parents.empty()) {
                grown_.goal_reached = false;
                return;
            }
            std::vector<uint32_t> degrees; // a split into d adds d - 1 leaves
            uint32_t missing = count - leaf_count;
            for (size_t i = 0; i < parents.size() && missing > 0; ++i) {
                degrees.push_back(std::min(options_.build.degree, missing + 1));
                missing -= degrees.back() - 1;
            }
            parents.resize(degrees.size());
            split_all(parents, degrees, [&](double) { return static_cast<double>(leaf_count) / count; });
            leaf_count = static_cast<uint32_t>(leaves().size());
        }
    }

    void grow_to_tolerance(double tolerance) {
        double first = 0;
        while (!cancelled()) {
            std::vector<Fit> fits;
            for (const uint32_t leaf : leaves()) fits.push_back(grown_.nodes[leaf].cluster.fit);
            const double ratio = options_.outside_ratio(fits);
            if (ratio <= tolerance) return;
            if (first == 0) first = ratio;
            const std::vector<uint32_t> parents = worst_leaves();
            if (parents.empty() || fits.size() >= kMaxLeaves) {
                grown_.goal_reached = false;
                return;
            }
            // The ratio falls about like a power of the count: its logarithm measures the way gone.
            const double gone = std::clamp(std::log(first / ratio) / std::log(first / tolerance), 0.0, 1.0);
            split_all(parents, std::vector<uint32_t>(parents.size(), options_.build.degree),
                      [&](double) { return gone; });
        }
    }

    const Voxels& voxels_;
    const GrowOptions& options_;
    Grown grown_;
    std::set<uint32_t> exhausted_; // leaves that a split could not improve
};

} // namespace

Grown grow(const Voxels& voxels, const GrowOptions& options) {
    return Grower(voxels, options).run();
}

} // namespace prolate

#include "builder/tree_above.hpp"

#include "builder/divide.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace prolate {
namespace {

// A child has at most twice its equal share of its parent's leaves, and at most two thirds of all: the two smallest of
// degree + 1 parts have less, so that parts that may merge are always found.
constexpr double kMostShare = 2, kMostShareOfAll = 2.0 / 3;
constexpr size_t kMostUnits = 512; // that merge into the groups of a node; of more leaves, some are one unit

// Some leaves that are to be below a node.
struct Group {
    uint32_t node = 0;
    std::vector<uint32_t> members; // rising
};

class TreeAbove {
public:
    TreeAbove(const FlatSet& leaves, const Pieces& pieces, const FlatSetMaker& sets, uint32_t degree, double min_radius)
        : leaves_(leaves.parts), sets_(sets), degree_(degree), min_radius_(min_radius), fits_(fits_of(leaves.parts)),
          touching_(neighbours_of(fits_, 1)), sketches_(leaves.parts.size()) {
        parallel_for(size_t{0}, leaves_.size(), [&](size_t i) {
            for (const uint32_t piece : leaves_[i].pieces) sketches_[i].add(pieces.points(piece));
        });
    }

    std::vector<GrownNode> run(const Fit& root) {
        std::vector<Group> groups(1);
        groups[0].members.resize(leaves_.size());
        std::iota(groups[0].members.begin(), groups[0].members.end(), 0u);
        nodes_.push_back({root, pieces_of(groups[0].members)});
        while (!groups.empty()) { // breadth-first: children of a node are consecutive
            std::vector<std::vector<std::vector<uint32_t>>> parts(groups.size());
            parallel_for(size_t{0}, groups.size(), [&](size_t g) { parts[g] = parts_of(groups[g].members); });
            std::vector<Group> next;
            for (size_t g = 0; g < groups.size(); ++g) {
                nodes_[groups[g].node].first_child = static_cast<uint32_t>(nodes_.size());
                nodes_[groups[g].node].child_count = static_cast<uint32_t>(parts[g].size());
                for (std::vector<uint32_t>& part : parts[g])
                    add(std::move(part), nodes_[groups[g].node].level + 1, next);
            }
            groups.swap(next);
        }
        return std::move(nodes_);
    }

private:
    void add(std::vector<uint32_t> members, uint32_t level, std::vector<Group>& groups) {
        std::vector<uint32_t> pieces = pieces_of(members);
        const Fit fit = members.size() == 1 ? fits_[members[0]] : sets_.fit_around(pieces);
        if (members.size() > 1) groups.push_back({static_cast<uint32_t>(nodes_.size()), std::move(members)});
        nodes_.push_back({fit, std::move(pieces), level});
    }

    std::vector<uint32_t> pieces_of(std::span<const uint32_t> members) const {
        std::vector<uint32_t> pieces;
        for (const uint32_t leaf : members)
            pieces.insert(pieces.end(), leaves_[leaf].pieces.begin(), leaves_[leaf].pieces.end());
        return pieces;
    }

    // Some leaves in as many groups as a node has children, none of them much larger than its share, if that can be.
    std::vector<std::vector<uint32_t>> parts_of(const std::vector<uint32_t>& members) const {
        std::vector<std::vector<uint32_t>> parts;
        if (members.size() <= degree_) {
            for (const uint32_t leaf : members) parts.push_back({leaf});
            return parts;
        }
        const std::vector<std::vector<uint32_t>> units = halved(members, std::min(members.size(), kMostUnits));
        std::vector<Sketch> own(units.size());
        std::map<uint32_t, uint32_t> unit_of; // of each leaf
        for (uint32_t unit = 0; unit < units.size(); ++unit)
            for (const uint32_t leaf : units[unit]) own[unit].add(sketches_[leaf]), unit_of[leaf] = unit;
        std::vector<std::vector<uint32_t>> neighbours(units.size());
        for (const auto& [leaf, unit] : unit_of)
            for (const uint32_t other : touching_[leaf])
                if (const auto found = unit_of.find(other); found != unit_of.end() && found->second != unit)
                    neighbours[unit].push_back(found->second);

        const double share = std::min(kMostShare / degree_, kMostShareOfAll) * static_cast<double>(units.size());
        for (const std::vector<uint32_t>& group :
             merge_groups(own, neighbours, degree_, static_cast<size_t>(std::ceil(share)), min_radius_,
                          [this](const Fit& fit) { return sets_.outside_volume(fit); })) {
            std::vector<uint32_t>& part = parts.emplace_back();
            for (const uint32_t unit : group) part.insert(part.end(), units[unit].begin(), units[unit].end());
            std::sort(part.begin(), part.end());
        }
        return parts;
    }

    // Leaves in `count` units of about the same size, by place.
    std::vector<std::vector<uint32_t>> halved(const std::vector<uint32_t>& members, size_t count) const {
        if (count == 1) return {members};
        const auto [low, high] =
            divide(members, members.size() * (count / 2) / count, [this](uint32_t leaf) { return fits_[leaf].center; });
        std::vector<std::vector<uint32_t>> out = halved(low, count / 2);
        for (std::vector<uint32_t>& unit : halved(high, count - count / 2)) out.push_back(std::move(unit));
        return out;
    }

    const std::vector<Part>& leaves_;
    const FlatSetMaker& sets_;
    const uint32_t degree_;
    const double min_radius_;
    const std::vector<Fit> fits_;
    const std::vector<std::vector<uint32_t>> touching_;
    std::vector<Sketch> sketches_; // of each leaf
    std::vector<GrownNode> nodes_;
};

} // namespace

std::vector<GrownNode> tree_above(const FlatSet& leaves, const Fit& root, const Pieces& pieces,
                                  const FlatSetMaker& sets, uint32_t degree, double min_radius) {
    return TreeAbove(leaves, pieces, sets, degree, min_radius).run(root);
}

} // namespace prolate

#include "builder/stack.hpp"

#include "builder/assignment.hpp"
#include "builder/job.hpp"

#include <Eigen/LU>

#include <cmath>
#include <numeric>

namespace prolate {
namespace {

constexpr int kRounds = 8;
// Of an ellipsoid's own extent, against where it is: more than its covariance, 1/5, as it is to be held whole.
constexpr double kExtent = 0.6;

// Of some ellipsoids: their mean and the inverse of their covariance.
struct Spread {
    Vec mean;
    Mat inverse;
    double log_det; // of the covariance: about twice the logarithm of the volume of an ellipsoid around them

    explicit Spread(std::span<const Fit* const> fits) : mean(Vec::Zero()) {
        const double share = 1 / static_cast<double>(fits.size());
        for (const Fit* fit : fits) mean += share * fit->center;
        Mat covariance = Mat::Zero();
        for (const Fit* fit : fits) {
            const Vec off = fit->center - mean;
            covariance += share * (off * off.transpose() + kExtent * fit->factor * fit->factor.transpose());
        }
        inverse = covariance.inverse();
        log_det = std::log(covariance.determinant());
    }
    // What it costs to add an ellipsoid.
    double cost(const Fit& fit) const {
        const Vec off = fit.center - mean;
        return off.dot(inverse * off) + kExtent * (inverse * fit.factor * fit.factor.transpose()).trace() + log_det;
    }
};

// A node and, of each level below its own, the parts that are to be below it.
struct Branch {
    uint32_t node;
    std::vector<std::vector<uint32_t>> below;
};

class Stack {
public:
    Stack(std::span<FlatSet> sets, uint32_t degree) : sets_(sets), degree_(degree) {}

    std::vector<GrownNode> run() {
        std::vector<Branch> branches(1);
        branches[0].node = add(0, 0);
        for (const FlatSet& set : sets_.subspan(1)) {
            std::vector<uint32_t>& all = branches[0].below.emplace_back(set.parts.size());
            std::iota(all.begin(), all.end(), 0u);
        }
        for (uint32_t level = 1; level < sets_.size(); ++level) {
            std::vector<std::vector<Branch>> shared(branches.size());
            parallel_for(size_t{0}, branches.size(), [&](size_t b) { shared[b] = share(branches[b], level); });
            std::vector<Branch> next;
            for (size_t b = 0; b < branches.size(); ++b) {
                const std::vector<uint32_t>& children = branches[b].below[0];
                nodes_[branches[b].node].first_child = static_cast<uint32_t>(nodes_.size());
                nodes_[branches[b].node].child_count = static_cast<uint32_t>(children.size());
                for (size_t c = 0; c < children.size(); ++c) {
                    shared[b][c].node = add(level, children[c]);
                    next.push_back(std::move(shared[b][c]));
                }
            }
            branches.swap(next);
        }
        return std::move(nodes_);
    }

private:
    uint32_t add(uint32_t level, uint32_t part) {
        Part& from = sets_[level].parts[part];
        nodes_.push_back({from.fit, std::move(from.pieces), level});
        return static_cast<uint32_t>(nodes_.size() - 1);
    }

    const Fit& fit(size_t level, uint32_t part) const { return sets_[level].parts[part].fit; }

    // What is below each of the branch's children, which are on `level`.
    std::vector<Branch> share(const Branch& branch, size_t level) const {
        std::vector<Branch> out;
        std::vector<Spread> spreads;
        for (const uint32_t child : branch.below[0]) spreads.emplace_back(std::vector{&fit(level, child)});
        for (int round = 0; round < kRounds && branch.below.size() > 1; ++round) {
            out = share(branch, level, spreads);
            spreads.clear();
            for (const Branch& child : out) spreads.emplace_back(all_below(child, level));
        }
        out.resize(branch.below[0].size());
        return out;
    }

    // The same with children that stand for these spreads.
    std::vector<Branch> share(const Branch& branch, size_t level, std::span<const Spread> spreads) const {
        std::vector<Branch> out(spreads.size());
        std::vector<GroupSize> sizes(spreads.size(), {1, degree_});
        for (size_t depth = 1; depth < branch.below.size(); ++depth) {
            const std::vector<uint32_t>& parts = branch.below[depth];
            const auto groups = assign(static_cast<uint32_t>(parts.size()), sizes, [&](uint32_t p, uint32_t c) {
                return spreads[c].cost(fit(level + depth, parts[p]));
            });
            for (Branch& child : out) child.below.emplace_back();
            for (size_t p = 0; p < parts.size(); ++p) out[groups[p]].below.back().push_back(parts[p]);
            for (size_t c = 0; c < out.size(); ++c) {
                const auto size = static_cast<uint32_t>(out[c].below.back().size());
                sizes[c] = {size, size * degree_};
            }
        }
        return out;
    }

    std::vector<const Fit*> all_below(const Branch& child, size_t level) const {
        std::vector<const Fit*> fits;
        for (size_t depth = 0; depth < child.below.size(); ++depth)
            for (const uint32_t part : child.below[depth]) fits.push_back(&fit(level + 1 + depth, part));
        return fits;
    }

    const std::span<FlatSet> sets_;
    const uint32_t degree_;
    std::vector<GrownNode> nodes_;
};

} // namespace

std::vector<GrownNode> stack(std::span<FlatSet> sets, uint32_t degree) {
    return Stack(sets, degree).run();
}

} // namespace prolate

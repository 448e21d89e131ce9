#include "builder/assignment.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

class Assignment {
public:
    Assignment(uint32_t count, const std::vector<GroupSize>& groups,
               const std::function<double(uint32_t, uint32_t)>& cost)
        : groups_(groups), cost_(size_t{count} * groups.size()), members_(groups.size()),
          moves_(groups.size() * groups.size()) {
        for (uint32_t thing = 0; thing < count; ++thing) {
            const auto first = cost_.begin() + static_cast<std::ptrdiff_t>(thing * groups.size());
            for (uint32_t g = 0; g < groups.size(); ++g) first[g] = cost(thing, g);
            const auto cheapest = std::min_element(first, first + static_cast<std::ptrdiff_t>(groups.size()));
            members_[static_cast<size_t>(cheapest - first)].push_back(thing);
        }
        for (uint32_t g = 0; g < groups.size(); ++g) look_at(g);
    }

    std::vector<uint32_t> run() {
        const auto size = [this](uint32_t g) { return members_[g].size(); };
        while (move_one([&](uint32_t g) { return size(g) > groups_[g].most; },
                        [&](uint32_t g) { return size(g) < groups_[g].most; })) {
        }
        while (move_one([&](uint32_t g) { return size(g) > groups_[g].least; },
                        [&](uint32_t g) { return size(g) < groups_[g].least; })) {
        }
        std::vector<uint32_t> out(cost_.size() / groups_.size());
        for (uint32_t g = 0; g < groups_.size(); ++g)
            for (const uint32_t thing : members_[g]) out[thing] = g;
        return out;
    }

private:
    struct Move { // the cheapest from one group to another
        double cost = HUGE_VAL;
        size_t position = 0; // in the first one's members
    };
    Move& move(uint32_t from, uint32_t to) { return moves_[from * groups_.size() + to]; }

    // Finds the cheapest moves out of `from`.
    void look_at(uint32_t from) {
        for (uint32_t to = 0; to < groups_.size(); ++to) move(from, to) = {};
        for (size_t position = 0; position < members_[from].size(); ++position) {
            const double* const cost = &cost_[members_[from][position] * groups_.size()];
            for (uint32_t to = 0; to < groups_.size(); ++to)
                if (const double by = cost[to] - cost[from]; by < move(from, to).cost) move(from, to) = {by, position};
        }
    }

    // Makes a group smaller that may `give` and one larger that may `take`, by the cheapest chain of moves: shortest
    // paths of at most so many steps, one step more a round (Bellman and Ford), as moves may cost less than nothing.
    // False if there is none.
    template <class Give, class Take> bool move_one(Give&& give, Take&& take) {
        checkpoint();
        const auto count = static_cast<uint32_t>(groups_.size());
        std::vector<double> length(count, HUGE_VAL);
        for (uint32_t g = 0; g < count; ++g)
            if (give(g)) length[g] = 0;
        std::vector<std::vector<uint32_t>> before; // of each round: where the last step comes from, or the group itself
        for (bool news = true; news && before.size() + 1 < count;) {
            news = false;
            std::vector<uint32_t>& from_group = before.emplace_back(count);
            std::vector<double> next = length;
            for (uint32_t to = 0; to < count; ++to) {
                from_group[to] = to;
                for (uint32_t from = 0; from < count; ++from)
                    if (const double by = length[from] + move(from, to).cost; by < next[to])
                        next[to] = by, from_group[to] = from, news = true;
            }
            length.swap(next);
        }
        uint32_t last = count;
        for (uint32_t g = 0; g < count; ++g)
            if (take(g) && length[g] < HUGE_VAL && (last == count || length[g] < length[last])) last = g;
        if (last == count) return false;
        for (size_t round = before.size(); round-- > 0;) {
            const uint32_t from = before[round][last];
            if (from != last) make(from, last);
            last = from;
        }
        return true;
    }

    void make(uint32_t from, uint32_t to) {
        const auto at = members_[from].begin() + static_cast<std::ptrdiff_t>(move(from, to).position);
        members_[to].push_back(*at);
        members_[from].erase(at);
        look_at(from), look_at(to);
    }

    const std::vector<GroupSize>& groups_;
    std::vector<double> cost_; // of each thing in each group
    std::vector<std::vector<uint32_t>> members_;
    std::vector<Move> moves_;
};

} // namespace

std::vector<uint32_t> assign(uint32_t count, const std::vector<GroupSize>& groups,
                             const std::function<double(uint32_t thing, uint32_t group)>& cost) {
    return Assignment(count, groups, cost).run();
}

} // namespace prolate

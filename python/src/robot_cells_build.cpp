// How cells are found.
#include "python/src/robot_cells.hpp"

#include <prolate/bounds.hpp>
#include <prolate/points.hpp>
#include <prolate/shapes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace prolate::python {
namespace {

constexpr size_t kLevels = 3;     // of cells below the root: 512 leaves at most
constexpr size_t kMostInner = 32; // balls

struct Range {
    std::array<float, 3> low, high;
    float length(size_t k) const { return high[k] - low[k]; }
    size_t longest() const {
        const std::array<float, 3> sides = {length(0), length(1), length(2)};
        return static_cast<size_t>(std::max_element(sides.begin(), sides.end()) - sides.begin());
    }
};

// Rounded outwards.
Cell cell_of(const Range& range) {
    Cell out{};
    for (size_t k = 0; k < 3; ++k) {
        out.center[k] = 0.5f * (range.low[k] + range.high[k]);
        const float half = std::max(range.high[k] - out.center[k], out.center[k] - range.low[k]);
        out.half[k] = half * (1 + 0x1p-22f) + 0x1p-24f * std::abs(out.center[k]);
    }
    return out;
}

CellBlock empty_block() {
    CellBlock out{};
    out.half.x = out.half.x - kInfinity, out.half.y = out.half.x, out.half.z = out.half.x;
    out.children.fill(Cells::kLeaf);
    return out;
}

void put(CellBlock& block, size_t lane, const Cell& cell) {
    block.center.x[lane] = cell.center[0], block.center.y[lane] = cell.center[1], block.center.z[lane] = cell.center[2];
    block.half.x[lane] = cell.half[0], block.half.y[lane] = cell.half[1], block.half.z[lane] = cell.half[2];
}

// How far the cell reaches from `from`.
float farthest(const Cell& cell, const std::array<float, 3>& from) {
    float squares = 0;
    for (size_t k = 0; k < 3; ++k) {
        const float side = std::abs(cell.center[k] - from[k]) + cell.half[k];
        squares += side * side;
    }
    return std::sqrt(squares) * (1 + 0x1p-20f);
}

// The cells of one tree, found by asking it.
class Carver {
public:
    Carver(const TreeView& tree, QueryContext& context) : tree_(tree), context_(context) {}

    Cells carve() {
        const Bounds box = bounds(tree_, {});
        Range range = {{box.lower.x, box.lower.y, box.lower.z}, {box.upper.x, box.upper.y, box.upper.z}};
        shrink(range);
        out_.root = cell_of(range);
        out_.first = divide(range, kLevels);
        out_.radius = 0;
        for (const Cell& leaf : leaves_) out_.radius = std::max(out_.radius, farthest(leaf, out_.root.center));
        if (leaves_.empty()) out_.radius = farthest(out_.root, out_.root.center);
        find_inner();
        return std::move(out_);
    }

private:
    bool empty(const Range& range) {
        const Cell cell = cell_of(range);
        const Box box{{{cell.center[0], cell.center[1], cell.center[2]}, {}},
                      {cell.half[0], cell.half[1], cell.half[2]}};
        return overlap(tree_, {}, box, context_).verdict == Verdict::separated;
    }

    // Takes off each side what is empty, by halves.
    void shrink(Range& range) {
        for (size_t k = 0; k < 3; ++k)
            for (const bool low : {true, false}) {
                const float whole = range.length(k);
                for (const float part : {0.5f, 0.25f, 0.125f}) {
                    Range slab = range, rest = range;
                    const float cut = low ? range.low[k] + part * whole : range.high[k] - part * whole;
                    if (!(cut > range.low[k] && cut < range.high[k])) break;
                    (low ? slab.high : slab.low)[k] = cut;
                    (low ? rest.low : rest.high)[k] = cut;
                    if (empty(slab)) range = rest;
                }
            }
    }

    // Up to eight parts of `range` that hold what is in it: the largest is halved as long as there is room.
    std::vector<Range> parts_of(const Range& range) {
        std::vector<Range> parts = {range};
        while (!parts.empty() && parts.size() < kLanes) {
            const auto longest = [](const Range& r) { return r.length(r.longest()); };
            const auto largest = std::max_element(
                parts.begin(), parts.end(), [&](const Range& a, const Range& b) { return longest(a) < longest(b); });
            Range low = *largest, high = *largest;
            const size_t k = largest->longest();
            const float middle = 0.5f * (largest->low[k] + largest->high[k]);
            if (!(middle > largest->low[k] && middle < largest->high[k])) break; // a point, but for rounding
            low.high[k] = middle, high.low[k] = middle;
            parts.erase(largest);
            for (const Range& half : {low, high})
                if (!empty(half)) parts.push_back(half);
        }
        for (Range& part : parts) shrink(part);
        return parts;
    }

    uint32_t divide(const Range& range, size_t levels) {
        const std::vector<Range> parts = parts_of(range);
        const auto block = static_cast<uint32_t>(out_.blocks.size());
        out_.blocks.push_back(empty_block());
        for (size_t lane = 0; lane < parts.size(); ++lane) {
            const Cell cell = cell_of(parts[lane]);
            put(out_.blocks[block], lane, cell);
            if (levels == 1)
                leaves_.push_back(cell);
            else {
                const uint32_t below = divide(parts[lane], levels - 1);
                out_.blocks[block].children[lane] = below;
            }
        }
        return block;
    }

    // Balls around the centers of cells that lie in the solid, deepest first, none with its center in another.
    void find_inner() {
        std::vector<Vec3> centers;
        for (const Cell& leaf : leaves_) centers.push_back({leaf.center[0], leaf.center[1], leaf.center[2]});
        std::vector<SignedDistance> found(centers.size());
        signed_distance(tree_, {}, centers, found, context_);
        std::vector<size_t> order(centers.size());
        std::iota(order.begin(), order.end(), size_t{0});
        std::stable_sort(order.begin(), order.end(),
                         [&](size_t i, size_t j) { return found[i].upper < found[j].upper; });
        std::vector<std::array<float, 4>> balls;
        for (const size_t i : order) {
            if (!(found[i].upper < 0) || found[i].verdict != Verdict::overlapping || balls.size() == kMostInner) break;
            const Vec3& c = centers[i];
            const auto holds = [&](const std::array<float, 4>& b) {
                return std::hypot(c.x - b[0], c.y - b[1], c.z - b[2]) < b[3];
            };
            if (std::none_of(balls.begin(), balls.end(), holds))
                balls.push_back({c.x, c.y, c.z, static_cast<float>(-found[i].upper) * (1 - 0x1p-20f)});
        }
        for (size_t i = 0; i < balls.size(); ++i) {
            const size_t lane = i % kLanes;
            if (lane == 0) out_.inner.push_back(BallBlock{Floats3{}, Floats{} - 1.0f});
            BallBlock& block = out_.inner.back();
            block.center.x[lane] = balls[i][0], block.center.y[lane] = balls[i][1], block.center.z[lane] = balls[i][2];
            block.radius[lane] = balls[i][3];
        }
    }

    const TreeView& tree_;
    QueryContext& context_;
    Cells out_;
    std::vector<Cell> leaves_;
};

// The cells of points, found by halving them at the median.
class PointCells {
public:
    PointCells(std::span<const Vec3> points, float radius, std::vector<uint32_t>& ids)
        : points_(points), radius_(radius), ids_(ids), order_(points.size()) {
        std::iota(order_.begin(), order_.end(), 0u);
    }

    Cells build() {
        out_.root = cell_of(range_of({0, order_.size()}));
        out_.radius = farthest(out_.root, out_.root.center);
        out_.first = divide({0, order_.size()});
        return std::move(out_);
    }

private:
    struct Part {
        size_t begin, end;
        size_t count() const { return end - begin; }
    };
    std::array<float, 3> point(size_t i) const {
        const Vec3& p = points_[order_[i]];
        return {p.x, p.y, p.z};
    }
    Range range_of(const Part& part) const {
        Range out = {point(part.begin), point(part.begin)};
        for (size_t i = part.begin; i < part.end; ++i)
            for (size_t k = 0; k < 3; ++k) {
                out.low[k] = std::min(out.low[k], point(i)[k]);
                out.high[k] = std::max(out.high[k], point(i)[k]);
            }
        for (size_t k = 0; k < 3; ++k) out.low[k] -= radius_, out.high[k] += radius_;
        return out;
    }
    Part split(Part& part) {
        const size_t k = range_of(part).longest(), middle = part.begin + part.count() / 2;
        const auto at = [&](size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
        const auto coordinate = [&](uint32_t i) {
            const Vec3& p = points_[i];
            return std::array<float, 3>{p.x, p.y, p.z}[k];
        };
        std::nth_element(at(part.begin), at(middle), at(part.end),
                         [&](uint32_t i, uint32_t j) { return coordinate(i) < coordinate(j); });
        const Part rest = {middle, part.end};
        part.end = middle;
        return rest;
    }

    uint32_t divide(const Part& whole) {
        std::vector<Part> parts = {whole};
        while (parts.size() < kLanes) {
            const auto largest = std::max_element(parts.begin(), parts.end(),
                                                  [](const Part& a, const Part& b) { return a.count() < b.count(); });
            if (largest->count() == 1) break;
            const Part rest = split(*largest);
            parts.push_back(rest);
        }
        const auto block = static_cast<uint32_t>(out_.blocks.size());
        out_.blocks.push_back(empty_block());
        ids_.resize(out_.blocks.size() * kLanes);
        for (size_t lane = 0; lane < parts.size(); ++lane) {
            put(out_.blocks[block], lane, cell_of(range_of(parts[lane])));
            if (parts[lane].count() == 1)
                ids_[kLanes * block + lane] = order_[parts[lane].begin];
            else {
                const uint32_t below = divide(parts[lane]);
                out_.blocks[block].children[lane] = below;
            }
        }
        return block;
    }

    std::span<const Vec3> points_;
    float radius_;
    std::vector<uint32_t>& ids_;
    std::vector<uint32_t> order_;
    Cells out_;
};

} // namespace

Cells cells_of(const TreeView& tree, QueryContext& context) {
    return Carver(tree, context).carve();
}

Cells cells_of_box(const std::array<double, 3>& half) {
    Cells out;
    for (size_t k = 0; k < 3; ++k) out.root.half[k] = static_cast<float>(half[k]) * (1 + 0x1p-22f);
    out.radius = farthest(out.root, out.root.center);
    return out;
}

Cells cells_of_points(std::span<const Vec3> points, float radius, std::vector<uint32_t>& ids) {
    return PointCells(points, radius, ids).build();
}

} // namespace prolate::python

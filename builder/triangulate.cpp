// Ear clipping on exact predicates.
//
// An ear is a corner whose triangle (its neighbours and itself) turns left and through whose inside no edge passes:
// then it can be cut off. Every polygon that does not cross itself has two (G. H. Meisters, Polygons have ears, 1975).
//
// Why the result is right whatever order the ears are cut in: each cut splits the winding number of the polygon's
// border into that of the ear and that of the rest. So the winding numbers of all triangles sum up to the polygon's. If
// no triangle turns right, none of these is negative; and where the polygon winds once, there is just one triangle.
//
// The coordinates are floats, so a product of two is exact in double, and the sign of a sum of six of them is found
// exactly with an expansion (J. R. Shewchuk, Adaptive precision floating-point arithmetic, 1997).
//
// A plane polygon that is turned in space is simple only up to the rounding of its corners: where two edges touch they
// may cross by that much. When no ear is left, corners on a line are cut, else the one with the least triangle; in the
// end the triangles' areas may exceed the polygon's by what rounding can explain, and not by more.
#include "builder/triangulate.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

// The sign of a sum of numbers, exactly: an expansion grows by one number after the other.
int sign_of_sum(std::span<const double> numbers) {
    std::array<double, 8> expansion{};
    size_t count = 0;
    for (double carry : numbers) {
        for (size_t i = 0; i < count; ++i) { // two-sum: `carry` and expansion[i] become their rounded sum and its error
            const double sum = carry + expansion[i], part = sum - carry;
            expansion[i] = (carry - (sum - part)) + (expansion[i] - part);
            carry = sum;
        }
        expansion[count++] = carry;
    }
    for (size_t i = count; i-- > 0;) // from the largest on
        if (expansion[i] != 0) return expansion[i] > 0 ? 1 : -1;
    return 0;
}

struct Flat {
    float x, y;
    bool operator==(const Flat&) const = default;
};

// Twice the area of a, b, c, rounded.
double area_of(const Flat& a, const Flat& b, const Flat& c) {
    return (double{b.x} - a.x) * (double{c.y} - a.y) - (double{b.y} - a.y) * (double{c.x} - a.x);
}

// 1 if a, b, c turn left, -1 if right, 0 if they lie on a line.
int turn(const Flat& a, const Flat& b, const Flat& c) {
    const double left = (double{b.x} - a.x) * (double{c.y} - a.y), right = (double{b.y} - a.y) * (double{c.x} - a.x);
    const double difference = left - right;
    constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon(); // of differences, products and difference
    if (std::abs(difference) > kRounding * (std::abs(left) + std::abs(right))) return difference > 0 ? 1 : -1;
    const std::array<double, 6> products = {double{a.x} * b.y,    -(double{a.y} * b.x), double{b.x} * c.y,
                                            -(double{b.y} * c.x), double{c.x} * a.y,    -(double{c.y} * a.x)};
    return sign_of_sum(products);
}

// Newell's normal, twice the area long, around the first corner.
std::array<double, 3> newell(std::span<const Vec3> points, std::span<const uint32_t> corners) {
    std::array<double, 3> normal{};
    const Vec3& o = points[corners[0]];
    for (size_t i = 1; i + 1 < corners.size(); ++i) {
        const Vec3 &p = points[corners[i]], &q = points[corners[i + 1]];
        const double a[3] = {double{p.x} - o.x, double{p.y} - o.y, double{p.z} - o.z};
        const double b[3] = {double{q.x} - o.x, double{q.y} - o.y, double{q.z} - o.z};
        for (size_t k = 0; k < 3; ++k) normal[k] += a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
    return normal;
}

// Twice the area by which corners, each moved to the next float, change that of the polygon, at most.
double twice_rounding(std::span<const Vec3> points, std::span<const uint32_t> corners) {
    double length = 0, largest = 0;
    for (size_t i = 0; i < corners.size(); ++i) {
        const Vec3 &p = points[corners[i]], &q = points[corners[(i + 1) % corners.size()]];
        length += std::abs(double{p.x} - q.x) + std::abs(double{p.y} - q.y) + std::abs(double{p.z} - q.z);
        largest = std::max({largest, std::abs(double{p.x}), std::abs(double{p.y}), std::abs(double{p.z})});
    }
    return 2 * length * largest * double{std::numeric_limits<float>::epsilon()};
}

class EarClipping {
public:
    // The polygon turns left. Its area is known to `rounding`.
    EarClipping(std::vector<Flat> corners, double rounding)
        : at_(std::move(corners)), count_(static_cast<uint32_t>(at_.size())), rounding_(rounding) {
        next_.resize(count_), previous_.resize(count_), alive_.assign(count_, true);
        for (uint32_t i = 0; i < count_; ++i) next_[i] = (i + 1) % count_, previous_[(i + 1) % count_] = i;
        find_obstacles();
    }

    // The triangles, as corner numbers; false if they would overlap.
    bool run(std::vector<std::array<uint32_t, 3>>& out) {
        double polygon = 0, triangles = 0;
        for (uint32_t i = 1; i + 1 < count_; ++i) polygon += area_of(at_[0], at_[i], at_[i + 1]);
        uint32_t left = count_, corner = 0;
        const auto cut = [&](uint32_t q) {
            const uint32_t p = previous_[q], r = next_[q];
            out.push_back({p, q, r});
            triangles += std::abs(area_of(at_[p], at_[q], at_[r]));
            next_[p] = r, previous_[r] = p, alive_[q] = false;
            --left;
            corner = r; // neighbours of an ear are tried later, or triangles would get thin
        };
        for (uint32_t patience = kPatience; left > 3;) {
            uint32_t tried = 0;
            while (tried < left && !is_ear(corner)) corner = next_[corner], ++tried;
            if (tried < left) {
                cut(corner);
                continue;
            }
            bool any = false;
            for (uint32_t q = corner, rest = left; rest > 0 && left > 3; --rest) {
                const uint32_t r = next_[q];
                if (turn(at_[previous_[q]], at_[q], at_[r]) == 0) cut(q), any = true;
                q = r;
            }
            if (any) continue;
            if (patience-- == 0) return false;
            cut(least_evil(corner));
        }
        cut(next_[corner]);
        return std::abs(triangles - polygon) <= 2 * rounding_;
    }

private:
    static constexpr uint32_t kMostCells = 512; // along a side
    static constexpr uint32_t kPatience = 1000; // crossings that rounding made: more are the polygon's own

    // Corners that may lie in an ear: those that do not turn left, and those that share their place with another.
    void find_obstacles() {
        std::vector<uint32_t> order(count_);
        for (uint32_t i = 0; i < count_; ++i) order[i] = i;
        std::sort(order.begin(), order.end(), [this](uint32_t a, uint32_t b) {
            return at_[a].x != at_[b].x ? at_[a].x < at_[b].x : at_[a].y < at_[b].y;
        });
        std::vector<bool> shared(count_);
        for (uint32_t i = 1; i < count_; ++i)
            if (at_[order[i]] == at_[order[i - 1]]) shared[order[i]] = shared[order[i - 1]] = true;
        std::vector<uint32_t> obstacles;
        for (uint32_t i = 0; i < count_; ++i)
            if (shared[i] || turn(at_[previous_[i]], at_[i], at_[next_[i]]) <= 0) obstacles.push_back(i);

        low_ = high_ = at_[0];
        for (const Flat& p : at_) {
            low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y)};
            high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y)};
        }
        const auto side = static_cast<uint32_t>(std::sqrt(static_cast<double>(obstacles.size())));
        cells_ = std::clamp(side, 1u, kMostCells);
        in_cell_.resize(size_t{cells_} * cells_);
        for (const uint32_t i : obstacles)
            in_cell_[size_t{cell(at_[i].x, low_.x, high_.x)} * cells_ + cell(at_[i].y, low_.y, high_.y)].push_back(i);
    }
    uint32_t cell(float x, float low, float high) const {
        const double part = (double{x} - low) / (double{high} - low) * cells_;
        return part > 0 ? std::min(static_cast<uint32_t>(std::min(part, double{kMostCells})), cells_ - 1) : 0;
    }

    bool is_ear(uint32_t q) {
        checkpoint_();
        const uint32_t p = previous_[q], r = next_[q];
        const Flat &a = at_[p], &b = at_[q], &c = at_[r];
        if (turn(a, b, c) <= 0) return false;
        const auto [x_low, x_high] = std::minmax({a.x, b.x, c.x});
        const auto [y_low, y_high] = std::minmax({a.y, b.y, c.y});
        bool is_touched = false;
        const uint32_t last_x = cell(x_high, low_.x, high_.x), last_y = cell(y_high, low_.y, high_.y);
        for (uint32_t x = cell(x_low, low_.x, high_.x); x <= last_x; ++x)
            for (uint32_t y = cell(y_low, low_.y, high_.y); y <= last_y; ++y)
                for (const uint32_t w : in_cell_[size_t{x} * cells_ + y]) {
                    if (!alive_[w] || w == p || w == q || w == r) continue;
                    const Place place = place_of(w, a, b, c);
                    if (place == Place::enters) return false;
                    is_touched |= place == Place::touches;
                }
        // Where the border comes by twice, a triangle may turn left, have nothing in it, and yet be outside.
        return !is_touched || winding((double{a.x} + b.x + c.x) / 3, (double{a.y} + b.y + c.y) / 3, q) > 0;
    }
    // Of the border that is left, around a point.
    int winding(double x, double y, uint32_t first) const {
        int number = 0;
        uint32_t i = first;
        do {
            const Flat &from = at_[i], &to = at_[next_[i]];
            if ((from.y <= y) != (to.y <= y)) {
                const double side = (double{to.x} - from.x) * (y - from.y) - (double{to.y} - from.y) * (x - from.x);
                if ((side > 0) == (to.y > from.y)) number += to.y > from.y ? 1 : -1;
            }
            i = next_[i];
        } while (i != first);
        return number;
    }
    // Does an edge at corner w pass through the inside of the triangle a, b, c? Or does it touch its border?
    enum class Place { away, touches, enters };
    Place place_of(uint32_t w, const Flat& a, const Flat& b, const Flat& c) const {
        const int ab = turn(a, b, at_[w]), bc = turn(b, c, at_[w]), ca = turn(c, a, at_[w]);
        if (ab < 0 || bc < 0 || ca < 0) return Place::away;
        if (ab > 0 && bc > 0 && ca > 0) return Place::enters;
        for (const uint32_t n :
             {previous_[w], next_[w]}) { // on the border: it does if a neighbour is on the inner side
            const bool inner = (ab > 0 || turn(a, b, at_[n]) > 0) && (bc > 0 || turn(b, c, at_[n]) > 0) &&
                               (ca > 0 || turn(c, a, at_[n]) > 0);
            if (inner) return Place::enters;
        }
        return Place::touches;
    }

    // The corner with the least triangle.
    uint32_t least_evil(uint32_t corner) const {
        uint32_t best = corner;
        double least = std::numeric_limits<double>::infinity();
        uint32_t q = corner;
        do {
            const double area = std::abs(area_of(at_[previous_[q]], at_[q], at_[next_[q]]));
            if (area < least) least = area, best = q;
            q = next_[q];
        } while (q != corner);
        return best;
    }

    const std::vector<Flat> at_;
    const uint32_t count_;
    const double rounding_;
    std::vector<uint32_t> next_, previous_;
    std::vector<bool> alive_;
    Flat low_{}, high_{};
    uint32_t cells_ = 1;
    std::vector<std::vector<uint32_t>> in_cell_; // obstacles, by place
    Checkpoints checkpoint_;
};

} // namespace

bool triangulate(std::span<const Vec3> points, std::span<const uint32_t> corners, std::vector<Triangle>& out) {
    if (corners.size() == 3) {
        out.push_back({corners[0], corners[1], corners[2]});
        return true;
    }
    const std::array<double, 3> normal = newell(points, corners);
    size_t axis = 0;
    for (size_t k = 1; k < 3; ++k)
        if (std::abs(normal[k]) > std::abs(normal[axis])) axis = k;
    std::vector<Flat> flat;
    flat.reserve(corners.size());
    for (const uint32_t corner : corners) {
        const Vec3& p = points[corner];
        const float all[3] = {p.x, p.y, p.z};
        const float x = all[(axis + 1) % 3], y = all[(axis + 2) % 3];
        flat.push_back(normal[axis] < 0 ? Flat{y, x} : Flat{x, y}); // so that it turns left
    }
    std::vector<std::array<uint32_t, 3>> found;
    found.reserve(corners.size() - 2);
    const double rounding = twice_rounding(points, corners);
    if (!EarClipping(std::move(flat), rounding).run(found)) return false;
    // Seen from where it has no area, a polygon must have none: else it is a figure of eight.
    const auto length = [](const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); };
    if (length(normal) <= rounding)
        for (const auto& [a, b, c] : found)
            if (const uint32_t t[] = {corners[a], corners[b], corners[c]}; length(newell(points, t)) > rounding)
                return false;
    for (const auto& [a, b, c] : found) out.push_back({corners[a], corners[b], corners[c]});
    return true;
}

double distance_from_flat(std::span<const Vec3> points, std::span<const uint32_t> corners) {
    const std::array<double, 3> normal = newell(points, corners);
    const double length = std::hypot(normal[0], normal[1], normal[2]);
    if (!(length > 0)) return 0;
    const auto height = [&](uint32_t corner) {
        const Vec3& p = points[corner];
        return (normal[0] * p.x + normal[1] * p.y + normal[2] * p.z) / length;
    };
    double mean = 0, largest = 0;
    for (const uint32_t corner : corners) mean += height(corner) / static_cast<double>(corners.size());
    for (const uint32_t corner : corners) largest = std::max(largest, std::abs(height(corner) - mean));
    return largest;
}

} // namespace prolate

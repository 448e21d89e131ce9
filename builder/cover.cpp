#include "builder/cover.hpp"

#include "src/power_of_two.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace prolate {
namespace {

// Rounding takes care of ellipsoids with a larger axis ratio: half a step of the center, or of a long column of the
// factor, may be a good part of their thin radius.
constexpr double kThin = 16;
constexpr int kTries = 300;         // integers above and below, for a column
constexpr double kEnough = 5e-3;    // of the volume, what rounding a column may cost: the search ends
constexpr double kWidening = 0.025; // of radii, to make up for a center that is off, if length can do more

bool is_thin(const Fit& fit) {
    return fit.factor.norm() * fit.inverse.norm() > 3 * kThin; // of Frobenius norms: 3 for a ball
}

// Integers x for which |basis (x - target)| is small: the nearest plane (Babai 1986) in a reduced basis (Lenstra,
// Lenstra and Lovasz 1982).
Vec nearest_integers(Mat basis, const Vec& target) {
    constexpr int kMostSwaps = 500;
    Mat integers = Mat::Identity(); // the columns of `basis` in terms of those given
    const Vec wanted = basis * target;
    Mat orthogonal; // Gram-Schmidt
    for (int swaps = 0; swaps < kMostSwaps; ++swaps) {
        const auto subtract = [&](int i, int j, double times) {
            basis.col(i) -= times * basis.col(j);
            integers.col(i) -= times * integers.col(j);
        };
        int unsorted = 0;
        for (int i = 0; i < 3; ++i) {
            for (int j = i; j-- > 0;)
                subtract(i, j, std::round(basis.col(i).dot(orthogonal.col(j)) / orthogonal.col(j).squaredNorm()));
            orthogonal.col(i) = basis.col(i);
            for (int j = 0; j < i; ++j)
                orthogonal.col(i) -=
                    basis.col(i).dot(orthogonal.col(j)) / orthogonal.col(j).squaredNorm() * orthogonal.col(j);
            if (i == 0) continue;
            const double before = orthogonal.col(i - 1).squaredNorm();
            const double mu = basis.col(i).dot(orthogonal.col(i - 1)) / before;
            if (orthogonal.col(i).squaredNorm() < (0.75 - mu * mu) * before) {
                unsorted = i;
                break;
            }
        }
        if (unsorted == 0) break;
        basis.col(unsorted).swap(basis.col(unsorted - 1));
        integers.col(unsorted).swap(integers.col(unsorted - 1));
    }
    Vec left = wanted, out = Vec::Zero();
    for (int i = 3; i-- > 0;) {
        const double times = std::round(left.dot(orthogonal.col(i)) / orthogonal.col(i).squaredNorm());
        left -= times * basis.col(i);
        out += times * integers.col(i);
    }
    return out;
}

// An ellipsoid about a lattice point, one that lies well for the thin axes of `fit`, in place of it. It is longer along
// the way that the center went, as far as that spares volume, or width, which costs more than thickness.
Fit about_lattice_point(const Fit& fit, const format::Lattice& lattice,
                        const std::function<double(const Fit&)>& reach_of) {
    const double step = power_of_two(lattice.step_exponent);
    const Vec origin(lattice.origin[0], lattice.origin[1], lattice.origin[2]);
    Vec unit; // steps
    for (int i = 0; i < 3; ++i) unit[i] = power_of_two(-format::fraction_bits(lattice.origin[i]));
    const Vec q = unit.asDiagonal() * nearest_integers(step * fit.inverse * unit.asDiagonal(),
                                                       (fit.center / step - origin).cwiseQuotient(unit));
    if ((q.array() < 0).any() || (q.array() > UINT16_MAX).any()) return fit;
    const Vec center = step * (origin + q), way = fit.center - center;
    const double off = std::sqrt(fit.radial_squared(center));
    Fit best(center, fit.factor);
    if (off < kSlack) return best;
    const double widest = (1 + kWidening) * reach_of(fit);
    double reach = reach_of(best);
    for (const double times : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}) {
        const double length = 1 + times * off;
        const Fit longer(center, cholesky(fit.factor * fit.factor.transpose() +
                                          (length * length - 1) / (off * off) * way * way.transpose()));
        const double own = reach_of(longer);
        if (reach > widest ? own < reach : own <= widest && longer.volume() * std::pow(own / reach, 3) < best.volume())
            best = longer, reach = own;
    }
    return best;
}

// Rounds column c of the factor again. A longer or shorter column does little harm, one that points elsewhere may tilt
// a sheet by more than it is thick: of the integers around that of the largest entry, the one is taken for which the
// others' roundings do least.
void round_column(format::PackedNode& node, const Fit& fit, int c) {
    const Vec target = fit.factor.col(c);
    int pivot = c;
    for (int r = c + 1; r < 3; ++r)
        if (std::abs(target[r]) > std::abs(target[pivot])) pivot = r;
    const auto first_off = static_cast<size_t>(c == 0 ? 0 : 2); // l21, l31; l32
    const auto clamped = [&](int r, int32_t q) {
        return r == c ? std::clamp(q, 1, UINT16_MAX) : std::clamp(q, INT16_MIN, INT16_MAX);
    };
    const int32_t middle = format::nearest_entry(target[pivot], node.exponent);
    double least = HUGE_VAL;
    std::array<int32_t, 3> best{};
    for (int k = 0; k <= 2 * kTries && least > kEnough; ++k) { // the nearest first
        const int32_t tried = clamped(pivot, middle + (k % 2 == 0 ? k / 2 : -(k + 1) / 2));
        const double scale = format::entry(tried, node.exponent) / target[pivot];
        std::array<int32_t, 3> q{};
        Vec rounded = Vec::Zero();
        for (int r = c; r < 3; ++r) {
            q[static_cast<size_t>(r)] =
                r == pivot ? tried : clamped(r, format::nearest_entry(scale * target[r], node.exponent));
            rounded[r] = format::entry(q[static_cast<size_t>(r)], node.exponent);
        }
        // What volume it costs: a column too long by x that much, one too short scales all three axes, and a shear by x
        // needs x / 2 more of each.
        Vec error = fit.inverse.triangularView<Eigen::Lower>() * rounded - Vec::Unit(c);
        const double along = error[c];
        error[c] = 0;
        const double cost = (along > 0 ? along : -3 * along) + 1.5 * error.norm();
        if (cost < least) least = cost, best = q;
    }
    node.diagonal[c] = static_cast<uint16_t>(best[static_cast<size_t>(c)]);
    for (int r = c + 1; r < 3; ++r)
        node.off_diagonal[first_off + static_cast<size_t>(r - c - 1)] =
            static_cast<int16_t>(best[static_cast<size_t>(r)]);
}

} // namespace

std::optional<format::PackedNode> covering_node(const Fit& given, const format::Lattice& lattice,
                                                const std::function<double(const Fit&)>& reach_of) {
    constexpr int kRounds = 64;
    const bool thin = is_thin(given);
    const Fit fit = thin ? about_lattice_point(given, lattice, reach_of) : given;
    double scale = thin ? reach_of(fit) / (1 - kSlack) : 1;
    for (int round = 0; round < kRounds; ++round) {
        const Fit wanted = fit.scaled(scale);
        const Mat& l = wanted.factor;
        const double factor[6] = {l(0, 0), l(1, 0), l(1, 1), l(2, 0), l(2, 1), l(2, 2)};
        format::PackedNode node;
        format::quantise(node, lattice, fit.center.data(), factor);
        if (thin) round_column(node, wanted, 0), round_column(node, wanted, 1);
        const Fit decoded(format::decode(node, lattice));
        const double reach = reach_of(decoded);
        if (reach <= 1 - kSlack) return node;
        // Rounding may undo a tiny enlargement: enlarge a little more each round.
        scale *= reach / (1 - kSlack) * (1 + 1e-6 * (1 << std::min(round, 12)));
    }
    return std::nullopt;
}

std::optional<format::PackedNode> covering_node(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members,
                                                const format::Lattice& lattice, double margin) {
    return covering_node(fit, lattice, [&](const Fit& decoded) {
        return reach_of(decoded, pieces, members) + radial_margin(decoded, margin);
    });
}

double radial_margin(const Fit& fit, double margin) {
    return margin * fit.inverse.norm();
}

double surface_error(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members) {
    double largest = 0;
    for (const uint32_t piece : members)
        pieces.for_each_surface_point(piece, [&](const Vec& p) {
            const double radial = std::sqrt(fit.radial_squared(p));
            // At the very center every direction is radial; the shortest way out is the smallest semi-axis.
            if (radial > 1e-12) largest = std::max(largest, std::abs(1 - 1 / radial) * (p - fit.center).norm());
        });
    return largest;
}

} // namespace prolate

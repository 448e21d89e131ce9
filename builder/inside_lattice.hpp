// Points of the solid on a lattice: the volume of a union of ellipsoids inside it, by counting.
#pragma once

#include "builder/distance_field.hpp"
#include "builder/fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

class InsideLattice {
public:
    explicit InsideLattice(const DistanceField& field);

    /// Lattice points inside the solid, by index, in raster order.
    std::span<const uint32_t> points() const { return points_; }
    Vec place(uint32_t index) const;
    /// How far the point is from the surface, metres.
    double depth(uint32_t index) const { return -double{field_.values()[index]}; }
    double pitch() const { return field_.pitch(); }

    /// Calls visit(index) for each lattice point in the ellipsoid and the solid. O(lattice lines across it + points).
    template <class Visit> void for_each_in(const Fit& ellipsoid, Visit&& visit) const {
        const auto [ni, nj, nk] = field_.size();
        const Vec half = ellipsoid.half_extents();
        const auto range = [&](int axis, int n) {
            const double at = (ellipsoid.center[axis] - field_.origin()[axis]) / field_.pitch();
            const double reach = half[axis] / field_.pitch();
            return std::pair(static_cast<int>(std::clamp(std::ceil(at - reach), 0.0, double(n))),
                             static_cast<int>(std::clamp(std::floor(at + reach), -1.0, double(n - 1))));
        };
        const auto [i0, i1] = range(0, ni);
        const auto [j0, j1] = range(1, nj);
        const Vec step = field_.pitch() * ellipsoid.inverse.col(2); // of radial coordinates, along a line
        const double a = step.squaredNorm();
        for (int i = i0; i <= i1; ++i)
            for (int j = j0; j <= j1; ++j) {
                const Vec first = ellipsoid.radial(field_.origin() + field_.pitch() * Vec(i, j, 0));
                const double b = first.dot(step), c = first.squaredNorm() - 1, square = b * b - a * c;
                if (square < 0) continue;
                const double root = std::sqrt(square);
                const int k0 = static_cast<int>(std::clamp(std::ceil((-b - root) / a), 0.0, double(nk))),
                          k1 = static_cast<int>(std::clamp(std::floor((-b + root) / a), -1.0, double(nk - 1)));
                for (int k = k0; k <= k1; ++k)
                    if (const auto index = static_cast<uint32_t>(field_.index(i, j, k)); field_.values()[index] < 0)
                        visit(index);
            }
    }

private:
    const DistanceField& field_;
    std::vector<uint32_t> points_;
};

/// How many ellipsoids hold each point. Refers to the lattice.
class Coverage {
public:
    Coverage(const InsideLattice& lattice, size_t values) : lattice_(&lattice), held_by_(values, 0) {}

    void add(const Fit& fit) {
        lattice_->for_each_in(fit, [&](uint32_t p) { ++held_by_[p]; });
    }
    void remove(const Fit& fit) {
        lattice_->for_each_in(fit, [&](uint32_t p) { --held_by_[p]; });
    }
    /// Points that it would be the first to hold.
    uint32_t gain(const Fit& fit) const {
        uint32_t out = 0;
        lattice_->for_each_in(fit, [&](uint32_t p) { out += held_by_[p] == 0; });
        return out;
    }
    bool holds(uint32_t index) const { return held_by_[index] > 0; }

private:
    const InsideLattice* lattice_;
    std::vector<uint16_t> held_by_;
};

} // namespace prolate

#include "builder/columns.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

struct Crossing {
    double z;
    int sign; // +1: going up enters (normal points down)
};

// Sign of the area of (a, b, p) in the xy-plane. The same edge gives exactly opposite values from its two triangles,
// and never zero: a point on an edge is moved by a symbolic step in +x, then +y, so that every column lies in exactly
// one of the triangles around an edge or vertex.
int side(const Vec& a, const Vec& b, double x, double y) {
    const bool swap = b.x() < a.x() || (b.x() == a.x() && b.y() < a.y());
    const Vec &p = swap ? b : a, &q = swap ? a : b;
    const double area = (q.x() - p.x()) * (y - p.y()) - (q.y() - p.y()) * (x - p.x());
    int sign = area > 0 ? 1 : area < 0 ? -1 : 0;
    if (sign == 0) sign = q.y() > p.y() ? -1 : q.y() < p.y() ? 1 : q.x() > p.x() ? 1 : -1;
    return swap ? -sign : sign;
}

// Lattice indices with low <= x0 + i * pitch <= high, one wider for safety, clamped.
std::pair<int, int> index_range(double low, double high, double x0, double pitch, int n) {
    const double first = std::floor((low - x0) / pitch), last = std::ceil((high - x0) / pitch);
    return {static_cast<int>(std::clamp(first, 0.0, double(n))), static_cast<int>(std::clamp(last, -1.0, n - 1.0))};
}

template <class Visit> void for_each_crossing(MeshView mesh, const ColumnLattice& lattice, Visit&& visit) {
    for (const Triangle& t : mesh.triangles) {
        const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
        const auto [i0, i1] = index_range(std::min({a.x(), b.x(), c.x()}), std::max({a.x(), b.x(), c.x()}), lattice.x0,
                                          lattice.dx, lattice.nx);
        const auto [j0, j1] = index_range(std::min({a.y(), b.y(), c.y()}), std::max({a.y(), b.y(), c.y()}), lattice.y0,
                                          lattice.dy, lattice.ny);
        const double area = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
        const double z_low = std::min({a.z(), b.z(), c.z()}), z_high = std::max({a.z(), b.z(), c.z()});
        for (int i = i0; i <= i1; ++i)
            for (int j = j0; j <= j1; ++j) {
                const double x = lattice.x0 + i * lattice.dx, y = lattice.y0 + j * lattice.dy;
                const int s = side(a, b, x, y);
                if (side(b, c, x, y) != s || side(c, a, x, y) != s) continue;
                double z = z_low;
                if (area != 0) {
                    const double u = ((x - a.x()) * (c.y() - a.y()) - (y - a.y()) * (c.x() - a.x())) / area;
                    const double v = ((b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x())) / area;
                    z = std::clamp(a.z() + u * (b.z() - a.z()) + v * (c.z() - a.z()), z_low, z_high);
                }
                // Counter-clockwise from above: the normal points up, so that a ray going up leaves here.
                visit(static_cast<size_t>(i) * static_cast<size_t>(lattice.ny) + static_cast<size_t>(j),
                      Crossing{z, -s});
            }
    }
}

} // namespace

Columns::Columns(MeshView mesh, bool closed, const Winding& winding, const ColumnLattice& lattice) : lattice_(lattice) {
    // Crossings of all columns, in one array, by counting first.
    const size_t count = static_cast<size_t>(lattice.nx) * static_cast<size_t>(lattice.ny);
    std::vector<size_t> crossing_begin(count + 1, 0);
    for_each_crossing(mesh, lattice, [&](size_t column, const Crossing&) { ++crossing_begin[column + 1]; });
    for (size_t c = 0; c < count; ++c) crossing_begin[c + 1] += crossing_begin[c];
    std::vector<Crossing> crossings(crossing_begin[count]);
    std::vector<size_t> fill(crossing_begin.begin(), crossing_begin.end() - 1);
    for_each_crossing(mesh, lattice,
                      [&](size_t column, const Crossing& crossing) { crossings[fill[column]++] = crossing; });

    std::vector<std::vector<Interval>> rows(static_cast<size_t>(lattice.nx));
    std::vector<size_t> interval_count(count + 1, 0);
    tbb::parallel_for(0, lattice.nx, [&](int i) {
        std::vector<Interval>& row = rows[static_cast<size_t>(i)];
        for (int j = 0; j < lattice.ny; ++j) {
            const size_t c = static_cast<size_t>(i) * static_cast<size_t>(lattice.ny) + static_cast<size_t>(j);
            const std::span<Crossing> own(crossings.data() + crossing_begin[c],
                                          crossing_begin[c + 1] - crossing_begin[c]);
            std::sort(own.begin(), own.end(),
                      [](const Crossing& s, const Crossing& t) { return s.z != t.z ? s.z < t.z : s.sign > t.sign; });
            const size_t first = row.size();
            // Signs that do not add up (an open mesh; a column within rounding of a vertex) cannot be counted.
            int depth = 0;
            for (const Crossing& crossing : own) depth += crossing.sign;
            const bool countable = closed && depth == 0;
            for (size_t k = 0; k + 1 < own.size(); ++k) {
                depth += own[k].sign;
                const double low = own[k].z, high = own[k + 1].z;
                if (!(low < high)) continue;
                bool solid = depth != 0;
                if (!countable) {
                    const Vec middle(lattice.x0 + i * lattice.dx, lattice.y0 + j * lattice.dy, 0.5 * (low + high));
                    solid = std::abs(winding(middle)) >= 0.5;
                }
                if (!solid) continue;
                if (row.size() > first && row.back().high == low)
                    row.back().high = high;
                else
                    row.push_back({low, high});
            }
            interval_count[c + 1] = row.size() - first;
        }
    });
    begin_.assign(count + 1, 0);
    for (size_t c = 0; c < count; ++c) begin_[c + 1] = begin_[c] + interval_count[c + 1];
    intervals_.reserve(begin_[count]);
    for (const std::vector<Interval>& row : rows) intervals_.insert(intervals_.end(), row.begin(), row.end());
}

double Columns::volume() const {
    double length = 0;
    for (const Interval& s : intervals_) length += s.high - s.low;
    return length * lattice_.dx * lattice_.dy;
}

CoverVolume measure_cover(MeshView mesh, bool closed, const Winding& winding, std::span<const Ellipsoid> ellipsoids,
                          int columns_across) {
    // Each ellipsoid as Q^-1 = L^-T L^-1 and its half extents in x and y.
    struct Shape {
        Vec c;
        Mat inverse; // L^-1
        double ex, ey;
    };
    std::vector<Shape> shapes;
    Box box;
    for (const Ellipsoid& e : ellipsoids) {
        Mat l;
        l << e.l11, 0, 0, e.l21, e.l22, 0, e.l31, e.l32, e.l33;
        const Vec half = l.rowwise().norm();
        const Vec c = to_vec(e.center);
        const Mat inverse = l.triangularView<Eigen::Lower>().solve(Mat::Identity());
        shapes.push_back({c, inverse, half.x(), half.y()});
        box.add(c - half);
        box.add(c + half);
    }
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    const double dx = box.size().x() / columns_across, dy = box.size().y() / columns_across;
    // An irrational offset: no column of a mesh modelled on round numbers falls on its edges.
    const ColumnLattice lattice{
        box.low.x() + 0.41421356 * dx, box.low.y() + 0.73205081 * dy, dx, dy, columns_across, columns_across};
    const Columns solid(mesh, closed, winding, lattice);

    std::vector<std::vector<uint32_t>> by_row(static_cast<size_t>(lattice.nx));
    for (uint32_t s = 0; s < shapes.size(); ++s) {
        const auto [i0, i1] =
            index_range(shapes[s].c.x() - shapes[s].ex, shapes[s].c.x() + shapes[s].ex, lattice.x0, dx, lattice.nx);
        for (int i = i0; i <= i1; ++i) by_row[static_cast<size_t>(i)].push_back(s);
    }
    std::vector<CoverVolume> rows(static_cast<size_t>(lattice.nx));
    tbb::parallel_for(0, lattice.nx, [&](int i) {
        const double x = lattice.x0 + i * dx;
        std::vector<std::vector<Interval>> cover(static_cast<size_t>(lattice.ny));
        for (const uint32_t s : by_row[static_cast<size_t>(i)]) {
            const Shape& shape = shapes[s];
            const auto [j0, j1] =
                index_range(shape.c.y() - shape.ey, shape.c.y() + shape.ey, lattice.y0, dy, lattice.ny);
            for (int j = j0; j <= j1; ++j) {
                // |w + z u|^2 = 1 with u = the z-column of L^-1, w = the rest.
                const Vec w = shape.inverse.col(0) * (x - shape.c.x()) +
                              shape.inverse.col(1) * (lattice.y0 + j * dy - shape.c.y());
                const Vec u = shape.inverse.col(2);
                const double uu = u.squaredNorm(), uw = u.dot(w), discriminant = uw * uw - uu * (w.squaredNorm() - 1);
                if (discriminant <= 0) continue;
                const double root = std::sqrt(discriminant);
                cover[static_cast<size_t>(j)].push_back(
                    {shape.c.z() + (-uw - root) / uu, shape.c.z() + (-uw + root) / uu});
            }
        }
        CoverVolume& sum = rows[static_cast<size_t>(i)];
        for (int j = 0; j < lattice.ny; ++j) {
            const std::span<const Interval> inside = solid.column(i, j);
            for (const Interval& s : inside) sum.solid += s.high - s.low;
            std::vector<Interval>& own = cover[static_cast<size_t>(j)];
            std::sort(own.begin(), own.end(), [](const Interval& s, const Interval& t) { return s.low < t.low; });
            for (size_t k = 0; k < own.size();) { // maximal intervals of the union, each less the solid
                const double low = own[k].low;
                double high = own[k].high;
                for (++k; k < own.size() && own[k].low <= high; ++k) high = std::max(high, own[k].high);
                sum.whole += high - low;
                sum.outside += high - low;
                for (const Interval& s : inside)
                    sum.outside -= std::max(0.0, std::min(high, s.high) - std::max(low, s.low));
            }
        }
    });
    CoverVolume total;
    for (const CoverVolume& row : rows) { // in order: the same sum for any number of threads
        total.solid += row.solid * dx * dy;
        total.whole += row.whole * dx * dy;
        total.outside += row.outside * dx * dy;
    }
    return total;
}

} // namespace prolate

// Where vertical columns of a lattice pass a mesh's triangles.
#pragma once

#include "builder/columns.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {

/// Where a column passes the surface.
struct Crossing {
    double z;
    int sign; // +1: going up enters (normal points down)
};

/// The sign of the area of (a, b, p) in the xy-plane, for points p of a row of columns. The same edge gives exactly
/// opposite values from its two triangles, and never zero: a point on an edge is moved by a symbolic step in +x, then
/// +y, so that every column lies in exactly one of the triangles around an edge or vertex.
class Edge {
public:
    Edge(const Vec& a, const Vec& b) {
        const bool swap = b.x() < a.x() || (b.x() == a.x() && b.y() < a.y());
        const Vec &p = swap ? b : a, &q = swap ? a : b;
        x_ = p.x(), y_ = p.y(), dx_ = q.x() - p.x(), dy_ = q.y() - p.y();
        left_ = swap ? -1 : 1;
        on_ = left_ * (q.y() > p.y() ? -1 : q.y() < p.y() ? 1 : q.x() > p.x() ? 1 : -1);
    }
    void set_row(double x) { row_ = dy_ * (x - x_); }
    int side(double y) const {
        const double area = dx_ * (y - y_) - row_;
        return area > 0 ? left_ : area < 0 ? -left_ : on_;
    }

private:
    double x_, y_, dx_, dy_, row_ = 0;
    int left_, on_; // the sign where the area is above 0, and where it is 0
};

/// Lattice indices with low <= x0 + i * pitch <= high, one wider for safety, clamped.
inline std::pair<int, int> index_range(double low, double high, double x0, double pitch, int n) {
    const double first = std::floor((low - x0) / pitch), last = std::ceil((high - x0) / pitch);
    return {static_cast<int>(std::clamp(first, 0.0, double(n))), static_cast<int>(std::clamp(last, -1.0, n - 1.0))};
}

/// Calls visit(index of the column, crossing) for each; columns along y follow one another.
template <class Visit> void for_each_crossing(MeshView mesh, const ColumnLattice& lattice, Visit&& visit) {
    Checkpoints checkpoints;
    const auto corner = [&](uint32_t v) { return lattice.to_frame(to_vec(mesh.vertices[v])); };
    for (const Triangle& t : mesh.triangles) {
        checkpoints();
        const Vec a = corner(t[0]), b = corner(t[1]), c = corner(t[2]);
        const auto [i0, i1] = index_range(std::min({a.x(), b.x(), c.x()}), std::max({a.x(), b.x(), c.x()}), lattice.x0,
                                          lattice.dx, lattice.nx);
        const auto [j0, j1] = index_range(std::min({a.y(), b.y(), c.y()}), std::max({a.y(), b.y(), c.y()}), lattice.y0,
                                          lattice.dy, lattice.ny);
        const double area = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
        const double z_low = std::min({a.z(), b.z(), c.z()}), z_high = std::max({a.z(), b.z(), c.z()});
        Edge ab(a, b), bc(b, c), ca(c, a);
        for (int i = i0; i <= i1; ++i) {
            const double x = lattice.x0 + i * lattice.dx;
            ab.set_row(x), bc.set_row(x), ca.set_row(x);
            for (int j = j0; j <= j1; ++j) {
                const double y = lattice.y0 + j * lattice.dy;
                const int s = ab.side(y);
                if (bc.side(y) != s || ca.side(y) != s) continue;
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
}

} // namespace prolate

#include "builder/columns.hpp"

#include "builder/crossings.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

// The frame of measuring lattices: its x-axis runs along (golden ratio, 1), a slope far from every simple fraction.
constexpr ColumnLattice kTurned{0, 0, 1, 1, 0, 0, 0.85065080835203993, 0.52573111211913361};

// Columns that meet ellipsoids to be measured, at most: times the solid's, and so many more for each ellipsoid.
constexpr double kMostColumns = 16, kMostColumnsEach = 1 << 12;

// A sum over columns, for each of the four interleaved lattices by itself.
class Sum {
public:
    void add(int i, int j, double length) {
        part_[static_cast<size_t>(2 * (i & 1) + (j & 1))] += length;
        longest_ = std::max(longest_, std::abs(length));
    }
    void add(const Sum& other) {
        for (size_t k = 0; k < 4; ++k) part_[k] += other.part_[k];
        longest_ = std::max(longest_, other.longest_);
    }
    Quadrature times(double area) const {
        const double value = area * (part_[0] + part_[1] + part_[2] + part_[3]);
        double furthest = 0;
        for (const double part : part_) furthest = std::max(furthest, std::abs(4 * area * part - value));
        return {value, furthest + 2 * area * longest_};
    }

private:
    double part_[4] = {}, longest_ = 0;
};

// A lattice of square cells over the box, which is in the turned frame.
ColumnLattice measuring_lattice(const Box& box, int columns_across) {
    const Vec size = box.size();
    // A box without width must not ask for columns without number.
    const double pitch = std::max(std::sqrt(size.x() * size.y()), std::max(size.x(), size.y()) / 64) / columns_across;
    const auto count = [&](double length) { return static_cast<int>(std::ceil(length / pitch)) + 1; };
    ColumnLattice lattice = kTurned;
    // No point of the unbounded lattice beyond these lies in the box. Irrational offsets: on a symmetric model with a
    // symmetric lattice the four interleaved ones would agree, however wrong they are.
    constexpr double kOffsetX = 0.41421356237309515, kOffsetY = 0.73205080756887729;
    lattice.x0 = box.low.x() - kOffsetX * pitch;
    lattice.y0 = box.low.y() - kOffsetY * pitch;
    lattice.dx = lattice.dy = pitch;
    lattice.nx = count(size.x() + kOffsetX * pitch);
    lattice.ny = count(size.y() + kOffsetY * pitch);
    return lattice;
}

// Moments of intervals of columns.
class MomentSums {
public:
    MomentSums(const ColumnLattice& lattice, const Vec& origin) : lattice_(lattice), origin_(origin) {}
    void add(int i, int j, const Interval& interval, double weight) {
        const Vec foot(lattice_.x0 + i * lattice_.dx, lattice_.y0 + j * lattice_.dy, 0);
        const Vec p = lattice_.from_frame(foot) - origin_;
        const double low = interval.low - origin_.z(), high = interval.high - origin_.z(), x = p.x(), y = p.y();
        const double one = weight * (high - low), z = one * (low + high) / 2;
        const double zz = one * (low * low + low * high + high * high) / 3;
        const Monomials terms{one, x * one, y * one, z, x * x * one, y * y * one, zz, x * y * one, x * z, y * z};
        for (size_t m = 0; m < kMonomials; ++m) sums_[m].add(i, j, terms[m]);
    }
    Moments total() const {
        Moments out;
        for (size_t m = 0; m < kMonomials; ++m) out[m] = sums_[m].times(lattice_.dx * lattice_.dy);
        return out;
    }

private:
    const ColumnLattice& lattice_;
    const Vec origin_;
    std::array<Sum, kMonomials> sums_;
};

// Signs that do not (an open mesh; a column within rounding of a vertex) cannot be counted.
bool adds_up(std::span<const Crossing> column) {
    int depth = 0;
    for (const Crossing& crossing : column) depth += crossing.sign;
    return depth == 0 || column.size() < 2; // of one, there is nothing to count
}

} // namespace

Columns::Columns(MeshView mesh, bool closed, const Winding* winding, const ColumnLattice& lattice) : lattice_(lattice) {
    // Crossings of all columns, in one array.
    const size_t count = static_cast<size_t>(lattice.nx) * static_cast<size_t>(lattice.ny);
    std::vector<size_t> crossing_begin(count + 1, 0);
    std::vector<std::pair<size_t, Crossing>> found;
    for_each_crossing(mesh, lattice, [&](size_t column, const Crossing& crossing) {
        ++crossing_begin[column + 1];
        found.emplace_back(column, crossing);
    });
    for (size_t c = 0; c < count; ++c) crossing_begin[c + 1] += crossing_begin[c];
    std::vector<Crossing> crossings(found.size());
    std::vector<size_t> fill(crossing_begin.begin(), crossing_begin.end() - 1);
    for (const auto& [column, crossing] : found) crossings[fill[column]++] = crossing;
    const auto crossings_of = [&](size_t c) {
        return std::span(crossings).subspan(crossing_begin[c], crossing_begin[c + 1] - crossing_begin[c]);
    };
    std::optional<Winding> own_winding;
    for (size_t c = 0; winding == nullptr && c < count; ++c)
        if (!closed || !adds_up(crossings_of(c))) winding = &own_winding.emplace(mesh);

    std::vector<std::vector<Interval>> rows(static_cast<size_t>(lattice.nx));
    std::vector<size_t> interval_count(count + 1, 0);
    std::vector<std::vector<Excess>> excesses(static_cast<size_t>(lattice.nx));
    parallel_for(0, lattice.nx, [&](int i) {
        std::vector<Interval>& row = rows[static_cast<size_t>(i)];
        for (int j = 0; j < lattice.ny; ++j) {
            const size_t c = static_cast<size_t>(i) * static_cast<size_t>(lattice.ny) + static_cast<size_t>(j);
            const std::span<Crossing> own = crossings_of(c);
            std::sort(own.begin(), own.end(),
                      [](const Crossing& s, const Crossing& t) { return s.z != t.z ? s.z < t.z : s.sign > t.sign; });
            const size_t first = row.size();
            const bool countable = closed && adds_up(own);
            int depth = 0;
            for (size_t k = 0; k + 1 < own.size(); ++k) {
                depth += own[k].sign;
                const double low = own[k].z, high = own[k + 1].z;
                if (!(low < high)) continue;
                const Vec middle(lattice.x0 + i * lattice.dx, lattice.y0 + j * lattice.dy, 0.5 * (low + high));
                const double number = countable ? depth : (*winding)(lattice.from_frame(middle));
                if (std::abs(number) < 0.5) continue;
                if (const double excess = std::round(number) - 1; excess != 0)
                    excesses[static_cast<size_t>(i)].push_back({i, j, {low, high}, excess});
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
    for (const std::vector<Excess>& row : excesses) excess_.insert(excess_.end(), row.begin(), row.end());
    for (const auto& [i, j, interval, weight] : excess_)
        defect_ += (interval.high - interval.low) * std::abs(weight) * lattice.dx * lattice.dy;
}

Quadrature Columns::volume() const {
    Sum sum;
    for (int i = 0; i < lattice_.nx; ++i)
        for (int j = 0; j < lattice_.ny; ++j)
            for (const Interval& s : column(i, j)) sum.add(i, j, s.high - s.low);
    return sum.times(lattice_.dx * lattice_.dy);
}

Moments Columns::moments(const Vec& origin) const {
    MomentSums sums(lattice_, origin);
    for (int i = 0; i < lattice_.nx; ++i)
        for (int j = 0; j < lattice_.ny; ++j)
            for (const Interval& s : column(i, j)) sums.add(i, j, s, 1);
    return sums.total();
}

Moments Columns::excess(const Vec& origin) const {
    MomentSums sums(lattice_, origin);
    for (const auto& [i, j, interval, weight] : excess_) sums.add(i, j, interval, weight);
    return sums.total();
}

Columns measuring_columns(MeshView mesh, bool closed, const Winding* winding, int columns_across) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(kTurned.to_frame(to_vec(v)));
    return {mesh, closed, winding, measuring_lattice(box, columns_across)};
}

namespace {

// An ellipsoid in the lattice's frame, as L^-1, with the rows and columns that it meets: first ... last.
struct Shape {
    Vec c;
    Mat inverse;
    double i0, i1, j0, j1;

    double columns() const { return std::max(0.0, i1 - i0 + 1) * std::max(0.0, j1 - j0 + 1); }
};

Shape shape_on(const ColumnLattice& lattice, const Ellipsoid& e) {
    Mat l;
    l << e.l11, 0, 0, e.l21, e.l22, 0, e.l31, e.l32, e.l33;
    const Mat inverse = l.triangularView<Eigen::Lower>().solve(Mat::Identity());
    Mat turned, turned_inverse; // the columns of L, the rows of L^-1
    for (int k = 0; k < 3; ++k) {
        turned.col(k) = lattice.to_frame(l.col(k));
        turned_inverse.row(k) = lattice.to_frame(inverse.row(k)).transpose();
    }
    const Vec half = turned.rowwise().norm(), c = lattice.to_frame(to_vec(e.center));
    const auto index = [](double x, double origin, double step) { return std::floor((x - origin) / step); };
    return {c,
            turned_inverse,
            index(c.x() - half.x(), lattice.x0, lattice.dx) + 1,
            index(c.x() + half.x(), lattice.x0, lattice.dx),
            index(c.y() - half.y(), lattice.y0, lattice.dy) + 1,
            index(c.y() + half.y(), lattice.y0, lattice.dy)};
}

std::vector<Shape> shapes_on(const ColumnLattice& lattice, std::span<const Ellipsoid> ellipsoids) {
    std::vector<Shape> out;
    out.reserve(ellipsoids.size());
    for (const Ellipsoid& e : ellipsoids) out.push_back(shape_on(lattice, e));
    return out;
}

// What columns see of some ellipsoids.
struct Seen {
    Quadrature solid, whole, outside, sum, sum_outside;
};

// A row of columns, i: the shapes in it are added first.
class Row {
public:
    struct Sums {
        Sum solid, whole, outside, sum, sum_outside;
    };

    Row(const ColumnLattice& lattice, const Columns* solid, int i) : lattice_(lattice), solid_(solid), i_(i) {}

    void add(const Shape& shape) {
        // |w + z u|^2 = 1 with u = the z-column of L^-1, w = the rest.
        const Vec u = shape.inverse.col(2);
        const Vec wx = shape.inverse.col(0) * (lattice_.x0 + i_ * lattice_.dx - shape.c.x());
        const double uu = u.squaredNorm();
        for (auto j = static_cast<int>(shape.j0); j <= static_cast<int>(shape.j1); ++j) {
            const Vec w = wx + shape.inverse.col(1) * (lattice_.y0 + j * lattice_.dy - shape.c.y());
            const double uw = u.dot(w), discriminant = uw * uw - uu * (w.squaredNorm() - 1);
            if (discriminant <= 0) continue;
            const double middle = shape.c.z() - uw / uu, half = std::sqrt(discriminant) / uu;
            cover_.push_back({j, {middle - half, middle + half}});
            sums_.sum.add(i_, j, 2 * half);
            sums_.sum_outside.add(i_, j, outside(j, cover_.back().z));
        }
    }

    Sums measure() {
        for (int j = 0; j < lattice_.ny; ++j)
            for (const Interval& s : solid_in(j)) sums_.solid.add(i_, j, s.high - s.low);
        std::sort(cover_.begin(), cover_.end(),
                  [](const Piece& a, const Piece& b) { return a.j != b.j ? a.j < b.j : a.z.low < b.z.low; });
        for (size_t k = 0; k < cover_.size();) { // maximal intervals of the union
            auto [j, piece] = cover_[k];
            for (++k; k < cover_.size() && cover_[k].j == j && cover_[k].z.low <= piece.high; ++k)
                piece.high = std::max(piece.high, cover_[k].z.high);
            sums_.whole.add(i_, j, piece.high - piece.low);
            sums_.outside.add(i_, j, outside(j, piece));
        }
        return sums_;
    }

private:
    struct Piece {
        int j;
        Interval z;
    };
    std::span<const Interval> solid_in(int j) const {
        const bool known = solid_ != nullptr && i_ >= 0 && i_ < lattice_.nx && j >= 0 && j < lattice_.ny;
        return known ? solid_->column(i_, j) : std::span<const Interval>();
    }
    // What of an interval is outside the solid.
    double outside(int j, const Interval& s) const {
        double length = s.high - s.low;
        for (const Interval& t : solid_in(j))
            length -= std::max(0.0, std::min(s.high, t.high) - std::max(s.low, t.low));
        return length;
    }

    const ColumnLattice& lattice_;
    const Columns* solid_;
    int i_;
    std::vector<Piece> cover_;
    Sums sums_;
};

// All columns that meet the shapes; `solid`, of the same lattice, may be null: there is none.
Seen look(const ColumnLattice& lattice, const Columns* solid, std::span<const Shape> shapes) {
    int row_low = 0, row_high = lattice.nx - 1;
    for (const Shape& s : shapes) {
        if (s.columns() == 0) continue;
        row_low = std::min(row_low, static_cast<int>(s.i0)), row_high = std::max(row_high, static_cast<int>(s.i1));
    }
    std::vector<std::vector<uint32_t>> by_row(static_cast<size_t>(row_high - row_low + 1));
    for (uint32_t s = 0; s < shapes.size(); ++s)
        if (shapes[s].columns() > 0)
            for (auto i = static_cast<int>(shapes[s].i0); i <= static_cast<int>(shapes[s].i1); ++i)
                by_row[static_cast<size_t>(i - row_low)].push_back(s);

    std::vector<Row::Sums> rows(by_row.size());
    parallel_for(size_t{0}, rows.size(), [&](size_t r) {
        Row row(lattice, solid, static_cast<int>(r) + row_low);
        for (const uint32_t s : by_row[r]) checkpoint(), row.add(shapes[s]);
        rows[r] = row.measure();
    });
    Row::Sums all;
    for (const Row::Sums& row : rows) { // in order: the same sum for any number of threads
        all.solid.add(row.solid);
        all.whole.add(row.whole);
        all.outside.add(row.outside);
        all.sum.add(row.sum);
        all.sum_outside.add(row.sum_outside);
    }
    const double area = lattice.dx * lattice.dy;
    return {all.solid.times(area), all.whole.times(area), all.outside.times(area), all.sum.times(area),
            all.sum_outside.times(area)};
}

// `whole` less what of it is in the solid, `part` less `part_outside`.
Quadrature remainder(const Quadrature& whole, const Quadrature& part, const Quadrature& part_outside) {
    return {whole.value - (part.value - part_outside.value), whole.error + part.error + part_outside.error};
}

} // namespace

CoverVolume measure_cover(const Columns& solid, std::span<const Ellipsoid> ellipsoids) {
    ColumnLattice lattice = solid.lattice();
    std::vector<Shape> shapes = shapes_on(lattice, ellipsoids);
    double columns = 0;
    for (const Shape& s : shapes) columns += s.columns();
    const double most = kMostColumns * lattice.nx * lattice.ny + kMostColumnsEach * static_cast<double>(shapes.size());
    if (columns <= most) {
        const Seen seen = look(lattice, &solid, shapes);
        return {seen.solid, seen.whole, seen.outside, seen.sum_outside};
    }
    // They stick out of a thin solid so far that its lattice is too fine for them: then only what may be in the solid
    // is measured by it, and all of them by a coarser one.
    for (Shape& s : shapes) {
        s.i0 = std::max(s.i0, 0.0), s.i1 = std::min(s.i1, lattice.nx - 1.0);
        s.j0 = std::max(s.j0, 0.0), s.j1 = std::min(s.j1, lattice.ny - 1.0);
    }
    const Seen near = look(lattice, &solid, shapes);
    const double coarser = std::sqrt(columns / most);
    lattice.dx *= coarser, lattice.dy *= coarser;
    lattice.nx = lattice.ny = 0;
    const Seen far = look(lattice, nullptr, shapes_on(lattice, ellipsoids));
    return {near.solid, far.whole, remainder(far.whole, near.whole, near.outside),
            remainder(far.sum, near.sum, near.sum_outside)};
}

} // namespace prolate

#include "builder/prover.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr double kSmallestBox = 1e-9;          // of the mesh's size: below, the proof gives up
constexpr uint64_t kPiecesPerTask = 4'000'000; // a bound on the work at hostile trees; real ones need about 10,000
constexpr size_t kFewCandidates = 6;           // up to so many are tried in pairs

bool holds_box(const CoverNode& shape, const Box& box) {
    for (unsigned i = 0; i < 8; ++i)
        if (!shape.ellipsoid_holds(box.corner(i))) return false;
    return shape.parent == nullptr || holds_box(*shape.parent, box);
}

} // namespace

// Done with this cell? If not, it has to be cut.
bool Prover::settled(ProofCell& cell) {
    ++proof.pieces;
    suspect_.reset();
    drop_far_candidates(cell);
    if (cell.polygons.empty() && !solid_) return true; // surface mode: nothing here to cover
    for (const uint32_t c : cell.candidates)
        if (holds_box(shapes_[c], cell.box)) return true;
    if (cell.polygons.empty() && !cell.solid) { // wholly inside the solid or wholly outside
        if (!solid_->holds_corner(cell.box.corner(0))) return true;
        cell.solid = true;
    }
    Inside corner_inside;
    corner_inside.fill(cell.solid ? 1 : -1); // -1: not asked yet
    if (!cell.solid)
        for (const uint32_t c : cell.candidates)
            if (holds_piece(shapes_[c], cell, corner_inside)) return true;
    if (cell.candidates.size() <= kFewCandidates)
        for (size_t b = 1; b < cell.candidates.size(); ++b)
            for (size_t a = 0; a < b; ++a)
                if (hold_parts(shapes_[cell.candidates[a]], shapes_[cell.candidates[b]], cell, corner_inside))
                    return true;
    refute(cell);
    return !proof.covered;
}

void Prover::prove(ProofCell& cell) {
    checkpoint();
    if (settled(cell)) return;
    if (cell.box.size().maxCoeff() < kSmallestBox * size_ || proof.pieces > kPiecesPerTask) {
        give_up(cell.box.center());
        return;
    }
    std::array<ProofCell, 8> parts = cut(cell);
    cell = {}; // the memory is not needed on the way down
    for (ProofCell& part : parts) {
        prove(part);
        if (!proof.covered) return;
    }
}

std::array<ProofCell, 8> Prover::cut(const ProofCell& cell) {
    std::array<ProofCell, 8> parts;
    const Vec middle = cell.box.center();
    for (unsigned p = 0; p < 8; ++p) {
        for (int a = 0; a < 3; ++a) {
            const bool upper = p >> a & 1;
            parts[p].box.low[a] = upper ? middle[a] : cell.box.low[a];
            parts[p].box.high[a] = upper ? cell.box.high[a] : middle[a];
        }
        parts[p].candidates = cell.candidates;
        parts[p].solid = cell.solid;
    }
    Polygon x[2], y[2], z[2];
    for (const Polygon& polygon : cell.polygons) {
        split_polygon(polygon, 0, middle[0], x[0], x[1]);
        for (unsigned i = 0; i < 2; ++i) {
            if (x[i].empty()) continue;
            split_polygon(x[i], 1, middle[1], y[0], y[1]);
            for (unsigned j = 0; j < 2; ++j) {
                if (y[j].empty()) continue;
                split_polygon(y[j], 2, middle[2], z[0], z[1]);
                for (unsigned k = 0; k < 2; ++k)
                    if (!z[k].empty()) parts[i | j << 1 | k << 2].polygons.push_back(z[k]);
            }
        }
    }
    return parts;
}

bool Prover::holds_piece(const CoverNode& shape, const ProofCell& cell, Inside& corner_inside) const {
    for (const Polygon& polygon : cell.polygons)
        for (const Vec& p : polygon)
            if (!shape.ellipsoid_holds(p)) return false;
    if (!solid_) return shape.parent == nullptr || holds_piece(*shape.parent, cell, corner_inside);
    for (unsigned i = 0; i < 8; ++i) {
        const Vec corner = cell.box.corner(i);
        if (shape.ellipsoid_holds(corner)) continue;
        if (corner_inside[i] < 0) corner_inside[i] = solid_->holds_corner(corner);
        if (corner_inside[i]) return false;
    }
    return shape.parent == nullptr || holds_piece(*shape.parent, cell, corner_inside);
}

// Does `a` hold what is below, and `b` what is above the plane that is tangent, near the middle of the cell, to the
// surface of equal radial coordinates? The parts' corners are those of the cell, and where the plane cuts edges.
// A corner that they do not hold is suspect: it may be a counterexample.
bool Prover::hold_parts(const CoverNode& a, const CoverNode& b, const ProofCell& cell, Inside& corner_inside) {
    for (const Polygon& polygon : cell.polygons)
        for (const Vec& p : polygon)
            if (!a.holds(p) && !b.holds(p)) return false;
    Vec on_plane = cell.box.center(), normal;
    const Fit &fit_a = a.outermost(on_plane), &fit_b = b.outermost(on_plane);
    for (int newton = 0; newton < 3; ++newton) {
        const Vec from_a = fit_a.inverse * (on_plane - fit_a.center);
        const Vec from_b = fit_b.inverse * (on_plane - fit_b.center);
        normal = 2 * (fit_a.inverse.transpose() * from_a - fit_b.inverse.transpose() * from_b);
        if (normal.squaredNorm() == 0) return false;
        if (newton < 2) on_plane -= (from_a.squaredNorm() - from_b.squaredNorm()) / normal.squaredNorm() * normal;
    }
    const auto height = [&](const Vec& p) { return normal.dot(p - on_plane); };
    const auto holds_own = [&](const Vec& p, double h) { return (h > 0 || a.holds(p)) && (h < 0 || b.holds(p)); };
    const auto cut_of = [](const Vec& p, double h_p, const Vec& q, double h_q) -> Vec {
        return p + h_p / (h_p - h_q) * (q - p);
    };
    for (const Polygon& polygon : cell.polygons) {
        double last = height(polygon.back());
        for (size_t i = 0; i < polygon.size(); ++i) {
            const Vec &p = polygon[i], &before = polygon[i ? i - 1 : polygon.size() - 1];
            const double h = height(p);
            if (!holds_own(p, h)) return false;
            if (h * last < 0)
                if (const Vec cut = cut_of(p, h, before, last); !holds_own(cut, 0)) {
                    suspect_ = cut;
                    return false;
                }
            last = h;
        }
    }
    if (!solid_) return true;
    std::array<double, 8> heights;
    for (unsigned i = 0; i < 8; ++i) {
        const Vec corner = cell.box.corner(i);
        heights[i] = height(corner);
        if (holds_own(corner, heights[i])) continue;
        if (corner_inside[i] < 0) corner_inside[i] = solid_->holds_corner(corner);
        if (corner_inside[i]) return false;
    }
    for (unsigned i = 0; i < 8; ++i)
        for (unsigned axis = 1; axis < 8; axis <<= 1) {
            const unsigned j = i ^ axis;
            if (i > j || !(heights[i] * heights[j] < 0)) continue;
            const Vec cut = cut_of(cell.box.corner(i), heights[i], cell.box.corner(j), heights[j]);
            if (!holds_own(cut, 0) && (cell.solid || solid_->holds(cut))) return false;
        }
    return true;
}

void Prover::drop_far_candidates(ProofCell& cell) const {
    const Vec center = cell.box.center();
    const double radius = 0.5 * cell.box.size().norm();
    std::erase_if(cell.candidates, [&](uint32_t c) {
        const CoverNode& shape = shapes_[c];
        if (std::sqrt(shape.fit.radial_squared(center)) <= 1 + radius * shape.shortest_inverse) {
            const Vec gap = (center - shape.fit.center).cwiseAbs() - 0.5 * cell.box.size();
            return (gap.array() > shape.fit.half_extents().array() * (1 + 1e-9)).any();
        }
        return true;
    });
}

// A counterexample, if `p` is a point of the solid and no ellipsoid contains it, not even barely.
template <class InSolid> void Prover::refute_at(const Vec& p, const ProofCell& cell, InSolid&& in_solid) {
    const auto holds_it = [&](uint32_t c) { return shapes_[c].barely_holds(p); };
    if (holds_it(last_holder_)) return; // of points one after the other, most often the same
    for (const uint32_t c : cell.candidates)
        if (holds_it(c)) {
            last_holder_ = c;
            return;
        }
    if (!in_solid()) return;
    double nearest = HUGE_VAL;
    for (const CoverNode& shape : shapes_) nearest = std::min(nearest, shape.radial_squared(p));
    if (nearest <= 1) return;
    proof.covered = false;
    proof.has_counterexample = true;
    std::copy_n(p.data(), 3, proof.point);
    proof.depth = std::sqrt(nearest) - 1;
}

// Looks for a counterexample among the points at hand.
void Prover::refute(const ProofCell& cell) {
    if (suspect_) refute_at(*suspect_, cell, [] { return true; });
    if (!proof.covered) return;
    for (const Polygon& polygon : cell.polygons)
        for (const Vec& p : polygon) {
            refute_at(p, cell, [] { return true; });
            if (!proof.covered) return;
        }
    if (!solid_) return;
    for (unsigned i = 0; i < 9 && proof.covered; ++i) {
        const Vec p = i < 8 ? cell.box.corner(i) : cell.box.center();
        // A point that close to 1/2 lies on the surface: as good a witness as any, but 3/4 leaves no doubt.
        refute_at(p, cell, [&] {
            if (cell.solid) return true;
            return (i == 8 || solid_->holds_corner(p)) && std::abs(solid_->winding(p)) > 0.75;
        });
    }
}

void Prover::give_up(const Vec& p) {
    proof.covered = false;
    std::copy_n(p.data(), 3, proof.point);
}

} // namespace prolate

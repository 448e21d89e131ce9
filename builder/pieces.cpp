#include "builder/pieces.hpp"

#include "builder/clip.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

ColumnLattice corner_lattice(const Voxels& voxels, int parts) {
    const double step = voxels.pitch() / parts;
    return {voxels.origin().x(),          voxels.origin().y(),         step, step,
            voxels.size()[0] * parts + 1, voxels.size()[1] * parts + 1};
}

} // namespace

Pieces::Pieces(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution)
    : Pieces(mesh, closed, winding, Voxels(mesh, closed, winding, resolution)) {}

Pieces::Pieces(MeshView mesh, bool closed, const Winding& winding, const Voxels& voxels)
    : mesh_(mesh), closed_(closed), origin_(voxels.origin()), step_(voxels.pitch() / kParts),
      columns_(mesh, closed, &winding, corner_lattice(voxels, kParts)) {
    for (size_t a = 0; a < 3; ++a) buckets_[a] = (voxels.size()[a] + kBlock - 1) / kBlock;
    in_bucket_.resize(bucket_index(buckets_[0] - 1, buckets_[1] - 1, buckets_[2] - 1) + 1);
    add_voxels(voxels);
}

// Voxels at the surface one by one; wholly solid ones as the largest aligned blocks of 8, 4, 2 or 1 that there are.
void Pieces::add_voxels(const Voxels& voxels) {
    const auto solid = [&](int i, int j, int k) {
        const uint32_t cell = voxels.cell_at(i, j, k);
        return cell != Voxels::kNoCell && voxels.triangles(cell).empty() && voxels.points(cell).size() == 8;
    };
    // Of the aligned block of 2^level voxels around (i, j, k), given in blocks: is it solid throughout?
    std::array<std::vector<bool>, 4> whole;
    std::array<std::array<int, 3>, 4> extent;
    const auto at = [&](size_t level, int i, int j, int k) {
        return (static_cast<size_t>(i) * static_cast<size_t>(extent[level][1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(extent[level][2]) +
               static_cast<size_t>(k);
    };
    for (size_t level = 0; level < whole.size(); ++level) {
        for (size_t a = 0; a < 3; ++a) extent[level][a] = (voxels.size()[a] + (1 << level) - 1) >> level;
        whole[level].resize(at(level, extent[level][0] - 1, extent[level][1] - 1, extent[level][2] - 1) + 1);
        for (int i = 0; i < extent[level][0]; ++i, checkpoint())
            for (int j = 0; j < extent[level][1]; ++j)
                for (int k = 0; k < extent[level][2]; ++k) {
                    bool all = true;
                    if (level == 0)
                        all = solid(i, j, k);
                    else
                        for (int c = 0; c < 8 && all; ++c) {
                            const int ci = 2 * i + (c & 1), cj = 2 * j + (c >> 1 & 1), ck = 2 * k + (c >> 2);
                            all = ci < extent[level - 1][0] && cj < extent[level - 1][1] && ck < extent[level - 1][2] &&
                                  whole[level - 1][at(level - 1, ci, cj, ck)];
                        }
                    whole[level][at(level, i, j, k)] = all;
                }
    }
    std::vector<Vec> points;
    for (uint32_t cell = 0; cell < voxels.cell_count(); ++cell) {
        checkpoint();
        const auto& [i, j, k] = voxels.coordinates(cell);
        size_t level = 0;
        while (level + 1 < whole.size() &&
               whole[level + 1][at(level + 1, i >> (level + 1), j >> (level + 1), k >> (level + 1))])
            ++level;
        const int mask = (1 << level) - 1;
        if (level > 0 && ((i & mask) || (j & mask) || (k & mask))) continue; // its block's first voxel speaks for it
        Piece piece{
            {i * kParts, j * kParts, k * kParts}, kParts << level, 0, 0, 0, triangles_.size(), size(), Vec::Zero(), 0};
        const auto triangles = voxels.triangles(cell);
        piece.triangle_count = static_cast<uint32_t>(triangles.size());
        triangles_.insert(triangles_.end(), triangles.begin(), triangles.end());
        if (level == 0)
            points.assign(voxels.points(cell).begin(), voxels.points(cell).end());
        else
            for (points.clear(); points.size() < 8;) points.push_back(corner(piece, points.size()));
        add_points(piece, points);
        in_bucket_[bucket_of(piece)].push_back(size());
        pieces_.push_back(piece);
    }
}

Vec Pieces::corner(const Piece& piece, size_t c) const {
    return origin_ + step_ * Vec(piece.low[0] + (c & 1 ? piece.side : 0), piece.low[1] + (c & 2 ? piece.side : 0),
                                 piece.low[2] + (c & 4 ? piece.side : 0));
}

void Pieces::add_points(Piece& piece, std::vector<Vec>& points) {
    std::sort(points.begin(), points.end(), lexicographically_before);
    points.erase(std::unique(points.begin(), points.end()), points.end());
    Box box;
    for (const Vec& p : points) box.add(p);
    piece.center = box.center();
    piece.radius = 0;
    for (const Vec& p : points) piece.radius = std::max(piece.radius, (p - piece.center).norm());
    piece.first_point = points_.size();
    piece.point_count = static_cast<uint32_t>(points.size());
    points_.insert(points_.end(), points.begin(), points.end());
}

// Is the lattice corner in the closed solid?
bool Pieces::inside(const std::array<int, 3>& at) const {
    const double z = origin_.z() + step_ * at[2], tie = 1e-9 * step_;
    for (const Interval& solid : columns_.column(at[0], at[1]))
        if (solid.low - tie <= z && z <= solid.high + tie) return true;
    return false;
}

// Does the corner of a part lie between two corners of `whole` that belong to it, or is it one?
bool Pieces::between_corners(const Piece& whole, const std::array<int, 3>& at) const {
    size_t high = 0, middle = 0; // axes
    for (size_t a = 0; a < 3; ++a)
        if (const int along = at[a] - whole.low[a]; along == whole.side)
            high |= size_t{1} << a;
        else if (along > 0)
            middle |= size_t{1} << a;
    const auto first = points_.begin() + static_cast<std::ptrdiff_t>(whole.first_point);
    const auto belongs = [&](size_t c) {
        return std::binary_search(first, first + whole.point_count, corner(whole, c), lexicographically_before);
    };
    for (size_t c = 0; c < 8; ++c)
        if ((c & ~middle) == high && belongs(c) && belongs(c ^ middle)) return true;
    return false;
}

// The part of `whole` in the box from `low`, half as wide; false if there is none.
bool Pieces::cut(const Piece& whole, const std::array<int, 3>& low, Piece& part) {
    part = {low, whole.side / 2, 0, 0, 0, triangles_.size(), size(), Vec::Zero(), 0};
    std::vector<Vec> points;
    Polygon polygon, below, above;
    for (size_t t = whole.first_triangle; t < whole.first_triangle + whole.triangle_count; ++t) {
        const Triangle& triangle = mesh_.triangles[triangles_[t]];
        polygon.clear();
        for (const uint32_t v : triangle) polygon.push_back(to_vec(mesh_.vertices[v]));
        for (int a = 0; a < 3 && !polygon.empty(); ++a) {
            const int from = low[static_cast<size_t>(a)];
            split_polygon(polygon, a, origin_[a] + step_ * from, below, above);
            polygon.swap(above);
            if (polygon.empty()) break;
            split_polygon(polygon, a, origin_[a] + step_ * (from + part.side), below, above);
            polygon.swap(below);
        }
        if (polygon.empty()) continue;
        points.insert(points.end(), polygon.begin(), polygon.end());
        const uint32_t kept = triangles_[t];
        triangles_.push_back(kept);
        ++part.triangle_count;
    }
    // Of a closed mesh, all of the solid in the box; without a surface in it that is all of the box. Where an open mesh
    // fades, no surface separates inside from outside: parts must not leave the hull of the whole.
    const bool solid = whole.triangle_count == 0;
    for (size_t c = 0; c < 8; ++c) {
        const std::array<int, 3> at = {low[0] + (c & 1 ? part.side : 0), low[1] + (c & 2 ? part.side : 0),
                                       low[2] + (c & 4 ? part.side : 0)};
        if (closed_ ? solid || inside(at) : between_corners(whole, at)) points.push_back(corner(part, c));
    }
    if (points.empty()) return false;
    add_points(part, points);
    return true;
}

bool Pieces::refine(uint32_t piece) {
    checkpoint();
    const Piece whole = pieces_[piece];
    if (whole.side == 1) return false;
    bool first = true;
    for (size_t c = 0; c < 8; ++c) {
        const int half = whole.side / 2;
        Piece part;
        if (!cut(whole,
                 {whole.low[0] + (c & 1 ? half : 0), whole.low[1] + (c & 2 ? half : 0),
                  whole.low[2] + (c & 4 ? half : 0)},
                 part))
            continue;
        if (first) {
            part.cut_from = whole.cut_from;
            pieces_[piece] = part;
        } else {
            part.cut_from = piece;
            in_bucket_[bucket_of(part)].push_back(size());
            pieces_.push_back(part);
        }
        first = false;
    }
    return !first;
}

double reach_of(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members) {
    double reach = 0;
    Checkpoints checkpoints;
    for (const uint32_t piece : members) reach = std::max(reach, fit.reach(pieces.points(piece))), checkpoints();
    return reach;
}

Fit fit_pieces(const Pieces& pieces, std::span<const uint32_t> members, double min_radius) {
    Sketch sketch;
    Checkpoints checkpoints;
    for (const uint32_t piece : members) sketch.add(pieces.points(piece)), checkpoints();
    std::vector<Vec> core(sketch.points().begin(), sketch.points().end());
    std::sort(core.begin(), core.end(), lexicographically_before);
    core.erase(std::unique(core.begin(), core.end()), core.end());

    constexpr int kRounds = 6;
    Fit fit;
    double reach = 1;
    for (int round = 0; round < kRounds; ++round) {
        fit = enclosing_ellipsoid(core, min_radius, 1e-3);
        // The points that stick out most join the core, at most one per piece.
        std::vector<std::pair<double, Vec>> out;
        reach = 1;
        const double shortest_inverse = fit.inverse.norm();
        for (const uint32_t piece : members) {
            checkpoints();
            if (std::sqrt(fit.radial_squared(pieces.center(piece))) + pieces.radius(piece) * shortest_inverse <= 1)
                continue;
            double worst = 1;
            const Vec* at = nullptr;
            for (const Vec& p : pieces.points(piece))
                if (const double squared = fit.radial_squared(p); squared > worst) worst = squared, at = &p;
            if (at) out.emplace_back(std::sqrt(worst), *at), reach = std::max(reach, out.back().first);
        }
        if (reach <= 1 + 1e-3 || round + 1 == kRounds) break;
        std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
            return a.first != b.first ? a.first > b.first : lexicographically_before(a.second, b.second);
        });
        for (size_t i = 0; i < std::min<size_t>(out.size(), 12); ++i) core.push_back(out[i].second);
    }
    return fit.scaled(reach);
}

} // namespace prolate

#include "bench/peers/models.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>

namespace prolate::bench::peers {
namespace {

// In double, so that the only rounding is that of the result.
void scale_to_unit(Mesh& mesh) {
    std::array<double, 3> low, high;
    low.fill(INFINITY), high.fill(-INFINITY);
    for (const Vec3& v : mesh.vertices) {
        const std::array<double, 3> p{v.x, v.y, v.z};
        for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    }
    double squared = 0;
    for (size_t i = 0; i < 3; ++i) squared += (high[i] - low[i]) * (high[i] - low[i]);
    const double scale = 1 / std::sqrt(squared);
    const auto moved = [&](float x, size_t i) {
        return static_cast<float>(scale * (static_cast<double>(x) - (low[i] + high[i]) / 2));
    };
    for (Vec3& v : mesh.vertices) v = {moved(v.x, 0), moved(v.y, 1), moved(v.z, 2)};
}

std::optional<Model> finish(const std::string& name, Mesh mesh) {
    scale_to_unit(mesh);
    auto cleaned = clean(mesh.view());
    if (!cleaned) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), cleaned.error().what);
        return std::nullopt;
    }
    return Model{name, std::move(cleaned->mesh), cleaned->report.closed};
}

// A solid of the cells of a rectangular grid, with round holes drilled right through. Every face of a cell ends at the
// grid's own vertices, and so does the ring around a hole: hence the surface is closed without further thought.
class Part {
public:
    using Lines = std::array<std::vector<double>, 3>;
    explicit Part(Lines lines) : lines_(std::move(lines)), solid_(cells(0) * cells(1) * cells(2)) {}

    size_t cells(size_t axis) const { return lines_[axis].size() - 1; }
    void fill(std::array<size_t, 3> from, std::array<size_t, 3> to) { // `to` is past the last
        for (size_t i = from[0]; i < to[0]; ++i)
            for (size_t j = from[1]; j < to[1]; ++j)
                for (size_t k = from[2]; k < to[2]; ++k) solid_[index({i, j, k})] = true;
    }
    // A hole along `axis` through all solid cells in line with `cell`; its diameter is `share` of the cell's width.
    void drill(size_t axis, std::array<size_t, 3> cell, double share) {
        cell[axis] = 0;
        holes_.push_back({axis, cell, share});
    }

    Mesh mesh() {
        std::array<size_t, 3> cell{};
        for (cell[0] = 0; cell[0] < cells(0); ++cell[0])
            for (cell[1] = 0; cell[1] < cells(1); ++cell[1])
                for (cell[2] = 0; cell[2] < cells(2); ++cell[2])
                    if (is_solid(cell, 0, 0))
                        for (size_t axis = 0; axis < 3; ++axis)
                            for (const int side : {-1, 1})
                                if (!is_solid(cell, axis, side)) face(cell, axis, side > 0);
        return std::move(mesh_);
    }

private:
    static constexpr size_t kSegments = 48; // of a hole; a multiple of 4
    using Point = std::array<double, 3>;
    struct Hole {
        size_t axis;
        std::array<size_t, 3> cell;
        double share;
    };

    size_t index(const std::array<size_t, 3>& c) const { return (c[0] * cells(1) + c[1]) * cells(2) + c[2]; }
    bool is_solid(std::array<size_t, 3> cell, size_t axis, int step) const {
        if ((step < 0 && cell[axis] == 0) || (step > 0 && cell[axis] + 1 == cells(axis))) return false;
        cell[axis] += static_cast<size_t>(step); // wraps for -1, as unsigned arithmetic does
        return solid_[index(cell)];
    }
    const Hole* hole_of(std::array<size_t, 3> cell, size_t axis) const {
        cell[axis] = 0;
        const auto found =
            std::ranges::find_if(holes_, [&](const Hole& h) { return h.axis == axis && h.cell == cell; });
        return found == holes_.end() ? nullptr : &*found;
    }

    uint32_t vertex(const Point& p) {
        const auto [at, fresh] = vertices_.try_emplace(p, static_cast<uint32_t>(mesh_.vertices.size()));
        if (fresh)
            mesh_.vertices.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
        return at->second;
    }
    void triangle(uint32_t a, uint32_t b, uint32_t c, bool turned) {
        mesh_.triangles.push_back(turned ? Triangle{a, c, b} : Triangle{a, b, c});
    }

    // Corner q = 0 ... 3 of the face, counter-clockwise seen from the axis' positive side, at plane `level`.
    Point corner(const std::array<size_t, 3>& cell, size_t axis, double level, size_t q) const {
        const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        Point p{};
        p[axis] = level;
        p[u] = lines_[u][cell[u] + (q == 0 || q == 3 ? 1 : 0)];
        p[v] = lines_[v][cell[v] + (q < 2 ? 1 : 0)];
        return p;
    }
    Point rim(const Hole& hole, double level, size_t k) const {
        const size_t u = (hole.axis + 1) % 3, v = (hole.axis + 2) % 3;
        const auto middle = [&](size_t i) { return (lines_[i][hole.cell[i]] + lines_[i][hole.cell[i] + 1]) / 2; };
        const auto width = [&](size_t i) { return lines_[i][hole.cell[i] + 1] - lines_[i][hole.cell[i]]; };
        const double angle = 2 * std::numbers::pi * static_cast<double>(k % kSegments) / kSegments;
        const double radius = hole.share / 2 * std::min(width(u), width(v));
        Point p{};
        p[hole.axis] = level;
        p[u] = middle(u) + radius * std::cos(angle), p[v] = middle(v) + radius * std::sin(angle);
        return p;
    }

    void face(const std::array<size_t, 3>& cell, size_t axis, bool upper) {
        const double level = lines_[axis][cell[axis] + (upper ? 1 : 0)];
        std::array<uint32_t, 4> c;
        for (size_t q = 0; q < 4; ++q) c[q] = vertex(corner(cell, axis, level, q));
        const Hole* const hole = hole_of(cell, axis);
        if (hole == nullptr) {
            triangle(c[0], c[1], c[2], !upper), triangle(c[0], c[2], c[3], !upper);
            return;
        }
        std::array<uint32_t, kSegments> rims;
        for (size_t k = 0; k < kSegments; ++k) rims[k] = vertex(rim(*hole, level, k));
        for (size_t k = 0; k < kSegments; ++k) // each corner's fan to its quarter of the rim
            triangle(c[k / (kSegments / 4)], rims[(k + 1) % kSegments], rims[k], !upper);
        for (size_t q = 0; q < 4; ++q)
            triangle(c[q], c[(q + 1) % 4], rims[(q + 1) * kSegments / 4 % kSegments], !upper);
        if (upper) wall(cell, *hole, level);
    }
    void wall(std::array<size_t, 3> cell, const Hole& hole, double top) { // down to the other end of the hole
        while (is_solid(cell, hole.axis, -1)) --cell[hole.axis];
        const double bottom = lines_[hole.axis][cell[hole.axis]];
        for (size_t k = 0; k < kSegments; ++k) {
            const uint32_t a = vertex(rim(hole, bottom, k)), b = vertex(rim(hole, bottom, k + 1));
            const uint32_t d = vertex(rim(hole, top, k)), e = vertex(rim(hole, top, k + 1));
            triangle(a, e, b, false), triangle(a, d, e, false); // seen from the hole's inside
        }
    }

    Lines lines_;
    std::vector<bool> solid_;
    std::vector<Hole> holes_;
    std::map<Point, uint32_t> vertices_;
    Mesh mesh_;
};

} // namespace

std::optional<Model> load_model(const std::string& name, const std::vector<std::string>& paths) {
    const auto path = std::ranges::find_if(paths, [](const std::string& p) { return std::filesystem::exists(p); });
    if (path == paths.end()) {
        std::fprintf(stderr, "%s is skipped: there is no %s\n", name.c_str(), paths.front().c_str());
        return std::nullopt;
    }
    ImportReport report;
    auto mesh = load_mesh(path->c_str(), {}, &report);
    if (!mesh) {
        std::fprintf(stderr, "%s is skipped: %s %s\n", path->c_str(), mesh.error().what, report.detail.c_str());
        return std::nullopt;
    }
    return finish(name, std::move(*mesh));
}

Model cad_model() {
    // Millimetres: a plate of 120 x 80 x 8 with a wall of 60 at its back, two ribs between them, and two pads.
    Part part({{{0, 10, 30, 34, 50, 70, 86, 90, 110, 120}, {0, 16, 32, 48, 64, 72, 80}, {0, 8, 14, 30, 50, 60}}});
    part.fill({0, 0, 0}, {9, 6, 1});                                  // the plate
    part.fill({0, 5, 1}, {9, 6, 5});                                  // the wall
    part.fill({2, 2, 1}, {3, 5, 4}), part.fill({6, 2, 1}, {7, 5, 4}); // the ribs, 4 thick
    part.fill({2, 2, 4}, {3, 3, 4});
    part.fill({4, 1, 1}, {5, 3, 2}); // a pad
    for (const size_t i : {1u, 3u, 5u, 7u})
        for (const size_t j : {0u, 1u, 2u, 3u}) part.drill(2, {i, j, 0}, j % 2 == 0 ? 0.75 : 0.5);
    part.drill(2, {4, 1, 0}, 0.6), part.drill(2, {4, 2, 0}, 0.6); // through pad and plate
    for (const size_t i : {1u, 3u, 5u, 7u}) part.drill(1, {i, 0, 3}, 0.7);
    part.drill(1, {4, 0, 3}, 0.9);
    auto model = finish("cad", part.mesh());
    return std::move(*model);
}

} // namespace prolate::bench::peers

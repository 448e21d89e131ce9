// One level: a set of ellipsoids that covers the solid by itself (paper, Algorithm 1, steps 5 to 8).
//
// A set is optimised as a whole: start (start.hpp), descend (gradient_descent.hpp), polish (polish.hpp). It knows of no
// other level. Sets are compared by the volume of their union outside the solid. Of a mesh without an inside, that is
// all of it.
#pragma once

#include "builder/columns.hpp"
#include "builder/effort.hpp"
#include "builder/polish.hpp"
#include "builder/start.hpp"

#include <prolate/build.hpp>

#include <functional>
#include <utility>
#include <vector>

namespace prolate {

/// Everything about the solid that growing needs.
struct Solid {
    Pieces& pieces;      ///< refined along the way
    const Voxels& cells; ///< coarser: to start from
    const DistanceField& field;
    const Columns& columns; ///< to compare covers
    double area;            ///< of the surface, square metres
    /// E_vol of an ellipsoid and its gradient, in closed form; empty for the voxel method.
    std::function<EllipsoidVolume(const Fit&)> outside;
    /// One-sided Hausdorff distance of a cover, metres.
    std::function<double(std::span<const Ellipsoid>)> distance;
};

/// An ellipsoid and the pieces that it stands for: it holds them.
struct Part {
    Fit fit;
    std::vector<uint32_t> pieces;
};

/// Parts that together have all pieces.
struct FlatSet {
    std::vector<Part> parts;
    double outside = 0; ///< volume of the union outside the solid, cubic metres
    uint32_t piece_count =
        0; ///< that there were: what was cut since belongs to the part of its whole, see follow_cuts()
};

std::vector<Fit> fits_of(std::span<const Part> parts);
std::vector<Ellipsoid> ellipsoids_of(std::span<const Fit> fits);

/// Gives the parts of `set` the pieces that were cut off theirs since it was made.
void follow_cuts(FlatSet& set, const Pieces& pieces);

/// Makes flat sets. The same ones for any number of threads.
class FlatSetMaker {
public:
    /// Keeps `solid` and `options`.
    FlatSetMaker(const Solid& solid, const BuildOptions& options, const Effort& effort, double min_radius);

    /// A tight set of at most `count`: fewer where one more is worth much less than the others. Cuts pieces at seams.
    /// Where `above` is given and has several parts, each of them has an equal share of the ellipsoids to start with,
    /// and these help each other only: so they stay together, as those below a node should. Where that is much looser
    /// than a set that knows of no other, the latter is taken.
    FlatSet make(uint32_t count, const FlatSet* above, const std::function<void(double)>& progress);

    /// Halves parts until there are `count`, or none that has two pieces.
    void split(FlatSet& set, size_t count) const;

    /// The least set of one, of at least the primitive's shape.
    FlatSet single() const;

    /// An ellipsoid of the right kind around these pieces.
    Fit fit_around(std::span<const uint32_t> pieces) const;

    /// E_vol of one ellipsoid.
    double outside_volume(const Fit& fit) const;
    /// The volume of a union outside the solid.
    double outside_of(std::span<const Fit> fits) const;

private:
    struct Start {
        std::vector<Fit> fits;
        std::vector<uint32_t> family; // of each: the part of the set above; empty if there is none
        std::vector<uint32_t> owner;  // of each point: an ellipsoid near it
    };
    std::vector<std::vector<Fit>> approach(uint32_t count, const Search& search, const FlatSet* above,
                                           const std::function<void(double)>& progress) const;
    void improve_places(std::vector<Fit>& fits, const Search& search, std::span<const Vec> points,
                        const std::function<void(double)>& progress) const;
    DescentOptions descent_options(size_t count, int iterations, double kappa, int number) const;
    bool better_alone(uint32_t count, const FlatSet& above, std::span<const Vec> points, int iterations) const;
    std::vector<std::vector<Fit>> next_to(std::span<const Fit> fits, size_t most) const;
    FlatSet settle(std::vector<Fit> fits, size_t count, const Search& search);
    Start start(uint32_t count, const FlatSet* above, int number, std::span<const Vec> points) const;
    Start start_at(std::vector<Fit> fits, std::span<const Vec> points) const;
    void descend_from(Start& start, std::span<const Vec> points, int iterations, double kappa, int number,
                      const std::function<void(double)>& progress) const;
    std::vector<std::vector<uint32_t>> share_cells(std::span<const Fit> fits) const;
    std::vector<Vec> points_for(uint32_t count) const;
    std::vector<uint32_t> polish_set(std::vector<Fit>& fits, const Search& search) const;
    void halve(FlatSet& set, size_t count, double worth) const;
    std::pair<std::vector<uint32_t>, std::vector<uint32_t>> halves_of(const Part& part) const;
    Fit smaller(const Fit& whole, std::span<const uint32_t> pieces) const;
    Fit part_of(const Fit& whole, std::span<const uint32_t> pieces,
                const std::function<double(const Fit&)>& outside) const;
    CoverVolume measure(std::span<const Fit> fits) const;
    double approximate_error(std::span<const Fit> fits) const;
    Objective objective(size_t count) const;

    const Solid& solid_;
    const BuildOptions& options_;
    const Effort effort_;
    const double min_radius_, solid_volume_;
    std::vector<Vec> surface_; // points of it, as even as the pieces are before they are cut at seams
};

} // namespace prolate

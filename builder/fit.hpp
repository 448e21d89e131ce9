// Enclosing ellipsoids of point sets.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/build.hpp>

#include <span>
#include <vector>

namespace prolate {

/// Largest ratio of two semi-axes that the bake makes: nodes that need to be thinner are thicker (build.hpp). The
/// runtime's tests are right at any ratio; this is about as thin as the format's integers keep an ellipsoid's shape.
inline constexpr double kMaxAxisRatio = 1 / kThinnestNode;
/// The same while ellipsoids are guided by the distance field, which shows nothing much thinner: polish() thins them
/// out at its end.
inline constexpr double kMaxGuidedRatio = 40;

/// The ellipsoid {center + L u : |u| <= 1} while it is being fitted, L lower triangular.
struct Fit {
    Vec center = Vec::Zero();
    Mat factor = Mat::Identity();  ///< L
    Mat inverse = Mat::Identity(); ///< L^-1

    Fit() = default;
    Fit(const Vec& c, const Mat& lower);
    explicit Fit(const Ellipsoid& e);
    /// Rounded to float.
    Ellipsoid ellipsoid() const;

    /// Unit-ball coordinates L^-1 (p - center).
    Vec radial(const Vec& p) const {
        const Vec d = p - center;
        return {inverse(0, 0) * d.x(), inverse(1, 0) * d.x() + inverse(1, 1) * d.y(),
                inverse(2, 0) * d.x() + inverse(2, 1) * d.y() + inverse(2, 2) * d.z()};
    }
    /// Squared radial coordinate |L^-1 (p - center)|^2: at most 1 inside.
    double radial_squared(const Vec& p) const { return radial(p).squaredNorm(); }
    double volume() const;
    /// Half extents of the bounding box.
    Vec half_extents() const { return factor.rowwise().norm(); }
    /// The same shape, `by` times as large.
    Fit scaled(double by) const;
    /// Largest radial coordinate |L^-1 (p - center)| of the points: at most 1 means that they are covered.
    double reach(std::span<const Vec> points) const;
};

/// Lower Cholesky factor of the symmetric positive definite `q`, in a fixed order of operations.
Mat cholesky(const Mat& q);

/// Ellipsoid with the shape matrix `q` (symmetric positive definite), its axis ratio brought down to `max_ratio` and
/// its radii up to `min_radius` by lengthening short axes.
Fit capped(const Vec& center, const Mat& q, double min_radius, double max_ratio = kMaxGuidedRatio);

/// Does `fit` keep to those bounds, up to rounding? What capped() returns does.
bool within_caps(const Fit& fit, double min_radius, double max_ratio = kMaxGuidedRatio);

/// Minimum-volume ellipsoid around `points` (any number above 0, also coplanar or equal ones), capped at kMaxAxisRatio,
/// to a relative error of about `tolerance` in radius. It contains the points up to rounding. Khachiyan's algorithm
/// with away steps (Todd and Yildirim 2007). O(n) an iteration: give it a core set.
Fit enclosing_ellipsoid(std::span<const Vec> points, double min_radius, double tolerance = 1e-3);

/// Directions in which a point set is sketched: evenly spread over the sphere.
std::span<const Vec> sketch_directions();

/// Support sketch: for each sketch direction, the point farthest along it. Sketches of a union are merged by taking the
/// farther point, so that clusters can be merged without looking at their points again.
class Sketch {
public:
    Sketch() = default;
    explicit Sketch(std::span<const Vec> points) { add(points); }
    void add(std::span<const Vec> points);
    void add(const Sketch& other);
    bool empty() const { return points_.empty(); }
    /// The farthest points, one per direction, not made unique.
    std::span<const Vec> points() const { return points_; }

private:
    std::vector<Vec> points_;
    std::vector<double> heights_;
};

} // namespace prolate

#include "query/deform/pair.hpp"

#include "query/ellipsoid/gap.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

namespace prolate::query {

bool apart(const Bound& x, const Bound& y, double margin) noexcept {
    return separated(x.core, y.core, margin + x.radius + y.radius);
}

bool apart(const PlacedTriangle& x, const Bound& y, double margin) noexcept {
    const double within = margin + y.radius;
    return within > 0 ? distance(x, y.core).lower > within : separated(x, y.core);
}

} // namespace prolate::query

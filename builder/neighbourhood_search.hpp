// Large neighbourhood search (Shaw 1998): a set that descents found, improved place by place.
//
// Descents of whole sets from several starts differ less the more ellipsoids there are: what one finds better in one
// place it finds worse in another. So a few neighbours at a time go back to a blurred state and descend again, while
// the others stay, and what the place came to is kept if the set has less error by it: each place gets the best of its
// own trials.
#pragma once

#include "builder/gradient_descent.hpp"

#include <functional>
#include <span>
#include <vector>

namespace prolate {

struct NeighbourhoodSearch {
    DescentOptions descent; ///< of a trial; its seed begins a sequence, `fixed` and `family` are empty
    size_t size;            ///< ellipsoids that descend together, at least 1
    int trials;
    /// Of a whole set: what is lowered.
    std::function<double(std::span<const Fit>)> error;
    std::function<void(double)> progress; ///< called now and then with the share that is done
};

/// Lowers options.error(fits), or leaves them as they are. `points` of the surface are to be covered. The result
/// depends on no number of threads.
void search_neighbourhoods(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
                           const NeighbourhoodSearch& options);

} // namespace prolate

// N rays, or balls along them, at N poses of a body, as the runtime takes them.
#pragma once

#include "python/src/answers.hpp"
#include "python/src/batch.hpp"

#include <prolate/raycast.hpp>

namespace prolate::python {

class Rays {
public:
    /// `more`: how many there are of what else goes with each ray, and whether it is a single one.
    Rays(nb::handle pose, nb::handle origins, nb::handle directions, nb::handle max_t, nb::handle order,
         size_t more = 1, bool more_single = true);

    size_t count() const noexcept { return count_; }

    /// (arrays of hits, is it a single ray) of query(i, pose, ray, context), a RaycastResult, for all i < count().
    template <class Query> nb::tuple cast(int threads, const Query& query) const {
        HitArrays out(count_);
        for_all(count_, threads, [&](size_t i, QueryContext& context) {
            const Placed at = placed(i);
            const RaycastResult r = query(i, at.pose, at.ray, context);
            const Point local = {r.normal.x, r.normal.y, r.normal.z};
            out.store(i, r, r.t * at.scale, row(origins_, i), row(directions_, i),
                      at.in_frame ? rotated(poses_.at(i), local) : local);
        });
        return nb::make_tuple(out.take(), single_);
    }

private:
    struct Placed {
        Pose pose;
        Ray ray;
        bool in_frame = false; ///< the ray is in the body's frame
        double scale = 1;      ///< of the direction
    };
    static const double* row(const Rows<double>& rows, size_t i) noexcept {
        return &rows.values[3 * (rows.count == 1 ? 0 : i)];
    }
    Placed placed(size_t i) const noexcept;
    Placed without_end(size_t i) const noexcept;

    Poses poses_;
    Rows<double> origins_, directions_;
    double max_t_;
    size_t count_;
    bool single_;
};

} // namespace prolate::python

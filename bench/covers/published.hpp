// Outside ratios that other methods reach on models that are known here, and those that prolate is to reach.
#pragma once

#include "bench/covers/measure.hpp"

#include <cstdint>
#include <span>
#include <string>

namespace prolate::bench {

/// Outside ratios of one model at one count, by exact columns. NaN: none.
struct Published {
    const char* model;
    uint32_t triangles, count;
    double naive; ///< k-means with minimum ellipsoids, degree 8
    double vhacd; ///< V-HACD's hulls, which leave 0.02 to 0.3 % of the volume uncovered
    /// AMAA's sphere trees (Bradshaw), grown until they cover, with 58-64 and 441-497 spheres where 64 and 512 are said
    /// (homer's 64 do not cover).
    double amaa;
    double goal; ///< prolate's own
};

/// All of them. A model is known by its name and its number of triangles.
std::span<const Published> all_published();
/// The one of a model and a count; all figures NaN if there is none.
Published published(const std::string& model, uint32_t triangles, uint32_t count);

} // namespace prolate::bench

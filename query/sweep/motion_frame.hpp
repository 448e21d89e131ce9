// What the kernels of sweep() need to know of how two bodies move at one time.
#pragma once

#include "query/node/lattice.hpp"

namespace prolate::query {

/// How all moves at one time, in lattice coordinates of one body, X, whose nodes are opened; Y is the other.
struct MotionFrame {
    LatticePose y_to_x;
    float velocity[3];          ///< of Y's turning point less that of X's
    float spin_x[3], spin_y[3]; ///< rotation vectors
    float speed, spin_x_length, spin_y_length;
    float center_x[3]; ///< the points turned about
    double center_y[3];
};

} // namespace prolate::query

// The tree as Python holds it: a view, and the object whose memory it lies in.
#pragma once

#include "python/src/arrays.hpp"

#include <prolate/tree.hpp>

#include <array>

namespace prolate::python {

/// Immutable, so that threads may share it.
struct HeldTree {
    TreeView view;
    nb::object owner; ///< of the bytes
    /// A ball that holds the body, in its frame, metres; and no point of it is farther from the origin than `reach`.
    std::array<double, 3> center;
    double radius, reach;
};

/// The tree that `value` is; a TypeError that names the argument if it is none.
const HeldTree& tree_of(nb::handle value, const char* name);

/// Bytes that have just been made, as a numpy array that owns them.
nb::object owned_bytes(std::span<const std::byte> bytes);

// What module.cpp puts together.
void bind_tree(nb::module_& m);
void bind_bake(nb::module_& m);
void bind_queries(nb::module_& m);
void bind_contacts(nb::module_& m);
void bind_deform(nb::module_& m);
void bind_points(nb::module_& m);
void bind_primitives(nb::module_& m);
void bind_pairs(nb::module_& m);
void bind_robot(nb::module_& m);
void bind_shapes(nb::module_& m);
void bind_solids(nb::module_& m);
void bind_world(nb::module_& m);

} // namespace prolate::python

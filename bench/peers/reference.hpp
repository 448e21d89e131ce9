// The judge: slow, obvious answers for two triangle meshes, in double precision, independent of every library compared.
//
// A tree of axis-parallel boxes finds the pairs of triangles that come near each other; of a pair, all 9 pairs of edges
// and 6 of a corner and a triangle give the distance, which is 0 if an edge passes through the other triangle (Ericson,
// Real-Time Collision Detection, 2005, sections 5.1.5 and 5.1.9). Right to about 1e-15 of the coordinates.
#pragma once

#include <prolate/mesh.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace prolate::bench::peers {

struct Placement {
    Pose a, b;
    Pose before; ///< where B was a moment ago, for queries that remember it
};

class Reference {
public:
    using Point = std::array<double, 3>;
    struct Node {
        Point middle, half;    // of the box
        uint32_t first, count; // triangles of a leaf; count 0: children first, first + 1
    };

    explicit Reference(MeshView mesh);
    const std::vector<Node>& nodes() const { return nodes_; }
    std::array<Point, 3> triangle(uint32_t t) const { return triangles_[t]; } ///< in the tree's order

private:
    void split(uint32_t node, uint32_t begin, uint32_t end);
    std::vector<Node> nodes_;
    std::vector<std::array<Point, 3>> triangles_;
};

/// Do the surfaces have a common point, or come nearer than 1e-14?
bool meet(const Reference& a, const Reference& b, const Placement& at);

/// Distance of the surfaces.
double distance(const Reference& a, const Reference& b, const Placement& at);

} // namespace prolate::bench::peers

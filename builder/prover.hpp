// The proof that one level covers what of the solid lies in a cell of space: see verify.cpp for why it holds.
#pragma once

#include "builder/clip.hpp"
#include "builder/fit.hpp"
#include "builder/winding.hpp"

#include "src/hash.hpp"

#include <prolate/verify.hpp>

#include <tbb/concurrent_unordered_map.h>

#include <array>
#include <optional>
#include <vector>

namespace prolate {

/// A node's ellipsoid and, by `parent`, those of nodes above it that must hold the same.
struct CoverNode {
    Fit fit;
    double shrunk;                     // squared radial coordinate up to which a point is inside beyond doubt
    double shortest_inverse;           // bounds |L^-1 v| / |v|
    const CoverNode* parent = nullptr; // none: it stands for itself

    bool ellipsoid_holds(const Vec& p) const { return fit.radial_squared(p) <= shrunk; }
    bool holds(const Vec& p) const { return ellipsoid_holds(p) && (parent == nullptr || parent->holds(p)); }
    bool barely_holds(const Vec& p) const {
        return fit.radial_squared(p) <= 1 && (parent == nullptr || parent->barely_holds(p));
    }
    // The ellipsoid that `p` is farthest out in.
    const Fit& outermost(const Vec& p) const {
        const Fit* found = &fit;
        double largest = fit.radial_squared(p);
        for (const CoverNode* s = parent; s != nullptr; s = s->parent)
            if (const double radial = s->fit.radial_squared(p); radial > largest) largest = radial, found = &s->fit;
        return *found;
    }
    double radial_squared(const Vec& p) const { return outermost(p).radial_squared(p); }
};

/// A box of space and what of the mesh is in it.
struct ProofCell {
    Box box;
    std::vector<Polygon> polygons;    // the surface in the box
    std::vector<uint32_t> candidates; // ellipsoids that may meet the box
    bool solid = false;               // wholly inside: there is no surface, and this is known
};

/// The solid of a closed mesh. Thread-safe.
class ClosedSolid {
public:
    explicit ClosedSolid(MeshView mesh) : winding_(mesh) {}

    // The winding number is whole but on the surface, so a value in between tells of the error of the fast evaluation:
    // then the exact sum.
    double winding(const Vec& p) const {
        const double fast = winding_(p, kAccuracy);
        return std::abs(fast - std::round(fast)) < 0.1 ? fast : winding_(p, HUGE_VAL);
    }
    bool holds(const Vec& p) const { return std::abs(winding(p)) > 0.25; }
    // The same for a corner of a box: those of neighbouring boxes, and of all levels, are the same points.
    bool holds_corner(const Vec& p) const {
        const Key key{p.x(), p.y(), p.z()};
        if (const auto found = corners_.find(key); found != corners_.end()) return found->second;
        const bool held = holds(p);
        if (corners_.size() < kMostCorners) corners_.emplace(key, held);
        return held;
    }

private:
    static constexpr double kAccuracy = 3;            // of the winding number, see Winding
    static constexpr size_t kMostCorners = 4'000'000; // to remember

    using Key = std::array<double, 3>;
    struct Hash {
        size_t operator()(const Key& key) const { return hash_bytes(std::as_bytes(std::span(key))); }
    };
    Winding winding_;
    mutable tbb::concurrent_unordered_map<Key, bool, Hash> corners_;
};

class Prover {
public:
    /// Refers to its arguments. `solid` is null in surface mode; `size` is the mesh's.
    Prover(const std::vector<CoverNode>& shapes, const ClosedSolid* solid, double size)
        : shapes_(shapes), solid_(solid), size_(size) {}

    LevelProof proof; ///< covered stays true until something speaks against it

    /// Proves a cell, or says in `proof` what speaks against it. Takes what the cell holds.
    void prove(ProofCell& cell);
    /// The eight parts.
    static std::array<ProofCell, 8> cut(const ProofCell& cell);

private:
    using Inside = std::array<int8_t, 8>; // of a cell's corners: -1: not asked yet

    bool settled(ProofCell& cell);
    bool holds_piece(const CoverNode& shape, const ProofCell& cell, Inside& corner_inside) const;
    bool hold_parts(const CoverNode& a, const CoverNode& b, const ProofCell& cell, Inside& corner_inside);
    void drop_far_candidates(ProofCell& cell) const;
    template <class InSolid> void refute_at(const Vec& p, const ProofCell& cell, InSolid&& in_solid);
    void refute(const ProofCell& cell);
    void give_up(const Vec& p);

    const std::vector<CoverNode>& shapes_;
    const ClosedSolid* solid_;
    double size_;
    uint32_t last_holder_ = 0;   // a shape
    std::optional<Vec> suspect_; // a point of the surface, in the cell at hand
};

} // namespace prolate

// What a tree knows of how bones move its mesh (TreeView::skin()): linear blend skinning, bounded node by node.
//
// A bone is an affine transform T_b of the mesh's frame: in an animation the joint's matrix times its inverse bind
// matrix, the identity at rest. A vertex x goes to sum over b of w_b T_b x, where w_b >= 0 are its weights over their
// sum; points of a triangle move as its corners do, linearly. If the tree has modes, too (deformation.hpp), they move x
// first, and the bones what they made of it, as in glTF.
//
// A node stands for the triangles that deformation.hpp names. Of each bone that moves one of their corners it knows a
// weight m_b, which add up to 1; a spread s_b >= |w_b(x) - m_b| for every corner x; and a ball around the corners with
// w_b(x) > 0, their center z_b and radius r_b. Let M = sum m_b T_b. A corner that goes to x' = sum w_b T_b x is then
// off M x by
//     x' - M x = sum w_b (T_b - M) x               no longer than the longest (T_b - M) y, y in the ball of b
//              = sum (w_b - m_b) (T_b - M) x       no longer than sum s_b |(T_b - M) x|, x in one of the balls,
// and a point of a triangle by a mean of its corners' errors. So all that lies within the smaller of both of M E, E the
// node's ellipsoid at rest, holds what the node stands for, for *all* matrices: no range is needed, and no vertex.
//
// It is exact where one bone moves a node, or all move alike, and tight where weights vary little within a node.
#pragma once

#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

inline constexpr uint32_t kMaxBones = 1024;       ///< most bones of a tree
inline constexpr uint32_t kMaxInfluences = 8;     ///< most bones that move a vertex
inline constexpr float kLargestBoneFactor = 1024; ///< most of an entry of BoneMatrix but the translation, either way

/// x goes to m (x, 1): m[row][column], the last column a translation in metres, all in the mesh's frame. It may scale,
/// shear and mirror. (The matrices of glTF are column by column.)
struct BoneMatrix {
    float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};

/// A view of the section of a file that open() has checked (src/FORMAT.md, "SKIN"). Cheap to copy. Safe to share
/// between threads.
class Skin {
public:
    /// What a node knows of a bone; m, s, z and r above.
    struct Influence {
        uint32_t bone;
        double weight;    ///< 0 ... 1; those of a node add up to 1
        double spread;    ///< 0 ... 1
        double center[3]; ///< metres
        double radius;    ///< metres
    };
    /// A bone's weight for a point; a point's add up to about 1, and count by their share of that.
    struct Weight {
        uint32_t bone;
        float weight; ///< at least 0
    };

    uint32_t bone_count() const noexcept; ///< 1 ... kMaxBones
    /// Of the node in `slot`: at least 1, in the order of bones.
    uint32_t influence_count(uint32_t slot) const noexcept;
    Influence influence(uint32_t slot, uint32_t i) const noexcept;

    /// Points of the mesh whose weights are known. Of exact trees, the vertices, by their numbers. Else one vertex of
    /// each connected part of the surface, the same ones as of a deformation.
    uint32_t point_count() const noexcept;
    /// Where point `p` < point_count() of a tree without triangles is at rest, metres.
    Vec3 point(uint32_t p) const noexcept;
    uint32_t weight_count() const noexcept; ///< of each point: 1 ... kMaxInfluences
    Weight weight(uint32_t p, uint32_t i) const noexcept;

private:
    friend class TreeView;
    Skin(std::span<const std::byte> content, uint32_t slots, bool exact) noexcept
        : content_(content), slots_(slots), exact_(exact) {}
    const std::byte* points() const noexcept;
    std::span<const std::byte> content_;
    uint32_t slots_;
    bool exact_;
};

} // namespace prolate

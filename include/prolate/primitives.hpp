// Trees of simple solids, made on the spot: a box, a cylinder, a convex polyhedron, an ellipsoid, a capsule. They need
// no mesh file and no bake, and are bodies like all others: every query and every World takes them, with the same
// certificates, manifolds, ids and caches. A floor is a large box. shapes.hpp asks for overlaps with shapes that are no
// bodies.
//
// Making one takes some microseconds and allocates its bytes; queries allocate nothing. All functions are thread-safe,
// and give the same bits on all machines. The trees say nothing of their mass (BakeInfo::mass is 0).
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// The box |x| <= half.x, |y| <= half.y, |z| <= half.z, exactly: an exact tree of 12 triangles. Fails with bad_options
/// if a half extent is not finite and above 0, or out of the format's range (src/FORMAT.md, "Known limits").
Result<Tree> box_tree(const Vec3& half);

/// A prism that stands for the cylinder x^2 + y^2 <= radius^2, |z| <= half_height, metres: it holds it, and sticks out
/// of it by at most e = 5.3 / sides^2 of the radius, rounding included: 0.5 % with 32 sides, 0.03 % with 128, 5e-6 with
/// 1024, in 4 triangles a side. `sides` are a power of two, 8 ... 1024. Fails as box_tree() does.
///
/// So of the round cylinder, *separated* is certain, and lower bounds of distances and times of contact hold; upper
/// bounds of distances may be too small by e, and depths too large by as much. Where it lies on a plane, depth deep,
/// its points are at most sqrt(2 radius (e + depth)) + e off the line that the cylinder touches with. (A leaf of its
/// own for cylinders would need a case in every query.)
Result<Tree> cylinder_tree(float radius, float half_height, uint32_t sides = 32);

/// The convex polyhedron with these triangles, exactly: indices into `points`, counter-clockwise seen from outside.
/// Points that no triangle uses are left out. Fails with bad_mesh if there are fewer than four triangles, a triangle
/// names a point that does not exist, is not finite or has no area, an edge does not belong to just two triangles that
/// run along it in opposite directions, or a point lies beyond a triangle's plane by more than 1e-5 of the size;
/// `where` is the triangle's index. Fails with bad_options if the size is out of the format's range. O(triangles *
/// points).
Result<Tree> convex_tree(std::span<const Vec3> points, std::span<const Triangle> triangles);

/// A tree of one ellipsoid, which holds `e` and is larger by at most 2e-4 of its size. Fails with bad_options if a
/// number is not finite, a diagonal entry is not above 0, or the size is out of the format's range.
Result<Tree> ellipsoid_tree(const Ellipsoid& e);
/// The same for the ball around the origin.
Result<Tree> sphere_tree(float radius);

/// The capsule of all points within `radius` of the segment from `a` to `b`, exactly but for 1e-7 of the radius: a tree
/// of the segment, whose view is rounded() by the radius. Where `a` and `b` are the same, a ball. Fails as box_tree()
/// does. Of a save()d file, the view must be rounded again.
Result<Tree> capsule_tree(const Vec3& a, const Vec3& b, float radius);

} // namespace prolate

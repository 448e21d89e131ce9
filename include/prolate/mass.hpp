// Mass properties of a baked solid, for rigid-body dynamics: BakeInfo::mass in bake_info.hpp.
#pragma once

#include <prolate/types.hpp>

#include <array>

namespace prolate {

/// Volume, centre of mass and inertia tensor of a solid of density 1 (kg per cubic metre), in the frame of its mesh.
/// For another density, multiply the volume, the inertia and their errors by it.
///
/// The bake integrates over the mesh's triangles, which is exact but for rounding. The errors are bounds of that
/// rounding, if the mesh winds around its solid once. If its parts overlap, what is counted twice is subtracted by
/// z-columns, and the errors include the estimated error of these; of an open mesh, everything is by columns. All is 0
/// where there is no inside, and of exact trees of open meshes.
struct MassProperties {
    double volume = 0;                 ///< cubic metres; the mass in kg
    std::array<double, 3> center = {}; ///< centre of mass, metres
    /// Inertia tensor about the centre, along the mesh's axes: xx, yy, zz, xy, xz, yz, kg m^2. The last three are
    /// entries of the tensor, minus the integrals of x y, x z and y z.
    std::array<double, 6> inertia = {};
    double volume_error = 0;  ///< |error| of the volume is at most this, cubic metres
    double center_error = 0;  ///< the same for each coordinate of the centre, metres
    double inertia_error = 0; ///< the same for each entry of the tensor, kg m^2
    friend bool operator==(const MassProperties&, const MassProperties&) = default;
};

/// Of the solid scaled about its frame's origin by `scale`, a finite number that is not 0. A negative one mirrors the
/// solid through the origin. Thread-safe.
MassProperties scaled(const MassProperties& mass, double scale) noexcept;

/// Of the solid placed at `pose`: centre and tensor along the world's axes. Thread-safe.
/// All numbers but the volume are NaN if the pose is not finite or its quaternion is zero.
MassProperties placed(const MassProperties& mass, const Pose& pose) noexcept;

/// The frame in which an inertia tensor is diagonal.
struct PrincipalInertia {
    std::array<double, 3> moments; ///< about the frame's x, y, z axes, largest first, kg m^2
    Pose frame;                    ///< origin at the centre of mass; right-handed axes
};

/// Principal moments and axes, by the library's own Jacobi iteration: the same bits on every IEEE platform.
/// Thread-safe.
PrincipalInertia principal_inertia(const MassProperties& mass) noexcept;

} // namespace prolate

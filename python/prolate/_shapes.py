"""Simple, solid shapes in the world, which need no tree."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Union

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._answers import Floats


class Sphere(NamedTuple):
    """All points at most ``radius`` from ``center`` (3,); world, metres."""

    center: ArrayLike
    radius: float


class Capsule(NamedTuple):
    """All points at most ``radius`` from the segment between ``a`` and ``b`` (3,); world, metres."""

    a: ArrayLike
    b: ArrayLike
    radius: float


class Box(NamedTuple):
    """The box of half extents ``half`` (3,) at ``pose`` (7,), ``x y z qx qy qz qw``; world, metres."""

    pose: ArrayLike
    half: ArrayLike


class HalfSpace(NamedTuple):
    """All points p with ``dot(normal, p) <= offset * |normal|``; ``normal`` (3,) is no zero vector; world, metres."""

    normal: ArrayLike
    offset: float


Shape = Union[Sphere, Capsule, Box, HalfSpace]


def _row(name: str, value: ArrayLike, count: int) -> Floats:
    import numpy as np

    try:
        row = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: cannot be taken as an array of float64") from None
    if row.shape != (count,):
        raise ValueError(f"{name}: must have shape ({count},), not {row.shape}")
    return row


def _length(name: str, value: float) -> Floats:
    row = _row(name, [value], 1)
    if row[0] < 0:
        raise ValueError(f"{name}: must be 0 or more")
    return row


def numbers(shape: Shape) -> tuple[str, Floats]:
    """The shape as the library takes it: its kind and a row of numbers, checked."""
    import numpy as np

    if isinstance(shape, Sphere):
        return "sphere", np.concatenate([_row("shape.center", shape.center, 3), _length("shape.radius", shape.radius)])
    if isinstance(shape, Capsule):
        ends = [_row("shape.a", shape.a, 3), _row("shape.b", shape.b, 3)]
        return "capsule", np.concatenate([*ends, _length("shape.radius", shape.radius)])
    if isinstance(shape, Box):
        half = _row("shape.half", shape.half, 3)
        pose = _row("shape.pose", shape.pose, 7)
        if (half < 0).any():
            raise ValueError("shape.half: must be 0 or more")
        if not np.abs(pose[3:]).max() > 1e-18:
            raise ValueError("shape.pose: has a quaternion of 0; no rotation is 0 0 0 1")
        return "box", np.concatenate([pose, half])
    if isinstance(shape, HalfSpace):
        normal = _row("shape.normal", shape.normal, 3)
        length = float(np.linalg.norm(normal))
        if not 0 < length < np.inf:
            raise ValueError("shape.normal: must not be 0")
        offset = _row("shape.offset", [shape.offset], 1)
        return "half_space", np.concatenate([normal / length, offset])
    raise TypeError(f"shape: must be a Sphere, Capsule, Box or HalfSpace, not {type(shape).__name__}")


def ground(half_space: HalfSpace, pose: object) -> Floats:
    """The numbers of a half-space that stands in the place of a body."""
    if pose is not None:
        raise TypeError("poses_b: a HalfSpace is in the world and has no pose")
    return numbers(half_space)[1]

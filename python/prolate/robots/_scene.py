"""What stands around a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Union

import numpy as np

from .. import _core
from .._shapes import Box, Capsule, HalfSpace, Sphere, numbers
from .._tree import Tree

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_IDENTITY = np.array([0, 0, 0, 0, 0, 0, 1.0])


class PointCloud(NamedTuple):
    """Balls of one ``radius`` around ``points`` (n, 3): a depth camera's picture, say; metres."""

    points: ArrayLike
    radius: float


Obstacle = Union[Tree, Box, Sphere, Capsule, HalfSpace, PointCloud]


class Scene:
    """Bodies that stand still, in the frame of a robot's root.

    ``len(scene)`` is their number, ``scene.names`` what they are called. Not thread-safe while :meth:`add` is called;
    else it is.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.native = _core.RobotScene()

    def __len__(self) -> int:
        return len(self.names)

    def add(self, shape: Obstacle, pose: ArrayLike | None = None, *, name: str | None = None) -> Scene:
        """Add a body.

        Parameters
        ----------
        shape : Tree, Box, Sphere, Capsule, HalfSpace or PointCloud
            Metres.
        pose : array of shape (7,) or (4, 4), optional
            ``x y z qx qy qz qw`` or a rigid matrix, of the shape's frame; on top of what the shape itself says of where
            it is. The identity by default.
        name : str, optional
            By default, ``"box 3"`` for a box that comes after three others.

        Returns
        -------
        Scene
            Itself: ``Scene().add(table).add(wall)``.

        Raises
        ------
        ValueError, TypeError
            Naming what is wrong; the scene is then as it was.
        """
        at = matrix_of("pose", _IDENTITY if pose is None else pose)
        self._insert(shape, at)
        self.names.append(name if name is not None else f"{_word(shape)} {len(self.names)}")
        return self

    def _insert(self, shape: Obstacle, at: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> None:
        if isinstance(shape, Tree):
            self.native.add_tree(shape, at)
        elif isinstance(shape, Box):
            row = numbers(shape)[1]
            self.native.add_box(row[7:], at @ matrix_of("shape.pose", row[:7]))
        elif isinstance(shape, Sphere):
            row = numbers(shape)[1]
            self.native.add_capsule(np.zeros(3), np.zeros(3), row[3], at @ _shift(row[:3]))
        elif isinstance(shape, Capsule):
            row = numbers(shape)[1]
            middle = (row[:3] + row[3:6]) / 2
            self.native.add_capsule(row[:3] - middle, row[3:6] - middle, row[6], at @ _shift(middle))
        elif isinstance(shape, HalfSpace):
            row = numbers(shape)[1]
            _check_rigid(at)
            normal = at[:3, :3] @ row[:3]
            self.native.add_half_space(np.append(normal, row[3] + normal @ at[:3, 3]))
        elif isinstance(shape, PointCloud):
            if not np.size(shape.points):
                raise ValueError("shape.points: there are none")
            self.native.add_points(shape.points, shape.radius, at)
        else:
            raise TypeError(
                f"shape: must be a Tree, Box, Sphere, Capsule, HalfSpace or PointCloud, not {type(shape).__name__}"
            )


def _word(shape: Obstacle) -> str:
    if isinstance(shape, HalfSpace):
        return "half-space"
    return "points" if isinstance(shape, PointCloud) else type(shape).__name__.lower()


def _shift(by: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    out = np.eye(4)
    out[:3, 3] = by
    return out


def _check_rigid(at: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> None:
    """As the native side does it, for a shape that has no frame there."""
    _core.RobotScene().add_points(np.zeros((1, 3)), 0.0, at)


def matrix_of(name: str, pose: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """4x4 of a pose in either form; `name` is the argument's."""
    try:
        given = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: cannot be taken as an array of float64") from None
    if given.shape == (4, 4):
        return given  # the native side checks that it is rigid
    if given.shape != (7,):
        raise ValueError(f"{name}: must have shape (7,) or (4, 4), not {given.shape}")
    most = np.abs(given[3:]).max()
    if not (np.isfinite(given).all() and most > 1e-18):
        raise ValueError(f"{name}: is not finite, or has a quaternion of 0; no rotation is 0 0 0 1")
    turn = given[3:] / most
    x, y, z, w = turn / np.linalg.norm(turn)
    out = _shift(given[:3])
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return out

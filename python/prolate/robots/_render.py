"""A robot as a picture: covers over meshes, and which links touch. By numpy alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ._baked import BakedRobot, is_solid
from ._scene import matrix_of
from ._solids import merged, moved
from ._view import outside

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

# As in view.js.
_MESH, _TOUCH = (0.62, 0.66, 0.70), (0.86, 0.15, 0.18)
_COLOURS = np.array(
    [
        (0, 0.447, 0.698),
        (0.902, 0.624, 0),
        (0, 0.62, 0.451),
        (0.8, 0.475, 0.655),
        (0.337, 0.706, 0.914),
        (0.835, 0.369, 0),
    ]
)
_RAMP = np.array([(0.192, 0.408, 0.557), (0.208, 0.718, 0.475), (0.992, 0.906, 0.145), (0.839, 0.235, 0.157)])
_GLASS = 0.4


def render(
    baked: BakedRobot,
    q: ArrayLike | None = None,
    *,
    size: tuple[int, int] = (1200, 900),
    view: tuple[float, float] = (-50.0, 20.0),
    covers: Literal["colour", "heat", "none"] = "colour",
    meshes: bool = True,
    heat_top: float | None = None,
    samples: int = 2,
) -> NDArray[np.uint8]:
    """A picture of a robot, for papers. Parallel lines stay parallel.

    Parameters
    ----------
    baked : BakedRobot
    q : array of shape (nq,), optional
        The configuration; by default where q begins. Links that may touch are red.
    size : (int, int)
        Width and height, pixels.
    view : (float, float)
        Azimuth and elevation of the viewer, degrees.
    covers : {"colour", "heat", "none"}
        By link, and transparent over meshes; by how far they stick out; or not at all.
    meshes : bool
        The links' own bodies.
    heat_top : float, optional
        Where the colours of ``"heat"`` end, metres; by default at what sticks out most.
    samples : int
        1 ... 8 squared of them make a pixel.

    Returns
    -------
    uint8 array (height, width, 3)

    Raises
    ------
    ValueError, TypeError
        For an argument.

    Thread-safe.
    """
    if covers not in ("colour", "heat", "none"):
        raise ValueError(f"covers: {covers!r} is none of colour, heat, none")
    if not (1 <= samples <= 8 and min(size) >= 1):
        raise ValueError("samples must be 1 to 8, and size above 0")
    checks = baked.checks
    at = checks.kinematics.home if q is None else np.asarray(q, dtype=np.float64)
    frames = checks.fk(at)
    red = {
        name
        for pair, meets in zip(checks.pairs(), checks.collide(at, first_only=False)[0])
        if meets
        for name in pair[:2]
    }

    solid, glass = _Bodies(), _Bodies()
    for i, (link, frame) in enumerate(zip(baked.description.links, frames)):
        pose = matrix_of("frame", frame)
        if meshes and is_solid(link):
            solid.add(*merged(link.collisions), pose, _TOUCH if link.name in red else _MESH)
        cover = baked.covers.get(link.name)
        if cover is not None and covers != "none":
            vertices, faces = merged(cover.geometries)
            heat = outside(link, vertices) if covers == "heat" and link.name not in red else None
            glass.add(vertices, faces, pose, _TOUCH if link.name in red else _COLOURS[i % len(_COLOURS)], heat)
    width, height = size[0] * samples, size[1] * samples
    camera = _Camera(np.concatenate([solid.points(), glass.points()]), view, width, height)
    mesh_depth, mesh_colour = solid.drawn(camera, None)
    depth, colour = glass.drawn(camera, heat_top)
    clear = _GLASS if meshes and covers == "colour" else 1.0
    front = np.where(depth >= mesh_depth, clear, 0.0)[..., None]
    front[~np.isfinite(depth)] = 0
    picture = colour * front + mesh_colour * (1 - front)
    picture = picture.reshape(size[1], samples, size[0], samples, 3).mean(axis=(1, 3))
    out: NDArray[np.uint8] = np.rint(255 * picture).astype(np.uint8)
    return out


class _Camera:
    """Parallel projection on all that there is, with a margin."""

    def __init__(self, points: Floats, view: tuple[float, float], width: int, height: int) -> None:
        azimuth, elevation = np.radians(view)
        self.towards = np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        self.axes = np.stack([right, -np.cross(self.towards, right), self.towards], axis=1)  # right, down, near
        flat = points @ self.axes
        low, high = (flat.min(axis=0), flat.max(axis=0)) if len(points) else (np.zeros(3), np.ones(3))
        self.scale = 0.92 / max(*((high - low)[:2] / (width, height)), 1e-9)
        self.shift = np.array([width, height]) / 2 - self.scale * (low + high)[:2] / 2
        self.width, self.height = width, height

    def __call__(self, points: Floats) -> Floats:
        flat: Floats = points @ self.axes
        flat[:, :2] = flat[:, :2] * self.scale + self.shift
        return flat


class _Bodies:
    """Triangles in the world, and what colours them."""

    def __init__(self) -> None:
        self._parts: list[tuple[Floats, NDArray[np.int64], Floats, Floats | None]] = []

    def add(
        self, vertices: Floats, faces: NDArray[np.int64], pose: Floats, colour: ArrayLike, heat: Floats | None = None
    ) -> None:
        self._parts.append((moved(pose, vertices), faces, np.asarray(colour, dtype=np.float64), heat))

    def points(self) -> Floats:
        return np.concatenate([np.empty((0, 3)), *(part[0] for part in self._parts)])

    def drawn(self, camera: _Camera, heat_top: float | None) -> tuple[Floats, Floats]:
        """How near is what is seen, -inf for nothing; and its colour, white there: (height, width) and (..., 3)."""
        depth = np.full((camera.height, camera.width), -np.inf)
        colour = np.ones((camera.height, camera.width, 3))
        most = max((heat.max(initial=0.0) for *_, heat in self._parts if heat is not None), default=0.0)
        top = heat_top if heat_top is not None else most
        for world, faces, base, heat in self._parts:
            flat = camera(world)
            normal = np.cross(world[faces[:, 1]] - world[faces[:, 0]], world[faces[:, 2]] - world[faces[:, 0]])
            length = np.linalg.norm(normal, axis=1)
            light = camera.towards + (0, 0, 0.6)
            bright = 0.35 + 0.65 * np.abs(normal @ light) / np.maximum(length * np.linalg.norm(light), 1e-300)
            for face, shade in zip(faces, bright):
                part = _pixels(flat[face], camera.width, camera.height)
                if part is None:
                    continue
                rows, columns, weights = part
                near = weights @ flat[face, 2]
                seen = near > depth[rows, columns]
                rows, columns = rows[seen], columns[seen]
                depth[rows, columns] = near[seen]
                tint = base if heat is None else _ramp(weights[seen] @ heat[face] / (top or 1))
                colour[rows, columns] = shade * tint
        return depth, colour


def _pixels(corners: Floats, width: int, height: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats] | None:
    """Rows and columns of the pixels whose middles a triangle covers, and their barycentric coordinates (n, 3)."""
    low = np.maximum(np.ceil(corners[:, :2].min(axis=0) - 0.5), 0).astype(np.int64)
    high = np.minimum(np.floor(corners[:, :2].max(axis=0) - 0.5), (width - 1, height - 1)).astype(np.int64)
    if (high < low).any():
        return None
    x, y = np.arange(low[0], high[0] + 1) + 0.5, np.arange(low[1], high[1] + 1) + 0.5
    (ax, ay), (bx, by), (cx, cy) = corners[:, :2]
    twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if abs(twice) < 1e-12:
        return None
    b = ((x[None, :] - ax) * (cy - ay) - (cx - ax) * (y[:, None] - ay)) / twice
    c = ((bx - ax) * (y[:, None] - ay) - (x[None, :] - ax) * (by - ay)) / twice
    rows, columns = np.nonzero((b >= 0) & (c >= 0) & (b + c <= 1))
    weights = np.stack([1 - b - c, b, c], axis=-1)[rows, columns]
    return rows + low[1], columns + low[0], weights


def _ramp(part: Floats) -> Floats:
    """Colours (n, 3) of numbers from 0 to 1."""
    stops = np.linspace(0, 1, len(_RAMP))
    return np.stack([np.interp(part, stops, _RAMP[:, k]) for k in range(3)], axis=-1)

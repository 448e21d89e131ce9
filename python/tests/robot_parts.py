"""A small robot for tests, at general rotations, whose solids are known exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from prolate.robots import BakedRobot, Robot
from prolate.robots._model import BoxShape, Description, Geometry, Inertial, Joint, Link, MeshShape

L_BOXES = [((0.0, 0.0, 0.0), (0.3, 0.1, 0.1)), ((0.0, 0.1, 0.0), (0.1, 0.4, 0.1))]  # lower and upper corners, metres


def pose(seed: int, reach: float = 0.3) -> np.ndarray:
    """A random rigid motion."""
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] = -rotation[:, 0]
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, random.uniform(-reach, reach, 3)
    return found


def l_shape() -> MeshShape:
    """The solid of L_BOXES: closed, not convex."""
    outline = np.array([[0, 0], [0.3, 0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.4], [0, 0.4]])
    count = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(count, z)]) for z in (0.0, 0.1)])
    flat = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in flat] + [(a + count, b + count, c + count) for a, b, c in flat]
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, j + count), (i, j + count, i + count)]
    return MeshShape(vertices, np.array(faces))


def points_of_l(number: int, seed: int = 1) -> np.ndarray:
    """Random points of the solid of l_shape(), and its corners."""
    random = np.random.default_rng(seed)
    inner = [random.uniform(low, high, (number // 2, 3)) for low, high in L_BOXES]
    return np.concatenate([*inner, l_shape().vertices])


def distance_to_l(points: np.ndarray) -> np.ndarray:
    """Of points from the solid of l_shape(), metres; 0 inside."""
    apart = [np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1) for low, high in L_BOXES]
    return np.min(apart, axis=0)


def wedge() -> MeshShape:
    """A tetrahedron: closed, convex."""
    vertices = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.15, 0], [0, 0, 0.1]])
    return MeshShape(vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))


def arm() -> Description:
    """An L, a wedge with a box beside it that turns on it, and a wedge that slides."""
    inertial = Inertial(1.5, np.diag([0.01, 0.02, 0.025]), pose(9, 0.05))
    source = Path("arm.urdf")
    links = (
        Link("base", (Geometry(l_shape(), pose(1)),), (Geometry(l_shape(), pose(1)),), inertial),
        Link("elbow", (Geometry(wedge(), pose(2)), Geometry(BoxShape((0.05, 0.1, 0.2)), pose(3))), (), inertial),
        Link("hand", (Geometry(wedge(), pose(4)),), (), inertial),
    )
    axis = pose(5)[:3, 0]
    joints = (
        Joint("turn", "revolute", "base", "elbow", pose(6), tuple(map(float, axis)), lower=-2.0, upper=1.5),
        Joint("push", "prismatic", "elbow", "hand", pose(7), (0.0, 0.6, 0.8), lower=-0.1, upper=0.2),
    )
    return Description("arm", links, joints, source, "urdf")


def baked(only: str | None, cache: Path) -> BakedRobot:
    """arm() with covers of all kinds or of one, which are so loose that they take little time."""
    return Robot(arm()).bake(clearance=0.1 if only is None else 0.2, only=only, max_ellipsoids=8, cache=cache)


def frames(description: Description, q: dict[str, float]) -> dict[str, np.ndarray]:
    """Of all links in the root's, by the model's own formula, for hinges and slides."""
    found = {description.links[0].name: np.eye(4)}
    for joint in description.joints:
        motion, value, axis = np.eye(4), q.get(joint.name, 0.0) - joint.zero, np.asarray(joint.axis)
        if joint.kind == "prismatic":
            motion[:3, 3] = value * axis
        else:
            cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
            motion[:3, :3] = np.eye(3) + np.sin(value) * cross + (1 - np.cos(value)) * cross @ cross
        there, back = np.eye(4), np.eye(4)
        there[:3, 3], back[:3, 3] = joint.anchor, -np.asarray(joint.anchor)
        found[joint.child] = found[joint.parent] @ joint.origin @ there @ motion @ back
    return found

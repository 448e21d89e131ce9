"""Lists of spheres, for planners that know nothing else: cuRobo. (VAMP and foam read URDF with spheres.)"""

from __future__ import annotations

import json
import os
from typing import Union

from .._errors import Error
from ._baked import BakedRobot, LinkCover
from ._model import SphereShape
from ._writing import Files, check_proved


def write_spheres(robot: BakedRobot, path: Union[str, os.PathLike[str]], *, unproved: bool = False) -> None:
    """Write ``collision_spheres`` as cuRobo reads them, in YAML: centres in the frames of links, and radii; metres.

    Parameters
    ----------
    path : path-like
    unproved : bool
        Write it even if something of the robot is missing, or a cover is not proved.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` if a cover is not of spheres only, ``"bad_mesh"`` for a robot that is not proved,
        or ``"io"``.
    """
    check_proved(robot, unproved)
    lines = ["collision_spheres:"]
    for cover in robot.covers.values():
        lines.append(f"  {json.dumps(cover.name)}:")
        for center, radius in spheres_of(cover):
            x, y, z = center
            lines.append(f"    - center: [{x!r}, {y!r}, {z!r}]")
            lines.append(f"      radius: {radius!r}")
    files = Files.at(path, robot.description)
    files.contents[files.path] = ("\n".join(lines) + "\n").encode()
    files.write()


def spheres_of(cover: LinkCover) -> list[tuple[tuple[float, float, float], float]]:
    """Centres and radii. Raises Error for what is no sphere."""
    found = []
    for one in cover.geometries:
        if not isinstance(one.shape, SphereShape):
            kind = type(one.shape).__name__.removesuffix("Shape").lower()
            raise Error(
                f'link {cover.name}: its cover has a {kind}; bake with only="spheres", and describe the link by meshes',
                "unsupported",
            )
        x, y, z = (float(value) for value in one.pose[:3, 3])
        found.append(((x, y, z), float(one.shape.radius)))
    return found

"""How commands of ``prolate-robot`` read a robot, and ``info``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

from ._model import Description, Geometry, MeshShape, Note
from ._read import load

# As the command prolate has them; its cli/failure.hpp says what each means.
DONE, NO, USAGE, BAD_INPUT, IO, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 4, 5, 130


def add_command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], int], what: str, more: str
) -> argparse.ArgumentParser:
    """A command, with the options of all that read robots."""
    parser: argparse.ArgumentParser = commands.add_parser(name, help=what, description=more)
    parser.set_defaults(run=run)
    parser.add_argument("robot", help="URDF, xacro, MJCF or SDF; what is in the file decides")
    reading = parser.add_argument_group("how the description is read")
    reading.add_argument(
        "--package",
        metavar="NAME=FOLDER",
        type=pair,
        action="append",
        default=[],
        help="where package://NAME/... leads; otherwise ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, Gazebo's paths and the "
        "folders above the file are searched",
    )
    reading.add_argument("--srdf", metavar="FILE", help="names pairs of links that are never in contact")
    reading.add_argument(
        "--xacro-arg",
        metavar="NAME=VALUE",
        type=pair,
        action="append",
        default=[],
        help="an argument of a xacro file",
    )
    reading.add_argument(
        "--dae-unit",
        choices=["obey", "ignore"],
        help="does the unit that a DAE states scale it? PyBullet, SAPIEN and scikit-robot obey; Pinocchio, yourdfpy, "
        "Newton and Genesis ignore it. Asked for if one is not the metre",
    )
    reading.add_argument(
        "--gltf-axes",
        choices=["keep", "turn"],
        help="does the Y axis of a glTF become Z? Drake turns; Pinocchio, yourdfpy, Newton and SAPIEN keep. Asked for "
        "by every glTF",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="print errors only: no notes, no progress")
    return parser


def pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"must have the form NAME=..., not {text!r}")
    return name, value


def load_as(options: argparse.Namespace, visuals: bool) -> Description:
    packages: dict[str, list[str]] = {}
    for name, folder in options.package:
        packages.setdefault(name, []).append(folder)
    return load(
        options.robot,
        packages=packages,
        srdf=options.srdf,
        xacro_args=dict(options.xacro_arg),
        dae_unit=options.dae_unit,
        gltf_axes=options.gltf_axes,
        visuals=visuals,
    )


def say(notes: Sequence[Note], quiet: bool) -> int:
    """Prints notes, and returns the exit code that they mean."""
    for note in notes:
        if note.kind == "error" or not quiet:
            print(note, file=sys.stderr)
    return NO if any(note.kind == "error" for note in notes) else DONE


def add_info(commands: Any) -> None:
    info = add_command(
        commands,
        "info",
        _info,
        "say what a description holds, and what is wrong with it",
        "Prints links, joints and geometries as they were read, with sizes in metres, and then all that was not "
        "understood, is surely not meant so, or is read differently elsewhere.",
    )
    info.add_argument("--json", action="store_true", help="print the same as JSON")


def _info(options: argparse.Namespace) -> int:
    robot = load_as(options, visuals=True)
    if options.json:
        print(json.dumps(_summary(robot), indent=2))
    else:
        print(_table(robot))
    return say(robot.notes, options.quiet or options.json)


def _table(robot: Description) -> str:
    hang = {joint.child: joint for joint in robot.joints}
    lines = [
        f"{robot.name}: {robot.format}, {len(robot.links)} links, {len(robot.joints)} joints, {robot.nq} coordinates"
    ]
    for link in robot.links:
        joint = hang.get(link.name)
        by = (
            "root"
            if joint is None
            else f"{joint.name} ({joint.kind}{', mimic' if joint.mimic else ''}) of {joint.parent}"
        )
        mass = f", {link.inertial.mass:.4g} kg" if link.inertial else ""
        lines.append(f"{link.name}: {by}{mass}")
        for kind, geometries in (("collision", link.collisions), ("visual", link.visuals)):
            lines += [f"    {kind:9} {_told(geometry)}" for geometry in geometries]
    if robot.disabled:
        lines.append(f"{len(robot.disabled)} pairs of links are never in contact, says the description")
    return "\n".join(lines)


def _told(geometry: Geometry) -> str:
    shape = geometry.shape
    kind = type(shape).__name__.removesuffix("Shape").lower()
    if not isinstance(shape, MeshShape):
        return f"{kind} " + " ".join(f"{name}={_number(value)}" for name, value in vars(shape).items())
    size = " x ".join(f"{edge:.4g}" for edge in shape.vertices.max(axis=0) - shape.vertices.min(axis=0))
    return f"{kind} {shape.path.name if shape.path else ''} {len(shape.faces)} triangles, {size} m"


def _number(value: Any) -> str:
    return " ".join(f"{x:g}" for x in value) if isinstance(value, tuple) else f"{value:g}"


def _summary(robot: Description) -> dict[str, Any]:
    return {
        "name": robot.name,
        "format": robot.format,
        "coordinates": robot.nq,
        "links": [
            {
                "name": link.name,
                "mass": link.inertial.mass if link.inertial else None,
                "collisions": [_told(geometry) for geometry in link.collisions],
                "visuals": [_told(geometry) for geometry in link.visuals],
            }
            for link in robot.links
        ],
        "joints": [
            {"name": joint.name, "kind": joint.kind, "parent": joint.parent, "child": joint.child}
            for joint in robot.joints
        ],
        "disabled": [{"links": list(pair), "reason": reason} for pair, reason in robot.disabled.items()],
        "notes": [
            {
                "kind": note.kind,
                "text": note.text,
                "file": str(note.where.path),
                "line": note.where.line,
                "link": note.link,
            }
            for note in robot.notes
        ],
    }

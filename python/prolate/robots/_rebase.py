"""Descriptions as URDF and SDF can say them: joints turn about the child's origin, from 0."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ._baked import BakedRobot
from ._model import Geometry, Joint, Link, Matrix


def rebased(robot: BakedRobot) -> BakedRobot:
    """The same robot, but each link's frame is where its joint's ``anchor`` is, and coordinates start at 0: q becomes
    q - ``zero``."""
    description = robot.description
    moves = {joint.child: _shift(np.asarray(joint.anchor)) for joint in description.joints}
    zeros = {joint.name: joint.zero for joint in description.joints}
    links = tuple(_link(link, moves.get(link.name, np.eye(4))) for link in description.links)
    joints = tuple(_joint(joint, moves, zeros) for joint in description.joints)
    covers = {
        name: replace(cover, geometries=_geometries(cover.geometries, moves.get(name, np.eye(4))), baked=None)
        for name, cover in robot.covers.items()
    }
    return replace(robot, description=replace(description, links=links, joints=joints), covers=covers)


def _shift(by: Matrix) -> Matrix:
    pose = np.eye(4)
    pose[:3, 3] = by
    return pose


def _link(link: Link, move: Matrix) -> Link:
    inertial = link.inertial
    if inertial is not None:
        inertial = replace(inertial, pose=np.linalg.inv(move) @ inertial.pose)
    return replace(
        link,
        collisions=_geometries(link.collisions, move),
        visuals=_geometries(link.visuals, move),
        inertial=inertial,
    )


def _geometries(geometries: Iterable[Geometry], move: Matrix) -> tuple[Geometry, ...]:
    if not move[:3, 3].any():
        return tuple(geometries)
    return tuple(replace(one, pose=np.linalg.inv(move) @ one.pose) for one in geometries)


def _joint(joint: Joint, moves: dict[str, Matrix], zeros: dict[str, float]) -> Joint:
    origin = joint.origin
    if joint.parent in moves:
        origin = np.linalg.inv(moves[joint.parent]) @ origin
    mimic = joint.mimic
    if mimic is not None:
        mimic = replace(mimic, offset=mimic.offset + mimic.multiplier * zeros[mimic.joint] - joint.zero)
    return replace(
        joint,
        origin=origin @ moves[joint.child],
        anchor=(0.0, 0.0, 0.0),
        zero=0.0,
        lower=joint.lower - joint.zero,
        upper=joint.upper - joint.zero,
        mimic=mimic,
    )

"""From links and joints, as a file has them, to a tree of links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from .._errors import Error
from ._model import COORDINATES, Description, Format, Inertial, Joint, Link, Mimic
from ._xml import Notes

Part = TypeVar("Part", Link, Joint)


@dataclass(frozen=True)
class Parts:
    """What a reader found in a file, before it is known to hang together."""

    name: str
    links: Sequence[Link]
    joints: Sequence[Joint]
    disabled: Mapping[tuple[str, str], str] = field(default_factory=dict)
    home: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  #: coordinates of joints that the file states


def assemble(parts: Parts, source: Path, kind: Format, notes: Notes) -> Description:
    """The tree of all links that hang together with the first root; what does not is named in the notes.

    Raises
    ------
    Error
        If there is no link, or none without a parent.
    """
    links = _unique(parts.links, "link", notes)
    joints = _with_one_parent(_unique(parts.joints, "joint", notes), links, notes)
    if not links:
        raise Error(f"{source}: has no link", "bad_file")
    children = {joint.child for joint in joints.values()}
    roots = [link for link in links.values() if link.name not in children]
    if not roots:
        raise Error(f"{source}: every link is some joint's child, so none is the root; take one joint out", "bad_file")
    placed, used = _from_root(roots, links, list(joints.values()))
    for link in links.values():
        if link.name not in placed:
            notes.add("error", _loose(link, roots, placed[0]), link.where, link.name)
    for link in map(links.__getitem__, placed):
        _look_at(link.inertial, link, notes)
    ordered = _mimics(used, notes)
    return Description(
        parts.name,
        tuple(links[name] for name in placed),
        tuple(ordered),
        source,
        kind,
        {pair: why for pair, why in parts.disabled.items() if all(name in placed for name in pair)},
        tuple(notes.all),
        tuple(x for joint in ordered if joint.coordinates for x in parts.home.get(joint.name, _middle(joint))),
    )


def _middle(joint: Joint) -> tuple[float, ...]:
    """Zero, or the limit next to it."""
    if joint.kind in ("ball", "floating"):
        return (0.0,) * (joint.coordinates - 1) + (1.0,)
    return (float(np.clip(0, joint.lower, joint.upper)),) * joint.coordinates


def _unique(all_of_them: Sequence[Part], what: str, notes: Notes) -> dict[str, Part]:
    out: dict[str, Part] = {}
    for one in all_of_them:
        if one.name in out:
            text = f"there is another {what} {one.name} at {out[one.name].where}; this one is left out"
            notes.add("error", text, one.where)
        else:
            out[one.name] = one
    return out


def _with_one_parent(joints: dict[str, Joint], links: dict[str, Link], notes: Notes) -> dict[str, Joint]:
    """The joints whose links there are, each link being the child of one."""
    out = {}
    parent_of: dict[str, Joint] = {}
    for joint in joints.values():
        unknown = [name for name in (joint.parent, joint.child) if name not in links]
        if unknown:
            text = f"joint {joint.name}: there is no link {' and no link '.join(unknown)}; it is left out"
            notes.add("error", text, joint.where)
        elif joint.child in parent_of:
            other = parent_of[joint.child]
            text = f"joint {joint.name}: hangs on joint {other.name} ({other.where}) already; a loop cannot be closed, "
            notes.add("error", text + "and this joint is left out", joint.where, joint.child)
        else:
            parent_of[joint.child] = joint
            out[joint.name] = joint
    return out


def _from_root(roots: list[Link], links: dict[str, Link], joints: list[Joint]) -> tuple[list[str], list[Joint]]:
    """Names of links, parents first, and the joints in their order, of the root with the most links."""
    best: tuple[list[str], list[Joint]] = ([], [])
    below: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints:
        below[joint.parent].append(joint)
    for root in roots:
        names, used = [root.name], []
        stack = below[root.name][::-1]
        while stack:
            joint = stack.pop()
            names.append(joint.child)
            used.append(joint)
            stack += below[joint.child][::-1]
        if len(names) > len(best[0]):
            best = names, used
    return best


def _loose(link: Link, roots: list[Link], root: str) -> str:
    why = "no joint has it as its child" if link in roots else "its joints go round in a circle, or hang on such a link"
    return f"does not hang together with the root {root} ({why}); it is left out"


def _mimics(joints: list[Joint], notes: Notes) -> list[Joint]:
    """The joints, each mimic of a mimic following the one that moves by itself."""
    by_name = {joint.name: joint for joint in joints}
    out = []
    for joint in joints:
        leader, multiplier, offset, steps = joint, 1.0, 0.0, 0
        while leader.mimic and leader.mimic.joint in by_name and steps <= len(joints):
            offset += multiplier * leader.mimic.offset
            multiplier *= leader.mimic.multiplier
            leader, steps = by_name[leader.mimic.joint], steps + 1
        if not joint.mimic:
            out.append(joint)
        elif leader.mimic or leader.coordinates != 1 or COORDINATES[joint.kind] != 1:
            text = f"joint {joint.name}: cannot follow {joint.mimic.joint}, {_why_not(leader, joint, by_name)}"
            notes.add("warning", f"{text}; it moves by itself here", joint.where, joint.child)
            out.append(replace(joint, mimic=None))
        else:
            out.append(replace(joint, mimic=Mimic(leader.name, multiplier, offset)))
    return out


def _why_not(leader: Joint, joint: Joint, by_name: Mapping[str, Joint]) -> str:
    if COORDINATES[joint.kind] != 1:
        return f"being {joint.kind}"
    if leader.mimic:
        if leader.mimic.joint not in by_name:
            return f"as there is no joint {leader.mimic.joint}"
        return "which follows it in turn"
    return f"as {leader.name} is {leader.kind}"


def _look_at(inertial: Inertial | None, link: Link, notes: Notes) -> None:
    """Warns of what no rigid body has."""
    if inertial is None:
        return
    least, middle, most = np.linalg.eigvalsh(inertial.inertia)
    if inertial.mass <= 0 or most <= 0:
        text = "its mass or its inertia is zero: MuJoCo refuses that, Pinocchio gives NaN, others make something up"
    elif least < 0 or most > (least + middle) * (1 + 1e-6):
        text = f"no body has principal moments of {least:.3g}, {middle:.3g}, {most:.3g}: none exceeds the others' sum"
    else:
        return
    notes.add("warning", f"{text}; write the whole inertial", link.where, link.name)

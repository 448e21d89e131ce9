"""Reads the pairs of links that an SRDF, MoveIt's companion of a URDF, calls never in contact."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ._xml import BadElement, Notes, Reader, parse


def read_srdf(path: Path, links: Collection[str], notes: Notes) -> dict[tuple[str, str], str]:
    """Pairs as sorted tuples of names, with the reason given. A pair of a link that there is not becomes a note."""
    reader = Reader(path)
    out: dict[tuple[str, str], str] = {}
    root = parse(path)
    for element in root.iter("disable_default_collisions"):
        one = element.get("link") or ""
        out.update({pair_of(one, other): "default" for other in links if other != one and one in links})
    for element in root.iter("disable_collisions", "enable_collisions"):
        try:
            one, other = reader.text(element, "link1"), reader.text(element, "link2")
            unknown = [name for name in (one, other) if name not in links]
            if unknown:
                raise reader.fail(element, f"the robot has no link {' and no link '.join(unknown)}")
        except BadElement as error:
            notes.add("warning", f"{error.text}; this pair is left out", error.where)
            continue
        if element.tag == "enable_collisions":
            out.pop(pair_of(one, other), None)
        else:
            out[pair_of(one, other)] = element.get("reason") or "given"
    return out


def pair_of(one: str, other: str) -> tuple[str, str]:
    """The pair as all of prolate.robots writes it."""
    return (one, other) if one <= other else (other, one)

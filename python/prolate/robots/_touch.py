"""Which links touch each other always, sometimes or never, and what covers change about that; found by sampling."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from ._baked import BakedRobot
from ._checks import Checks
from ._model import Description, MeshShape
from ._robot import Robot
from ._srdf import pair_of
from ._write_srdf import write_srdf

if TYPE_CHECKING:
    from numpy.typing import NDArray

_BLOCK = 4096  # configurations a call, which bounds the memory of N x P answers


class PairTouch(NamedTuple):
    """How often two links touch.

    Attributes
    ----------
    links : tuple of 2 str
        In the order of the alphabet.
    exact, covers : float
        In which part of the samples their meshes touch, and their covers.
    home, covers_home : bool
        Do they in the description's ``home``?
    """

    links: tuple[str, str]
    exact: float
    covers: float
    home: bool
    covers_home: bool

    @property
    def added(self) -> float:
        """In which part of the samples only covers touch; 1 if they do at home."""
        return 1.0 if self.covers_home and not self.home else self.covers - self.exact


@dataclass(frozen=True, eq=False)
class Touches:
    """What :func:`touches` found.

    ``adjacent`` are pairs that a joint connects, or that nothing moves against each other. All others are ``pairs``,
    those that touch most often first.
    """

    description: Description
    pairs: tuple[PairTouch, ...]
    adjacent: tuple[tuple[str, str], ...]
    samples: int

    def disabled(self) -> dict[tuple[str, str], str]:
        """Pairs that need no check, with the reason, as MoveIt's assistant chooses them, and those of the description.

        The keys are what ``write_mjcf(exclude=...)`` takes. ``"never"`` is no proof: it holds for all samples of the
        covers. ``"always"`` is of the meshes, never of covers alone: what only covers bring into contact stays
        one that counts, to be mended by finer covers. So does what touches at ``home``, which MoveIt excludes.
        """
        found: dict[tuple[str, str], str] = dict.fromkeys(self.adjacent, "adjacent")
        for pair in self.pairs:
            if pair.exact == 1:
                found[pair.links] = "always"
            elif pair.covers == 0:
                found[pair.links] = "never"
        return {**found, **self.description.disabled}

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Write :meth:`disabled` as SRDF. Raises Error, ``code`` ``"io"``."""
        write_srdf(path, self.description.name, self.disabled())

    def table(self) -> str:
        """How many pairs touch, and a line of text for each: ``new`` if only their covers do."""
        known = self.disabled()
        touching = [pair for pair in self.pairs if pair.covers > 0 or pair.covers_home]
        counts = [sum(which(pair) for pair in self.pairs) for which in _COUNTED.values()]
        lines = [f"of {len(self.pairs)} pairs, beside {len(self.adjacent)} of neighbours, in {self.samples} samples:"]
        lines += [f"    {count:5} {what}" for what, count in zip(_COUNTED, counts)]
        lines.append(f"{'pair':56} {'meshes':>8} {'covers':>8}")
        for pair in touching:
            words = [known.get(pair.links, "new" if pair.exact == 0 else ""), "at home" if pair.home else ""]
            words.append("covers at home" if pair.covers_home and not pair.home else "")
            what = ", ".join(filter(None, words))
            lines.append(f"{' '.join(pair.links):56} {pair.exact:8.2%} {pair.covers:8.2%}  {what}".rstrip())
        return "\n".join(lines)


_COUNTED: dict[str, Callable[[PairTouch], bool]] = {
    "touch by their meshes": lambda pair: pair.exact > 0,
    "touch by their covers": lambda pair: pair.covers > 0,
    "touch by their meshes at home": lambda pair: pair.home,
    "touch by their covers at home": lambda pair: pair.covers_home,
}


def touches(
    exact: BakedRobot, covers: BakedRobot, *, samples: int = 10_000, seed: int = 0, threads: int = 0
) -> Touches:
    """Ask at random configurations which links touch.

    Parameters
    ----------
    exact, covers : BakedRobot
        The same robot, baked with ``exact=True`` and as it is to be used.
    samples : int
        How many configurations, uniform within the joints' limits; 1 or more.
    seed : int
        The same one gives the same samples.
    threads : int
        0 = all cores.

    Raises
    ------
    ValueError
        ``samples`` is below 1.

    Thread-safe.
    """
    if samples < 1:
        raise ValueError(f"samples: must be 1 or more, not {samples}")
    meshes, stand_ins = (_checks(robot) for robot in (exact, covers))
    q = meshes.kinematics.random(samples, seed)
    names = [pair_of(pair.link, pair.other) for pair in meshes.pairs()]
    of_exact, of_covers = (_rates(checks, q, threads) for checks in (meshes, stand_ins))
    home = np.array([exact.description.home])
    at_home, covers_at_home = (_rates(checks, home, threads) for checks in (meshes, stand_ins))
    found = [
        PairTouch(name, of_exact[name], of_covers.get(name, 0.0), at_home[name] > 0, covers_at_home.get(name, 0.0) > 0)
        for name in names
    ]
    found.sort(key=lambda pair: (-pair.exact, -pair.covers, pair.links))
    held = [link.name for link in exact.description.links if link.name in exact.covers]
    every = {pair_of(a, b) for i, a in enumerate(held) for b in held[i + 1 :]}
    return Touches(exact.description, tuple(found), tuple(sorted(every - set(names))), samples)


def mend(
    exact: BakedRobot,
    covers: BakedRobot,
    *,
    most: float = 0.01,
    rounds: int = 2,
    samples: int = 10_000,
    seed: int = 0,
    threads: int = 0,
    **options: Any,
) -> tuple[BakedRobot, Touches]:
    """Covers that seldom bring links into contact whose meshes are not.

    Links that touch by their covers alone, at home or in more than ``most`` of the samples, are covered anew: to stick
    out by half as much, by up to four times as many bodies, and hulls of four times as many vertices. So they stay
    checked, where excluding the pair would hide real contacts.

    Parameters
    ----------
    exact, covers : BakedRobot
        As for :func:`touches`.
    most : float
        Part of the samples in which covers alone may touch.
    rounds : int
        How often this is done.
    samples, seed, threads
        As for :func:`touches`.
    **options
        Of :meth:`Robot.bake`, but for goals.

    Returns
    -------
    BakedRobot, Touches
        Covers, and what they still bring into contact.
    """
    found = touches(exact, covers, samples=samples, seed=seed, threads=threads)
    stuck: set[str] = set()  # links that cannot be covered more closely
    for _ in range(rounds):
        names = {name for pair in found.pairs if pair.added > most for name in pair.links if name in covers.covers}
        names = {name for name in names - stuck if covers.covers[name].clearance > 0}
        if not names:
            break
        closer = _closer(covers, names, threads=threads, **options)
        stuck |= names - set(closer.covers)
        notes = [note for note in covers.notes if note.link not in closer.covers]
        notes += [note for note in closer.notes if note.link in closer.covers]
        covers = replace(covers, covers={**covers.covers, **closer.covers}, notes=tuple(notes))
        found = touches(exact, covers, samples=samples, seed=seed, threads=threads)
    return covers, found


def _closer(robot: BakedRobot, names: set[str], **options: Any) -> BakedRobot:
    """These links alone, as far as they can be covered more closely."""
    links = tuple(link if link.name in names else replace(link, collisions=()) for link in robot.description.links)
    now = {name: robot.covers[name] for name in names}
    limits = {name: cover.clearance / 2 for name, cover in now.items()}
    bodies = 4 * max(16, *(len(cover.geometries) for cover in now.values()))
    hulls = [one.shape for cover in now.values() for one in cover.geometries if isinstance(one.shape, MeshShape)]
    corners = 4 * max([64, *(len(hull.vertices) for hull in hulls)])
    more = {**options, "max_ellipsoids": bodies, "max_hull_vertices": corners}
    part = Robot(replace(robot.description, links=links))
    baked = part.bake(clearance=max(limits.values()), finer=limits, **more)
    better = {name: one for name, one in baked.covers.items() if one.proved and one.clearance < now[name].clearance}
    return replace(baked, covers=better)


def _checks(robot: BakedRobot) -> Checks:
    """Of all pairs of links but neighbours, whatever the description says of them."""
    return replace(robot, description=replace(robot.description, disabled={})).checks


def _rates(checks: Checks, q: NDArray[np.float64], threads: int) -> dict[tuple[str, str], float]:
    """In which part of the configurations each pair touches."""
    names = [pair_of(pair.link, pair.other) for pair in checks.pairs()]
    counts = np.zeros(len(names), dtype=np.int64)
    for first in range(0, len(q), _BLOCK):
        counts += checks.collide(q[first : first + _BLOCK], first_only=False, threads=threads).sum(axis=0)
    return {name: float(count) / len(q) for name, count in zip(names, counts)}

"""SRDF, MoveIt's companion of a URDF."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Union
from xml.etree.ElementTree import Element, SubElement

from ._writing import Files


def write_srdf(path: Union[str, os.PathLike[str]], name: str, pairs: Mapping[tuple[str, str], str]) -> None:
    """The pairs as SRDF, in whole or not at all. Raises Error, ``code`` ``"io"``."""
    # MoveIt's words. Its assistant asks what touches at home, "Default", before what touches "Always", so that word is
    # hardly ever written; and SAPIEN 3.0.3 obeys "Default" alone (findings/sapien-srdf-reasons.sh).
    reasons = {"adjacent": "Adjacent", "always": "Default", "never": "Never"}
    root = Element("robot", name=name)
    for (one, other), reason in pairs.items():
        SubElement(root, "disable_collisions", link1=one, link2=other, reason=reasons.get(reason, reason))
    files = Files.at(path)
    files.xml(root, "Pairs of links that are not checked for contact, by prolate")
    files.write()

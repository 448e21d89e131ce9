"""How callers write poses."""

from __future__ import annotations

from typing import Literal

Order = Literal["xyzw", "wxyz"]


IDENTITY: dict[str, tuple[int, ...]] = {"xyzw": (0, 0, 0, 0, 0, 0, 1), "wxyz": (0, 0, 0, 1, 0, 0, 0)}

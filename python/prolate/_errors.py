"""The exception of everything that is no mistake in an argument."""

from __future__ import annotations

from typing import Literal

ErrorCode = Literal[
    "bad_options",
    "bad_mesh",
    "bad_file",
    "newer_version",
    "io",
    "cancelled",
    "unsupported",
    "internal",
    "out_of_memory",
    "bad_id",
]


class Error(Exception):
    """A mesh, a file or the operating system stood in the way.

    Arguments of a wrong type, shape or range raise ``TypeError`` or ``ValueError`` instead.

    Attributes
    ----------
    code : str
        What kind of failure: ``"bad_mesh"``, ``"bad_file"``, ``"newer_version"``, ``"io"``, ``"cancelled"``,
        ``"unsupported"``, ``"out_of_memory"``, ``"bad_id"``, ``"bad_options"`` or ``"internal"``.
    where : int
        The byte offset, the index of a triangle or vertex, or the ``errno``, that the message is about; 0 if none.
    """

    code: ErrorCode
    where: int

    def __init__(self, message: str, code: ErrorCode, where: int = 0) -> None:
        super().__init__(message)
        self.code = code
        self.where = where

    def __reduce__(self) -> tuple[type[Error], tuple[str, ErrorCode, int]]:
        return Error, (str(self), self.code, self.where)

"""The exception of everything that is no mistake in an argument, and checks of arguments that many functions have."""

from __future__ import annotations

import os
from typing import Literal, Union

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


def path_of(name: str, path: Union[str, bytes, os.PathLike[str]]) -> str:
    """The path as text that the system can take."""
    try:
        text = os.fsdecode(path)
        raw = os.fsencode(text)
    except TypeError:
        raise TypeError(f"{name}: must be a path, not {type(path).__name__}") from None
    except UnicodeError:
        raise ValueError(f"{name}: cannot be a file's name in this system's encoding") from None
    if b"\0" in raw:
        raise ValueError(f"{name}: no path has a zero byte")
    return text


def check_callable(name: str, function: object) -> None:
    if function is not None and not callable(function):
        raise TypeError(f"{name}: must be callable, not {type(function).__name__}")


def truth(name: str, value: object) -> bool:
    try:
        return bool(value)
    except (TypeError, ValueError):  # arrays
        raise TypeError(f"{name}: must be True or False, not {type(value).__name__}") from None

"""Paths, and files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile


def name(path: str | os.PathLike[str]) -> str:
    """The path as a text. A number is none, though Python opens it as a file descriptor, and closes that in the end."""
    found = os.fspath(path) if isinstance(path, (str, os.PathLike)) else None
    if not isinstance(found, str):
        raise TypeError(f"path: expected a str or a path, found {type(path).__name__}")
    return found


def write(path: str | os.PathLike[str], text: str) -> None:
    """Write a text to a file, which holds either all of it or what it held before."""
    path = name(path)
    folder = os.path.dirname(path) or "."
    handle, passing = tempfile.mkstemp(dir=folder, prefix=".thetahat-")
    try:
        with open(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(passing, 0o666 & ~umask)
        os.replace(passing, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(passing)
        raise

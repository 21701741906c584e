"""Paths."""

from __future__ import annotations

import os


def name(path: str | os.PathLike[str]) -> str:
    """The path as a text. A number is none, though Python opens it as a file descriptor, and closes that in the end."""
    found = os.fspath(path) if isinstance(path, (str, os.PathLike)) else None
    if not isinstance(found, str):
        raise TypeError(f"path: expected a str or a path, found {type(path).__name__}")
    return found

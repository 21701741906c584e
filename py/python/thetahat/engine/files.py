"""Paths, and URLs of fsspec."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from thetahat import _thetahat


def name(path: str | os.PathLike[str]) -> str:
    """The path as a text. A number is none, though Python opens it as a file descriptor, and closes that in the end."""
    found = os.fspath(path) if isinstance(path, (str, os.PathLike)) else None
    if not isinstance(found, str):
        raise TypeError(f"path: expected a str or a path, found {type(path).__name__}")
    return found


def is_url(path: str | os.PathLike[str]) -> bool:
    """Whether it is one of fsspec, such as ``s3://bucket/log.csv``."""
    return isinstance(path, str) and "://" in path


@contextmanager
def local(path: str | os.PathLike[str]) -> Iterator[str]:
    """The file at a path, or what is at a URL, copied into a file that goes afterwards."""
    if not is_url(path):
        yield os.fspath(path)
        return
    fsspec = _fsspec()
    with tempfile.TemporaryDirectory(prefix="thetahat-") as folder:
        copy = os.path.join(folder, "log")
        try:
            with fsspec.open(path, "rb") as source, open(copy, "wb") as target:
                shutil.copyfileobj(source, target)
        except (OSError, ValueError, ImportError) as error:
            raise OSError(f"{path}: cannot be read: {error}; check the URL, and that its package is installed") from error
        yield copy


def write_anywhere(path: str, text: str) -> None:
    """Write a text to a file, whole or not at all, or to a URL; its folder is made."""
    if is_url(path):
        filesystem, place = _fsspec().core.url_to_fs(path)
        filesystem.makedirs(filesystem._parent(place), exist_ok=True)
        with filesystem.transaction, filesystem.open(place, "w", encoding="utf-8") as file:
            file.write(text)
        return
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    _thetahat.write(path, text)


def _fsspec() -> Any:
    try:
        import fsspec
    except ImportError:
        raise ImportError("a URL needs fsspec; install it: pip install fsspec") from None
    return fsspec

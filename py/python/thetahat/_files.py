"""Files are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile


def write(path: str | os.PathLike[str], text: str) -> None:
    """Write a text to a file, which holds either all of it or what it held before."""
    folder = os.path.dirname(os.fspath(path)) or "."
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

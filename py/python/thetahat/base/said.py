"""What the package warns of: said at once, or kept where it is one of many."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_kept: ContextVar[list[str] | None] = ContextVar("kept", default=None)


class EstimationWarning(UserWarning):
    """What to know of a model before relying on it, such as missing samples or a search that did not converge."""


def warn(message: str, category: type[Warning] = UserWarning, stacklevel: int = 1) -> None:
    """Warn as `warnings.warn` does, or keep the words for who asked for them."""
    words = _kept.get()
    if words is None:
        warnings.warn(message, category, stacklevel=stacklevel + 1)
    else:
        words.append(message)


@contextmanager
def kept() -> Iterator[list[str]]:
    """Keep what is warned of in this thread instead of saying it: `warnings.catch_warnings` is one for all threads."""
    words: list[str] = []
    token = _kept.set(words)
    try:
        yield words
    finally:
        _kept.reset(token)

"""What the package warns of: said at once, or kept where it is one of many."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing_extensions import deprecated as deprecated
else:

    def deprecated(message: str) -> Callable[[Any], Any]:
        """A method that still works, and says that it has another name: PEP 702, for Pythons that do not have it."""

        def of(method: Any) -> Any:
            @wraps(method)
            def called(*arguments: Any, **options: Any) -> Any:
                warn(message, DeprecationWarning)
                return method(*arguments, **options)

            called.__deprecated__ = message
            return called

        return of


_kept: ContextVar[list[str] | None] = ContextVar("kept", default=None)


class EstimationWarning(UserWarning):
    """What to know of a model before relying on it, such as missing samples or a search that did not converge."""


_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep


def warn(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line that called into the package, or keep the words for who asked for them."""
    words = _kept.get()
    if words is not None:
        words.append(message)
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and os.path.abspath(frame.f_code.co_filename).startswith(_PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


@contextmanager
def kept() -> Iterator[list[str]]:
    """Keep what is warned of in this thread instead of saying it: `warnings.catch_warnings` is one for all threads."""
    words: list[str] = []
    token = _kept.set(words)
    try:
        yield words
    finally:
        _kept.reset(token)

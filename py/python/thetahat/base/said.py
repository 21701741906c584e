"""What the package warns of: said at once, or kept where it is one of many."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import TYPE_CHECKING, Any, Literal

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


LOGGER = logging.getLogger("thetahat")
"""The logger of the package: what was fitted at level INFO, and warnings where `warnings_as` says so."""
LOGGER.addHandler(logging.NullHandler())

Action = Literal["warn", "raise", "log", "ignore"]

_action: Action = "warn"


class warnings_as:  # noqa: N801
    """What becomes of warnings of this package: from now on, or within a ``with`` block.

    Parameters
    ----------
    action : {"warn", "raise", "log", "ignore"}
        Python's warnings, which is how it begins; exceptions; records of the logger ``"thetahat"``; or nothing. Models keep their own in
        `Model.warnings`.

    Examples
    --------
    >>> import thetahat as th
    >>> short = th.dc_motor()[:40]
    >>> with th.warnings_as("ignore"):
    ...     model = th.bj(short, nb=2, nc=2, nd=2, nf=2)
    >>> len(model.warnings) > 0
    True
    """

    def __init__(self, action: Action) -> None:
        global _action
        if action not in ("warn", "raise", "log", "ignore"):
            raise ValueError(f"action: {action!r} is none of 'warn', 'raise', 'log' and 'ignore'")
        self._before = _action
        _action = action

    def __enter__(self) -> None:
        pass

    def __exit__(self, *raised: object) -> None:
        global _action
        _action = self._before


def warn(message: str, category: type[Warning] = UserWarning) -> None:
    """Warn at the line that called into the package, or keep the words for who asked for them."""
    words = _kept.get()
    if words is not None:
        words.append(message)
        return
    if _action != "warn" and category is not DeprecationWarning:
        if _action == "raise":
            raise category(message)
        if _action == "log":
            LOGGER.warning("%s", message)
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

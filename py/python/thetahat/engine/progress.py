"""How far long work is: a bar of tqdm, a line, or a function of the caller."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Optional, Union

from thetahat import _thetahat

Told = Callable[[int, Optional[int], Optional[float]], Any]
"""A function of how many models, logs or iterations are done, of how many, where that is known, and the least cost so far."""

Progress = Union[bool, Told, None]
"""True for a bar of tqdm, or a line on standard error where there is no tqdm; or a function that is told."""


@contextmanager
def told(progress: Progress, what: str) -> Iterator[None]:
    """Tell of the progress of compiled work that this thread waits for."""
    with shown(progress, what) as tell:
        before = _thetahat.progress(tell)
        try:
            yield
        finally:
            _thetahat.progress(before)


@contextmanager
def shown(progress: Progress, what: str) -> Iterator[Told | None]:
    """The function to tell, if anybody wants to know."""
    if progress is None or progress is False:
        yield None
    elif progress is not True:
        if not callable(progress):
            raise TypeError(f"progress: expected True, False or a function of (done, total, best), found {progress!r}")
        yield progress
    else:
        show = _bar(what) or _Line(what)
        try:
            yield show.tell
        finally:
            show.close()


class _Line:
    """A line that is written over, on standard error."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._written = 0

    def tell(self, done: int, total: int | None, best: float | None) -> None:
        text = f"{self._what}: {done}{'' if total is None else f' of {total}'}{'' if best is None else f', best {best:.6g}'}"
        sys.stderr.write("\r" + text.ljust(self._written))
        sys.stderr.flush()
        self._written = len(text)

    def close(self) -> None:
        if self._written:
            sys.stderr.write("\n")


class _Bar:
    """A bar of tqdm."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def tell(self, done: int, total: int | None, best: float | None) -> None:
        self._bar.total = total
        self._bar.n = done
        if best is not None:
            self._bar.set_postfix(best=f"{best:.6g}", refresh=False)
        self._bar.refresh()

    def close(self) -> None:
        self._bar.close()


def _bar(what: str) -> _Bar | None:
    try:
        bars = import_module("tqdm.auto")
    except ImportError:
        return None
    return _Bar(bars.tqdm(desc=what, leave=True))

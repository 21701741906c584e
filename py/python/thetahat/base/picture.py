"""Small pictures for notebooks, which need no plotting library."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import numpy.typing as npt

_WIDTH, _HEIGHT = 320, 40
_COLOURS = ("currentColor", "#d95f02")


def rows(title: str, lines: Sequence[tuple[str, Sequence[npt.NDArray[np.float64]]]]) -> str:
    """A title and a row for each name with its signals, one over the other."""
    body = "".join(
        f"<tr><td style='text-align:left'>{escape(name)}</td><td>{_line(signals)}</td></tr>" for name, signals in lines
    )
    return f"<div><code>{escape(title)}</code><table>{body}</table></div>"


def _line(signals: Sequence[npt.NDArray[np.float64]]) -> str:
    finite = np.concatenate([signal[np.isfinite(signal)] for signal in signals])
    if finite.size == 0:
        return ""
    low, high = float(finite.min()), float(finite.max())
    span = high - low or 1.0
    paths = []
    for signal, colour in zip(signals, _COLOURS):
        points = []
        # Least and greatest of as many rows as share a pixel, so that peaks stay.
        for index, part in enumerate(np.array_split(signal, min(_WIDTH, len(signal)))):
            part = part[np.isfinite(part)]
            for value in (part.min(), part.max()) if part.size else ():
                x = index * _WIDTH / min(_WIDTH, len(signal))
                points.append(f"{x:.1f},{_HEIGHT - 1 - (value / span - low / span) * (_HEIGHT - 2):.1f}")
        paths.append(f"<polyline points='{' '.join(points)}' fill='none' stroke='{colour}'/>")
    return f"<svg width='{_WIDTH}' height='{_HEIGHT}' role='img'>{''.join(paths)}</svg>"

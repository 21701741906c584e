"""What the functions of `thetahat.plot` share: checks of what is to be drawn, axes to draw into, bands, labels."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import TextWrapper
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from thetahat.engine import options as _options
from thetahat.models.model import Model

Array = npt.NDArray[np.float64]

_MANY = 20_000
"""More points than this are drawn by their outline."""
_BINS = 4000
"""Into how many bins they go: more than a picture has pixels from left to right."""
_SIZE = 9.0
"""The size of the letters of a legend, in points."""
_CHARACTER = 5.5
"""How wide a letter is on average, in points."""
_HANDLE = 6
"""How many letters are as wide as the line in front of an entry of a legend."""


def expect(argument: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        raise TypeError(f"{argument}: expected a {kind.__name__}, found {type(value).__name__}")


def named(models: Any, kinds: tuple[type, ...]) -> list[tuple[str, Any]]:
    """What to draw, with names for a legend: those given, or what each is."""
    if isinstance(models, kinds):
        models = [models]
    if isinstance(models, Mapping):
        named = [(_options.text("models", name), one) for name, one in models.items()]
    elif isinstance(models, Sequence) and not isinstance(models, str):
        named = [(one.name if isinstance(one, Model) else "response", one) for one in models]
        names = [name for name, _ in named]
        if len(set(names)) < len(names):
            named = [(f"{index}: {name}", one) for index, (name, one) in enumerate(named, 1)]
    else:
        raise TypeError(f"models: expected a Model, several or a dict of them, found {type(models).__name__}")
    if not named:
        raise ValueError("models: there is none; give at least one")
    for _, one in named:
        if not isinstance(one, kinds):
            expected = " or ".join(kind.__name__ for kind in kinds)
            raise TypeError(f"models: expected a {expected}, found {type(one).__name__}")
    return named


def chosen(names: Sequence[str], which: int | str | None, argument: str = "output") -> list[str]:
    """One of several channels, by its position or its name; all of them without."""
    if which is None:
        return list(names)
    if isinstance(which, str):
        if which not in names:
            raise ValueError(f"{argument}: there is no {argument} '{which}'; there are: {', '.join(names) or 'none'}")
        return [which]
    place = _options.integer(argument, which)
    if not 0 <= place < len(names):
        raise ValueError(f"{argument}: there is no {argument} {place}; there are {len(names)}, counted from 0")
    return [names[place]]


def one(ax: Axes | None) -> Axes:
    """The axes to draw into."""
    if ax is None:
        made: Axes = plt.subplots(layout="constrained")[1]
        return made
    expect("ax", ax, Axes)
    return ax


def grid(
    axes: Any, rows: int, columns: int, sharex: bool = True, argument: str = "axes", height: float = 2.2
) -> npt.NDArray[Any]:
    """Rows and columns of axes to draw into, the rows of this height in inches; of one row or column, or of one pair of
    axes, fewer dimensions do too."""
    if axes is None:
        # Many columns are narrower, so that a page still holds them.
        wide = max(2.4, min(4.8, 14.4 / columns))
        size = (max(6.4, wide * columns), max(4.8, height * rows))
        made: npt.NDArray[Any] = plt.subplots(
            rows, columns, squeeze=False, sharex="col" if sharex else False, figsize=size, layout="constrained"
        )[1]
        return made
    given: npt.NDArray[Any] = np.asarray(axes, dtype=np.object_)
    line = (max(rows, columns),)
    if given.shape != (rows, columns) and not (1 in (rows, columns) and given.size == line[0] and given.ndim < 2):
        expected = (rows, columns) if 1 not in (rows, columns) else line
        raise ValueError(f"{argument}: expected shape {expected}, found {given.shape}")
    for ax in given.flat:
        expect(argument, ax, Axes)
    return given.reshape(rows, columns)


def alone(axes: npt.NDArray[Any]) -> Any:
    """One pair of axes for itself, several as they are."""
    return axes.item() if axes.size == 1 else axes


def curve(ax: Axes, x: Array, values: Array, **style: Any) -> Line2D:
    """A line; of many points those that are seen."""
    x, values = _outline(x, values)
    if "marker" not in style:
        style |= _lone(values)
    line: Line2D = ax.plot(x, values, **style)[0]
    return line


def band(ax: Axes, x: Array, low: Array, high: Array, colour: Any, alpha: float | None = 0.2) -> Any:
    """An area between two curves; None where none is known."""
    if not np.isfinite(high - low).any():
        return None
    if len(x) > _MANY:
        x, low, high = _outer(x, low, high)
    return ax.fill_between(x, low, high, color=colour, alpha=alpha, linewidth=0)


def _bins(values: Array, fill: float) -> Array:
    """Bins of as many neighbours as share a point of a picture, one in each row."""
    size = -(-len(values) // _BINS)
    return np.pad(values, (0, -len(values) % size), constant_values=fill).reshape(-1, size)


def _outline(x: Array, values: Array) -> tuple[Array, Array]:
    """Of many points the least and the greatest of each bin, and where the line breaks."""
    if len(x) <= _MANY:
        return x, values
    bins = _bins(values, np.nan)
    first = np.arange(len(bins)) * bins.shape[1]
    least = first + np.argmin(np.where(np.isnan(bins), np.inf, bins), axis=1)
    greatest = first + np.argmax(np.where(np.isnan(bins), -np.inf, bins), axis=1)
    kept = np.unique(np.concatenate([[0, len(x) - 1], least, greatest, np.flatnonzero(np.isnan(x))]))
    return x[kept], values[kept]


def _outer(x: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Of a band of many points the outermost ends of each bin; none where no point has one."""
    bins = _bins(x, np.nan)
    there = np.isfinite(bins)
    counts = there.sum(axis=1)
    middle = np.where(counts > 0, np.where(there, bins, 0.0).sum(axis=1) / np.maximum(counts, 1), np.nan)
    # The least of what is turned over is the greatest.
    ends = [np.min(np.where(np.isnan(of), np.inf, of), axis=1) for of in (_bins(low, np.nan), _bins(-high, np.nan))]
    lower, upper = (np.where(np.isinf(end), np.nan, end) for end in ends)
    return middle, lower, -upper


def label_one(bands: Sequence[Any], level: float) -> None:
    """Puts the first band into the legend."""
    for band in [band for band in bands if band is not None][:1]:
        band.set_label(f"{100 * level:g} % band")


def correlation(ax: Axes, lags: npt.NDArray[np.int_], values: Array, half: Array) -> None:
    """A correlation with its band."""
    ax.axhline(0, color="0.6", linewidth=0.8)
    # A value's band is as wide as its place.
    edges = np.ravel(np.column_stack([lags - 0.5, lags + 0.5]))
    wide = np.repeat(half, 2)
    ax.fill_between(edges, -wide, wide, color="0.5", alpha=0.25, linewidth=0, label="95 % band")
    ax.vlines(lags, 0, values)
    ax.plot(lags, values, "o", markersize=3)
    ax.set_xlabel("lag [samples]")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def _lone(values: Array) -> dict[str, Any]:
    """Dots for values that have no neighbour to draw a line to."""
    there = np.concatenate([[False], np.isfinite(values), [False]])
    lone = there[1:-1] & ~there[:-2] & ~there[2:]
    return {"marker": ".", "markevery": lone} if lone.any() else {}


def scale_to(ax: Axes, measured: Sequence[Array], modelled: Sequence[Array]) -> None:
    """What diverges leaves the chart, which shows as much again above and below what was measured."""
    there = np.concatenate([values[np.isfinite(values)] for values in measured])
    if there.size == 0:
        return
    low, high = there.min(), there.max()
    span = high - low or abs(high) or 1.0
    low, high = low - span, high + span
    if any(np.any((values < low) | (values > high)) for values in modelled):
        ax.set_ylim(low, high)


def fixed(value: float, decimals: int) -> str:
    """This many decimals, or powers of ten where that is wider than twelve characters."""
    text = f"{value:.{decimals}f}"
    return text if len(text) <= 12 else f"{value:.4e}"


def percent(measured: Array, values: Array) -> float:
    """The fit where both are there; NaN where there is none."""
    both = np.isfinite(measured) & np.isfinite(values)
    measured = measured[both]
    spread = float(np.linalg.norm(measured - measured.mean())) if both.any() else 0.0
    return 100 * (1 - float(np.linalg.norm(measured - values[both])) / spread) if spread > 0 else np.nan


def verdict(null: str, p: float | None, alpha: float) -> str:
    """What a test finds of its null hypothesis at the level alpha; nothing where it could not be made."""
    return "" if p is None else f": {null if p >= alpha else f'not {null}'}, p = {p:.2g}"


def shown(text: str) -> str:
    """A text that matplotlib shows as it is: no formula between dollars, and no label left out for an underscore."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def title(ax: Axes, text: str) -> None:
    """A title in as many lines as it needs."""
    ax.set_title(shown(_lines(text, _extent(ax)[0])), fontsize="medium")


def ylabel(ax: Axes, text: str) -> None:
    """A label of the y axis in as many lines as it needs."""
    ax.set_ylabel(shown(_lines(text, _extent(ax)[1])))


def legend(axes: Any) -> None:
    """A legend of one pair of axes, or of an array of them above the first, where it covers nothing: below the title, and
    above the factor of the ticks."""
    entries: dict[str, Any] = {}
    given = np.ravel(np.asarray(axes, dtype=np.object_))
    for one in given:
        for handle, label in zip(*one.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    if not entries:
        return
    ax: Axes = given[0]
    width = _extent(ax)[0]
    texts = [_lines(label.replace(r"\$", "$"), width - _HANDLE) for label in entries]
    longest = max(len(line) for text in texts for line in text.split("\n"))
    columns = max(1, min(len(texts), int(width // (longest + _HANDLE))))
    # A column at a time: the highest of each row counts.
    rows = -(-len(texts) // columns)
    height = sum(max(text.count("\n") + 1 for text in texts[row::rows]) for row in range(rows))
    axis = ax.yaxis
    axis.get_major_formatter().set_locs(axis.get_majorticklocs().tolist())
    raised = 1.3 * _SIZE if axis.get_major_formatter().get_offset() else 2.0
    above = raised / (ax.get_window_extent().height * 72 / ax.figure.dpi)
    made = ax.legend(
        list(entries.values()),
        list(entries),
        loc="lower left",
        bbox_to_anchor=(0, 1 + above),
        ncol=columns,
        fontsize=_SIZE,
        frameon=False,
        borderaxespad=0,
        borderpad=0.2,
        labelspacing=0.2,
    )
    for text, label in zip(made.get_texts(), texts):
        text.set_text(shown(label))
    if ax.get_title():
        # As matplotlib leaves no place for a legend.
        ax.set_title(ax.get_title(), fontsize="medium", pad=raised + 1.4 * _SIZE * height + 4)


def _extent(ax: Axes) -> tuple[int, int]:
    """How many characters fit beside one another along the x axis and the y axis."""
    box = ax.get_window_extent()
    point = 72 / ax.figure.dpi
    return max(12, int(box.width * point / _CHARACTER)), max(12, int(box.height * point / _CHARACTER))


def _lines(text: str, width: int) -> str:
    """A long text in lines of this many characters; a short one as it is."""
    if len(text) <= width:
        return text
    # Figures stay beside what they are of.
    return _Wrapper(max(width, 12)).fill(text.replace(" = ", "\0=\0")).replace("\0", " ")


class _Wrapper(TextWrapper):
    """Lines end after blanks and underscores."""

    wordsep_re = re.compile(r"(\s+|(?<=_))")

"""What the functions of `thetahat.plot` share: checks of what is to be drawn, axes to draw into, bands, labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, log as ln
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from thetahat.engine import options as _options
from thetahat.logs.log import Log
from thetahat.models.model import Model

Array = npt.NDArray[np.float64]


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


def one(ax: Axes | None) -> Axes:
    """The axes to draw into."""
    if ax is None:
        made: Axes = plt.subplots(layout="constrained")[1]
        return made
    expect("ax", ax, Axes)
    return ax


def grid(axes: Any, rows: int, columns: int, sharex: bool = True) -> npt.NDArray[Any]:
    """Rows and columns of axes to draw into; of one column or row, or one alone, fewer dimensions do too."""
    if axes is None:
        size = (max(6.4, 4.8 * columns), max(4.8, 2.2 * rows))
        made: npt.NDArray[Any] = plt.subplots(
            rows, columns, squeeze=False, sharex="col" if sharex else False, figsize=size, layout="constrained"
        )[1]
        return made
    given: npt.NDArray[Any] = np.asarray(axes, dtype=np.object_)
    line = (max(rows, columns),)
    if given.shape != (rows, columns) and not (1 in (rows, columns) and given.size == line[0] and given.ndim < 2):
        expected = (rows, columns) if 1 not in (rows, columns) else line
        raise ValueError(f"axes: expected shape {expected}, found {given.shape}")
    for ax in given.flat:
        expect("axes", ax, Axes)
    return given.reshape(rows, columns)


def band(ax: Axes, x: Array, low: Array, high: Array, colour: Any) -> Any:
    """An area between two curves; None where none is known."""
    if not np.isfinite(high - low).any():
        return None
    return ax.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)


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
    ax.legend()


def region(ax: Axes, root: Mapping[str, Any], half: float, level: float, colour: Any) -> None:
    """Where a root lies with this probability: an ellipse, of a real root an interval."""
    if root["covariance"] is None:
        return
    covariance = np.array(root["covariance"], dtype=np.float64)
    if not np.isfinite(covariance).all():
        return
    if covariance[1, 1] == 0:
        spread = half * float(np.sqrt(covariance[0, 0]))
        ax.plot([root["re"] - spread, root["re"] + spread], [root["im"]] * 2, color=colour, linewidth=1.2)
        return
    variances, directions = np.linalg.eigh(covariance)
    width, height = 2 * np.sqrt(-2 * ln(1 - level) * np.maximum(variances, 0))
    angle = float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0])))
    ax.add_patch(Ellipse((root["re"], root["im"]), width, height, angle=angle, fill=False, color=colour))


def _time(log: Log) -> Array:
    """The time of each row: that of the log; of several experiments, each begins one sample after the one before it."""
    time = log.time.copy()
    for rows in log.experiments[1:]:
        time[rows.start : rows.stop] += time[rows.start - 1] + log.sample_time - time[rows.start]
    return time


def broken(log: Log, values: Array) -> tuple[Array, Array]:
    """Time and values, with a break of the line where the clock has a gap, and where an experiment begins."""
    time = _time(log)
    gaps = np.flatnonzero(np.diff(time) > 1.5 * log.sample_time) + 1
    starts = np.union1d(gaps, [rows.start for rows in log.experiments[1:]]).astype(np.intp)
    return np.insert(time, starts, np.nan), np.insert(values, starts, np.nan)


def gapped(time: Array, *values: Array) -> list[Array]:
    """Time and values, with a break of the line where rows are missing, or where another experiment begins."""
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    starts = np.flatnonzero((steps > 1.5 * usual) | (steps <= 0)) + 1
    return [np.insert(one, starts, np.nan) for one in (time, *values)]


def boundaries(ax: Axes, log: Log) -> None:
    """A line between each experiment and the one before it."""
    time = _time(log)
    for rows in log.experiments[1:]:
        ax.axvline(time[rows.start] - log.sample_time / 2, color="0.7", linewidth=0.8, linestyle=":")


def lone(values: Array) -> dict[str, Any]:
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


def verdict(null: str, p: float, alpha: float) -> str:
    """What a test finds of its null hypothesis at the level alpha; nothing where it could not be made."""
    return f": {null if p >= alpha else f'not {null}'}, p = {p:.2g}" if isfinite(p) else ""


def shown(text: str) -> str:
    """A text that matplotlib shows as it is: no formula between dollars, and no label left out for an underscore."""
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text

"""Pictures of logs, and of their inspections."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from thetahat.base import numbers as _numbers
from thetahat.logs.inspection import Inspection
from thetahat.logs.log import Log
from thetahat.plot import drawing as _drawing
from thetahat.plot.timeline import Timeline

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""


def log(log: Log, axes: Any = None, *, output: int | str | None = None) -> Grid:
    """The signals of a log over time: each output, and below them each input.

    Where the clock of the log has dates, the axis of time has them too, in the time zone of the log.

    Parameters
    ----------
    log : Log
        The data. Inputs are drawn as held from one sample to the next. Experiments follow one another, whatever their
        clocks say, with a line where one begins; where the log has dates, they lie at these, unless most of the axis
        would lie between them. More than 20000 rows are drawn by their outline: the least and the greatest of neighbours.
    axes : array_like of Axes, shape (outputs + inputs,), optional
        Where to draw.
    output : int or str, optional
        Which of several outputs, by its position or its name; all of them, unless said otherwise.

    Returns
    -------
    ndarray of Axes, shape (outputs + inputs,)

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> [ax.get_ylabel() for ax in plot.log(th.dc_motor())]
    ['y', 'u']
    """
    _drawing.expect("log", log, Log)
    signals = [(name, "default") for name in _drawing.chosen(log.outputs, output)]
    signals += [(name, "steps-post") for name in log.inputs]
    grid = _drawing.grid(axes, len(signals), 1)[:, 0]
    timeline = Timeline.of_log(log)
    for ax, (name, style) in zip(grid, signals):
        time, values = timeline.broken(log[name])
        _drawing.curve(ax, time, values, drawstyle=style)
        _drawing.ylabel(ax, name)
    timeline.onto(grid)
    return grid


def inspection(inspection: Inspection, axes: Any = None) -> Grid:
    """What a log is worth: the spectrum of each input, and its correlation with the output, which shows delay and feedback.

    Parameters
    ----------
    inspection : Inspection
        Of `thetahat.inspect`.
    axes : array_like of Axes, shape (inputs, 2), optional
        Where to draw.

    Returns
    -------
    ndarray of Axes, shape (inputs, 2)

    Raises
    ------
    ValueError
        If the log has no inputs.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> plot.inspection(th.inspect(th.dc_motor()))[0, 1].get_title()
    'from u to y: a delay of 1 sample'
    """
    _drawing.expect("inspection", inspection, Inspection)
    document = inspection.document
    delays = {delay["input"]: delay for delay in document["delays"]}
    if not document["excitation"]:
        raise ValueError("inspection: the log has no inputs; there is nothing to draw")
    output = next((channel["name"] for channel in document["channels"] if channel["role"] == "output"), "the output")
    grid = _drawing.grid(axes, len(document["excitation"]), 2, sharex=False, height=2.6)
    for (left, right), excitation in zip(grid, document["excitation"]):
        name = excitation["input"]
        # Frequency 0 has no place on a logarithmic axis.
        points = [point for point in excitation["spectrum"] or () if point["frequency"] > 0 and point["density"]]
        left.plot([point["frequency"] for point in points], [point["density"] for point in points])
        left.set_xscale("log")
        left.set_yscale("log")
        left.set_xlabel("frequency [rad/s]")
        left.set_ylabel("power density")
        _drawing.title(left, f"spectrum of {name}")
        title = f"from {name} to {output}"
        delay = delays.get(name)
        if delay is not None:
            # At negative lags the input comes after the output.
            following = delay.get("following", [])
            values = _numbers.of_document([*reversed(following), *delay["correlation"]])
            band = np.full(len(values), delay["band"], dtype=np.float64)
            _drawing.correlation(right, np.arange(len(values)) - len(following), values, band)
            nk = delay["nk"]
            title += ": no delay found" if nk is None else f": a delay of {nk} sample{'' if nk == 1 else 's'}"
        _drawing.ylabel(right, "prewhitened correlation")
        _drawing.title(right, title)
    _drawing.legend(grid[:, 1])
    return grid

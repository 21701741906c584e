"""Pictures of logs, and of their inspections."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from thetahat.base import numbers as _numbers
from thetahat.logs.inspection import Inspection
from thetahat.logs.log import Log
from thetahat.plot import drawing as _drawing

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""


def log(log: Log, axes: Any = None) -> Grid:
    """The signals of a log over time: the output, and below it each input.

    Parameters
    ----------
    log : Log
        The data. Inputs are drawn as held from one sample to the next. Experiments follow one another, whatever their
        clocks say, with a line where one begins.
    axes : array_like of Axes, shape (1 + inputs,), optional
        Where to draw.

    Returns
    -------
    ndarray of Axes, shape (1 + inputs,)

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> [ax.get_ylabel() for ax in plot.log(th.dc_motor())]
    ['y', 'u']
    """
    _drawing.expect("log", log, Log)
    signals = [(log.output, log.y, "default")]
    signals += [(name, values, "steps-post") for name, values in zip(log.inputs, log.u.T)]
    grid = _drawing.grid(axes, len(signals), 1)[:, 0]
    for ax, (name, values, style) in zip(grid, signals):
        time, values = _drawing.broken(log, values)
        ax.plot(time, values, drawstyle=style, **_drawing.lone(values))
        ax.set_ylabel(_drawing.shown(name))
        _drawing.boundaries(ax, log)
    grid[-1].set_xlabel("time [s]")
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
    grid = _drawing.grid(axes, len(document["excitation"]), 2, sharex=False)
    for (left, right), excitation in zip(grid, document["excitation"]):
        name = excitation["input"]
        # Frequency 0 has no place on a logarithmic axis.
        points = [point for point in excitation["spectrum"] or () if point["frequency"] > 0 and point["density"]]
        left.plot([point["frequency"] for point in points], [point["density"] for point in points])
        left.set_xscale("log")
        left.set_yscale("log")
        left.set_xlabel("frequency [rad/s]")
        left.set_ylabel("power density")
        left.set_title(_drawing.shown(f"spectrum of {name}"))
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
        right.set_ylabel("prewhitened correlation")
        right.set_title(_drawing.shown(title))
    return grid

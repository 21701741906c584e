"""Pictures of responses: to frequencies, steps and impulses of models, and those of a step test. `thetahat.plot` has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from thetahat.engine import options as _options
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.experiments.step_test import StepTest
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.models.responses import FrequencyResponse, TransientResponse
from thetahat.plot import drawing as _drawing

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""

Models = Union[Model, Sequence[Model], Mapping[str, Model]]
"""A model, several, or several by name."""

Response = Union[Model, FrequencyResponse, MeasuredResponse]
"""What has a frequency response."""

Responses = Union[Response, Sequence[Response], Mapping[str, Response]]
"""One of these, several, or several by name."""


def bode(
    models: Responses,
    w: npt.ArrayLike | None = None,
    axes: Any = None,
    *,
    sources: Sequence[str] | str | None = None,
    output: int | str | None = None,
    level: float = 0.95,
) -> Grid:
    """Magnitude and phase over frequency.

    Parameters
    ----------
    models : Model, FrequencyResponse or MeasuredResponse, or a sequence of them, or dict of str to them
        What to draw; models beside a measured response lie over it.
    w : array_like, optional
        Frequencies in radians per second, as for `thetahat.Model.frequency_response`.
    axes : array_like of Axes, shape (2, sources), optional
        Where to draw: the magnitudes, and below them the phases. Of one source, shape (2,) does too.
    sources : str or sequence of str, optional
        The inputs to draw the responses to, or ``"noise"``; all inputs, unless said otherwise, or the noise where there are
        none.
    output : int or str, optional
        Of which output, where models have several: its position, or its name.
    level : float, default 0.95
        The probability with which the bands hold the response at a frequency.

    Returns
    -------
    ndarray of Axes, shape (2, sources)

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> log = th.dc_motor()
    >>> models = {"arx": th.arx(log, na=2, nb=2), "oe": th.oe(log, nb=2, nf=2)}
    >>> axes = plot.bode(models)
    >>> axes.shape
    (2, 1)
    >>> axes[1, 0].get_xlabel()
    'frequency [rad/s]'
    >>> axes = plot.bode({"measured": th.spectrum(log), **models})
    """
    found: list[tuple[str, FrequencyResponse]] = []
    for name, one in _drawing.named(models, (Model, FrequencyResponse, MeasuredResponse)):
        if w is not None and not isinstance(one, Model):
            raise TypeError(f"w: a {type(one).__name__} has its own frequencies; leave it out")
        if isinstance(one, MeasuredResponse):
            one = one.to_frequency_response()
        found.append((name, one.frequency_response(w, points=300, output=output) if isinstance(one, Model) else one))
    there_are = list(dict.fromkeys(source for _, response in found for source in response.sources))
    # The noise comes last, where a model says what becomes of it.
    inputs = [source for source in there_are if source != "noise"]
    wanted = [sources] if isinstance(sources, str) else list(inputs or there_are if sources is None else sources)
    for source in wanted:
        if source not in there_are:
            raise ValueError(f"sources: there is no {source}; there are: {', '.join(there_are)}")
    half = _options.quantile(level)
    grid = _drawing.grid(axes, 2, len(wanted))
    for column, source in enumerate(wanted):
        above, below = grid[:, column]
        bands = []
        for name, response in found:
            if source not in response.sources:
                continue
            row = response.sources.index(source)
            x, magnitude, phase = response.frequencies, response.magnitude[row], np.degrees(response.phase[row])
            (line,) = above.plot(x, magnitude, label=_drawing.shown(name), **_drawing.lone(magnitude))
            below.plot(x, phase, label=_drawing.shown(name), color=line.get_color(), **_drawing.lone(phase))
            spread = half * response.magnitude_errors[row]
            # The logarithm of what is not above zero has no place.
            lowest = np.min(magnitude[magnitude > 0], initial=np.inf) / 10
            low = np.maximum(magnitude - spread, lowest)
            bands.append(_drawing.band(above, x, low, magnitude + spread, line.get_color()))
            spread = half * np.degrees(response.phase_errors[row])
            _drawing.band(below, x, phase - spread, phase + spread, line.get_color())
        _drawing.label_one(bands, level)
        above.set_title(_drawing.shown(f"from {source}"))
        above.set_xscale("log")
        above.set_yscale("log")
        below.set_xscale("log")
        below.set_xlabel("frequency [rad/s]")
        above.legend()
    grid[0, 0].set_ylabel("magnitude")
    grid[1, 0].set_ylabel("phase [°]")
    return grid


def step(
    models: Models,
    input: int | str = 0,
    samples: int | None = None,
    ax: Axes | None = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Axes:
    """The response of the output to a unit step of an input, from rest.

    Parameters
    ----------
    models : Model, or a sequence of them, or dict of str to Model
        What to draw.
    input : int or str, default 0
        Which input, by its place or name.
    samples : int, optional
        How many; until each has settled, unless said otherwise.
    ax : Axes, optional
        Where to draw.
    output : int or str, optional
        Of which output, where models have several: its position, or its name.
    level : float, default 0.95
        The probability with which the band holds the response at a time.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> ax = plot.step(th.arx(th.dc_motor(), na=2, nb=2))
    >>> ax.get_ylabel()
    'y per unit of u'
    """
    return _transient("step", Model.step_response, models, input, samples, ax, output, level)


def impulse(
    models: Models,
    input: int | str = 0,
    samples: int | None = None,
    ax: Axes | None = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Axes:
    """The impulse responses of models, with their bands.

    Parameters
    ----------
    models, input, samples, ax, output, level
        As for `step`.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> ax = plot.impulse(th.arx(th.dc_motor(), na=2, nb=2))
    >>> ax.get_xlabel()
    'time since the impulse [s]'
    """
    return _transient("impulse", Model.impulse_response, models, input, samples, ax, output, level)


def step_test(test: StepTest, log: Log, ax: Axes | None = None) -> Axes:
    """The responses of a step test, each from 0 before its step to 1 in the final steady state.

    Parameters
    ----------
    test : StepTest
        What was read off. Where there is a time constant to trust, the response of a first order lies over the data, and where there is a
        damping that of a second.
    log : Log
        The log that it was read off.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> t = np.arange(300)
    >>> log = th.Log(1 - np.exp(-np.maximum(t - 50, 0) / 20), np.where(t < 50, 0.0, 1.0), sample_time=1.0)
    >>> plot.step_test(th.step_test(log), log).get_xlabel()
    'time since the step [s]'
    """
    _drawing.expect("test", test, StepTest)
    _drawing.expect("log", log, Log)
    ax = _drawing.one(ax)
    time, values = log.time, log.select(output=test.output).y
    longest = 0.0
    for number, step in enumerate(test.steps, start=1):
        response = step["response"]
        if response is None:
            continue
        first, last = step["after"][0] - 1, step["after"][1]
        before, regime = response["initial"]["value"], response["regime"]["value"]
        since = time[first:last] - time[first]
        ax.plot(since, (values[first:last] - before) / (regime - before), ".", label=f"step {number}")
        longest = max(longest, float(since[-1]))
    grid = np.linspace(0, longest, 400)
    figures = {of["figure"] for of in test.document["summary"] if of["trusted"]}
    if figures & {"time-constant", "damping"} and longest > 0:
        later = np.maximum(grid - test.value("dead-time"), 0)
        if "time-constant" in figures:
            modelled, name = 1 - np.exp(-later / test.value("time-constant")), "first order"
        else:
            damping, frequency = test.value("damping"), test.value("natural-frequency")
            rest = np.sqrt(1 - damping**2)
            angle = frequency * rest * later
            decay = np.exp(-damping * frequency * later)
            modelled, name = 1 - decay * (np.cos(angle) + damping / rest * np.sin(angle)), "second order"
        ax.plot(grid, modelled, color="black", label=name)
    ax.set_xlabel("time since the step [s]")
    ax.set_ylabel(_drawing.shown(f"{test.output}, as a fraction of its change"))
    ax.legend()
    return ax


def _transient(
    what: str,
    respond: Callable[..., TransientResponse],
    models: Models,
    input: int | str,
    samples: int | None,
    ax: Axes | None,
    output: int | str | None,
    level: float,
) -> Axes:
    half = _options.quantile(level)
    found = []
    for name, model in _drawing.named(models, (Model,)):
        if isinstance(input, str) and input not in model.inputs:
            raise ValueError(f"input: {name} has no input {input}; there are: {', '.join(model.inputs) or 'none'}")
        index = model.inputs.index(input) if isinstance(input, str) else input
        response = respond(model, index, samples, output=output)
        found.append((name, response, f"{model.outputs[model._output(output)]} per unit of {model.inputs[index]}"))
    ax = _drawing.one(ax)
    bands = []
    for name, response, _ in found:
        (line,) = ax.plot(response.time, response.values, label=_drawing.shown(name), **_drawing.lone(response.values))
        spread = half * response.standard_errors
        bands.append(
            _drawing.band(ax, response.time, response.values - spread, response.values + spread, line.get_color())
        )
    _drawing.label_one(bands, level)
    ax.set_xlabel(f"time since the {what} [s]")
    ax.set_ylabel(_drawing.shown(", ".join(dict.fromkeys(unit for _, _, unit in found))))
    ax.legend()
    return ax

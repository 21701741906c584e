"""Pictures of responses: to frequencies, steps and impulses of models, and those of a step test. `thetahat.plot` has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil
from typing import Any, NamedTuple, Union

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, MultipleLocator

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
    decibels: bool = False,
    hertz: bool = False,
) -> Grid:
    """Magnitude and phase over frequency.

    Parameters
    ----------
    models : Model, FrequencyResponse or MeasuredResponse, or a sequence of them, or dict of str to them
        What to draw; models beside a measured response lie over it.
    w : array_like, optional
        Frequencies in radians per second, as for `thetahat.Model.frequency_response`.
    axes : array_like of Axes, shape (2 outputs, sources), optional
        Where to draw: the magnitudes of an output, and below them the phases. Of one source, shape (2 outputs,) does
        too.
    sources : str or sequence of str, optional
        The inputs to draw the responses to, or ``"noise"``; all inputs, unless said otherwise, or the noise where there are
        none.
    output : int or str, optional
        Of which output, where models have several: its position, or its name; of all of them, unless said otherwise.
    level : float, default 0.95
        The probability with which the bands hold the response at a frequency.
    decibels : bool, default False
        Magnitudes in decibels, 20 log10 of them.
    hertz : bool, default False
        The axis of frequency in hertz; ``w`` stays in radians per second.

    Returns
    -------
    ndarray of Axes, shape (2 outputs, sources)

    Notes
    -----
    Phases do not jump, and lie on the branch nearest to that of the first response. Where a phase is not known to half a
    turn, its band is a full turn.

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
    >>> axes = plot.bode({"measured": th.spectrum(log), **models}, decibels=True)
    >>> axes[0, 0].get_ylabel()
    'magnitude [dB]'
    """
    found: list[tuple[str, FrequencyResponse]] = []
    for name, one in _drawing.named(models, (Model, FrequencyResponse, MeasuredResponse)):
        if w is not None and not isinstance(one, Model):
            raise TypeError(f"w: a {type(one).__name__} has its own frequencies; leave it out")
        if isinstance(one, MeasuredResponse):
            one = one.to_frequency_response()
        if isinstance(one, Model):
            outputs = _drawing.chosen(one.outputs, output)
            found += [(name, one.frequency_response(w, points=300, output=to)) for to in outputs]
        else:
            found.append((name, one))
    there_are = list(dict.fromkeys(source for _, response in found for source in response.sources))
    # The noise comes last, where a model says what becomes of it.
    inputs = [source for source in there_are if source != "noise"]
    wanted = [sources] if isinstance(sources, str) else list(inputs or there_are if sources is None else sources)
    for source in wanted:
        if source not in there_are:
            raise ValueError(f"sources: there is no {source}; there are: {', '.join(there_are)}")
    half = _options.quantile(level)
    # A response of which it is not known is of the first output.
    outputs = list(dict.fromkeys(response.output for _, response in found if response.output is not None))
    outputs = outputs or [""]
    colours = {name: f"C{place}" for place, name in enumerate(dict.fromkeys(name for name, _ in found))}
    grid = _drawing.grid(axes, 2 * len(outputs), len(wanted))
    for row, to in enumerate(outputs):
        of_output = [(name, response) for name, response in found if (response.output or outputs[0]) == to]
        for above, below, source in zip(grid[2 * row], grid[2 * row + 1], wanted):
            bands, first = [], None
            for name, response in of_output:
                if source not in response.sources:
                    continue
                curve = _Curve.of(response, source, half, hertz)
                first = first or curve
                curve = curve.on_branch_of(first)
                bands.append(curve.draw(above, below, decibels, colours[name], _drawing.shown(name)))
            _drawing.label_one(bands, level)
            _drawing.title(above, f"from {source}" + (f" to {to}" if len(outputs) > 1 else ""))
            for ax in (above, below):
                ax.set_xscale("log")
            if not decibels:
                above.set_yscale("log")
            below.yaxis.set_major_locator(_Degrees())
        grid[2 * row, 0].set_ylabel("magnitude [dB]" if decibels else "magnitude")
        grid[2 * row + 1, 0].set_ylabel("phase [°]")
    for ax in grid[-1]:
        ax.set_xlabel("frequency [Hz]" if hertz else "frequency [rad/s]")
    _drawing.legend(grid)
    return grid


class _Curve(NamedTuple):
    """A frequency response from one source, with half its bands."""

    frequencies: _drawing.Array
    magnitude: _drawing.Array
    magnitude_half: _drawing.Array
    phase: _drawing.Array
    """Degrees."""
    phase_half: _drawing.Array

    @classmethod
    def of(cls, response: FrequencyResponse, source: str, half: float, hertz: bool) -> _Curve:
        row = response.sources.index(source)
        # More than half a turn to each side says nothing.
        spread = np.minimum(half * np.degrees(response.phase_errors[row]), 180.0)
        x = response.frequencies / (2 * np.pi) if hertz else response.frequencies
        magnitude, phase = response.magnitude[row], np.degrees(response.phase[row])
        return cls(x, magnitude, half * response.magnitude_errors[row], phase, spread)

    def on_branch_of(self, other: _Curve) -> _Curve:
        """The same with as many turns as the other has, where both are known."""
        mine, yours = np.isfinite(self.phase), np.isfinite(other.phase)
        if not (mine.any() and yours.any()):
            return self
        x, xs = self.frequencies[mine], other.frequencies[yours]
        there = np.interp(x, xs, other.phase[yours], left=np.nan, right=np.nan)
        apart = (there - self.phase[mine])[np.isfinite(there)]
        turns = 360.0 * round(float(np.median(apart)) / 360.0) if apart.size else 0.0
        return self if turns == 0 else self._replace(phase=self.phase + turns)

    def draw(self, above: Axes, below: Axes, decibels: bool, colour: str, label: str) -> Any:
        """Draws both, and gives the band of the magnitude."""
        x, positive = self.frequencies, self.magnitude[self.magnitude > 0]
        # The logarithm of what is not above zero has no place.
        low = np.maximum(self.magnitude - self.magnitude_half, np.min(positive, initial=np.inf) / 10)
        curves = [self.magnitude, low, self.magnitude + self.magnitude_half]
        if decibels:
            curves = [20 * np.log10(np.where(curve > 0, curve, np.nan)) for curve in curves]
        _drawing.curve(above, x, curves[0], color=colour, label=label)
        _drawing.curve(below, x, self.phase, color=colour, label=label)
        _drawing.band(below, x, self.phase - self.phase_half, self.phase + self.phase_half, colour)
        return _drawing.band(above, x, curves[1], curves[2], colour)


class _Degrees(MaxNLocator):
    """Ticks at quarters and eighths of a turn, where the axis has as much."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        turned = abs(vmax - vmin)
        if turned < 90:
            return super().tick_values(vmin, vmax)
        step = next((step for step in (45, 90, 180, 360) if turned <= 6 * step), 360 * ceil(turned / 2160))
        return MultipleLocator(step).tick_values(vmin, vmax)


def step(
    models: Models,
    input: int | str | None = None,
    samples: int | None = None,
    ax: Any = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Any:
    """The responses of the outputs to a unit step of each input, from rest.

    Parameters
    ----------
    models : Model, or a sequence of them, or dict of str to Model
        What to draw.
    input : int or str, optional
        Which input, by its place or name; each of them, unless said otherwise.
    samples : int, optional
        How many; until each has settled, unless said otherwise.
    ax : Axes, or array_like of them, shape (outputs, inputs), optional
        Where to draw.
    output : int or str, optional
        Of which output, where models have several: its position, or its name; of all of them, unless said otherwise.
    level : float, default 0.95
        The probability with which the band holds the response at a time.

    Returns
    -------
    Axes, or ndarray of Axes, shape (outputs, inputs), where there are several of either

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
    input: int | str | None = None,
    samples: int | None = None,
    ax: Any = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Any:
    """The impulse responses of models, with their bands.

    Parameters
    ----------
    models, input, samples, ax, output, level
        As for `step`.

    Returns
    -------
    Axes, or ndarray of Axes, shape (outputs, inputs), where there are several of either

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
        What was read off. Where there is a time constant to trust, the response of a first order lies over the data, and
        where there is a damping that of a second.
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
    _drawing.ylabel(ax, f"{test.output}, as a fraction of its change")
    _drawing.legend(ax)
    return ax


def _transient(
    what: str,
    respond: Callable[..., TransientResponse],
    models: Models,
    input: int | str | None,
    samples: int | None,
    ax: Any,
    output: int | str | None,
    level: float,
) -> Any:
    half = _options.quantile(level)
    named = _drawing.named(models, (Model,))
    found: dict[tuple[str, str], list[tuple[int, str, TransientResponse]]] = {}
    for place, (name, model) in enumerate(named):
        if not model.inputs:
            raise ValueError(f"input: {name} has no inputs to make a {what} of; plot.bode draws what becomes of its noise")
        if isinstance(input, str) and input not in model.inputs:
            raise ValueError(f"input: {name} has no input {input}; there are: {', '.join(model.inputs)}")
        for to in _drawing.chosen(model.outputs, output):
            for source in _drawing.chosen(model.inputs, input, "input"):
                response = respond(model, source, samples, output=to)
                found.setdefault((to, source), []).append((place, name, response))
    outputs, inputs = (list(dict.fromkeys(pair[side] for pair in found)) for side in (0, 1))
    grid = _drawing.grid(ax, len(outputs), len(inputs), sharex=False, argument="ax")
    for row, to in zip(grid, outputs):
        for on, source in zip(row, inputs):
            bands = []
            for place, name, response in found.get((to, source), []):
                time, values, spread = response.time, response.values, half * response.standard_errors
                _drawing.curve(on, time, values, color=f"C{place}", label=_drawing.shown(name))
                bands.append(_drawing.band(on, time, values - spread, values + spread, f"C{place}"))
            _drawing.label_one(bands, level)
            _drawing.ylabel(on, f"{to} per unit of {source}")
    for on in grid[-1]:
        on.set_xlabel(f"time since the {what} [s]")
    _drawing.legend(grid)
    return _drawing.alone(grid)

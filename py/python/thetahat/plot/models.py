"""Pictures of models: what they say of a log, what they leave, and the search for them."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.ticker import MaxNLocator

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.engine import options as _options
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.models.responses import Forecast
from thetahat.models.validation import Validation, p_value
from thetahat.plot import drawing as _drawing
from thetahat.plot.responses import Models
from thetahat.plot.timeline import Timeline

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""

_CRITERIA = {word: name for word, name, _ in _thetahat.CRITERIA} | {
    "validation": "mean of e² on the validation rows",
    "cv": "mean of e² in cross-validation",
}
_LOGARITHMIC = {word for word, _, logarithmic in _thetahat.CRITERIA if logarithmic}
"""Criteria that are the logarithm of the cost and a penalty."""


def fit(
    models: Models,
    log: Log,
    horizon: int | None = None,
    ax: Any = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Any:
    """The measured outputs, and what models say of them.

    The legend tells the fit of each, 100 (1 - ||y - yhat||/||y - mean(y)||), on the rows that are drawn.

    Parameters
    ----------
    models : Model, or a sequence of them, or dict of str to Model
        What to draw.
    log : Log
        The data, best those that the models were not fitted to.
    horizon : int or None, default None
        Steps ahead; None is a free run: the inputs alone drive the model.
    ax : Axes, or array_like of them, shape (outputs,), optional
        Where to draw.
    output : int or str, optional
        Which output, where models have several: its position, or its name; all of them, unless said otherwise.
    level : float, default 0.95
        The probability with which the band holds the measured output. A free run has no band: nothing is known of how its
        noise began.

    Returns
    -------
    Axes, or ndarray of Axes, shape (outputs,), where there are several outputs

    See Also
    --------
    thetahat.Model.predict : The values.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> log = th.dc_motor()
    >>> ax = plot.fit(th.arx(log[:700], na=2, nb=2), log[700:], horizon=5)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['measured', 'ARX(2, 2, 1), 5 steps ahead: 95.86 %', '95 % band']
    """
    _drawing.expect("log", log, Log)
    named = _drawing.named(models, (Model,))
    wanted = {name: _drawing.chosen(model.outputs, output) for name, model in named}
    # A channel of the log is found by its name, as a prediction finds it.
    measured = {channel: log[channel] for channels in wanted.values() for channel in channels}
    grid = _drawing.grid(ax, len(measured), 1, argument="ax", height=3.2)[:, 0]
    places = dict(zip(measured, grid))
    timeline = Timeline.of_log(log)
    for channel, values in measured.items():
        _drawing.curve(places[channel], *timeline.broken(values), color="0.4", linewidth=1.0, label="measured")
    far = "free run" if horizon is None else "1 step ahead" if horizon == 1 else f"{horizon} steps ahead"
    bands: dict[str, list[Any]] = {channel: [] for channel in measured}
    drawn_all: dict[str, list[_drawing.Array]] = {channel: [] for channel in measured}
    for colour, (name, model) in enumerate(named):
        all_values = model.predict(log, horizon)
        ends = None if horizon is None else np.moveaxis(model.predict_interval(log, horizon, level=level), -1, 0)
        for channel in wanted[name]:
            place, on = model.outputs.index(channel), places[channel]
            values = _column(all_values, place)
            percent = _drawing.percent(measured[channel], values)
            label = f"{name}, {far}" + (f": {_drawing.fixed(percent, 2)} %" if isfinite(percent) else "")
            time, drawn = timeline.broken(values)
            _drawing.curve(on, time, drawn, color=f"C{colour}", linewidth=1.0, label=_drawing.shown(label))
            drawn_all[channel].append(drawn)
            if ends is not None:
                _, low, high = timeline.broken(*(_column(end, place) for end in ends))
                bands[channel].append(_drawing.band(on, time, low, high, f"C{colour}"))
    timeline.onto(grid)
    for channel, on in places.items():
        _drawing.label_one(bands[channel], level)
        _drawing.scale_to(on, [measured[channel]], drawn_all[channel])
        _drawing.ylabel(on, channel)
        _drawing.legend(on)
    return _drawing.alone(grid)


def _column(values: npt.NDArray[np.float64], place: int) -> npt.NDArray[np.float64]:
    """That of an output, where there are several."""
    return values if values.ndim == 1 else values[:, place]


def forecast(
    log: Log,
    forecast: Forecast,
    ax: Any = None,
    *,
    last: int | None = None,
    levels: Sequence[float] = (0.5, 0.8, 0.95),
    output: int | str | None = None,
) -> Any:
    """The end of a log, what is expected after it, and the fan of its intervals.

    Parameters
    ----------
    log : Log
        The log that was forecast; where it goes on after that, what came is drawn too.
    forecast : Forecast
        Of `thetahat.Model.forecast`.
    ax : Axes, or array_like of them, shape (outputs,), optional
        Where to draw.
    last : int, optional
        How many rows before the forecast; three times as many as it has steps, and 30 or more, unless said otherwise.
    levels : sequence of float, default (0.5, 0.8, 0.95)
        The probabilities with which the intervals hold the output at a time; the narrower, the darker.
    output : int or str, optional
        Which of several outputs, by its position or its name; all of them, unless said otherwise.

    Returns
    -------
    Axes, or ndarray of Axes, shape (outputs,), where there are several outputs

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> log = th.dc_motor()
    >>> model = th.arx(log[:900], na=2, nb=2)
    >>> ax = plot.forecast(log[:900], model.forecast(log[:900], 30, log.u[900:930]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['measured', 'forecast', '95 %', '80 %', '50 %']
    """
    _drawing.expect("log", log, Log)
    _drawing.expect("forecast", forecast, Forecast)
    quantiles = {level: _options.quantile(level) for level in sorted(levels, reverse=True)}
    outputs = _drawing.chosen(forecast.outputs, output)
    measured = {name: log[name] for name in outputs}
    steps = len(forecast.values)
    timeline = Timeline.of_log(log)
    # Rows of the last experiment before the forecast.
    own = log.experiments[-1]
    begins = own.start + int(np.searchsorted(log.time[own.start :], forecast.time[0] - log.sample_time / 2))
    if begins == own.start:
        raise ValueError("log: it begins after the forecast; give the log that was forecast")
    shown = max(30, 3 * steps) if last is None else _options.count("last", last)
    first, end = max(0, begins - shown), min(len(log), begins + steps)
    x = timeline.after(begins, forecast.time - log.time[begins - 1], forecast._clock)
    grid = _drawing.grid(ax, len(outputs), 1, argument="ax", height=2.6)[:, 0]
    for on, name in zip(grid, outputs):
        place = forecast.outputs.index(name)
        values, deviations = _column(forecast.values, place), _column(forecast.standard_deviations, place)
        past, drawn = timeline.part(first, end), measured[name][first:end]
        _drawing.curve(on, *past.broken(drawn), color="0.3", linewidth=1.0, label="measured")
        # From the last measured value on.
        known = np.flatnonzero(np.isfinite(drawn[: begins - first]))[-1:]
        time = np.concatenate([past.x[known], x])
        values = np.concatenate([drawn[known], values])
        deviations = np.concatenate([np.zeros(len(known)), deviations])
        _drawing.curve(on, time, values, color="C0", label="forecast")
        for number, (level, quantile) in enumerate(quantiles.items()):
            half = quantile * deviations
            # The narrow ones lie over the wide, as dark as their entries in the legend.
            share = 0.15 + 0.4 * (number + 1) / len(quantiles)
            shade = share * np.array(to_rgb("C0")) + (1 - share) * np.array(to_rgb(on.get_facecolor()))
            band = _drawing.band(on, time, values - half, values + half, tuple(shade), None)
            if band is not None:
                band.set_label(f"{100 * level:g} %")
        _drawing.ylabel(on, name)
    timeline.part(first, end).onto(grid)
    _drawing.legend(grid)
    return _drawing.alone(grid)


def residuals(
    of: Validation | Model, log: Log | None = None, axes: Any = None, *, output: int | str | None = None
) -> Grid:
    """The correlation of the one-step errors with themselves and with each input.

    The titles say what the tests find at the level of the validation, 0.05 unless said otherwise: errors are not white,
    or not independent of an input, where their p-value is below it. White errors stay inside the band at 95 of 100 lags.
    Outside of it at positive lags of an input: past inputs are still in the errors, so the model lacks dynamics or delay.
    At negative lags: the input follows the output, there is feedback.

    Parameters
    ----------
    of : Validation or Model
        What to draw.
    log : Log, optional
        The data to validate a model on.
    axes : array_like of Axes, shape (1 + inputs,), of several outputs (outputs, 1 + inputs), optional
        Where to draw.
    output : int or str, optional
        Which of several outputs, by its position or its name; all of them, unless said otherwise.

    Returns
    -------
    ndarray of Axes, shape (1 + inputs,), of several outputs (outputs, 1 + inputs)

    Raises
    ------
    ValueError
        If there were too few samples to test the residuals.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> log = th.dc_motor()
    >>> axes = plot.residuals(th.armax(log[:700], na=2, nb=2, nc=1), log[700:])
    >>> [ax.get_title() for ax in axes]
    ['residuals: white, p = 0.54', 'residuals and u: independent, p = 0.87']
    """
    if isinstance(of, Model):
        if log is None:
            raise TypeError("log: a model is validated on data; give a Log too")
        of = of.validate(log)
    elif log is not None:
        raise TypeError("log: the validation has a log of its own; leave it out")
    _drawing.expect("of", of, Validation)
    tested = {tests["output"]: tests for tests in of.document["residuals"]}
    wanted = _drawing.chosen([noise["output"] for noise in of.document["noise"]], output)
    if not all(name in tested for name in wanted):
        raise ValueError("of: the residuals could not be tested; there are too few samples")
    several, count = len(wanted) > 1, 1 + len(tested[wanted[0]]["independence"])
    rows, columns = (len(wanted), count) if several else (count, 1)
    grid = _drawing.grid(axes, rows, columns, sharex=False, height=2.6)
    for row, name in zip(grid if several else [grid[:, 0]], wanted):
        tests = tested[name]
        called = f"residuals of {name}" if several else "residuals"
        values = _numbers.of_document(tests["autocorrelation"])[1:]
        _drawing.correlation(row[0], np.arange(1, len(values) + 1), values, np.full(len(values), tests["band"]))
        _drawing.title(row[0], called + _drawing.verdict("white", tests["ljung_box"]["p_value"], of.alpha))
        row[0].set_ylabel("autocorrelation")
        for ax, test in zip(row[1:], tests["independence"]):
            values, half = _numbers.of_document(test["correlation"]), _numbers.of_document(test["band"])
            _drawing.correlation(ax, np.arange(len(values)) - len(values) // 2, values, half)
            verdict = _drawing.verdict("independent", p_value(test), of.alpha)
            _drawing.title(ax, f"{called} and {test['input']}{verdict}")
            ax.set_ylabel("correlation")
    _drawing.legend(grid)
    return grid if several else grid[:, 0]


def selection(model: Model, ax: Axes | None = None) -> Axes:
    """How a model was chosen: cost and criterion of the best model of each size.

    For MDL, AIC and AICc the cost is drawn as its logarithm: what lies between the two curves is the penalty. For the others
    both are in squared units of the output.

    Parameters
    ----------
    model : Model
        A model of `thetahat.search`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the model was not chosen among others.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> model = th.search(th.dc_motor()[:700])
    >>> [text.get_text() for text in plot.selection(model).get_legend().get_texts()]
    ['ln of the mean of e² in the fit', 'MDL', 'chosen: ARMAX(2, 2, 1, 1)']
    """
    _drawing.expect("model", model, Model)
    found = model.selection
    if found is None:
        raise ValueError("model: it was not chosen among others; thetahat.search chooses")
    by = found["select"]
    logarithmic = by in _LOGARITHMIC
    sizes = [one["parameters"] for one in found["of_size"]]
    costs = _numbers.of_document([one["mse"] for one in found["of_size"]])
    costs = np.where(costs > 0, costs, np.nan)
    ax = _drawing.one(ax)
    cost = "ln of the mean of e² in the fit" if logarithmic else "mean of e² in the fit"
    ax.plot(sizes, np.log(costs) if logarithmic else costs, ".--", color="0.5", label=cost)
    scores = _numbers.of_document([one["score"] for one in found["of_size"]])
    ax.plot(sizes, scores, "o-", markersize=4, label=_CRITERIA[by])
    chosen = found["chosen"]
    least = found.get("least")
    if least is not None and least != chosen:
        ax.plot(least["parameters"], least["score"], "o", markersize=11, fillstyle="none", label="least")
    ax.plot(
        chosen["parameters"],
        np.nan if chosen["score"] is None else chosen["score"],
        "*",
        markersize=14,
        fillstyle="none",
        label=f"chosen: {model.name}" if model.kind == "polynomial" else "best polynomial model",
    )
    if not logarithmic:
        ax.set_yscale("log")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("number of parameters")
    ax.set_ylabel(_CRITERIA[by] if logarithmic else "mean of e²")
    _drawing.legend(ax)
    return ax

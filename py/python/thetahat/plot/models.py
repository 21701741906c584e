"""Pictures of models: what they say of a log, what they leave, their roots, and the search for them."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.engine import options as _options
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.models.validation import Validation
from thetahat.plot import drawing as _drawing
from thetahat.plot.responses import Models

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""

_CRITERIA = {word: name for word, name, _ in _thetahat.CRITERIA} | {
    "validation": "mean of e² on the validation rows",
    "cv": "mean of e² in cross-validation",
}
_LOGARITHMIC = {word for word, _, logarithmic in _thetahat.CRITERIA if logarithmic}
"""Criteria that are the logarithm of the cost and a penalty."""

_FARTHEST = 3.0
"""Roots farther out than this are named and not shown: they would make a dot of the unit circle."""


def fit(
    models: Models,
    log: Log,
    horizon: int | None = None,
    ax: Axes | None = None,
    *,
    output: int | str | None = None,
    level: float = 0.95,
) -> Axes:
    """The measured output, and what models say of it.

    The legend tells the fit of each, 100 (1 - ||y - yhat||/||y - mean(y)||), on the rows that are drawn.

    Parameters
    ----------
    models : Model, or a sequence of them, or dict of str to Model
        What to draw.
    log : Log
        The data, best those that the models were not fitted to.
    horizon : int or None, default None
        Steps ahead; None is a free run: the inputs alone drive the model.
    ax : Axes, optional
        Where to draw.
    output : int or str, optional
        Which output, where models have several: its position, or its name.
    level : float, default 0.95
        The probability with which the band holds the measured output. A free run has no band: nothing is known of how its
        noise began.

    Returns
    -------
    Axes

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
    # A channel of the log is found by its name, as a prediction finds it.
    which = {name: model._output(output) for name, model in named}
    measured = {model.outputs[which[name]]: log[model.outputs[which[name]]] for name, model in named}
    ax = _drawing.one(ax)
    for name, values in measured.items():
        time, values = _drawing.broken(log, values)
        label = "measured" if len(measured) == 1 else _drawing.shown(f"measured {name}")
        ax.plot(time, values, color="0.4", linewidth=1.0, label=label, **_drawing.lone(values))
    far = "free run" if horizon is None else "1 step ahead" if horizon == 1 else f"{horizon} steps ahead"
    bands = []
    drawn_all = []
    for name, model in named:
        place = which[name]
        values = _column(model.predict(log, horizon), place)
        percent = _drawing.percent(measured[model.outputs[place]], values)
        time, drawn = _drawing.broken(log, values)
        drawn_all.append(drawn)
        label = _drawing.shown(f"{name}, {far}" + (f": {_drawing.fixed(percent, 2)} %" if isfinite(percent) else ""))
        (line,) = ax.plot(time, drawn, linewidth=1.0, label=label, **_drawing.lone(drawn))
        if horizon is not None:
            ends = np.moveaxis(model.predict_interval(log, horizon, level=level), -1, 0)
            low, high = (_drawing.broken(log, _column(end, place))[1] for end in ends)
            bands.append(_drawing.band(ax, time, low, high, line.get_color()))
    _drawing.label_one(bands, level)
    _drawing.boundaries(ax, log)
    _drawing.scale_to(ax, list(measured.values()), drawn_all)
    ax.set_xlabel("time [s]")
    ax.set_ylabel(_drawing.shown(", ".join(measured)))
    # To find the best place takes long in a long log.
    ax.legend(loc="best" if len(log) <= 20_000 else "upper right")
    return ax


def _column(values: npt.NDArray[np.float64], place: int) -> npt.NDArray[np.float64]:
    """That of an output, where there are several."""
    return values if values.ndim == 1 else values[:, place]


def residuals(of: Validation | Model, log: Log | None = None, axes: Any = None) -> Grid:
    """The correlation of the one-step errors with themselves and with each input.

    The titles say what the tests find at the level of the validation, 0.05 unless said otherwise: errors are not white, or
    not independent of an input, where their p-value is below it. White errors stay inside the band at 95 of 100 lags. Outside of it at positive lags of an input: past inputs are still in
    the errors, so the model lacks dynamics or delay. At negative lags: the input follows the output, there is feedback.

    Parameters
    ----------
    of : Validation or Model
        What to draw.
    log : Log, optional
        The data to validate a model on.
    axes : array_like of Axes, shape (1 + inputs,), optional
        Where to draw.

    Returns
    -------
    ndarray of Axes, shape (1 + inputs,)

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
    if len(of.document["noise"]) > 1:
        raise ValueError("of: there are several outputs; the page of the validation shows them all")
    tests = next(iter(of.document["residuals"]), None)
    if tests is None:
        raise ValueError("of: the residuals could not be tested; there are too few samples")
    inputs = tests["independence"]
    grid = _drawing.grid(axes, 1 + len(inputs), 1, sharex=False)[:, 0]

    values = _numbers.of_document(tests["autocorrelation"])[1:]
    _drawing.correlation(grid[0], np.arange(1, len(values) + 1), values, np.full(len(values), tests["band"]))
    grid[0].set_title("residuals" + _drawing.verdict("white", of.whiteness, of.alpha))
    grid[0].set_ylabel("autocorrelation")
    for ax, test in zip(grid[1:], inputs):
        values = _numbers.of_document(test["correlation"])
        _drawing.correlation(ax, np.arange(len(values)) - len(values) // 2, values, _numbers.of_document(test["band"]))
        name = test["input"]
        verdict = _drawing.verdict("independent", of.independence[name], of.alpha)
        ax.set_title(_drawing.shown(f"residuals and {name}{verdict}"))
        ax.set_ylabel("correlation")
    return grid


def poles_zeros(model: Model, ax: Axes | None = None, *, level: float = 0.95) -> Axes:
    """The poles and zeros of a model in the z plane, with the unit circle.

    Poles inside the circle decay and outside they grow; the nearer to the circle, the more slowly. Complex roots have
    ellipses and real ones intervals that hold the root with the probability ``level``, to first order.

    Parameters
    ----------
    model : Model
        What to draw.
    ax : Axes, optional
        Where to draw.
    level : float, default 0.95
        The probability.

    Returns
    -------
    Axes

    Notes
    -----
    A root with the covariance S of its real and imaginary part lies, with the probability p, where d' S^-1 d is below the
    quantile of chi-square for two degrees of freedom, -2 ln(1 - p). Roots near to one another have no S: there the first
    order does not hold.

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> ax = plot.poles_zeros(th.armax(th.dc_motor(), na=2, nb=2, nc=1))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['poles', 'zeros from u', 'noise zeros']
    """
    _drawing.expect("model", model, Model)
    half = _options.quantile(level)
    own = model.document["model"]
    groups = [("poles", own["poles"], "x")]
    groups += [(f"zeros from {name}", roots, "o") for name, roots in zip(model.inputs, own["zeros"])]
    groups += [("noise poles", own["noise_poles"], "+"), ("noise zeros", own["noise_zeros"], "D")]
    ax = _drawing.one(ax)
    ax.add_patch(Circle((0, 0), 1, fill=False, color="0.6", linewidth=0.8))
    ax.axhline(0, color="0.85", linewidth=0.8, zorder=0)
    ax.axvline(0, color="0.85", linewidth=0.8, zorder=0)
    reach = 1.0
    for name, roots, marker in groups:
        if not roots:
            continue
        places = np.array([complex(root["re"], root["im"]) for root in roots])
        near = np.abs(places) <= _FARTHEST
        away = ", ".join(f"{place:.4g}" if place.imag else f"{place.real:.4g}" for place in places[~near])
        label = f"{name}, outside of the picture: {away}" if away else name
        (line,) = ax.plot(places.real, places.imag, marker, fillstyle="none", label=_drawing.shown(label))
        reach = float(np.max([np.abs(places[near].real), np.abs(places[near].imag)], initial=reach))
        for root in roots:
            _drawing.region(ax, root, half, level, line.get_color())
    ax.set_xlim(-1.15 * reach, 1.15 * reach)
    ax.set_ylim(-1.15 * reach, 1.15 * reach)
    ax.set_aspect("equal")
    ax.set_xlabel("real part")
    ax.set_ylabel("imaginary part")
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    return ax


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
    ax.legend()
    return ax

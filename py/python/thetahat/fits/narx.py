"""Nonlinear ARX models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Union

from thetahat import _thetahat
from thetahat.base import said as _said
from thetahat.base.said import EstimationWarning
from thetahat.engine import options as _options
from thetahat.engine.options import NarxOptions, Rows
from thetahat.logs.log import Log, handle
from thetahat.models.model import Model

Lags = Union[int, Sequence[int]]
"""A number for all channels, or one for each."""


def narx(
    log: Log,
    map: str = "poly",
    *,
    ny: Lags | None = None,
    nu: Lags | None = None,
    nk: Lags | None = None,
    regressors: Sequence[str] | None = None,
    degree: int | None = None,
    terms: int | Sequence[str] | None = None,
    most_terms: int | None = None,
    centres: str | None = None,
    width: float | None = None,
    units: int | None = None,
    linear: bool | None = None,
    membership: str | None = None,
    select: str | None = None,
    ridge: float | None = None,
    raw_terms: bool | None = None,
    drawn: bool | None = None,
    focus: str | int | None = None,
    search: str | None = None,
    max_iterations: int | None = None,
    tolerance: float | None = None,
    step: float | tuple[float, float] | None = None,
    starts: int | None = None,
    seed: int | None = None,
    time_limit: float | None = None,
    estimate: Rows | None = None,
    validate: Rows | None = None,
    split: tuple[float, float, float] | None = None,
    detrend: str | None = None,
    offset: Mapping[str, float] | None = None,
) -> Model:
    """Fit a nonlinear ARX model, y(k) = g(past outputs and inputs) + e(k).

    The functions of g are chosen one by one, that which explains most of what is left comes next; or they are those of a network, or radial
    basis functions, that are trained.

    Parameters
    ----------
    log : Log
        The data. Each of its outputs has a map of its own, of the lags of all channels.
    map : {"poly", "rbf", "spline", "local", "knn", "tanh", "logistic", "relu", "step", "rbf-free", "auto"}
        Products of the regressors, radial basis functions, a natural cubic spline of each regressor, local linear models grown by
        splitting, the nearest samples of the fit; a network with one hidden layer of these units, radial basis functions whose centres and
        widths are trained; or of polynomials and networks the one with the best free run on rows held out.
    ny : int, or one for each output
        Past outputs that g reads: y(k-1), ..., y(k-ny). 2 unless it is said; where no lags are, ``"auto"`` also tries those of the linear
        model that the data choose.
    nu : int, or one for each input
        Values of the input that g reads, from ``nk`` on, 2 unless it is said; 0 for a time series.
    nk : int, or one for each input
        Samples from input to first effect, 1 unless it is said; 0 where it acts at once.
    regressors, degree, terms, most_terms, centres, width, units, linear, membership, select, ridge, raw_terms, drawn, focus, search, \
max_iterations, tolerance, step, starts, seed, time_limit, estimate, validate, split, detrend, offset
        Which functions, what to fit to and how, see `thetahat.NarxOptions`.

    Returns
    -------
    Model
        Its `Model.kind` is ``"nonlinear-arx"``.

    Raises
    ------
    EstimationError
        If the data cannot determine the parameters, which are named.
    ValueError
        If an argument does not make sense, or no row to fit to has a value in every channel.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> u = np.random.default_rng(0).uniform(-1, 1, 400)
    >>> y = np.zeros(400)
    >>> for k in range(1, 400):
    ...     y[k] = 0.5 * y[k - 1] + u[k - 1] + 0.4 * u[k - 1] ** 2
    >>> log = th.Log(y, u, sample_time=1)
    >>> model = th.narx(log, terms=3, detrend="none", raw_terms=True)
    >>> sorted(model.parameter_names)
    ['u(k-1)', 'u(k-1)^2', 'y(k-1)']
    """
    words = [f"--narx={_options.text('map', map)}", *_options.order_words(ny=ny, nu=nu, nk=nk)]
    words += _options.words(NarxOptions, locals(), len(log) if isinstance(log, Log) else None)
    found = Model._of(_thetahat.fit_narx(handle("log", log), words))
    for warning in found.warnings:
        _said.warn(warning, EstimationWarning, stacklevel=2)
    return found

"""Nonlinear ARX models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, Union

from thetahat.engine import options as _options, progress as _progress
from thetahat.engine.option_types import NarxOptions
from thetahat.engine.progress import Progress
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack

Lags = Union[int, Sequence[int]]
"""A number for all channels, or one for each."""

Map = Literal["poly", "rbf", "spline", "local", "knn", "tanh", "logistic", "relu", "hinge", "step", "rbf-free", "auto"]
"""The functions of a nonlinear ARX model."""


@_options.takes(NarxOptions)
def narx(
    log: Log,
    map: Map = "poly",
    *,
    ny: Lags | None = None,
    nu: Lags | None = None,
    nk: Lags | None = None,
    progress: Progress = None,
    **options: Unpack[NarxOptions],
) -> Model:
    """Fit a nonlinear ARX model, y(k) = g(past outputs and inputs) + e(k).

    The functions of g are chosen one by one, each as the one that explains most of the remaining errors; or they are those of a network, or
    radial basis functions, that are trained.

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
    progress : bool or callable, optional
        True shows how far it is, by tqdm if that is installed; a function is called with how many models or iterations are done, of how
        many, where that is known, and the least cost so far.
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
    _options.text("map", map)
    if map == "none":  # type: ignore[comparison-overlap]
        raise ValueError("map: narx fits a nonlinear model; name its functions, or fit a linear one")
    with _progress.told(progress, "narx"):
        return fitted(log, {"narx": map, "ny": ny, "nu": nu, "nk": nk}, options)

"""The noises of a model in matrices, from a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.base.said import EstimationWarning, warn
from thetahat.engine import options as _options
from thetahat.engine.values import Duration
from thetahat.online import rows as _rows
from thetahat.online.state_model import StateModel

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """The noises of a `StateModel`, as a log says them: what `fit_noise` returns."""

    model: StateModel
    """The model with these noises."""
    Q: Array
    """The covariance of the process noise, shape (n, n)."""
    R: Array
    """The covariance of the measurement noise, shape (m, m)."""
    S: Array
    """The covariance of the two, shape (n, m): zero unless the structure is "innovations"."""
    Q_errors: Array
    """The standard errors of the entries of Q: 0 of what is known, NaN of a variance that came out 0."""
    R_errors: Array
    """The standard errors of the entries of R."""
    S_errors: Array
    """The standard errors of the entries of S."""
    log_likelihood: float
    """The log-likelihood of all that was measured, as `StateFilter.log_likelihood`."""
    log_likelihoods: list[float]
    """The same with the noises that the search began with, and after each of its iterations."""
    measured: int
    """How many values were measured."""
    iterations: int
    """How many iterations the search took."""
    stopped: Literal["converged", "no-descent", "max-iterations", "time-limit"]
    """Why it stopped: "no-descent" is as far as rounding allows."""
    warnings: list[str]
    """What to know before relying on it."""

    def __repr__(self) -> str:
        noises = ", ".join(f"{name} {np.array2string(value, precision=6)}" for name, value in (("Q", self.Q), ("R", self.R)))
        shown = " ".join(noises.split())
        return f"NoiseEstimate({shown}, log-likelihood {self.log_likelihood:.2f} of {self.measured} values)"


def fit_noise(
    model: StateModel,
    data: _rows.Data,
    u: _numbers.Columns | None = None,
    *,
    time: _rows.Times | None = None,
    sample_time: Duration | None = None,
    structure: Literal["diagonal", "full", "scaled", "innovations"] = "diagonal",
    max_iterations: int = 100,
    tolerance: float = 1e-8,
) -> NoiseEstimate:
    """Find the noises of a model in matrices, with which a log is most likely: Q and R of its Kalman filter.

    All else of the model is as it says. The search begins at its own Q and R.

    Parameters
    ----------
    model : StateModel
        A model in matrices. Of equations give a noise as ``{"start": 0.1, "unknown": True}`` and use `grey`.
    data : Log, data frame, dict, or array_like of shape (N, m)
        The rows, as for `StateFilter.run`. NaN is a missing output. A log that is joined of several starts anew in each of them.
    u : array_like or columns, optional
        The inputs, where ``data`` is an array.
    time : array_like or str, optional
        The times, or the name of their column. Steps are whole multiples of the model's sample time.
    sample_time : float or timedelta, optional
        Seconds from row to row, where there are no times.
    structure : {"diagonal", "full", "scaled", "innovations"}, default "diagonal"
        What is unknown. "diagonal": the variances, the other entries are 0; a log tells them apart more often than anything else. "full":
        all entries of Q and R. In both, a state or output whose variance is 0 in the model has no noise. "scaled": two factors, of the
        model's Q and R. "innovations": R and K of w = K v, with Q = K R K' and S = K R: the most that outputs tell of Q, R and S together.
    max_iterations : int, default 100
        Iterations at most.
    tolerance : float, default 1e-8
        The search stops when a step would raise the log-likelihood by less than this fraction of half the measured values.

    Returns
    -------
    NoiseEstimate
        The model with its noises, their standard errors and the likelihood.

    Raises
    ------
    EstimationError
        If the log does not tell entries apart: ``parameters`` names them.
    ValueError
        If the model has no matrices, its noises are not for the structure, or the rows do not fit the model.

    Warns
    -----
    EstimationWarning
        If a variance came out 0, an entry is hardly determined, or the search ended early.

    Notes
    -----
    The covariance of both noises is L L', with L lower triangular, so that it is never indefinite. The likelihood is that of the
    innovations of the Kalman filter, and the search is Fisher scoring with exact derivatives. pykalman's ``em`` finds the same maximum
    in more steps. Of a full Q there must be no more than n m entries, for n states and m outputs.

    References
    ----------
    Schweppe, Evaluation of likelihood functions for Gaussian signals, 1965. Mehra, On the identification of variances and adaptive Kalman
    filtering, 1970. Gupta and Mehra, Computational aspects of maximum likelihood estimation, 1974.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> # A level that walks by 0.3 a sample, and a gauge with an error of 1.
    >>> random = np.random.default_rng(1)
    >>> level = np.cumsum(0.3 * random.standard_normal(1000))
    >>> walk = th.StateModel([[1]], [[1]], [[1]], [[10]], [[1]], sample_time=1)
    >>> found = th.fit_noise(walk, level + random.standard_normal(1000))
    >>> np.sqrt([found.Q[0, 0], found.R[0, 0]]).round(1).tolist()
    [0.3, 1.0]
    >>> trajectory = th.StateFilter(found.model).run(level)
    """
    if not isinstance(model, StateModel):
        raise TypeError(f"model: expected a StateModel, found {type(model).__name__}")
    rows = _rows.of(data, u, time, sample_time, model.inputs, model.outputs)
    steps = None
    if rows.seconds is not None:
        steps = np.diff(rows.seconds, prepend=np.nan)
    elif rows.sample_time is not None:
        steps = np.full(len(rows), rows.sample_time)
    ends = [0, *rows.boundaries, len(rows)]
    logs = [
        (None if steps is None else steps[first:end], rows.inputs[first:end], rows.outputs[first:end])
        for first, end in zip(ends, ends[1:])
    ]
    found = _thetahat.fit_noise(
        model._model,
        logs,
        _options.text("structure", structure),
        _options.count("max_iterations", max_iterations),
        float(_options.number("tolerance", tolerance)),
    )
    fitted = NoiseEstimate(model=StateModel.from_toml(found.pop("text")), **found)
    for message in fitted.warnings:
        warn(message, EstimationWarning)
    return fitted

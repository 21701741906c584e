"""ARX models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from thetahat._thetahat import EstimationError
from thetahat.base import said as _said
from thetahat.base.said import EstimationWarning
from thetahat.fits.fit import arx
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.sklearn.regressor import Orders, Regressor, orders_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thetahat.engine.values import Band, Bound, Rows

_OPTIONS = (
    "estimate",
    "validate",
    "split",
    "detrend",
    "offset",
    "prefilter",
    "initial",
    "likelihood",
    "constant",
    "trend",
    "focus",
    "norm",
    "bound",
    "dc_gain",
    "ridge",
    "noise_bound",
    "search",
    "max_iterations",
    "tolerance",
    "step",
    "starts",
    "seed",
    "time_limit",
)

class ARXRegressor(Regressor):
    """An ARX model, A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + e(t), by least squares.

    Parameters
    ----------
    na : int, default=2
        Coefficients of A: how many past outputs there are.
    nb : int, sequence of int or dict of str to int, default=2
        Coefficients of B, for all inputs or one for each, by the names of the columns too.
    nk : int, sequence of int or dict of str to int, default=1
        Samples from an input's change to its first effect, for all inputs or one for each, by the names of the columns too.
    horizon : int or None, default=None
        How many samples ahead `predict` and `score` predict. None: the free run, which sees no outputs.
    sample_time : float, default=None
        Seconds from one sample to the next. None: that of the times in the index of pandas that X or y has, else 1.
    estimate, validate, split, detrend, offset, prefilter, initial, likelihood, constant, trend, focus, norm, bound, dc_gain,
    ridge, noise_bound, search, max_iterations, tolerance, step, starts, seed, time_limit : default=None
        What to fit to and how, as for `thetahat.arx`, see `thetahat.FitOptions`. Channels are called as the columns of a data
        frame, else u, or u1, u2, …, and y.

    Attributes
    ----------
    model_ : thetahat.Model
        The fitted model.
    coef_ : ndarray of shape (n_parameters,)
        Its parameters: a1, a2, ..., then those of B for each input. Of several outputs there is none: see the part ``estimation`` of
        ``model_.document``.
    n_features_in_ : int
        The number of inputs.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        The inputs' names, where X was a dataframe with names that are text.

    Notes
    -----
    NaN in y means a sample that is missing. Without inputs, X being None, this is an AR model of y, and nb and nk are not read;
    its free run is the level that was taken from y before the fit.

    With a horizon, `scoring` of searches and cross-validation is left at its default, which is `score`, or is a `scorer` of this module:
    scikit-learn's own call `predict` without the outputs. The `predict` of a pipeline hands them on: `pipeline.predict(X, y=y)`.

    Rows that are too few for the orders, as in a first fold, get as many coefficients as they determine, with a warning.

    It passes scikit-learn's `check_estimator` but for `EXPECTED_FAILED_CHECKS` of this module, which says why:
    ``check_estimator(ARXRegressor(), expected_failed_checks=EXPECTED_FAILED_CHECKS)``.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.model_selection import TimeSeriesSplit, cross_val_score
    >>> from thetahat.sklearn import ARXRegressor
    >>> u = np.random.default_rng(1).standard_normal((500, 1))
    >>> y = np.zeros(500)
    >>> for t in range(1, 500):
    ...     y[t] = 0.5 * y[t - 1] + u[t - 1, 0]
    >>> regressor = ARXRegressor(na=1, nb=1, horizon=1)
    >>> scores = cross_val_score(regressor, u, y, cv=TimeSeriesSplit(3))
    >>> bool(scores.min() > 0.99)
    True
    """

    def __init__(
        self,
        na: int = 2,
        nb: Orders = 2,
        nk: Orders = 1,
        *,
        horizon: int | None = None,
        sample_time: float | None = None,
        estimate: Rows | None = None,
        validate: Rows | None = None,
        split: tuple[float, float, float] | None = None,
        detrend: str | None = None,
        offset: Mapping[str, float] | None = None,
        prefilter: Band | None = None,
        initial: Literal["auto", "drop", "zero", "estimate"] | None = None,
        likelihood: Literal["conditional", "exact"] | None = None,
        constant: Literal["auto", "yes", "no"] | None = None,
        trend: bool | None = None,
        focus: int | Literal["auto", "prediction", "simulation"] | None = None,
        norm: float | str | None = None,
        bound: Mapping[str, Bound] | None = None,
        dc_gain: Bound | Mapping[str, Bound] | None = None,
        ridge: float | None = None,
        noise_bound: float | None = None,
        search: Literal["lm", "gauss-newton", "newton", "gradient", "annealing"] | None = None,
        max_iterations: int | None = None,
        tolerance: float | None = None,
        step: float | tuple[float, float] | None = None,
        starts: int | None = None,
        seed: int | None = None,
        time_limit: float | None = None,
    ) -> None:
        self.na = na
        self.nb = nb
        self.nk = nk
        self.horizon = horizon
        self.sample_time = sample_time
        self.estimate = estimate
        self.validate = validate
        self.split = split
        self.detrend = detrend
        self.offset = offset
        self.prefilter = prefilter
        self.initial = initial
        self.likelihood = likelihood
        self.constant = constant
        self.trend = trend
        self.focus = focus
        self.norm = norm
        self.bound = bound
        self.dc_gain = dc_gain
        self.ridge = ridge
        self.noise_bound = noise_bound
        self.search = search
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.step = step
        self.starts = starts
        self.seed = seed
        self.time_limit = time_limit

    def _fitted(self, log: Log) -> Model:
        nb = orders_of("nb", self.nb, log.inputs) if log.inputs else 0
        return self._oforders_of(log, self.na, nb)

    def _oforders_of(self, log: Log, na: int, nb: int | list[int]) -> Model:
        orders: Any = {"nb": nb, "nk": orders_of("nk", self.nk, log.inputs)} if log.inputs else {"nb": nb}
        options: Any = {name: getattr(self, name) for name in _OPTIONS}
        return arx(log, na=na, **orders, **options)

    def _smaller(self, log: Log, refused: EstimationError) -> Model:
        """Few rows, as in a first fold: as many coefficients as they determine, in the end none but the level."""
        nb = orders_of("nb", self.nb, log.inputs) if log.inputs else 0
        na = int(self.na)
        while na > 0:
            na, nb = na - 1, [max(order - 1, 0) for order in nb] if isinstance(nb, list) else max(nb - 1, 0)
            try:
                with _said.kept():
                    found = self._oforders_of(log, na, nb)
            except (EstimationError, ValueError):
                continue
            _said.warn(f"{refused}; fitted with na={na}, nb={nb} instead", EstimationWarning)
            return found
        if np.isnan(log.y).all():
            raise refused
        _said.warn(f"{refused}; the level of y stands for a model", EstimationWarning)
        level = np.nanmean(np.atleast_2d(log.y.T), axis=1)
        count = len(level)
        none = np.zeros((1, len(log.inputs)))
        return Model.from_state_space(
            [[0.0]],
            none,
            np.zeros((count, 1)),
            np.zeros((count, len(log.inputs))),
            sample_time=log.sample_time,
            inputs=log.inputs,
            outputs=log.outputs,
            offset=dict(zip(log.outputs, level.tolist())),
        )

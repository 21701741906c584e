"""Nonlinear ARX models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from thetahat.engine.option_types import NarxOptions
from thetahat.fits.narx import Map, narx
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.sklearn.regressor import Orders, Regressor, orders_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thetahat.engine.values import Rows


class NARXRegressor(Regressor):
    """A nonlinear ARX model, y(k) = g(past outputs and inputs) + e(k), with functions that forward regression chooses, or that are
    trained.

    Parameters
    ----------
    map : {"poly", "rbf", "spline", "local", "knn", "tanh", "logistic", "relu", "step", "rbf-free", "auto"}, default="poly"
        The functions, as for `thetahat.narx`.
    ny : int, default=2
        Past outputs that g reads.
    nu : int or sequence of int, default=2
        Values of each input that g reads, for all inputs or one for each.
    nk : int, sequence of int or dict of str to int, default=1
        Samples from an input's change to its first effect, for all inputs or one for each, by the names of the columns too.
    horizon : int or None, default=None
        How many samples ahead `predict` and `score` predict. None: the free run, which sees no outputs.
    sample_time : float, default=None
        Seconds from one sample to the next. None: that of the times in the index of pandas that X or y has, else 1.
    regressors, degree, terms, most_terms, centres, width, units, linear, membership, select, ridge, raw_terms, drawn, focus, search, \
max_iterations, tolerance, step, starts, seed, time_limit, estimate, validate, split, detrend, offset : default=None
        Which functions, what to fit to and how, as for `thetahat.narx`, see `thetahat.NarxOptions`. Channels are called as the columns
        of a data frame, else u, or u1, u2, …, and y.

    Attributes
    ----------
    model_ : thetahat.Model
        The fitted model.
    coef_ : ndarray of shape (n_parameters,)
        Its parameters, in the order of ``model_.parameter_names``.
    n_features_in_ : int
        The number of inputs.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        The inputs' names, where X was a dataframe with names that are text.

    Notes
    -----
    As for `ARXRegressor`. Where a choice is made by scikit-learn, as by `GridSearchCV` over ``terms``, give ``terms``: without it the
    model makes its own choice in each fit.

    Examples
    --------
    >>> import numpy as np
    >>> from thetahat.sklearn import NARXRegressor
    >>> u = np.random.default_rng(1).uniform(-1, 1, (500, 1))
    >>> y = np.zeros(500)
    >>> for t in range(1, 500):
    ...     y[t] = 0.5 * y[t - 1] + u[t - 1, 0] + 0.3 * u[t - 1, 0] ** 2
    >>> regressor = NARXRegressor(ny=1, nu=1).fit(u, y)
    >>> bool(regressor.score(u, y) > 0.99)
    True
    """

    def __init__(
        self,
        map: Map = "poly",
        ny: int = 2,
        nu: Orders = 2,
        nk: Orders = 1,
        *,
        horizon: int | None = None,
        sample_time: float | None = None,
        regressors: Sequence[str] | None = None,
        degree: int | None = None,
        terms: int | Sequence[str] | None = None,
        most_terms: int | None = None,
        centres: str | None = None,
        width: float | None = None,
        units: int | None = None,
        linear: bool | None = None,
        membership: Literal["rectangle", "trapezoid", "gaussian"] | None = None,
        select: Literal["fpe", "aic", "aicc", "mdl", "hqc", "validation", "cv"] | None = None,
        ridge: float | None = None,
        raw_terms: bool | None = None,
        drawn: bool | None = None,
        focus: int | Literal["auto", "prediction", "simulation"] | None = None,
        search: Literal["lm", "gauss-newton", "newton", "gradient", "annealing"] | None = None,
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
    ) -> None:
        self.map = map
        self.ny = ny
        self.nu = nu
        self.nk = nk
        self.horizon = horizon
        self.sample_time = sample_time
        self.regressors = regressors
        self.degree = degree
        self.terms = terms
        self.most_terms = most_terms
        self.centres = centres
        self.width = width
        self.units = units
        self.linear = linear
        self.membership = membership
        self.select = select
        self.ridge = ridge
        self.raw_terms = raw_terms
        self.drawn = drawn
        self.focus = focus
        self.search = search
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.step = step
        self.starts = starts
        self.seed = seed
        self.time_limit = time_limit
        self.estimate = estimate
        self.validate = validate
        self.split = split
        self.detrend = detrend
        self.offset = offset

    def _fitted(self, log: Log) -> Model:
        names = log.inputs
        lags: Any = {"nu": orders_of("nu", self.nu, names), "nk": orders_of("nk", self.nk, names)} if names else {"nu": 0}
        options: Any = {name: getattr(self, name) for name in NarxOptions.__annotations__}
        return narx(log, self.map, ny=int(self.ny), **lags, **options)

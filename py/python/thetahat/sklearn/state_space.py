"""Models in state space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from thetahat.fits.state_space import ss
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.sklearn.regressor import Orders, Regressor, orders_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thetahat.engine.values import Rows

_STATES = (
    "weighting",
    "past",
    "future",
    "feedthrough",
    "refine",
    "search",
    "max_iterations",
    "tolerance",
    "time_limit",
    "estimate",
    "validate",
    "split",
    "detrend",
    "offset",
    "constant",
)


class StateSpaceRegressor(Regressor):
    """A state-space model, x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t), by a subspace method.

    Parameters
    ----------
    order : int, range or None, default=None
        States, or those among which the least MDL chooses; None: 1 to 20.
    nk : int, sequence of int or None, default=None
        Samples that each input waits.
    horizon : int or None, default=None
        How many samples ahead `predict` and `score` predict. None: the free run, which sees no outputs.
    sample_time : float, default=None
        Seconds from one sample to the next. None: that of the times in the index of pandas that X or y has, else 1.
    weighting, past, future, feedthrough, refine, search, max_iterations, tolerance, time_limit, estimate, validate, split, detrend, offset, \
constant : default=None
        How, as for `thetahat.ss`. Channels are called as the columns of a data frame, else u, or u1, u2, …, and y, or y1, y2, …

    Attributes
    ----------
    model_ : thetahat.Model
        The fitted model.
    n_features_in_ : int
        The number of inputs.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        The inputs' names, where X was a dataframe with names that are text.

    Notes
    -----
    As for `ARXRegressor`.

    Examples
    --------
    >>> import numpy as np
    >>> from thetahat.sklearn import StateSpaceRegressor
    >>> rng = np.random.default_rng(1)
    >>> u, x = rng.standard_normal((500, 2)), np.zeros((501, 2))
    >>> for t in range(500):
    ...     x[t + 1] = [[0.8, 0.2], [-0.2, 0.7]] @ x[t] + u[t]
    >>> y = x[:500] + 0.01 * rng.standard_normal((500, 2))
    >>> regressor = StateSpaceRegressor(order=2).fit(u[:300], y[:300])
    >>> regressor.predict(u[300:]).shape
    (200, 2)
    >>> bool(regressor.score(u[300:], y[300:]) > 0.9)
    True
    """

    def __init__(
        self,
        order: int | range | None = None,
        nk: Orders | None = None,
        *,
        horizon: int | None = None,
        sample_time: float | None = None,
        weighting: Literal["ssarx", "moesp", "n4sid", "cva"] | None = None,
        past: int | None = None,
        future: int | None = None,
        feedthrough: bool | None = None,
        refine: Literal["prediction", "simulation"] | None = None,
        search: Literal["lm", "gauss-newton", "newton", "gradient", "annealing"] | None = None,
        max_iterations: int | None = None,
        tolerance: float | None = None,
        time_limit: float | None = None,
        estimate: Rows | None = None,
        validate: Rows | None = None,
        split: tuple[float, float, float] | None = None,
        detrend: str | None = None,
        offset: Mapping[str, float] | None = None,
        constant: Literal["auto", "yes", "no"] | None = None,
    ) -> None:
        self.order = order
        self.nk = nk
        self.horizon = horizon
        self.sample_time = sample_time
        self.weighting = weighting
        self.past = past
        self.future = future
        self.feedthrough = feedthrough
        self.refine = refine
        self.search = search
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.time_limit = time_limit
        self.estimate = estimate
        self.validate = validate
        self.split = split
        self.detrend = detrend
        self.offset = offset
        self.constant = constant

    def _fitted(self, log: Log) -> Model:
        options: Any = {name: getattr(self, name) for name in _STATES}
        delays = orders_of("nk", self.nk, log.inputs) if log.inputs and self.nk is not None else None
        return ss(log, self.order, nk=delays, **options)

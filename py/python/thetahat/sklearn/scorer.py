"""Scores of predictions that see the measured outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.metrics import get_scorer

from thetahat.base import numbers as _numbers

if TYPE_CHECKING:
    from collections.abc import Callable


def scorer(metric: str = "r2") -> Callable[[Any, Any, Any], float]:
    """A metric of scikit-learn for `cross_val_score`, `GridSearchCV` and their like, of predictions that see the measured outputs.

    scikit-learn's own scorers call ``predict(X)`` without y, from which a prediction with a horizon has nothing to start. This one calls
    ``predict(X, y)``, and leaves out the rows that have no prediction.

    Parameters
    ----------
    metric : str, default "r2"
        The name of a scorer of regressions, such as ``"neg_mean_squared_error"``.

    Returns
    -------
    callable
        For the parameter ``scoring``.

    Examples
    --------
    >>> import thetahat as th
    >>> from sklearn.model_selection import TimeSeriesSplit, cross_val_score
    >>> log, cv = th.dc_motor(), TimeSeriesSplit(3, gap=10)
    >>> scoring = th.sklearn.scorer("neg_root_mean_squared_error")
    >>> scores = cross_val_score(th.sklearn.ARXRegressor(horizon=1), log.u, log.y, cv=cv, scoring=scoring)
    >>> bool(scores.min() > -1)
    True
    """
    known = get_scorer(metric)
    if not hasattr(known, "_score_func") or not hasattr(known, "_sign"):
        raise ValueError(f"metric: {metric!r} is no scorer of predictions; give one such as 'r2'")

    def score(estimator: Any, X: Any, y: Any) -> float:
        predicted = np.asarray(estimator.predict(X, y=y), dtype=np.float64)
        measured = _numbers.array("y", y).reshape(predicted.shape)
        rows = ~(np.isnan(predicted) | np.isnan(measured)).reshape(len(predicted), -1).any(axis=1)
        return float(known._sign * known._score_func(measured[rows], predicted[rows], **known._kwargs))

    return score

"""ARX, nonlinear ARX and state-space models as estimators of scikit-learn, for its pipelines, searches and scores.

Rows are samples in the order of time, at equal distances. Whatever splits them has to keep that order:
`sklearn.model_selection.TimeSeriesSplit` does, shuffled folds do not. An index of pandas tells: of times it is the clock, of whole
numbers it counts rows; nothing reaches across what is left out of either, and rows out of order are an error.
"""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Union

import numpy as np
import numpy.ma as ma
from narwhals.dependencies import is_pandas_like_dataframe, is_pandas_like_series

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.metrics import get_scorer, r2_score
    from sklearn.utils import check_array, check_consistent_length, column_or_1d
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:
    message = (
        f"thetahat.sklearn needs scikit-learn 1.6 or later, which cannot be imported ({error}): "
        "pip install thetahat[sklearn]"
    )
    raise ImportError(message) from error

from thetahat._thetahat import EstimationError
from thetahat.base import clock as _clock, numbers as _numbers, said as _said
from thetahat.base.said import EstimationWarning
from thetahat.engine.option_types import NarxOptions
from thetahat.fits.fit import arx
from thetahat.fits.narx import Map, narx
from thetahat.fits.state_space import ss
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

    from thetahat.engine.values import Band, Bound, Rows

__all__ = ["EXPECTED_FAILED_CHECKS", "ARXRegressor", "NARXRegressor", "StateSpaceRegressor", "scorer"]

EXPECTED_FAILED_CHECKS = {
    "check_methods_sample_order_invariance": "rows are in the order of time",
    "check_methods_subset_invariance": "a row depends on those before it",
}
"""The checks of `sklearn.utils.estimator_checks.check_estimator` that these regressors fail by what they are, and why."""


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


Orders = Union[int, "Sequence[int]", "Mapping[str, int]"]
"""One order for all inputs, or one for each, by the names of the columns too."""


# Without stubs of scikit-learn its classes are Any to mypy.
class _Regressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """What the regressors have in common: predictions of a fitted model, and the log of an array."""

    horizon: int | None
    sample_time: float | None
    model_: Model
    coef_: NDArray[np.float64]

    def fit(self, X: ArrayLike | None, y: ArrayLike) -> Self:
        """Estimate the model.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_inputs), or None
            The inputs in the order of time; None for a time series.
        y : array_like of shape (n_samples,) or (n_samples, n_outputs)
            The output, or several.

        Returns
        -------
        Self
            This one, fitted.

        Raises
        ------
        ValueError
            If X or y does not have its shape, or a parameter is out of its range.
        thetahat.EstimationError
            If the data do not determine the model.
        """
        self._check_horizon()
        inputs = self._inputs(X, reset=True)
        log = self._log(inputs, self._output(y, inputs), self._times(X, y))
        try:
            self.model_ = self._fitted(log)
        except EstimationError as refused:
            self.model_ = self._smaller(log, refused)
        self._targets = _target_names(y)
        if hasattr(self, "coef_"):
            del self.coef_
        if self.model_.kind != "state-space":
            self.coef_ = np.asarray(self.model_.parameters, dtype=np.float64)
        return self

    def _fitted(self, log: Log) -> Model:
        raise NotImplementedError

    def _smaller(self, log: Log, refused: EstimationError) -> Model:
        """A model that the rows determine where they do not determine the one that was asked for; else what was said of that."""
        raise refused

    def set_output(self, *, transform: Literal["default", "pandas", "polars"] | None = None) -> Self:
        """Say what `predict` returns: arrays, or for "pandas" a series with the index of X, of several outputs a frame, for "polars" those.

        Parameters
        ----------
        transform : {"default", "pandas", "polars"}, optional
            As for scikit-learn's transformers; None changes nothing.

        Returns
        -------
        Self

        Examples
        --------
        >>> import pandas as pd
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> X = pd.DataFrame({"u": log["u"]}, pd.date_range("2026-03-01", periods=1000, freq="s"))
        >>> regressor = th.sklearn.ARXRegressor().set_output(transform="pandas").fit(X, pd.Series(log.y, X.index, name="speed"))
        >>> regressor.predict(X[:3]).round(1)
        2026-03-01 00:00:00    81.2
        2026-03-01 00:00:01    80.4
        2026-03-01 00:00:02    78.4
        Freq: s, Name: speed, dtype: float64
        """
        if transform not in (None, "default", "pandas", "polars"):
            raise ValueError(f"transform: {transform!r} is none of 'default', 'pandas' and 'polars'")
        if transform is not None:
            self._output_as = transform
        return self

    def predict(self, X: ArrayLike | None, y: ArrayLike | None = None) -> NDArray[np.float64]:
        """Predict the output.

        Without a horizon this is the free run: the model is driven by the inputs alone and begins at rest, all deviations zero
        before the first row. What the system did before is not known to it, so that it needs some rows to come close.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_inputs), or None
            The inputs in the order of time; None for a time series.
        y : array_like of shape (n_samples,) or (n_samples, n_outputs), optional
            The measured output, or outputs, of which a prediction with a horizon sees what is that far back. Not read without a horizon,
            but for its length where there are no inputs.

        Returns
        -------
        ndarray of shape (n_samples,), or (n_samples, n_outputs) of several
            With a horizon, NaN where too little is known to predict from, as in the first rows.

        Raises
        ------
        ValueError
            If there is a horizon and no y, or neither X nor y, or X does not have the inputs of the fit.
        sklearn.exceptions.NotFittedError
            If there is no model yet.
        """
        found = self._predicted(X, y)
        kind = getattr(self, "_output_as", "default")
        if kind == "default":
            return found
        names = self._target_names()
        table = {names[0]: found} if found.ndim == 1 else dict(zip(names, found.T))
        if kind == "polars":
            frame: Any = _clock.imported("polars").DataFrame(table)
        else:
            frame = _clock.imported("pandas").DataFrame(table, _clock.common_index([("X", X), ("y", y)]))
        named: NDArray[np.float64] = frame[names[0]] if found.ndim == 1 else frame
        return named

    def _target_names(self) -> list[str]:
        """What the outputs were called in the fit."""
        return list(getattr(self, "_targets", None) or self.model_.outputs)

    def _predicted(self, X: ArrayLike | None, y: ArrayLike | None) -> NDArray[np.float64]:
        check_is_fitted(self)
        self._check_horizon()
        inputs = self._inputs(X, reset=False)
        times = self._times(X, y)
        if self.horizon is None and inputs is not None and self.model_.inputs:
            clock = self._log(inputs, np.zeros(len(inputs)), times)
            if times is not None and abs(clock.sample_time / self.model_.sample_time - 1) > _clock.UNIFORM:
                message = f"X: its rows are {clock.sample_time:g} s apart, those of the fit {self.model_.sample_time:g} s"
                raise ValueError(f"{message}; resample them first")
            # A segment of the clock begins at rest.
            runs = [self.model_.simulate(inputs[rows.start : rows.stop], initial="zero") for rows in clock.segments]
            return np.asarray(np.concatenate(runs), dtype=np.float64)
        if self.horizon is None:
            if inputs is None and y is None:
                raise ValueError("y: without inputs it says how many samples to predict; give predict(None, y)")
            count = len(self._output(y, None) if inputs is None else inputs)
            offsets = np.array([self.model_.offsets[name] for name in self.model_.outputs])
            lines = offsets[:, 0] + self.model_.sample_time * np.arange(count)[:, None] * offsets[:, 1]
            return np.asarray(lines[:, 0] if len(offsets) == 1 else lines, dtype=np.float64)
        if y is None:
            message = (
                f"y: a prediction {self.horizon} samples ahead starts from measured outputs; give predict(X, y), in a search or a "
                "cross-validation scoring=thetahat.sklearn.scorer('r2'), or horizon=None for a free run, which needs none"
            )
            raise ValueError(message)
        outputs = self._output(y, inputs)
        if outputs.shape[1:] != self._shape():
            message = f"y: expected {len(self.model_.outputs)} outputs, as in the fit, found an array of shape {outputs.shape}"
            raise ValueError(message)
        log = self._log(inputs, outputs, times)
        return np.asarray(self.model_.predict(log, horizon=int(self.horizon)), dtype=np.float64)

    def score(self, X: ArrayLike | None, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """The coefficient of determination, R^2, of `predict(X, y)`.

        Parameters
        ----------
        X : array_like of shape (n_samples, n_inputs), or None
            The inputs in the order of time; None for a time series.
        y : array_like of shape (n_samples,) or (n_samples, n_outputs)
            The measured output, or outputs.
        sample_weight : array_like of shape (n_samples,), optional
            What each sample counts.

        Returns
        -------
        float
            1 - sum (y - y^)^2 / sum (y - mean y)^2 over the samples that have a prediction and a measured output; of several outputs
            the mean.

        Raises
        ------
        ValueError
            As for `predict`, or if there are not two such samples.
        """
        predicted = self._predicted(X, y)
        measured = self._output(y, predicted)
        if measured.shape != predicted.shape:
            message = f"y: expected an array of shape {predicted.shape}, found one of {measured.shape}"
            raise ValueError(message)
        weights = None if sample_weight is None else np.asarray(sample_weight)
        columns = zip(measured.reshape(len(measured), -1).T, predicted.reshape(len(measured), -1).T)
        return float(np.mean([_score(own, run, weights) for own, run in columns]))

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # Of rows without an order in time there is nothing to learn.
        tags.regressor_tags.poor_score = True
        tags.target_tags.multi_output = True
        tags.target_tags.single_output = True
        return tags

    def _shape(self) -> tuple[int, ...]:
        count = len(self.model_.outputs)
        return () if count == 1 else (count,)

    def _check_horizon(self) -> None:
        horizon = self.horizon
        if horizon is not None and not (isinstance(horizon, numbers.Integral) and horizon >= 1):
            message = f"horizon: expected a whole number of samples from 1 on, or None, found {horizon!r}"
            raise ValueError(message)

    def _inputs(self, X: ArrayLike | None, *, reset: bool) -> NDArray[np.float64] | None:
        if X is None and reset:
            self.n_features_in_ = 0
            # Names of an earlier fit go with its inputs.
            if hasattr(self, "feature_names_in_"):
                del self.feature_names_in_
        if X is None:
            if self.n_features_in_ > 0:
                raise ValueError(f"X: expected {self.n_features_in_} inputs, as in the fit, found None")
            return None
        # scikit-learn reads what lies behind a mask.
        inputs: NDArray[np.float64] = validate_data(
            self,
            _numbers.array("X", X) if isinstance(X, ma.MaskedArray) else X,
            reset=reset,
            dtype=np.float64,
            ensure_min_samples=2 if reset else 1,
        )
        return inputs

    def _output(self, y: ArrayLike | None, beside: NDArray[np.float64] | None) -> NDArray[np.float64]:
        if y is None:
            message = f"y: {type(self).__name__} requires y to be passed, but the target y is None"
            raise ValueError(message)
        checked = check_array(
            _numbers.array("y", y),
            dtype=np.float64,
            ensure_all_finite="allow-nan",
            ensure_2d=False,
            input_name="y",
            estimator=self,
        )
        several = checked.ndim == 2 and checked.shape[1] > 1
        output: NDArray[np.float64] = checked if several else column_or_1d(checked, warn=True)
        if beside is not None:
            check_consistent_length(beside, output)
        return output

    def _times(self, X: ArrayLike | None, y: ArrayLike | None) -> Any:
        """The clock in the index that X and y have: times, or the numbers of rows by the sample time."""
        index = _clock.common_index([("X", X), ("y", y)])
        if index is None or index.nlevels > 1:
            return None
        if _clock.of_index(index) is not None:
            if self.sample_time is not None:
                raise ValueError("sample_time: the index is a clock; leave sample_time out, or drop the index (reset_index in pandas)")
            return index
        numbers = _clock.labels_of(index).values
        if numbers.dtype.kind not in "iu" or len(numbers) < 2:
            return None
        steps = np.diff(numbers.astype(np.int64))
        if steps.min() < 1:
            row = int(np.argmin(steps > 0))
            message = (
                f"X: its index goes back from {numbers[row]} in row {row + 1} to {numbers[row + 1]} in row {row + 2}; keep the rows in "
                "the order of time (shuffled folds do not), or drop the index (reset_index in pandas)"
            )
            raise ValueError(message)
        if steps.max() == steps.min():
            return None
        return (numbers - numbers[0]) * (1.0 if self.sample_time is None else self.sample_time)

    def _log(self, inputs: NDArray[np.float64] | None, output: NDArray[np.float64], times: ArrayLike | None) -> Log:
        names = getattr(self, "feature_names_in_", None)
        taken = [] if names is None else [str(name) for name in names]
        # No input may have the name of an output.
        names = ["y"] if output.ndim == 1 else [f"y{number}" for number in range(1, 1 + output.shape[1])]
        while not set(names).isdisjoint(taken):
            names = [name + "_" for name in names]
        plain = 1.0 if self.sample_time is None else self.sample_time
        return Log(
            output,
            inputs,
            sample_time=plain if times is None else None,
            time=times,
            input_names=taken or None,
            output_name=names[0] if output.ndim == 1 else names,
        )


def _target_names(y: Any) -> list[str] | None:
    """The names of a series or of the columns of a frame."""
    if is_pandas_like_series(y):
        return None if y.name is None else [str(y.name)]
    return [str(name) for name in y.columns] if is_pandas_like_dataframe(y) else None


def _score(measured: NDArray[np.float64], predicted: NDArray[np.float64], weights: NDArray[Any] | None) -> float:
    """R^2 of one output."""
    known = ~(np.isnan(predicted) | np.isnan(measured))
    if np.count_nonzero(known) < 2:
        message = (
            f"score: of {len(known)} samples {np.count_nonzero(known)} have a prediction and a measured output, "
            "and R^2 needs two; give more rows"
        )
        raise ValueError(message)
    return float(r2_score(measured[known], predicted[known], sample_weight=None if weights is None else weights[known]))


class ARXRegressor(_Regressor):
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
        nb = _orders("nb", self.nb, log.inputs) if log.inputs else 0
        return self._of_orders(log, self.na, nb)

    def _of_orders(self, log: Log, na: int, nb: int | list[int]) -> Model:
        orders: Any = {"nb": nb, "nk": _orders("nk", self.nk, log.inputs)} if log.inputs else {"nb": nb}
        options: Any = {name: getattr(self, name) for name in _OPTIONS}
        return arx(log, na=na, **orders, **options)

    def _smaller(self, log: Log, refused: EstimationError) -> Model:
        """Few rows, as in a first fold: as many coefficients as they determine, in the end none but the level."""
        nb = _orders("nb", self.nb, log.inputs) if log.inputs else 0
        na = int(self.na)
        while na > 0:
            na, nb = na - 1, [max(order - 1, 0) for order in nb] if isinstance(nb, list) else max(nb - 1, 0)
            try:
                with _said.kept():
                    found = self._of_orders(log, na, nb)
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


class NARXRegressor(_Regressor):
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
        lags: Any = {"nu": _orders("nu", self.nu, names), "nk": _orders("nk", self.nk, names)} if names else {"nu": 0}
        options: Any = {name: getattr(self, name) for name in NarxOptions.__annotations__}
        return narx(log, self.map, ny=int(self.ny), **lags, **options)


class StateSpaceRegressor(_Regressor):
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
        delays = _orders("nk", self.nk, log.inputs) if log.inputs and self.nk is not None else None
        return ss(log, self.order, nk=delays, **options)


def _orders(argument: str, orders: Orders, names: Sequence[str]) -> int | list[int]:
    """One order for all inputs, or a list of one for each, which may be given by name."""
    if isinstance(orders, Mapping):
        other = set(orders) - set(names)
        if other:
            raise ValueError(f"{argument}: {sorted(other)[0]!r} is no input; there are {', '.join(map(repr, names))}")
        left = [name for name in names if name not in orders]
        if left:
            raise ValueError(f"{argument}: there is none for {left[0]!r}; give one for each input")
        return [int(orders[name]) for name in names]
    if isinstance(orders, numbers.Integral):
        return int(orders)
    return [int(order) for order in orders]  # type: ignore[union-attr]

"""What the regressors of scikit-learn have in common: arrays as logs, predictions, scores."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Union

import numpy as np
import numpy.ma as ma
from narwhals.dependencies import is_pandas_like_dataframe, is_pandas_like_series
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.metrics import r2_score
from sklearn.utils import check_array, check_consistent_length, column_or_1d
from sklearn.utils.validation import check_is_fitted, validate_data

from thetahat._thetahat import EstimationError
from thetahat.base import clock as _clock, numbers as _numbers
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

Orders = Union[int, "Sequence[int]", "Mapping[str, int]"]
"""One order for all inputs, or one for each, by the names of the columns too."""


# Without stubs of scikit-learn its classes are Any to mypy.
class Regressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
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


def orders_of(argument: str, orders: Orders, names: Sequence[str]) -> int | list[int]:
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

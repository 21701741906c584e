"""The state of a model along a log: what `thetahat filter` does, over whole logs and row by row."""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import clock as _clock, numbers as _numbers, picture as _picture
from thetahat.base.said import deprecated
from thetahat.engine import files as _files, options as _options, runs as _runs
from thetahat.engine.values import Duration, Initial
from thetahat.fits.grey_box import GreyBox
from thetahat.logs.log import Log
from thetahat.models.model import Model
from thetahat.online import rows as _rows
from thetahat.online.state_model import StateModel

if TYPE_CHECKING:
    import os

Array = npt.NDArray[np.float64]


class StateEstimate(NamedTuple):
    """What a filter knows after a row.

    Standard deviations, and what follows from them, are NaN of an observer, which knows no noise, and where noise is bounded.
    """

    row: int
    """The row, counted from 0."""
    time: float
    """Seconds since the first row."""
    predicted: Array
    """The state given all rows before, shape (n,)."""
    predicted_deviations: Array
    """Its standard deviations."""
    filtered: Array
    """The state given this row too. NaN of an observer: in predictor form a measurement corrects the state of the next row."""
    filtered_deviations: Array
    """Its standard deviations."""
    parameters: Array
    """The unknown parameters given this row too, in their own units, shape (p,)."""
    parameter_deviations: Array
    """Their standard deviations, to first order."""
    outputs: Array
    """The outputs as predicted, shape (m,)."""
    output_deviations: Array
    """The standard deviations of the innovations."""
    innovations: Array
    """The outputs less their predictions; NaN where one is missing."""
    nis: float
    """The normalised innovation squared: chi-square with as many degrees of freedom as elements measured if the model is right."""
    nis_bounds: Array
    """Between which it lies in 95 % of the rows if the model is right, shape (2,)."""
    log_likelihood: float
    """The log-likelihood of this row given those before: 0 if nothing was measured."""
    predicted_bounds: Array
    """How far at most the state is from ``predicted``, where noise is bounded; else NaN."""
    filtered_bounds: Array
    """How far at most the state is from ``filtered``, where noise is bounded; else NaN."""
    output_bounds: Array
    """How large the innovations are at most, where noise is bounded; else NaN."""
    contradiction: int
    """The output that no state within the bounds explains, so that the row was not used; -1 if there is none."""
    action: str
    """What was done with the measurement, see `Innovation`."""
    held: npt.NDArray[np.bool_]
    """Which inputs are missing in this row, so that their last value was held."""


class StateTrajectory:
    """What a `StateFilter` knew in a run, row by row.

    Standard deviations, and what follows from them, are NaN of an observer, which knows no noise, and where noise is bounded.

    Attributes
    ----------
    time : ndarray, shape (N,)
        Seconds.
    measured : ndarray, shape (N, m)
        The outputs of the log.
    predicted, predicted_deviations : ndarray, shape (N, n)
        The states given all rows before, and their standard deviations.
    filtered, filtered_deviations : ndarray, shape (N, n)
        The states given this row too. NaN of an observer.
    parameters, parameter_deviations : ndarray, shape (N, p)
        The unknown parameters given this row too, in their own units.
    outputs, output_deviations : ndarray, shape (N, m)
        The outputs as predicted, and the standard deviations of the innovations.
    innovations : ndarray, shape (N, m)
        The outputs less their predictions; NaN where one is missing.
    nis : ndarray, shape (N,)
        The normalised innovations squared; NaN where nothing was measured.
    nis_bounds : ndarray, shape (N, 2)
        Between which they lie in 95 % of the rows if the model is right.
    log_likelihoods : ndarray, shape (N,)
        The log-likelihood of each row given those before; `log_likelihood` is their sum.
    predicted_bounds, filtered_bounds : ndarray, shape (N, n)
        How far at most the state is from the estimate, where noise is bounded; else NaN.
    output_bounds : ndarray, shape (N, m)
        How large the innovations are at most, where noise is bounded; else NaN.
    contradictions : ndarray, shape (N,)
        The output that no state within the bounds explains, so that the row was not used; -1 where there is none.
    actions : ndarray of str, shape (N,)
        What was done with each row, see `Innovation`.
    held : ndarray of bool, shape (N, k)
        Which inputs are missing, so that their last value was held.
    smoothed, smoothed_deviations : ndarray, shape (N, n), or None
        The states given all rows, later ones too, where that was asked for.
    smoothed_parameters, smoothed_parameter_deviations : ndarray, shape (N, p), or None
        The unknown parameters given all rows.
    """

    time: Array
    measured: Array
    predicted: Array
    predicted_deviations: Array
    filtered: Array
    filtered_deviations: Array
    parameters: Array
    parameter_deviations: Array
    outputs: Array
    output_deviations: Array
    innovations: Array
    nis: Array
    nis_bounds: Array
    log_likelihoods: Array
    predicted_bounds: Array
    filtered_bounds: Array
    output_bounds: Array
    contradictions: Array
    actions: npt.NDArray[np.str_]
    held: npt.NDArray[np.bool_]
    smoothed: Array | None = None
    smoothed_deviations: Array | None = None
    smoothed_parameters: Array | None = None
    smoothed_parameter_deviations: Array | None = None

    def __init__(self, filter: StateFilter, rows: _rows.Rows, found: dict[str, Any]) -> None:
        for name, values in found.items():
            setattr(self, name, values)
        self.time = rows.time(filter.sample_time)
        self.measured = rows.outputs
        self.state_names = filter.states
        self.parameter_names = filter.unknown
        self.input_names = filter.inputs
        self.output_names = filter.outputs
        self._clock = rows.clock
        self._observes = filter.estimator == "luenberger"
        self._bounded = filter.estimator == "bounded"

    @property
    def log_likelihood(self) -> float:
        """The log-likelihood of all measurements; NaN of an observer."""
        # As the document adds them up.
        return float(np.cumsum(self.log_likelihoods)[-1])

    def to_pandas(self) -> Any:
        """A data frame of pandas with the index that the log came with; its columns are those of ``thetahat filter``.

        Examples
        --------
        >>> import pandas as pd
        >>> import thetahat as th
        >>> walk = th.StateModel([[1]], [[1]], [[1]], [[4]], [[100]], sample_time=1, states=["level"])
        >>> flow = pd.Series([3.0, 5.0, None], pd.date_range("2026-03-01", periods=3, freq="s"))
        >>> th.StateFilter(walk).run(flow).to_pandas()[["action", "level", "level_sd"]].round(2)
                              action  level  level_sd
        2026-03-01 00:00:00  updated   2.88      1.96
        2026-03-01 00:00:01  updated   4.04      1.48
        2026-03-01 00:00:02  missing   4.04      1.79
        """
        return _clock.to_pandas(self._clock, self.time, self._columns())

    def to_polars(self) -> Any:
        """As `to_pandas`, for Polars: the times are the first column."""
        return _clock.to_polars(self._clock, self.time, self._columns())

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {"action": self.actions}
        if self._bounded:
            places = self.contradictions.astype(int)
            columns["contradicts"] = np.array([self.output_names[place] if place >= 0 else "" for place in places], dtype=np.str_)

        def pair(name: str, values: Array | None, deviations: Array | None, place: int) -> None:
            if values is not None and deviations is not None:
                columns[name] = values[:, place]
                if not self._observes:
                    columns[f"{name}_sd"] = deviations[:, place]

        def interval(name: str, values: Array, bounds: Array, place: int) -> None:
            columns[name] = values[:, place]
            columns[f"{name}_low"] = values[:, place] - bounds[:, place]
            columns[f"{name}_high"] = values[:, place] + bounds[:, place]

        for place, name in enumerate(self.state_names):
            if self._bounded:
                interval(name, self.filtered, self.filtered_bounds, place)
                interval(f"{name}_predicted", self.predicted, self.predicted_bounds, place)
                continue
            if not self._observes:
                pair(name, self.filtered, self.filtered_deviations, place)
            pair(f"{name}_predicted", self.predicted, self.predicted_deviations, place)
            pair(f"{name}_smoothed", self.smoothed, self.smoothed_deviations, place)
        for place, name in enumerate(self.parameter_names):
            pair(name, self.parameters, self.parameter_deviations, place)
            pair(f"{name}_smoothed", self.smoothed_parameters, self.smoothed_parameter_deviations, place)
        for place, name in enumerate(self.output_names):
            columns[f"measured_{name}"] = self.measured[:, place]
            columns[f"predicted_{name}"] = self.outputs[:, place]
            if self._bounded:
                columns[f"innovation_{name}"] = self.innovations[:, place]
                columns[f"innovation_{name}_bound"] = self.output_bounds[:, place]
                continue
            pair(f"innovation_{name}", self.innovations, self.output_deviations, place)
        if not self._observes and not self._bounded:
            columns |= {"nis": self.nis, "nis_low": self.nis_bounds[:, 0], "nis_high": self.nis_bounds[:, 1]}
            columns["log_likelihood"] = self.log_likelihoods
        if self.input_names:
            names = np.array(self.input_names, dtype=np.object_)
            columns["held"] = np.array([" ".join(names[held]) for held in self.held], dtype=np.str_)
        return columns

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        smoothed = "" if self.smoothed is None else ", smoothed"
        return f"StateTrajectory({len(self)} rows, states {', '.join([*self.state_names, *self.parameter_names])}{smoothed})"

    def _repr_html_(self) -> str:
        states = self.predicted if self._observes else self.filtered
        lines = [(name, [states[:, place]]) for place, name in enumerate(self.state_names)]
        lines += [(name, [self.parameters[:, place]]) for place, name in enumerate(self.parameter_names)]
        return _picture.rows(repr(self), lines)


class StateFilter:
    """An estimator of the state of a model, fed row by row or with whole logs: what ``thetahat filter`` does.

    ::

        first row     correct x0, P0 with y(1)
        later rows    predict over the step from the row before, with that row's u; then correct with y(k) and u(k)

    Inputs are held from their row to the next. A NaN among the outputs is a missing element, which is skipped alone. A NaN among
    the inputs is replaced by that input's last value, and before the first one by its offset.

    Parameters
    ----------
    model : Model, StateModel or GreyBox
        The model: of a fit, in innovations form, with its offsets, or where it is a nonlinear ARX model with its lags as the state, as
        deviations from the offsets; or in matrices or equations.
    estimator : {"kalman", "ekf", "iekf", "ukf", "bounded", "luenberger"}, optional
        How to estimate: "kalman" for a linear model, else "ekf", the extended Kalman filter, which estimates unknown parameters
        with the state. "iekf" iterates its corrections, for accurate measurements of what bends; "ukf" is the unscented
        filter, whose deviations know how the model bends. "bounded" keeps a set in which the state is for certain while noises
        keep their bounds, for linear models in matrices or of a fit. "luenberger" is an observer, with ``poles`` or ``gain``.
    initial : {"unknown", "zero"}, optional
        The initial state of a `Model`: unknown, so that it is estimated from the first rows, which is the default; or at rest, with its
        channels at their offsets. Equations and matrices have an initial state of their own.
    measurement_noise : float, or array_like of shape (m,), optional
        Standard deviation of white noise in what is measured, in units of each output, beside the noise of the `Model`, which drives
        the plant: for nonlinear ARX models, 0 unless it is said. The others say theirs.
    deviations : float, optional
        For "bounded": so many standard deviations of its noises bound those of a model that says no bounds.
    poles : array_like of complex, shape (n,), optional
        Where the error of the observer is to have its poles in the z plane.
    gain : array_like, shape (n, m), optional
        The gain of the observer instead.

    Raises
    ------
    ValueError
        If the model is not for this estimator, or the poles or the gain do not fit it.

    See Also
    --------
    thetahat.KalmanFilter : A filter whose models are arguments of each step.

    Notes
    -----
    A model in equations with ``dt`` or ``[derivative]`` takes steps of any length. Any other takes whole multiples of its sample
    time, within 1 %: it predicts as many times.

    An object is for one thread at a time. It pickles and copies, wherever it stands.

    References
    ----------
    Anderson and Moore, Optimal Filtering, 1979. Luenberger, An introduction to observers, 1971. Bell and Cathey, The iterated
    Kalman filter update as a Gauss-Newton method, 1993. Julier and Uhlmann, Unscented filtering and nonlinear estimation, 2004. Alamo,
    Bravo and Camacho, Guaranteed state estimation by zonotopes, 2005.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> filter = th.StateFilter(th.arx(log[:700], na=2, nb=2))
    >>> trajectory = filter.run(log[700:])
    >>> trajectory.filtered.shape
    (300, 2)
    >>> filter.update(log.y[-1], log.u[-1]).action
    'updated'

    Noise of which the bound alone is known: the level is in its interval for certain, and the last row cannot be.

    >>> bounds = {"process_bound": 0.1, "measurement_bound": 1, "initial_bound": 100}
    >>> tank = th.StateModel([[1]], [[1]], **bounds, sample_time=1, states=["level"])
    >>> level = th.StateFilter(tank, "bounded").run([3.0, 4.0, 3.5, 9.0])
    >>> level.to_pandas()[["contradicts", "level", "level_low", "level_high"]].round(2).values.tolist()[2:]
    [['', 3.55, 2.9, 4.2], ['y', 3.55, 2.8, 4.3]]
    """

    __slots__ = ("_deviations", "_filter", "_gain", "_initial", "_last", "_model", "_noise", "_poles", "_seen", "estimator")
    estimator: str

    def __init__(
        self,
        model: Model | StateModel | GreyBox,
        estimator: Literal["kalman", "ekf", "iekf", "ukf", "bounded", "luenberger"] | None = None,
        *,
        initial: Initial | None = None,
        measurement_noise: npt.ArrayLike | None = None,
        deviations: float | None = None,
        poles: npt.ArrayLike | None = None,
        gain: npt.ArrayLike | None = None,
    ) -> None:
        if isinstance(model, (StateModel, GreyBox)):
            if initial is not None:
                raise ValueError(f"initial: a {type(model).__name__} says itself where it starts; leave it out")
            seen = model._model if isinstance(model, StateModel) else _thetahat.StateModel.from_grey_box(model._model)
        elif isinstance(model, Model):
            start = None if initial is None else _options.text("initial", initial)
            seen = _thetahat.StateModel.from_model(model._model, start)
        else:
            raise TypeError(f"model: expected a Model, a StateModel or a GreyBox, found {type(model).__name__}")
        if measurement_noise is not None:
            measurement_noise = _numbers.array("measurement_noise", measurement_noise).reshape(-1).copy()
            seen = seen.with_measurement_noise(measurement_noise.tolist())
        if estimator is not None:
            _options.text("estimator", estimator)
        self._poles = None if poles is None else _poles(poles)
        self._gain = gain if gain is None else _numbers.array("gain", gain).copy()
        split = None if self._poles is None else (self._poles.real.tolist(), self._poles.imag.tolist())
        self._deviations = None if deviations is None else float(_options.number("deviations", deviations))
        self._filter = _thetahat.StateFilter(seen, estimator, self._deviations, split, self._gain)
        self._model, self._initial, self._noise, self._seen = model, initial, measurement_noise, seen
        self.estimator = ("kalman" if seen.is_linear else "ekf") if estimator is None else estimator
        self._last: _rows.Last | None = None

    def update(self, y: npt.ArrayLike, u: npt.ArrayLike | None = None, *, seconds: Duration | None = None) -> StateEstimate:
        """Take one row.

        Parameters
        ----------
        y : float, or array_like of shape (m,)
            The outputs, in their own units. NaN is a missing one.
        u : float, or array_like of shape (k,); None without inputs
            The inputs, recorded at the same instant. NaN is a missing one.
        seconds : float or timedelta, optional
            Time since the row before: one sample time, unless said otherwise. It does not count for the first row.

        Returns
        -------
        StateEstimate

        Raises
        ------
        ValueError
            If a shape is wrong, a value infinite, the step does not fit the model, or the estimate cannot go on. Nothing has
            changed then.
        """
        step = None if seconds is None else _options.seconds("seconds", seconds)
        found = StateEstimate(**self._filter.step(step, u, y))
        if self._last is not None:
            # No date is known of it.
            self._last = _rows.Last(self._last.seconds + (self.sample_time if step is None else step))
        return found

    @deprecated("step is deprecated: its name is update")
    def step(self, y: npt.ArrayLike, u: npt.ArrayLike | None = None, *, seconds: Duration | None = None) -> StateEstimate:
        """The name that `update` had. Deprecated."""
        return self.update(y, u, seconds=seconds)

    def predict(self, u: npt.ArrayLike | None = None, steps: int | None = None) -> Array:
        """The outputs to come, y(k+1), y(k+2), …, y(k) being that of the latest row.

        Parameters
        ----------
        u : array_like, shape (steps,) or (steps, k), optional
            The inputs of these rows, in their own units. Without them the latest ones are held.
        steps : int, optional
            How many, 1 to 10000; with ``u`` as many as that has rows, else 1.

        Returns
        -------
        ndarray, shape (steps,), or (steps, m) where there are several outputs

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> filter = th.StateFilter(th.arx(log[:700], na=2, nb=2))
        >>> _ = filter.run(log[700:900])
        >>> filter.predict(log.u[900:903]).shape
        (3,)
        """
        return _runs.predicted(self._filter, len(self.inputs), u, steps)

    def run(
        self,
        data: _rows.Data,
        *,
        u: _numbers.Columns | None = None,
        time: _rows.Times | None = None,
        sample_time: Duration | None = None,
        smooth: bool = False,
    ) -> StateTrajectory:
        """Take many rows: the same as `update` in a loop, to the bit.

        The interpreter lock is released meanwhile. Rows go on from those before them: of two parts of a log the second follows the
        first.

        Parameters
        ----------
        data : Log, data frame, dict of str to array_like, or array_like of shape (N,) or (N, m)
            The outputs and inputs. Those of a log, a frame or a dict are found by name; an array holds the outputs.
        u : array_like of shape (N,) or (N, k), or data frame or dict of str to array_like, optional
            The inputs, where they are not in ``data``.
        time : str or array_like of shape (N,), optional
            The times, or the column that holds them: instants, durations or seconds, which may lie irregularly. Without it an index of
            pandas is the clock if it holds times. A log has its own clock.
        sample_time : float or timedelta, optional
            Time from row to row instead: that of the model, unless said otherwise.
        smooth : bool, default False
            Whether to give each state given all rows too, later ones as well. The filter must not have seen rows before.

        Returns
        -------
        StateTrajectory

        Raises
        ------
        TypeError
            If something does not hold numbers.
        ValueError
            If a channel is not there, a shape is wrong, a value infinite, a step does not fit the model, or the estimate cannot go
            on. Nothing has changed then.

        Examples
        --------
        >>> import thetahat as th
        >>> walk = th.StateModel([[1]], [[1]], [[1]], [[1e-9]], [[1]], sample_time=1)
        >>> # Between two measurements a walk is a line.
        >>> th.StateFilter(walk).run([2.0, None, None, None, 6.0], smooth=True).smoothed[:, 0].round(6)
        array([2., 3., 4., 5., 6.])
        """
        rows = _rows.of(data, u, time, sample_time, self.inputs, self.outputs)
        if not isinstance(smooth, bool):
            raise TypeError(f"smooth: expected True or False, found {smooth!r}")
        if rows.boundaries:
            raise ValueError("data: it holds several experiments, which have states of their own; take log[log.experiments[0]], …")
        steps = None
        if rows.seconds is not None:
            steps = np.diff(rows.seconds, prepend=np.nan)
            if self._last is not None:
                steps[0] = self._last.until(rows)
        elif rows.sample_time is not None:
            steps = np.full(len(rows), rows.sample_time)
        before = rows.before
        if rows.seconds is None and rows.sample_time is None and before:
            # A second from row to row was assumed, and is the model's sample time.
            before *= self.sample_time / data.sample_time if isinstance(data, Log) else 1.0
        found = self._filter.run(steps, rows.inputs, rows.outputs, before, smooth)
        self._last = _rows.last(rows)
        return StateTrajectory(self, rows, found)

    @property
    def latest(self) -> StateEstimate | None:
        """What it knows after the latest row; None before the first."""
        found = self._filter.latest()
        return None if found is None else StateEstimate(**found)

    @property
    def model(self) -> Model | StateModel | GreyBox:
        """The model."""
        return self._model

    @property
    def states(self) -> list[str]:
        """The names of the states."""
        return self._seen.states

    @property
    def unknown(self) -> list[str]:
        """The names of the unknown parameters."""
        return self._seen.unknown

    @property
    def inputs(self) -> list[str]:
        """The channels of the inputs."""
        return self._seen.inputs

    @property
    def outputs(self) -> list[str]:
        """The channels of the outputs."""
        return self._seen.outputs

    @property
    def sample_time(self) -> float:
        """Seconds of a sample of the model."""
        return self._seen.sample_time

    @property
    def rows(self) -> int:
        """How many rows it has taken."""
        return self._filter.rows

    @property
    def log_likelihood(self) -> float:
        """The log-likelihood of all measurements so far; NaN of an observer."""
        found = self.document["log_likelihood"]
        return float("nan" if found is None else found)

    def to_json(self) -> str:
        """The document of ``thetahat filter --summary``: of the same rows the same bytes.

        Examples
        --------
        >>> import thetahat as th
        >>> walk = th.StateModel([[1]], [[1]], [[1]], [[4]], [[100]], sample_time=1)
        >>> filter = th.StateFilter(walk)
        >>> _ = filter.run([3.0, 5.0])
        >>> filter.to_json().splitlines()[1]
        '  "schema": "thetahat.filter/1",'
        """
        return self._filter.to_json()

    @property
    def document(self) -> dict[str, Any]:
        """The document as a dict: all that there is to know at the latest row."""
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    def summary(self) -> str:
        """The table that ``thetahat filter`` prints."""
        return self._filter.table()

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words: whether the innovations are as large as the model says."""
        warning = self._filter.warning()
        return [] if warning is None else [warning]

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the document to a file, whole or not at all."""
        _thetahat.write(_files.name(path), self.to_json())

    def __reduce__(self) -> tuple[Any, ...]:
        given = (self._model, self.estimator, self._initial, self._noise, self._deviations, self._poles, self._gain)
        return (_restored, (given, self._filter.snapshot(), self._last))

    def __repr__(self) -> str:
        names = ", ".join([*self.states, *self.unknown])
        return f"StateFilter({self.estimator}, {self.rows} rows, states {names})"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


def _restored(given: tuple[Any, ...], snapshot: str, last: _rows.Last | None) -> StateFilter:
    """Makes a filter again of what `__reduce__` gave."""
    model, estimator, initial, noise, deviations, poles, gain = given
    made = StateFilter(
        model, estimator, initial=initial, measurement_noise=noise, deviations=deviations, poles=poles, gain=gain
    )
    made._filter.resume(snapshot)
    made._last = last
    return made


def _poles(poles: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    try:
        found = np.asarray(poles, dtype=np.complex128)
    except (TypeError, ValueError) as error:
        raise TypeError(f"poles: expected numbers, found {_numbers.shown(poles)}") from error
    if found.ndim != 1 or found.size == 0:
        raise ValueError(f"poles: expected one dimension with an entry for each state, found shape {found.shape}")
    return found.copy()

"""Models that are estimated along a log: what `thetahat track` does, over whole logs and row by row."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Literal, Union

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat._thetahat import Forgetting
from thetahat.base import clock as _clock, numbers as _numbers
from thetahat.base.said import deprecated
from thetahat.engine import files as _files, options as _options, runs as _runs
from thetahat.engine.values import Duration
from thetahat.models.model import Model
from thetahat.online import rows as _rows
from thetahat.online.tracked import Tracked, TrackTrajectory, shaped

if TYPE_CHECKING:
    import os

Array = npt.NDArray[np.float64]

Policy = Union[float, str, Forgetting, None]
"""A way to forget: a factor, a text such as "selective:0.99", a `Forgetting`, or None."""


class Tracker:
    """An ARX, ARMAX or nonlinear ARX model that is estimated while the plant runs: what ``thetahat track`` does.

    ::

        A(q) y(k) = sum_j B_j(q) u_j(k) + constant + C(q) e(k),   or   y(k) = g(past outputs and inputs) + e(k)

    It is a `RecursiveArx`, a `RecursiveArmax` or a `RecursiveNarx` with what a log needs: channels with names and offsets, scales that are found in
    the first rows, gaps of the clock, predictions and forecasts, figures, detection of changes, a start from a fitted model, and a
    state that is kept in a file.

    With several outputs A has a full matrix for each of the na past samples: an equation for each output, with the past of all of them.
    Parameters are those of each equation: ``a2_1`` multiplies the second output a sample ago. Arrays have an axis for the outputs in front of
    that of the parameters.

    Parameters
    ----------
    na : int, optional
        Coefficients of A: past outputs.
    nb : int or sequence of int, optional
        Coefficients of B: one value for each input or one for all, 0 for a model without inputs.
    nc : int, optional
        Coefficients of C: past disturbances.
    nk : int or sequence of int, default 1
        Samples from input to first effect, one value for each input or one for all.
    warm : Model, optional
        Start from a fit instead: its orders or functions, parameters, covariance, noise and offsets.
    narx : {"poly"}, optional
        Track a nonlinear model instead: all products of lags up to a degree. Functions that a fit has chosen come with ``warm``.
    ny : int, default 2
        With ``narx``: past outputs that are read.
    nu : int or sequence of int, default 2
        With ``narx``: values of each input that are read, from ``nk`` on.
    degree : int, default 2
        With ``narx``: factors of a product at most.
    inputs : sequence of str, or str, optional
        The channels of the inputs: those of ``warm``; without it u, or u1, u2, … as many as nb has.
    output : str or sequence of str, optional
        The channel of the output, or those of several: that of ``warm``, or y.
    couple : {"full", "none"}, optional
        With several outputs: whether an output depends on the past of all, which is the default, or on its own.
    offset : dict of str to float, optional
        What is subtracted from a channel: 0, or the offsets of ``warm``.
    scale : dict of str to float, optional
        The typical magnitude of each channel; a factor of 3 does not matter. Without them the largest of the first rows, from
        which then nothing is predicted.
    constant : bool, default False
        Whether a constant is estimated too, for channels of which the offsets are not known; without ``offset`` the first value of each
        is taken off.
    method : {"rls", "els", "rpem"}, optional
        Recursive least squares; with C extended least squares, or the recursive prediction error method, which is the default.
    forgetting : float, str, Forgetting or None, or a sequence of them, default 0.99
        What is forgotten; several run side by side. A float is exponential forgetting with that factor, None forgets nothing. A text is
        "none", "exponential:LAMBDA", "selective:LAMBDA", "random-walk:VARIANCE" or "variable:LAMBDA:MINIMUM:NOISE".
    start : str, optional
        "standard" (from a wide prior), "exact" (without prior, once the rows determine the parameters), "mixed" or
        "mixed:SAMPLES" (standard, then blended into exact).
    dead_zone : float, optional
        An innovation of at most this size corrects nothing, in units of the output.
    outliers : str, optional
        What becomes of rows whose innovations are far larger than the noise makes them: "used"; "huber:THRESHOLD", where one of more
        than THRESHOLD standard deviations corrects as one of so many; "gate:NIS:RELEASE", where one whose normalised square is
        above NIS corrects nothing, until RELEASE of them came in a row. "huber" is "huber:3", "gate" is "gate:25:20". "used" if not given.
    horizon : int, optional
        Forecast the output this many rows later in each row, inputs held at their last value.
    alarm : float, optional
        Watch the innovations for changes of their mean and variance (CUSUM), with this many samples between two false alarms on
        average, 10 to 1e9. See `ChangeDetector`.
    sample_time : float or timedelta, optional
        Time from one row to the next, where rows have times: that of ``warm``, or the first step. A step of less than half or more than
        one and a half of it is a gap.

    Raises
    ------
    ValueError
        If orders are missing or do not go with the method, a name is no channel, or a number is out of its range.

    Notes
    -----
    An object is for one thread at a time. It pickles and copies, wherever it stands.

    References
    ----------
    Ljung, System Identification, 2nd ed., 1999, chapter 11.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> tracker = th.Tracker(na=2, nb=2, forgetting=[0.99, None])
    >>> trajectory = tracker.run(log[:900])
    >>> trajectory.parameters.shape
    (900, 4, 2)
    >>> tracker.parameters[:, 1].round(2)
    array([-1.54,  0.58,  0.36,  0.32])
    >>> tracked = tracker.update(log.y[900], log.u[900], time=log.time[900])
    >>> tracked.action.tolist()
    ['updated', 'updated']
    """

    __slots__ = ("_sample_time", "_tracker")
    _tracker: _thetahat.Tracker
    _sample_time: float | None

    def __init__(
        self,
        na: int | None = None,
        nb: int | Sequence[int] | None = None,
        nc: int | None = None,
        nk: int | Sequence[int] | None = None,
        *,
        warm: Model | None = None,
        narx: Literal["poly"] | None = None,
        ny: int | None = None,
        nu: int | Sequence[int] | None = None,
        degree: int | None = None,
        inputs: Sequence[str] | str | None = None,
        output: str | Sequence[str] | None = None,
        couple: Literal["full", "none"] | None = None,
        offset: Mapping[str, float] | None = None,
        scale: Mapping[str, float] | None = None,
        constant: bool = False,
        method: Literal["rls", "els", "rpem"] | None = None,
        forgetting: Policy | Sequence[Policy] = 0.99,
        start: str | None = None,
        dead_zone: float | None = None,
        outliers: str | None = None,
        horizon: int | None = None,
        alarm: float | None = None,
        sample_time: Duration | None = None,
    ) -> None:
        orders = {"na": na, "nb": nb, "nc": nc, "nk": nk}
        lags = {"ny": ny, "nu": nu, "degree": degree}
        for name, value in lags.items():
            if value is not None and narx is None:
                raise ValueError(f"{name}: this is for narx='poly'; leave it out")
        named = None if inputs is None else [inputs] if isinstance(inputs, str) else list(inputs)
        if warm is not None:
            if not isinstance(warm, Model):
                raise TypeError(f"warm: expected a Model, found {type(warm).__name__}")
            for name, order in {**orders, "narx": narx}.items():
                if order is not None:
                    raise ValueError(f"{name}: the orders are those of warm; leave it out")
            named = warm.inputs if named is None else named
            if len(named) != len(warm.inputs):
                raise ValueError(f"inputs: expected {len(warm.inputs)} names as warm has inputs, found {len(named)}")
        elif named is None:
            named = _inputs(nb if narx is None else 2 if nu is None else nu)
        plan = _options.plan(
            {
                **orders,
                "narx": narx,
                **lags,
                "constant": _options.flag("constant", constant) or None,
                "method": method,
                "start": start,
                "outliers": outliers,
                "couple": couple,
                "forgetting": ",".join(_policies(forgetting)),
                "offset": offset,
                "scale": scale,
                "dead_zone": dead_zone,
                "horizon": None if horizon is None else _options.count("horizon", horizon, 10_000),
                "alarm": alarm,
            }
        )
        self._sample_time = None if sample_time is None else _options.seconds("sample_time", sample_time)
        given = self._sample_time
        if given is None and warm is not None:
            self._sample_time = warm.sample_time
        named = [_options.text("inputs", name) for name in named]
        if output is None:
            measured = ["y"] if warm is None else warm.outputs
        else:
            measured = [_options.text("output", name) for name in ([output] if isinstance(output, str) else list(output))]
        if len({*named, *measured}) < len(named) + len(measured):
            raise ValueError(f"inputs: {_numbers.twice([*named, *measured])!r} is named twice; each channel has one role")
        self._tracker = _thetahat.Tracker(plan, given, named, measured, None if warm is None else warm._model)

    @classmethod
    def from_state(cls, text: str) -> Tracker:
        """Go on from the state that `state` gave or ``thetahat track --state`` wrote.

        Parameters
        ----------
        text : str
            The state.

        Raises
        ------
        ValueError
            If the text is no such state, or was edited.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> tracker = th.Tracker(na=2, nb=2)
        >>> _ = tracker.run(log[:500])
        >>> again = th.Tracker.from_state(tracker.state())
        >>> bool((again.run(log[500:]).parameters == tracker.run(log[500:]).parameters).all())
        True
        """
        return cls._restored(_options.text("text", text), None, None)

    @classmethod
    def read_state(cls, path: str | os.PathLike[str]) -> Tracker:
        """Go on from the state in a file, see `from_state`."""
        with open(_files.name(path), encoding="utf-8") as file:
            return cls.from_state(file.read())

    @classmethod
    def _restored(cls, text: str, inputs: Sequence[str] | None, sample_time: float | None) -> Tracker:
        """Makes a tracker again of what `__reduce__` gave."""
        made = object.__new__(cls)
        made._tracker = _thetahat.Tracker.from_state(text, inputs)
        made._sample_time = json.loads(text)["pace"]["sample_time"] if sample_time is None else sample_time
        return made

    def state(self) -> str:
        """All that there is to know to go on, to the bit: the state that ``thetahat track --state`` writes.

        Of the same rows it is the same to the byte. It counts the lines that the program would have written about them, so that the
        program goes on from it with its output after these.
        """
        return self._tracker.state()

    def write_state(self, path: str | os.PathLike[str]) -> None:
        """Write the state to a file, whole or not at all."""
        _thetahat.write(_files.name(path), self.state())

    def update(self, y: npt.ArrayLike, u: npt.ArrayLike | None = None, *, time: float | None = None) -> Tracked:
        """Take one row of a log: y(k) and u(k), recorded at the same instant.

        Parameters
        ----------
        y : float, or array_like of shape (outputs,)
            The output, in its own unit. NaN is a missing sample.
        u : float, or array_like of shape (inputs,); None without inputs
            The inputs. NaN is a missing sample.
        time : float, optional
            Seconds; where rows have times, each has one.

        Returns
        -------
        Tracked

        Raises
        ------
        ValueError
            If a shape is wrong, a value infinite, or the time not after that of the row before. Nothing has changed then.
        """
        seconds = None if time is None else float(_options.number("time", time))
        found = self._tracker.row(y, u, seconds)
        if isinstance(found[0], float):
            return Tracked._make(found)
        *columns, alarms = found
        predicted, error, variance, nis, action, excitation, forecast = (self._one(np.asarray(column)) for column in columns)
        return Tracked(predicted, error, variance, nis, action, excitation, forecast, alarms)

    @deprecated("log_row is deprecated: its name is update")
    def log_row(self, y: npt.ArrayLike, u: npt.ArrayLike | None = None, *, time: float | None = None) -> Tracked:
        """The name that `update` had. Deprecated."""
        return self.update(y, u, time=time)

    def predict(self, u: npt.ArrayLike | None = None, steps: int | None = None) -> Array:
        """The outputs to come, y(k+1), y(k+2), …, y(k) being that of the latest row.

        Parameters
        ----------
        u : array_like, shape (steps,) or (steps, inputs), optional
            The inputs of these rows, in their own units. Without them the latest ones are held.
        steps : int, optional
            How many, 1 to 10000; with ``u`` as many as that has rows, else 1.

        Returns
        -------
        ndarray, shape (steps,)
            In the units of the log. With several outputs an axis for these follows, with several ways to forget a last one. NaN before
            there is an estimate, and where it depends on a missing sample.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> tracker = th.Tracker(na=2, nb=2)
        >>> _ = tracker.run(log[:900])
        >>> bool(np.all(np.abs(tracker.predict(log.u[900:905]) - log.y[900:905]) < 10))
        True
        """
        future = None if u is None else _runs.future(u, len(self.inputs), steps)
        count = len(future) if future is not None else 1 if steps is None else steps
        return shaped(self._tracker, self._tracker.predict(future, _options.count("steps", count, 10_000)), 1)

    def run(
        self,
        data: _rows.Data,
        u: _numbers.Columns | None = None,
        *,
        time: _rows.Times | None = None,
        stop_on_alarm: bool = False,
    ) -> TrackTrajectory:
        """Take many rows: the same as `update` in a loop, to the bit.

        The interpreter lock is released meanwhile. Rows go on from those before them: of two parts of a log the second follows the
        first.

        Parameters
        ----------
        data : Log, data frame, dict of str to array_like, or array_like of shape (N,) or (N, outputs)
            The output and inputs. Those of a log, a frame or a dict are found by name; an array holds the outputs. Between the
            experiments of a log are gaps.
        u : array_like of shape (N,) or (N, inputs), or data frame or dict of str to array_like, optional
            The inputs, where they are not in ``data``.
        time : str or array_like of shape (N,), optional
            The times, or the column that holds them: instants, durations or seconds. Without it an index of pandas is the clock if it
            holds times. A log has its own clock.
        stop_on_alarm : bool, default False
            Whether to end after the row of the first alarm.

        Returns
        -------
        TrackTrajectory

        Raises
        ------
        TypeError
            If something does not hold numbers.
        ValueError
            If a channel is not there, a shape is wrong, a value infinite, or the first time is not after that of the row before.
            Nothing has changed then.
        """
        rows = _rows.of(data, u, time, None, self.inputs, self.outputs)
        if not isinstance(stop_on_alarm, bool):
            raise TypeError(f"stop_on_alarm: expected True or False, found {stop_on_alarm!r}")
        return TrackTrajectory(self._tracker, self._sample_time, rows, self._run(rows, stop_on_alarm))

    def _run(self, rows: _rows.Rows, stop_on_alarm: bool) -> dict[str, Any]:
        name, start, last = self._tracker.clock
        seconds = rows.seconds
        if self.rows > 0 and (name is None) != (seconds is None):
            before, now = ("had times", "have none") if seconds is None else ("had no times", "have some")
            raise ValueError(f"time: the rows before {before}, and these {now}; give all of them times, or none")
        if seconds is not None and self.rows > 0:
            if start is not None and rows.start is not None and start != rows.start:
                seconds = seconds + _apart(start, rows.start)
            if last is not None and not seconds[0] > last:
                raise ValueError(f"time: the first row is {last - seconds[0]:g} s before the latest one that was taken; give later rows")
        clock = None if seconds is None else (seconds, rows.name or "time", rows.start)
        return self._tracker.run(rows.inputs, rows.outputs, clock, list(rows.boundaries), stop_on_alarm)

    def gap(self) -> None:
        """Tell that an unknown number of rows is missing here. Where rows have times, these tell it.

        Raises
        ------
        ValueError
            If rows have times.
        """
        if self._tracker.clock[0] is not None:
            raise ValueError("gap: rows have times, which tell it")
        self._tracker.gap()

    def forecast(self, steps: int) -> Any:
        """The output this many steps ahead of the latest row, inputs held at their latest values.

        Parameters
        ----------
        steps : int
            How many, 1 to 10000.

        Returns
        -------
        float, or ndarray
            In the units of the log. With several outputs an array with one for each; with several ways to forget there is a last axis for
            these. NaN before there is an estimate, and where it depends on a missing sample.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> tracker = th.Tracker(na=2, nb=2)
        >>> _ = tracker.run(log[:900])
        >>> bool(abs(tracker.forecast(1) - log.y[900]) < 5)
        True
        """
        return self._one(self._tracker.forecast(_options.count("steps", steps, 10_000)))

    def _one(self, values: npt.NDArray[Any]) -> Any:
        """What each of the trackers has: a number if there is one of them."""
        found = shaped(self._tracker, values, 0)
        return found.item() if found.ndim == 0 else found

    @property
    def parameters(self) -> Array:
        """The parameters in the order of `parameter_names`, shape ([outputs,] n[, ways to forget]); NaN before there is an estimate."""
        return shaped(self._tracker, self._tracker.parameters(), 0)

    @property
    def standard_errors(self) -> Array:
        """Their standard errors, of the shape of `parameters`; NaN until the noise variance is known."""
        return shaped(self._tracker, self._tracker.standard_errors(), 0)

    @property
    def noise_variance(self) -> Any:
        """The variance of e, a float, or an array of shape ([outputs][, ways to forget]); NaN until enough rows are in."""
        return self._one(self._tracker.noise_variances())

    @property
    def parameter_names(self) -> list[str]:
        """Such as ``a1``, ``b1``, ``constant``."""
        return self._tracker.names

    @property
    def forgetting(self) -> list[str]:
        """The ways to forget, as texts."""
        return self._tracker.policies

    @property
    def inputs(self) -> list[str]:
        """The channels of the inputs."""
        return self._tracker.inputs

    @property
    def output(self) -> str:
        """The channel of the output, of a tracker that has one."""
        if len(self.outputs) > 1:
            raise AttributeError(f"there are several outputs: {', '.join(self.outputs)}; see outputs")
        return self.outputs[0]

    @property
    def outputs(self) -> list[str]:
        """The channels of the outputs."""
        return self._tracker.outputs

    @property
    def offsets(self) -> dict[str, float]:
        """What is taken from each channel."""
        return dict(zip([*self.inputs, *self.outputs], self._tracker.offsets))

    @property
    def scales(self) -> dict[str, float] | None:
        """The typical magnitude of each channel less its offset; None while they are not known."""
        scales = self._tracker.scales
        return None if scales is None else dict(zip([*self.inputs, *self.outputs], scales))

    @property
    def horizon(self) -> int | None:
        """How many rows ahead a forecast is, if one was asked for."""
        return self._tracker.horizon

    @property
    def sample_time(self) -> float | None:
        """Seconds from one row to the next, where that was said."""
        return self._sample_time

    @property
    def rows(self) -> int:
        """How many rows it has taken."""
        return self._tracker.rows

    def to_json(self) -> str:
        """The document of ``thetahat track --summary``: of the same rows the same bytes."""
        return self._tracker.to_json()

    @property
    def document(self) -> dict[str, Any]:
        """The document as a dict: all that there is to know at the latest row."""
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    def summary(self) -> str:
        """The table that ``thetahat track`` prints.

        Examples
        --------
        >>> import thetahat as th
        >>> tracker = th.Tracker(na=2, nb=2)
        >>> _ = tracker.run(th.dc_motor())
        >>> print(tracker.summary().splitlines()[1])
        1000 rows
        """
        return self._tracker.table()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the document to a file, whole or not at all."""
        _thetahat.write(_files.name(path), self.to_json())

    def __reduce__(self) -> tuple[Any, ...]:
        return (Tracker._restored, (self.state(), self.inputs, self._sample_time))

    def __repr__(self) -> str:
        return f"Tracker({self._tracker.orders}, forgetting {', '.join(self.forgetting)}, {self.rows} rows)"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


def _inputs(nb: int | Sequence[int] | None) -> list[str]:
    """The usual names of this many inputs."""
    if isinstance(nb, (list, tuple, np.ndarray)):
        return ["u"] if len(nb) == 1 else [f"u{place}" for place in range(1, len(nb) + 1)]
    return [] if nb is None or nb == 0 else ["u"]


def _policies(forgetting: Any) -> list[str]:
    every = list(forgetting) if isinstance(forgetting, (list, tuple, np.ndarray)) else [forgetting]
    if not every:
        raise ValueError("forgetting: there is none; give at least one")
    return [one if isinstance(one, str) else _thetahat.policy(one) for one in every]


def _apart(first: str, second: str) -> float:
    """Seconds from one time to another, as they are written."""
    try:
        one, other = _clock.read("time", [first, second]).values
    except (TypeError, ValueError):
        raise ValueError(
            f"time: the times of these rows count from {second}, and those before from {first}; give times in ISO 8601"
        ) from None
    return float((other - one) / _clock.SECOND)

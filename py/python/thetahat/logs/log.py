"""Logs: the measured signals that models are fitted to."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.base import clock as _clock, frames as _frames, numbers as _numbers, picture as _picture, said as _said
from thetahat.base.clock import Clock
from thetahat.base.numbers import LONGEST
from thetahat.engine import options as _options
from thetahat.engine.values import Duration, Resample


class Log:
    """Inputs and outputs on a common clock.

    A log owns its data: arrays are copied once, here. NaN is a missing sample; it ends a segment, and nothing reaches
    across. Rows are counted as Python does: ``log[:500]`` is the log of the first 500, and ``log["u"]`` is a channel. A log with dates
    is cut by these too: ``log["2026-03-01":"2026-03-02"]`` are two days.

    Parameters
    ----------
    y : array_like, shape (N,) or (N, outputs), or dict of str to array_like
        The measured output: an array or a list, or a series of pandas, Polars or PyArrow; of several outputs a column for each, or by
        name; a data frame. What is None, NaN, NA, null or masked is missing.
    u : array_like, shape (N,) or (N, inputs), or dict of str to array_like, optional
        The inputs, a column for each, or by name; a data frame. Without them the log is a time series.
    sample_time : float or timedelta, optional
        Time from one row to the next: seconds, or a timedelta of Python, NumPy or pandas. Without it and a clock it is assumed
        to be 1 s; the repr says so.
    time : array_like, shape (N,), optional
        The clock instead: instants with or without a time zone, texts of them in ISO 8601, durations, or seconds; numbers that can
        only be s, ms, µs or ns since 1970, by their size, are these. Steps may differ from their median by 10 %; one longer than
        1.5 medians is a gap. An index of pandas that all series share is the clock if it holds times; one that counts rows is not.
    resample : (float or timedelta, {"linear", "hold", "auto"}) or (…, "unfiltered"), optional
        Puts the log on another clock: time between the new rows, and how to read between the old ones. A step of two recorded
        ones or more is filtered against aliasing first, unless "unfiltered" is added or the clock is irregular.
    input_names : sequence of str, optional
        The names of the inputs: those of the series or of the frame's columns, or ``u``, or ``u1``, ``u2``, …
    output_name : str or sequence of str, optional
        The name of the output: that of the series, or ``y``; of several the names, or those of the frame's columns, or ``y1``, ``y2``, ….
    uniform : bool, default True
        Whether the steps of a clock have to be even. Models in equations take any.

    Raises
    ------
    ValueError
        If an array is empty, has another shape, or holds an infinity, or the clock is not uniform.
    TypeError
        If an array does not hold numbers.

    See Also
    --------
    read_log : A log from a file.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.Log([0.0, 0.0, 0.5, 0.8], [0.0, 1.0, 1.0, 1.0], sample_time=0.1)
    >>> log
    Log(4 rows, inputs u, output y, sample time 0.1 s)
    >>> log[:2].y
    array([0., 0.])
    """

    __slots__ = ("_clock", "_log")
    _log: _thetahat.Log
    _clock: Clock

    def __init__(
        self,
        y: npt.ArrayLike | _numbers.Columns,
        u: _numbers.Columns | None = None,
        *,
        sample_time: Duration | None = None,
        time: npt.ArrayLike | None = None,
        resample: Resample | None = None,
        input_names: Sequence[str] | None = None,
        output_name: str | Sequence[str] | None = None,
        uniform: bool = True,
    ) -> None:
        for argument, value in (("y", y), ("u", u)):
            if isinstance(value, Log):
                raise TypeError(f"{argument}: expected numbers, found a Log; its channels are log.y, log.u and log['name']")
            if isinstance(value, str):
                raise TypeError(f"{argument}: expected numbers, found a text; a file is read by thetahat.read_log({value[:LONGEST]!r})")
        y, u = _numbers.of_xarray(y), _numbers.of_xarray(u)
        channels = _inputs(u, input_names)
        names = [name for name, _ in channels]
        outputs = _outputs(y, output_name)
        of_pandas = [
            *(y.items() if isinstance(y, Mapping) else [("y", y)]),
            *(u.items() if isinstance(u, Mapping) else [("u", u)]),
        ]
        index = _clock.common_index(of_pandas if time is None else [*of_pandas, ("time", time)])
        if index is not None and index.nlevels > 1:
            raise ValueError("y: its index has several levels; Log.from_dataframe makes an experiment of each run that they tell apart")
        clock = None
        if time is not None:
            times = _clock.read("time", time)
            if not times.are_times:
                # Seconds are what they are.
                times = times._replace(name="time" if times.name is None else times.name)
            clock = Clock("by time" if times.are_times else "", times, _labels(index), column=True)
        roles = (names, [name for name, _ in outputs])
        self._log, self._clock = _made(
            [*channels, *outputs], roles, clock, index, sample_time, resample, "time", uniform=uniform
        )

    @classmethod
    def from_dataframe(
        cls,
        frame: Any,
        *,
        inputs: Sequence[str | int] | str | int = (),
        output: str | int | Sequence[str | int],
        time: str | npt.ArrayLike | None = None,
        sample_time: Duration | None = None,
        resample: Resample | None = None,
        uniform: bool = True,
    ) -> Log:
        """A log of some columns of a data frame.

        Parameters
        ----------
        frame : data frame
            Of pandas, Polars, PyArrow, or any library with their interchange protocols; a lazy frame is collected, a Dataset of xarray made
            one of pandas. Missing values become NaN. Where an index of pandas has several levels, such as run and time, one is the clock,
            and each run of the others is an experiment.
        inputs : sequence of str, or str
            The columns that are inputs; none for a time series. Labels that are numbers, or in a list tuples, name a column too; the
            channel is then called by their text.
        output : str or sequence of str
            The column that is the output, or those that are.
        time : str or array_like, optional
            The column that holds the times, or the index of this name, or the times themselves, see `Log`. Without it an index
            of pandas is the clock if it holds times; one that counts rows is not. Else it is the one other column that holds times.
        sample_time, resample, uniform
            As for `Log`.

        Warns
        -----
        UserWarning
            If 1 s is assumed where a column or an index may be a clock.

        Raises
        ------
        ValueError
            If a column is not there, and as for `Log`.
        TypeError
            If a column does not hold numbers.

        Examples
        --------
        >>> import pandas as pd
        >>> import thetahat as th
        >>> frame = pd.DataFrame({"heater": [0.0, 1.0, 1.0], "temperature": [20.0, 20.0, 20.5]})
        >>> th.Log.from_dataframe(frame, inputs=["heater"], output="temperature", sample_time=2.0)
        Log(3 rows, inputs heater, output temperature, sample time 2.0 s)
        >>> frame.index = pd.date_range("2026-03-29 01:59", periods=3, freq="min", tz="Europe/Berlin", name="when")
        >>> th.Log.from_dataframe(frame, inputs="heater", output="temperature")
        Log(3 rows, inputs heater, output temperature, sample time 60.0 s by the index 'when' from 2026-03-29T01:59:00+01:00)
        """
        frame = _frames.plain(frame)
        names, outputs = _called("inputs", inputs), _called("output", output)
        runs = _frames.runs(frame, time if isinstance(time, str) else None)
        if runs:
            if time is not None and not isinstance(time, str):
                raise ValueError("time: the index has several levels; give the name of the level or column that is the clock")
            options: dict[str, Any] = {"sample_time": sample_time, "resample": resample, "uniform": uniform}
            run_logs = [cls.from_dataframe(run, inputs=names, output=outputs, time=time, **options) for run, _ in runs]
            joined = cls.join(run_logs)
            if resample is not None:
                return joined
            index = _clock.common_index([("frame", frame)])
            rows = _clock.labels_of(index[np.concatenate([rows for _, rows in runs])])
            return cls._of(joined._log, joined._clock._replace(rows=rows))
        columns = _frames.columns(frame, [*names, *outputs])
        channels = [(name, columns[name]) for name in [*names, *outputs]]
        index, clock, argument = _clock.common_index([("frame", frame)]), None, "time"
        if isinstance(time, str):
            clock, argument = _frames.clock(frame, time), f"time={time!r}"
        elif time is not None:
            clock = Clock("by time", _clock.read("time", time), _labels(index))
        elif sample_time is None and not _is_clock(index):
            found = _frames.clocks(frame, [*names, *outputs])
            if len(found) > 1:
                raise ValueError(
                    f"several columns may be the clock: {', '.join(map(repr, found))}; name one with time, or give sample_time"
                )
            if found:
                clock, argument = _frames.clock(frame, found[0]), f"time={found[0]!r}"
        roles = (names, outputs)
        log, clock = _made(channels, roles, clock, index, sample_time, resample, argument, uniform=uniform)
        return cls._of(log, clock)

    @classmethod
    def join(cls, logs: Sequence[Log]) -> Log:
        """Several experiments with one plant as one log: lags do not cross from one into the next, see `experiments`.

        Parameters
        ----------
        logs : sequence of Log
            With the same channels and sample time.

        Examples
        --------
        >>> import thetahat as th
        >>> monday, tuesday = th.Log([1.0, 2.0]), th.Log([3.0, 4.0, 5.0])
        >>> th.Log.join([monday, tuesday])
        Log(5 rows in 2 experiments, no inputs, output y, sample time 1.0 s assumed)
        """
        joined = _thetahat.Log.join([handle("logs", log) for log in logs])
        return cls._of(joined, _clock.joined([log._clock for log in logs]))

    @classmethod
    def _of(cls, log: _thetahat.Log, clock: Clock) -> Log:
        made = object.__new__(cls)
        made._log, made._clock = log, clock
        return made

    @property
    def inputs(self) -> list[str]:
        """The names of the inputs."""
        return self._log.inputs

    @property
    def outputs(self) -> list[str]:
        """The names of the outputs."""
        return self._log.outputs

    @property
    def output(self) -> str:
        """The name of the output, of a log that has one."""
        if len(self.outputs) > 1:
            raise ValueError(f"the log has several outputs: {', '.join(self.outputs)}; take one with select(output=...)")
        return self.outputs[0]

    def select(self, *, inputs: Sequence[str] | str | None = None, output: str | Sequence[str] | None = None) -> Log:
        """The same log with other roles of its channels, and without those that have none.

        Parameters
        ----------
        inputs : sequence of str, or str, optional
            The channels that are inputs; those of the log, unless said otherwise.
        output : str or sequence of str, optional
            The channel that is the output, or those that are; those of the log, unless said otherwise.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.Log({"angle": [0.0, 0.1], "rate": [1.0, 0.9]}, sample_time=0.1)
        >>> log.outputs
        ['angle', 'rate']
        >>> log.select(output="rate").y
        array([1. , 0.9])
        """
        outputs = self.outputs if output is None else names_of("output", output)
        chosen = self.inputs if inputs is None else names_of("inputs", inputs)
        if inputs is None:
            chosen = [name for name in chosen if name not in outputs]
        return self._of(self._log.select(chosen, outputs), self._clock)

    @property
    def sample_time(self) -> float:
        """Seconds from one row to the next."""
        return self._log.sample_time

    @property
    def y(self) -> npt.NDArray[np.float64]:
        """The output, shape (N,), or (N, outputs) where there are several; a copy."""
        columns = [self._log.values(name) for name in self.outputs]
        return columns[0] if len(columns) == 1 else np.column_stack(columns)

    @property
    def u(self) -> npt.NDArray[np.float64]:
        """The inputs, shape (N, inputs); a copy."""
        if not self.inputs:
            return np.empty((len(self), 0))
        return np.column_stack([self._log.values(name) for name in self.inputs])

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """Seconds, one for each row: those of the clock, or counted from 0 by the sample time."""
        clock = self._log.time()
        if clock is None:
            clock = np.arange(len(self), dtype=np.float64) * self.sample_time
        return clock

    def resample(self, step: Duration, how: Literal["auto", "linear", "hold"] = "auto", *, unfiltered: bool = False) -> Log:
        """The same signals on another clock.

        Parameters
        ----------
        step : float, timedelta or str
            Time from one new row to the next: seconds, a timedelta, or a text such as ``"10 s"``.
        how : {"auto", "linear", "hold"}, default "auto"
            How to read between the old rows: "auto" holds channels that move in steps.
        unfiltered : bool, default False
            Whether to leave out the filter against aliasing, which there is where the step is two old ones or more.

        Returns
        -------
        Log
            Each experiment for itself.

        Examples
        --------
        >>> import thetahat as th
        >>> th.dc_motor().resample("50 ms")
        Log(200 rows, inputs u, output y, sample time 0.05 s resampled)
        """
        resample = (step, how, "unfiltered") if unfiltered else (step, how)
        return Log.join([self[rows]._resampled(resample) for rows in self.experiments])

    def _resampled(self, resample: Resample) -> Log:
        clock = self._clock
        if clock.times is None or len(clock.times.values) != len(self):
            clock = Clock("by time", _clock.Labels(self.time, "time"))
        channels = [(name, self._log.values(name)) for name in [*self.inputs, *self.outputs]]
        return self._of(*_made(channels, (self.inputs, self.outputs), clock, None, None, resample, "time", uniform=False))

    def plot(self, **options: Any) -> Any:
        """Draw the signals over time: `thetahat.plot.log`.

        Returns
        -------
        ndarray of Axes
        """
        # The package loads its module of drawings when it is asked for one.
        return sys.modules["thetahat"].plot.log(self, **options)

    def to_pandas(self, **columns: npt.ArrayLike) -> Any:
        """A data frame of pandas with the index that the log came with, beside its channels what belongs to its rows.

        Parameters
        ----------
        **columns : array_like, shape (N,)
            Further columns by name, such as predictions.

        Returns
        -------
        pandas.DataFrame
            The index is that of the frame that the log was made of, a part of it for a part of the log; of other logs the
            times, as they were given, or in seconds. A column that held the times is there again.

        Raises
        ------
        ValueError
            If a column has not one value for each row, or is called as a channel.
        ImportError
            If pandas is not installed.

        Examples
        --------
        >>> import pandas as pd
        >>> import thetahat as th
        >>> index = pd.date_range("2026-03-01", periods=4, freq="10s")
        >>> frame = pd.DataFrame({"fan": [0.0, 1.0, 1.0, 0.0], "room": [20.0, 20.0, 19.5, 19.25]}, index)
        >>> log = th.Log.from_dataframe(frame, inputs="fan", output="room")
        >>> model = th.arx(log, na=1, nb=1, detrend="none")
        >>> log[2:].to_pandas(predicted=model.predict(log)[2:])[["room", "predicted"]].round(3)
                              room  predicted
        2026-03-01 00:00:20  19.50     19.625
        2026-03-01 00:00:30  19.25     19.125
        """
        return _clock.to_pandas(self._clock, self.time, self._columns(columns))

    def to_polars(self, **columns: npt.ArrayLike) -> Any:
        """As `to_pandas`, for Polars: the times are the first column, in seconds where the log has no others.

        Examples
        --------
        >>> import thetahat as th
        >>> th.Log([1.0, 2.0], sample_time=0.5).to_polars(twice=[2.0, 4.0]).rows()
        [(0.0, 1.0, 2.0), (0.5, 2.0, 4.0)]
        """
        return _clock.to_polars(self._clock, self.time, self._columns(columns))

    def _columns(self, columns: Mapping[str, npt.ArrayLike]) -> dict[str, npt.NDArray[np.float64]]:
        found = {name: self._log.values(name) for name in [*self.inputs, *self.outputs]}
        for name, column in columns.items():
            if name in found:
                raise ValueError(f"{name}: the log has a channel of this name; give the column another")
            values = _numbers.column(name, column)
            if len(values) != len(self):
                raise ValueError(f"{name}: expected {len(self)} values, one for each row of the log, found {len(values)}")
            found[name] = values
        return found

    @property
    def experiments(self) -> list[range]:
        """The rows of each experiment, of one that was not joined all of them. ``log[log.experiments[0]]`` is the first.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.Log.join([th.Log([1.0, 2.0]), th.Log([3.0, 4.0, 5.0])])
        >>> log.experiments
        [range(0, 2), range(2, 5)]
        """
        edges = [0, *self._log.boundaries, len(self)]
        return [range(*ends) for ends in zip(edges, edges[1:])]

    @property
    def segments(self) -> list[range]:
        """The segments of rows that estimators see: in none a value is missing, the clock has a gap, or an experiment ends.

        Examples
        --------
        >>> import thetahat as th
        >>> th.Log([1.0, 2.0, float("nan"), 4.0]).segments
        [range(0, 2), range(3, 4)]
        """
        present = np.ones(len(self), dtype=bool)
        for name in [*self.inputs, *self.outputs]:
            present &= ~np.isnan(self._log.values(name))
        starts = np.array(self._log.segment_starts, dtype=np.intp)
        first, last = present.copy(), present.copy()
        first[1:] &= ~present[:-1]
        last[:-1] &= ~present[1:]
        first[starts], last[starts - 1] = present[starts], present[starts - 1]
        return [range(*ends) for ends in zip(np.flatnonzero(first).tolist(), (np.flatnonzero(last) + 1).tolist())]

    @property
    def missing(self) -> dict[str, int]:
        """How many values each channel misses.

        Examples
        --------
        >>> import thetahat as th
        >>> th.Log([1.0, 2.0, float("nan"), 4.0]).missing
        {'y': 1}
        """
        names = [*self.inputs, *self.outputs]
        return {name: int(np.count_nonzero(np.isnan(self._log.values(name)))) for name in names}

    def __len__(self) -> int:
        return self._log.rows

    def __contains__(self, name: object) -> bool:
        return name in self.outputs or name in self.inputs

    __iter__ = None

    @overload
    def __getitem__(self, rows: slice | range) -> Log: ...

    @overload
    def __getitem__(self, rows: str) -> npt.NDArray[np.float64]: ...

    def __getitem__(self, rows: slice | range | str) -> Log | npt.NDArray[np.float64]:
        if isinstance(rows, str):
            if rows not in self:
                raise KeyError(f"there is no channel '{rows}'; there are: {', '.join([*self.inputs, *self.outputs])}")
            return self._log.values(rows)
        if isinstance(rows, range):
            if not 0 <= rows.start <= rows.stop <= len(self):
                raise ValueError(f"rows: {rows} is not inside of the log, which has {len(self)}")
            rows = slice(rows.start, rows.stop, rows.step)
        if not isinstance(rows, slice):
            raise TypeError(f"a log is cut by a slice such as log[:500], found {_numbers.shown(rows)}")
        dated = [end for end in (rows.start, rows.stop) if end is not None and not hasattr(end, "__index__")]
        if dated:
            if rows.step is not None or self._clock.times is None:
                raise TypeError(f"rows: {dated[0]!r} is no row; cut by rows such as log[:500], or a log with dates by these")
            rows = self._clock.times.between(rows.start, rows.stop)
        start, stop, step = rows.indices(len(self))
        if step != 1:
            raise ValueError(f"rows: a step of {step} leaves some out; give one of 1")
        if stop <= start:
            raise ValueError(f"rows: {' to '.join(map(str, dated)) or f'{start}:{stop}'} is empty; the log has {len(self)}")
        return self._of(self._log.part(start + 1, stop), self._clock.part(start, stop))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Log):
            return NotImplemented
        mine, yours = self._log, other._log
        same = (mine.inputs, mine.outputs, mine.sample_time, mine.segment_starts, mine.boundaries) == (
            yours.inputs,
            yours.outputs,
            yours.sample_time,
            yours.segment_starts,
            yours.boundaries,
        )
        arrays = ((self.y, other.y), (self.u, other.u), (self.time, other.time))
        return same and all(np.array_equal(one, another, equal_nan=True) for one, another in arrays)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return (Log._of, (self._log, self._clock))

    def __copy__(self) -> Log:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Log:
        # Nothing can change a log.
        return self

    def __repr__(self) -> str:
        inputs = f"inputs {', '.join(self.inputs)}" if self.inputs else "no inputs"
        experiments, segments, missing = len(self.experiments), len(self.segments), sum(self.missing.values())
        rows = f"{len(self)} rows"
        if experiments > 1:
            rows += f" in {experiments} experiments"
        if segments != experiments:
            rows += f"{' and' if experiments > 1 else ' in'} {segments} segment{'' if segments == 1 else 's'}"
        if missing:
            rows += f", {missing} value{'' if missing == 1 else 's'} missing"
        outputs = f"output{'' if len(self.outputs) == 1 else 's'} {', '.join(self.outputs)}"
        return f"Log({rows}, {inputs}, {outputs}, sample time {self.sample_time} s{self._clock.text()})"

    def _repr_html_(self) -> str:
        names = [*self.outputs, *self.inputs]
        return _picture.rows(repr(self), [(name, [self._log.values(name)]) for name in names])


def handle(argument: str, log: Log) -> _thetahat.Log:
    """The compiled log behind an argument."""
    if not isinstance(log, Log):
        # A frame does not say which column is the output.
        makes = "Log.from_dataframe(frame, inputs=[...], output=...)" if hasattr(log, "columns") else "Log(y, u)"
        raise TypeError(f"{argument}: expected a Log, found {type(log).__name__}; make one with thetahat.{makes}")
    return log._log


def _inputs(u: _numbers.Columns | None, names: Sequence[str] | None) -> list[tuple[str, Any]]:
    """The inputs by name."""
    if u is None:
        if names:
            raise ValueError("input_names: there are no inputs; give u too")
        return []
    columns = _numbers.named("u", u)
    if columns is None or (names is not None and not isinstance(u, Mapping)):
        array = _numbers.array("u", u)
        if array.ndim not in (1, 2):
            raise ValueError(f"u: expected shape (rows,) or (rows, inputs), found shape {array.shape}")
        arrays = [array] if array.ndim == 1 else [array[:, index] for index in range(array.shape[1])]
        if not arrays:
            raise ValueError(f"u: expected at least one column, found shape {array.shape}")
        if names is None:
            names = ["u"] if len(arrays) == 1 else [f"u{index + 1}" for index in range(len(arrays))]
        names = [names] if isinstance(names, str) else list(names)
        if len(names) != len(arrays):
            raise ValueError(f"input_names: expected {len(arrays)}, found {len(names)}")
        return [(_options.text("input_names", name), column) for name, column in zip(names, arrays)]
    if names is not None:
        raise ValueError("input_names: the inputs have names already; leave it out")
    return [(_options.text("u", name), _numbers.column(f"u: column {name!r}", values)) for name, values in columns]


def _outputs(y: npt.ArrayLike | _numbers.Columns, names: str | Sequence[str] | None) -> list[tuple[str, Any]]:
    """The outputs by name: those given, or those of series or of the columns of a frame."""
    columns = _numbers.named("y", y)
    if columns is not None and len(columns) > 1:
        if names is not None:
            raise ValueError("output_name: the outputs have names already; leave it out")
        return [(_options.text("y", name), _numbers.column(f"y: column {name!r}", values)) for name, values in columns]
    given = names if names is None or isinstance(names, str) else list(names)
    array = None if columns is not None else _numbers.array("y", y)
    if array is not None and array.ndim == 2 and array.shape[1] > 1:
        rows, count = array.shape
        if count > rows:
            raise ValueError(f"y: expected one dimension, or a column for each output, found shape {array.shape}")
        if given is None:
            given = [f"y{index + 1}" for index in range(count)]
        if isinstance(given, str) or len(given) != count:
            raise ValueError(f"output_name: expected {count}, found {1 if isinstance(given, str) else len(given)}")
        return [(_options.text("output_name", name), array[:, index]) for index, name in enumerate(given)]
    if isinstance(given, list):
        if len(given) != 1:
            raise ValueError(f"output_name: expected 1, found {len(given)}")
        given = given[0]
    own = columns[0][0] if columns else "y"
    values = columns[0][1] if columns and isinstance(y, Mapping) else y
    return [(own if given is None else _options.text("output_name", given), _numbers.column("y", values))]


def _labels(index: Any) -> _clock.Labels | None:
    return None if index is None else _clock.labels_of(index)


def _is_clock(index: Any) -> bool:
    """Whether an index is one; what is to be said of it is said by who takes it."""
    with _said.kept():
        return index is not None and _clock.of_index(index) is not None


def _called(argument: str, labels: Any) -> list[str]:
    """The names of columns by their labels, which may be numbers, or in a list tuples."""
    if isinstance(labels, (bool, float)) or labels is None:
        raise TypeError(f"{argument}: expected a name or several, found {_numbers.shown(labels)}")
    several = [labels] if isinstance(labels, (str, int, np.integer)) else labels
    return names_of(argument, [label if isinstance(label, str) else _frames.name_of(label) for label in several])


def names_of(argument: str, names: Sequence[str] | str) -> list[str]:
    """One name, or several."""
    found = [_options.text(argument, name) for name in ([names] if isinstance(names, str) else names)]
    if argument == "output" and not found:
        raise ValueError("output: there is none; name at least one")
    return found


def _made(
    channels: Sequence[tuple[str, Any]],
    roles: tuple[Sequence[str], Sequence[str]],
    clock: Clock | None,
    index: Any,
    sample_time: Duration | None,
    resample: Resample | None,
    argument: str,
    *,
    uniform: bool,
) -> tuple[_thetahat.Log, Clock]:
    """The compiled log of channels that are inputs and outputs, and its clock: the one given, or an index of pandas; without one the
    sample time counts."""
    if clock is None and index is not None:
        clock = _clock.of_index(index)
        argument = "index"
        if clock is not None and sample_time is not None:
            raise ValueError("sample_time: the index is a clock; leave sample_time out, or drop the index (reset_index in pandas)")
    if clock is not None and sample_time is not None:
        raise ValueError("sample_time: the log has a clock; give one of time and sample_time")
    if resample is not None and clock is None:
        raise ValueError("resample: it is for logs with a clock; give time too")
    resampling = None if resample is None else _options.resampling("resample", resample)
    if clock is None or clock.times is None:
        step = 1.0 if sample_time is None else _options.seconds("sample_time", sample_time)
        found = _clock.assumed(index) if sample_time is None else Clock("", None, _labels(index))
        return _thetahat.Log(channels, *roles, step), found
    times = clock.times
    seconds = times.seconds(argument)
    name = "time" if times.name is None else str(times.name)
    log = _thetahat.Log(channels, *roles, 1.0, (seconds, resampling, times.start(), name), uniform)
    new = None if resample is None else log.time()
    return log, clock if new is None else clock.resampled(new)

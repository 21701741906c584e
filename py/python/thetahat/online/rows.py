"""Rows for what goes along a log one by one: of a `Log`, of a data frame or channels by name, or of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Union

import narwhals.stable.v2 as nw
import numpy as np
import numpy.typing as npt

from thetahat.base import clock as _clock, frames as _frames, numbers as _numbers
from thetahat.base.clock import Clock
from thetahat.engine import options as _options
from thetahat.engine.values import Duration
from thetahat.logs.log import Log

Array = npt.NDArray[np.float64]

Data = Union[Log, _numbers.Columns]
"""A log, channels by name, or an array with a column for each output."""

Times = Union[str, npt.ArrayLike]
"""The name of a column of times, or the times themselves."""


class Rows(NamedTuple):
    """Rows and their clock."""

    inputs: Array
    """Shape (N, inputs)."""
    outputs: Array
    """Shape (N, outputs)."""
    seconds: Array | None
    """The times, where there is a clock."""
    sample_time: float | None
    """Seconds from row to row, where that was said instead."""
    clock: Clock
    """The way back to data frames."""
    before: float = 0.0
    """Seconds from the first row of the log that these were cut from."""
    boundaries: Sequence[int] = ()
    """The rows at which another experiment begins."""
    name: str | None = None
    """What the times are called."""
    start: str | None = None
    """The first time as it was written, where times are dates."""

    def __len__(self) -> int:
        return len(self.outputs)

    @property
    def instants(self) -> npt.NDArray[Any] | None:
        """The times, where they are dates."""
        times = self.clock.times
        return times.values if times is not None and times.values.dtype.kind == "M" else None

    def time(self, sample_time: float) -> Array:
        """Seconds, one for each row; counted from 0 without a clock."""
        if self.seconds is not None:
            return self.seconds
        step = sample_time if self.sample_time is None else self.sample_time
        return self.before + step * np.arange(len(self), dtype=np.float64)


class Last(NamedTuple):
    """When the latest row was."""

    seconds: float
    instant: Any = None

    def until(self, rows: Rows) -> float:
        """Seconds to the first of further rows.

        Raises
        ------
        ValueError
            If these are not after it.
        """
        assert rows.seconds is not None
        if self.instant is not None and rows.instants is not None:
            step = float((rows.instants[0] - self.instant) / _clock.SECOND)
        else:
            step = float(rows.seconds[0] - self.seconds)
        if not step > 0:
            raise ValueError(f"time: the first row is {-step:g} s before the latest one that was taken; give later rows")
        return step


def last(rows: Rows) -> Last | None:
    """When the last of them was, where there is a clock."""
    if rows.seconds is None:
        return None
    return Last(float(rows.seconds[-1]), None if rows.instants is None else rows.instants[-1])


def of(
    data: Data,
    u: _numbers.Columns | None,
    time: Times | None,
    sample_time: Duration | None,
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> Rows:
    """The rows of these channels.

    Raises
    ------
    TypeError
        If something does not hold numbers, or is said twice.
    ValueError
        If a channel is not there, a shape is wrong, there are no rows, or times do not rise.
    """
    if isinstance(data, Log):
        for name, value in (("u", u), ("time", time), ("sample_time", sample_time)):
            if value is not None:
                raise TypeError(f"{name}: a Log has its own; leave it out")
        return _of_log(data, inputs, outputs)
    if sample_time is not None and time is not None:
        raise ValueError("sample_time: the rows have times; give one of time and sample_time")
    step = None if sample_time is None else _options.seconds("sample_time", sample_time)
    if step is not None and step <= 0:
        raise ValueError(f"sample_time: {step} is not above 0")
    columns = _named("data", data)
    measured = _channels("data", data, columns, outputs)
    if u is not None and not inputs:
        raise ValueError("u: the model has no inputs; leave it out")
    if u is None and inputs and columns is None:
        raise ValueError(f"u: the model has inputs ({', '.join(inputs)}); give their values, one column for each")
    driving = _channels("data", data, columns, inputs) if u is None else _channels("u", u, _named("u", u), inputs)
    if inputs and len(driving) != len(measured):
        raise ValueError(f"u: expected {len(measured)} rows as in data, found {len(driving)}")
    if len(measured) == 0:
        raise ValueError("data: there are no rows; give at least one")
    clock = _clock_of(data, u, time)
    if clock.times is None:
        return Rows(driving, measured, None, step, clock)
    if step is not None:
        raise ValueError("sample_time: the index is a clock; leave sample_time out, or drop the index (reset_index in pandas)")
    seconds = clock.times.seconds("time")
    if len(seconds) != len(measured):
        raise ValueError(f"time: expected {len(measured)} times, one for each row, found {len(seconds)}")
    if not (np.isfinite(seconds).all() and (np.diff(seconds) > 0).all()):
        raise ValueError("time: the times do not rise from row to row; sort the rows by time, one for each")
    name = "time" if clock.times.name is None else str(clock.times.name)
    return Rows(driving, measured, seconds, None, clock, name=name, start=clock.times.start())


def _of_log(log: Log, inputs: Sequence[str], outputs: Sequence[str]) -> Rows:
    there = [*log.inputs, *log.outputs]
    for name in [*inputs, *outputs]:
        if name not in there:
            raise ValueError(f"data: there is no channel '{name}'; there are: {', '.join(there)}")
    seconds = log._log.time()
    assumed = log._clock.said.startswith("assumed")
    called, start = log._log.clock
    return Rows(
        _stacked([log[name] for name in inputs], len(log)),
        _stacked([log[name] for name in outputs], len(log)),
        seconds,
        None if seconds is not None or assumed else log.sample_time,
        log._clock,
        log._log.before,
        log._log.boundaries,
        None if seconds is None else called or "time",
        start,
    )


def _named(argument: str, value: Any) -> dict[Any, Any] | None:
    """The columns of a mapping or of a frame with names."""
    if isinstance(value, Mapping) or isinstance(_numbers.of_library(argument, value), nw.DataFrame):
        columns = _numbers.named(argument, value)
        return None if columns is None else dict(columns)
    return None


def _channels(argument: str, value: Any, columns: Mapping[Any, Any] | None, names: Sequence[str]) -> Array:
    """A column for each name: those of this name, or those of an array."""
    if columns is None:
        if not names:
            return np.empty((0, 0))
        found = _numbers.array(argument, value)
        if found.ndim == 1 and len(names) == 1:
            found = found[:, np.newaxis]
        if found.ndim != 2 or found.shape[1] != len(names):
            expected = "(rows,) or (rows, 1)" if len(names) == 1 else f"(rows, {len(names)})"
            raise ValueError(f"{argument}: expected shape {expected}, found shape {found.shape}")
        return np.ascontiguousarray(found)
    for name in names:
        if name not in columns:
            there = ", ".join(map(str, columns)) or "none"
            raise ValueError(f"{argument}: there is no column '{name}'; there are: {there}")
    found_columns = [_numbers.column(f"{argument}: column {name!r}", columns[name]) for name in names]
    lengths = {len(column) for column in found_columns}
    if len(lengths) > 1:
        raise ValueError(f"{argument}: columns have different lengths: {', '.join(map(str, sorted(lengths)))}")
    return _stacked(found_columns, max(lengths, default=0))


def _stacked(columns: Sequence[Array], rows: int) -> Array:
    return np.ascontiguousarray(np.column_stack(columns)) if columns else np.empty((rows, 0))


def _clock_of(data: Any, u: Any, time: Times | None) -> Clock:
    """The clock: the one given, or an index of pandas that holds times."""
    of_pandas = [("data", data), ("u", u)]
    of_pandas += [("data", column) for column in data.values()] if isinstance(data, Mapping) else []
    index = _clock.common_index(of_pandas)
    labels = None if index is None else _clock.labels_of(index)
    if isinstance(time, str):
        if isinstance(data, Mapping):
            if time not in data:
                raise ValueError(f"time: there is no column '{time}'; there are: {', '.join(map(str, data))}")
            return Clock(f"by column {time!r}", _clock.read(f"column {time!r}", data[time], time), labels, column=True)
        return _frames.clock(data, time)
    if time is not None:
        times = _clock.read("time", time)
        return Clock("by time" if times.are_times else "", times, labels)
    clock = None if index is None else _clock.of_index(index)
    return Clock("", None, labels) if clock is None else clock

"""Columns of dataframes as NumPy arrays.

Their numbers become float64 as all numbers do, see `thetahat.base.numbers`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import narwhals.stable.v2 as nw
import numpy as np
from narwhals.dependencies import is_pandas_like_dataframe
from numpy.typing import NDArray

from thetahat.base import clock as _clock, numbers as _numbers

if TYPE_CHECKING:
    from collections.abc import Sequence


Frame = Any
"""A data frame of pandas, Polars, PyArrow or another library that Narwhals reads."""


def name_of(label: Any) -> str:
    """What a column of this label is called: labels may be numbers, or tuples of a MultiIndex."""
    return label if isinstance(label, str) else ".".join(map(str, label)) if isinstance(label, tuple) else str(label)


def plain(frame: Any) -> Any:
    """A frame whose columns are called by texts: a lazy frame collected, a Dataset of xarray as a frame of pandas."""
    frame = _numbers.of_xarray(frame)
    if not isinstance(frame, nw.DataFrame) and hasattr(frame, "collect") and hasattr(frame, "collect_schema") and hasattr(frame, "lazy"):
        frame = frame.collect()
    if is_pandas_like_dataframe(frame) and not all(isinstance(label, str) for label in frame.columns):
        frame = frame.set_axis([name_of(label) for label in frame.columns], axis=1)
    return frame


def columns(frame: Any, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Columns of numbers, as float64.

    Parameters
    ----------
    frame : dataframe
        Of pandas, polars, pyarrow or another library that Narwhals reads.
    names : sequence of str
        The columns, each once.

    Returns
    -------
    dict of str to numpy.ndarray
        In the order of `names`. A null is NaN; False and True are 0 and 1. An array may be a view of the frame that cannot be
        written to.

    Raises
    ------
    TypeError
        If this is no dataframe, or a column does not hold numbers.
    ValueError
        If a column is missing, or is there or asked for twice, or the frame has no rows.
    """
    table = _table(frame)
    if len(set(names)) < len(names):
        message = f"columns: {_numbers.twice(names)!r} is asked for twice; name each column once"
        raise ValueError(message)
    return {name: _numbers.series(f"column {name!r}", _column(table, name)) for name in names}


def names(frame: Any) -> list[str]:
    """What the columns are called."""
    return list(_table(frame).columns)


def with_missing(frame: Any, names: Sequence[str]) -> Any:
    """The frame with columns of which all is missing."""
    return _table(frame).with_columns(*(nw.lit(float("nan")).alias(name) for name in names)).to_native()


def clock(frame: Any, name: str) -> _clock.Clock:
    """The times in a column, or in the index of pandas that has this name.

    Raises
    ------
    TypeError
        If this is no dataframe, or the column does not hold times.
    ValueError
        If there is no such column, or the frame has no rows.
    """
    table = _table(frame)
    index = _clock.common_index([("frame", frame)])
    there = table.columns
    if name not in there and index is not None and name == index.name:
        said = f"the index {name!r}"
        return _clock.Clock(f"by {said}", _clock.read(said, index), _clock.labels_of(index))
    if name not in there and index is not None and index.name is not None:
        message = f"frame: there is no column {name!r}, and the index is called {index.name!r}"
        raise ValueError(message)
    said = f"column {name!r}"
    times = _clock.read(said, _column(table, name).to_native(), name)
    return _clock.Clock(f"by {said}", times, None if index is None else _clock.labels_of(index), column=True)


def runs(frame: Any, time: str | None) -> list[tuple[Any, NDArray[np.intp]]]:
    """The runs that the levels of an index of pandas tell apart, each as a frame with the level of its clock as index, and its
    rows; none of a frame whose index has one level.

    Parameters
    ----------
    frame : dataframe
        Of any library.
    time : str, optional
        The level that is the clock. Without it that is the last one that holds times, or the last one.

    Raises
    ------
    ValueError
        If a row belongs to no run.
    """
    index = _clock.common_index([("frame", frame)])
    if index is None or index.nlevels == 1:
        return []
    levels = range(index.nlevels)
    if time in index.names:
        clock = index.names.index(time)
    else:
        of_times = [level for level in levels if _clock.of_index(index.get_level_values(level)) is not None]
        clock = of_times[-1] if of_times else levels[-1]
    numbers = index.droplevel(clock).factorize()[0]
    for level in levels:
        missing = np.flatnonzero(index.get_level_values(level).isna())
        if level != clock and len(missing):
            called = f"the level {index.names[level]!r}" if index.names[level] is not None else f"level {level}"
            message = f"frame: {called} of its index is missing in row {missing[0] + 1}; it tells which run a row belongs to"
            raise ValueError(message)
    order = np.argsort(numbers, kind="stable")
    plain = frame.set_axis(index.get_level_values(clock))
    parts = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    return [(plain.iloc[rows], rows) for rows in parts]


def clocks(frame: Any, but: Sequence[str]) -> list[str]:
    """The columns that hold times, texts of instants or numbers since 1970, but for some."""
    table = _table(frame)

    def is_clock(name: str) -> bool:
        dtype = table.schema[name]
        text = dtype == nw.String or dtype == nw.Object
        if dtype.is_integer():
            return _clock.Labels(np.asarray(table.get_column(name).to_numpy()), name).dated(f"column {name!r}").are_times
        return dtype.is_temporal() or (text and _clock.are_times(table.get_column(name).head(10).to_list()))

    return [name for name in table.columns if name not in but and is_clock(name)]


def _table(frame: Any) -> nw.DataFrame[Any]:
    table = _numbers.of_library("frame", frame)
    if not isinstance(table, nw.DataFrame):
        kind = type(frame)
        message = (
            f"frame: expected a dataframe of pandas, polars or pyarrow, found {kind.__module__}.{kind.__qualname__}; "
            "collect a lazy frame first, convert anything else"
        )
        raise TypeError(message)
    if len(table) == 0:
        message = "frame: there are no rows; give at least one"
        raise ValueError(message)
    return table


def _column(table: nw.DataFrame[Any], name: str) -> nw.Series[Any]:
    if name not in table.columns:
        there = ", ".join(repr(column) for column in table.columns) or "none"
        message = f"frame: there is no column {name!r}; there are {there}"
        raise ValueError(message)
    return table.get_column(name)

"""Columns of dataframes as NumPy arrays.

Narwhals reads pandas, polars, pyarrow and Modin tables alike. It has no dependencies and needs none of them installed. No
protocol does this: pandas 3.1 deprecates `__dataframe__` and needs pyarrow for `__arrow_c_stream__`, polars 2 has only the
latter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import narwhals.stable.v2 as nw
import numpy as np
from narwhals.exceptions import DuplicateError
from numpy.typing import NDArray

from thetahat._log import instants

if TYPE_CHECKING:
    from collections.abc import Sequence


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
        message = f"columns: {_twice(names)!r} is asked for twice; name each column once"
        raise ValueError(message)
    return {name: _numbers(_column(table, name), name) for name in names}


def times(frame: Any, name: str) -> tuple[NDArray[np.float64], str | None]:
    """A column of times, in seconds.

    Parameters
    ----------
    frame : dataframe
        As for `columns`.
    name : str
        The column: dates, instants with or without a time zone, durations, or numbers, which are taken to be seconds.

    Returns
    -------
    seconds : numpy.ndarray
        Of dates and instants those since the first row. A null is NaN.
    first : str or None
        The first instant in ISO 8601: of instants with a time zone in UTC and with a Z behind it, of others as they are written.
        None for durations and numbers.

    Raises
    ------
    TypeError
        If this is no dataframe, or the column does not hold times.
    ValueError
        If the column is missing or begins with a null, or the frame has no rows.
    """
    column = _column(_table(frame), name)
    second = np.timedelta64(1, "s")
    if column.dtype == nw.Duration:
        return _contiguous(column.to_numpy() / second), None
    if not (column.dtype == nw.Datetime or column.dtype == nw.Date):
        return _numbers(column, name), None
    if column.dtype == nw.Date:
        # Midnight. The dates of pandas with pyarrow would come as objects.
        column = column.cast(nw.Datetime("us"))
    # With a time zone these are in UTC.
    seconds, text = instants(f"column {name!r}", column.to_numpy())
    if getattr(column.dtype, "time_zone", None) is not None:
        text += "Z"
    return seconds, text


def _table(frame: Any) -> nw.DataFrame[Any]:
    try:
        table: nw.DataFrame[Any] = nw.from_native(frame, eager_only=True)
        # Whether names are there twice is seen only here for some.
        names = table.columns
    except DuplicateError as error:
        message = f"frame: two columns have the same name; rename one ({error})"
        raise ValueError(message) from error
    except TypeError as error:
        kind = type(frame)
        message = (
            f"frame: expected a dataframe of pandas, polars or pyarrow, found {kind.__module__}.{kind.__qualname__}; "
            "collect a lazy frame first, convert anything else"
        )
        raise TypeError(message) from error
    if len(set(names)) < len(names):
        message = f"frame: two columns have the name {_twice(names)!r}; rename one"
        raise ValueError(message)
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


def _numbers(column: nw.Series[Any], name: str) -> NDArray[np.float64]:
    if not (column.dtype.is_numeric() or column.dtype == nw.Boolean):
        native = column.to_native()
        dtype = getattr(native, "dtype", getattr(native, "type", column.dtype))
        message = f"column {name!r}: expected numbers, found {dtype}; convert it to a type of numbers first"
        raise TypeError(message)
    # pyarrow does not cast whole numbers that float64 would round, NumPy does.
    if not column.dtype.is_integer():
        column = column.cast(nw.Float64())
    return _contiguous(column.to_numpy())


def _contiguous(values: Any) -> NDArray[np.float64]:
    return np.ascontiguousarray(values, dtype=np.float64)


def _twice(names: Sequence[str]) -> str:
    return next(name for place, name in enumerate(names) if name in names[:place])

"""Columns of dataframes as NumPy arrays.

Their numbers become float64 as all numbers do, see `thetahat._numbers`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import narwhals.stable.v2 as nw
import numpy as np
from numpy.typing import NDArray

from thetahat import _numbers
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
        message = f"columns: {_numbers.twice(names)!r} is asked for twice; name each column once"
        raise ValueError(message)
    return {name: _numbers.series(f"column {name!r}", _column(table, name)) for name in names}


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
        return np.asarray(column.to_numpy() / second, dtype=np.float64, order="C"), None
    if not (column.dtype == nw.Datetime or column.dtype == nw.Date):
        return _numbers.series(f"column {name!r}", column), None
    if column.dtype == nw.Date:
        # Midnight. The dates of pandas with pyarrow would come as objects.
        column = column.cast(nw.Datetime("us"))
    # With a time zone these are in UTC.
    seconds, text = instants(f"column {name!r}", column.to_numpy())
    if getattr(column.dtype, "time_zone", None) is not None:
        text += "Z"
    return seconds, text


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

"""Columns of dataframes as NumPy arrays.

Their numbers become float64 as all numbers do, see `thetahat._numbers`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import narwhals.stable.v2 as nw
import numpy as np
from numpy.typing import NDArray

from thetahat import _clock, _numbers

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


def clocks(frame: Any, but: Sequence[str]) -> list[str]:
    """The columns that hold times or texts of instants, but for some."""
    table = _table(frame)

    def is_clock(name: str) -> bool:
        dtype = table.schema[name]
        text = dtype == nw.String or dtype == nw.Object
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

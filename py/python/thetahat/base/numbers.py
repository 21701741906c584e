"""Whatever holds numbers, as arrays of float64: the one conversion, which every function that takes numbers uses.

A contiguous array of float64 does not come here: it is read where it lies. Narwhals reads the series and frames of pandas,
Polars, PyArrow and Modin alike. It has no dependencies and needs none of them installed. No protocol does this: pandas 3.1
deprecates `__dataframe__` and needs PyArrow for `__arrow_c_stream__`, Polars 2 has only the latter. What has the latter and is none
of these is taken for a table by it.

A column of float64 in one piece and without nulls is read where its library keeps it; any other is copied once.
"""

from __future__ import annotations

import decimal
import numbers
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Union

import narwhals.stable.v2 as nw
import numpy as np
import numpy.ma as ma  # At its first `np.ma` NumPy loads it, which threads must not meet in.
from narwhals.exceptions import DuplicateError
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

Columns = Union[ArrayLike, Mapping[str, ArrayLike]]
"""Channels: an array with a column for each, a data frame, or columns by name."""

LONGEST = 80
"""How much of a value a message shows."""


def array(argument: str, value: Any) -> Array:
    """Numbers as a contiguous array of float64, of the shape that they have.

    Parameters
    ----------
    argument : str
        What messages call it.
    value : array_like, series or frame
        Lists and tuples, arrays, series and frames of pandas, Polars, PyArrow and others.

    Returns
    -------
    numpy.ndarray
        What is missing is NaN: None, NaN and NA, a null, what is masked. False and True are 0 and 1. A frame has a column for
        each of its own. It may be a view that cannot be written to.

    Raises
    ------
    TypeError
        If there is something that is no number, such as text or a date.
    ValueError
        If rows differ in length, two columns have one name, or a number is too large.
    """
    if isinstance(value, ma.MaskedArray):
        return _of_masked(argument, value)
    if not isinstance(value, (list, tuple, np.ndarray, np.generic)):
        native = of_library(argument, value)
        if isinstance(native, nw.DataFrame):
            columns = [series(f"{argument}: column {name!r}", native.get_column(name)) for name in native.columns]
            return np.column_stack(columns) if columns else np.empty((len(native), 0))
        if isinstance(native, nw.Series):
            return series(argument, native)
    try:
        found = np.asarray(value)
    except ValueError as error:
        # Rows of different lengths, and whatever else NumPy makes no array of.
        raise ValueError(f"{argument}: {error}") from None
    return _of_array(argument, found, value)


def column(argument: str, value: Any) -> Array:
    """The numbers of one channel: one dimension, or one column."""
    found = array(argument, value)
    if found.ndim == 2 and found.shape[1] == 1:
        return found[:, 0]
    if found.ndim != 1:
        raise ValueError(f"{argument}: expected one dimension, found shape {found.shape}")
    return found


def series(argument: str, values: nw.Series[Any]) -> Array:
    """Numbers of a series, as `array` makes them; `argument` may say which column it is."""
    native = values.to_native()
    encoded = getattr(getattr(native, "type", None), "value_type", None)
    if values.dtype == nw.Categorical and encoded is not None:
        # A dictionary of PyArrow, of numbers perhaps.
        native = native.cast(encoded)
        values = nw.from_native(native, series_only=True)
    dtype = getattr(native, "dtype", None)
    if values.dtype == nw.Object or values.dtype == nw.Unknown or dtype == object:
        # Objects, or a type of NumPy that the frame's library only stores.
        return _of_array(argument, np.asarray(native), native)
    if not (values.dtype.is_numeric() or values.dtype == nw.Boolean):
        raise _no_numbers(argument, dtype if dtype is not None else getattr(native, "type", values.dtype))
    # PyArrow does not cast whole numbers that float64 would round, NumPy does.
    if not values.dtype.is_integer():
        values = values.cast(nw.Float64())
    return np.asarray(values.to_numpy(), dtype=np.float64, order="C")


def of_document(values: Sequence[float | None]) -> Array:
    """The numbers of a document, in which what is not known is None, and NaN here."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def named(argument: str, value: Any) -> list[tuple[str, Any]] | None:
    """The columns of a mapping or of a frame with names, or a series with its own; None of what has no names.

    pandas numbers columns and names no series where it was not told a name: these are none.
    """
    if isinstance(value, Mapping):
        return list(value.items())
    native = of_library(argument, value)
    if isinstance(native, nw.DataFrame):
        names = native.columns
        if names and all(isinstance(name, str) for name in names):
            return [(name, native.get_column(name).to_native()) for name in names]
    elif isinstance(native, nw.Series) and isinstance(native.name, str) and native.name:
        return [(native.name, value)]
    return None


def of_library(argument: str, value: Any) -> Any:
    """A frame or series of a library that Narwhals reads, in its clothes; anything else as it is.

    The names of a frame's columns are each there once.
    """
    value = of_xarray(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return value
    try:
        native = nw.from_native(value, eager_only=True, allow_series=True, pass_through=True)
        if native is value:
            native = _of_capsule(value)
        # Whether names are there twice is seen only here for some.
        names = native.columns if isinstance(native, nw.DataFrame) else []
    except DuplicateError as error:
        message = f"{argument}: two columns have the same name; rename one ({error})"
        raise ValueError(message) from error
    if len(set(names)) < len(names):
        message = f"{argument}: two columns have the name {twice(names)!r}; rename one"
        raise ValueError(message)
    return native


def of_xarray(value: Any) -> Any:
    """What xarray labels, as pandas has it: a Dataset as a frame, an array of one dimension with a coordinate as a series. Arrays without
    a coordinate, or with several dimensions, are those of NumPy. Anything else as it is.
    """
    if type(value).__module__.partition(".")[0] != "xarray":
        return value
    if hasattr(value, "data_vars"):
        return value.to_dataframe()
    if getattr(value, "ndim", 0) == 1 and value.dims[0] in value.coords:
        return value.to_series()
    return np.asarray(value)


def _of_capsule(value: Any) -> Any:
    """A table of a library that gives it by the PyCapsule interface of Arrow, such as a record batch: without a copy, in the clothes
    of PyArrow or Polars, whichever is installed. Anything else as it is: a lazy frame too, whose work is asked for by who has it.
    """
    if not hasattr(value, "__arrow_c_stream__") or hasattr(value, "collect"):
        return value
    for library in ("pyarrow", "polars"):
        try:
            return nw.from_arrow(value, backend=library)
        except ImportError:
            continue
        except DuplicateError:
            raise
        except (TypeError, ValueError):
            # A stream of something else than tables.
            return value
    return value


def twice(names: Sequence[Any]) -> Any:
    """The first name that was there before."""
    return next(name for place, name in enumerate(names) if name in names[:place])


def is_number(entry: object) -> bool:
    """Whether it is a real number; NaN is one."""
    return isinstance(entry, (numbers.Real, decimal.Decimal, np.bool_))


def is_null(entry: object) -> bool:
    """Whether it stands for what is missing and is no number: None, and `pandas.NA` where pandas is in use."""
    return entry is None or entry is getattr(sys.modules.get("pandas"), "NA", None)


def _of_masked(argument: str, value: ma.MaskedArray[Any, Any]) -> Array:
    """What is masked is missing, whatever lies behind the mask."""
    if value.dtype.kind in "biuf":
        filled: NDArray[Any] = ma.filled(value.astype(np.float64), np.nan)
        return np.asarray(filled, order="C")
    missing = ma.getmaskarray(value)
    found = np.array(value.data)
    if found.dtype.kind == "O":
        found[missing] = None
    return _of_array(argument, found, value)


def _of_array(argument: str, found: NDArray[Any], value: Any) -> Array:
    if found.dtype.kind in "biuf":
        return np.require(found, np.float64, ["C", "ALIGNED"])
    if found.dtype.kind != "O":
        raise _no_numbers(argument, f"dtype {found.dtype}")
    if found.ndim == 0:
        raise _no_numbers(argument, _kind(value))
    floats = np.empty(found.shape)
    flat = floats.reshape(-1)
    for place, entry in enumerate(found.flat):
        if is_number(entry):
            try:
                flat[place] = entry
            except (OverflowError, ValueError) as error:
                raise ValueError(f"{argument}: entry {_place(place, found)}: {error}") from None
        elif is_null(entry):
            flat[place] = np.nan
        else:
            raise _no_numbers(argument, f"{entry!r} ({_kind(entry)}) in entry {_place(place, found)}")
    return floats


def _place(place: int, found: NDArray[Any]) -> str:
    where = np.unravel_index(place, found.shape)
    return str(where[0]) if len(where) == 1 else f"({', '.join(map(str, where))})"


def _no_numbers(argument: str, found: object) -> TypeError:
    return TypeError(f"{argument}: expected numbers, found {found}; convert to numbers first, with NaN for what is missing")


def _kind(value: object) -> str:
    kind = type(value)
    return kind.__qualname__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__qualname__}"


def shown(value: Any) -> str:
    """A value as messages show it: of an array what it is, of what is long the beginning."""
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return f"{type(value).__name__} of shape {shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"

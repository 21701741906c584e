"""Keyword arguments as options: as a plan, and how a file is read in the words of the command line."""

from __future__ import annotations

import contextlib
import datetime
import difflib
import functools
import inspect
import json
import math
import operator
import os
import re
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Any, Callable, Literal, Optional, TypedDict, TypeVar, Union, cast

import numpy as np

from thetahat.base import numbers as _numbers
from thetahat.engine import files as _files, signatures as _signatures
from thetahat.engine.values import Duration, Resample


class ReadOptions(TypedDict, total=False):
    """How a file is read.

    Attributes
    ----------
    time : str
        The column that holds the times: numbers, or dates; two, of dates and of times of day, as "date,time". Without it the one column
        that is a clock by its name and its values.
    sample_time : float or timedelta
        Time from one row to the next, where no column holds it.
    resample : (float or timedelta, {"linear", "hold", "auto"}) or (…, "unfiltered")
        Put the log on another clock: time between the new rows, and how to read between the old ones; "auto" holds channels that move
        in steps. A step of two recorded
        ones or more is filtered against aliasing first, unless "unfiltered" is added or the clock is irregular.
    time_format : str
        How times are written, in strftime's notation. Without it the first rows say.
    time_unit : {"ns", "us", "ms", "s", "min", "h", "d"}
        The unit of times that are numbers. Without it their name and their size say, or they are seconds.
    time_zone : str
        The time zone of dates that have none, such as "Europe/Berlin".
    delimiter, comment, encoding : str
        The character between fields; the one that begins a comment; the file's encoding.
    sheet : str
        The sheet of a spreadsheet. Without it the first that holds numbers.
    decimal_comma : bool
        Whether numbers are written with a decimal comma. Without it the first rows say.
    header : bool or int
        The line that holds the names of the columns, counted from 1, or False if there is none. Without it that is the last line of
        words above the rows.
    skip_rows : int
        Lines to leave out below it; a line of units is recognised.
    missing : list of str
        Further words for a missing value, besides empty fields, NaN and the words of historians and spreadsheets.
    values : dict of str to float
        Words that stand for numbers, such as {"auto": 1}, besides words for off and on.
    """

    time: Optional[str]
    sample_time: Optional[Duration]
    resample: Optional[Resample]
    time_format: Optional[str]
    time_unit: Optional[Literal["ns", "us", "ms", "s", "min", "h", "d"]]
    time_zone: Optional[str]
    delimiter: Optional[str]
    comment: Optional[str]
    encoding: Optional[str]
    sheet: Optional[str]
    decimal_comma: Optional[bool]
    header: Union[bool, int]
    skip_rows: Optional[int]
    missing: Optional[Union[str, Sequence[str]]]
    values: Optional[Mapping[str, float]]


def words(arguments: Mapping[str, Any]) -> list[str]:
    """Those of a function's arguments that say how a file is read, in the words of the command line.

    Raises
    ------
    TypeError
        For a value of a type that an option cannot have.
    ValueError
        For a value that cannot be.
    """
    found: list[str] = []
    for name in ReadOptions.__annotations__:
        value = arguments.get(name)
        if value is None:
            continue
        if name == "header":
            # The command line says it the other way round.
            if isinstance(value, (bool, np.bool_)):
                found += [] if value else ["--no-header"]
            else:
                found.append(f"--header-row={integer(name, value)}")
        elif name == "decimal_comma":
            found.append(f"--decimal-comma={'yes' if flag(name, value) else 'no'}")
        elif name == "values":
            found += [f"--value={one}" for one in _texts(name, value, None)]
        else:
            found += [f"--{name.replace('_', '-')}={text}" for text in _texts(name, value, None)]
    return found


def plan(arguments: Mapping[str, Any], rows: int | None = None) -> str:
    """Options as a plan, in JSON; those that are None were not given. ``rows`` is where an open slice ends.

    Raises
    ------
    TypeError, ValueError
        As for `words`.
    """
    found: dict[str, Any] = {}
    for name, value in arguments.items():
        if value is None:
            continue
        if name == "input":
            # Channels by name, as they are.
            found[name] = [text(name, one) for one in value]
        elif name == "linear":
            found["no_linear"] = not flag(name, value)
        elif name == "terms" and isinstance(value, (list, tuple)):
            # The products themselves.
            if not value:
                raise ValueError("terms: there is none; name one at least")
            found["term"] = [text(name, one) for one in value]
        elif name == "regressors":
            if not isinstance(value, (list, tuple)):
                raise TypeError(f"regressors: expected a sequence of str, found {_numbers.shown(value)}")
            found["regressor"] = [text(name, one) for one in value] or None
        elif name == "feedthrough":
            found[name] = "yes" if flag(name, value) else "no"
        elif name in ("trend", "raw_terms", "drawn", "delay", "profile") or (name == "constant" and isinstance(value, bool)):
            found[name] = flag(name, value)
        elif name in ("past", "future"):
            found[name] = count(name, value)
        else:
            texts = _orders(name, value) if name in _ORDERS else _texts(name, value, rows)
            found[name] = texts[0] if len(texts) == 1 else texts or None
    return json.dumps(found)


_ORDERS = frozenset(["na", "nb", "nc", "nd", "nf", "nk", "np", "nu", "ny", "nz", "order", "seasonal", "taps"])
"""The options that are orders: values or ranges, one for all channels or one for each."""


def _orders(name: str, value: Any) -> list[str]:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        return [_order(name, value)]
    if (name, len(value)) in (("order", 3), ("seasonal", 4)):
        # p, d, q and P, D, Q, s.
        return [",".join(_order(name, one) for one in value)]
    if name not in ("nb", "nf", "nk", "np", "nu", "ny", "nz", "taps"):
        raise TypeError(f"{name}: expected an int or a range such as range(1, 4), found {_numbers.shown(value)}")
    texts = [_order(name, one) for one in value]
    if not texts:
        raise ValueError(f"{name}: there is none; give one for each channel")
    return [",".join(texts)]


_F = TypeVar("_F", bound=Callable[..., Any])


def takes(options: type | None = None) -> Callable[[_F], _F]:
    """A function whose keyword arguments are these options beside its own parameters: `inspect.signature` and `help` show each,
    and one that is none is an error that says which may have been meant."""
    types: dict[str, Any] = {} if options is None else options.__annotations__

    def documented(function: _F) -> _F:
        signature = inspect.signature(function)
        names = function.__globals__
        own = [
            one.replace(annotation=_signatures.spelled_out(one.annotation, names))
            for one in signature.parameters.values()
            if one.kind is not inspect.Parameter.VAR_KEYWORD
        ]
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
            for name, kind in types.items()
        ]
        known = signature.replace(parameters=[*own, *added])

        @functools.wraps(function)
        def checked(*arguments: Any, **named: Any) -> Any:
            for name in named:
                if name not in known.parameters:
                    near = difflib.get_close_matches(name, known.parameters, n=1)
                    meant = f"; did you mean {near[0]!r}?" if near else ""
                    raise TypeError(f"{function.__name__}() has no argument {name!r}{meant}")
            return function(*arguments, **named)

        kinds = function.__annotations__.items()
        own_types = {name: _signatures.spelled_out(kind, names) for name, kind in kinds if name != "options"}
        checked.__annotations__ = {**own_types, **types}
        checked.__signature__ = known  # type: ignore[attr-defined]
        return cast(_F, checked)

    return documented


def _order(name: str, value: Any) -> str:
    if isinstance(value, range):
        return _span(name, value, 0)
    count = integer(name, value)
    if count < 0:
        raise ValueError(f"{name}: {count} is below 0")
    return str(count)


def integer(name: str, value: Any) -> int:
    """A whole number, of Python or NumPy."""
    if not isinstance(value, bool):
        with contextlib.suppress(TypeError):
            return operator.index(value)
    raise TypeError(f"{name}: expected an int, found {_numbers.shown(value)}")


def count(name: str, value: Any, most: int = 10_000_000) -> int:
    """A whole number from 1 on."""
    found = integer(name, value)
    if not 1 <= found <= most:
        raise ValueError(f"{name}: {found} is outside 1..{most}")
    return found


def number(name: str, value: Any) -> str:
    """A finite number, written so that it is read back exactly."""
    if isinstance(value, (bool, str, bytes)):
        raise TypeError(f"{name}: expected a number, found {_numbers.shown(value)}")
    try:
        found = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number, found {_numbers.shown(value)}") from None
    if not math.isfinite(found):
        raise ValueError(f"{name}: {found} is not a finite number")
    return repr(found)


UNITS = {"ns": 1e9, "us": 1e6, "ms": 1e3, "s": 1.0, "min": 1 / 60, "h": 1 / 3600, "d": 1 / 86400}
"""Units of durations: how many are a second."""


def seconds(name: str, value: Any) -> float:
    """A duration: seconds, a timedelta, or a text with a unit."""
    if isinstance(value, (datetime.timedelta, np.timedelta64)):
        # NumPy's keeps the nanoseconds of pandas.
        lasts = value.to_timedelta64() if hasattr(value, "to_timedelta64") else np.timedelta64(value)
        try:
            value = lasts / np.timedelta64(1, "s")
        except TypeError:
            raise TypeError(f"{name}: {value!r} has no fixed length; give seconds or a timedelta of days or less") from None
    if isinstance(value, str):
        found = re.fullmatch(r"\s*([0-9.]+(?:e[+-]?\d+)?)\s*(ns|us|ms|s|min|h|d)\s*", value)
        try:
            value = float(found.group(1)) / UNITS[found.group(2)] if found else None
        except ValueError:
            value = None
        if value is None:
            raise ValueError(f"{name}: it is no duration; give seconds, a timedelta, or a text such as '10 ms' (ns, us, ms, s, min, h, d)")
    return float(number(name, value))


def quantile(level: float) -> float:
    """How many standard deviations to either side of the mean a normal variable lies with the probability ``level``."""
    if not 0 < level < 1:
        raise ValueError(f"level: {level} is not between 0 and 1; give one such as 0.95")
    return NormalDist().inv_cdf((1 + level) / 2)


def named(name: str, value: Any) -> dict[str, float] | None:
    """Numbers by names."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise TypeError(f"{name}: expected a dict, found {_numbers.shown(value)}")
    return {text(name, key): float(number(name, one)) for key, one in value.items()} or None


def text(name: str, value: Any) -> str:
    """The value, if it is a str."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a str, found {_numbers.shown(value)}")
    return value


def resampling(name: str, value: Any) -> tuple[float, str, bool]:
    """The step in seconds, how to read between rows, and whether to filter against aliasing."""
    if not isinstance(value, (tuple, list)) or len(value) not in (2, 3):
        raise TypeError(f"{name}: expected (seconds, 'linear', 'hold' or 'auto'), found {_numbers.shown(value)}")
    if len(value) == 3 and value[2] != "unfiltered":
        raise ValueError(f"{name}: {value[2]!r} is not 'unfiltered'; leave it out for a filter")
    return seconds(name, value[0]), text(name, value[1]), len(value) == 2


def flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{name}: expected True or False, found {_numbers.shown(value)}")
    return value


def channels(inputs: Sequence[str] | str | None, output: str | None) -> list[str]:
    """The channels of a file as options of the command line."""
    found = []
    for name in [inputs] if isinstance(inputs, str) else inputs or ():
        name = text("inputs", name)
        if any(sign in name for sign in ',"\n'):
            # As in CSV.
            name = '"' + name.replace('"', '""') + '"'
        found.append(f"--input={name}")
    return found if output is None else [*found, f"--output={text('output', output)}"]


def path_text(path: str | os.PathLike[str]) -> str:
    """A path as the command line takes it: a name that begins with a hyphen is no option and not standard input."""
    name = _files.name(path)
    # Python has an error of its own for a file that is not there.
    os.stat(name)
    return f"./{name}" if name.startswith("-") else name


def _span(name: str, value: Any, first: int) -> str:
    """What a slice or range holds, counted from ``first``, both ends included."""
    start, stop = (0 if value.start is None else value.start), value.stop
    if value.step not in (None, 1):
        raise ValueError(f"{name}: a step of {value.step} leaves some out; give one of 1")
    if stop is None or start < 0 or stop < 0:
        raise ValueError(f"{name}: {value} needs a start and a stop that are not below 0")
    if stop <= start:
        raise ValueError(f"{name}: {value} is empty")
    return f"{start + first}..{stop - 1 + first}"


def rows_of(name: str, value: Any, rows: int | None) -> list[str]:
    """Ranges of rows, counted from 1; ``rows`` is where an open slice ends."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, slice) and value.stop is None:
        value = slice(value.start, rows, value.step)
    if isinstance(value, (slice, range)):
        return [_span(name, value, 1)]
    if isinstance(value, (list, tuple)):
        ends = len(value) == 2 and all(isinstance(end, (int, np.integer)) for end in value)
        if ends:
            raise TypeError(f"{name}: expected a slice, found {value!r}; slice({value[0]}, {value[1]}) are these rows, or range({value[0]}, {value[1]})")
        return [one for part in value for one in rows_of(name, part, rows)]
    raise TypeError(f"{name}: expected a slice, a range or a text such as '1..500', found {_numbers.shown(value)}")


def _bound(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise ValueError(f"{name}: expected a value or a lower and an upper end, found {_numbers.shown(value)}")

        def end(limit: Any) -> str:
            open_end = limit is None or (isinstance(limit, float) and math.isinf(limit))
            return "" if open_end else number(name, limit)

        return f"{end(value[0])}..{end(value[1])}"
    return number(name, value)


_WHOLE = frozenset(
    ["channels", "degree", "discard", "half_width", "lags", "length", "max_iterations", "most_terms", "period", "points", "seed"]
    + ["knots", "skip_rows", "starts", "terms", "units", "window"]
)
"""The options that are whole numbers."""


def _texts(name: str, value: Any, rows: int | None) -> list[str]:
    if name in ("estimate", "validate", "rows"):
        return [",".join(rows_of(name, value, rows))]
    if name == "values":
        if not isinstance(value, Mapping):
            raise TypeError(f"{name}: expected a dict, found {_numbers.shown(value)}")
        return [f"{text(name, word)}={number(name, of)}" for word, of in value.items()]
    if name in ("offset", "scale", "bound"):
        if not isinstance(value, Mapping):
            raise TypeError(f"{name}: expected a dict, found {_numbers.shown(value)}")
        return [f"{text(name, key)}={_bound(name, of) if name == 'bound' else number(name, of)}" for key, of in value.items()]
    if name == "dc_gain":
        if isinstance(value, Mapping):
            return [f"{key}={_bound(name, of)}" for key, of in value.items()]
        return [_bound(name, value)]
    if name == "prefilter":
        return [value if isinstance(value, str) else _bound(name, value)]
    if name == "split":
        if isinstance(value, str):
            return [value]
        if not isinstance(value, Sequence):
            raise TypeError(f"{name}: expected three numbers such as (60, 20, 20), found {_numbers.shown(value)}")
        return ["/".join(_plain(number(name, part)) for part in value)]
    if name == "focus":
        return [value if isinstance(value, str) else str(integer(name, value))]
    if name == "norm":
        return [{"1.0": "1", "2.0": "2"}.get(str(value), str(value))]
    if name == "resample":
        step, how, filtered = resampling(name, value)
        return [f"{number(name, step)}:{how}{'' if filtered else ':unfiltered'}"]
    if name == "missing":
        return [value] if isinstance(value, str) else [text(name, one) for one in value]
    if name in _WHOLE:
        return [str(integer(name, value))]
    if name == "frequencies":
        if isinstance(value, tuple) and len(value) == 2:
            return ["..".join(number(name, end) for end in value)]
        if isinstance(value, np.ndarray):
            value = value.ravel().tolist()
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise TypeError(f"{name}: expected a band such as (0.1, 3), or a list of frequencies, found {_numbers.shown(value)}")
        return [",".join(number(name, one) for one in value)]
    if name in ("range", "band"):
        if not isinstance(value, (tuple, list)) or len(value) != 2:
            raise TypeError(f"{name}: expected a lower and an upper end, found {_numbers.shown(value)}")
        return [f"{number(name, value[0])}..{number(name, value[1])}"]
    if name == "horizon":
        every = value if isinstance(value, (list, tuple)) else [value]
        return [",".join(str(integer(name, one)) for one in every)]
    if name in ("alphas", "step"):
        every = value if isinstance(value, (list, tuple)) else [value]
        return [",".join(number(name, one) for one in every)]
    if name == "sample_time":
        return [number(name, seconds(name, value))]
    if name in ("tolerance", "time_limit", "ridge", "noise_bound", "alpha", "width", "rms", "dead_zone", "alarm"):
        return [number(name, value)]
    return [text(name, value)]


def _plain(number: str) -> str:
    return number[:-2] if number.endswith(".0") else number

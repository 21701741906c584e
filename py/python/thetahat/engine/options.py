"""Keyword arguments as the options of the command line, whose words they share."""

from __future__ import annotations

import contextlib
import datetime
import math
import operator
import os
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Any, Optional, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

from thetahat.engine import files as _files

Order = Union[int, range]
"""An order, or the orders among which to choose: ``range(1, 9)`` is 1 to 8."""

Orders = Union[Order, Sequence[Order]]
"""An order for all inputs, or one for each."""

Rows = Union[str, slice, range, Sequence[Union[str, slice, range]]]
"""Rows of a log: a slice or a range as Python counts them, or ``"1..500"``, which counts from 1 and holds both ends."""

Bound = Union[float, tuple[Optional[float], Optional[float]]]
"""A value, or the lower and the upper end of a range, either of which may be None."""


Duration = Union[float, datetime.timedelta, "np.timedelta64"]
"""Seconds, or a timedelta of Python, NumPy or pandas."""

Resample = Union["tuple[Duration, str]", "tuple[Duration, str, str]"]
"""The time between the new rows, "linear", "hold" or "auto", and "unfiltered" where no filter is wanted."""


Band = Union["tuple[float | None, float | None]", str]
"""The lower and the upper end in Hz, either of which may be None; or a text such as "0.1..5"."""

Frequencies = Union["tuple[float, float]", Sequence[float], NDArray[np.float64]]
"""A band in radians per second as a tuple of its ends, or a list of frequencies."""


class FitOptions(TypedDict, total=False):
    """What every fit can be told, beside the orders.

    Attributes
    ----------
    estimate, validate : rows
        The rows to fit to (all, unless said otherwise), and those to validate on: ``slice(0, 500)`` as Python counts, or
        ``"1..500"``, which counts from 1 and holds both ends; or a list of these.
    split : (float, float, float)
        Cuts the rows in time order into parts to fit, to choose and to test, such as ``(60, 20, 20)``.
    detrend : {"mean", "linear", "none", "start:K"}
        What is taken from each channel before the fit and kept in the model.
    offset : dict of str to float
        Offsets of channels that are set by hand.
    prefilter : (float or None, float or None) or str
        The band of frequencies in Hz whose errors the fit makes small, such as ``(0.1, 5)``: inputs and output go through one
        Butterworth filter. The model and its figures are of the signals as they are.
    initial : {"auto", "drop", "zero", "estimate"}
        What stands for the samples before the first of a segment. Rows that the log has before those to fit to are used as
        past inputs and outputs in all cases but "zero". Without them, "drop" leaves out the first rows, for models without F;
        "estimate" finds what they did to B/F u with the parameters, for models with F. "auto" is "drop" without F; with F it
        is "estimate" where there is a past or where that is worth its parameters, else "zero".
    likelihood : {"conditional", "exact"}
        Which likelihood is made large: that given the first samples, which least squared errors do, or that of all measured
        outputs, by the Kalman filter, through missing ones, as statsmodels' SARIMAX counts it. For models without D and F, one at
        a time. With "exact" the response to the inputs begins at rest (``initial="zero"``) or in a state that is estimated
        ("estimate"); "auto" takes the latter where rows stand before, or where it is worth its parameters.
    constant : {"auto", "yes", "no"}
        Whether the level of the output is estimated with the parameters, beside the mean that is taken off: where it lowers
        MDL, always or never. With ``detrend="none"``, or an offset of the output by hand, "auto" is "no". It is part of ``model.offsets``, and stands with its standard error in the report.
    trend : bool
        Whether a slope of the output is estimated with the parameters too, and its level with it.
    focus : {"auto", "prediction", "simulation"} or int
        What the model is for: errors one step ahead, free runs that the inputs alone drive, or a number of steps ahead. With
        orders, "simulation" finds the plant with the least errors of its free run and the noise behind it, and a number
        is the horizon of the figure on held-out rows. In a choice it says what models are compared by on rows that were held
        out from them; "auto" is "prediction", unless without orders another model simulates these clearly better.
    norm : {2, 1, "huber", "huber:K", "inf"}
        What to make small: squared errors; absolute ones, which wild samples do not rule; squares up to K times the scale of
        the errors and absolute values beyond (1.345); or, where the model is linear in its parameters, the largest error.
    bound : dict of str to float or (float, float)
        Ranges or values that parameters keep to, such as ``{"a1": (-1.9, 0)}``.
    dc_gain : float, (float, float) or dict
        A range or value of the static gain; of each input by its name.
    ridge : float
        Keeps parameters small: weighs like this many more samples in which the output is 0.
    noise_bound : float
        Let no error exceed this, in units of the output.
    search : {"lm", "gauss-newton", "newton", "gradient", "annealing"}
        How steps are chosen: Levenberg and Marquardt's way, unless said otherwise. This and what follows is for models that
        need a search: those with C, D or F.
    max_iterations : int
        Iterations at most, from each start: 100.
    tolerance : float
        Stop where the next step would lower the cost by less than this fraction: 1e-8.
    step : float or (float, float)
        Step length of the gradient search: c1, or c1/(c2 + l) in iteration l.
    starts : int
        Search from this many further starts.
    seed : int
        Which random starts.
    time_limit : float
        After this many seconds begin no iteration, and look for no further start.
    """

    estimate: Rows
    validate: Rows
    split: tuple[float, float, float]
    detrend: str
    offset: Mapping[str, float]
    prefilter: Band
    initial: str
    likelihood: str
    constant: str
    trend: bool
    focus: Union[str, int]
    norm: Union[float, str]
    bound: Mapping[str, Bound]
    dc_gain: Union[Bound, Mapping[str, Bound]]
    ridge: float
    noise_bound: float
    search: str
    max_iterations: int
    tolerance: float
    step: Union[float, tuple[float, float]]
    starts: int
    seed: int
    time_limit: float


class EquationsOptions(TypedDict, total=False):
    """What a fit of a model in equations can be told.

    Attributes
    ----------
    estimate, validate, split
        Rows to fit to and to validate on, see `FitOptions`. In each log the model begins, as it says, with the first row to fit to.
    search : {"lm", "gauss-newton", "newton", "gradient", "annealing"}
        How steps are chosen: Levenberg and Marquardt's way, unless said otherwise.
    max_iterations : int
        Iterations at most, from each start: 100.
    tolerance : float
        Stop where the next step would raise the log-likelihood by no more than this fraction of half the measured values: 1e-8.
    step : float or (float, float)
        Step length of the gradient search: c1, or c1/(c2 + l) in iteration l.
    starts : int
        Search from this many further starts, drawn from what the model knows of its parameters.
    seed : int
        Which random starts.
    time_limit : float
        After this many seconds begin no iteration.
    """

    estimate: Rows
    validate: Rows
    split: tuple[float, float, float]
    search: str
    max_iterations: int
    tolerance: float
    step: Union[float, tuple[float, float]]
    starts: int
    seed: int
    time_limit: float


class NarxOptions(TypedDict, total=False):
    """What a fit of a nonlinear ARX model can be told.

    Attributes
    ----------
    estimate, validate, split, detrend, offset, ridge
        What to fit to, what to judge on and what is taken from the channels, see `FitOptions`.
    regressors : sequence of str
        Expressions of the channels that g reads too, such as ``"sqrt(u)"``, at the lags of the channels in them.
    degree : int
        Factors of a product at most, for ``"poly"``: 2.
    terms : int, or sequence of str
        How many functions to take; chosen unless it is said. Or products by name, as `Model.parameter_names` has them: ``["1",
        "y(k-1)", "y(k-1)^2*u(k-1)"]``.
    most_terms : int
        How many functions a choice looks at: 40.
    select : str
        What makes one number of functions better than another: ``"validation"``, the free run on the validation rows, where there are
        some, else ``"cv"``, that on five blocks of the estimation rows; or an information criterion, such as ``"mdl"``.
    centres : str
        Where radial basis functions stand: ``"chosen"`` among the samples, ``"kmeans:N"``, ``"grid:N"`` or ``"random:N"``.
    width : float
        sigma of exp(-|z - centre|^2/sigma^2), z in standard deviations; so that neighbours overlap, unless it is said.
    units : int
        Units of a network, for ``"tanh"``, ``"logistic"`` and ``"relu"``, centres for ``"rbf-free"``, local models for ``"local"``, or
        neighbours for ``"knn"``; chosen unless it is said. Bends of each regressor, for ``"spline"``: 5. Units that are drawn: 100.
    drawn : bool
        Draw the weights of the hidden layer of a network, and choose among its units; else all weights are trained. Those of ``"step"``
        are always drawn.
    focus : {"auto", "prediction", "simulation"} or int
        Of which errors parameters are made the least: one step ahead, of the free run, or so many steps from what was measured.
        ``"auto"`` is one step ahead, and for what is trained the free run where there are inputs.
    search, max_iterations, tolerance, step, starts, time_limit
        How a training searches, see `FitOptions`: 500 iterations and 4 further starts unless it is said.
    linear : bool
        Whether a constant and the regressors themselves stand beside radial basis functions; whether local models, and what neighbours
        say, are planes: True.
    membership : {"gaussian", "trapezoid", "rectangle"}
        How local models share the space of the regressors.
    raw_terms : bool
        Leave signals in their own units: else each is divided by its standard deviation.
    seed : int
        Which random centres, units and starts.
    """

    estimate: Rows
    validate: Rows
    split: tuple[float, float, float]
    detrend: str
    offset: Mapping[str, float]
    ridge: float
    regressors: Sequence[str]
    degree: int
    terms: Union[int, Sequence[str]]
    most_terms: int
    select: str
    centres: str
    width: float
    units: int
    linear: bool
    membership: str
    raw_terms: bool
    drawn: bool
    focus: Union[str, int]
    search: str
    max_iterations: int
    tolerance: float
    step: Union[float, tuple[float, float]]
    starts: int
    seed: int
    time_limit: float


class ValidationOptions(TypedDict, total=False):
    """How to validate a model on a log.

    Attributes
    ----------
    rows : rows
        The rows to validate on; all, unless said otherwise.
    detrend : {"model", "none", "mean", "linear", "start:K"}
        The offsets: the model's own, or those of the rows evaluated.
    horizon : int or list of int
        Prediction horizons besides 1, in steps.
    lags : int
        Lags of the tests of residuals.
    alpha : float
        Reject where less than this chance is left.
    alphas : list of float
        The levels of Anderson's test.
    """

    rows: Rows
    detrend: str
    horizon: Union[int, Sequence[int]]
    lags: int
    alpha: float
    alphas: Sequence[float]


class SpectrumOptions(TypedDict, total=False):
    """How a frequency response is estimated from a log.

    Attributes
    ----------
    rows : rows
        The rows to use; all, unless said otherwise. Each range is a segment of its own.
    detrend : {"mean", "none", "linear", "start:K"}
        What is taken from each channel first.
    method : {"lpm", "spa", "welch", "etfe", "sines"}
        Local polynomials; Blackman and Tukey's windowed covariances; Welch's averages over windows; the plain ratio of the
        transforms; correlation over whole periods of a stepped or a multi-sine input.
    frequencies : (float, float) or list of float
        Frequencies in radians per second: a band as a tuple of two, or for "lpm" and "spa" a list of them.
    points : int
        For "lpm" and "spa": how many frequencies of the band.
    half_width : int
        For "lpm": lines of the transform on either side of a frequency.
    lags : int
        For "spa": lags of the Hann window.
    window : int
        For "welch": rows of a window.
    estimator : {"h1", "h2"}
        For "welch": where the noise is, in the output or in the input.
    period, discard : int
        For "sines": rows of a period, and how many periods to leave out at the beginning.
    """

    rows: Rows
    detrend: str
    method: str
    frequencies: Frequencies
    points: int
    half_width: int
    lags: int
    window: int
    estimator: str
    period: int
    discard: int


class StepTestOptions(TypedDict, total=False):
    """What of a log is a step test.

    Attributes
    ----------
    rows : rows
        The rows to use; all, unless said otherwise. Each range is for itself.
    """

    rows: Rows


class DesignOptions(TypedDict, total=False):
    """What a test signal has to be.

    Attributes
    ----------
    length : int
        How many samples; 1023, a period of a PRBS, unless said otherwise.
    range : (float, float)
        The lowest and the highest value, in units of the input; (-1, 1) unless said otherwise.
    rms : float
        A power budget: the root mean square of the deviations from the middle of ``range``, instead of its width.
    band : (float, float)
        The lowest and the highest frequency of a multisine, a chirp or stepped sines, in radians per second; all of them unless said
        otherwise.
    points : int
        How many frequencies, each the same factor above the one before: of a multisine, which has every line of its period otherwise,
        and of stepped sines, which have 10.
    period : int
        After how many samples the signal repeats itself: of a PRBS the longest that fits, of a multisine 4096 at most, else the
        length.
    channels : int
        How many signals without correlation: 1, or with a model one for each of its inputs.
    sample_time : float or timedelta
        Time from one sample to the next: 1 s, or that of the model.
    seed : int
        Which random signal, or where a PRBS begins.
    """

    length: int
    range: tuple[float, float]
    rms: float
    band: tuple[float, float]
    points: int
    period: int
    channels: int
    sample_time: Duration
    seed: int


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
        What stands for a missing value, besides nothing, NaN and what historians and spreadsheets write.
    values : dict of str to float
        Words that stand for numbers, such as {"auto": 1}, besides words for off and on.
    """

    time: str
    sample_time: Duration
    resample: Resample
    time_format: str
    time_unit: str
    time_zone: str
    delimiter: str
    comment: str
    encoding: str
    sheet: str
    decimal_comma: bool
    header: Union[bool, int]
    skip_rows: int
    missing: Union[str, Sequence[str]]
    values: Mapping[str, float]


def words(allowed: type, arguments: Mapping[str, Any], rows: int | None = None) -> list[str]:
    """Those of a function's arguments that are options, in the words of the command line; ``rows`` is where an open slice
    ends.

    Raises
    ------
    TypeError
        For a value of a type that an option cannot have.
    ValueError
        For a value that cannot be.
    """
    found: list[str] = []
    for name in allowed.__annotations__:
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
        elif name == "linear":
            found += [] if flag(name, value) else ["--no-linear"]
        elif name == "terms" and isinstance(value, (list, tuple)):
            # The products themselves.
            if not value:
                raise ValueError("terms: there is none; name one at least")
            found += [f"--term={text(name, one)}" for one in value]
        elif name == "regressors":
            if not isinstance(value, (list, tuple)):
                raise TypeError(f"regressors: expected a sequence of str, found {value!r}")
            found += [f"--regressor={text(name, one)}" for one in value]
        elif name == "values":
            found += [f"--value={one}" for one in _texts(name, value, rows)]
        elif name in ("trend", "raw_terms", "drawn"):
            found += [f"--{name.replace('_', '-')}"] if flag(name, value) else []
        else:
            found += [f"--{name.replace('_', '-')}={text}" for text in _texts(name, value, rows)]
    return found


def order_words(**orders: Orders | None) -> list[str]:
    """Orders as options: values or ranges, one for all inputs or one for each."""
    found = []
    for name, value in orders.items():
        if value is None:
            continue
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if isinstance(value, (list, tuple)):
            if name not in ("nb", "nf", "nk", "np", "nu", "ny", "nz", "taps"):
                raise TypeError(f"{name}: expected an int or a range such as range(1, 4), found {value!r}")
            texts = [_order(name, one) for one in value]
            if not texts:
                raise ValueError(f"{name}: there is none; give one for each channel")
            found.append(f"--{name}={','.join(texts)}")
        else:
            found.append(f"--{name}={_order(name, value)}")
    return found


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
    raise TypeError(f"{name}: expected an int, found {value!r}")


def count(name: str, value: Any, most: int = 10_000_000) -> int:
    """A whole number from 1 on."""
    found = integer(name, value)
    if not 1 <= found <= most:
        raise ValueError(f"{name}: {found} is outside 1..{most}")
    return found


def number(name: str, value: Any) -> str:
    """A finite number, written so that it is read back exactly."""
    if isinstance(value, (bool, str, bytes)):
        raise TypeError(f"{name}: expected a number, found {value!r}")
    try:
        found = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number, found {value!r}") from None
    if not math.isfinite(found):
        raise ValueError(f"{name}: {found} is not a finite number")
    return repr(found)


def seconds(name: str, value: Any) -> float:
    """A duration: seconds, or a timedelta."""
    if isinstance(value, (datetime.timedelta, np.timedelta64)):
        # NumPy's keeps the nanoseconds of pandas.
        lasts = value.to_timedelta64() if hasattr(value, "to_timedelta64") else np.timedelta64(value)
        try:
            value = lasts / np.timedelta64(1, "s")
        except TypeError:
            raise TypeError(f"{name}: {value!r} has no fixed length; give seconds or a timedelta of days or less") from None
    if isinstance(value, str):
        raise TypeError(f"{name}: expected seconds or a timedelta, found {value!r}")
    return float(number(name, value))


def quantile(level: float) -> float:
    """How many standard deviations to either side of the mean a normal variable lies with the probability ``level``."""
    if not 0 < level < 1:
        raise ValueError(f"level: {level} is not between 0 and 1; give one such as 0.95")
    return NormalDist().inv_cdf((1 + level) / 2)


def text(name: str, value: Any) -> str:
    """The value, if it is a str."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a str, found {value!r}")
    return value


def resampling(name: str, value: Any) -> tuple[float, str, bool]:
    """The step in seconds, how to read between rows, and whether to filter against aliasing."""
    if not isinstance(value, (tuple, list)) or len(value) not in (2, 3):
        raise TypeError(f"{name}: expected (seconds, 'linear', 'hold' or 'auto'), found {value!r}")
    if len(value) == 3 and value[2] != "unfiltered":
        raise ValueError(f"{name}: {value[2]!r} is not 'unfiltered'; leave it out for a filter")
    return seconds(name, value[0]), text(name, value[1]), len(value) == 2


def flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{name}: expected True or False, found {value!r}")
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


def _rows(name: str, value: Any, rows: int | None) -> list[str]:
    if isinstance(value, str):
        return [value]
    if isinstance(value, slice) and value.stop is None:
        value = slice(value.start, rows, value.step)
    if isinstance(value, (slice, range)):
        return [_span(name, value, 1)]
    if isinstance(value, (list, tuple)):
        return [one for part in value for one in _rows(name, part, rows)]
    raise TypeError(f"{name}: expected a slice, a range or a text such as '1..500', found {value!r}")


def _bound(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise ValueError(f"{name}: expected a value or a lower and an upper end, found {value!r}")

        def end(limit: Any) -> str:
            open_end = limit is None or (isinstance(limit, float) and math.isinf(limit))
            return "" if open_end else number(name, limit)

        return f"{end(value[0])}..{end(value[1])}"
    return number(name, value)


_WHOLE = frozenset(
    ["channels", "degree", "discard", "half_width", "lags", "length", "max_iterations", "most_terms", "period", "points", "seed"]
    + ["skip_rows", "starts", "terms", "units", "window"]
)
"""The options that are whole numbers."""


def _texts(name: str, value: Any, rows: int | None) -> list[str]:
    if name in ("estimate", "validate", "rows"):
        return [",".join(_rows(name, value, rows))]
    if name == "values":
        if not isinstance(value, Mapping):
            raise TypeError(f"{name}: expected a dict, found {value!r}")
        return [f"{text(name, word)}={number(name, of)}" for word, of in value.items()]
    if name in ("offset", "bound"):
        if not isinstance(value, Mapping):
            raise TypeError(f"{name}: expected a dict, found {value!r}")
        return [f"{key}={number(name, of) if name == 'offset' else _bound(name, of)}" for key, of in value.items()]
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
            raise TypeError(f"{name}: expected three numbers such as (60, 20, 20), found {value!r}")
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
            raise TypeError(f"{name}: expected a band such as (0.1, 3), or a list of frequencies, found {value!r}")
        return [",".join(number(name, one) for one in value)]
    if name in ("range", "band"):
        if not isinstance(value, (tuple, list)) or len(value) != 2:
            raise TypeError(f"{name}: expected a lower and an upper end, found {value!r}")
        return [f"{number(name, value[0])}..{number(name, value[1])}"]
    if name == "horizon":
        every = value if isinstance(value, (list, tuple)) else [value]
        return [",".join(str(integer(name, one)) for one in every)]
    if name in ("alphas", "step"):
        every = value if isinstance(value, (list, tuple)) else [value]
        return [",".join(number(name, one) for one in every)]
    if name == "sample_time":
        return [number(name, seconds(name, value))]
    if name in ("tolerance", "time_limit", "ridge", "noise_bound", "alpha", "width", "rms"):
        return [number(name, value)]
    return [text(name, value)]


def _plain(number: str) -> str:
    return number[:-2] if number.endswith(".0") else number

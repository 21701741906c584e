"""Clocks: times of any kind as seconds, and what the rows of a data frame are called, so that results go back to one.

Instants are kept as datetime64, in UTC where they have a time zone, which stands beside them: between two of them lies the time
that went by, whatever summer time does to the clocks on the wall.
"""

from __future__ import annotations

import datetime
import re
import sys
import warnings
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, NamedTuple

import narwhals.stable.v2 as nw
import numpy as np
from narwhals.dependencies import is_pandas_like_dataframe, is_pandas_like_index, is_pandas_like_series
from numpy.typing import NDArray

from thetahat.base import numbers as _numbers, said as _said

SECOND = np.timedelta64(1, "s")
# Steps of a calendar, such as months, differ from their median by no more than what a log takes for uniform.
UNIFORM = 0.1
# How many of the last rows tell the calendar that they follow.
LAST = 1000
# Units of time since 1970, each with how many of it are a second.
EPOCHS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
# The instants of logs: from 2000 to 2100, in seconds since 1970.
LOGGED = (9.4e8, 4.1e9)
# Steps of a calendar are whole minutes; others are shorter than this many seconds.
SLOW = 100.0

ISO_8601 = re.compile(
    r"(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?))? ?(Z|[+-]\d\d(?::?\d\d)?)?", re.ASCII | re.IGNORECASE
)


class Labels(NamedTuple):
    """What rows are called: by times, by numbers, or by anything else."""

    values: NDArray[Any]
    """datetime64 (UTC where there is a zone), timedelta64, numbers, or objects."""
    name: Any = None
    zone: Any = None
    """A tzinfo or the name of a time zone; None for all but instants with one."""
    rule: Any = None
    """The rule that an index of pandas follows, its `freq`."""
    epoch: str | None = None
    """The unit of the numbers since 1970 that the times were given as."""

    @property
    def are_times(self) -> bool:
        return self.values.dtype.kind in "mM"

    def part(self, start: int, stop: int) -> Labels:
        return self._replace(values=self.values[start:stop])

    def seconds(self, argument: str) -> _numbers.Array:
        """Seconds, of instants those since the first, if all are there and rise."""
        values = self.values
        dated = self.are_times
        missing = np.isnat(values) if dated else np.isnan(values)
        if missing.any():
            count, first = np.count_nonzero(missing), int(np.argmax(missing)) + 1
            rows = f"row {first} has" if count == 1 else f"{count} rows have"
            where = "" if count == 1 else f", the first of them row {first}"
            raise ValueError(f"{argument}: {rows} no time{where}; drop rows without one, or fill their times in")
        if not dated:
            # Whether these rise is for the log to see.
            return np.asarray(values, dtype=np.float64, order="C")
        steps = np.diff(values)
        wrong = steps <= np.timedelta64(0)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"{argument}: {self._trouble(row, int(np.count_nonzero(steps == np.timedelta64(0))))}")
        origin = values[0] if values.dtype.kind == "M" and len(values) else np.timedelta64(0)
        return np.asarray((values - origin) / SECOND, dtype=np.float64, order="C")

    def _trouble(self, row: int, twice: int) -> str:
        """Why row `row` (from 0) and the next one do not rise."""
        before, after = self.text(row), self.text(row + 1)
        if self.values[row] == self.values[row + 1]:
            more = f" (and {twice - 1} more)" if twice > 1 else ""
            return f"{before} is there twice, in rows {row + 1} and {row + 2}{more}; keep one row for each time"
        back = self.values[row] - self.values[row + 1]
        summer = self.values.dtype.kind == "M" and self.zone is None and back <= np.timedelta64(3600, "s")
        hint = "; where summer time ends, give the times their time zone (tz_localize in pandas)" if summer else ""
        return f"time goes back from {before} in row {row + 1} to {after} in row {row + 2}; sort the rows by time first{hint}"

    def between(self, start: Any, stop: Any) -> slice:
        """The rows from an instant to another one, both included. A text without a time of day is the whole day, month or year; one
        without a time zone is of the zone of the log."""
        values = self.values
        if values.dtype.kind != "M":
            raise TypeError("rows: the log has no dates; cut it by rows, such as log[:500]")
        if (np.diff(values) < np.timedelta64(0)).any():
            raise ValueError("rows: the dates of the log do not rise; cut its experiments one by one")
        first = 0 if start is None else int(np.searchsorted(values, self._instants(start)[0], "left"))
        if stop is None:
            return slice(first, len(values))
        begins, ends = self._instants(stop)
        last = np.searchsorted(values, begins, "right") if ends is None else np.searchsorted(values, ends, "left")
        return slice(first, int(last))

    def _instants(self, value: Any) -> tuple[np.datetime64, np.datetime64 | None]:
        """Where an instant begins, and where the day, month, minute or other part that a text names ends."""
        if not isinstance(value, str):
            labels = read("rows", [value])
            if labels.values.dtype.kind != "M":
                raise TypeError(f"rows: {value!r} is no date; rows are counted by whole numbers")
            return labels.values[0], None
        found = ISO_8601.fullmatch(value.strip())
        if found is not None and found.group(3) is not None:
            return read("rows", [value]).values[0], None
        try:
            partial = np.datetime64(value.strip().replace(" ", "T").replace(",", "."))
        except ValueError:
            raise ValueError(f"rows: {value!r} is no date such as '2026-03-01' or '2026-03-01 12:30'; rows are counted by numbers") from None
        return self._in_utc(partial), self._in_utc(partial + 1)

    def _in_utc(self, local: np.datetime64) -> np.datetime64:
        """What the clocks on the wall of the zone show as this."""
        zone = None if self.zone is None else _tzinfo(self.zone)
        if zone is None:
            return local
        instant = local.astype("datetime64[us]").item().replace(tzinfo=zone)
        return np.datetime64(instant.astimezone(datetime.timezone.utc).replace(tzinfo=None), "us")

    def text(self, row: int = 0) -> str:
        """A time as ISO 8601 writes it, where the clocks on the wall of its zone show it; a duration in seconds."""
        value = self.values[row]
        if self.values.dtype.kind == "m":
            return f"{value / SECOND:g} s"
        if self.zone is not None:
            instant, zone = value.astype("datetime64[us]").item(), self.tzinfo
            # Python has no dates after the year 9999.
            if zone is not None and isinstance(instant, datetime.datetime):
                return instant.replace(tzinfo=datetime.timezone.utc).astimezone(zone).isoformat()
        return _written(value) + ("" if self.zone is None else "Z")

    def start(self) -> str | None:
        """The first instant as documents have it: in UTC with a Z where there is a zone."""
        if self.values.dtype.kind != "M":
            return None
        return _written(self.values[0]) + ("" if self.zone is None else "Z")

    def to_pandas(self) -> Any:
        """As an index."""
        if isinstance(self.name, tuple):
            return imported("pandas").MultiIndex.from_tuples(self.values, names=self.name)
        if self._is_counted:
            return imported("pandas").Index(self.values.astype(np.int64), name=self.name)
        index = imported("pandas").Index(self.values, name=self.name)
        if self.zone is not None:
            index = index.tz_localize("UTC").tz_convert(self.zone)
        if self.rule is not None:
            index.freq = self.rule
        return index

    def to_polars(self) -> Any:
        """As a series."""
        polars = imported("polars")
        values, name = self.values, "time" if self.name is None else str(self.name)
        if self._is_counted:
            return polars.Series(name, self.values.astype(np.int64))
        if self.are_times and np.datetime_data(values.dtype)[0] not in ("ms", "us", "ns"):
            values = values.astype(f"{values.dtype.kind}8[us]")
        series = polars.Series(name, values)
        if self.zone is not None:
            series = series.dt.replace_time_zone("UTC")
            known = self.zone_name
            if known != "UTC" and "/" in known:
                series = series.dt.convert_time_zone(known)
        return series

    @property
    def zone_name(self) -> str:
        """What the time zone is called; nothing where there is none."""
        return "" if self.zone is None else str(getattr(self.zone, "key", getattr(self.zone, "zone", self.zone)))

    @property
    def tzinfo(self) -> datetime.tzinfo | None:
        """The time zone as Python has it; None where there is none, or Python does not know it."""
        return None if self.zone is None else _tzinfo(self.zone)

    @property
    def _is_counted(self) -> bool:
        """Whether the instants go back to numbers since 1970; finer ones than were given stay instants."""
        return self.epoch is not None and self.values.dtype == np.dtype(f"datetime64[{self.epoch}]")

    def dated(self, argument: str) -> Labels:
        """Numbers that can only be a time since 1970, in a unit that their size tells, as the instants that they are."""
        numbers = self.values
        if numbers.dtype.kind not in "iuf" or len(numbers) < 2 or not np.isfinite(numbers).all():
            return self
        low, high = float(numbers.min()), float(numbers.max())
        step = float(np.median(np.diff(numbers.astype(np.float64))))
        inside = [unit for unit, second in EPOCHS.items() if LOGGED[0] * second <= low and high <= LOGGED[1] * second]
        whole = numbers.dtype.kind in "iu" or bool((numbers == np.floor(numbers)).all())
        # A fraction of a second is more than instants have digits for.
        if not inside or step <= 0 or not (whole or inside[0] != "s"):
            return self
        unit, lasts = inside[0], step / EPOCHS[inside[0]]
        if lasts >= SLOW and lasts % 60 != 0:
            _said.warn(
                f"{argument}: numbers near {low:.3g} with steps of {step:g} may be {unit} since 1970, with {lasts:g} s from row to "
                "row; they are taken as seconds; give times (pandas.to_datetime with its unit), or seconds"
            )
            return self
        instants = np.floor(numbers).astype(np.int64)
        if not whole:
            fine = 1e9 / EPOCHS[unit]
            instants = instants * int(fine) + np.round((numbers - np.floor(numbers)) * fine).astype(np.int64)
        values = instants.astype(f"datetime64[{unit if whole else 'ns'}]")
        return self._replace(values=values, zone=datetime.timezone.utc, epoch=unit if whole else None)

    def after(self, steps: int, sample_time: float) -> Labels | None:
        """Those of the rows to come; None where nothing says what follows."""
        values = self.values
        if not self.are_times:
            # Numbers of rows go on as they do.
            between = np.unique(np.diff(values)) if values.dtype.kind in "iu" else np.empty(0)
            return self._replace(values=values[-1] + between[0] * np.arange(1, steps + 1)) if len(between) == 1 else None
        calendar = self._calendar_after(steps)
        if calendar is not None:
            return calendar
        last = np.diff(values[-LAST:])
        rule = self.rule
        if len(last) and (last == last[0]).all():
            ahead = last[0] * np.arange(1, steps + 1)
        else:
            nanoseconds = np.round(sample_time * 1e9 * np.arange(1, steps + 1)).astype("timedelta64[ns]")
            ahead = nanoseconds.astype(f"timedelta64[{np.datetime_data(values.dtype)[0]}]")
            # Whole units where they are, finer ones where not.
            ahead = ahead if (ahead == nanoseconds).all() else nanoseconds
            rule = None
        return self._replace(values=values[-1] + ahead, rule=rule)

    def _calendar_after(self, steps: int) -> Labels | None:
        """The instants to come where the last ones follow a calendar, such as the first days of months, days of a zone."""
        pandas = sys.modules.get("pandas")
        last = np.diff(self.values[-LAST:]) / SECOND
        if pandas is None or self.values.dtype.kind != "M" or len(last) < 2:
            return None
        if np.abs(last / np.median(last) - 1).max() > UNIFORM:
            # Days of work, and others that leave some out: the steps of the log do not.
            return None
        rule = self.rule
        index = self._replace(values=self.values[-LAST:], rule=None, epoch=None).to_pandas()
        if rule is None and not (last == last[0]).all():
            with warnings.catch_warnings():
                # pandas 3.1 announces that another type will be returned, which date_range takes as well.
                warnings.simplefilter("ignore")
                rule = pandas.infer_freq(index)
        if rule is None:
            return None
        ahead = pandas.date_range(index[-1], periods=steps + 1, freq=rule)[1:]
        return read("index", ahead, self.name)


class Clock(NamedTuple):
    """How the rows of a log lie in time, beside the seconds: for its repr, and for the way back to a data frame."""

    said: str = ""
    """How the sample time is known; nothing where it was given."""
    times: Labels | None = None
    """The times of the rows, where they are more than seconds, or were a column."""
    rows: Labels | None = None
    """The index of the data frame, where it is not these times."""
    column: bool = False
    """Whether the times were a column of it."""

    def part(self, start: int, stop: int) -> Clock:
        return self._replace(
            times=None if self.times is None else self.times.part(start, stop),
            rows=None if self.rows is None else self.rows.part(start, stop),
        )

    def after(self, steps: int, sample_time: float) -> Clock:
        """That of the rows to come."""
        times = self.times
        if times is not None and not times.are_times:
            times = times._replace(values=times.values[-1] + sample_time * np.arange(1, steps + 1))
        elif times is not None:
            times = times.after(steps, sample_time)
        return self._replace(
            times=times,
            rows=None if self.rows is None else self.rows.after(steps, sample_time),
        )

    def resampled(self, seconds: _numbers.Array) -> Clock:
        """That of new rows at these seconds, as `Labels.seconds` counts them. The index went with the old ones."""
        said = f"{self.said}, resampled".strip(", ")
        if self.times is None or not self.times.are_times:
            return Clock(said, None if self.times is None else self.times._replace(values=seconds))
        values = self.times.values
        origin = values[0] if values.dtype.kind == "M" else np.timedelta64(0)
        exact = origin + np.round(seconds * 1e9).astype("timedelta64[ns]")
        plain = exact.astype(values.dtype)
        return Clock(said, self.times._replace(values=plain if (plain == exact).all() else exact, rule=None))

    def text(self) -> str:
        """What the repr of a log says after the sample time."""
        if self.times is None or not self.times.are_times:
            return f" {self.said}" if self.said else ""
        unit = f", {self.times.epoch} since 1970," if self.times.epoch is not None else ""
        return (f" {self.said}" if self.said else "") + f"{unit} from {self.times.text()}"


def joined(clocks: Sequence[Clock]) -> Clock:
    """That of several logs, one after the other."""
    said = clocks[0].said if len({clock.said for clock in clocks}) == 1 else ""
    times, rows = _joined([clock.times for clock in clocks]), _joined([clock.rows for clock in clocks])
    return Clock(said, times, rows, all(clock.column for clock in clocks))


def _joined(labels: Sequence[Labels | None]) -> Labels | None:
    there = [one for one in labels if one is not None]
    kinds = {(one.values.dtype.kind in "mM" and one.values.dtype.kind, one.zone is None) for one in there}
    if len(there) < len(labels) or len(kinds) != 1:
        return None
    zones = [one.zone for one in there]
    zone = zones[0] if all(str(zone) == str(zones[0]) for zone in zones) else datetime.timezone.utc
    epoch = there[0].epoch if len({one.epoch for one in there}) == 1 else None
    return Labels(np.concatenate([one.values for one in there]), there[0].name, zone, None, epoch)


def to_pandas(clock: Clock, seconds: _numbers.Array, columns: dict[str, Any]) -> Any:
    """A data frame of columns with the index that the log came with, or its times."""
    pandas = imported("pandas")
    times = Labels(seconds, "time") if clock.times is None else clock.times
    if clock.rows is None:
        return pandas.DataFrame(columns, times.to_pandas())
    if clock.times is None or not clock.column:
        return pandas.DataFrame(columns, clock.rows.to_pandas())
    name = _free("time" if times.name is None else times.name, columns)
    # Without its own index, which pandas would align with the other.
    return pandas.DataFrame({name: times.to_pandas().array, **columns}, clock.rows.to_pandas())


def to_polars(clock: Clock, seconds: _numbers.Array, columns: dict[str, Any]) -> Any:
    """A data frame of columns after one of times, or of the numbers that the rows have."""
    polars = imported("polars")
    labels = Labels(seconds, "time")
    if clock.times is not None:
        labels = clock.times
    elif clock.rows is not None and clock.rows.values.dtype.kind in "iu":
        labels = clock.rows
    times = labels.to_polars()
    return polars.DataFrame([times.rename(_free(times.name, columns)), *(polars.Series(*column) for column in columns.items())])


def _free(name: Any, columns: dict[str, Any]) -> Any:
    while name in columns:
        name = f"{name}_"
    return name


def labels_from(start: str, seconds: _numbers.Array, name: Any) -> Labels | None:
    """Rows of a file, so many seconds after a start in ISO 8601; None where that is a time of day without a date."""
    found = ISO_8601.fullmatch(start.replace(",", "."))
    if found is None:
        return None
    first = read("time", [start]).values[0].astype("datetime64[ns]")
    instants = first + np.round(seconds * 1e9).astype("timedelta64[ns]")
    zone = None if found.group(3) is None else datetime.timezone.utc
    return Labels(instants, name, zone)


def read(argument: str, values: Any, name: Any = None) -> Labels:
    """Times of any kind, copied: a log owns its data.

    Parameters
    ----------
    argument : str
        What messages call them.
    values : array_like, series or index
        Instants with or without a time zone, days, periods, durations, texts in ISO 8601, or numbers, which are seconds.
    name : optional
        What they are called; the name of the series or index, unless said otherwise.

    Raises
    ------
    TypeError
        If there is something that is no time, or times of several kinds.
    ValueError
        If a text is not in ISO 8601, or it has not one dimension.
    """
    if isinstance(values, str):
        message = f"{argument}: expected times, found the text {values!r}; names of columns are for Log.from_dataframe"
        raise TypeError(message)
    rule = None
    if is_pandas_like_index(values):
        name, rule = values.name if name is None else name, getattr(values, "freq", None)
        values = values.to_series()
    native = _numbers.of_library(argument, values)
    if isinstance(native, nw.DataFrame):
        columns = native.columns
        if len(columns) != 1:
            raise ValueError(f"{argument}: expected one column of times, found {len(columns)}")
        native = native.get_column(columns[0])
    if not isinstance(native, nw.Series):
        found = np.asarray(values)
        if isinstance(values, np.ma.MaskedArray) and found.dtype.kind in "mM":
            found = np.where(np.ma.getmaskarray(values), np.array("NaT", found.dtype), found)
        if found.ndim == 2 and found.shape[1] == 1:
            found = found[:, 0]
        if found.ndim != 1:
            raise ValueError(f"{argument}: expected one dimension, found shape {found.shape}")
        if found.dtype.kind in "mM":
            return Labels(found.copy(), name)
        if found.dtype.kind in "USO":
            return _of_objects(argument, found.tolist(), name)
        return _numbered(argument, found, _numbers.column(argument, values).copy(), name)
    name = native.name if name is None and native.name else name
    if native.dtype == nw.Duration:
        return Labels(np.array(native.to_numpy()), name, None, rule)
    if native.dtype == nw.Date:
        # Midnight. The dates of pandas with PyArrow would come as objects.
        native = native.cast(nw.Datetime("us"))
    if native.dtype == nw.Datetime:
        of_pandas = getattr(native.to_native(), "dt", None)
        zone = getattr(of_pandas, "tz", None) or getattr(native.dtype, "time_zone", None)
        # With a time zone these are in UTC.
        return Labels(np.array(native.to_numpy()), name, zone, rule)
    if native.dtype.is_numeric():
        return _numbered(argument, native.to_numpy(), _numbers.series(argument, native).copy(), name)
    return _of_objects(argument, native.to_list(), name)


def _numbered(argument: str, given: Any, numbers: _numbers.Array, name: Any) -> Labels:
    """Numbers: a time since 1970, of whose nanoseconds float64 would lose some, or seconds."""
    exact = np.asarray(given)
    dated = Labels(exact if exact.dtype.kind in "iu" else numbers, name).dated(argument)
    return dated if dated.are_times else Labels(numbers, name)


def _of_objects(argument: str, entries: list[Any], name: Any) -> Labels:
    times: list[Any] = []
    kind, first = None, 0
    zones: dict[Any, None] = {}
    for row, entry in enumerate(entries, 1):
        time, own, zone = _of_object(argument, entry, row)
        times.append(time)
        if own is None:
            continue
        if kind is None:
            kind, first = own, row
        if own != kind:
            raise TypeError(
                f"{argument}: row {row} has {own}, {entry!r}, where row {first} has {kind}, {entries[first - 1]!r}; "
                "give times of one kind"
            )
        zones[zone] = None
    if kind == "a number":
        return Labels(_numbers.array(argument, entries), name)
    missing = np.timedelta64("NaT") if kind == "a duration" else np.datetime64("NaT")
    values = np.array([missing if time is None else time for time in times])
    zone = next(iter(zones), None)
    return Labels(values, name, zone if len(zones) < 2 else datetime.timezone.utc)


def _of_object(argument: str, entry: Any, row: int) -> tuple[Any, str | None, Any]:
    """A time, of which kind it is, and its zone; all None of what is missing."""
    with_zone, without, lasts = "an instant with a time zone", "an instant", "a duration"
    if _is_missing(entry):
        return None, None, None
    if isinstance(entry, str):
        return _of_text(argument, entry, row)
    if hasattr(entry, "to_timestamp"):
        # A period begins at an instant.
        entry = entry.to_timestamp()
    if isinstance(entry, np.datetime64):
        return entry, without, None
    if isinstance(entry, datetime.datetime):
        zone = entry.tzinfo
        if hasattr(entry, "to_datetime64"):
            # pandas has nanoseconds; with a zone these are in UTC.
            return entry.to_datetime64(), without if zone is None else with_zone, zone
        if zone is None:
            return np.datetime64(entry, "us"), without, None
        return np.datetime64(entry.astimezone(datetime.timezone.utc).replace(tzinfo=None), "us"), with_zone, zone
    if isinstance(entry, datetime.date):
        return np.datetime64(entry, "D"), without, None
    if isinstance(entry, (datetime.timedelta, np.timedelta64)):
        return duration(entry), lasts, None
    if _numbers.is_number(entry):
        return None, "a number", None
    raise TypeError(f"{argument}: row {row} is no time but {entry!r}; give instants, durations, or seconds")


def _is_missing(entry: Any) -> bool:
    """Whether no time is there: None, NA, NaT, NaN."""
    return _numbers.is_null(entry) or (isinstance(entry, (float, datetime.datetime, np.generic)) and bool(entry != entry))


def _of_text(argument: str, text: str, row: int) -> tuple[Any, str, Any]:
    found = ISO_8601.fullmatch(text.strip())
    try:
        if found is None:
            raise ValueError
        date, time, offset = found.groups()
        instant = np.datetime64(date if time is None else f"{date}T{time.replace(',', '.')}")
        if offset is None:
            return instant, "an instant", None
        hours = offset.upper().replace("Z", "+00").replace(":", "")
        minutes = int(hours[0] + "1") * (60 * int(hours[1:3]) + int(hours[3:] or 0))
        zone = datetime.timezone(datetime.timedelta(minutes=minutes)) if minutes else datetime.timezone.utc
        return instant - np.timedelta64(minutes, "m"), "an instant with a time zone", zone
    except ValueError:
        message = f"{argument}: row {row} is {text!r}, no time in ISO 8601 such as 2026-03-01T12:00:00.5+01:00; parse it first"
        raise ValueError(f"{message} (to_datetime in pandas and Polars)") from None


def are_times(objects: Iterable[Any]) -> bool:
    """Whether objects are times, or texts of instants: what they begin with tells. Numbers are not."""
    first = next((entry for entry in objects if not _is_missing(entry)), None)
    if isinstance(first, str):
        return ISO_8601.fullmatch(first.strip()) is not None
    return isinstance(first, (datetime.date, datetime.timedelta)) or hasattr(first, "to_timestamp")


def common_index(rows: Sequence[tuple[str, Any]]) -> Any:
    """The index that all arguments of pandas share; None where there is none of pandas."""
    common, owner = None, ""
    for argument, value in rows:
        if not (is_pandas_like_series(value) or is_pandas_like_dataframe(value)):
            continue
        index = value.index
        if common is None:
            common, owner = index, argument
        elif index is not common and len(index) == len(common) and not index.equals(common):
            raise ValueError(
                f"{argument}: its index is not that of {owner}, so it is open which rows belong together; align them first "
                f"({owner}.align({argument}) in pandas), or give to_numpy() of both"
            )
    return common


def of_index(index: Any) -> Clock | None:
    """The clock that an index of pandas is: instants, days, periods, durations, texts of instants, or numbers since 1970."""
    labels = labels_of(index)
    called = "the index" if labels.name is None else f"the index {labels.name!r}"
    labels = labels.dated(called)
    if labels.are_times:
        return Clock(f"by {called}", labels)
    if labels.values.dtype.kind != "O" or not are_times(labels.values):
        return None
    # The index itself goes back to frames.
    return Clock(f"by {called}", read(called, labels.values, labels.name), labels)


def labels_of(index: Any) -> Labels:
    """What an index of pandas holds, times as times."""
    if index.nlevels > 1:
        return Labels(_objects(index), tuple(index.names))
    kind = getattr(index.dtype, "kind", "O")
    if kind in "mM":
        return read("index", index)
    return Labels(np.asarray(index) if kind in "biuf" else np.asarray(index, dtype=object), index.name)


def _objects(index: Any) -> NDArray[Any]:
    """The tuples of an index with several levels, one in each row."""
    values = np.empty(len(index), dtype=object)
    values[:] = list(index)
    return values


def assumed(index: Any) -> Clock:
    """That of rows a second apart, of which nothing else is known but an index of pandas that is no clock, or None."""
    if index is None:
        return Clock("assumed")
    labels = labels_of(index)
    if labels.values.dtype.kind not in "iuf":
        return Clock("assumed", None, labels)
    steps = np.unique(np.diff(labels.values))
    if labels.values.dtype.kind in "iu" and (len(steps) == 0 or (steps == 1).all()):
        return Clock("assumed, as the index is a counter", None, labels)
    how = "name it, and give its name as time" if labels.name is None else f"time={labels.name!r} takes it as seconds"
    _said.warn(f"the index holds numbers and may be a clock; {how}; 1 s from row to row is assumed")
    return Clock("assumed, as the index holds numbers", None, labels)


def duration(value: Any) -> np.timedelta64:
    """A duration of Python, NumPy or pandas."""
    if hasattr(value, "to_timedelta64"):
        return np.timedelta64(value.to_timedelta64())
    return value if isinstance(value, np.timedelta64) else np.timedelta64(value, "us")


def _written(instant: np.datetime64) -> str:
    text = str(np.datetime_as_string(instant))
    return text.rstrip("0").rstrip(".") if "." in text else text


def _tzinfo(zone: Any) -> datetime.tzinfo | None:
    if isinstance(zone, datetime.tzinfo):
        return zone
    try:
        made: datetime.tzinfo = import_module("zoneinfo").ZoneInfo(str(zone))
    except (KeyError, ValueError):
        # Python knows no zones here, or not this one.
        return None
    return made


def imported(name: str) -> Any:
    """A package that not everybody has."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs {name}, which cannot be imported ({error}): pip install {name}") from error

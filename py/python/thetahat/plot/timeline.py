"""Where rows lie on an axis of time: at dates, where the clock of the log has them, else at seconds."""

from __future__ import annotations

import datetime
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib import dates

from thetahat.base.clock import Clock, Labels
from thetahat.logs.log import Log

Array = npt.NDArray[np.float64]

_DATES: Any = dates
"""Matplotlib has no types for these."""

_SHORTEST = 1e-5
"""Seconds between rows that dates still show: matplotlib counts days, in float64 to about a microsecond."""

_DAY = 86_400.0
"""Seconds."""


class Timeline(NamedTuple):
    """The rows of a log or of a trajectory on an axis of time."""

    x: Array
    """Seconds, or days since 1970, as matplotlib counts dates."""
    breaks: npt.NDArray[np.intp]
    """The rows at which a line begins anew: after a gap of the clock, and where an experiment begins."""
    boundaries: Array
    """Between each experiment and the one before it."""
    dates: Labels | None
    """The dates; None where x is seconds."""

    @classmethod
    def of_log(cls, log: Log) -> Timeline:
        """Dates where the rows have them in their order, unless most of the axis would lie between experiments. Of seconds
        each experiment begins one sample after the one before it."""
        seconds, experiments = log.time, log.experiments
        gaps = np.flatnonzero(np.diff(seconds) > 1.5 * log.sample_time) + 1
        starts = np.array([rows.start for rows in experiments[1:]], dtype=np.intp)
        dates = _dates(log._clock, log.sample_time, len(log))
        x = seconds
        if dates is not None:
            x = _DATES.date2num(dates.values)
            covered = sum(float(x[rows.stop - 1] - x[rows.start]) for rows in experiments)
            if not (np.diff(x) > 0).all() or x[-1] - x[0] > 2 * covered:
                dates, x = None, seconds
        if dates is None:
            x = x.copy()
            for rows in experiments[1:]:
                x[rows.start : rows.stop] += x[rows.start - 1] + log.sample_time - x[rows.start]
        return cls(x, np.union1d(gaps, starts).astype(np.intp), (x[starts - 1] + x[starts]) / 2, dates)

    @classmethod
    def of_rows(cls, seconds: Array, clock: Clock) -> Timeline:
        """That of a trajectory, whose lines break where rows are missing, or where another experiment begins."""
        steps = np.diff(seconds)
        usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        breaks = np.flatnonzero((steps > 1.5 * usual) | (steps <= 0)) + 1
        dates = _dates(clock, usual, len(seconds))
        x = seconds if dates is None else _DATES.date2num(dates.values)
        if not (np.diff(x) > 0).all():
            dates, x = None, seconds
        return cls(x, breaks, np.empty(0), dates)

    def part(self, start: int, stop: int) -> Timeline:
        """That of some rows."""
        inside = self.breaks[(self.breaks > start) & (self.breaks < stop)] - start
        x = self.x[start:stop]
        between = self.boundaries[(self.boundaries > x[0]) & (self.boundaries < x[-1])]
        return self._replace(x=x, breaks=inside, boundaries=between)

    def after(self, row: int, seconds: Array, clock: Clock) -> Array:
        """The x of instants this long after the row before one, whose dates a clock may have."""
        origin = float(self.x[row - 1])
        if self.dates is None:
            return origin + seconds
        if clock.times is not None and clock.times.values.dtype.kind == "M":
            return np.asarray(_DATES.date2num(clock.times.values), dtype=np.float64)
        return origin + seconds / _DAY

    def broken(self, *values: Array) -> list[Array]:
        """The times, and values, with a break of the line where one begins anew."""
        return [np.insert(one, self.breaks, np.nan) for one in (self.x, *values)]

    def onto(self, axes: npt.NDArray[Any]) -> None:
        """What the x axes say, the label below the last row of them; a line between experiments."""
        zone = None if self.dates is None else self.dates.tzinfo or datetime.timezone.utc
        for ax in axes.flat:
            for x in self.boundaries:
                ax.axvline(x, color="0.7", linewidth=0.8, linestyle=":")
            if zone is not None:
                locator = _DATES.AutoDateLocator(tz=zone, minticks=3, maxticks=8)
                ax.xaxis.set_major_locator(locator)
                ax.xaxis.set_major_formatter(_DATES.ConciseDateFormatter(locator, tz=zone))
                if len(self.x) == 1:
                    # The day around it; matplotlib would take four years.
                    ax.set_xlim(self.x[0] - 0.5, self.x[0] + 0.5)
        for ax in np.atleast_1d(axes[-1]):
            ax.set_xlabel(self._label)

    @property
    def _label(self) -> str:
        if self.dates is None:
            return "time [s]"
        if self.dates.zone is None:
            return "time"
        return f"time ({'UTC' if self.dates.tzinfo is None else self.dates.zone_name})"


def _dates(clock: Clock, sample_time: float, rows: int) -> Labels | None:
    """The dates of a clock, where it has some that an axis can show."""
    times = clock.times
    known = times is not None and times.values.dtype.kind == "M" and len(times.values) == rows
    return times if known and sample_time >= _SHORTEST else None

"""What trackers made of rows."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat._thetahat import Alarm
from thetahat.base import clock as _clock, picture as _picture
from thetahat.engine import options as _options
from thetahat.online import rows as _rows

Array = npt.NDArray[np.float64]


def shaped(tracker: _thetahat.Tracker, values: npt.NDArray[Any], axis: int) -> npt.NDArray[Any]:
    """The axis of trackers as one of outputs, in its place, and one of ways to forget, the last; neither where there is one."""
    ways, outputs = len(tracker.policies), len(tracker.outputs)
    apart = values.reshape(*values.shape[:axis], ways, outputs, *values.shape[axis + 1 :])
    apart = apart.squeeze(axis + 1) if outputs == 1 else apart
    return apart.squeeze(axis) if ways == 1 else np.moveaxis(apart, axis, -1)


class Tracked(NamedTuple):
    """What a tracker made of a row.

    With several outputs, numbers are arrays with one for each; with several ways to forget they have a last axis for these.
    """

    predicted: float | Array
    """The one-step prediction, from all rows before and the inputs of this one; NaN if there is none."""
    error: float | Array
    """The innovation: the output less its prediction; NaN if one of the two is missing."""
    variance: float | Array
    """The variance of the innovation; NaN until the noise variance is known."""
    nis: float | Array
    """The normalised innovation squared: 1 on average. NaN where the variance is not known."""
    action: str | npt.NDArray[np.str_]
    """What was done with the row, see `Innovation`; "too large" of a value that was taken for missing."""
    excitation: float | Array
    """How much is known of the parameter that least is known of, 0 to 1. Below 0.5 or so, do not rely on the parameters."""
    forecast: float | Array
    """The output ``horizon`` rows later; NaN if there is none, or none was asked for."""
    alarms: list[Alarm]
    """The changes that were noticed; their row is this one, counted from 0 since the first."""


class TrackTrajectory:
    """What a `Tracker` made of many rows.

    With several outputs, all but `time` have an axis with one place for each after that of the rows. With several ways to forget, all but
    `time` and `measured` have a last axis for these.

    Attributes
    ----------
    time : ndarray, shape (N,)
        Seconds.
    measured : ndarray, shape (N,)
        The outputs of the log.
    predicted : ndarray, shape (N,)
        The one-step predictions, in the units of the log; NaN where there is none.
    errors, variances : ndarray, shape (N,)
        The innovations and their variances; NaN where there is none.
    nis : ndarray, shape (N,)
        The normalised innovations squared; NaN where the variance is not known.
    excitation : ndarray, shape (N,)
        How much is known of the parameter that least is known of, 0 to 1.
    forecasts : ndarray, shape (N,)
        The outputs ``horizon`` rows later; NaN if that was not asked for.
    parameters, standard_errors : ndarray, shape (N, n)
        The parameters after each row, and their standard errors; NaN where they are not known.
    actions : ndarray of str, shape (N,)
        What was done with each row, see `Innovation`; "too large" of a value that was taken for missing.
    alarms : list of Alarm
        The changes that were noticed, row by row.
    parameter_names : list of str
        Such as ``a1``, ``b1``, ``constant``.
    outputs : list of str
        The channels of the outputs.
    forgetting : list of str
        The ways to forget.
    """

    predicted: Array
    errors: Array
    variances: Array
    nis: Array
    excitation: Array
    forecasts: Array
    parameters: Array
    standard_errors: Array
    actions: npt.NDArray[np.str_]
    alarms: list[Alarm]

    def __init__(
        self, tracker: _thetahat.Tracker, sample_time: float | None, rows: _rows.Rows, found: dict[str, Any]
    ) -> None:
        taken, count = found.pop("taken"), len(tracker.policies) * len(tracker.outputs)
        self.alarms = found.pop("alarms")
        too_large = found.pop("too_large").reshape(taken, count)
        found["actions"] = np.where(too_large, "too large", found["actions"].reshape(taken, count))
        for name, values in found.items():
            setattr(self, name, shaped(tracker, values[:taken], 1))
        self.time = rows.time(1.0 if sample_time is None else sample_time)[:taken]
        self.measured = rows.outputs[:taken] if len(tracker.outputs) > 1 else rows.outputs[:taken, 0]
        self.parameter_names = tracker.names
        self.outputs = tracker.outputs
        self.forgetting = tracker.policies
        self._clock = rows.clock.part(0, taken)
        self._horizon = tracker.horizon
        self._watched = tracker.watched

    def to_pandas(self, tracker: int = 0) -> Any:
        """A data frame of pandas with the index that the log came with; its columns are those of ``thetahat track``.

        With several outputs each has its columns, with its name at their end: ``predicted_y1``.

        Parameters
        ----------
        tracker : int, default 0
            Which of several ways to forget, counted from 0.

        Examples
        --------
        >>> import thetahat as th
        >>> frame = th.Tracker(na=2, nb=2).run(th.dc_motor()).to_pandas()
        >>> frame.columns.tolist()[:6]
        ['action', 'measured', 'predicted', 'innovation', 'innovation_sd', 'nis']
        >>> frame[["a1", "a2", "b1", "b2"]].tail(1).to_numpy().round(2)
        array([[-1.56,  0.6 ,  0.38,  0.27]])
        """
        return _clock.to_pandas(self._clock, self.time, self._columns(tracker))

    def to_polars(self, tracker: int = 0) -> Any:
        """As `to_pandas`, for Polars: the times are the first column."""
        return _clock.to_polars(self._clock, self.time, self._columns(tracker))

    def _of(self, values: npt.NDArray[Any], tracker: int, output: int = 0) -> npt.NDArray[Any]:
        """The part of one way to forget and one output."""
        mine = values if len(self.forgetting) == 1 else values[..., tracker]
        return mine if len(self.outputs) == 1 else mine[:, output]

    def _place(self, tracker: int) -> int:
        place = _options.integer("tracker", tracker)
        if not 0 <= place < len(self.forgetting):
            raise ValueError(f"tracker: there is no tracker {place}; there are {len(self.forgetting)}, counted from 0")
        return place

    def _output(self, output: str | None) -> int:
        """The place of an output."""
        if output is None and len(self.outputs) > 1:
            raise ValueError(f"output: there are several; name one of {', '.join(self.outputs)}")
        name = self.outputs[0] if output is None else _options.text("output", output)
        if name not in self.outputs:
            raise ValueError(f"output: {name!r} is none of {', '.join(self.outputs)}")
        return self.outputs.index(name)

    def _alarms(self, tracker: int, output: int) -> list[Alarm]:
        policy = self.forgetting[tracker] if len(self.forgetting) > 1 else None
        name = self.outputs[output] if len(self.outputs) > 1 else None
        return [alarm for alarm in self.alarms if (alarm.forgetting, alarm.output) == (policy, name)]

    def _columns(self, tracker: int) -> dict[str, Any]:
        place = self._place(tracker)
        if len(self.outputs) == 1:
            return self._columns_of(place, 0)
        columns: dict[str, Any] = {}
        for output, name in enumerate(self.outputs):
            columns |= {f"{column}_{name}": values for column, values in self._columns_of(place, output).items()}
        return columns

    def _columns_of(self, place: int, output: int) -> dict[str, Any]:
        columns: dict[str, Any] = {
            "action": self._of(self.actions, place, output),
            "measured": self.measured if len(self.outputs) == 1 else self.measured[:, output],
            "predicted": self._of(self.predicted, place, output),
            "innovation": self._of(self.errors, place, output),
            "innovation_sd": np.sqrt(self._of(self.variances, place, output)),
            "nis": self._of(self.nis, place, output),
            "excitation": self._of(self.excitation, place, output),
        }
        if self._horizon is not None:
            columns["forecast"] = self._of(self.forecasts, place, output)
        for suffix, values in (("", self.parameters), ("_se", self.standard_errors)):
            found = self._of(values, place, output)
            columns |= {f"{name}{suffix}": found[:, column] for column, name in enumerate(self.parameter_names)}
        if self._watched:
            charts, statistics = np.full(len(self), "", dtype="U9"), np.full(len(self), np.nan)
            samples = np.full(len(self), np.nan)
            for alarm in self._alarms(place, output):
                charts[alarm.row], statistics[alarm.row], samples[alarm.row] = alarm.chart, alarm.statistic, alarm.samples
            columns |= {"chart": charts, "statistic": statistics, "samples": samples}
        return columns

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        outputs = "" if len(self.outputs) == 1 else f" of {len(self.outputs)} outputs"
        several = "" if len(self.forgetting) == 1 else f", {len(self.forgetting)} ways to forget"
        alarms = f", {len(self.alarms)} alarm{'' if len(self.alarms) == 1 else 's'}" if self._watched else ""
        return f"TrackTrajectory({len(self)} rows, parameters {', '.join(self.parameter_names)}{outputs}{several}{alarms})"

    def _repr_html_(self) -> str:
        values = self._of(self.parameters, 0)
        return _picture.rows(repr(self), [(name, [values[:, place]]) for place, name in enumerate(self.parameter_names)])

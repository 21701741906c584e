"""Pictures of what estimators leave along a log: states, parameters and changes. `thetahat.plot` has them."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt

from thetahat._thetahat import ChangeTrajectory
from thetahat.engine import options as _options
from thetahat.online.filter import StateTrajectory
from thetahat.online.tracked import TrackTrajectory
from thetahat.plot import drawing as _drawing
from thetahat.plot.timeline import Timeline

Grid = npt.NDArray[Any]
"""An array of matplotlib axes."""

_CHARTS = ("mean_up", "mean_down", "variance")
"""The charts of a change detector, in their order."""


def states(trajectory: StateTrajectory, axes: Any = None, *, level: float = 0.95) -> Grid:
    """The states of a model along a log, its unknown parameters, and how the innovations lie.

    Each state is drawn given all rows if the run was smoothed, else given the rows so far; of an observer given the rows before.

    Parameters
    ----------
    trajectory : StateTrajectory
        Of `thetahat.StateFilter.run`.
    axes : array_like of Axes, shape (states + parameters + 1,), optional
        Where to draw: the last one has the normalised innovations squared (NIS) with their 95 % bounds. Of an observer,
        which knows no noise, there is one less.
    level : float, default 0.95
        The probability with which the band holds the state.

    Returns
    -------
    ndarray of Axes, shape (states + parameters + 1,)

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> filter = th.StateFilter(th.arx(th.dc_motor(), na=2, nb=2))
    >>> [ax.get_ylabel() for ax in plot.states(filter.run(th.dc_motor()))]
    ['x1', 'x2', 'NIS']
    """
    _drawing.expect("trajectory", trajectory, StateTrajectory)
    half = _options.quantile(level)
    observes = bool(np.isnan(trajectory.predicted_deviations).all())
    if trajectory.smoothed is not None:
        assert trajectory.smoothed_deviations is not None
        given, known, deviations = "given all rows", trajectory.smoothed, trajectory.smoothed_deviations
    elif observes:
        given, known, deviations = "given the rows before", trajectory.predicted, trajectory.predicted_deviations
    else:
        given, known, deviations = "given the rows so far", trajectory.filtered, trajectory.filtered_deviations
    smoothed = trajectory.smoothed_parameters, trajectory.smoothed_parameter_deviations
    unknown, spreads = (
        (trajectory.parameters, trajectory.parameter_deviations) if smoothed[0] is None or smoothed[1] is None else smoothed
    )
    assert unknown is not None and spreads is not None
    names = [*trajectory.state_names, *trajectory.parameter_names]
    values, deviations = np.hstack([known, unknown]), np.hstack([deviations, spreads])
    grid = _drawing.grid(axes, len(names) + (not observes), 1)[:, 0]
    timeline = Timeline.of_rows(trajectory.time, trajectory._clock)
    for place, (ax, name) in enumerate(zip(grid, names)):
        time, drawn, spread = timeline.broken(values[:, place], half * deviations[:, place])
        line = _drawing.curve(ax, time, drawn, linewidth=1.0, label=given)
        band = _drawing.band(ax, time, drawn - spread, drawn + spread, line.get_color())
        _drawing.label_one([band], level)
        # What is not known yet would make a line of what is.
        late = values[len(values) // 2 :, place], (half * deviations)[len(values) // 2 :, place]
        ends = [late[0]] if observes else [late[0] - late[1], late[0] + late[1]]
        _drawing.scale_to(ax, ends, [] if observes else [drawn - spread, drawn + spread])
        _drawing.ylabel(ax, name)
    _drawing.legend(grid)
    if not observes:
        ax = grid[-1]
        time, nis, low, high = timeline.broken(trajectory.nis, *trajectory.nis_bounds.T)
        _drawing.curve(ax, time, nis, marker=".", markersize=3, linestyle="none")
        _drawing.curve(ax, time, low, color="0.5", linewidth=0.8, label="95 % bounds")
        _drawing.curve(ax, time, high, color="0.5", linewidth=0.8)
        ax.set_ylabel("NIS")
        _drawing.legend(ax)
    timeline.onto(grid)
    return grid


def parameters(trajectory: TrackTrajectory, axes: Any = None, *, output: str | None = None, level: float = 0.95) -> Grid:
    """The parameters of a tracked model over time, with its alarms.

    Parameters
    ----------
    trajectory : TrackTrajectory
        Of `thetahat.Tracker.run`. Several ways to forget are drawn one over the other.
    axes : array_like of Axes, shape (parameters,), of several outputs (parameters, outputs), optional
        Where to draw.
    output : str, optional
        Of which of several outputs; of all of them, unless said otherwise.
    level : float, default 0.95
        The probability with which the band holds the parameter.

    Returns
    -------
    ndarray of Axes, shape (parameters,), of several outputs (parameters, outputs)

    Examples
    --------
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> tracker = th.Tracker(na=2, nb=2, forgetting=[0.98, None])
    >>> axes = plot.parameters(tracker.run(th.dc_motor()))
    >>> [ax.get_ylabel() for ax in axes]
    ['a1', 'a2', 'b1', 'b2']
    >>> [text.get_text() for text in axes[0].get_legend().get_texts()]
    ['exponential:0.98', '95 % band', 'none']
    """
    _drawing.expect("trajectory", trajectory, TrackTrajectory)
    half = _options.quantile(level)
    outputs = trajectory.outputs if output is None else [trajectory.outputs[trajectory._output(output)]]
    several = len(outputs) > 1
    timeline = Timeline.of_rows(trajectory.time, trajectory._clock)
    grid = _drawing.grid(axes, len(trajectory.parameter_names), len(outputs))
    for column, of_output in enumerate(outputs):
        _parameters_of(trajectory, of_output, grid[:, column], timeline, half, level)
        if several:
            _drawing.title(grid[0, column], of_output)
    timeline.onto(grid)
    _drawing.legend(grid)
    return grid if several else grid[:, 0]


def _parameters_of(
    trajectory: TrackTrajectory, output: str, axes: Grid, timeline: Timeline, half: float, level: float
) -> None:
    """Those of one output."""
    of_output = trajectory._output(output)
    for column, (ax, name) in enumerate(zip(axes, trajectory.parameter_names)):
        bands, late, all_drawn = [], [], []
        for place, policy in enumerate(trajectory.forgetting):
            values = trajectory._of(trajectory.parameters, place, of_output)[:, column]
            errors = trajectory._of(trajectory.standard_errors, place, of_output)[:, column]
            time, drawn, spread = timeline.broken(values, half * errors)
            line = _drawing.curve(ax, time, drawn, linewidth=1.0, label=policy)
            bands.append(_drawing.band(ax, time, drawn - spread, drawn + spread, line.get_color()))
            late.append(values[len(values) // 2 :])
            all_drawn += [drawn, drawn - spread, drawn + spread]
        _drawing.label_one(bands, level)
        # What is not known yet would make a line of what is.
        _drawing.scale_to(ax, late, all_drawn)
        mine = [alarm.row for alarm in trajectory.alarms if alarm.output in (None, output)]
        rows = sorted({row for row in mine if row is not None})
        for number, row in enumerate(rows):
            label = {"label": "alarm"} if number == 0 else {}
            ax.axvline(timeline.x[row], color="0.5", linewidth=0.8, linestyle=":", **label)
        _drawing.ylabel(ax, name)


def changes(trajectory: ChangeTrajectory, axes: Any = None) -> Grid:
    """The charts of a change detector with their thresholds and alarms.

    Parameters
    ----------
    trajectory : ChangeTrajectory
        Of `thetahat.ChangeDetector.run`.
    axes : array_like of Axes, shape (charts,), optional
        Where to draw. Charts that are turned off have none.

    Returns
    -------
    ndarray of Axes, shape (charts,)

    Raises
    ------
    ValueError
        If all charts are turned off.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> from thetahat import plot
    >>> errors = np.random.default_rng(1).standard_normal(200)
    >>> axes = plot.changes(th.ChangeDetector.with_thresholds(4.0, 6.0).run(errors, np.ones(200)))
    >>> [ax.get_ylabel() for ax in axes]
    ['mean up', 'mean down', 'variance']
    """
    _drawing.expect("trajectory", trajectory, ChangeTrajectory)
    charts = [place for place, threshold in enumerate(trajectory.thresholds) if isfinite(threshold)]
    if not charts:
        raise ValueError("trajectory: all charts are turned off; there is nothing to draw")
    grid = _drawing.grid(axes, len(charts), 1)[:, 0]
    for ax, place in zip(grid, charts):
        name = _CHARTS[place]
        ax.plot(trajectory.statistics[:, place], linewidth=1.0)
        ax.axhline(trajectory.thresholds[place], color="0.5", linewidth=0.8, linestyle="--", label="threshold")
        given = [(alarm.row, alarm.statistic) for alarm in trajectory.alarms if alarm.chart == name]
        if given:
            ax.plot(*zip(*given), "v", markersize=5, fillstyle="none", label="alarm")
        ax.set_ylabel(name.replace("_", " "))
    _drawing.legend(grid)
    grid[-1].set_xlabel("row")
    return grid

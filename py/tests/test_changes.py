"""The change detector: against its recursion in NumPy, the command line, and itself."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th

Array = NDArray[np.float64]
ROWS = 400


def stepped() -> tuple[Array, Array]:
    """Innovations whose mean rises, and whose variance grows later; their variances."""
    random = np.random.default_rng(3)
    errors = 2.0 * random.standard_normal(ROWS)
    errors[150:170] += 4.0
    errors[300:330] *= 4.0
    errors[40] = np.nan
    variances = np.full(ROWS, 4.0)
    variances[50] = np.nan
    return errors, variances


def charts(errors: Array, variances: Array, thresholds: Array) -> tuple[Array, list[tuple[int, int]]]:
    """The recursion of Page, written down again: the charts after each row, and rows and charts of alarms."""
    sums, rows, alarms = np.zeros(3), [], []
    for row, (error, variance) in enumerate(zip(errors, variances)):
        if np.isfinite(error) and np.isfinite(variance):
            z = error / math.sqrt(variance)
            sums = np.maximum(0, sums + np.array([z - 0.5, -z - 0.5, (z * z / 2 - math.log(2)) / 2]))
            if (sums > thresholds).any():
                alarms.append((row, int(np.argmax(sums / thresholds))))
                sums = np.where(sums > thresholds, 0.0, sums)
        rows.append(sums)
    return np.array(rows), alarms


def test_it_is_the_recursion_of_page() -> None:
    detector = th.ChangeDetector.with_thresholds(5.0, 7.0)
    changes = detector.run(*stepped())
    rows, alarms = charts(*stepped(), detector.thresholds)
    np.testing.assert_allclose(changes.statistics, rows, rtol=1e-12, atol=1e-12)
    words = ["mean_up", "mean_down", "variance"]
    assert [(alarm.row, alarm.chart) for alarm in changes.alarms] == [(row, words[chart]) for row, chart in alarms]
    assert {alarm.chart for alarm in changes.alarms} >= {"mean_up", "variance"}
    first = changes.alarms[0]
    assert first.row is not None and abs(first.row + 1 - first.samples - 150) <= 3 and first.statistic > 5
    assert len(changes) == ROWS and changes.thresholds.tolist() == [5.0, 5.0, 7.0]
    assert repr(changes) == f"ChangeTrajectory(400 rows, {len(alarms)} alarms)"


def test_thresholds_follow_from_the_interval() -> None:
    detector = th.ChangeDetector(10_000)
    np.testing.assert_allclose(detector.thresholds[:2], 8.75, atol=0.01)
    several = th.ChangeDetector(interval=1000.0, outputs=3)
    assert several.outputs == 3 and np.isinf(several.thresholds[:2]).all() and several.thresholds[2] > 0
    assert repr(detector).startswith("ChangeDetector(outputs=1, mean_threshold=8.7")


def test_samples_in_a_loop_and_a_run_are_the_same() -> None:
    errors, variances = stepped()
    loop, run = (th.ChangeDetector.with_thresholds(5.0, 7.0) for _ in range(2))
    estimator = th.RecursiveLeastSquares(1, None)
    given, innovations = [], []
    for row, y in enumerate(errors):
        innovation = estimator.update([1.0], y)
        innovations.append((innovation.error, innovation.variance))
        alarm = loop.update(innovation)
        if alarm is not None:
            assert alarm.row is None
            given.append((row, alarm.chart, alarm.statistic, alarm.samples))
    changes = run.run(*np.array(innovations).T)
    assert given == [(alarm.row, alarm.chart, alarm.statistic, alarm.samples) for alarm in changes.alarms]
    np.testing.assert_array_equal(loop.statistics, run.statistics)
    np.testing.assert_array_equal(loop.statistics, changes.statistics[-1])
    assert given


def test_several_outputs_are_watched_by_their_square() -> None:
    random = np.random.default_rng(5)
    transition = th.LinearTransition(0.9 * np.eye(2), 0.1 * np.eye(2))
    observation = th.LinearObservation(np.eye(2), np.eye(2))
    measurements = random.standard_normal((300, 2))
    measurements[200:] *= 3.0
    measurements[20, 1] = measurements[30, 0] = measurements[30, 1] = np.nan
    trajectory = th.KalmanFilter(np.zeros(2), np.eye(2)).run(transition, observation, measurements)
    detector = th.ChangeDetector(1000, 2)
    changes = detector.run(trajectory.errors, trajectory.variances, nis=trajectory.nis)
    found = [alarm.row for alarm in changes.alarms if alarm.row is not None]
    assert found and min(found) >= 200 and {alarm.chart for alarm in changes.alarms} == {"variance"}
    filter, loop = th.KalmanFilter(np.zeros(2), np.eye(2)), th.ChangeDetector(1000, 2)
    for row, y in enumerate(measurements):
        loop.update(filter.update(y, observation=observation))
        filter.predict(transition)
        np.testing.assert_array_equal(loop.statistics, changes.statistics[row])
    # A filter of one output gives columns, which do as they are.
    one = th.KalmanFilter([0.0], [[1.0]])
    single = one.run(th.LinearTransition([[1.0]], [[1e-4]]), th.LinearObservation([[1.0]], [[1.0]]), measurements[:, 0])
    assert th.ChangeDetector(1000).run(single.errors, single.variances).alarms


def test_it_pickles_and_goes_on_to_the_bit() -> None:
    errors, variances = stepped()
    whole = th.ChangeDetector.with_thresholds(5.0, math.inf)
    changes = whole.run(errors, variances)
    half = th.ChangeDetector.with_thresholds(5.0, math.inf)
    half.run(errors[:160], variances[:160])
    for again in (pickle.loads(pickle.dumps(half)), copy.deepcopy(half)):
        rest = again.run(errors[160:], variances[160:])
        np.testing.assert_array_equal(rest.statistics, changes.statistics[160:])
        np.testing.assert_array_equal(again.thresholds, whole.thresholds)
    same = pickle.loads(pickle.dumps(changes))
    np.testing.assert_array_equal(same.statistics, changes.statistics)
    assert same.alarms == changes.alarms and changes.alarms
    alarm = changes.alarms[0]
    assert repr(alarm).startswith("Alarm(chart='mean_up', statistic=5.")
    assert alarm != "mean_up" and pickle.loads(pickle.dumps(alarm)) == alarm
    whole.reset()
    assert whole.statistics.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, math.inf], [1.0, 1.0]), "row 2: errors is infinite"),
        (([], []), "errors: expected at least one entry"),
        (([1.0, 2.0], [1.0]), r"variances: expected 2 entries, found shape \(1,\)"),
        ((np.ones((3, 2)), np.ones((3, 2))), r"errors: expected shape \(any, 1\), found shape \(3, 2\)"),
        (([1.0], [1.0], [1.0, 2.0]), "nis: expected 1 entry"),
        (([1.0], [1.0], [math.inf]), "row 1: nis is infinite"),
    ],
)
def test_bad_arrays_change_nothing(arguments: tuple[Any, ...], message: str) -> None:
    detector = th.ChangeDetector.with_thresholds(5.0, 7.0)
    detector.run([1.5], [1.0])
    before = detector.statistics
    with pytest.raises(ValueError, match=message):
        detector.run(*arguments[:2], nis=arguments[2] if len(arguments) > 2 else None)
    np.testing.assert_array_equal(detector.statistics, before)


def test_bad_arguments() -> None:
    for interval in (9.0, 1e10, math.nan, math.inf):
        with pytest.raises(ValueError, match="^interval: .* is not a number of samples from 10 to 1e9"):
            th.ChangeDetector(interval)
    with pytest.raises(TypeError, match="interval: expected a number"):
        th.ChangeDetector("often")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="outputs: expected an int from 1 to 1000, found 0"):
        th.ChangeDetector(100, 0)
    for threshold in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="mean_threshold"):
            th.ChangeDetector.with_thresholds(threshold, 1.0)
        with pytest.raises(ValueError, match="variance_threshold"):
            th.ChangeDetector.with_thresholds(1.0, threshold)
    two = th.ChangeDetector.with_thresholds(5.0, 7.0, outputs=2)
    with pytest.raises(ValueError, match="innovation: expected 2 entries, found 1"):
        two.update(th.RecursiveLeastSquares(1).update([1.0], 1.0))
    with pytest.raises(ValueError, match="nis: expected 2 entries, found None"):
        two.run(np.ones((2, 2)), np.ones((2, 2)))
    with pytest.raises(TypeError):
        two.update(1.0)  # type: ignore[arg-type]

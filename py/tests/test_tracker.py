"""Trackers: the same numbers, states and documents as the command line, whatever they are fed with."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

import thetahat as th

Array = NDArray[np.float64]
PROGRAM = Path(sys.executable).with_name("thetahat")
LOG = "thetahat-demo/dc_motor.csv"


def program(folder: Path, *words: str, code: int = 0) -> str:
    found = subprocess.run([str(PROGRAM), *words], cwd=folder, capture_output=True, text=True, check=False)
    assert found.returncode == code, found.stderr
    return found.stdout


def tracked(folder: Path, *words: str, code: int = 0) -> tuple[list[dict[str, Any]], str, str]:
    """What `thetahat track` writes: its lines, its state and its document."""
    (folder / "state.json").unlink(missing_ok=True)
    text = program(folder, "track", *words, "--state=state.json", "--summary=summary.json", "--quiet", code=code)
    lines = [json.loads(line) for line in text.splitlines()]
    return lines, (folder / "state.json").read_text(), (folder / "summary.json").read_text()


def same(trajectory: th.TrackTrajectory, lines: list[dict[str, Any]]) -> None:
    """That a run has the bits of the lines."""
    for place, policy in enumerate(trajectory.forgetting):
        mine = [line for line in lines if line.get("forgetting", policy) == policy]
        expected = pd.DataFrame([line for line in mine if line["event"] == "sample"])
        found = trajectory.to_pandas(place)
        watched = [found.pop(name) for name in ("chart", "statistic", "samples") if name in found]
        expected = expected.drop(columns=["event", "row", "time", "forgetting"], errors="ignore")
        assert list(found.columns) == list(expected.columns)
        for name in found.columns:
            if found[name].dtype.kind == "f":
                np.testing.assert_array_equal(found[name].to_numpy(), expected[name].to_numpy(dtype=float), err_msg=name)
            else:
                assert found[name].tolist() == expected[name].tolist(), name
        alarms = [line for line in mine if line["event"] == "alarm"]
        given = [alarm for alarm in trajectory.alarms if alarm.forgetting in (None, policy)]
        assert [(line["row"] - 1, line["chart"], line["statistic"], line["samples"]) for line in alarms] == [
            (alarm.row, alarm.chart, alarm.statistic, alarm.samples) for alarm in given
        ]
        if watched:
            assert np.flatnonzero(watched[0] != "").tolist() == [line["row"] - 1 for line in alarms]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    program(tmp_path, "demo")
    monkeypatch.chdir(tmp_path)
    return tmp_path


CASES: dict[str, dict[str, Any]] = {
    "--na=2 --nb=2": {"na": 2, "nb": 2},
    "--na=2 --nb=2 --nk=0 --constant --forgetting=none": {"na": 2, "nb": 2, "nk": 0, "constant": True, "forgetting": None},
    "--na=2 --nb=2 --nc=1 --horizon=3": {"na": 2, "nb": 2, "nc": 1, "horizon": 3},
    "--na=2 --nb=2 --nc=1 --method=els --dead-zone=0.5": {"na": 2, "nb": 2, "nc": 1, "method": "els", "dead_zone": 0.5},
    "--na=2 --nb=0 --start=exact": {"na": 2, "nb": 0, "start": "exact"},
    "--na=1 --nb=2 --start=mixed:20 --offset=u=4 --offset=y=80": {
        "na": 1,
        "nb": 2,
        "start": "mixed:20",
        "offset": {"u": 4.0, "y": 80.0},
    },
    "--na=2 --nb=2 --scale=u=5 --scale=y=50 --alarm=200": {"na": 2, "nb": 2, "scale": {"u": 5, "y": 50}, "alarm": 200},
    "--na=2 --nb=2 --alarm=100 --forgetting=0.98,selective:0.99,random-walk:1e-06,variable:0.99:0.9:1.0": {
        "na": 2,
        "nb": 2,
        "alarm": 100.0,
        "forgetting": [0.98, th.Forgetting.selective(0.99), "random-walk:1e-6", th.Forgetting.variable(0.99, 0.9, 1.0)],
    },
}


@pytest.mark.parametrize("words", CASES)
@pytest.mark.parametrize("clock", [True, False])
def test_all_is_the_same_as_on_the_command_line(folder: Path, words: str, clock: bool) -> None:
    options = CASES[words]
    time = ["--time=t"] if clock else []
    lines, state, document = tracked(folder, LOG, *time, *words.split())
    log = th.read_csv(LOG, time="t") if clock else th.read_csv(LOG, sample_time=0.01)
    tracker = th.Tracker(**options)
    trajectory = tracker.run(log)
    same(trajectory, lines)
    assert tracker.to_json() == document
    assert tracker.state() == state
    # Half of it, kept, and the other half; and row by row.
    half = th.Tracker(**options)
    half.run(log[:400])
    half.write_state("half.json")
    again = th.Tracker.read_state("half.json")
    assert again.state() == half.state() == Path("half.json").read_text()
    again.run(log[400:])
    assert again.state() == state and again.to_json() == document
    loop = th.Tracker(**options)
    for row in range(60):
        one = loop.update(log.y[row], log.u[row] if loop.inputs else None, time=log.time[row] if clock else None)
        for name in ("predicted", "variances", "nis", "excitation"):
            field = {"variances": "variance"}.get(name, name)
            np.testing.assert_array_equal(getattr(one, field), getattr(trajectory, name)[row], err_msg=name)
        np.testing.assert_array_equal(one.action, trajectory.actions[row])
    short = th.Tracker(**options)
    short.run(log[:60])
    if clock:
        # Numbers do not say what they are called.
        assert loop.state().replace('"time"', '"t"') == short.state()
    else:
        assert loop.state() == short.state()


def test_the_program_goes_on_from_a_state_and_back(folder: Path) -> None:
    _, state, document = tracked(folder, LOG, "--time=t", "--na=2", "--nb=2", "--nc=1", "--alarm=100")
    log = th.read_csv(LOG, time="t")
    tracker = th.Tracker(2, 2, 1, alarm=100)
    tracker.run(log[:321])
    tracker.write_state("state.json")
    words = ["--time=t", "--na=2", "--nb=2", "--nc=1", "--alarm=100", "--state=state.json", "--summary=summary.json"]
    program(folder, "track", LOG, *words)
    assert Path("state.json").read_text() == state and Path("summary.json").read_text() == document
    Path("state.json").unlink()
    Path("head.csv").write_text("\n".join(Path(LOG).read_text().splitlines()[:501]) + "\n")
    program(folder, "track", "head.csv", *words)
    tracker = th.Tracker.read_state("state.json")
    assert tracker.rows == 500 and tracker.parameter_names == ["a1", "a2", "b1", "b2", "c1"]
    tracker.run(log[500:])
    assert tracker.state() == state and tracker.to_json() == document


def test_it_starts_from_a_fit(folder: Path) -> None:
    log = th.read_csv(LOG, time="t")
    model = th.arx(log, 2, 2, estimate="1..500")
    model.write("model.json")
    lines, state, document = tracked(folder, LOG, "--time=t", "--warm=model.json", "--forgetting=0.995", "--horizon=2")
    tracker = th.Tracker(warm=model, forgetting=0.995, horizon=2)
    np.testing.assert_array_equal(tracker.parameters, model.parameters)
    assert tracker.offsets == {name: level for name, (level, _) in model.offsets.items()}
    same(tracker.run(log), lines)
    assert tracker.state() == state and tracker.to_json() == document
    with pytest.raises(ValueError, match="^warm: .* only AR, ARX, ARMA, ARMAX and nonlinear ARX can be tracked"):
        th.Tracker(warm=th.oe(log, 2, 2))


def test_gaps_of_the_clock_and_between_experiments(folder: Path) -> None:
    rows = Path(LOG).read_text().splitlines()
    Path("gap.csv").write_text("\n".join(rows[:300] + rows[340:700]) + "\n")
    lines, state, document = tracked(folder, "gap.csv", "--time=t", "--na=2", "--nb=2")
    log = th.read_csv("gap.csv", time="t")
    tracker = th.Tracker(2, 2)
    same(tracker.run(log), lines)
    assert tracker.state() == state and tracker.to_json() == document and tracker.document["gaps"] == 1
    parts = th.Tracker(2, 2)
    parts.run(log[:299])
    parts.run(log[299:])
    assert parts.state() == state
    whole = th.dc_motor()
    first, second = th.Log(whole.y[:300], whole.u[:300]), th.Log(whole.y[340:700], whole.u[340:700])
    joined, called = th.Tracker(2, 2), th.Tracker(2, 2)
    one = joined.run(th.Log.join([first, second]))
    called.run(first)
    called.gap()
    two = called.run(second)
    np.testing.assert_array_equal(one.parameters[300 - 1 + 1 :], two.parameters)
    assert joined.state() == called.state() and joined.document["gaps"] == 1
    with pytest.raises(ValueError, match="gap: rows have times"):
        tracker.gap()


def test_dates_of_files_and_frames(folder: Path) -> None:
    index = pd.date_range("2026-03-01 12:00", periods=1000, freq="10ms", name="when")
    log = th.dc_motor()
    frame = pd.DataFrame({"u": log.u[:, 0], "y": log.y}, index)
    frame.to_csv("dated.csv", date_format="%Y-%m-%dT%H:%M:%S.%f")
    lines, state, document = tracked(folder, "dated.csv", "--time=when", "--na=2", "--nb=2")
    tracker = th.Tracker(2, 2)
    trajectory = tracker.run(th.read_csv("dated.csv", time="when"))
    same(trajectory, lines)
    assert tracker.state() == state and tracker.to_json() == document
    whole, parts = th.Tracker(2, 2), th.Tracker(2, 2)
    np.testing.assert_array_equal(whole.run(frame).parameters, trajectory.parameters)
    first, second = parts.run(frame[:400]), parts.run(frame[400:])
    np.testing.assert_array_equal(np.concatenate([first.parameters, second.parameters]), trajectory.parameters)
    assert parts.document["gaps"] == 0 and parts.rows == 1000
    pd.testing.assert_index_equal(second.to_pandas().index, frame.index[400:])
    with pytest.raises(ValueError, match="^time: the first row is .* before the latest one"):
        parts.run(frame[900:])
    with pytest.raises(ValueError, match="^time: the rows before had times, and these have none"):
        parts.run(log.y, u=log.u)


def test_frames_dicts_and_arrays_are_the_same() -> None:
    log = th.dc_motor()
    frame = pd.DataFrame({"other": ["a"] * 1000, "speed": log.y, "volts": log.u[:, 0]})
    expected = th.Tracker(2, 2).run(log.y, u=log.u)
    for data, u in ((frame, None), (dict(frame), None), (frame["speed"], frame["volts"]), (log.y.tolist(), log.u[:, 0])):
        found = th.Tracker(2, 2, inputs="volts", output="speed").run(data, u=u)
        np.testing.assert_array_equal(found.parameters, expected.parameters)
    polars = pytest.importorskip("polars")
    found = th.Tracker(2, 2, inputs=["volts"], output="speed").run(polars.from_pandas(frame))
    np.testing.assert_array_equal(found.standard_errors, expected.standard_errors)
    assert found.to_polars().columns[:3] == ["time", "action", "measured"]
    several = th.Tracker(2, [1, 2])
    assert (several.inputs, several.output, several.parameter_names) == (["u1", "u2"], "y", ["a1", "a2", "b1_1", "b2_1", "b2_2"])


def test_what_it_knows() -> None:
    log = th.dc_motor()
    tracker = th.Tracker(2, 2, forgetting=[0.99, None], alarm=1000)
    assert np.isnan(tracker.parameters).all() and np.isnan(tracker.forecast(1)).all() and tracker.scales is None
    trajectory = tracker.run(log)
    assert trajectory.parameters.shape == (1000, 4, 2) and trajectory.predicted.shape == (1000, 2)
    np.testing.assert_array_equal(tracker.parameters, trajectory.parameters[-1])
    np.testing.assert_array_equal(tracker.standard_errors, trajectory.standard_errors[-1])
    assert tracker.noise_variance.shape == (2,) and tracker.forecast(3).shape == (2,)
    assert tracker.forgetting == ["exponential:0.99", "none"] and "1000 rows" in tracker.summary()
    assert tracker.scales is not None and set(tracker.scales) == {"u", "y"}
    alone = th.Tracker(2, 2, forgetting=None, horizon=3)
    run = alone.run(log)
    np.testing.assert_array_equal(run.parameters, trajectory.parameters[..., 1])
    assert alone.forecast(3) == run.forecasts[-1] and isinstance(alone.noise_variance, float)
    assert repr(alone) == "Tracker(ARX(2, 2, 1), forgetting none, 1000 rows)" and alone.horizon == 3
    assert repr(run) == "TrackTrajectory(1000 rows, parameters a1, a2, b1, b2)" and "<svg" in run._repr_html_()
    # It ends where batch least squares does.
    model = th.arx(log, 2, 2, detrend="none", constant="no")
    np.testing.assert_allclose(alone.parameters, model.parameters, rtol=0.02)


def test_it_ends_at_an_alarm(folder: Path) -> None:
    log = th.dc_motor()
    y = log.y.copy()
    y[600:] += 20.0
    pd.DataFrame({"u": log.u[:, 0], "y": y}).to_csv("changed.csv", index=False)
    _, state, document = tracked(folder, "changed.csv", "--na=2", "--nb=2", "--alarm=10000", "--stop-on-alarm", code=7)
    tracker = th.Tracker(2, 2, alarm=10_000)
    trajectory = tracker.run(y, u=log.u, stop_on_alarm=True)
    alarm = trajectory.alarms[0]
    assert len(trajectory) == tracker.rows == (alarm.row or 0) + 1
    assert len(trajectory.to_pandas()) == len(trajectory) and tracker.state() == state and tracker.to_json() == document


def test_it_pickles_and_copies_wherever_it_stands() -> None:
    log = th.dc_motor()
    for options in ({"na": 2, "nb": 2}, {"na": 2, "nb": 2, "nc": 1, "forgetting": [0.99, None], "alarm": 100}):
        for rows in (0, 1, 7, 300):
            tracker = th.Tracker(**options, inputs=["u"])
            if rows:
                tracker.run(log[:rows])
            for again in (pickle.loads(pickle.dumps(tracker)), copy.copy(tracker), copy.deepcopy(tracker)):
                assert again.state() == tracker.state() and repr(again) == repr(tracker)
                expected = copy.deepcopy(tracker).run(log[rows:600])
                np.testing.assert_array_equal(again.run(log[rows:600]).parameters, expected.parameters)
    commas = th.Tracker(1, [1, 1], inputs=["a,b", "c"])
    assert pickle.loads(pickle.dumps(commas)).inputs == ["a,b", "c"]
    with pytest.raises(ValueError, match="the names of its inputs hold commas: a,b,c"):
        th.Tracker.from_state(commas.state())
    trajectory = th.Tracker(2, 2).run(log)
    pd.testing.assert_frame_equal(pickle.loads(pickle.dumps(trajectory)).to_pandas(), trajectory.to_pandas())


@pytest.mark.parametrize(
    ("data", "options", "error", "message"),
    [
        ([], {"u": []}, ValueError, "data: there are no rows"),
        ([1.0, 2.0, np.inf], {"u": [1.0, 2.0, 3.0]}, ValueError, "row 3: 'y' is infinite; NaN is a missing sample"),
        ([1.0, 2.0], {"u": [1.0, -np.inf]}, ValueError, "row 2: 'u' is infinite"),
        ([1.0, 2.0], {}, ValueError, r"u: the model has inputs \(u\)"),
        ([1.0, 2.0], {"u": [1.0]}, ValueError, "u: expected 2 rows as in data, found 1"),
        (np.ones((2, 2)), {"u": [1.0, 2.0]}, ValueError, r"data: expected shape \(rows,\) or \(rows, 1\)"),
        ([1.0], {"u": np.ones((1, 2))}, ValueError, r"u: expected shape \(rows,\) or \(rows, 1\)"),
        ({"y": [1.0]}, {}, ValueError, "data: there is no column 'u'; there are: y"),
        (["a"], {"u": [1.0]}, TypeError, "data: expected numbers"),
        ([1.0], {"u": [1.0], "time": [5.0]}, ValueError, "time: the rows before had no times"),
        ([1.0], {"u": [1.0], "stop_on_alarm": 1}, TypeError, "stop_on_alarm: expected True or False"),
    ],
)
def test_bad_rows_change_nothing(data: Any, options: dict[str, Any], error: type[Exception], message: str) -> None:
    log = th.dc_motor()
    tracker = th.Tracker(2, 2, alarm=100)
    tracker.run(log.y[:50], u=log.u[:50])
    before = tracker.state()
    with pytest.raises(error, match=message):
        tracker.run(data, **options)
    assert tracker.state() == before
    one = tracker.run([np.nan], u=[np.nan])
    assert len(one) == 1 and one.actions.tolist() == ["missing"]


def test_bad_single_rows_change_nothing() -> None:
    fresh = th.Tracker(1, 1)
    before = fresh.state()
    with pytest.raises(ValueError, match="row 2: 'y' is infinite"):
        fresh.run([1.0, np.inf], u=[1.0, 1.0], time=[0.0, 1.0])
    assert fresh.state() == before
    cases: list[tuple[tuple[Any, ...], dict[str, Any], type[Exception], str]] = [
        ((np.inf, 1.0), {}, ValueError, "^'y' is infinite"),
        ((1.0, np.inf), {}, ValueError, "^'u' is infinite"),
        ((1.0,), {}, ValueError, "u: expected a number, found None"),
        ((1.0, [1.0, 2.0]), {}, ValueError, r"u: expected 1 entry, found shape \(2,\)"),
        (([1.0, 2.0], 1.0), {}, ValueError, r"y: expected 1 entry, found shape \(2,\)"),
        (("a", 1.0), {}, TypeError, "y: expected numbers"),
        ((1.0, 1.0), {"time": np.nan}, ValueError, "time: nan is not a finite number"),
        ((1.0, 1.0), {"time": "noon"}, TypeError, "time: expected a number"),
    ]
    for arguments, options, error, message in cases:
        with pytest.raises(error, match=message):
            fresh.update(*arguments, **options)
        assert fresh.state() == before
    timed = th.Tracker(1, 1)
    timed.update(1.0, 1.0, time=3.0)
    with pytest.raises(ValueError, match="^time: the row is 1 s before the latest one"):
        timed.update(1.0, 1.0, time=2.0)
    assert timed.rows == 1
    large = timed.update(1e120, 1.0, time=4.0)
    assert large.action == "too large"


def test_bad_trackers() -> None:
    model = th.arx(th.dc_motor(), 2, 2)
    cases: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({}, ValueError, "the orders are missing: give na and nb"),
        ({"na": 2}, ValueError, "nb: missing: give it"),
        ({"na": -1, "nb": 1}, ValueError, "na: -1 is below 0"),
        ({"na": 1.5, "nb": 1}, TypeError, "na: expected an int"),
        ({"na": 1, "nb": 1, "method": "rpem"}, ValueError, "^method: rpem is for models with C"),
        ({"na": 1, "nb": 1, "nc": 1, "method": "rls"}, ValueError, "^method: rls has no C"),
        ({"na": 1, "nb": 1, "method": "pem"}, ValueError, "^method: 'pem' is none of rls, els, rpem"),
        ({"na": 1, "nb": 1, "forgetting": "often"}, ValueError, "^forgetting: 'often' is no policy"),
        ({"na": 1, "nb": 1, "forgetting": 1.5}, ValueError, "^forgetting: "),
        ({"na": 1, "nb": 1, "forgetting": [0.99, 0.99]}, ValueError, "^forgetting: exponential:0.99 is there twice"),
        ({"na": 1, "nb": 1, "forgetting": []}, ValueError, "^forgetting: there is none"),
        ({"na": 1, "nb": 1, "forgetting": {}}, TypeError, "^forgetting: expected a float, a Forgetting or None"),
        ({"na": 1, "nb": 1, "start": "cold"}, ValueError, "^start: 'cold' is none"),
        ({"na": 1, "nb": 1, "dead_zone": -1.0}, ValueError, "^dead_zone: "),
        ({"na": 1, "nb": 1, "horizon": 0}, ValueError, "^horizon: 0 is outside"),
        ({"na": 1, "nb": 1, "alarm": 3.0}, ValueError, "^alarm: 3 is not a number of samples from 10"),
        ({"na": 1, "nb": 1, "alarm": np.inf}, ValueError, "^alarm: inf is not a finite number"),
        ({"na": 1, "nb": 1, "offset": {"v": 1.0}}, ValueError, "^offset: 'v' is no channel of the model"),
        ({"na": 1, "nb": 1, "offset": 3.0}, TypeError, "^offset: expected a dict"),
        ({"na": 1, "nb": 1, "scale": {"u": 1.0}}, ValueError, "^scale: 'y' has none"),
        ({"na": 1, "nb": 1, "scale": {"u": 0.0, "y": 1.0}}, ValueError, "^scale: u=0"),
        ({"na": 1, "nb": [1, 1], "inputs": "u"}, ValueError, "^nb: 2 values for 1 inputs"),
        ({"na": 1, "nb": 1, "inputs": ["y"]}, ValueError, "^inputs: 'y' is named twice"),
        ({"na": 1, "nb": 1, "inputs": [3]}, TypeError, "^inputs: expected a str"),
        ({"na": 1, "nb": 1, "constant": 1}, TypeError, "^constant: expected True or False"),
        ({"na": 1, "nb": 1, "sample_time": 0.0}, ValueError, "^sample_time: 0: not a positive number"),
        ({"warm": model, "na": 2}, ValueError, "^na: the orders are those of warm"),
        ({"warm": "model.json"}, TypeError, "^warm: expected a Model, found str"),
        ({"warm": model, "inputs": ["a", "b"]}, ValueError, "^inputs: expected 1 names as warm has inputs, found 2"),
        ({"warm": model, "start": "exact"}, ValueError, "^start: 'exact' is a start without a report"),
    ]
    for options, error, message in cases:
        with pytest.raises(error, match=message) as raised:
            th.Tracker(**options)
        assert "--" not in str(raised.value), raised.value


def test_bad_states() -> None:
    tracker = th.Tracker(2, 2)
    tracker.run(th.dc_motor()[:50])
    state = tracker.state()
    cases = {
        "": "this is no state of thetahat track",
        "{}": "this is no state of thetahat track",
        state.replace("track-state/1", "track-state/9"): "of version 'thetahat.track-state/9'",
        state.replace('"rows":50', '"rows":0'): "its parts do not fit together",
        state.replace('["--format","jsonl"]', '["--format","xml"]'): "its parts do not fit together",
        state.replace('["--every","1"]', '["--every","0"]'): "its parts do not fit together",
    }
    for text, message in cases.items():
        assert text != state
        with pytest.raises(ValueError, match=message):
            th.Tracker.from_state(text)
    with pytest.raises(TypeError, match="text: expected a str"):
        th.Tracker.from_state(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="steps: 0 is outside"):
        tracker.forecast(0)
    with pytest.raises(ValueError, match="tracker: there is no tracker 1"):
        tracker.run(th.dc_motor()[50:60]).to_pandas(1)


def two_outputs(rows: int = 300) -> tuple[Array, Array]:
    """Two outputs that feed each other, and an input."""
    random = np.random.default_rng(3)
    u, e = random.normal(size=rows), 0.05 * random.normal(size=(rows, 2))
    y = np.zeros((rows, 2))
    for t in range(1, rows):
        y[t] = [[0.8, -0.1], [0.3, 0.6]] @ y[t - 1] + np.array([1.0, -0.5]) * u[t - 1] + e[t]
    return y, u


@pytest.mark.parametrize("couple", ["full", "none"])
def test_several_outputs_are_those_of_the_program(folder: Path, couple: str) -> None:
    y, u = two_outputs()
    y[100, 1] = np.nan
    frame = pd.DataFrame({"u": u, "hot": y[:, 0], "cold": y[:, 1]})
    frame.to_csv("two.csv", index=False)
    words = ("two.csv", "-y", "hot,cold", "--na=2", "--nb=1", f"--couple={couple}", "--forgetting=0.98,none", "--alarm=50", "--horizon=2")
    lines, state, document = tracked(folder, *words)
    options: dict[str, Any] = {"na": 2, "nb": 1, "couple": couple, "forgetting": [0.98, None], "alarm": 50, "horizon": 2}
    tracker = th.Tracker(output=["hot", "cold"], **options)
    trajectory = tracker.run(frame)
    n = len(tracker.parameter_names)
    assert trajectory.parameters.shape == (300, 2, n, 2) and trajectory.predicted.shape == (300, 2, 2)
    assert tracker.parameters.shape == (2, n, 2) and tracker.forecast(3).shape == (2, 2)
    assert trajectory.measured.shape == (300, 2)
    for output, name in enumerate(tracker.outputs):
        for place, policy in enumerate(trajectory.forgetting):
            mine = [line for line in lines if line["output"] == name and line["forgetting"] == policy]
            expected = pd.DataFrame([line for line in mine if line["event"] == "sample"])
            found = trajectory.to_pandas(place)
            for column in ("measured", "predicted", "innovation", "nis", "forecast", *tracker.parameter_names):
                wanted = expected[column].to_numpy(dtype=float)
                np.testing.assert_array_equal(found[f"{column}_{name}"].to_numpy(), wanted, err_msg=column)
            assert found[f"action_{name}"].tolist() == expected["action"].tolist()
            np.testing.assert_array_equal(trajectory.errors[:, output, place], expected["innovation"].to_numpy(dtype=float))
            alarms = [line["row"] - 1 for line in mine if line["event"] == "alarm"]
            given = [alarm for alarm in trajectory.alarms if (alarm.forgetting, alarm.output) == (policy, name)]
            assert [alarm.row for alarm in given] == alarms
    assert tracker.to_json() == document and tracker.state() == state
    again = pickle.loads(pickle.dumps(tracker))
    row = ([1.0, 2.0], 0.5)
    assert str(again.update(*row)) == str(tracker.update(*row))
    assert set(tracker.offsets) == {"u", "hot", "cold"}
    if couple == "full":
        assert tracker.parameter_names == ["a1_1", "a1_2", "a2_1", "a2_2", "b1"]


def test_several_outputs_one_row_at_a_time() -> None:
    y, u = two_outputs()
    tracker = th.Tracker(1, 1, output=["a", "b"], forgetting=None)
    whole = th.Tracker(1, 1, output=["a", "b"], forgetting=None).run(y, u=u)
    for at in range(100):
        seen = tracker.update(y[at], u[at])
        assert np.shape(seen.predicted) == (2,)
        np.testing.assert_array_equal(seen.error, whole.errors[at])
    np.testing.assert_array_equal(tracker.parameters, whole.parameters[99])
    with pytest.raises(AttributeError, match="several outputs: a, b"):
        tracker.output  # noqa: B018
    for wrong in (1.0, [1.0], [1.0, 2.0, 3.0], [1.0, np.inf]):
        with pytest.raises(ValueError, match=r"y: expected 2 entries|infinite"):
            tracker.update(wrong, 0.0)
    with pytest.raises(ValueError, match="couple: it is for several outputs"):
        th.Tracker(1, 1, couple="none")
    with pytest.raises(ValueError, match="several outputs are tracked as ARX"):
        th.Tracker(1, 1, 1, output=["a", "b"])
    with pytest.raises(ValueError, match="named twice"):
        th.Tracker(1, 1, output=["a", "a"])


def test_several_outputs_go_on_from_a_fit() -> None:
    y, u = two_outputs()
    log = th.Log(y, u, sample_time=1.0)
    model = th.arx(log[:200], 2, 1, couple="full")
    tracker = th.Tracker(warm=model, forgetting=None)
    assert tracker.outputs == model.outputs and tracker.parameters.shape == (2, 5)
    fitted = np.array(model.document["estimation"]["a"][0])
    found = tracker.parameters[:, [0, 2]]
    np.testing.assert_array_equal(found, [[entry["value"] for entry in row] for row in fitted])
    tracker.run(log[200:])
    np.testing.assert_allclose(tracker.parameters[1, 0], -0.3, atol=0.05)
    with pytest.raises(ValueError, match="only an ARX model can be tracked"):
        th.Tracker(warm=th.ss(log, 2))
    with pytest.raises(ValueError, match="couple: that of warm is taken"):
        th.Tracker(warm=model, couple="none")


def test_the_parameters_of_one_of_several_outputs_are_drawn() -> None:
    from thetahat import plot

    y, u = two_outputs()
    trajectory = th.Tracker(1, 1, output=["a", "b"], alarm=100).run(y, u=u)
    axes = plot.parameters(trajectory, output="b")
    line = axes[0].get_lines()[0]
    drawn = np.asarray(line.get_ydata(), dtype=float)
    np.testing.assert_array_equal(drawn[-1], trajectory.parameters[-1, 1, 0])
    both = plot.parameters(trajectory)
    assert both.shape == (len(axes), 2) and [ax.get_title() for ax in both[0]] == ["a", "b"]
    np.testing.assert_array_equal(both[0, 1].get_lines()[0].get_ydata(), line.get_ydata())
    with pytest.raises(ValueError, match="'c' is none of a, b"):
        plot.parameters(trajectory, output="c")


def test_predictions_from_inputs_to_come() -> None:
    log = th.dc_motor()
    tracker = th.Tracker(2, 2, forgetting=None)
    tracker.run(log[:900])
    ahead = tracker.predict(log.u[900:910])
    assert ahead.shape == (10,)
    assert np.sqrt(np.mean((ahead - log.y[900:910]) ** 2)) < 0.2 * np.std(log.y)
    held = tracker.predict(np.full(4, log.u[899, 0]))
    np.testing.assert_allclose(tracker.predict(steps=4), held, rtol=1e-12)
    assert tracker.predict(steps=4)[-1] == tracker.forecast(4)
    assert tracker.predict()[0] == tracker.forecast(1)
    both = th.Tracker(2, 2, forgetting=[0.99, None])
    both.run(log[:900])
    assert both.predict(log.u[900:903]).shape == (3, 2)
    y, u = two_outputs()
    coupled = th.Tracker(1, 1, output=["a", "b"], forgetting=None)
    coupled.run(y[:90], u=u[:90])
    found = coupled.predict(u[90:95])
    assert found.shape == (5, 2)
    np.testing.assert_array_equal(coupled.predict(steps=3)[-1], coupled.forecast(3))
    for wrong in ({"u": [[1.0, 2.0]]}, {"u": [1.0], "steps": 2}, {"steps": 0}, {"u": [np.inf]}):
        with pytest.raises(ValueError, match="u: |steps: "):
            tracker.predict(**wrong)
    with pytest.warns(DeprecationWarning, match="its name is update"):
        tracker.log_row(1.0, 1.0, time=log.time[900])


def test_the_row_of_an_alarm_counts_rows_since_the_first() -> None:
    log = th.dc_motor()
    tracker = th.Tracker(1, 1, alarm=100)
    for y, u in zip(log.y[:500], log.u[:500]):
        tracker.update(y, u)
    assert [alarm.row for alarm in tracker.update(1e4, 0.0).alarms] == [500]

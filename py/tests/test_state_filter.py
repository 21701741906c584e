"""Filters of stored models: the same numbers and documents as the command line, whatever they are fed with."""

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

NILE = """sample_time = 1
states = ['level']
outputs = ['y']
F = [[1]]
H = [[1]]
Q = [[1469.1]]
R = [[15099]]
P0 = [[1e7]]
"""

TWO = """sample_time = 0.5
states = ['position', 'velocity']
inputs = ['force']
outputs = ['here', 'there']
F = [[1, 0.5], [0, 0.9]]
G = [[0.1], [0.5]]
H = [[1, 0], [1, 0.2]]
Q = [[0.01, 0], [0, 0.1]]
R = [[0.2, 0.05], [0.05, 0.3]]
S = [[0.01, 0], [0, 0.02]]
P0 = [[10, 0], [0, 10]]
"""

def program(folder: Path, *words: str) -> str:
    found = subprocess.run([str(PROGRAM), *words], cwd=folder, capture_output=True, text=True, check=True)
    return found.stdout


def lines(folder: Path, *words: str) -> tuple[pd.DataFrame, str]:
    """What `thetahat filter` writes: its lines as a frame, and its document."""
    text = program(folder, "filter", *words, "--summary=summary.json", "--quiet")
    rows = [json.loads(line) for line in text.splitlines()]
    return pd.DataFrame(rows), (folder / "summary.json").read_text()


def same(found: pd.DataFrame, expected: pd.DataFrame) -> None:
    """That two frames have the same columns and the same bits."""
    expected = expected.drop(columns=["row", "time"], errors="ignore")
    held = "held" in found and "held" not in expected
    if held:
        assert set(found.pop("held")) == {""}
    assert list(found.columns) == list(expected.columns)
    for name in found.columns:
        if found[name].dtype.kind == "f":
            np.testing.assert_array_equal(found[name].to_numpy(), expected[name].to_numpy(dtype=float), err_msg=name)
        else:
            assert found[name].tolist() == expected[name].fillna("").tolist(), name


def two_channels(rows: int = 60) -> pd.DataFrame:
    random = np.random.default_rng(8)
    frame = pd.DataFrame(random.standard_normal((rows, 3)), columns=["force", "here", "there"])
    frame.loc[5, "here"] = frame.loc[9, "there"] = frame.loc[20, "force"] = np.nan
    frame.loc[30, ["here", "there"]] = np.nan
    return frame


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    program(tmp_path, "demo")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("options", [{}, {"initial": "zero"}, {"estimator": "ekf"}, {"smooth": True}])
def test_a_fitted_model_is_the_same_as_on_the_command_line(folder: Path, options: dict[str, Any]) -> None:
    log = th.read_csv(LOG, time="t")
    model = th.armax(log, 2, 2, 1, estimate="1..700", detrend="mean")
    model.write("model.json")
    words = ["--smooth" if name == "smooth" else f"--{name}={value}" for name, value in options.items()]
    expected, document = lines(folder, "model.json", LOG, "--time=t", *words)
    smooth = options.pop("smooth", False)
    filter = th.StateFilter(model, **options)
    trajectory = filter.run(log, smooth=smooth)
    same(trajectory.to_pandas(), expected)
    assert filter.to_json() == document
    np.testing.assert_array_equal(trajectory.time, log.time)
    # A part begins as the command line begins in the middle.
    expected, document = lines(folder, "model.json", LOG, "--time=t", "--rows=401..600", *words)
    filter = th.StateFilter(model, **options)
    same(filter.run(log[400:600], smooth=smooth).to_pandas(), expected)
    assert filter.to_json() == document


def test_offsets_that_are_lines_in_time(folder: Path) -> None:
    log = th.read_csv(LOG, time="t")
    model = th.arx(log, 2, 2, detrend="linear")
    model.write("model.json")
    expected, document = lines(folder, "model.json", LOG, "--time=t", "--rows=401..600")
    filter = th.StateFilter(model)
    same(filter.run(log[400:600]).to_pandas(), expected)
    assert filter.to_json() == document


def test_several_outputs_from_frames_dicts_and_arrays(folder: Path) -> None:
    frame = two_channels()
    frame.to_csv("log.csv", index=False)
    Path("model.toml").write_text(TWO)
    expected, document = lines(folder, "model.toml", "log.csv", "--smooth")
    model = th.StateModel.read("model.toml")
    y, u = frame[["here", "there"]], frame["force"]
    feeds: list[tuple[Any, Any]] = [
        (frame, None),
        (dict(frame), None),
        (frame.to_dict("list"), None),
        (y, u),
        (y.to_numpy(), u.to_numpy()),
        (y.to_numpy().tolist(), u.to_numpy().reshape(-1, 1)),
    ]
    for data, u in feeds:
        filter = th.StateFilter(model)
        trajectory = filter.run(data, u=u, smooth=True)
        same(trajectory.to_pandas(), expected)
        assert filter.to_json() == document
        assert trajectory.predicted.shape == (60, 2) and trajectory.nis_bounds.shape == (60, 2)
        assert trajectory.held.sum() == 1 and trajectory.actions[30] == "missing"
    assert trajectory.log_likelihood == filter.log_likelihood
    polars = pytest.importorskip("polars")
    again = th.StateFilter(model).run(polars.from_pandas(frame), smooth=True)
    np.testing.assert_array_equal(again.filtered, trajectory.filtered)
    assert again.to_polars().columns[1:] == list(trajectory.to_pandas().columns)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (["--poles=0.5,0.4"], {"poles": [0.5, 0.4]}),
        (["--poles=0.3+0.2i,0.3-0.2i"], {"poles": [0.3 + 0.2j, 0.3 - 0.2j]}),
        (["--gain=0.5,0.1;0.2,0.3"], {"gain": [[0.5, 0.1], [0.2, 0.3]]}),
    ],
)
def test_observers(folder: Path, words: list[str], options: dict[str, Any]) -> None:
    frame = two_channels()
    frame.to_csv("log.csv", index=False)
    Path("model.toml").write_text(TWO)
    expected, document = lines(folder, "model.toml", "log.csv", "--estimator=luenberger", *words)
    filter = th.StateFilter(th.StateModel.from_toml(TWO), "luenberger", **options)
    trajectory = filter.run(frame)
    same(trajectory.to_pandas(), expected)
    assert filter.to_json() == document and np.isnan(filter.log_likelihood)
    assert np.isnan(trajectory.filtered).all() and np.isnan(trajectory.output_deviations).all()
    with pytest.raises(ValueError, match="^estimator: an observer knows no noises"):
        th.StateFilter(th.StateModel.from_toml(TWO), "luenberger", **options).run(frame, smooth=True)


def test_a_model_in_equations_with_unknown_parameters(folder: Path) -> None:
    data = Path(__file__).parents[2] / "tests" / "data"
    if not data.exists():
        pytest.skip("the models of the repository are not here")
    model, log = data / "mass_spring_damper.toml", data / "mass_spring_damper.csv"
    expected, document = lines(folder, str(model), str(log), "--rows=1..300")
    filter = th.StateFilter(th.StateModel.read(model))
    trajectory = filter.run(pd.read_csv(log)[:300])
    same(trajectory.to_pandas(), expected)
    assert filter.to_json() == document and filter.estimator == "ekf" and trajectory.parameters.shape[1] == len(filter.unknown) > 0
    again = pickle.loads(pickle.dumps(filter))
    assert again.to_json() == document


def test_matrices_are_the_model_that_the_text_is(folder: Path) -> None:
    frame = two_channels()
    model = th.StateModel(
        np.array([[1, 0.5], [0, 0.9]]),
        [[1.0, 0.0], [1.0, 0.2]],
        [[0.01, 0.0], [0.0, 0.1]],
        [[0.2, 0.05], [0.05, 0.3]],
        np.diag([10.0, 10.0]),
        G=[[0.1], [0.5]],
        S=[[0.01, 0.0], [0.0, 0.02]],
        sample_time=0.5,
        states=["position", "velocity"],
        inputs=["force"],
        outputs=["here", "there"],
    )
    one, other = (th.StateFilter(each).run(frame) for each in (model, th.StateModel.from_toml(TWO)))
    np.testing.assert_array_equal(one.filtered, other.filtered)
    assert th.StateModel.from_toml(model.to_toml()) == model and len({model, pickle.loads(pickle.dumps(model))}) == 1
    plain = th.StateModel(np.eye(3), np.eye(2, 3), np.eye(3), np.eye(2), np.eye(3), sample_time=pd.Timedelta("2s"), G=np.ones((3, 2)), x0=[1, 2, 3])
    assert (plain.states, plain.inputs, plain.outputs) == (["x1", "x2", "x3"], ["u1", "u2"], ["y1", "y2"])
    assert repr(plain) == "StateModel(states x1, x2, x3, inputs u1, u2, outputs y1, y2, sample time 2.0 s)"
    first = th.StateFilter(plain).update([0.0, 0.0], [0.0, 0.0])
    assert first.predicted.tolist() == [1.0, 2.0, 3.0]


def test_the_nile() -> None:
    filter = th.StateFilter(th.StateModel.from_toml(NILE))
    estimate = filter.update(1120.0)
    # Durbin and Koopman, Time Series Analysis by State Space Methods, section 2.2.
    assert estimate.filtered[0] == pytest.approx(1118.311462, abs=1e-6)
    assert estimate.filtered_deviations[0] ** 2 == pytest.approx(15076.236391, abs=1e-6)
    assert (estimate.row, estimate.time, estimate.action, filter.rows) == (0, 0.0, "updated", 1)
    assert estimate.innovations.tolist() == [1120.0] and estimate.nis_bounds[0] < estimate.nis < estimate.nis_bounds[1]
    assert "Kalman filter: 1 rows" in filter.summary()
    assert filter.warnings[0].startswith("squared innovations are 0.13 times as large")


def test_steps_in_a_loop_and_a_run_are_the_same() -> None:
    frame, model = two_channels(), th.StateModel.from_toml(TWO)
    whole, loop = th.StateFilter(model), th.StateFilter(model)
    trajectory = whole.run(frame)
    for row, (u, *y) in enumerate(frame.to_numpy().tolist()):
        estimate = loop.update(y, u)
        for name in ("predicted", "filtered", "filtered_deviations", "outputs", "innovations", "nis", "nis_bounds", "held"):
            np.testing.assert_array_equal(getattr(estimate, name), getattr(trajectory, name)[row], err_msg=name)
        assert (estimate.action, estimate.row) == (trajectory.actions[row], row)
        np.testing.assert_array_equal(estimate.log_likelihood, trajectory.log_likelihoods[row])
    assert loop.to_json() == whole.to_json()
    latest = loop.latest
    assert latest is not None
    np.testing.assert_array_equal(latest.filtered, trajectory.filtered[-1])
    parts = th.StateFilter(model)
    assert parts.latest is None
    np.testing.assert_array_equal(parts.run(frame[:23]).filtered, trajectory.filtered[:23])
    np.testing.assert_array_equal(parts.run(frame[23:]).filtered, trajectory.filtered[23:])


def test_it_pickles_and_copies_wherever_it_stands() -> None:
    frame, log = two_channels(), th.dc_motor()
    model = th.arx(log[:700], 2, 2)
    cases: list[tuple[th.StateFilter, Any]] = [
        (th.StateFilter(th.StateModel.from_toml(TWO)), frame),
        (th.StateFilter(th.StateModel.from_toml(TWO), "luenberger", poles=[0.5, 0.4]), frame),
        (th.StateFilter(model, initial="zero"), log),
    ]
    for filter, data in cases:
        for rows in (0, 1, 30):
            if rows:
                filter.run(data[filter.rows : rows])
            for again in (pickle.loads(pickle.dumps(filter)), copy.deepcopy(filter), copy.copy(filter)):
                assert again.to_json() == filter.to_json() and again.rows == rows and repr(again) == repr(filter)
                other = copy.deepcopy(filter)
                np.testing.assert_array_equal(again.run(data[rows:60]).predicted, other.run(data[rows:60]).predicted)
    trajectory = th.StateFilter(model).run(log)
    pd.testing.assert_frame_equal(pickle.loads(pickle.dumps(trajectory)).to_pandas(), trajectory.to_pandas())


def test_frames_go_in_and_come_back_with_their_index(folder: Path) -> None:
    index = pd.date_range("2026-03-01 12:00", periods=6, freq="s", tz="Europe/Berlin").delete(3)
    flow = pd.Series([1120.0, 1160.0, 963.0, 1210.0, 1160.0], index, name="flow")
    model = th.StateModel.from_toml(NILE)
    trajectory = th.StateFilter(model).run(flow)
    pd.testing.assert_index_equal(trajectory.to_pandas().index, index)
    # The second that is missing is a step of two sample times.
    filled = th.StateFilter(model).run([1120.0, 1160.0, 963.0, np.nan, 1210.0, 1160.0])
    np.testing.assert_array_equal(trajectory.filtered, filled.filtered[[0, 1, 2, 4, 5]])
    parts = th.StateFilter(model)
    first, second = parts.run(flow[:3]), parts.run(flow[3:])
    np.testing.assert_array_equal(np.concatenate([first.filtered, second.filtered]), trajectory.filtered)
    with pytest.raises(ValueError, match="^time: the first row is 4 s before the latest one"):
        parts.run(flow[1:])
    named = pd.DataFrame({"when": index, "y": flow.to_numpy()}, index=list("abcde"))
    by_name = th.StateFilter(model).run(named, time="when")
    np.testing.assert_array_equal(by_name.filtered, trajectory.filtered)
    assert by_name.to_pandas().index.tolist() == list("abcde") and "when" in by_name.to_pandas()
    irregular = th.StateFilter(model).run(flow.to_numpy(), time=[0.0, 1.0, 2.0, 4.0, 5.0])
    np.testing.assert_array_equal(irregular.filtered, trajectory.filtered)
    apart = th.StateFilter(model).run(flow.to_numpy(), sample_time=2.0)
    spaced = th.StateFilter(model).run(flow.to_numpy(), time=2.0 * np.arange(5))
    np.testing.assert_array_equal(apart.filtered, spaced.filtered)
    stepped = th.StateFilter(model)
    for y in flow:
        stepped.update(y, seconds=pd.Timedelta("2s"))
    latest = stepped.latest
    assert latest is not None and latest.filtered[0] == apart.filtered[-1, 0]


@pytest.mark.parametrize(
    ("data", "options", "error", "message"),
    [
        ([], {}, ValueError, "data: there are no rows"),
        (np.empty((0, 1)), {}, ValueError, "data: there are no rows"),
        ([1.0, np.inf], {}, ValueError, "'y' is infinite in row"),
        (np.ones((3, 2)), {}, ValueError, r"data: expected shape \(rows,\) or \(rows, 1\), found shape \(3, 2\)"),
        (np.ones((2, 2, 2)), {}, ValueError, "data: expected shape"),
        (["a", "b"], {}, TypeError, "data: expected numbers"),
        ({"x": [1.0]}, {}, ValueError, "data: there is no column 'y'; there are: x"),
        (pd.DataFrame({"x": [1.0]}), {}, ValueError, "data: there is no column 'y'; there are: x"),
        ([1.0], {"u": [1.0]}, ValueError, "u: the model has no inputs"),
        ([1.0, 2.0], {"time": [0.0]}, ValueError, "time: expected 2 times, one for each row, found 1"),
        ([1.0, 2.0], {"time": [1.0, 0.0]}, ValueError, "time: the times do not rise"),
        ([1.0, 2.0], {"time": [0.0, np.nan]}, ValueError, "time: row 2 has no time"),
        ([1.0, 2.0], {"time": [0.0, 1.5]}, ValueError, "1.5"),
        ([1.0, 2.0], {"time": [0.0, 1.0], "sample_time": 1.0}, ValueError, "sample_time: the rows have times"),
        ([1.0, 2.0], {"sample_time": 0.0}, ValueError, "sample_time: 0.0 is not above 0"),
        ([1.0, 2.0], {"sample_time": 0.3}, ValueError, "0.3"),
        ({"y": [1.0]}, {"time": "t"}, ValueError, "time: there is no column 't'"),
        ([1.0], {"smooth": 1}, TypeError, "smooth: expected True or False"),
        ([1.0], {"smooth": True}, ValueError, "smooth: the filter has seen rows already"),
    ],
)
def test_bad_rows_change_nothing(data: Any, options: dict[str, Any], error: type[Exception], message: str) -> None:
    filter = th.StateFilter(th.StateModel.from_toml(NILE))
    filter.run([1120.0, np.nan])
    before = pickle.dumps(filter)
    with pytest.raises(error, match=message):
        filter.run(data, **options)
    assert pickle.dumps(filter) == before
    assert "--" not in message


def test_bad_steps_change_nothing() -> None:
    filter = th.StateFilter(th.StateModel.from_toml(TWO))
    filter.update([1.0, 2.0], 0.5)
    before = filter.to_json()
    cases: list[tuple[tuple[Any, ...], dict[str, Any], type[Exception], str]] = [
        (([1.0], 0.5), {}, ValueError, r"y: expected 2 entries, found shape \(1,\)"),
        ((1.0, 0.5), {}, ValueError, "y: expected 2 entries, found a number"),
        (([1.0, 2.0],), {}, ValueError, "u: expected a number, found None"),
        (([1.0, 2.0], [1.0, 2.0]), {}, ValueError, "u: expected 1 entry"),
        (([1.0, np.inf], 0.5), {}, ValueError, "'there' is infinite in row 2"),
        (([1.0, 2.0], -np.inf), {}, ValueError, "'force' is infinite in row 2"),
        (([1.0, 2.0], 0.5), {"seconds": 0.7}, ValueError, "0.7"),
        (([1.0, 2.0], 0.5), {"seconds": -0.5}, ValueError, "-0.5"),
        (([1.0, 2.0], 0.5), {"seconds": "1"}, ValueError, "seconds: it is no duration"),
        ((["a", "b"], 0.5), {}, TypeError, "y: expected numbers"),
    ]
    for arguments, options, error, message in cases:
        with pytest.raises(error, match=message):
            filter.update(*arguments, **options)
        assert filter.to_json() == before and filter.rows == 1
    alone = th.StateFilter(th.StateModel.from_toml(TWO)).run([[1.0, 2.0]], u=[np.nan])
    assert len(alone) == 1 and alone.held.tolist() == [[True]]


def test_bad_logs() -> None:
    log = th.dc_motor()
    model = th.arx(log, 2, 2)
    with pytest.raises(ValueError, match="data: there is no channel 'u'; there are: y"):
        th.StateFilter(model).run(th.Log(log.y, sample_time=0.01))
    with pytest.raises(TypeError, match="u: a Log has its own; leave it out"):
        th.StateFilter(model).run(log, u=log.u)
    with pytest.raises(ValueError, match="data: it holds several experiments"):
        th.StateFilter(model).run(th.Log.join([log, log]))
    # Without a clock a log is at the pace of the model.
    plain = th.StateFilter(model).run(th.Log(log.y, log.u))
    np.testing.assert_array_equal(plain.filtered, th.StateFilter(model).run(log.y, u=log.u).filtered)


def test_bad_filters() -> None:
    nile, model = th.StateModel.from_toml(NILE), th.arx(th.dc_motor(), 2, 2)
    cases: list[tuple[Any, dict[str, Any], type[Exception], str]] = [
        ("model.toml", {}, TypeError, "model: expected a Model, a StateModel or a GreyBox, found str"),
        (nile, {"initial": "zero"}, ValueError, "initial: a StateModel says itself"),
        (model, {"initial": "drop"}, ValueError, "initial: 'drop' is neither 'zero' nor 'unknown'"),
        (nile, {"estimator": "wiener"}, ValueError, "estimator: 'wiener' is none of"),
        (nile, {"estimator": 3}, TypeError, "estimator: expected a str"),
        (nile, {"estimator": "luenberger"}, ValueError, "estimator: 'luenberger' needs poles or gain"),
        (nile, {"poles": [0.5]}, ValueError, "poles and gain are for estimator 'luenberger'"),
        (nile, {"estimator": "luenberger", "poles": [0.5, 0.4]}, ValueError, "^poles: there are 2"),
        (nile, {"estimator": "luenberger", "poles": [1.5]}, ValueError, "^poles: "),
        (nile, {"estimator": "luenberger", "poles": [np.nan]}, ValueError, "^poles: expected finite numbers"),
        (nile, {"estimator": "luenberger", "poles": "a"}, TypeError, "^poles: expected numbers"),
        (nile, {"estimator": "luenberger", "poles": []}, ValueError, "^poles: expected one dimension"),
        (nile, {"estimator": "luenberger", "poles": [0.5], "gain": [[1.0]]}, ValueError, "^gain: there are poles already"),
        (nile, {"estimator": "luenberger", "gain": [[1.0, 2.0]]}, ValueError, r"^gain: expected shape \(1, 1\)"),
        (nile, {"estimator": "luenberger", "gain": [[np.inf]]}, ValueError, "^gain: entry 0 is inf"),
        (nile, {"estimator": "luenberger", "gain": [[3.0]]}, ValueError, "^gain: with it the error"),
    ]
    for given, options, error, message in cases:
        with pytest.raises(error, match=message) as raised:
            th.StateFilter(given, **options)
        assert "--" not in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"F": [[1.0, 0.0]]}, r"F: expected shape \(1, 1\), found shape \(1, 2\)"),
        ({"F": []}, "F: expected shape"),
        ({"H": [[1.0, 2.0]]}, r"H: expected shape \(1, 1\)"),
        ({"Q": [[-1.0]]}, "^Q: "),
        ({"R": [[np.nan]]}, "^R: expected finite numbers, found nan"),
        ({"P0": [[np.inf]]}, "^P0: expected finite numbers"),
        ({"G": [[1.0], [2.0]]}, r"G: expected shape \(1, any\)"),
        ({"D": [[1.0]]}, "D: "),
        ({"S": [[1e9]]}, "Q, R and S"),
        ({"x0": [1.0, 2.0]}, "x0: expected shape"),
        ({"states": ["a", "b"]}, "states: expected 1 names, found 2"),
        ({"outputs": ["x1"], "G": [[1.0]], "inputs": ["x1"]}, "outputs: 'x1' is an input too"),
        ({"H": [[1.0], [1.0]], "R": [[1, 0], [0, 1]], "outputs": ["y", "y"]}, "outputs: 'y' is there twice"),
        ({"sample_time": 0.0}, "sample_time: 0.0 is not above 0"),
    ],
)
def test_bad_matrices(changes: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"F": [[1.0]], "H": [[1.0]], "Q": [[1.0]], "R": [[1.0]], "P0": [[1.0]], "sample_time": 1.0}
    with pytest.raises(ValueError, match=message) as raised:
        th.StateModel(**{**given, **changes})
    assert "line" not in str(raised.value)


def test_a_text_that_is_wrong_says_where() -> None:
    with pytest.raises(ValueError, match="line 6, column"):
        th.StateModel.from_toml(NILE.replace("[[1469.1]]", "[[1, 2]]"))
    with pytest.raises(TypeError, match="text: expected a str"):
        th.StateModel.from_toml(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="path"):
        th.StateModel.read(3)  # type: ignore[arg-type]


def test_a_filter_predicts_from_inputs_to_come() -> None:
    log = th.dc_motor()
    model = th.arx(log[:700], na=2, nb=2)
    filter = th.StateFilter(model)
    filter.run(log[:900])
    ahead = filter.predict(log.u[900:905])
    np.testing.assert_allclose(ahead, model.forecast(log[:900], 5, log.u[900:905]).values, rtol=1e-6)
    assert filter.rows == 900
    assert filter.predict().shape == (1,)
    np.testing.assert_allclose(filter.predict(steps=3), filter.predict(np.full(3, log.u[899, 0])))
    with pytest.raises(ValueError, match="u: expected shape"):
        filter.predict([[1.0, 2.0]])
    with pytest.warns(DeprecationWarning, match="its name is update"):
        filter.step(1.0, 1.0)

"""Models in state space with several outputs, and what every method makes of them."""

from __future__ import annotations

import json
import pickle
from typing import Any
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

import thetahat as th
from thetahat import plot

Array = npt.NDArray[np.float64]

F = np.array([[0.7, 0.2], [-0.2, 0.6]])
G = np.array([[1.0, 0.0], [0.5, -1.0]])
H = np.array([[1.0, 0.0], [0.5, 1.0]])
K = np.array([[0.3, 0.0], [0.0, 0.2]])


def signals(rows: int = 1500, noise: float = 0.2) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    u, e, x = rng.standard_normal((rows, 2)), noise * rng.standard_normal((rows, 2)), np.zeros(2)
    y = np.zeros((rows, 2))
    for k in range(rows):
        y[k] = H @ x + e[k]
        x = F @ x + G @ u[k] + K @ e[k]
    return u, y + [10, -3]


def log(rows: int = 1500) -> th.Log:
    u, y = signals(rows)
    return th.Log(y, u, sample_time=0.5)


def data_outputs(data: th.Log) -> Array:
    return np.column_stack([data[name] for name in ("y1", "y2")])


def test_the_plant_is_found_and_every_method_takes_it() -> None:
    data = log()
    model = th.ss(data, estimate=slice(0, 1000), validate=slice(1000, 1500))
    assert (model.kind, model.name, model.method) == ("state-space", "state space of order 2", "subspace")
    assert model.poles() == pytest.approx(np.linalg.eigvals(F), abs=0.03)
    assert model.stable and model.time_constants().shape == (2,)
    gains = H @ np.linalg.solve(np.eye(2) - F, G)
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            assert model.dc_gain(name, output=output)[0] == pytest.approx(gains[i, j], abs=0.1)
            step = model.step_response(name, 100, output=i).values
            assert step[-1] == pytest.approx(gains[i, j], abs=0.1)
            response = model.frequency_response([1e-4], output=output)
            assert abs(response.values[j][0]) == pytest.approx(abs(gains[i, j]), abs=0.1)
    assert model.noise_covariance == pytest.approx(0.04 * np.eye(2), abs=0.01)
    assert model.parameters.size == 0 and model.covariance is None
    with pytest.raises(AttributeError, match="this one is in state space"):
        _ = model.orders
    with pytest.raises(ValueError, match="output: there are several"):
        model.dc_gain()

    again = pickle.loads(pickle.dumps(model))
    assert json.loads(again.to_json()) == json.loads(model.to_json())
    assert model.predict(data).shape == model.residuals(data).shape == (1500, 2)
    assert np.std(model.residuals(data), axis=0) == pytest.approx([0.2, 0.2], rel=0.1)
    assert model.simulate(data).shape == (1500, 2)
    low, high = np.moveaxis(model.predict_interval(data, 3), -1, 0)
    inside = (low[2:] <= data_outputs(data)[2:]) & (data_outputs(data)[2:] <= high[2:])
    assert np.mean(inside, axis=0) == pytest.approx([0.95, 0.95], abs=0.03)
    forecast = model.forecast(data[:1400], 5, data.u[1400:1405])
    assert forecast.values.shape == forecast.standard_deviations.shape == (5, 2)
    validation = model.validate(data, rows=slice(1000, 1500), require=["fit[y1]>=60", "white", "stable"])
    assert {fit["output"] for fit in validation.document["fit"]} == {"y1", "y2"}
    with pytest.raises(ValueError, match="no output 'y9'"):
        model.validate(data, require="fit[y9]>=1")
    # ln L of Gaussian errors.
    share = model.document["model"]["degrees_of_freedom"] / 1000
    known = 1000 * (np.log(np.linalg.det(share * model.noise_covariance)) + 2 * np.log(2 * np.pi) + 2)
    assert model.log_likelihood == pytest.approx(-known / 2, rel=1e-9)
    assert "state space of order 2" in model._repr_html_()
    for draw in (plot.step, plot.impulse):
        assert draw(model).shape == (2, 2) and draw(model, output="y2").shape == (1, 2)
    assert plot.bode(model).shape == (4, 2) and plot.bode(model, output=0).shape == (2, 2)
    plot.fit(model, data, 5, output="y1")


def test_states_that_matter_least_are_left_out() -> None:
    data = log()
    model = th.ss(data, 5)
    values = model.hankel_singular_values()
    assert values.shape == (5,) and np.all(np.diff(values) <= 0)
    less = model.reduced(2)
    assert less.name == "state space of order 2" and "from 5 to 2 states" in less.warnings[0]
    assert less.poles() == pytest.approx(np.linalg.eigvals(F), abs=0.05)
    assert np.nanstd(less.residuals(data), axis=0) == pytest.approx([0.2, 0.2], rel=0.1)
    for wrong in (0, 9):
        with pytest.raises(ValueError, match="order"):
            model.reduced(wrong)
    with pytest.raises(ValueError, match="states are left out of"):
        th.narx(data).reduced(1)


def test_matrices_predict_as_the_model_does() -> None:
    data = log()
    model = th.ss(data, 2)
    form = model.to_state_space()
    u = data.u - [model.offsets[name][0] for name in model.inputs]
    level = np.array([model.offsets[name][0] for name in model.outputs])
    x, predicted = np.zeros(len(form.F)), np.zeros((len(data), 2))
    measured = data_outputs(data) - level
    for t in range(len(data)):
        predicted[t] = form.H @ x + form.D @ u[t]
        x = form.F @ x + form.G @ u[t] + form.K @ (measured[t] - predicted[t])
    assert np.allclose(predicted + level, model.predict(data, initial="zero"), atol=1e-9)
    control = pytest.importorskip("control")
    plant = model.to_control()
    assert isinstance(plant, control.StateSpace)
    assert (plant.input_labels, plant.output_labels) == (["u1", "u2"], ["y1", "y2"])
    assert model.to_scipy().dt == 0.5


def test_options_are_those_of_the_command_line() -> None:
    data = log()
    model = th.ss(data, range(1, 5), past=8, feedthrough=True, nk=[1, 0])
    assert (model.document["estimation"]["past"], model.document["estimation"]["feedthrough"]) == (8, True)
    assert len(model.document["estimation"]["orders"]) == 4
    for weighting in ("moesp", "n4sid", "cva"):
        assert th.ss(data, 2, weighting=weighting, past=8, future=10).poles().real == pytest.approx([0.65, 0.65], abs=0.03)
    series = th.ss(th.Log(signals()[1], sample_time=1), 2)
    assert series.inputs == [] and series.predict(th.Log(signals()[1], sample_time=1)).shape == (1500, 2)
    assert th.ss(th.Log(signals()[1][:, 0], signals()[0], sample_time=1), 2).output == "y"
    calls: list[tuple[Callable[[], th.Model], str]] = [
        (lambda: th.ss(data, 0), "order"),
        (lambda: th.ss(data, past=0), "past"),
        (lambda: th.ss(data, weighting="pem"), "weighting"),  # type: ignore[arg-type]
        (lambda: th.ss(data, nk=[1, 2, 3]), "nk"),
        (lambda: th.ss(data, feedthrough=False, nk=0), "nk"),
    ]
    for wrong, words in calls:
        with pytest.raises(ValueError, match=words):
            wrong()
    with pytest.raises(TypeError, match="feedthrough"):
        th.ss(data, feedthrough="yes")  # type: ignore[arg-type]
    with pytest.raises(th.EstimationError, match="more samples than signals"):
        th.ss(data[:20], past=10)


def test_a_filter_and_a_frame_take_it() -> None:
    pandas = pytest.importorskip("pandas")
    u, y = signals()
    frame = pandas.DataFrame({"heat": u[:, 0], "fan": u[:, 1], "hot": y[:, 0], "cold": y[:, 1]})
    frame.index = pandas.date_range("2026-01-01", periods=len(frame), freq="500ms")
    data = th.Log.from_dataframe(frame, inputs=["heat", "fan"], output=["hot", "cold"])
    model = th.ss(data, 2)
    assert model.outputs == ["hot", "cold"] and model.sample_time == 0.5
    estimated = th.StateFilter(model).run(data)
    assert len(estimated) == len(data) and "x1" in estimated.to_pandas().columns
    one = th.Log.from_dataframe(frame, inputs=["heat", "fan"], output="hot")
    assert th.ss(one, 2).output == "hot"


def test_refined_models_have_standard_errors() -> None:
    data = log()
    assert np.isnan(th.ss(data, 2).dc_gain("u1", output="y1")[1])
    truth = H @ np.linalg.solve(np.eye(2) - F, G)
    for refine in ("prediction", "simulation"):
        model = th.ss(data, 2, refine=refine, max_iterations=50, tolerance=1e-9)
        for output in range(2):
            for source in range(2):
                gain, error = model.dc_gain(source, output=output)
                assert 0 < error < 0.1
                assert abs(gain - truth[output, source]) < 4 * error
        step = model.step_response("u2", output="y2")
        assert np.all(step.standard_errors[1:] > 0)
        assert np.all(model.frequency_response([0.1, 1.0], output="y1").magnitude_errors > 0)
    with pytest.raises(ValueError, match="refine"):
        th.ss(data, 2, refine="both")  # type: ignore[arg-type]


def test_an_arx_model_has_several_outputs() -> None:
    data = log()
    model = th.arx(data, na=range(1, 5), nb=range(1, 5))
    found = model.document["estimation"]
    assert model.kind == "state-space" and found["method"] == "vector-arx" and len(found["tried"]) == 32
    truth = H @ np.linalg.solve(np.eye(2) - F, G)
    for output in range(2):
        for source in range(2):
            gain, error = model.dc_gain(source, output=output)
            assert error > 0 and abs(gain - truth[output, source]) < 4 * error
    # Without coupling each output is fitted as if it were alone.
    apart = th.arx(data, na=2, nb=2, couple="none", constant="no").document["estimation"]
    alone = th.arx(th.Log(data["y1"], {name: data[name] for name in ("u1", "u2")}, sample_time=0.5), 2, 2, constant="no")
    assert [apart["a"][lag][0][0]["value"] for lag in range(2)] == pytest.approx(alone.parameters[:2])
    assert apart["a"][0][0][1]["standard_error"] is None
    with pytest.raises(ValueError, match="couple"):
        th.arx(data, 2, 2, couple="some")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="couple"):
        th.arx(th.dc_motor(), 2, 2, couple="full")
    with pytest.raises(ValueError, match="prefilter"):
        th.arx(data, 2, 2, prefilter=(0.1, 0.5))


def test_continuous_time_is_that_of_scipy() -> None:
    signal = pytest.importorskip("scipy.signal")
    data = log()
    model = th.ss(data, 2)
    form = model.to_state_space()
    holds: list[tuple[Any, str]] = [("zoh", "zoh"), ("foh", "foh"), ("tustin", "bilinear")]
    for hold, method in holds:
        continuous = model.converted("continuous", hold)
        assert continuous.kind == "continuous-state-space" and continuous.stable
        plant = continuous.to_scipy()
        assert isinstance(plant, signal.StateSpace) and plant.dt is None
        sampled = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), 0.5, method)
        for found, known in zip(sampled, (form.F, form.G, form.H, form.D)):
            assert found == pytest.approx(known, abs=1e-9)
        again = continuous.converted(0.2)
        known = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), 0.2, method)
        slow = again.to_state_space()
        for found, expected in zip((slow.F, slow.G, slow.H, slow.D), known):
            assert found == pytest.approx(expected, abs=1e-9)
        assert continuous.noise_covariance == pytest.approx(model.noise_covariance, rel=1e-9) or hold == "tustin"
    continuous = model.converted("continuous")
    assert continuous.poles() == pytest.approx(np.log(model.poles()) / 0.5, abs=1e-9)
    assert continuous.dc_gain("u1", output="y2")[0] == pytest.approx(model.dc_gain("u1", output="y2")[0])
    assert continuous.predict(data) == pytest.approx(model.predict(data), abs=1e-6)
    control = pytest.importorskip("control")
    assert isinstance(continuous.to_control(), control.StateSpace) and continuous.to_control().dt == 0
    with pytest.raises(ValueError, match="neither the word continuous"):
        model.converted("slow")
    with pytest.raises(ValueError, match="is none of zoh, foh and tustin"):
        model.converted(1.0, "ramp")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="has a dead time"):
        th.ss(data, 2, nk=3).converted("continuous").to_scipy()

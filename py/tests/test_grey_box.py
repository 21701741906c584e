"""Models in equations: texts, dicts and functions of Python, their fits, and what every method makes of them."""

from __future__ import annotations

import copy
import json
import pickle
import subprocess
import sys
from pathlib import Path
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import thetahat as th
from thetahat import plot
from thetahat.fits.expressions import Expression

DATA = Path(__file__).parents[2] / "tests" / "data"
TANK: dict[str, Any] = {
    "sample_time": 1.0,
    "states": {"level": {"start": 0.0, "sd": 0.1}},
    "inputs": {"flow": "u"},
    "parameters": {"area": {"start": 1, "sd": 1, "unknown": True, "min": 0}, "loss": 0.1},
    "next": {"level": "level + dt * (flow - loss * level) / area"},
    "outputs": {"y": "level"},
    "noise": {"process": {"level": 0.01}, "measurement": {"y": 0.05}},
}


def tank_log(rows: int = 400, seed: int = 0) -> th.Log:
    """A tank of 2 m^2."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, rows // 10), 10)
    level = np.zeros(rows)
    for t in range(1, rows):
        level[t] = level[t - 1] + (u[t - 1] - 0.1 * level[t - 1]) / 2 + 0.01 * rng.standard_normal()
    return th.Log(level + 0.05 * rng.standard_normal(rows), u, sample_time=1)


def test_texts_files_and_dicts_are_one_model(tmp_path: Path) -> None:
    of_dict = th.GreyBox(TANK)
    (tmp_path / "tank.toml").write_text(of_dict.to_toml())
    assert th.GreyBox(of_dict.to_toml()) == of_dict == th.GreyBox(tmp_path / "tank.toml")
    assert of_dict.to_dict() == TANK
    assert (of_dict.states, of_dict.inputs, of_dict.outputs, of_dict.unknown) == (["level"], ["u"], ["y"], ["area"])
    known = of_dict.with_parameters(area=2.0)
    assert known.unknown == [] and known != of_dict
    for model in (of_dict, known):
        assert pickle.loads(pickle.dumps(model)) == model == copy.deepcopy(model)


def test_functions_of_python_are_the_same_equations() -> None:
    box = th.GreyBox.from_functions(
        sample_time=1.0,
        states={"level": (0.0, 0.1)},
        inputs={"flow": "u"},
        parameters=TANK["parameters"],
        next=lambda x, u, p, dt: {"level": x.level + dt * (u.flow - p.loss * x.level) / p.area},
        outputs=lambda x, u, p: {"y": x.level},
        process={"level": 0.01},
        measurement={"y": 0.05},
    )
    log = tank_log()
    assert np.array_equal(th.grey(log, box).parameters, th.grey(log, TANK).parameters)


def test_functions_of_numpy_become_those_of_the_equations() -> None:
    def derivative(x: Any, u: Any, p: Any) -> dict[str, Any]:
        return {
            "a": np.sin(x.a) + np.exp(-x.b) * np.sqrt(np.abs(x.b)) - x.a**2 + np.square(x.b),
            "b": np.minimum(x.a, 1.0) / 2 - np.arctan2(x.b, -3) + 0.5 * np.tanh(p.c) + +u.u,
        }

    box = th.GreyBox.from_functions(
        sample_time=0.1,
        states={"a": {"start": 0, "sd": 1}, "b": (1, 0)},
        inputs=["u"],
        parameters={"c": 2.0},
        derivative=derivative,
        outputs=lambda x, u, p: {"y": x.a, "z": 0 * x.b + 1},
        measurement={"y": 1.0, "z": 1.0},
        substeps=3,
    )
    found = box.to_dict()
    assert found["derivative"]["a"] == "(((sin(a) + (exp((-b)) * sqrt(abs(b)))) - (a ^ 2.0)) + (b * b))"
    assert found["derivative"]["b"] == "((((min(a, 1.0) / 2.0) - atan2(b, (-3.0))) + (0.5 * tanh(c))) + u)"
    assert found["substeps"] == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"states": {}}, "states"),
        ({"next": {"level": "level + volume"}}, "volume"),
        ({"sample_time": float("nan")}, "sample_time"),
        ({"outputs": {"y": "level +"}}, "line"),
        ({"sample_time": None}, "sample_time: expected a number"),
    ],
)
def test_a_model_that_is_none_is_refused_with_its_place(change: dict[str, Any], words: str) -> None:
    with pytest.raises((ValueError, TypeError), match=words):
        th.GreyBox({**TANK, **change})


def test_functions_that_cannot_be_equations_are_refused() -> None:
    def made(next: Any) -> th.GreyBox:
        outputs = lambda x, u, p: {"y": x.x}  # noqa: E731
        return th.GreyBox.from_functions(
            sample_time=1, states={"x": (0, 1)}, next=next, outputs=outputs, measurement={"y": 1.0}
        )

    import math

    for function, words in [
        (lambda x, u, p, dt: {"x": math.sin(x.x)}, "use NumPy's functions"),
        (lambda x, u, p, dt: {"x": 1.0 if x.x > 0 else 0.0}, "no value to branch on|greater"),
        (lambda x, u, p, dt: x.x, "return a dict"),
        (lambda x, u, p, dt: {"x": np.floor(x.x)}, "floor: equations have"),
        (lambda x, u, p, dt: {"x": "x"}, "expression"),
    ]:
        with pytest.raises(TypeError, match=words):
            made(function)
    with pytest.raises(AttributeError):
        made(lambda x, u, p, dt: {"x": x.y})
    with pytest.raises(ValueError, match="one of derivative and next"):
        made(None)


def test_a_fit_is_a_model_with_every_method(tmp_path: Path) -> None:
    log = tank_log()
    model = th.grey(log, TANK, estimate=slice(0, 300))
    assert (model.kind, model.name, model.outputs, model.inputs) == ("equations", "equations, 1 state", ["y"], ["u"])
    assert model.parameter_names == ["area"] and abs(model.parameters[0] - 2) < 4 * model.standard_errors[0]
    assert model.predict(log, 3).shape == (400,) and model.simulate(log).shape == (400,)
    low, high = model.predict_interval(log, 5).T
    inside = np.mean((low < log.y) & (log.y < high))
    assert 0.9 < inside < 0.99
    assert model.simulate([1.0] * 5).shape == (5,)
    ahead = model.forecast(log, 4, u=[0.0] * 4)
    assert np.all(np.isfinite(ahead.values)) and np.all(np.diff(ahead.standard_deviations) > 0)
    validation = model.validate(log, rows=slice(300, 400), require="white,fit>=70,coverage>=85")
    assert validation.unmet == [] and validation.document["in_sample"] == "no"
    assert model.validate(log, rows="1..300").document["in_sample"] == "yes"
    assert model.validate(log[:300]).document["in_sample"] == "yes"
    model.write_html(tmp_path / "page.html", log)
    assert "estimated as" in (tmp_path / "page.html").read_text()
    assert th.compare({"tank": model, "arx": th.arx(log, na=1, nb=1, estimate="1..300")}, log).document["criteria"] is not None
    again = th.Model.from_json(model.to_json())
    assert again.to_json() == model.to_json() == pickle.loads(pickle.dumps(model)).to_json()
    assert np.array_equal(again.predict(log, 3), model.predict(log, 3))
    plot.fit(model, log)
    plot.residuals(validation)


@pytest.mark.parametrize(
    "what", ["a", "orders", "stable", "poles", "to_state_space", "sample", "to_control"]
)
def test_what_equations_do_not_have_is_said_in_a_sentence(what: str) -> None:
    log = tank_log()
    model = th.grey(log, TANK)
    with pytest.raises((AttributeError, ValueError), match="is of polynomial models"):
        found = getattr(model, what)
        found(log) if what == "sample" else found()


def test_a_filter_takes_equations_and_their_fits() -> None:
    log = tank_log()
    box, model = th.GreyBox(TANK), th.grey(tank_log(), TANK)
    learning, fitted = th.StateFilter(box), th.StateFilter(model)
    assert (learning.unknown, fitted.unknown) == (["area"], [])
    trajectory = fitted.run(log)
    known = th.StateFilter(box.with_parameters(area=float(model.parameters[0])), "ekf").run(log)
    assert np.allclose(trajectory.filtered, known.filtered)
    assert np.array_equal(pickle.loads(pickle.dumps(th.StateFilter(box))).run(log).filtered, learning.run(log).filtered)
    with pytest.raises(ValueError, match="says itself where"):
        th.StateFilter(model, initial="zero")
    with pytest.raises(ValueError, match="a tracker is of polynomial models"):
        th.Tracker(warm=model)


def test_linear_equations_have_responses_and_others_not() -> None:
    model = th.grey(tank_log(), TANK)
    step = model.step_response(samples=60)
    assert step.values[0] == 0 and abs(step.values[-1] - 10) < 1 and step.standard_errors[5] > 0
    response = model.frequency_response(np.array([0.001, 0.1]))
    area = model.parameters[0]
    exact = 1 / (area * (np.exp(0.1j) - 1) + 0.1)
    assert response.sources == ["u"] and abs(response.values[0, 1] - exact) < 1e-9
    plot.bode(model)
    bent = th.grey(tank_log(), {**TANK, "next": {"level": "level + dt * (flow - loss * level - 0.01 * level^3) / area"}})
    with pytest.raises(ValueError, match="these equations are not linear"):
        bent.step_response()
    with pytest.raises(ValueError, match="there is no input 3"):
        model.step_response(3)


def test_several_outputs_have_responses_of_their_own() -> None:
    box = th.GreyBox(DATA / "dc_motor.toml")
    log = th.read_csv(DATA / "dc_motor.csv", inputs=box.inputs, output=box.outputs, time="t", uniform=False)
    model = th.grey(log, box, estimate="1..500")
    constant, friction = model.parameters
    speed = constant / (1.5 * friction + constant**2)
    responses = {name: model.step_response(samples=800, output=name) for name in model.outputs}
    assert abs(responses["speed"].values[-1] / speed - 1) < 1e-3
    assert abs(responses["i"].values[-1] / (friction * speed / constant) - 1) < 1e-2
    still = abs(model.frequency_response([1e-3], output=1).values[0, 0])
    assert abs(still / speed - 1) < 1e-3
    assert np.allclose(np.cumsum(model.impulse_response(samples=50, output="i").values), responses["i"].values[:50])
    with pytest.raises(ValueError, match="output: there are several: i, speed"):
        model.step_response()
    for output in (2, -1, "torque"):
        with pytest.raises(ValueError, match="there is no output"):
            model.step_response(output=output)
    assert "step of u to speed" in model._repr_html_()


def test_wrong_arguments_change_nothing() -> None:
    log = tank_log()
    wrong: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"estimate": "1..900"}, ValueError, "the log has 400 rows"),
        ({"starts": -1}, ValueError, "starts"),
        ({"tolerance": 0.0}, ValueError, "tolerance"),
        ({"model": th.GreyBox(TANK).with_parameters(area=2.0)}, ValueError, "none of its parameters is unknown"),
        ({"model": {**TANK, "inputs": {"flow": "v"}}}, ValueError, "needs channel 'v'"),
        ({"log": log.y}, TypeError, "expected a Log"),
    ]
    for arguments, error, words in wrong:
        with pytest.raises(error, match=words):
            th.grey(**{"log": log, "model": TANK, **arguments})
    still = th.Log(np.zeros(50), np.zeros(50), sample_time=1)
    with pytest.raises(th.EstimationError) as open_:
        th.grey(still, {**TANK, "parameters": {**TANK["parameters"], "loss": 0.0}})
    assert open_.value.parameters == ["area"]


def test_further_starts_find_the_lower_optimum() -> None:
    # A pendulum: from 6 the search ends where its frequency is another one.
    rng = np.random.default_rng(3)
    angle, rate, y = 1.0, 0.0, []
    for _ in range(300):
        y.append(angle + 0.02 * rng.standard_normal())
        # The midpoint rule, ten times as fine as the model's.
        for _ in range(50):
            middle = rate - 0.0005 * (9.8 * np.sin(angle) + 0.05 * rate)
            force = 9.8 * np.sin(angle + 0.0005 * rate) + 0.05 * middle
            angle, rate = angle + 0.001 * middle, rate - 0.001 * force
    log = th.Log(y, sample_time=0.05)
    box = th.GreyBox.from_functions(
        sample_time=0.05,
        states={"angle": (1.0, 0.0), "rate": (0.0, 0.0)},
        parameters={"stiffness": {"start": 3, "sd": 6, "unknown": True, "min": 0}, "damping": 0.05},
        derivative=lambda x, u, p: {"angle": x.rate, "rate": -p.stiffness * np.sin(x.angle) - p.damping * x.rate},
        outputs=lambda x, u, p: {"y": x.angle},
        measurement={"y": 0.02},
        substeps=5,
    )
    with pytest.warns(th.EstimationWarning):
        alone = th.grey(log, box, starts=0)
    best = th.grey(log, box, starts=20, seed=1)
    # Where nothing is said, more are tried if the first one explains the log badly.
    assert abs(th.grey(log, box).parameters[0] - 9.8) < 0.1
    assert abs(best.parameters[0] - 9.8) < 0.1 < abs(alone.parameters[0] - 9.8)
    assert best.log_likelihood > alone.log_likelihood
    assert best.to_json() == th.grey(log, box, starts=20, seed=1).to_json()


def test_all_searches_find_the_same_optimum() -> None:
    log = tank_log()
    usual = th.grey(log, TANK)
    for search in ("gauss-newton", "newton", "gradient"):
        found = th.grey(log, TANK, search=search, max_iterations=1000)
        assert json.loads(found.to_json())["estimation"]["search"]["algorithm"] == search
        assert abs(found.log_likelihood - usual.log_likelihood) < 1e-3
    with pytest.raises(ValueError, match="step"):
        th.grey(log, TANK, step=0.5)


def test_the_documents_are_those_of_the_command_line(tmp_path: Path) -> None:
    for name in ("mass_spring_damper", "dc_motor"):
        path, box = DATA / f"{name}.csv", th.GreyBox(DATA / f"{name}.toml")
        log = th.read_csv(path, inputs=box.inputs, output=box.outputs, time="t", uniform=False)
        model = th.grey(log, box, estimate="1..500", validate="501..700")
        report = tmp_path / "report.json"
        words = ["fit", "--grey", str(DATA / f"{name}.toml"), str(path), "--time", "t", "--estimate", "1..500"]
        words += ["--validate", "501..700", "--report", str(report)]
        subprocess.run([str(Path(sys.executable).with_name("thetahat")), *words], check=True, capture_output=True)
        assert model.to_json() == report.read_text()
        whole = model.predict(log, 2)
        assert whole.shape == ((len(log),) if len(box.outputs) == 1 else (len(log), len(box.outputs)))
        validation = model.validate(log)
        assert [noise["output"] for noise in validation.document["noise"]] == box.outputs
        if len(box.outputs) > 1:
            with pytest.raises(ValueError, match="output: there are several"):
                validation.fit()
        assert validation.fit(output=box.outputs[0]) > 50
        assert json.loads(model.to_json())["model"]["kind"] == "equations"


def test_states_and_parameters_keep_the_order_in_which_they_were_given() -> None:
    unknown = {"start": 1.0, "sd": 1.0, "unknown": True}
    box = th.GreyBox.from_functions(
        sample_time=1,
        states={"slow": (0, 1), "fast": (0, 1)},
        inputs={"v": "u"},
        parameters={"tau": unknown, "gain": unknown},
        next=lambda x, u, p, dt: {"slow": x.slow + (p.gain * u.v - x.slow) / p.tau, "fast": x.slow},
        outputs=lambda x, u, p: {"y": x.fast},
        measurement={"y": 0.1},
    )
    assert (box.states, box.unknown) == (["slow", "fast"], ["tau", "gain"])
    again = th.GreyBox(box.to_dict())
    assert (again.states, again.unknown) == (box.states, box.unknown)


OCV = ([0.0, 0.1, 0.3, 0.6, 0.9, 1.0], [3.0, 3.45, 3.6, 3.75, 4.0, 4.2])


def cell_log(rows: int = 600, seed: int = 5) -> th.Log:
    """A cell that is discharged and charged, whose voltage at rest goes by straight lines; its resistance is 0.02 Ohm."""
    rng = np.random.default_rng(seed)
    current, charge, level = np.zeros(rows), np.zeros(rows), 0.95
    for t in range(rows):
        if t % 20 == 0:
            goal = 0.95 - 0.9 * (t + 20) / rows
            current[t : t + 20] = 10 * (goal - level) + 0.3 * rng.uniform(-1, 1)
        charge[t] = level
        level += current[t] / 200
    v = np.interp(charge, *OCV) + 0.02 * current + 0.005 * rng.standard_normal(rows)
    assert charge.min() < 0.1 and charge.max() > 0.92 and np.sum(current > 0) > 50
    return th.Log(v, current, sample_time=1, input_names=["i"], output_name="v")


def cell(outputs: Any, **parameters: Any) -> th.GreyBox:
    return th.GreyBox.from_functions(
        sample_time=1,
        states={"soc": (0.95, 0.0)},
        inputs={"current": "i"},
        parameters={"r0": {"start": 0.05, "sd": 0.05, "unknown": True, "min": 0}, **parameters},
        next=lambda x, u, p, dt: {"soc": x.soc + dt * u.current / 200},
        outputs=lambda x, u, p: {"v": outputs(x, u, p)},
        measurement={"v": 0.005},
    )


def test_tables_of_numpy_and_ours_are_fitted() -> None:
    log = cell_log()
    boxes = [
        cell(lambda x, u, p: np.interp(x.soc, *OCV) + p.r0 * u.current),
        cell(lambda x, u, p: th.table(x.soc, *OCV, method="linear") + p.r0 * u.current),
    ]
    assert boxes[0] == boxes[1]
    model = th.grey(log, boxes[0])
    assert abs(model.parameters[0] - 0.02) < 3 * model.standard_errors[0] < 0.01
    # Charge and resistance are told apart by cubics too, though these are not the cell's lines.
    assert abs(th.grey(log, cell(lambda x, u, p: th.table(x.soc, *OCV) + p.r0 * u.current)).parameters[0] - 0.02) < 0.02
    # All values but the first are unknown.
    names = [f"v{i}" for i in range(1, 6)]
    unknown = {name: {"start": 3.7, "sd": 0.5, "unknown": True} for name in names}
    learned = th.grey(
        log, cell(lambda x, u, p: np.interp(x.soc, OCV[0], [3.0, *(p[name] for name in names)]) + p.r0 * u.current, **unknown)
    )
    assert learned.parameter_names == ["r0", *names]
    truth = np.array([0.02, *OCV[1][1:]])
    assert np.all(np.abs(learned.parameters - truth) < 3 * learned.standard_errors)


def test_branches_of_numpy_and_ours_are_fitted() -> None:
    log = cell_log()
    # Another resistance for each direction, written in three ways.
    forms = [
        lambda x, u, p: np.where(u.current < 0, 3.7 + p.r0 * u.current, 3.7 + p.r1 * u.current),
        lambda x, u, p: th.where(~(u.current >= 0), p.r0, p.r1) * u.current + 3.7,
        lambda x, u, p: 3.7 + p.r0 * np.clip(u.current, -9, 0) + p.r1 * np.clip(u.current, 0, None),
    ]
    likelihoods = []
    for form in forms:
        box = cell(form, r1={"start": 0.1, "sd": 0.1, "unknown": True})
        likelihoods.append(th.grey(log, box).log_likelihood)
    assert np.allclose(likelihoods, likelihoods[0], rtol=1e-9)

    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(-1, 1, 60), 10)
    through = np.where(u > 0.3, u - 0.3, np.where(u < -0.2, u + 0.2, 0.0))
    flow = np.zeros(600)
    for t in range(1, 600):
        flow[t] = 0.8 * flow[t - 1] + 0.5 * through[t - 1]
    valve = th.GreyBox.from_functions(
        sample_time=1,
        states={"flow": (0, 0.01)},
        inputs=["u"],
        parameters={
            "low": {"start": -0.1, "sd": 0.2, "unknown": True, "max": 0},
            "high": {"start": 0.1, "sd": 0.2, "unknown": True, "min": 0},
            "gain": {"start": 1, "sd": 1, "unknown": True},
        },
        next=lambda x, u, p, dt: {
            "flow": 0.8 * x.flow + p.gain * th.where(u.u > p.high, u.u - p.high, th.where(u.u < p.low, u.u - p.low, 0))
        },
        outputs=lambda x, u, p: {"y": x.flow},
        process={"flow": 0.001},
        measurement={"y": 0.02},
    )
    model = th.grey(th.Log(flow + 0.02 * rng.standard_normal(600), u, sample_time=1), valve)
    assert np.all(np.abs(model.parameters - [-0.2, 0.3, 0.5]) < 3 * model.standard_errors)


def test_conditions_and_tables_as_text() -> None:
    def text(form: Any) -> str:
        return str(cell(form).to_dict()["outputs"]["v"])

    cases: list[tuple[Any, str]] = [
        (lambda x, u, p: th.where(x.soc > 0.5, 1, p.r0), "(if soc > 0.5 then 1.0 else r0)"),
        (lambda x, u, p: th.where(0.5 >= x.soc, 1, 2, width=0.1), "(if soc <= 0.5 within 0.1 then 1.0 else 2.0)"),
        (
            lambda x, u, p: np.where((x.soc > 0) & (x.soc < 1), 1, 2),
            "(if soc > 0.0 then (if soc < 1.0 then 1.0 else 2.0) else 2.0)",
        ),
        (
            lambda x, u, p: np.where(np.logical_or(x.soc < 0, x.soc > 1), 1, 2),
            "(if soc < 0.0 then 1.0 else (if soc > 1.0 then 1.0 else 2.0))",
        ),
        (lambda x, u, p: th.where(True, x.soc, 2), "soc"),
        (lambda x, u, p: np.clip(x.soc, None, 1.0), "min(soc, 1.0)"),
        (lambda x, u, p: np.clip(x.soc, p.r0, 1), "sat(soc, r0, 1.0)"),
        (
            lambda x, u, p: np.interp(x[0] * 2, [0, 1], np.array([3, 4]), left=9),
            "(if (soc * 2.0) < 0.0 then 9.0 else lines((soc * 2.0); 0.0:3.0, 1.0:4.0))",
        ),
        (lambda x, u, p: th.table(x["soc"], [-1, 1], [p["r0"], -p.r0]), "table(soc; (-1.0):r0, 1.0:(-r0))"),
        (lambda x, u, p: sum(x) + len(u), "((soc + 0.0) + 1.0)"),
    ]
    for form, expected in cases:
        assert text(form) in (expected, expected.replace("(soc + 0.0)", "(0.0 + soc)")), expected


def test_errors_of_functions_name_these_and_their_lines() -> None:
    def made(**change: Any) -> th.GreyBox:
        arguments: dict[str, Any] = {
            "sample_time": 1,
            "states": {"level": (0, 1), "rate": (0, 1)},
            "inputs": {"flow": "u"},
            "parameters": {"area": {"start": 1.0, "sd": 1, "unknown": True}},
            "next": lambda x, u, p, dt: {"level": x.rate, "rate": u.flow * p.area},
            "outputs": lambda x, u, p: {"y": x.level},
            "measurement": {"y": 1.0},
        }
        return th.GreyBox.from_functions(**{**arguments, **change})

    def wrong_name(x: Any, u: Any, p: Any, dt: Any) -> Any:
        level = x.level
        return {"level": level, "rate": x.rte}

    first = wrong_name.__code__.co_firstlineno
    cases: list[tuple[Any, type[Exception], str]] = [
        (
            wrong_name,
            AttributeError,
            rf"^next, which is 'wrong_name' of test_grey_box.py, line {first + 2} \(defined in line {first}\): there is no state 'rte', "
            "the states are level, rate; did you mean 'rate'",
        ),
        (lambda x, u, p, dt: {"level": x.level}, ValueError, "lambda of test_grey_box.py.* the state 'rate' has no equation; it returned level"),
        (lambda x, u, p, dt: {"level": 0, "rate": 0, "flow": 1}, ValueError, "'flow' is no state, the states are level, rate"),
        (lambda x, u, p, dt: {"level": x[2], "rate": 0}, IndexError, "there is no state 2, the states are level, rate"),
        (lambda x, u, p, dt: {"level": x["l"], "rate": 0}, KeyError, "there is no state 'l'"),
        (lambda x, u, p, dt: {"level": u.u, "rate": 0}, AttributeError, "there is no input 'u', the inputs are flow"),
        (lambda x, u, p, dt: {"level": x.rate if x.rate > 0 else 0, "rate": 0}, TypeError, "rate > 0.0.*th.where"),
        (lambda x, u, p, dt: {"level": 0 < x.rate < 1, "rate": 0}, TypeError, "join conditions by &"),
        (lambda x, u, p, dt: {"level": x.rate > 0, "rate": 0}, TypeError, r"is a condition and no number: use th.where"),
        (lambda x, u, p, dt: {"level": (x.rate > 0) * 2, "rate": 0}, TypeError, "multiply: .*is a condition"),
        (lambda x, u, p, dt: {"level": x.rate == 0, "rate": 0}, TypeError, "hardly ever equal"),
        (lambda x, u, p, dt: {"level": np.inf * x.rate, "rate": 0}, ValueError, "inf is not a finite number"),
        (lambda x, u, p, dt: {"level": np.floor(x.rate), "rate": 0}, TypeError, "floor: equations have .*np.interp"),
        (lambda x, u, p, dt: {"level": np.nan_to_num(x.rate), "rate": 0}, TypeError, "nan_to_num: equations have"),
        (lambda x, u, p, dt: {"level": th.table(x.rate, [0, 1], [1]), "rate": 0}, ValueError, "2 knots, but 1 values"),
        (lambda x, u, p, dt: {"level": th.table(x.rate, [0, 0], [1, 1]), "rate": 0}, ValueError, "they must rise, but 0 follows 0"),
        (lambda x, u, p, dt: {"level": th.table(x.rate, [0], [1]), "rate": 0}, ValueError, "at least two"),
        (lambda x, u, p, dt: {"level": th.table(x.rate, [0, 1], [1, 1], method="x"), "rate": 0}, ValueError, "one of monotone"),  # type: ignore[arg-type]
        (lambda x, u, p, dt: {"level": np.interp(x.rate, [0, 1], [1, x.level]), "rate": 0}, ValueError, "in next\\['level'\\], lines.*of states"),
        (lambda x, u, p, dt: {"level": np.interp(x.rate, [0, 1], [1, 2], period=3), "rate": 0}, TypeError, "period"),
        (lambda x, u, p, dt: {"level": th.where(x.rate, 1, 2), "rate": 0}, TypeError, "expected a comparison"),
    ]
    for function, kind, words in cases:
        with pytest.raises(kind, match=words) as caught:
            made(next=function)
        assert "next, which is" in str(caught.value)
    with pytest.raises(ValueError, match=r"^parameters\['area'\]: the unknown parameter 'area' starts at 0 and needs 'sd'"):
        made(parameters={"area": {"start": 0.0, "unknown": True}})
    assert made(parameters={"area": {"start": -2.0, "unknown": True}})
    with pytest.raises(ValueError, match=r"^states\['level'\]: 'level' is there twice|^parameters\['level'\]: the name 'level'"):
        made(parameters={"level": 1.0, "area": 1.0})
    with pytest.raises(AttributeError, match="the model has no parameters"):
        made(parameters={})
    assert made(next=lambda x, u, p, dt: {"level": x[1], "rate": x[0]}).to_dict()["next"] == {"level": "rate", "rate": "level"}
    by_class = type("Plant", (), {"__call__": lambda self, x, u, p: {"y": x.lvl}})()
    with pytest.raises(AttributeError, match="outputs, which is 'Plant' of test_grey_box.py"):
        made(outputs=by_class)


def swinging(rng: np.random.Generator) -> tuple[th.Log, Callable[[Sequence[float]], th.GreyBox], tuple[float, ...]]:
    """A pendulum that is driven, its length and its damping."""
    dt, length, damping = 0.02, 0.7, 0.3
    u, x, y = np.repeat(rng.uniform(-3, 3, 30), 20), np.array([0.5, 0.0]), np.zeros(600)
    for k in range(600):
        y[k] = x[0] + 0.005 * rng.standard_normal()
        for _ in range(100):
            x = x + dt / 100 * np.array([x[1], -9.81 / length * np.sin(x[0]) - damping * x[1] + u[k]])

    def model(factors: Sequence[float]) -> th.GreyBox:
        return th.GreyBox.from_functions(
            sample_time=dt,
            states={"angle": (0, 1), "rate": (0, 1)},
            inputs={"torque": "u"},
            parameters=started({"length": length, "damping": damping}, factors),
            derivative=lambda x, u, p: {"angle": x.rate, "rate": -9.81 / p.length * np.sin(x.angle) - p.damping * x.rate + u.torque},
            outputs=lambda x, u, p: {"y": x.angle},
            measurement={"y": 0.005},
            process={"rate": 1e-4},
        )

    return th.Log(y, u, sample_time=dt), model, (length, damping)


def rubbing(rng: np.random.Generator) -> tuple[th.Log, Callable[[Sequence[float]], th.GreyBox], tuple[float, ...]]:
    """A motor with friction: its gain, its time constant, and the friction."""
    dt, gain, lag, friction = 0.01, 10.0, 0.15, 8.0
    u, speed, y = np.repeat(rng.uniform(-6, 6, 40), 25), 0.0, np.zeros(1000)
    for k in range(1000):
        y[k] = speed + 0.2 * rng.standard_normal()
        for _ in range(20):
            speed += dt / 20 * (gain * u[k] - speed - friction * np.tanh(speed)) / lag

    def model(factors: Sequence[float]) -> th.GreyBox:
        return th.GreyBox.from_functions(
            sample_time=dt,
            states={"speed": (0, 1)},
            inputs={"voltage": "u"},
            parameters=started({"gain": gain, "lag": lag, "friction": friction}, factors),
            derivative=lambda x, u, p: {"speed": (p.gain * u.voltage - x.speed - p.friction * np.tanh(x.speed)) / p.lag},
            outputs=lambda x, u, p: {"y": x.speed},
            measurement={"y": 0.2},
            process={"speed": 0.05},
        )

    return th.Log(y, u, sample_time=dt), model, (gain, lag, friction)


def started(truth: dict[str, float], factors: Sequence[float]) -> dict[str, Any]:
    starts = {name: value * factor for (name, value), factor in zip(truth.items(), factors)}
    return {name: {"start": start, "sd": start, "unknown": True, "min": 0} for name, start in starts.items()}


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize(
    ("plant", "seed", "factors"),
    [
        # The search from these ends far below the largest likelihood, or cannot begin.
        (swinging, 7, (10, 10)),
        (swinging, 16, (10, 0.1)),
        (rubbing, 0, (0.1, 0.1, 10)),
        (rubbing, 12, (0.1, 0.1, 10)),
        (rubbing, 14, (10, 0.1, 0.1)),
        # From these it does not.
        (swinging, 1, (0.1, 0.1)),
        (rubbing, 1, (0.1, 10, 10)),
    ],
)
def test_starts_ten_times_off_find_the_plant(plant: Any, seed: int, factors: Sequence[float]) -> None:
    log, model, truth = plant(np.random.default_rng(seed))
    found = th.grey(log, model(factors))
    known = th.grey(log, model([1.0] * len(truth)))
    np.testing.assert_allclose(found.parameters, known.parameters, rtol=1e-3)
    np.testing.assert_allclose(found.parameters, truth, rtol=0.05)


def test_noises_starts_holds_and_delays_of_functions() -> None:
    rng = np.random.default_rng(5)
    outside = 5 + 4 * np.sin(np.arange(900) / 40)
    heating = np.repeat(rng.normal(2, 1, 90), 10)
    room, y = 19.0, np.zeros(900)
    for row in range(900):
        y[row] = room + 0.05 * rng.standard_normal()
        rise = outside[min(row + 1, 899)] - outside[row]
        late = heating[max(row - 3, 0)]
        kept = np.exp(-0.5 / 4)
        towards = outside[row] + 8 * late
        room = towards + rise * (1 - 4 * (1 - kept) / 0.5) + (room - towards) * kept + 0.1 * rng.standard_normal()
    log = th.Log({"to": outside, "q": heating, "y": y}, sample_time=0.5)
    box = th.GreyBox.from_functions(
        sample_time=0.5,
        states={"room": ("first", 0.1)},
        inputs={"outside": {"channel": "to", "hold": "linear"}, "heating": "q"},
        parameters={
            "first": {"start": 20, "sd": 5, "unknown": True},
            "delay": {"start": 0.6, "sd": 1, "unknown": True, "min": 0, "max": 5},
            "tau": {"start": 8, "sd": 8, "unknown": True, "min": 0},
            "moved": {"start": 0.3, "sd": 0.3, "unknown": True, "min": 0},
        },
        derivative=lambda x, u, p: {"room": (u.outside + 8 * th.delayed(u.heating, p.delay) - x.room) / p.tau},
        outputs=lambda x, u, p: {"y": x.room},
        process=lambda x, u, p: {"room": p.moved},
        measurement={"y": {"start": 0.2, "unknown": True}},
    )
    assert box.unknown == ["first", "delay", "tau", "moved", "measurement.y"]
    with pytest.raises(TypeError, match="expected an input, such as u.flow"):
        th.delayed(2 * Expression("a"), 1)
    model = th.grey(log, box, profile=True)
    for value, error, truth in zip(model.parameters, model.standard_errors, [19, 1.5, 4, 0.1, 0.05]):
        assert abs(value - truth) < 4 * error
    intervals = {own["name"]: (own["low"], own["high"]) for own in json.loads(model.to_json())["estimation"]["profile"]}
    for name, value in zip(box.unknown, model.parameters):
        assert intervals[name][0] < value < intervals[name][1]
    # A filter takes the noises as they start.
    assert th.StateModel.from_toml(box.to_toml()).unknown == ["first", "delay", "tau"]

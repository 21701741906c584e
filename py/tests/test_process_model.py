"""Processes in continuous time, and what every method makes of them."""

from __future__ import annotations

import json
import pickle
import warnings
from typing import Any

import numpy as np
import pytest

import thetahat as th
from thetahat import plot


def log(rows: int = 400, noise: float = 0.02) -> th.Log:
    """A first-order process with a dead time on an irregular clock, from rest."""
    rng = np.random.default_rng(0)
    t = np.arange(rows) * 0.5 + 0.2 * np.sin(1.7 * np.arange(rows))
    u = np.repeat([0.0, 1.0, -0.5, 0.7], rows // 4)
    y = np.full(rows, 20.0)
    for start in (rows // 4, rows // 2, 3 * rows // 4):
        s = np.maximum(t - t[start] - 1.3, 0)
        y += 2 * (u[start] - u[start - 1]) * (1 - np.exp(-s / 5))
    return th.Log(y + noise * rng.standard_normal(rows), u, time=t, uniform=False)


def test_the_process_is_found_and_every_method_takes_it() -> None:
    data = log()
    model = th.process(data, "p1d")
    assert model.parameter_names == ["K", "tau", "theta"]
    assert model.parameters == pytest.approx([2, 5, 1.3], abs=0.05)
    assert model.kind == "process"
    assert np.all(np.isfinite(model.standard_errors))
    again = pickle.loads(pickle.dumps(model))
    assert json.loads(again.to_json()) == json.loads(model.to_json())
    run = model.simulate(data)
    assert np.std(run - data.y) < 0.05 * np.std(data.y)
    assert model.predict(data) == pytest.approx(run)
    assert np.std(model.residuals(data)) == pytest.approx(0.02, rel=0.2)
    assert model.validate(data, rows=slice(200, 400), require="fit>=90").document["model"] == "process p1d"
    assert model.step_response(samples=200).values[-1] == pytest.approx(model.parameters[0], rel=1e-3)
    assert abs(model.frequency_response([0.001]).values[0]) == pytest.approx(model.parameters[0], rel=0.01)
    assert "process p1d" in model._repr_html_()
    with pytest.raises(AttributeError, match="this one is a process"):
        _ = model.orders
    plot.step(model)


def test_several_inputs_starts_and_lines() -> None:
    data = log()
    u = data["u"]
    v = np.repeat([0.0, 1.0], len(u) // 2)
    since = np.maximum(data.time - data.time[len(u) // 2], 0)
    y = data.y + 0.01 * data.time + 3 * (1 - np.exp(-since / 4))
    both = th.Log(y, {"u": u, "v": v}, time=data.time, uniform=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", th.EstimationWarning)
        model = th.process(both, ["p1d", "p1"], trend=True)
    assert model.parameter_names == ["K[u]", "tau[u]", "theta[u]", "K[v]", "tau[v]"]
    assert model.parameters[3:] == pytest.approx([3, 4], rel=0.1)
    free = th.process(data, "p1d", initial="estimate")
    assert free.parameters == pytest.approx([2, 5, 1.3], abs=0.05)


def test_a_measured_response_makes_a_process() -> None:
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], 800), 5)
    pole = np.exp(-0.5 / 5)
    y = np.zeros(len(u))
    for k in range(1, len(u)):
        y[k] = pole * y[k - 1] + 2 * (1 - pole) * u[k - 1]
    response = th.spectrum(th.Log(y + 0.02 * rng.standard_normal(len(u)), u, sample_time=0.5))
    model = th.process(response, "p1")
    assert model.parameters == pytest.approx([2, 5], rel=0.01)
    assert model.method == "frequency-response"
    log = th.Log(y, u, sample_time=0.5)
    found = th.compare({"p1": model, "arx": th.arx(log, 1, 1, nk=4)}, log, over=response)
    outside = [own["response"][0]["outside"] for own in found.document["models"]]
    assert outside[0] < 0.1 * outside[1]
    with pytest.raises(TypeError, match="over"):
        th.compare([model], log, over=log)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="--trend|trend"):
        th.process(response, "p1", trend=True)


def test_what_is_wrong_is_told() -> None:
    data = log()
    for structure, words in [("p9", "structure"), (["p1d", "p1"], "2 for 1 inputs"), ("", "structure")]:
        with pytest.raises(ValueError, match=words):
            th.process(data, structure)
    constant = th.Log(np.arange(20.0), np.ones(20), sample_time=1)
    with pytest.raises(th.EstimationError, match="never changes"):
        th.process(constant)
    with pytest.raises(TypeError):
        th.process(data, 3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="drop"):
        th.process(data, initial="drop")


def test_a_choice_on_a_step_test_may_come_to_a_process() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(300) * 0.5
    u = (t >= 30).astype(float)
    slow = 1 - (1 + (t - 33) / 5) * np.exp(-(t - 33) / 5)
    y = 20 + np.where(t > 33, 2 * slow, 0) + 0.02 * rng.standard_normal(300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", th.EstimationWarning)
        model = th.search(th.Log(y, u, sample_time=0.5))
    assert model.selection is not None
    assert [process["structure"] for process in model.selection["processes"]][0] == "p2du"
    assert model.kind == "process"
    assert dict(zip(model.parameter_names, model.parameters))["K"] == pytest.approx(2, abs=0.02)
    plot.selection(model)
    again = pickle.loads(pickle.dumps(model))
    assert json.loads(again.to_json()) == json.loads(model.to_json())


def test_transfer_functions_are_found_on_any_clock_and_of_responses() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(600) * 0.1 + 0.03 * np.sin(1.7 * np.arange(600))
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 6)
    # 20/(s^2 + 2 s + 20) and 3/(s + 0.5), by the responses to their steps.
    steps = np.diff(u, prepend=u[0])
    since = np.maximum(t[:, None] - t[None, :], 0)
    damped = np.sqrt(19)
    pair = 1 - np.exp(-since) * (np.cos(damped * since) + np.sin(damped * since) / damped)
    v = np.roll(u, 30)
    lag = 6 * (1 - np.exp(-0.5 * since))
    y = 5 + pair @ steps + lag @ np.diff(v, prepend=v[0])
    y += 0.02 * rng.standard_normal(600)
    data = th.Log(y, {"u": u, "v": v}, time=t, uniform=False)
    model = th.tf(data, np=[2, 1], nz=[0, 0])
    assert model.parameter_names == ["b0[u]", "a1[u]", "a0[u]", "b0[v]", "a0[v]"]
    assert model.parameters == pytest.approx([20, 2, 20, 3, 0.5], rel=0.05)
    assert np.all(np.abs(model.parameters - [20, 2, 20, 3, 0.5]) < 4 * model.standard_errors)
    continuous = model.converted("continuous")
    assert continuous.document["model"]["poles"][0]["covariance"] is not None
    again = th.Model.from_json(model.to_json())
    assert again.predict(data) == pytest.approx(model.predict(data))

    even = th.Log(y, {"u": u, "v": v}, sample_time=0.1)
    even = th.Log(model.simulate(even, initial="zero"), {"u": u, "v": v}, sample_time=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", th.EstimationWarning)
        exact = th.tf(even, [2, 1], [0, 0], initial="zero")
    assert exact.parameters == pytest.approx(model.parameters, rel=1e-6)

    wrong: list[tuple[dict[str, Any], str]] = [
        ({"np": 7}, "7 poles"),
        ({"np": 2, "nz": 3}, "3 zeros"),
        ({"np": []}, "np: there is none"),
        ({"np": [1, 2, 3]}, "3 for 2 inputs"),
    ]
    for arguments, words in wrong:
        with pytest.raises(ValueError, match=words):
            th.tf(data, **arguments)
    mistyped: list[dict[str, Any]] = [{"np": 2.5}, {"np": 2, "delay": "no"}]
    for arguments in mistyped:
        with pytest.raises(TypeError, match="np|delay"):
            th.tf(data, **arguments)

"""Frequency responses that were measured elsewhere, and fits to them."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import thetahat as th

OMEGA = np.logspace(-2, 3, 60)
TRUTH = {"r0": 0.015, "r1": 0.01, "tau1": 0.05, "r2": 0.04, "tau2": 8.0}
CELL: dict[str, Any] = {
    "sample_time": 1,
    "states": {"fast": {"start": 0, "sd": 0}, "slow": {"start": 0, "sd": 0}},
    "inputs": {"i": "current"},
    "parameters": {
        name: {"start": start, "sd": start, "unknown": True, "min": 0}
        for name, start in [("r0", 0.02), ("r1", 0.02), ("tau1", 0.2), ("r2", 0.02), ("tau2", 20)]
    },
    "derivative": {"fast": "(r1 * i - fast) / tau1", "slow": "(r2 * i - slow) / tau2"},
    "outputs": {"voltage": "r0 * i + fast + slow"},
    "noise": {"measurement": {"voltage": 0.001}},
}


def impedance(error: float = 0.0, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    s = 1j * OMEGA
    values = TRUTH["r0"] + TRUTH["r1"] / (1 + TRUTH["tau1"] * s) + TRUTH["r2"] / (1 + TRUTH["tau2"] * s)
    return values + error * (random.standard_normal(60) + 1j * random.standard_normal(60))


def given(values: Any, **arguments: Any) -> th.MeasuredResponse:
    return th.MeasuredResponse.given(OMEGA, values, input="current", output="voltage", **arguments)


def test_a_response_is_what_was_given() -> None:
    found = given(impedance(), standard_deviations=np.full(60, 1e-4))
    assert found.continuous and found.inputs == ["current"] and found.output == "voltage"
    np.testing.assert_allclose(found.values[0], impedance(), rtol=1e-14)
    np.testing.assert_allclose(found.magnitude_errors[0], 1e-4, rtol=1e-12)
    assert np.isnan(given(impedance()).magnitude_errors).all()
    assert pickle.loads(pickle.dumps(found)).to_json() == found.to_json()
    held = th.MeasuredResponse.given([1.0, 0.5], [1, 1j], held=0.1)
    assert not held.continuous and held.sample_time == 0.1 and held.frequencies.tolist() == [0.5, 1.0]
    assert not th.spectrum(th.dc_motor()).continuous
    band = found.within(0.1, 10)
    assert band.frequencies.min() >= 0.1 and band.frequencies.max() <= 10 and band.values.shape == band.magnitude.shape
    with pytest.raises(ValueError, match="no point between"):
        found.within(1e7, 1e8)


@pytest.mark.parametrize("known", [True, False])
def test_the_elements_of_a_cell_come_back(known: bool) -> None:
    error = 1e-4
    response = given(impedance(error), standard_deviations=np.full(60, error) if known else None)
    model = th.grey(response, CELL)
    for name, value, spread in zip(model.parameter_names, model.parameters, model.standard_errors):
        assert abs(value - TRUTH[name]) < 4 * spread < 0.2 * TRUTH[name], name
    again = th.grey(response, th.GreyBox(CELL))
    assert again.parameters.tolist() == model.parameters.tolist()
    process = th.process(response, "rc2")
    assert abs(process.parameters[0] - TRUTH["r0"]) < 4 * process.standard_errors[0]


def test_a_transfer_function_in_continuous_time_comes_back() -> None:
    s = 1j * OMEGA
    response = th.MeasuredResponse.given(OMEGA, (2 * s + 3) / (s**2 + 0.4 * s + 25))
    model = th.tf(response, 2, 1)
    np.testing.assert_allclose(model.parameters, [2, 3, 0.4, 25], rtol=1e-5)
    late = th.MeasuredResponse.given(OMEGA, (2 * s + 3) * np.exp(-0.01 * s) / (s**2 + 0.4 * s + 25))
    np.testing.assert_allclose(th.tf(late, 2, 1, delay=True).parameters, [2, 3, 0.4, 25, 0.01], rtol=1e-4)
    # A dead time, where the phase turns no more than a few times.
    late = th.MeasuredResponse.given(OMEGA[:42], 3 * np.exp(-0.2 * s[:42]) / (1 + 4 * s[:42]))
    np.testing.assert_allclose(th.process(late, "p1d").parameters, [3, 4, 0.2], rtol=1e-5)


@pytest.mark.parametrize(
    ("frequencies", "values", "arguments", "message"),
    [
        ([], [], {}, "none above frequency 0"),
        ([0.0], [1.0], {}, "none above frequency 0"),
        ([1.0, -1.0], [1, 1], {}, "point 2: a frequency of -1 rad/s"),
        ([1.0, np.inf], [1, 1], {}, "point 2"),
        ([1.0, 2.0], [1, complex(np.nan, 0)], {}, "point 2"),
        ([1.0, 2.0], [1, 1], {"standard_deviations": [0.1, 0.0]}, "point 2: a standard deviation of 0"),
        ([1.0, 2.0], [1, 1], {"held": -1.0}, "no time that an input is held"),
        ([1.0, 40.0], [1, 1], {"held": 0.1}, "40 rad/s is more than"),
        ([1.0, 2.0], [1, 1, 1], {}, "values"),
        ([1.0, 2.0], [1, 1], {"standard_deviations": [0.1]}, "standard_deviations"),
        ([1.0, 2.0], [1, 1], {"input": "y"}, "'y' is the input already"),
    ],
)
def test_points_that_make_no_response_are_refused(
    frequencies: list[float], values: list[complex], arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        th.MeasuredResponse.given(frequencies, values, **arguments)


def test_what_a_response_cannot_say_is_refused() -> None:
    response = given(impedance())
    with pytest.raises(ValueError, match="a template finds its start values in a log"):
        th.grey(response, "template:battery")
    with pytest.raises(ValueError, match="has no rows"):
        th.grey(response, CELL, estimate=slice(0, 10))
    with pytest.raises(ValueError, match="the response has the input 'current'"):
        th.grey(response, {**CELL, "inputs": {"i": "amps"}})
    both = {**CELL, "parameters": {**CELL["parameters"], "rest": CELL["parameters"]["r0"]}}
    both["outputs"] = {"voltage": "(r0 + rest) * i + fast + slow"}
    with pytest.raises(th.EstimationError, match="'r0' and 'rest'"):
        th.grey(response, both)


def test_a_state_space_model_of_a_response_is_the_truth() -> None:
    response = given(impedance(1e-5), standard_deviations=np.full(60, 1e-5))
    model = th.ss(response)
    assert model.kind == "continuous-state-space" and len(model.poles()) == 2
    taus = sorted(-1 / model.poles().real)
    np.testing.assert_allclose(taus, [TRUTH["tau1"], TRUTH["tau2"]], rtol=0.01)
    gain, error = model.dc_gain()
    assert abs(gain - 0.065) < 4 * error < 1e-3
    with pytest.raises(ValueError, match="weighting"):
        th.ss(response, 2, weighting="cva")
    with pytest.raises(ValueError, match="nk"):
        th.ss(response, 2, nk=1)
    rng = np.random.default_rng(3)
    u, x = rng.normal(size=3000), np.zeros((3001, 2))
    for k in range(3000):
        x[k + 1] = [1.6 * x[k, 0] - 0.8 * x[k, 1] + 0.2 * u[k], x[k, 0]]
    log = th.Log(x[:-1, 0] + 0.1 * rng.normal(size=3000), u, sample_time=0.1)
    sampled = th.ss(th.spectrum(log), 2)
    pole = sampled.poles()[0]
    assert sampled.kind == "state-space" and abs(pole - (0.8 + 0.4j)) < 0.01
    assert sampled.to_state_space().H.shape == (1, 2)

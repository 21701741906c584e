"""Controllers for models, self-tuners, and loops that run."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable

import numpy as np
import pytest

import thetahat as th


@pytest.fixture(scope="module")
def motor() -> th.Model:
    return th.arx(th.dc_motor(), na=2, nb=2)


def test_each_design_gives_a_stable_loop(motor: th.Model) -> None:
    for found in (
        th.pole_placement(motor, [0.8, 0.7]),
        th.pole_placement(motor, [0.7 + 0.2j, 0.7 - 0.2j], observer=0.3, limits=(-5, None)),
        th.lqr(motor, 0.1),
        th.minimum_variance(motor, 0.01),
    ):
        assert found.closed_loop["stable"] and found.stable_share is not None
        assert found.r[0] == 1 and abs(found.r.sum()) < 1e-9, "it integrates"
        assert np.isclose(found.closed_loop["static_gain"], 1)
        assert "pole of the loop" in found.summary() and repr(found).startswith("Control(")
    assert th.lqr(motor, 0.1, integrator=False).document["state_feedback"]


def test_the_responses_are_those_of_the_loop_that_runs(motor: th.Model) -> None:
    found = th.pole_placement(motor, [0.8, 0.7])
    expected = found.closed_loop["setpoint_response"]
    run = th.closed_loop(found.controller(), motor, np.ones(len(expected)), noise=False)
    np.testing.assert_allclose(run.y, expected, atol=1e-9)
    np.testing.assert_allclose(run.u, found.closed_loop["controller_output"], atol=1e-9)
    again = th.closed_loop(found.controller(), motor, np.ones(50), seed=3)
    np.testing.assert_array_equal(again.y, th.closed_loop(found.controller(), motor, np.ones(50), seed=3).y)


def test_python_control_sees_the_same_loop(motor: th.Model) -> None:
    control = pytest.importorskip("control")
    found = th.pole_placement(motor, [0.8, 0.7])
    forward, back = found.to_control()
    plant = motor.to_control()
    loop = control.feedback(plant, back)
    response = control.step_response(control.series(forward, loop), T=found.closed_loop["time"])
    np.testing.assert_allclose(np.squeeze(response.outputs), found.closed_loop["setpoint_response"], atol=1e-6)


def test_limits_hold(motor: th.Model) -> None:
    level = th.pole_placement(motor, 0.5).document["input"]["offset"]["level"]
    found = th.pole_placement(motor, 0.5, limits=(level - 0.5, level + 0.5))
    run = th.closed_loop(found.controller(), motor, np.full(100, 3.0), noise=False)
    assert np.abs(run.u).max() <= 0.5 + 1e-12
    outside = th.pole_placement(motor, 0.5, limits=(level + 1, level + 2))
    assert any("outside of the limits" in warning for warning in outside.warnings)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda model: th.pole_placement(model, 1.2), "not inside the unit circle"),
        (lambda model: th.pole_placement(model, [0.5 + 0.1j]), "conjugate"),
        (lambda model: th.pole_placement(model, []), "one or more"),
        (lambda model: th.pole_placement(model, math.nan), "pole"),
        (lambda model: th.lqr(model, 0), "not a positive"),
        (lambda model: th.minimum_variance(model, -1), "not 0 or more"),
        (lambda model: th.lqr(model, 1, input="v"), "none called 'v'"),
        (lambda model: th.lqr(model, 1, limits=(2, 1)), "no range"),
        (lambda model: th.closed_loop(th.lqr(model, 1).controller(), model, [math.nan]), "set_point"),
    ],
)
def test_what_cannot_be_designed_is_refused(
    motor: th.Model, call: Callable[[th.Model], object], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        call(motor)


def test_wrong_types_are_refused(motor: th.Model) -> None:
    with pytest.raises(TypeError, match="model"):
        th.lqr("motor", 1)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="poles"):
        th.pole_placement(motor, "x")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="plant"):
        th.closed_loop(th.lqr(motor, 1).controller(), 3, [1.0])  # type: ignore[arg-type]


def tuner(**more: object) -> th.SelfTuner:
    settings: dict[str, object] = {"frequency": 0.3, "limits": (-10.0, 10.0)} | more
    return th.SelfTuner(2, 4, **settings)  # type: ignore[arg-type]


def plant_of(a: list[float], b: list[float], deviation: float = 0.0) -> Callable[[float], float]:
    y, u = np.zeros(len(a)), np.zeros(len(b))
    random = np.random.default_rng(0)

    def step(latest: float) -> float:
        u[1:], u[0] = u[:-1].copy(), latest
        now = -np.dot(a, y) + np.dot(b, u) + deviation * random.standard_normal()
        y[1:], y[0] = y[:-1].copy(), now
        return float(now)

    return step


def test_a_tuner_learns_and_controls() -> None:
    set_point = np.where(np.arange(1000) // 100 % 2 == 0, 1.0, -1.0)
    own = tuner()
    assert own.state == "probing" and own.controller is None
    run = th.closed_loop(own, plant_of([-1.5, 0.56], [0, 0.04, 0.02], 0.005), set_point)
    assert own.state == "controlling" and abs(run.y[-20:] + 1).max() < 0.1
    assert own.a[0] == 1 and own.b[0] == 0 and own.standard_errors is not None
    assert own.controller is not None and abs(own.controller.r.sum()) < 1e-9
    assert np.abs(run.u).max() <= 10
    for _ in range(5):
        own.control(-1.0, math.nan)
    assert own.state == "bridging"


def test_a_copy_goes_on_alike_and_a_probe_excites() -> None:
    own = tuner(start="exact", sensor_range=(-5, 5), stuck_after=0, probing=(0.5, 1.0), gain_sign=1)
    step = plant_of([-1.5, 0.56], [0, 0.04, 0.02])
    th.closed_loop(own, step, np.ones(200))
    other = pickle.loads(pickle.dumps(own))
    assert own.control(1.0, 0.9) == other.control(1.0, 0.9)
    own.probe(0.5, 10)
    assert own.control(1.0, 1.0) != other.control(1.0, 1.0)
    own.set_adaptation(False)
    before = own.a
    own.control(1.0, 3.0)
    np.testing.assert_array_equal(own.a, before)
    own.applied(0.0)


def test_a_tuner_that_is_not_trusted_says_why() -> None:
    own = tuner(gain_sign=-1, fallback=0.5)
    run = th.closed_loop(own, plant_of([-1.5, 0.56], [0, 0.04, 0.02], 0.005), np.ones(600))
    assert own.state == "distrusted" and own.distrust == "sign of the gain"
    np.testing.assert_allclose(np.abs(run.u[-100:] - 0.5), 0.1)
    assert own.design_age == 600 and np.abs(own.innovation.error) < 0.1
    assert pickle.loads(pickle.dumps(own)).distrust == own.distrust
    own.set_fallback("last good")
    own.set_gain_sign(1)
    run = th.closed_loop(own, plant_of([-1.5, 0.56], [0, 0.04, 0.02], 0.005), np.ones(1000))
    assert own.distrust is None and abs(run.y[-20:] - 1).max() < 0.1
    own.trust()
    for wrong in ("safe", None, math.nan):
        with pytest.raises(ValueError, match="fallback"):
            own.set_fallback(wrong)
    with pytest.raises(ValueError, match="gain_sign"):
        own.set_gain_sign(2)


def test_a_tuner_learns_noise_that_is_not_white() -> None:
    random, found = np.random.default_rng(5), {}
    e = 0.05 * random.standard_normal(4000)
    for nc in (0, 1):
        own, y, u = th.SelfTuner(2, 2, nc=nc, frequency=0.6, limits=(-10, 10), forgetting=0.998), np.zeros(4000), np.zeros(4000)
        for k in range(2, 4000):
            y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + 0.1 * u[k - 1] + 0.05 * u[k - 2] + e[k] - 0.9 * e[k - 1]
            u[k] = own.control(1.0 if k // 50 % 2 else -1.0, y[k])
        assert len(own.c) == nc + 1 and f"nc={nc}" in repr(own)
        found[nc] = own
    truth = np.array([-1.5, 0.7, 0.1, 0.05, 0.0, -0.9])
    errors = found[1].standard_errors
    estimates = np.r_[found[1].a[1:], found[1].b[1:], found[1].constant, found[1].c[1:]]
    assert errors is not None and (np.abs(estimates - truth) < 3 * errors).all()
    errors = found[0].standard_errors
    estimates = np.r_[found[0].a[1:], found[0].b[1:]]
    assert errors is not None and (np.abs(estimates - truth[:4]) > 5 * errors[:4]).any()
    other = pickle.loads(pickle.dumps(found[1]))
    assert [found[1].control(1.0, 0.9) for _ in range(20)] == [other.control(1.0, 0.9) for _ in range(20)]


@pytest.mark.parametrize(
    "more",
    [
        {"nc": -1},
        {"nc": 65},
        {"nc": 1, "start": "exact"},
        {"frequency": 0.0},
        {"damping": 2.0},
        {"observer": 1.0},
        {"limits": (1.0, -1.0)},
        {"input": 20.0},
        {"output_scale": 0.0},
        {"gain_sign": 3},
        {"start": "mixed"},
        {"probing": (2.0, 1.0)},
        {"sensor_range": (1.0, 0.0)},
        {"stuck_after": -1},
        {"frequency": math.nan},
    ],
)
def test_settings_out_of_range_are_refused(more: dict[str, object]) -> None:
    with pytest.raises(ValueError):
        tuner(**more)

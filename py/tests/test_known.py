"""Models of numbers that are known, and linear models for other packages."""

from __future__ import annotations

from math import factorial
from typing import Any

import control
import numpy as np
import pytest
import scipy.signal
import thetahat as th

NUM, DEN, SECONDS = [0.36, 0.32], [1.0, -1.54, 0.58], 0.01


def test_polynomials_systems_and_matrices_are_the_same_model() -> None:
    u = np.random.default_rng(1).choice([-1.0, 1.0], 300)
    expected = scipy.signal.lfilter([0, *NUM], DEN, u)
    log = th.Log(expected, u, sample_time=SECONDS)
    system = control.tf(NUM, DEN, SECONDS)
    space = control.ss([[1.54, -0.58], [1.0, 0.0]], [[1.0], [0.0]], [NUM], [[0.0]], SECONDS)
    for model in (
        th.Model.from_polynomials(b=[0, *NUM], f=DEN, sample_time=SECONDS),
        th.Model.from_transfer_function(NUM, DEN, SECONDS),
        th.Model.from_control(system),
        th.Model.from_control(space),
        th.Model.from_scipy(scipy.signal.dlti(NUM, DEN, dt=SECONDS)),
        th.Model.from_state_space(space.A, space.B, space.C, sample_time=SECONDS),
    ):
        assert np.allclose(model.simulate(log), expected, atol=1e-9), model
        assert np.allclose(np.sort_complex(model.poles()), np.sort_complex(np.roots(DEN)))
        assert np.allclose(model.zeros(), np.roots(NUM))
        assert np.allclose(model.num(), NUM) and np.allclose(model.den(), DEN)
        assert model.stable and abs(model.dc_gain()[0] - 17.0) < 1e-9
        assert np.isnan(model.dc_gain()[1]) and model.document["estimation"]["method"] == "given"
        assert th.Model.from_json(model.to_json()) == model
        back = model.to_control()
        assert np.allclose(control.poles(back), control.poles(system))


def test_known_models_go_through_everything() -> None:
    log = th.dc_motor()
    offset = {"u": float(log.u.mean()), "y": float(log.y.mean())}
    known = th.Model.from_polynomials(
        b=[0, *NUM], f=DEN, c=[1, 0.2], noise_variance=0.4, sample_time=SECONDS, offset=offset
    )
    assert known.offsets["u"][0] == offset["u"]
    assert known.validate(log, require="stable").unmet == []
    assert "known" in th.compare({"known": known, "fit": th.arx(log, 2, 2)}, log).summary()
    assert th.lqr(known, 1.0).closed_loop["stable"]
    assert list(known.export("c", "simulator", name="motor")) == ["motor.h", "motor.c"]
    assert known.predict(log).shape == (1000,)
    assert known.converted(0.02).sample_time == 0.02
    assert known.reduced(1).name == "state space of order 1"


def test_processes_have_poles_and_go_to_control() -> None:
    t = np.arange(400.0)
    y = 3 * (1 - np.exp(-np.maximum(t - 22, 0) / 10))
    model = th.process(th.Log(y, np.where(t < 20, 0.0, 1.0), sample_time=1), "p1d")
    assert np.allclose(model.poles(), [-0.1], atol=1e-4) and model.stable
    assert np.allclose(model.delays, [2.0], atol=1e-3) and len(model.zeros()) == 0
    assert abs(model.dc_gain()[0] - 3) < 1e-3 and np.allclose(model.time_constants(), [10], atol=1e-2)
    with pytest.raises(ValueError, match="dead time, which matrices"):
        model.to_control()
    system = model.to_control(pade=4)
    assert system.dt == 0 and system.nstates == 5
    w = np.array([0.01, 0.1, 0.5])
    expected = 3 / (1 + 10j * w) * np.exp(-2j * w)
    found = control.frequency_response(system, w).complex.reshape(-1)
    assert np.allclose(found, expected, rtol=1e-3)
    assert isinstance(model.to_scipy(pade=2), scipy.signal.lti)
    assert model.to_state_space().F.shape[0] >= 1


def test_several_inputs_need_no_slycot() -> None:
    rng = np.random.default_rng(0)
    log = th.dc_motor()
    two = th.Log(log.y, np.c_[log.u[:, 0], rng.normal(size=1000)], sample_time=SECONDS)
    system = th.arx(two, 2, 2).to_control()
    assert isinstance(system, control.StateSpace) and list(system.input_labels) == ["u1", "u2"]
    assert control.step_response(system).outputs.shape[:2] == (1, 2)
    several = th.Model.from_control(
        control.tf([[[1.0], [2.0]], [[1.0], [1.0]]], [[[1, 0.5], [1, 0.2]], [[1, 0.1], [1.0, 0.3]]], 1.0)
    )
    assert several.inputs == ["u1", "u2"] and several.outputs == ["y1", "y2"]
    assert abs(several.dc_gain("u2", output="y1")[0] - 2 / 1.2) < 1e-9
    assert np.allclose(several.den(1, output=0), [1, 0.2], atol=1e-9)


def test_pade_is_all_pass_and_right_at_low_frequencies() -> None:
    model = th.Model.from_transfer_function([1.0], [1.0, 1.0], delay=0.5)
    w = np.array([0.1, 1.0, 3.0])
    for order in (1, 3, 5):
        found = control.frequency_response(model.to_control(pade=order), w).complex.reshape(-1)
        ratio = found * (1 + 1j * w) / np.exp(-0.5j * w)
        # The first term that is left of the phase: (n!)^2 (w T)^(2 n + 1)/((2 n)! (2 n + 1)!).
        error = factorial(order) ** 2 * (0.5 * w) ** (2 * order + 1) / (factorial(2 * order) * factorial(2 * order + 1))
        assert np.allclose(np.abs(ratio), 1.0, atol=1e-9)
        assert (np.abs(np.angle(ratio)) <= error + 1e-9).all(), order


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: th.Model.from_polynomials(b=[0, 1], f=[2, 1], sample_time=1), ValueError, "f: it begins with 2"),
        (lambda: th.Model.from_polynomials(b=[0, np.nan], sample_time=1), ValueError, "b: expected finite numbers"),
        (lambda: th.Model.from_polynomials(b="x", sample_time=1), TypeError, "b: expected numbers"),
        (lambda: th.Model.from_polynomials(b=[1], sample_time=0), ValueError, "sample_time: it is 0 s"),
        (lambda: th.Model.from_polynomials(b=[1], sample_time=1, offset={"v": 1}), ValueError, "offset: 'v' is no channel"),
        (lambda: th.Model.from_transfer_function([1, 0, 0], [1, 1]), ValueError, "num: its degree is above"),
        (lambda: th.Model.from_transfer_function([1], [1, 1], delay=[1, 2]), ValueError, "delay: there are 2 for 1"),
        (lambda: th.Model.from_state_space([[1, 2]], [[1]], [[1]], sample_time=1), ValueError, "F is 1 x 2, not 1 x 1"),
        (lambda: th.Model.from_control("G"), TypeError, "system: expected a transfer function"),
        (lambda: th.Model.from_control(control.tf([1], [1, 1], True)), ValueError, "its sample time is not said"),
    ],
)
def test_bad_numbers(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_systems_of_other_packages_are_models_where_models_are_asked_for() -> None:
    control = pytest.importorskip("control")
    known = control.tf([0.36, 0.32], [1, -1.54, 0.58], dt=0.01)
    log = th.dc_motor()
    assert repr(th.compare({"known": known, "arx": th.arx(log, 2, 2)}, log)) == "Comparison(known, arx)"
    gains = th.lqr(known, 1.0, integrator=True)
    assert th.lqr(th.Model.from_control(known), 1.0, integrator=True).to_json() == gains.to_json()
    controller = gains.controller()
    assert th.closed_loop(controller, known, np.ones(50), noise=False).y.shape == (50,)
    for call in (lambda: th.lqr("arx", 1.0), lambda: th.compare({"a": 1}, log), lambda: th.closed_loop(controller, 3, np.ones(5))):  # type: ignore[dict-item, arg-type]
        with pytest.raises(TypeError, match="expected a Model"):
            call()
    with pytest.raises(TypeError, match=r"found a Model; compare\(\[model, another\], log\)"):
        th.compare(th.arx(log, 2, 2), log)  # type: ignore[arg-type]


def test_models_in_matrices_and_equations_run_freely() -> None:
    matrices = th.StateModel([[0.9, 0.1], [0, 0.8]], [[1, 0], [0, 1]], np.eye(2), np.eye(2), np.eye(2), G=[[0], [1]], sample_time=1, x0=[1, 2])
    u = np.sin(np.arange(20.0))
    x, expected = np.array([1.0, 2.0]), []
    for value in u:
        expected.append(x)
        x = np.array([[0.9, 0.1], [0, 0.8]]) @ x + np.array([0.0, value])
    np.testing.assert_allclose(matrices.simulate(u), expected, atol=1e-12)
    with pytest.raises(ValueError, match="u: expected shape"):
        matrices.simulate([[1.0, 2.0]])

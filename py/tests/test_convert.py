"""Models in SciPy and python-control against their difference equations."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from thetahat.models import convert as _convert

SAMPLE_TIME = 0.1
# SciPy's simulation takes the zero of an input without effect for a coefficient that vanished.
of_zero = pytest.mark.filterwarnings("ignore:Badly conditioned filter coefficients")
# B in rising powers of q^-1 with its delay, and A F.
QUOTIENTS = [
    ([0.0, 0.5, 0.3], [1.0, -1.2, 0.5]),
    ([0.7, 0.2], [1.0, -0.9]),
    ([0.0, 0.0, 0.0, 0.4], [1.0, -0.8]),
    ([0.3, 0.2, 0.1], [1.0]),
    ([0.0, 1.0], [1.0, -0.4, 0.1, 0.05]),
    ([2.0], [1.0]),
    ([0.0, 0.0], [1.0, -0.9]),
    ([0.0, 1.0, 0.0], [1.0, -0.5, 0.0, 0.0]),
]


def difference_equation(
    numerator: list[float], denominator: list[float], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    y = np.zeros(len(u))
    for t in range(len(u)):
        driven = sum(b * u[t - i] for i, b in enumerate(numerator) if i <= t)
        past = sum(p * y[t - i] for i, p in enumerate(denominator) if 0 < i <= t)
        y[t] = driven - past
    return y


def signals(count: int) -> NDArray[np.float64]:
    return np.random.default_rng(1).standard_normal((count, 60))


def observer_form(
    numerator: list[float], denominator: list[float]
) -> tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]:
    order = max(len(numerator), len(denominator)) - 1
    n = np.append(numerator, np.zeros(order + 1 - len(numerator)))
    p = np.append(denominator, np.zeros(order + 1 - len(denominator)))
    F = np.eye(order, k=1)
    F[:, :1] -= p[1:, None]
    return F, (n[1:] - p[1:] * n[0])[:, None], np.eye(1, order), np.array([[n[0]]])


@of_zero
@pytest.mark.parametrize(("numerator", "denominator"), QUOTIENTS)
def test_scipy_does_what_the_difference_equation_does(
    numerator: list[float], denominator: list[float]
) -> None:
    signal = pytest.importorskip("scipy.signal")
    u = signals(1)[0]
    system = _convert.to_scipy([numerator], [denominator], SAMPLE_TIME)
    assert isinstance(system, signal.TransferFunction)
    assert system.dt == SAMPLE_TIME
    time, y = signal.dlsim(system, u)
    np.testing.assert_allclose(y[:, 0], difference_equation(numerator, denominator, u), atol=1e-13)
    np.testing.assert_allclose(time, SAMPLE_TIME * np.arange(len(u)))


@pytest.mark.parametrize(("numerator", "denominator"), QUOTIENTS)
def test_scipy_runs_the_state_space(numerator: list[float], denominator: list[float]) -> None:
    signal = pytest.importorskip("scipy.signal")
    u = signals(1)[0]
    system = _convert.state_space_to_scipy(*observer_form(numerator, denominator), SAMPLE_TIME)
    assert isinstance(system, signal.StateSpace)
    assert system.dt == SAMPLE_TIME
    y = signal.dlsim(system, u)[1]
    np.testing.assert_allclose(y[:, 0], difference_equation(numerator, denominator, u), atol=1e-13)


@of_zero
def test_scipy_has_one_transfer_function_for_each_of_several_inputs() -> None:
    signal = pytest.importorskip("scipy.signal")
    numerators, denominators = [list(p) for p in zip(*QUOTIENTS)]
    u = signals(len(QUOTIENTS))
    systems = _convert.to_scipy(numerators, denominators, SAMPLE_TIME)
    assert isinstance(systems, list)
    y = sum(signal.dlsim(system, row)[1][:, 0] for system, row in zip(systems, u))
    expected = sum(difference_equation(*pair, row) for pair, row in zip(QUOTIENTS, u))
    np.testing.assert_allclose(y, expected, atol=1e-12)


def test_control_has_all_inputs_in_one() -> None:
    control = pytest.importorskip("control")
    numerators, denominators = [list(p) for p in zip(*QUOTIENTS)]
    u = signals(len(QUOTIENTS))
    names = [f"input {j}" for j in range(len(QUOTIENTS))]
    system = _convert.to_control(numerators, denominators, SAMPLE_TIME, names, "speed")
    assert isinstance(system, control.TransferFunction)
    assert (system.dt, system.input_labels, system.output_labels) == (SAMPLE_TIME, names, ["speed"])
    assert (system.noutputs, system.ninputs) == (1, len(QUOTIENTS))
    y = np.zeros(u.shape[1])
    for j, row in enumerate(u):
        # Not all at once: to simulate several inputs with poles, python-control needs slycot.
        one = system[0, j]
        y += np.ravel(control.forced_response(one, U=row).outputs)
    expected = sum(difference_equation(*pair, row) for pair, row in zip(QUOTIENTS, u))
    np.testing.assert_allclose(y, expected, atol=1e-12)


@pytest.mark.parametrize(("numerator", "denominator"), QUOTIENTS)
def test_control_runs_the_state_space(numerator: list[float], denominator: list[float]) -> None:
    control = pytest.importorskip("control")
    u = signals(1)[0]
    matrices = observer_form(numerator, denominator)
    system = _convert.state_space_to_control(*matrices, SAMPLE_TIME, ["u"], ["y"])
    assert isinstance(system, control.StateSpace)
    assert (system.dt, system.input_labels, system.output_labels) == (SAMPLE_TIME, ["u"], ["y"])
    assert system.nstates == np.shape(matrices[0])[0]
    y = np.ravel(control.forced_response(system, U=u).outputs)
    np.testing.assert_allclose(y, difference_equation(numerator, denominator, u), atol=1e-13)


def test_no_pole_at_the_origin_is_there_twice() -> None:
    pytest.importorskip("scipy.signal")
    # q^-1 / (1 - 0.5 q^-1) is 1 / (z - 0.5), however many zeros are behind it.
    for numerator, denominator in ([0.0, 1.0], [1.0, -0.5]), ([0, 1, 0, 0], [1, -0.5, 0]):
        system = _convert.to_scipy([numerator], [denominator], SAMPLE_TIME)
        np.testing.assert_array_equal(system.poles, [0.5])
        np.testing.assert_array_equal(system.zeros, [])
    # A delay of three samples has its two poles there.
    system = _convert.to_scipy([[0, 0, 0, 1]], [[1, -0.5]], SAMPLE_TIME)
    np.testing.assert_array_equal(np.sort(system.poles), [0, 0, 0.5])


def test_an_input_without_effect_is_zero_and_nothing_warns() -> None:
    pytest.importorskip("scipy.signal")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        system = _convert.to_scipy([[0.0, 0.0]], [[1.0, -0.9]], SAMPLE_TIME)
    np.testing.assert_array_equal(np.ravel(system.num), [0.0])
    np.testing.assert_array_equal(system.den, [1.0])


def test_a_time_series_has_no_transfer_function() -> None:
    none = np.zeros((1, 0))
    calls: list[Callable[[], Any]] = [
        lambda: _convert.to_scipy([], [], 1.0),
        lambda: _convert.to_control([], [], 1.0, [], "y"),
        lambda: _convert.state_space_to_scipy([[0.5]], none, [[1.0]], none, 1.0),
        lambda: _convert.state_space_to_control([[0.5]], none, [[1.0]], none, 1.0, [], ["y"]),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="no inputs.*state_space"):
            call()


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in "scipy.signal", "control":
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=r"scipy\.signal.*pip install thetahat\[scipy\]"):
        _convert.to_scipy([[1.0]], [[1.0]], 1.0)
    with pytest.raises(ImportError, match=r"control.*pip install thetahat\[control\]"):
        _convert.to_control([[1.0]], [[1.0]], 1.0, ["u"], "y")

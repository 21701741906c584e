"""A finite window, noise of the sensor, and measurements that come late: the core's, and what Python adds to it."""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th

Array = NDArray[np.float64]


def rows(count: int = 300) -> tuple[Array, Array]:
    random = np.random.default_rng(3)
    phi = np.column_stack([random.normal(size=count), 30.0 * random.normal(size=count), np.ones(count)])
    return phi, phi @ [1.0, -0.2, 4.0] + 0.1 * random.normal(size=count)


def test_a_window_is_the_least_squares_of_its_samples() -> None:
    phi, y = rows()
    windowed = th.WindowedLeastSquares(3, 40)
    trajectory = windowed.run(phi, y)
    for k in (50, 123, 299):
        inside = slice(k - 39, k + 1)
        expected, residuals, _, _ = np.linalg.lstsq(phi[inside], y[inside], rcond=None)
        np.testing.assert_allclose(trajectory.parameters[k], expected, atol=1e-12)
    variance = residuals[0] / 37
    assert windowed.noise_variance == pytest.approx(variance)
    covariance = variance * np.linalg.inv(phi[-40:].T @ phi[-40:])
    assert windowed.parameter_covariance is not None and windowed.standard_errors is not None
    np.testing.assert_allclose(windowed.parameter_covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(windowed.standard_errors, np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert windowed.predict([1.0, 1.0, 1.0]) == pytest.approx(windowed.parameters.sum())
    assert (windowed.rows, windowed.blocks, windowed.block) == (40, 40, 1)


def test_a_window_one_by_one_is_the_run_to_the_bit_and_blocks_slide_as_a_whole() -> None:
    phi, y = rows(100)
    whole, single = th.WindowedLeastSquares(3, 5, 4), th.WindowedLeastSquares(3, 5, 4)
    trajectory = whole.run(phi, y)
    for k in range(100):
        single.update(phi[k], y[k])
        np.testing.assert_array_equal(single.parameters, trajectory.parameters[k])
        assert single.rows == (k + 1 if k < 20 else 17 + k % 4)
    assert list(trajectory.actions[:4]) == ["collecting", "collecting", "updated", "updated"]
    for other in (pickle.loads(pickle.dumps(whole)), copy.deepcopy(whole)):
        assert repr(other) == repr(single)
        assert other.update(phi[0], 1.0).error == whole.update(phi[0], 1.0).error
        whole = copy.deepcopy(single)


def test_a_window_without_excitation_keeps_the_estimate() -> None:
    phi, y = rows(30)
    windowed = th.WindowedLeastSquares(3, 10)
    windowed.run(phi, y)
    for _ in range(12):
        innovation = windowed.update([0.0, 0.0, 1.0], 4.0)
    assert innovation.action == "collecting" and not windowed.determined
    np.testing.assert_allclose(windowed.parameters, [1.0, -0.2, 4.0], atol=0.5)
    assert windowed.noise_variance is None and windowed.standard_errors is None and windowed.parameter_covariance is None
    windowed.clear()
    assert windowed.rows == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3, 1), "blocks"),
        ((3, 2), "window"),
        ((0, 5), "n: "),
        ((3, 10, 0), "block: "),
        ((3, 10**12), "blocks"),
    ],
)
def test_a_window_that_cannot_be_is_refused(arguments: tuple[int, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        th.WindowedLeastSquares(*arguments)


def test_a_bad_sample_leaves_the_window_as_it_was() -> None:
    windowed = th.WindowedLeastSquares(2, 4)
    windowed.run([[1.0, 0.0], [0.0, 1.0]], [1.0, 2.0])
    before = pickle.dumps(windowed)
    for phi, y in (([1.0, math.inf], 1.0), ([1.0, 1.0], math.inf), ([1.0], 1.0), ([1e300, 1.0], 1.0)):
        with pytest.raises(ValueError, match="phi|y is|regressor"):
            windowed.update(phi, y)
    with pytest.raises(ValueError, match="row 2"):
        windowed.run([[1.0, 1.0], [math.inf, 1.0]], [1.0, 1.0])
    assert windowed.update([1.0, math.nan], 1.0).action == "missing"
    assert pickle.dumps(windowed) == before
    with pytest.raises(ValueError, match="at least one entry"):
        windowed.run(np.zeros((0, 2)), [])


def noisy(count: int = 6000, pole: float = 0.0) -> tuple[Array, Array]:
    """y(k) = 0.9 y(k-1) + 0.08 u(k-1), and noise of the sensor of half its deviation, with a pole."""
    random = np.random.default_rng(5)
    u = random.choice([-1.0, 1.0], count)
    x, v = np.zeros(count), np.zeros(count)
    for k in range(1, count):
        x[k] = 0.9 * x[k - 1] + 0.08 * u[k - 1]
        v[k] = pole * v[k - 1] + random.normal()
    return x + 0.5 * x.std() / v.std() * v, u


@pytest.mark.parametrize("pole", [0.0, 0.5])
def test_noise_of_the_sensor_biases_arx_and_neither_method(pole: float) -> None:
    y, u = noisy(pole=pole)
    arx = th.RecursiveArx(1, 1, forgetting=None)
    arx.run(y, u=u)
    assert arx.a[1] > -0.85
    model = th.RecursiveOutputError(1, 1, forgetting=None)
    model.run(y, u=u)
    np.testing.assert_allclose(model.f, [1.0, -0.9], atol=0.01)
    np.testing.assert_allclose(model.b[0], [0.0, 0.08], atol=0.01)
    assert model.standard_errors is not None and model.noise_variance is not None
    np.testing.assert_array_equal(model.a, [1.0])
    instruments = th.RecursiveOutputError(1, 1, forgetting=None, method="instruments")
    instruments.run(y, u=u)
    np.testing.assert_allclose(instruments.f, [1.0, -0.9], atol=0.02)
    assert instruments.standard_errors is None and instruments.noise_variance is None


@pytest.mark.parametrize("method", ["prediction-error", "instruments"])
def test_an_output_error_model_row_by_row_is_the_run_to_the_bit(method: str) -> None:
    y, u = noisy(200)
    y[50:53] = math.nan
    whole, single = (
        th.RecursiveOutputError(1, 2, 1, 0.98, method=method, constant=True, output_scale=0.2)  # type: ignore[arg-type]
        for _ in range(2)
    )
    trajectory = whole.run(y, u=u)
    for k in range(200):
        single.measured(y[k])
        single.applied(u[k])
    for other in (single, pickle.loads(pickle.dumps(whole)), copy.deepcopy(whole)):
        assert repr(other) == repr(whole)
        np.testing.assert_array_equal(other.covariance, whole.covariance)
        np.testing.assert_array_equal(other.predict(u[:5]), whole.predict(u[:5]))
    assert trajectory.actions[50] == "missing"
    # The model's output goes on.
    assert trajectory.actions[53] == ("updated" if method == "prediction-error" else "not ready")
    assert math.isfinite(trajectory.errors[53])
    assert whole.constant is not None


def test_a_wrong_output_error_model_is_refused() -> None:
    with pytest.raises(ValueError, match="method: expected 'prediction-error' or 'instruments', found 'pem'"):
        th.RecursiveOutputError(1, 1, method="pem")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="stable"):
        th.RecursiveOutputError(1, 1, parameters=[-1.1, 1.0])
    model = th.RecursiveOutputError(1, 1, limits=[(-0.8, 0.0), None])
    y, u = noisy(500)
    model.run(y, u=u)
    assert model.f[1] >= -0.8


def models() -> tuple[th.LinearTransition, th.LinearObservation]:
    motion = th.LinearTransition([[1.0, 0.1], [0.0, 0.9]], [[0.01, 0.0], [0.0, 0.1]], [[0.0], [1.0]])
    return motion, th.LinearObservation([[1.0, 0.0], [0.0, 1.0]], [[0.3, 0.1], [0.1, 0.2]])


@pytest.mark.parametrize("late_by", [1, 3, 5])
def test_a_late_measurement_is_to_the_bit_as_one_in_time(late_by: int) -> None:
    random = np.random.default_rng(6)
    motion, sensors = models()
    late = th.OutOfSequenceFilter([0.0, 0.0], np.eye(2), samples=5, outputs=2, inputs=1, gate=9.0)
    in_time = th.ExtendedKalmanFilter([0.0, 0.0], np.eye(2), gate=9.0)
    y, u = random.normal(size=(60, 2)), random.normal(size=60)
    for k in range(60):
        late.update([y[k, 0], math.nan], u[k], observation=sensors)
        if k >= late_by:
            assert late.correct_late(motion, sensors, late_by, [math.nan, y[k - late_by, 1]]).action in ("updated", "gated")
        late.predict(motion, u[k])
    late = pickle.loads(pickle.dumps(late))
    for k in range(60):
        in_time.update([y[k, 0], y[k, 1] if k < 60 - late_by else math.nan], observation=sensors)
        in_time.predict(motion, u[k])
    np.testing.assert_array_equal(late.state, in_time.state)
    np.testing.assert_array_equal(late.covariance, in_time.covariance)
    assert late.kept == late.samples == 5 and late.gated_in_a_row == in_time.gated_in_a_row


def test_too_late_twice_and_from_the_future_are_refused() -> None:
    motion, sensors = models()
    late = th.OutOfSequenceFilter([0.0, 0.0], np.eye(2), samples=3, outputs=2, inputs=1)
    for k in range(2):
        late.update([1.0, math.nan], 0.0, observation=sensors)
        late.predict(motion, 0.0)
    before = pickle.dumps(late)
    for age, measurement, message in (
        (-1, [math.nan, 1.0], "age"),
        (0, [math.nan, 1.0], "age"),
        (3, [math.nan, 1.0], "age"),
        (4, [math.nan, 1.0], "age"),
        (2, [1.0, 1.0], "measurement"),
        (1, [math.nan, math.inf], "measurement"),
        (1, [math.nan], "measurement"),
    ):
        with pytest.raises(ValueError, match=message):
            late.correct_late(motion, sensors, age, measurement)
    with pytest.raises(ValueError, match="samples"):
        th.OutOfSequenceFilter([0.0], [[1.0]], samples=0)
    assert pickle.dumps(late) == before

    def broken(x: Array, u: Array) -> Array:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        late.correct_late(th.NonlinearTransition(broken, np.eye(2)), sensors, 1, [math.nan, 1.0])
    assert pickle.dumps(late) == before

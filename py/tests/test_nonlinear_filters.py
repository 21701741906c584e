"""Filters for models that bend, and for noise of which the bound alone is known: honest where others are not."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th
from thetahat import ExtendedKalmanFilter, KalmanFilter, NonlinearObservation, NonlinearTransition, UnscentedKalmanFilter

Array = NDArray[np.float64]
RUNS = 1500

MOTION = th.LinearTransition([[0.9, 0.3], [-0.2, 0.95]], [[0.1, 0.02], [0.02, 0.2]], [[0.0], [0.5]])
SENSOR = th.LinearObservation([[1.0, 0.0], [0.5, 1.0]], [[0.5, 0.2], [0.2, 0.4]])

# A state that stands still, seen once through a function: text of equations, its prior mean and deviation.
SEEN = {
    "distance": ("sqrt(a * a + b * b)", [2.0, 0.0], 0.6),
    "exponential": ("exp(a)", [1.0, 0.0], 0.4),
}
FUNCTIONS = {"distance": lambda x: np.hypot(x[0], x[1]), "exponential": lambda x: np.exp(x[0])}


def swing(x: Array, u: Array) -> Array:
    return np.array([x[0] + 0.02 * x[1], x[1] - 0.02 * 9.81 * math.sin(x[0])])


def measured(rows: int = 120) -> tuple[Array, Array]:
    random = np.random.default_rng(4)
    y, u = random.standard_normal((rows, 2)), random.standard_normal((rows, 1))
    y[10, 0] = y[20, 1] = np.nan
    y[30] = np.nan
    return y, u


def test_a_linear_model_makes_the_unscented_filter_a_kalman_filter() -> None:
    y, u = measured()
    linear = KalmanFilter(np.zeros(2), np.eye(2), gate=9.0)
    unscented = UnscentedKalmanFilter(np.zeros(2), np.eye(2), gate=9.0)
    smoothed = linear.smooth(MOTION, SENSOR, y, inputs=u)
    again = unscented.smooth(MOTION, SENSOR, y, inputs=u)
    np.testing.assert_allclose(again.states, smoothed.states, rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(again.covariances, smoothed.covariances, rtol=1e-8, atol=1e-11)
    expected, found = linear.run(MOTION, SENSOR, y, inputs=u), unscented.run(MOTION, SENSOR, y, inputs=u)
    np.testing.assert_allclose(found.filtered_states, expected.filtered_states, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.filtered_covariances, expected.filtered_covariances, rtol=1e-9, atol=1e-12)
    assert found.actions.tolist() == expected.actions.tolist() and "gated" in found.actions
    assert found.log_likelihood == pytest.approx(expected.log_likelihood, rel=1e-12)
    f, g, h = MOTION.state_matrix, MOTION.input_matrix, SENSOR.output_matrix
    assert g is not None
    functions = NonlinearTransition(lambda x, u: f @ x + g @ u, MOTION.noise), NonlinearObservation(lambda x, u: h @ x, SENSOR.noise)
    called = UnscentedKalmanFilter(np.zeros(2), np.eye(2), gate=9.0).run(*functions, y, inputs=u)
    np.testing.assert_allclose(called.filtered_states, expected.filtered_states, rtol=1e-8, atol=1e-10)


def test_the_same_numbers_as_the_usual_sum_over_the_points() -> None:
    """Julier and Uhlmann, 2004: with n states, weights of points at sqrt(n + kappa) deviations; here n + kappa = c²."""
    mean, root, c = np.array([2.0, 0.3]), np.array([[0.6, 0.1], [0.0, 0.4]]), math.sqrt(3.0)
    unscented = UnscentedKalmanFilter(mean, root @ root.T)
    unscented.predict(NonlinearTransition(swing, 1e-3 * np.eye(2)))
    points = [mean, *(mean + sign * c * column for column in root.T for sign in (1, -1))]
    weights = np.array([1 - 2 / c**2, *[1 / (2 * c**2)] * 4])
    np.testing.assert_allclose(unscented.state, weights @ [swing(point, mean) for point in points], rtol=1e-12)
    # Along the columns of U only one factor bends, so that the covariance is that of the usual sum but for the centre's weight.
    ahead = np.array([swing(point, mean) for point in points])
    slopes = np.array([ahead[1] - ahead[2], ahead[3] - ahead[4]]) / (2 * c)
    bends = np.array([(ahead[1] + ahead[2]) / 2 - ahead[0], (ahead[3] + ahead[4]) / 2 - ahead[0]])
    expected = slopes.T @ slopes + (c**2 - 1) / c**4 * bends.T @ bends + 1e-3 * np.eye(2)
    np.testing.assert_allclose(unscented.covariance, expected, rtol=1e-10)


def test_steps_in_a_loop_and_a_run_give_the_same_bits_and_it_pickles() -> None:
    random, truth, y = np.random.default_rng(6), np.array([0.8, 0.0]), []
    for _ in range(100):
        y.append(math.sin(truth[0]) + 0.01 * random.standard_normal())
        truth = swing(truth, truth)
    pendulum, sideways = NonlinearTransition(swing, 1e-6 * np.eye(2)), NonlinearObservation(lambda x, u: np.sin(x[:1]), [[1e-4]])
    loop, run = (UnscentedKalmanFilter([0.5, 0.3], 0.1, spread=1.5) for _ in range(2))
    trajectory = run.run(pendulum, sideways, y)
    for k, value in enumerate(y):
        np.testing.assert_array_equal(trajectory.predicted_states[k], loop.state)
        innovation = loop.update(value, observation=sideways)
        assert trajectory.nis[k] == innovation.nis
        np.testing.assert_array_equal(trajectory.filtered_covariances[k], loop.covariance)
        loop.predict(pendulum)
    assert pickle.dumps(loop) == pickle.dumps(run)
    assert abs(run.state[0] - truth[0]) < 0.02 and run.spread == 1.5
    assert repr(run).startswith("UnscentedKalmanFilter(n=2, state=[")
    for again in (pickle.loads(pickle.dumps(run)), copy.copy(run), copy.deepcopy(run)):
        assert pickle.dumps(again) == pickle.dumps(run) and again.spread == 1.5
    held = UnscentedKalmanFilter([0.0, 0.0], 1.0, transition=MOTION, observation=SENSOR)
    held.update([1.0, 2.0])
    held.predict(0.5)
    assert pickle.loads(pickle.dumps(held)).update([1.0, 2.0]).nis == held.update([1.0, 2.0]).nis


def fails(x: Array, u: Array) -> Array:
    raise RuntimeError("boom")


FIRST = NonlinearObservation(lambda x, u: x[:1], [[1.0]])
LOGARITHM, SHORT = NonlinearTransition(lambda x, u: np.log(x - 1.5), np.eye(2)), NonlinearTransition(lambda x, u: x[:1], np.eye(2))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda one: one.predict(NonlinearTransition(fails, np.eye(2))), RuntimeError, "^boom$"),
        (lambda one: one.predict(NonlinearTransition(lambda x, u: x, fails)), RuntimeError, "^boom$"),
        (lambda one: one.predict(LOGARITHM), ValueError, "transition function: entry 0 is NaN"),
        (lambda one: one.predict(SHORT), ValueError, r"expected 2 entries, found shape \(1,\)"),
        (lambda one: one.update(1.0, observation=NonlinearObservation(fails, [[1.0]])), RuntimeError, "^boom$"),
        (lambda one: one.update(np.inf, observation=FIRST), ValueError, "measurement is infinite"),
        (lambda one: one.update([1.0, 2.0], observation=FIRST), ValueError, "expected"),
        (lambda one: one.run(MOTION, SENSOR, [[1.0, np.inf]], inputs=[1.0]), ValueError, "^row 1: measurement is infinite"),
        (lambda one: one.run(MOTION, SENSOR, [[1.0, 2.0]], inputs=[np.nan]), ValueError, "^row 1: .*input"),
        (lambda one: one.smooth(MOTION, NonlinearObservation(fails, [[1.0]]), [1.0], inputs=[1.0]), RuntimeError, "^boom$"),
        (lambda one: one.update(1.0), ValueError, "observation: the object holds none"),
        (lambda one: UnscentedKalmanFilter([0.0], 1.0, spread=0.5), ValueError, "spread"),
        (lambda one: UnscentedKalmanFilter([0.0], 1.0, spread=np.nan), ValueError, "spread"),
        (lambda one: UnscentedKalmanFilter([np.nan], 1.0), ValueError, "state: entry 0 is NaN"),
        (lambda one: UnscentedKalmanFilter([0.0, 0.0], np.eye(3)), ValueError, "covariance: expected shape"),
        (lambda one: UnscentedKalmanFilter([0.0], 1.0, iterations=2), TypeError, "iterations"),  # type: ignore[call-arg]
    ],
)
def test_what_is_wrong_is_said_and_changes_nothing(call: Any, error: type[Exception], message: str) -> None:
    filter = UnscentedKalmanFilter([1.0, 2.0], np.eye(2))
    before = pickle.dumps(filter)
    with np.errstate(invalid="ignore"), pytest.raises(error, match=message):
        call(filter)
    assert pickle.dumps(filter) == before


def seen_once(name: str) -> th.StateModel:
    """Two states that stand still, one measurement."""
    equation, (a, b), deviation = SEEN[name]
    return th.StateModel.from_toml(
        f"sample_time = 1\n[states]\na = {{ start = {a}, sd = {deviation} }}\nb = {{ start = {b}, sd = {deviation} }}\n"
        f"[next]\na = 'a'\nb = 'b'\n[outputs]\ny = '{equation}'\n[noise]\nmeasurement = {{ y = 0.05 }}\n"
    )


def squared_errors(name: str, estimator: Any) -> float:
    """The mean of squared errors of what is measured, in units of what the filter says of them: 1 if it is honest."""
    model, (_, mean, deviation) = seen_once(name), SEEN[name]
    random, states = np.random.default_rng(21), 2 if name == "distance" else 1
    total = 0.0
    for _ in range(RUNS):
        truth = np.array(mean) + deviation * random.standard_normal(2)
        filter = th.StateFilter(model, estimator)
        estimate = filter.update(float(FUNCTIONS[name](truth)) + 0.05 * random.standard_normal())
        total += float(np.sum(((truth - estimate.filtered) / estimate.filtered_deviations)[:states] ** 2)) / states
    return total / RUNS


def test_a_distance_that_bends_across_what_it_measures() -> None:
    # Four deviations of a mean of 1500 chi-squares of two degrees of freedom, halved, are 0.1; the second order is one more such.
    assert squared_errors("distance", "ukf") == pytest.approx(1.0, abs=0.25)
    assert squared_errors("distance", "ekf") > 2.0
    assert squared_errors("distance", "iekf") > 2.0


def test_an_exponential_that_bends_along_what_it_measures() -> None:
    # Four deviations of a mean of 1500 chi-squares of one degree of freedom are 0.15.
    assert squared_errors("exponential", "iekf") == pytest.approx(1.0, abs=0.15)
    assert squared_errors("exponential", "ukf") < 1.5
    assert squared_errors("exponential", "ekf") > 10.0


@pytest.mark.parametrize("estimator", ["ekf", "iekf", "ukf"])
def test_estimators_of_a_linear_model_are_the_kalman_filter(estimator: Any) -> None:
    f, h, q, r = (np.array(rows) for rows in ([[1, 0.5], [0, 0.9]], [[1, 0], [1, 0.2]], [[0.01, 0], [0, 0.1]], [[0.2, 0.05], [0.05, 0.3]]))
    model = th.StateModel(f, h, q, r, 10 * np.eye(2), G=[[0.1], [0.5]], S=[[0.01, 0.0], [0.0, 0.02]], sample_time=0.5)
    y, u = measured()
    kalman, other = th.StateFilter(model), th.StateFilter(model, estimator)
    expected, found = kalman.run(y, u=u, smooth=True), other.run(y, u=u, smooth=True)
    np.testing.assert_allclose(found.filtered, expected.filtered, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.filtered_deviations, expected.filtered_deviations, rtol=1e-9)
    assert expected.smoothed is not None and found.smoothed is not None
    np.testing.assert_allclose(found.smoothed, expected.smoothed, rtol=1e-8, atol=1e-10)
    assert other.log_likelihood == pytest.approx(kalman.log_likelihood, rel=1e-12) and other.estimator == estimator
    again = pickle.loads(pickle.dumps(other))
    assert again.estimator == estimator and again.to_json() == other.to_json()


BOUNDS: dict[str, Any] = {"process_bound": [0.01, 0.05], "measurement_bound": 0.3, "initial_bound": [5.0, 2.0]}


def oscillator(**options: Any) -> th.StateModel:
    matrices: Any = ([[0.98, 0.19], [-0.19, 0.98]], [[1.0, 0.0]])
    return th.StateModel(*matrices, sample_time=0.2, G=[[0.0], [0.1]], states=["position", "speed"], **options)


def simulated(rows: int = 2000, extreme: bool = False) -> tuple[Array, Array, Array]:
    """States, inputs and measurements with noises within their bounds, uniform or always at an end."""
    random = np.random.default_rng(9)
    draw = (lambda size: random.choice([-1.0, 1.0], size)) if extreme else (lambda size: random.uniform(-1.0, 1.0, size))
    x, u = np.array([5.0, 2.0]) * draw(2), random.standard_normal(rows)
    states = []
    for k in range(rows):
        states.append(x)
        x = np.array([[0.98, 0.19], [-0.19, 0.98]]) @ x + np.array([0.0, 0.1]) * u[k] + np.array([0.01, 0.05]) * draw(2)
    return np.array(states), u, np.array(states)[:, 0] + 0.3 * draw(rows)


@pytest.mark.parametrize("extreme", [False, True])
def test_the_state_is_in_its_set_in_every_row(extreme: bool) -> None:
    states, u, y = simulated(extreme=extreme)
    y[40:60] = np.nan
    found = th.StateFilter(oscillator(**BOUNDS), "bounded").run(y, u=u)
    # Rounding of a sum of some products of numbers below 10.
    assert np.all(np.abs(states - found.filtered) <= found.filtered_bounds + 1e-12)
    assert np.all(np.abs(states - found.predicted) <= found.predicted_bounds + 1e-12)
    assert np.all(found.contradictions == -1) and not np.isin(found.actions, ["gated"]).any()
    assert found.filtered_bounds[100:, 0].max() < 0.5 and np.isnan(found.filtered_deviations).all() and np.isnan(found.nis).all()


def test_a_set_that_is_empty_is_a_fault_which_names_the_output() -> None:
    states, u, y = simulated()
    y[1000] = states[1000, 0] + 3.0
    filter = th.StateFilter(oscillator(**BOUNDS), "bounded")
    found = filter.run(y, u=u)
    assert np.flatnonzero(found.contradictions != -1).tolist() == [1000] and found.actions[1000] == "gated"
    assert found.to_pandas()["contradicts"].iloc[1000] == "y"
    # The row is not used, so that the rows after it have the state inside again.
    assert np.all(np.abs(states - found.filtered) <= found.filtered_bounds + 1e-12)
    step = th.StateFilter(oscillator(**BOUNDS), "bounded")
    for k in range(1001):
        estimate = step.update(y[k], u[k])
    assert (estimate.contradiction, estimate.action) == (0, "gated")
    again = pickle.loads(pickle.dumps(step))
    np.testing.assert_array_equal(again.update(y[1001], u[1001]).filtered, step.update(y[1001], u[1001]).filtered)


def test_bounds_are_those_of_the_text_and_make_covariances() -> None:
    model = oscillator(**BOUNDS)
    assert th.StateModel.from_toml(model.to_toml()) == model
    third = np.square([0.01, 0.05]) / 3
    uniform = oscillator(Q=np.diag(third), R=[[0.03]], P0=np.diag(np.square([5.0, 2.0]) / 3))
    _, u, y = simulated(100)
    np.testing.assert_allclose(th.StateFilter(model).run(y, u=u).filtered, th.StateFilter(uniform).run(y, u=u).filtered, rtol=1e-12)
    # As many deviations as make the bounds of a uniform noise.
    by_deviations = th.StateFilter(uniform, "bounded", deviations=math.sqrt(3)).run(y, u=u)
    by_bounds = th.StateFilter(model, "bounded").run(y, u=u)
    np.testing.assert_allclose(by_deviations.filtered_bounds, by_bounds.filtered_bounds, rtol=1e-9)
    beside = oscillator(Q=np.eye(2), R=[[1.0]], P0=np.eye(2), **BOUNDS)
    np.testing.assert_array_equal(th.StateFilter(beside, "bounded").run(y, u=u).filtered, by_bounds.filtered)


COVARIANCES: dict[str, Any] = {"Q": np.eye(2), "R": [[1.0]], "P0": np.eye(2)}


@pytest.mark.parametrize(
    ("options", "estimator", "error", "message"),
    [
        ({}, {}, ValueError, "Q"),
        ({**COVARIANCES, "process_bound": 0.1}, {}, ValueError, "measurement_bound"),
        ({**BOUNDS, "process_bound": [0.1]}, {}, ValueError, r"process_bound: expected shape \(2, 1\)"),
        ({**BOUNDS, "process_bound": [0.1, np.nan]}, {}, ValueError, "process_bound: expected finite numbers, found nan"),
        ({**BOUNDS, "measurement_bound": np.inf}, {}, ValueError, "measurement_bound: expected finite numbers, found inf"),
        ({**BOUNDS, "initial_bound": [1.0, -1.0]}, {}, ValueError, "initial_bound: it has -1.*: no magnitude is negative"),
        ({**BOUNDS, "measurement_bound": "wide"}, {}, TypeError, "measurement_bound: expected"),
        (COVARIANCES, {"estimator": "bounded"}, ValueError, "bounded needs bounds"),
        (BOUNDS, {"estimator": "bounded", "deviations": 3}, ValueError, "the model says its bounds itself"),
        (COVARIANCES, {"estimator": "bounded", "deviations": -1}, ValueError, "-1 is no number above 0"),
        (COVARIANCES, {"estimator": "bounded", "deviations": np.nan}, ValueError, "deviations: nan is not a finite number"),
        (COVARIANCES, {"estimator": "bounded", "deviations": "3"}, TypeError, "deviations: expected a number"),
        (COVARIANCES, {"estimator": "ukf", "deviations": 3}, ValueError, "deviations are for estimator 'bounded'"),
        (COVARIANCES, {"estimator": "ukf", "poles": [0.5, 0.4]}, ValueError, "poles and gain are for estimator 'luenberger'"),
        (COVARIANCES, {"estimator": "UKF"}, ValueError, "estimator: 'UKF' is none of 'kalman', 'ekf', 'iekf', 'ukf', 'bounded'"),
    ],
)
def test_bad_bounds_and_estimators(options: dict[str, Any], estimator: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message) as raised:
        th.StateFilter(oscillator(**options), **estimator)
    assert "line" not in str(raised.value) and "--" not in str(raised.value)


@pytest.mark.parametrize("estimator", ["iekf", "ukf", "bounded"])
def test_bad_rows_of_the_new_estimators_change_nothing(estimator: Any) -> None:
    filter = th.StateFilter(oscillator(**BOUNDS), estimator)
    filter.update(1.0, 0.5)
    before = filter.to_json()
    cases: list[tuple[tuple[Any, ...], str]] = [
        ((np.inf, 0.5), "'y' is infinite in row 2"),
        ((1.0, -np.inf), "'u' is infinite in row 2"),
        (([1.0, 2.0], 0.5), "y: expected 1 entry"),
        ((1.0, [1.0, 2.0]), "u: expected 1 entry"),
    ]
    for arguments, message in cases:
        with pytest.raises(ValueError, match=message):
            filter.update(*arguments)
        assert filter.to_json() == before
    with pytest.raises(ValueError, match="^model|^estimator"):
        th.StateFilter(seen_once("distance"), "bounded", deviations=3)
    assert np.isnan(filter.update(np.nan, 0.5).innovations).all() and filter.rows == 2


def test_a_smoother_is_refused_where_there_is_none() -> None:
    with pytest.raises(ValueError, match="estimator"):
        th.StateFilter(oscillator(**BOUNDS), "bounded").run([1.0, 2.0], u=[0.0, 0.0], smooth=True)
    assert ExtendedKalmanFilter([0.0], 1.0, iterations=3).iterations == 3

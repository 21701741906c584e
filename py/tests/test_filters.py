"""Filters and observers: against numbers that others have published, another package, and themselves."""

from __future__ import annotations

import copy
import math
import pickle
import threading
from typing import Any, Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th

from thetahat import (
    EstimationError,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearObservation,
    LinearTransition,
    LuenbergerObserver,
    NonlinearObservation,
    NonlinearTransition,
)

Array = NDArray[np.float64]

# The annual flow of the Nile at Aswan, 1871-1970, in 1e8 m3.
NILE = np.array(
    """1120 1160 963 1210 1160 1160 813 1230 1370 1140 995 935 1110 994 1020 960 1180 799 958 1140 1100 1210 1150 1250
    1260 1220 1030 1100 774 840 874 694 940 833 701 916 692 1020 1050 969 831 726 456 824 702 1120 1100 832 764 821 768
    845 864 862 698 845 744 796 1040 759 781 865 845 944 984 897 822 1010 771 676 649 846 812 742 801 1040 860 874 848
    890 744 749 838 1050 918 986 797 923 975 815 1020 906 901 1170 912 746 919 718 714 740""".split(),
    dtype=float,
)
WALK = LinearTransition([[1.0]], [[1469.1]])
LEVEL = LinearObservation([[1.0]], [[15099.0]])
MOTION = LinearTransition([[1.0, 1.0], [0.0, 1.0]], [[0.25, 0.5], [0.5, 1.0]])
POSITION = LinearObservation([[1.0, 0.0]], [[1.0]])
TURN = np.array([[0.9, 0.3, 0.0], [-0.2, 0.95, 0.1], [0.0, 0.1, 0.8]])


def vehicle(rows: int = 120) -> tuple[LinearTransition, LinearObservation, Array, Array]:
    """Three states, two inputs, two correlated outputs, some of which are missing."""
    random = np.random.default_rng(4)
    transition = LinearTransition(TURN, 0.1 * np.eye(3), random.standard_normal((3, 2)))
    observation = LinearObservation([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]], [[0.5, 0.2], [0.2, 0.4]])
    measurements = random.standard_normal((rows, 2))
    measurements[10, 0] = measurements[20, 1] = np.nan
    measurements[30] = np.nan
    return transition, observation, measurements, random.standard_normal((rows, 2))


def linear_as_functions() -> tuple[NonlinearTransition, NonlinearObservation]:
    transition, observation, _, _ = vehicle()
    f, g, h = transition.state_matrix, transition.input_matrix, observation.output_matrix
    assert g is not None
    return (
        NonlinearTransition(lambda x, u: f @ x + g @ u, transition.noise, lambda x, u: f),
        NonlinearObservation(lambda x, u: h @ x, observation.noise, lambda x, u: h),
    )


def swing(x: Array, u: Array) -> Array:
    return np.array([x[0] + 0.02 * x[1], x[1] - 0.02 * 9.81 * math.sin(x[0])])


def swing_jacobian(x: Array, u: Array) -> Array:
    return np.array([[1.0, 0.02], [-0.02 * 9.81 * math.cos(x[0]), 1.0]])


def sideways(x: Array, u: Array) -> Array:
    return np.sin(x[:1])


def sideways_jacobian(x: Array, u: Array) -> Array:
    return np.array([[math.cos(x[0]), 0.0]])


def pendulum_data() -> Array:
    random, truth, measured = np.random.default_rng(6), np.array([0.8, 0.0]), []
    for _ in range(200):
        measured.append(math.sin(truth[0]) + 0.01 * random.standard_normal())
        truth = swing(truth, truth)
    return np.array(measured)


def test_the_nile() -> None:
    trajectory = KalmanFilter([0.0], [[1e7]]).run(WALK, LEVEL, NILE)
    level, variance = trajectory.filtered_states[:, 0], trajectory.filtered_covariances[:, 0, 0]
    # Durbin and Koopman, Time Series Analysis by State Space Methods, section 2.2.
    np.testing.assert_allclose(level[[0, 1, 99]], [1118.311462, 1140.108439, 798.370293], atol=5e-7)
    np.testing.assert_allclose(variance[[0, 1, 99]], [15076.236391, 7894.557531, 4032.157942], atol=5e-7)
    assert trajectory.log_likelihood == pytest.approx(-641.585578, abs=5e-7)
    assert len(trajectory) == 100 and trajectory.actions.tolist() == ["updated"] * 100
    loop = KalmanFilter([0.0], [[1e7]])
    total = 0.0
    for flow in NILE:
        total += loop.update(flow, observation=LEVEL).log_likelihood
        loop.predict(WALK)
    assert total == trajectory.log_likelihood


def test_the_alpha_beta_filter() -> None:
    steady = KalmanFilter([0.0, 0.0], np.eye(2)).steady_state(MOTION, POSITION)
    np.testing.assert_allclose(steady.gain, [[0.75], [0.5]], atol=1e-13)
    np.testing.assert_allclose(steady.predictor_gain, [[1.25], [0.5]], atol=1e-13)
    np.testing.assert_allclose(steady.predicted, [[3.0, 2.0], [2.0, 2.0]], atol=1e-12)
    np.testing.assert_allclose(steady.filtered, [[0.75, 0.5], [0.5, 1.0]], atol=1e-12)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(steady)).gain, steady.gain)
    with pytest.raises(EstimationError, match="not settled after 3 steps"):
        KalmanFilter([0.0, 0.0], np.eye(2)).steady_state(MOTION, POSITION, 3)


def test_a_steady_gain_of_the_literature() -> None:
    entry = np.array([[-0.3832], [0.5919], [0.5191]])
    state_matrix = [[1.1269, -0.494, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    transition = LinearTransition(state_matrix, 2.3 * entry @ entry.T)
    steady = KalmanFilter(np.zeros(3), np.eye(3)).steady_state(
        transition, LinearObservation([[1.0, 0.0, 0.0]], [[1.0]])
    )
    np.testing.assert_allclose(steady.gain[:, 0], [0.53454, 0.01013, -0.47757], atol=5e-6)


def test_it_agrees_with_filterpy() -> None:
    filterpy = pytest.importorskip("filterpy.kalman")
    transition, observation, measurements, inputs = vehicle()
    measurements = np.nan_to_num(measurements)
    other = filterpy.KalmanFilter(dim_x=3, dim_z=2, dim_u=2)
    other.F, other.H, other.Q = TURN, observation.output_matrix, transition.noise
    other.R, other.B, other.x, other.P = observation.noise, transition.input_matrix, np.zeros(3), np.eye(3)
    trajectory = KalmanFilter(np.zeros(3), np.eye(3)).run(transition, observation, measurements, inputs=inputs)
    for k, (y, u) in enumerate(zip(measurements, inputs)):
        np.testing.assert_allclose(trajectory.predicted_states[k], other.x, rtol=1e-9, atol=1e-12)
        other.update(y)
        np.testing.assert_allclose(trajectory.filtered_states[k], other.x, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(trajectory.filtered_covariances[k], other.P, rtol=1e-9, atol=1e-12)
        assert trajectory.nis[k] == pytest.approx(float(other.y @ other.SI @ other.y), rel=1e-9)
        other.predict(u)


def test_steps_in_a_loop_and_run_give_the_same_bits() -> None:
    transition, observation, measurements, inputs = vehicle()
    loop, run = (KalmanFilter(np.zeros(3), np.eye(3), gate=9.0) for _ in range(2))
    trajectory = run.run(transition, observation, measurements, inputs=inputs)
    actions = []
    for k, (y, u) in enumerate(zip(measurements, inputs)):
        np.testing.assert_array_equal(trajectory.predicted_states[k], loop.state)
        np.testing.assert_array_equal(trajectory.predicted_covariances[k], loop.covariance)
        innovation = loop.update(y, observation=observation)
        np.testing.assert_array_equal(trajectory.errors[k], innovation.error)
        np.testing.assert_array_equal(trajectory.variances[k], innovation.variance)
        assert trajectory.nis[k] == innovation.nis
        actions.append(innovation.action)
        np.testing.assert_array_equal(trajectory.filtered_states[k], loop.state)
        np.testing.assert_array_equal(trajectory.filtered_covariances[k], loop.covariance)
        loop.predict(transition, u)
    assert trajectory.actions.tolist() == actions
    assert actions[30] == "missing" and "gated" in actions and np.isnan(trajectory.errors[10, 0])
    assert pickle.dumps(loop) == pickle.dumps(run)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("m", range(1, 5))
@pytest.mark.parametrize("correlated", [False, True])
def test_every_size_gives_the_same_bits(n: int, m: int, correlated: bool) -> None:
    """`run` has a type of its own for 1 to 6 states with 1 to 3 outputs."""
    random = np.random.default_rng(10 * n + m)
    transition = LinearTransition(
        0.6 * random.standard_normal((n, n)) / math.sqrt(n), np.eye(n) + 0.1, random.standard_normal((n, 1))
    )
    root = random.standard_normal((m, m))
    observation = LinearObservation(random.standard_normal((m, n)), root @ root.T + np.eye(m))
    cross = 0.1 * random.standard_normal((n, m)) if correlated else None
    inputs, measurements = random.standard_normal(60), random.standard_normal((60, m))
    measurements[10, m - 1], measurements[20] = np.nan, np.nan
    loop, run = (KalmanFilter(np.ones(n), np.eye(n), gate=12.0) for _ in range(2))
    trajectory = run.run(transition, observation, measurements, inputs=inputs, cross_covariance=cross)
    likelihood = 0.0
    for k, (y, u) in enumerate(zip(measurements, inputs.tolist())):
        np.testing.assert_array_equal(trajectory.predicted_states[k], loop.state)
        np.testing.assert_array_equal(trajectory.predicted_covariances[k], loop.covariance)
        innovation = loop.update(y, observation=observation)
        likelihood += innovation.log_likelihood
        np.testing.assert_array_equal(trajectory.errors[k], innovation.error)
        np.testing.assert_array_equal(trajectory.variances[k], innovation.variance)
        assert (trajectory.nis[k], trajectory.actions[k]) == (innovation.nis, innovation.action)
        np.testing.assert_array_equal(trajectory.filtered_states[k], loop.state)
        np.testing.assert_array_equal(trajectory.filtered_covariances[k], loop.covariance)
        if cross is None or innovation.action == "gated":
            loop.predict(transition, u)
        else:
            loop.predict_correlated(transition, observation, cross, y, input=u)
    assert trajectory.log_likelihood == likelihood
    before = pickle.dumps(run)
    assert pickle.dumps(loop) == before
    measurements[7, 0] = np.inf
    with pytest.raises(ValueError, match="^row 8: measurement is infinite"):
        run.run(transition, observation, measurements, inputs=inputs, cross_covariance=cross)
    assert pickle.dumps(run) == before


def test_a_linear_model_makes_the_extended_filter_a_kalman_filter() -> None:
    transition, observation, measurements, inputs = vehicle()
    linear = KalmanFilter(np.zeros(3), np.eye(3)).run(transition, observation, measurements, inputs=inputs)
    extended = ExtendedKalmanFilter(np.zeros(3), np.eye(3))
    same = extended.run(transition, observation, measurements, inputs=inputs)
    np.testing.assert_array_equal(same.filtered_states, linear.filtered_states)
    np.testing.assert_array_equal(same.filtered_covariances, linear.filtered_covariances)
    called = ExtendedKalmanFilter(np.zeros(3), np.eye(3)).run(*linear_as_functions(), measurements, inputs=inputs)
    np.testing.assert_allclose(called.filtered_states, linear.filtered_states, rtol=1e-9, atol=1e-12)
    assert called.log_likelihood == pytest.approx(linear.log_likelihood)
    mixed = ExtendedKalmanFilter(np.zeros(3), np.eye(3))
    mixed.run(transition, linear_as_functions()[1], measurements, inputs=inputs)
    np.testing.assert_allclose(mixed.state, extended.state, rtol=1e-9)


def test_the_smoother() -> None:
    transition, observation, measurements, inputs = vehicle()
    filter = KalmanFilter(np.zeros(3), np.eye(3))
    before = pickle.dumps(filter)
    smoothed = filter.smooth(transition, observation, measurements, inputs=inputs)
    assert pickle.dumps(filter) == before
    trajectory = filter.run(transition, observation, measurements, inputs=inputs)
    # Rauch, Tung and Striebel, 1965.
    state, covariance = trajectory.filtered_states[-1], trajectory.filtered_covariances[-1]
    for k in reversed(range(len(measurements) - 1)):
        gain = trajectory.filtered_covariances[k] @ TURN.T @ np.linalg.inv(trajectory.predicted_covariances[k + 1])
        state = trajectory.filtered_states[k] + gain @ (state - trajectory.predicted_states[k + 1])
        change = covariance - trajectory.predicted_covariances[k + 1]
        covariance = trajectory.filtered_covariances[k] + gain @ change @ gain.T
        np.testing.assert_allclose(smoothed.states[k], state, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(smoothed.covariances[k], covariance, rtol=1e-8, atol=1e-10)
    extended = ExtendedKalmanFilter(np.zeros(3), np.eye(3))
    again = extended.smooth(*linear_as_functions(), measurements, inputs=inputs)
    np.testing.assert_allclose(again.states, smoothed.states, rtol=1e-8, atol=1e-10)


def test_correlated_noises() -> None:
    # x(k+1) = 0.5 x + e, y = x + e
    model, output = LinearTransition([[0.5]], [[1.0]]), LinearObservation([[1.0]], [[1.0]])
    loop, run = KalmanFilter([0.0], [[0.0]]), KalmanFilter([0.0], [[0.0]])
    for y in (1.0, 2.0):
        loop.update(y, observation=output)
        loop.predict_correlated(model, output, [[1.0]], y)
    run.run(model, output, [1.0, 2.0], cross_covariance=[[1.0]])
    assert loop.state[0] == run.state[0] == 1.5 and loop.covariance[0, 0] == 0.0
    with pytest.raises(ValueError, match="not positive"):
        loop.predict_correlated(model, output, [[2.0]], 1.0)


@pytest.mark.parametrize("iterations", [1, 3])
def test_numerical_and_given_jacobians_agree(iterations: int) -> None:
    y = pendulum_data()
    prior: Any = ([0.5, 0.3], 0.1 * np.eye(2))
    noise = 1e-6 * np.eye(2)
    numerical = (NonlinearTransition(swing, noise), NonlinearObservation(sideways, [[1e-4]]))
    given = (
        NonlinearTransition(swing, lambda x, u: noise, swing_jacobian),
        NonlinearObservation(sideways, lambda x, u: [[1e-4]], sideways_jacobian),
    )
    assert numerical[0].has_numerical_jacobian and not given[1].has_numerical_jacobian
    assert repr(numerical[0]) == "NonlinearTransition(swing, jacobian=numerical)"
    first, second = (ExtendedKalmanFilter(*prior, iterations=iterations) for _ in range(2))
    one, two = first.run(*numerical, y), second.run(*given, y)
    np.testing.assert_allclose(one.filtered_states, two.filtered_states, atol=1e-7)
    np.testing.assert_allclose(one.filtered_covariances, two.filtered_covariances, rtol=1e-6, atol=1e-12)
    loop = ExtendedKalmanFilter(*prior, iterations=iterations)
    for value in y.tolist():
        loop.update(value, observation=numerical[1])
        loop.predict(numerical[0])
    assert pickle.dumps(loop) == pickle.dumps(first)


class Refused(Exception):
    pass


def refuse(x: Array, u: Array) -> Array:
    raise Refused("not now")


@pytest.mark.parametrize(
    ("function", "jacobian", "error", "message"),
    [
        (refuse, None, Refused, "^not now$"),
        (swing, refuse, Refused, "^not now$"),
        (lambda x, u: x[:1], None, ValueError, r"transition function: expected 2 entries, found shape \(1,\)"),
        (lambda x, u: None, None, TypeError, "transition function|expected an array of numbers"),
        (lambda x, u: 1.0, None, ValueError, "transition function: expected one dimension"),
        (lambda x, u: x * np.nan, None, ValueError, "transition function: entry 0 is NaN"),
        (swing, lambda x, u: np.eye(3), ValueError, "transition jacobian: expected shape"),
        (swing, lambda x, u: np.inf * np.ones((2, 2)), ValueError, "transition jacobian: entry 0 is inf"),
    ],
)
def test_a_function_that_fails_changes_nothing(
    function: Any, jacobian: Any, error: type[Exception], message: str
) -> None:
    filter = ExtendedKalmanFilter([0.5, 0.3], np.eye(2))
    before = pickle.dumps(filter)
    transition = NonlinearTransition(function, np.eye(2), jacobian)
    if error is TypeError:
        error = ValueError
    with pytest.raises(error, match=message):
        filter.predict(transition)
    with pytest.raises(error, match=message if error is Refused else "^row 1: "):
        filter.run(transition, POSITION, [1.0, 2.0])
    with pytest.raises(error):
        filter.smooth(transition, POSITION, [1.0, 2.0])
    assert pickle.dumps(filter) == before


def test_a_function_that_uses_its_filter_is_an_error() -> None:
    filter = ExtendedKalmanFilter([0.5, 0.3], np.eye(2))

    def again(x: Array, u: Array) -> Array:
        filter.predict(MOTION)
        return x

    before = pickle.dumps(filter)
    with pytest.raises(RuntimeError):
        filter.predict(NonlinearTransition(again, np.eye(2)))
    assert pickle.dumps(filter) == before


def test_a_failed_step_changes_nothing_and_a_run_names_the_row() -> None:
    filter = KalmanFilter([0.0, 0.0], np.eye(2))
    before = pickle.dumps(filter)
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: filter.run(MOTION, POSITION, [1.0] * 7 + [np.inf]), "^row 8: measurement is infinite"),
        (lambda: filter.run(MOTION, POSITION, np.ones((5, 2))), r"measurements: expected shape \(any, 1\)"),
        (lambda: filter.run(MOTION, POSITION, []), "measurements: expected at least one"),
        (lambda: filter.run(MOTION, POSITION, [1.0], inputs=[1.0]), "inputs: expected None"),
        (lambda: filter.update([1.0, 2.0], observation=POSITION), "measurement: expected 1 entry"),
        (lambda: filter.update(np.inf, observation=POSITION), "measurement is infinite"),
        (lambda: filter.update(1.0, 1.0, observation=POSITION), "input: expected 0 entries|no input"),
        (lambda: filter.update(1.0, observation=LEVEL), "observation: expected a model with 2 states, found 1"),
        (lambda: filter.predict(WALK), "transition: expected a model with 2 states, found 1"),
    ]
    for call, message in calls:
        with pytest.raises(ValueError, match=message):
            call()
    with pytest.raises(EstimationError, match="known exactly"):
        KalmanFilter([0.0], [[0.0]]).run(WALK, LinearObservation([[1.0]], [[0.0]]), [1.0])
    with pytest.raises(TypeError):
        filter.predict(POSITION)  # type: ignore[call-overload]
    assert pickle.dumps(filter) == before


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: KalmanFilter([], [[]]), "state: expected at least one entry"),
        (lambda: KalmanFilter([0.0], np.eye(2)), r"covariance: expected shape \(1, 1\)"),
        (lambda: KalmanFilter([np.nan], [[1.0]]), "state: entry 0 is NaN"),
        (lambda: KalmanFilter([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]]), "covariance is not positive"),
        (lambda: KalmanFilter([0.0], [[1.0]], gate=0.0), "gate is out of range"),
        (lambda: ExtendedKalmanFilter([0.0], [[1.0]], iterations=0), "iterations: expected"),
        (lambda: LinearTransition(np.ones((2, 3)), np.eye(2)), "state_matrix"),
        (lambda: LinearTransition(np.eye(2), np.eye(2), [1.0, 2.0]), "input_matrix: expected two dimensions"),
        (lambda: LinearObservation([[1.0, 0.0]], np.eye(2)), r"noise: expected shape \(1, 1\)"),
        (lambda: LinearObservation([[np.nan, 0.0]], [[1.0]]), "output_matrix: entry 0"),
        (lambda: NonlinearTransition(swing, np.ones((2, 3))), "noise"),
        (lambda: LuenbergerObserver([0.0], [[1.0], [2.0]]), "gain: expected shape"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_what_is_no_function_is_refused() -> None:
    with pytest.raises(TypeError, match="function: expected a function of x and u, found int"):
        NonlinearTransition(1, np.eye(2))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="transition: expected a LinearTransition"):
        ExtendedKalmanFilter([0.0], [[1.0]]).predict(swing)  # type: ignore[call-overload]


@pytest.mark.parametrize("restore", [lambda o: pickle.loads(pickle.dumps(o)), copy.copy, copy.deepcopy])
def test_a_copy_goes_on_to_the_same_bits(restore: Callable[[Any], Any]) -> None:
    transition, observation, measurements, inputs = vehicle()
    for make in (KalmanFilter, ExtendedKalmanFilter):
        filter = make(np.ones(3) / 3.0, np.eye(3) / 7.0)
        filter.run(transition, observation, measurements[:50], inputs=inputs[:50])
        other = restore(filter)
        models = (restore(transition), restore(observation))
        first = filter.run(transition, observation, measurements[50:], inputs=inputs[50:])
        second = restore(other.run(*models, measurements[50:], inputs=inputs[50:]))
        np.testing.assert_array_equal(first.filtered_covariances, second.filtered_covariances)
        np.testing.assert_array_equal(first.filtered_states, second.filtered_states)
        assert first.log_likelihood == second.log_likelihood
        assert filter.gate == other.gate == math.inf
    pendulum = restore(NonlinearTransition(swing, np.eye(2), swing_jacobian))
    assert repr(pendulum) == "NonlinearTransition(swing, jacobian=given)"
    innovation = KalmanFilter(np.zeros(3), np.eye(3)).update([1.0, np.nan], observation=observation)
    np.testing.assert_array_equal(restore(innovation).variance, innovation.variance)
    for thing in (filter, transition, observation, pendulum, innovation, first):
        assert "\n" not in repr(thing)


def test_the_observer() -> None:
    cart = LinearTransition([[1.0, 0.1], [0.0, 1.0]], np.zeros((2, 2)), [[0.005], [0.1]])
    observer = LuenbergerObserver([0.0, 0.0], [[0.0], [0.0]])
    observer.place(cart, POSITION, [0.4 + 0.3j, 0.4 - 0.3j], input=0.0)
    poles = np.linalg.eigvals(cart.state_matrix - observer.gain @ POSITION.output_matrix)
    np.testing.assert_allclose(np.sort_complex(poles), [0.4 - 0.3j, 0.4 + 0.3j], atol=1e-12)
    truth, u, measured = np.array([1.0, 2.0]), np.sin(np.arange(40.0)), []
    for value in u:
        measured.append(truth[0])
        truth = np.array([truth[0] + 0.1 * truth[1] + 0.005 * value, truth[1] + 0.1 * value])
    loop, called = copy.copy(observer), copy.deepcopy(observer)
    trajectory = observer.run(cart, POSITION, measured, inputs=u)
    for k in range(40):
        np.testing.assert_array_equal(trajectory.predicted_states[k], loop.state)
        innovation = loop.update(cart, POSITION, measured[k], input=u[k])
        assert innovation.error == trajectory.errors[k, 0] and math.isnan(float(np.sum(innovation.variance)))
    np.testing.assert_allclose(observer.state, truth, atol=1e-8)
    f, g = cart.state_matrix, np.array([[0.005], [0.1]])
    moved = NonlinearTransition(lambda x, u: f @ x + g @ u, np.zeros((2, 2)))
    called.run(moved, POSITION, measured, inputs=u)
    np.testing.assert_allclose(called.state, observer.state, atol=1e-12)
    called.place(moved, POSITION, [0.5, 0.1], input=0.0)
    with pytest.raises(EstimationError, match="only 1 of the 2 states"):
        observer.place(cart, LinearObservation([[0.0, 1.0]], [[1.0]]), [0.5, 0.1], input=0.0)
    with pytest.raises(ValueError, match="poles is out of range"):
        observer.place(cart, POSITION, [1.5, 0.1], input=0.0)
    with pytest.raises(ValueError, match="observation: expected a model with 1 outputs, found 2"):
        observer.update(cart, LinearObservation(np.eye(2), np.eye(2)), [1.0, 2.0], input=0.0)


def test_arrays_of_every_kind_are_read_alike() -> None:
    transition, observation, measurements, inputs = vehicle()
    measurements, inputs = (a.astype(np.float32).astype(float) for a in (measurements, inputs))
    frozen = measurements.copy()
    frozen.setflags(write=False)
    wide = np.zeros((240, 4))
    wide[::2, ::2] = measurements
    kinds: list[Any] = [
        measurements,
        frozen,
        np.asfortranarray(measurements),
        wide[::2, ::2],
        measurements.astype(np.float32),
        measurements.tolist(),
    ]
    results = set()
    for kind in kinds:
        filter = KalmanFilter(np.zeros(3), np.eye(3))
        filter.run(transition, observation, kind, inputs=inputs)
        results.add(pickle.dumps(filter))
    assert len(results) == 1


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter])
def test_a_gate_that_locks_out_lets_go(kind: Any) -> None:
    walk, level = LinearTransition([[1.0]], [[0.01]]), LinearObservation([[1.0]], [[1.0]])
    locked, released = kind([0.0], [[1.0]], gate=9.0), kind([0.0], [[1.0]], gate=9.0, release=3)
    y = np.full(50, 100.0)
    assert set(locked.run(walk, level, y).actions) == {"gated"} and locked.gated_in_a_row == 50
    actions = released.run(walk, level, y).actions
    assert actions[:4].tolist() == ["gated"] * 3 + ["released"]
    assert actions[-1] == "updated" and released.gated_in_a_row == 0
    assert (locked.release, released.release) == (0, 3)
    assert pickle.loads(pickle.dumps(locked)).gated_in_a_row == 50
    for wrong in (-1, 70000):
        with pytest.raises(ValueError, match="release: expected an int from 0 to 65535"):
            kind([0.0], [[1.0]], release=wrong)


def test_two_threads_run_two_filters_at_once() -> None:
    transition, observation, measurements, inputs = vehicle(3000)
    filters = [KalmanFilter(np.zeros(3), np.eye(3)) for _ in range(3)]
    arguments = (transition, observation, measurements)
    threads = [threading.Thread(target=filter.run, args=arguments, kwargs={"inputs": inputs}) for filter in filters]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({pickle.dumps(filter) for filter in filters}) == 1


@pytest.mark.parametrize("where", ["predict", "correct", "run", "smooth"])
def test_a_noise_function_that_fails_fails_the_call(where: str) -> None:
    def fails(x: Any, u: Any) -> Any:
        raise RuntimeError("boom")

    move, look = (lambda x, u: x), (lambda x, u: x[:1])
    transition = NonlinearTransition(move, fails if where != "correct" else np.eye(2))
    observation = NonlinearObservation(look, fails if where == "correct" else np.eye(1))
    kalman = ExtendedKalmanFilter([1.0, 2.0], np.eye(2))
    calls: dict[str, Callable[[], Any]] = {
        "predict": lambda: kalman.predict(transition),
        "correct": lambda: kalman.update(1.0, observation=observation),
        "run": lambda: kalman.run(transition, observation, [1.0]),
        "smooth": lambda: kalman.smooth(transition, observation, [1.0, 2.0]),
    }
    with pytest.raises(RuntimeError, match="boom"):
        calls[where]()
    assert kalman.state.tolist() == [1.0, 2.0] and kalman.covariance.tolist() == np.eye(2).tolist()
    negative = NonlinearObservation(look, lambda x, u: [[-1.0]])
    with pytest.raises(ValueError, match="observation noise"):
        kalman.update(1.0, observation=negative)


def test_numbers_of_numpy_are_numbers() -> None:
    level = LinearObservation([[1.0]], [[1.0]])
    given, plain = KalmanFilter([0.0], [[1.0]]), KalmanFilter([0.0], [[1.0]])
    given.update(np.float32(1.5), observation=level)
    plain.update(1.5, observation=level)
    assert given.state == plain.state
    given.update(np.int64(2), observation=level)


def test_a_filter_holds_its_models_and_steps_read_update_and_predict() -> None:
    """As users of filterpy type: numbers for P, Q and R, and `update(z)` and `predict(u)` without models."""
    flow = np.array([1120.0, 1160.0, math.nan, 963.0, 1210.0])
    walk, level = LinearTransition([[1.0]], 1469.1), LinearObservation([[1.0]], 15099.0)
    held = KalmanFilter([0.0], 1e7, transition=walk, observation=level)
    given = KalmanFilter([0.0], [[1e7]])
    runs = pickle.loads(pickle.dumps(held))
    for y in flow:
        one = held.update(y)
        with pytest.warns(DeprecationWarning, match="its name is update"):
            other = given.correct(level, y)
        held.predict()
        given.predict(walk)
        assert one.error == other.error or math.isnan(y)
    assert pickle.dumps(held.state) == pickle.dumps(given.state)
    trajectory = runs.run(flow)
    assert trajectory.log_likelihood == KalmanFilter([0.0], 1e7).run(walk, level, flow).log_likelihood
    np.testing.assert_array_equal(runs.state, held.state)
    np.testing.assert_array_equal(LinearTransition(np.eye(2), 0.5).noise, 0.5 * np.eye(2))
    with pytest.raises(ValueError, match="observation: the object holds none; give observation="):
        given.update(1.0)
    with pytest.raises(ValueError, match="transition: expected a model with 1 states, found 2"):
        KalmanFilter([0.0], 1.0, transition=LinearTransition(np.eye(2), 1.0))
    with pytest.raises(TypeError, match="observation: expected a LinearObservation, found LinearTransition"):
        KalmanFilter([0.0], 1.0, observation=walk)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="covariance is not positive semidefinite"):
        KalmanFilter([0.0, 0.0], -1.0)


def test_other_filters_hold_their_models_too() -> None:
    motion, sensor = LinearTransition([[1.0, 0.1], [0.0, 1.0]], 0.01, [[0.0], [0.1]]), LinearObservation([[1.0, 0.0]], 0.04)
    y, u = np.sin(0.3 * np.arange(30)), np.cos(0.3 * np.arange(30))
    kalman = KalmanFilter([0.0, 0.0], 1.0, transition=motion, observation=sensor)
    extended = ExtendedKalmanFilter([0.0, 0.0], 1.0, transition=motion, observation=sensor)
    late = th.OutOfSequenceFilter([0.0, 0.0], 1.0, transition=motion, observation=sensor, samples=3, inputs=1)
    observer = LuenbergerObserver([0.0, 0.0], [[0.5], [0.2]], transition=motion, observation=sensor)
    for measured, applied in zip(y, u):
        kalman.update(measured)
        extended.update(measured)
        late.update(measured, applied)
        observer.update(measured, applied)
        kalman.predict(applied)
        extended.predict(applied)
        late.predict(applied)
    np.testing.assert_allclose(extended.state, kalman.state, atol=1e-12)
    np.testing.assert_allclose(late.state, kalman.state, atol=1e-12)
    again = LuenbergerObserver([0.0, 0.0], [[0.5], [0.2]], transition=motion, observation=sensor)
    again.run(y, u)
    np.testing.assert_array_equal(again.state, observer.state)
    assert pickle.loads(pickle.dumps(late)).update(0.5, 0.0).error == late.update(0.5, 0.0).error

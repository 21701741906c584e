"""Recursive estimators: against batch least squares, another package, and themselves."""

from __future__ import annotations

import contextlib
import copy
import json
import pickle
import re
import threading
import warnings
from typing import Any, Callable, Iterator, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th
from thetahat import (
    EstimationError,
    Forgetting,
    RecursiveArmax,
    RecursiveArx,
    RecursiveLeastSquares,
    RecursiveTrajectory,
)

Array = NDArray[np.float64]

POLICIES: list[float | Forgetting | None] = [
    0.98,
    None,
    Forgetting.selective(0.97),
    Forgetting.random_walk(1e-4),
    Forgetting.variable(0.99, 0.92, 0.01),
]


def regression(rows: int = 200, n: int = 3, seed: int = 1) -> tuple[Array, Array, Array]:
    random = np.random.default_rng(seed)
    phi = random.standard_normal((rows, n))
    theta = np.arange(1.0, n + 1.0)
    return phi, phi @ theta + 0.1 * random.standard_normal(rows), theta


def plant(rows: int = 300, seed: int = 2) -> tuple[Array, Array]:
    """y(k) = 0.8 y(k-1) + 0.5 u(k-2) + e(k)"""
    random = np.random.default_rng(seed)
    u, e, y = random.standard_normal(rows), 0.05 * random.standard_normal(rows), np.zeros(rows)
    for k in range(rows):
        y[k] = (0.8 * y[k - 1] if k > 0 else 0.0) + (0.5 * u[k - 2] if k > 1 else 0.0) + e[k]
    return u, y


def state(estimator: RecursiveLeastSquares | RecursiveArx | RecursiveArmax) -> bytes:
    return pickle.dumps(estimator)


def numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where the numbers of a snapshot are."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from numbers(part, (*path, key))
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from numbers(part, (*path, index))
    elif not isinstance(value, (str, bool)):
        yield path


@pytest.mark.parametrize("estimator", [RecursiveLeastSquares(2), RecursiveArx(1, 1), RecursiveArmax(1, 1, nc=1)])
def test_a_tampered_pickle_is_an_error_or_goes_on(estimator: Any) -> None:
    restore, (name, kept) = estimator.__reduce__()
    refused = 0
    damage: list[Any] = [-1, 7, 1.99, 6e300, 2**63, "NaN", "inf", None, []]
    for path in list(numbers(json.loads(kept))):
        for bad in damage:
            tampered = part = json.loads(kept)
            for key in path[:-1]:
                part = part[key]
            part[path[-1]] = bad
            try:
                read = restore(name, json.dumps(tampered).encode())
            except ValueError:
                refused += 1
                continue
            for k in range(20):
                with contextlib.suppress(ValueError, OverflowError):
                    if name == "RecursiveLeastSquares":
                        read.update([0.1, 1.0], 0.5)
                    else:
                        read.update(0.5, u=float(k % 3))
    assert refused > 50
    with pytest.raises(ValueError, match="of version 2, and version 1 is understood"):
        restore(name, kept.replace(b'"version":1', b'"version":2'))
    with pytest.raises(ValueError, match="not a snapshot"):
        restore(name, kept[:-5])


def test_a_tampered_policy_is_an_error() -> None:
    policy: Any = Forgetting.exponential(0.9)
    restore, (name, kept) = policy.__reduce__()
    for bad in (b"1.99", b"0", b'"NaN"', b"null"):
        with pytest.raises(ValueError):
            restore(name, kept.replace(b"0.9", bad))


def same(trajectory: RecursiveTrajectory, innovations: list[Any]) -> None:
    np.testing.assert_array_equal(trajectory.errors, [i.error for i in innovations])
    np.testing.assert_array_equal(trajectory.variances, [i.variance for i in innovations])
    np.testing.assert_array_equal(trajectory.nis, [i.nis for i in innovations])
    assert trajectory.actions.tolist() == [i.action for i in innovations]


def test_without_forgetting_it_is_batch_least_squares() -> None:
    phi, y, _ = regression()
    estimator = RecursiveLeastSquares(3, None, start="exact")
    estimator.run(phi, y)
    batch, squares = np.linalg.lstsq(phi, y, rcond=None)[:2]
    variance = squares[0] / (len(y) - 3)
    np.testing.assert_allclose(estimator.parameters, batch, rtol=1e-11)
    assert estimator.noise_variance == pytest.approx(variance, rel=1e-10)
    expected = variance * np.linalg.inv(phi.T @ phi)
    assert estimator.parameter_covariance is not None and estimator.standard_errors is not None
    np.testing.assert_allclose(estimator.parameter_covariance, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(estimator.standard_errors, np.sqrt(np.diag(expected)), rtol=1e-9)


def test_exponential_forgetting_is_the_textbook_and_padasip() -> None:
    padasip = pytest.importorskip("padasip")
    phi, y, _ = regression()
    estimator = RecursiveLeastSquares(3, 0.99)
    trajectory = estimator.run(phi, y)
    # P = I / eps there, and 100 I here.
    other = padasip.filters.FilterRLS(n=3, mu=0.99, eps=0.01, w="zeros")
    _, _, weights = other.run(y, phi)
    np.testing.assert_allclose(trajectory.parameters[:-1], weights[1:], rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("n", range(1, 12))
@pytest.mark.parametrize("forgetting", POLICIES)
def test_update_in_a_loop_and_run_give_the_same_bits(forgetting: float | Forgetting | None, n: int) -> None:
    """`run` has a type of its own for each of the sizes 1 to 10."""
    phi, y, _ = regression(n=n)
    y[50], phi[60, n // 2] = np.nan, np.nan
    loop, run = (RecursiveLeastSquares(n, forgetting, scales=np.linspace(0.5, 2.0, n)) for _ in range(2))
    innovations, parameters, errors = [], [], []
    for row, output in zip(phi, y):
        innovations.append(loop.update(row, output))
        parameters.append(loop.parameters)
        known = loop.standard_errors
        errors.append(np.full(n, np.nan) if known is None else known)
    trajectory = run.run(phi, y)
    same(trajectory, innovations)
    np.testing.assert_array_equal(trajectory.parameters, parameters)
    np.testing.assert_array_equal(trajectory.standard_errors, errors)
    assert innovations[50].action == innovations[60].action == "missing"
    assert state(loop) == state(run)


@pytest.mark.parametrize("n", [1, 2, 8, 10, 11])
@pytest.mark.parametrize("start", ["exact", "mixed"])
def test_a_run_goes_on_from_any_state(start: Literal["exact", "mixed"], n: int) -> None:
    phi, y, _ = regression(n=n)
    blend = 5 if start == "mixed" else None
    loop, runs = (RecursiveLeastSquares(n, 0.98, start=start, blend=blend, dead_zone=0.01) for _ in range(2))
    for row, output in zip(phi, y):
        loop.update(row, output)
    for begin, end in ((0, 1), (1, n), (n, n + 3), (n + 3, 100), (100, 200)):
        if begin < end:
            runs.run(phi[begin:end], y[begin:end])
    assert state(loop) == state(runs)
    loop.adapting = runs.adapting = False
    loop.update(phi[0], y[0])
    assert runs.run(phi[:1], y[:1]).actions[0] == "frozen"
    assert state(loop) == state(runs)


def test_the_results_are_separate_arrays_that_can_be_written() -> None:
    phi, y, _ = regression()
    first, second = (RecursiveLeastSquares(3).run(phi, y) for _ in range(2))
    for array in (first.parameters, first.standard_errors, first.errors, first.variances, first.nis):
        assert array.flags.c_contiguous and array.flags.writeable and array.dtype == float
    first.parameters[:] = 0.0
    np.testing.assert_array_equal(first.errors, second.errors)
    np.testing.assert_array_equal(first.standard_errors, second.standard_errors)


def test_several_outputs_share_the_regressor() -> None:
    phi, _, _ = regression()
    truth = np.arange(6.0).reshape(3, 2)
    y = phi @ truth
    loop, run = RecursiveLeastSquares(3, outputs=2), RecursiveLeastSquares(3, outputs=2)
    innovations = [loop.update(row, output) for row, output in zip(phi, y)]
    trajectory = run.run(phi, y)
    np.testing.assert_array_equal(trajectory.errors, [i.error for i in innovations])
    np.testing.assert_array_equal(trajectory.parameters[-1], run.parameters)
    assert trajectory.parameters.shape == trajectory.standard_errors.shape == (200, 3, 2)
    np.testing.assert_allclose(run.parameters, truth, atol=1e-3)
    one = RecursiveLeastSquares(3)
    one.run(phi, y[:, 1].copy())
    np.testing.assert_allclose(one.parameters, run.parameters[:, 1], rtol=1e-12)
    assert run.parameter_covariance is not None and run.parameter_covariance.shape == (2, 3, 3)
    np.testing.assert_allclose(run.predict([1.0, 0.0, 0.0]), run.parameters[0])
    assert state(loop) == state(run) == state(pickle.loads(state(run)))


@pytest.mark.parametrize("forgetting", POLICIES)
@pytest.mark.parametrize("restore", [lambda o: pickle.loads(pickle.dumps(o)), copy.copy, copy.deepcopy])
def test_a_copy_goes_on_to_the_same_bits(
    forgetting: float | Forgetting | None, restore: Callable[[Any], Any]
) -> None:
    phi, y, _ = regression()
    estimator = RecursiveLeastSquares(3, forgetting, start="mixed", blend=7)
    estimator.run(phi[:3], y[:3])
    restored = restore(estimator)
    assert restored is not estimator and restored.forgetting == estimator.forgetting
    first, second = (e.run(phi[3:], y[3:]) for e in (estimator, restored))
    np.testing.assert_array_equal(first.parameters, second.parameters)
    np.testing.assert_array_equal(first.errors, second.errors)
    again = pickle.loads(pickle.dumps(first))
    np.testing.assert_array_equal(again.standard_errors, first.standard_errors)
    np.testing.assert_array_equal(again.actions, first.actions)


def test_arrays_of_every_kind_are_read_alike() -> None:
    phi, y, _ = regression()
    phi, y = phi.astype(np.float32).astype(float), y.astype(np.float32).astype(float)
    frozen = phi.copy()
    frozen.setflags(write=False)
    wide = np.zeros((400, 6))
    wide[::2, ::2] = phi
    kinds: list[Any] = [phi, frozen, np.asfortranarray(phi), wide[::2, ::2], phi.astype(np.float32), phi.tolist()]
    results = []
    for kind in kinds:
        estimator = RecursiveLeastSquares(3)
        estimator.run(kind, y.tolist())
        estimator.update(kind[0], np.float32(1.0))
        results.append(state(estimator))
    assert len(set(results)) == 1


@pytest.mark.parametrize(
    ("phi", "y", "message"),
    [
        ([1.0, 2.0], 1.0, r"phi: expected 3 entries, found shape \(2,\)"),
        ([[1.0, 2.0, 3.0]], 1.0, "phi: expected one dimension"),
        ([1.0, 2.0, np.inf], 1.0, "phi is infinite"),
        ([1.0, 2.0, 3.0], np.inf, "y is infinite"),
        ([1.0, 2.0, 3.0], [1.0], "y: expected a number"),
        ([1.0, 2.0, 3.0], "1", "y: expected a number, found str"),
        ([1e200, 2.0, 3.0], 1.0, "too large"),
        (["a", "b", "c"], 1.0, "phi: expected numbers"),
    ],
)
def test_a_failed_update_changes_nothing(phi: Any, y: Any, message: str) -> None:
    estimator = RecursiveLeastSquares(3)
    estimator.run(*regression()[:2])
    before = state(estimator)
    with pytest.raises((ValueError, TypeError), match=message):
        estimator.update(phi, y)
    assert state(estimator) == before


def test_a_failed_run_names_the_row_and_changes_nothing() -> None:
    phi, y, _ = regression()
    y[17] = np.inf
    estimator = RecursiveLeastSquares(3)
    before = state(estimator)
    with pytest.raises(ValueError, match="^row 18: y is infinite"):
        estimator.run(phi, y)
    with pytest.raises(ValueError, match="^y: expected 200 entries"):
        estimator.run(phi, y[1:])
    assert state(estimator) == before
    u, y = plant()
    u[5] = np.inf
    arx = RecursiveArx(1, 1)
    before = state(arx)
    with pytest.raises(ValueError, match="^row 6: u is infinite"):
        arx.run(y, u=u)
    assert state(arx) == before


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: RecursiveLeastSquares(0), ValueError, "n: expected an int from 1 to 4096"),
        (lambda: RecursiveLeastSquares(-1), ValueError, "found -1"),
        (lambda: RecursiveLeastSquares(10**9), ValueError, "found 1000000000"),
        (lambda: RecursiveLeastSquares(10**40), ValueError, "n: expected"),
        (lambda: RecursiveLeastSquares(1.5), TypeError, "float"),  # type: ignore[arg-type]
        (lambda: RecursiveLeastSquares(2, 0.1), ValueError, "factor is out of range"),
        (lambda: RecursiveLeastSquares(2, np.nan), ValueError, "factor is out of range"),
        (lambda: RecursiveLeastSquares(2, "none"), TypeError, "forgetting"),  # type: ignore[arg-type]
        (lambda: RecursiveLeastSquares(2, scales=[1.0]), ValueError, "scales: expected 2 entries"),
        (lambda: RecursiveLeastSquares(2, scales=[1.0, np.nan]), ValueError, "scales: entry 1"),
        (lambda: RecursiveLeastSquares(2, scales=[1.0, 0.0]), ValueError, "scales"),
        (lambda: RecursiveLeastSquares(2, parameters=[np.nan, 0.0]), ValueError, "parameters: entry 0"),
        (lambda: RecursiveLeastSquares(2, covariance=[[1, 2], [2, 1]]), ValueError, "covariance is not positive"),
        (lambda: RecursiveLeastSquares(2, covariance=[[1, 2], [0, 1]]), ValueError, "not symmetric"),
        (lambda: RecursiveLeastSquares(2, dead_zone=-1.0), ValueError, "dead_zone"),
        (lambda: RecursiveLeastSquares(2, outputs=0), ValueError, "outputs"),
        (lambda: RecursiveLeastSquares(2, start="mixed"), ValueError, "blend: expected an int"),
        (lambda: RecursiveLeastSquares(2, start="mixed", blend=70000), ValueError, "blend"),
        (lambda: RecursiveLeastSquares(2, blend=1), ValueError, "blend: expected None"),
        (lambda: RecursiveLeastSquares(2, start="x"), ValueError, "start: expected"),  # type: ignore[arg-type]
        (lambda: RecursiveLeastSquares(2, start="exact", parameters=[0, 0]), ValueError, "start: expected"),
        (lambda: RecursiveArx(-1, 1), ValueError, "na: expected"),
        (lambda: RecursiveArx(0, 0), ValueError, "expected 1 to"),
        (lambda: RecursiveArx(1, [1, 1], [1]), ValueError, "nk: expected an int, or one for each of 2 inputs"),
        (lambda: RecursiveArx(1, 1, 10**9), ValueError, "nk: expected"),
        (lambda: RecursiveArx(1, [1, 1], 10**6), ValueError, "nk: expected"),
        (lambda: RecursiveArx(1, 1, output_scale=np.nan), ValueError, "scales"),
        (lambda: RecursiveArx(1, 1, input_scales=[1.0, 2.0]), ValueError, "input_scales"),
        (lambda: RecursiveArmax(1, 1, 1, method="newton"), ValueError, "method"),  # type: ignore[arg-type]
        (lambda: RecursiveArmax(0, 0, 1, parameters=[2.0]), ValueError, "C"),
        (lambda: Forgetting.exponential(np.nan), ValueError, "factor"),
        (lambda: Forgetting.variable(0.9, 0.95, 1.0), ValueError, "minimum"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(
    "make",
    [
        lambda: RecursiveArx(1, 1, 2),
        lambda: RecursiveArmax(1, 1, 1, 2, noise_scale=0.1),
        lambda: RecursiveArmax(1, 1, 1, 2, method="prediction-error", noise_scale=0.1),
    ],
)
def test_a_plant_is_found_row_by_row_and_by_run_alike(make: Callable[[], RecursiveArx | RecursiveArmax]) -> None:
    u, y = plant()
    y[40] = np.nan
    loop, run = make(), make()
    innovations = [loop.update(z, u=v) for v, z in zip(u.tolist(), y.tolist())]
    trajectory = run.run(y, u=u)
    same(trajectory, innovations)
    assert innovations[0].action == innovations[41].action == "not ready"
    assert innovations[40].action == "missing"
    np.testing.assert_array_equal(trajectory.parameters[-1], loop.parameters)
    np.testing.assert_allclose(run.a, [1.0, -0.8], atol=0.05)
    np.testing.assert_allclose(run.b[0], [0.0, 0.0, 0.5], atol=0.05)
    restored = pickle.loads(state(run))
    np.testing.assert_array_equal(restored.predict(np.ones(5)), loop.predict(np.ones((5, 1)), 5))
    assert loop.predict(np.ones(5))[0] == pytest.approx(-run.a[1] * y[-1] + run.b[0][2] * u[-2], abs=0.05)
    run.gap()
    assert run.update(0.0, u=0.0).action == "not ready"
    run.adapting = False
    assert not run.adapting and run.forgetting == Forgetting.exponential()


@pytest.mark.parametrize("make", [lambda: RecursiveArx(1, 1), lambda: RecursiveArmax(1, 1, 1)])
def test_time_is_the_order_of_the_calls(make: Callable[[], RecursiveArx | RecursiveArmax]) -> None:
    rows, moments = make(), make()
    u, y = plant()
    for v, z in zip(u.tolist(), y.tolist()):
        expected = rows.update(z, u=v)
        assert moments.measured(z).error == expected.error or np.isnan(expected.error)
        ahead = moments.predict([v, 1.0])
        moments.applied(v)
        assert moments.predict([1.0, 9.0]) == pytest.approx(ahead, abs=0.0, nan_ok=True)
        assert state(moments) == state(rows)
    # A measurement, and another: the input in between is missing.
    moments.measured(1.0)
    moments.measured(1.0)
    assert moments.measured(1.0).action == "not ready"
    rows.run([1.0, 1.0, 1.0], u=[np.nan] * 3)
    moments.applied(np.nan)
    assert state(moments) == state(rows)
    # Inputs, and others: the output in between is missing.
    moments.applied(2.0)
    rows.update(np.nan, u=2.0)
    assert state(moments) == state(rows)


@pytest.mark.parametrize("make", [lambda: RecursiveArx(1, 1, nk=0), lambda: RecursiveArmax(1, 1, 1, nk=0)])
def test_an_input_that_acts_at_once_needs_the_row(make: Callable[[], RecursiveArx | RecursiveArmax]) -> None:
    estimator = make()
    before = state(estimator)
    with pytest.raises(ValueError, match="nk = 0.*update"):
        estimator.measured(1.0)
    assert state(estimator) == before
    assert estimator.update(1.0, u=1.0).action == "not ready"


@pytest.mark.parametrize("make", [lambda: RecursiveArx(1, 1), lambda: RecursiveArmax(1, 1, 1)])
def test_the_output_comes_first_and_then_the_input(make: Callable[[], RecursiveArx | RecursiveArmax]) -> None:
    by_place, by_name, old = make(), make(), make()
    for y, u in ((1.0, 3.0), (2.0, 4.0), (0.5, -1.0)):
        by_place.update(y, u)
        by_name.update(y, u=u)
        with pytest.warns(DeprecationWarning, match="its name is update"):
            old.log_row(y, u=u)
    assert state(by_place) == state(by_name) == state(old)
    by_place.run([1.0, 2.0], [3.0, 4.0])
    by_name.run([1.0, 2.0], u=[3.0, 4.0])
    assert state(by_place) == state(by_name)
    estimator = make()
    before = state(estimator)
    with pytest.raises(ValueError, match="u: expected"):
        estimator.run([1.0, 2.0])
    with pytest.raises(ValueError, match="u: expected"):
        estimator.update(1.0)
    with pytest.raises((TypeError, ValueError), match="y: expected"):
        estimator.update([1.0, 2.0], u=1.0)  # type: ignore[arg-type]
    assert state(estimator) == before


def test_a_controller_learns_its_plant_under_noise() -> None:
    random = np.random.default_rng(7)
    heater = RecursiveArx(1, 1, output_scale=20.0, input_scales=50.0)
    y, u, left = 0.0, 0.0, []
    for k in range(2000):
        y = 0.9 * y + 0.08 * u + 0.1 * random.standard_normal()
        set_point = 30.0 if k // 100 % 2 == 0 else 35.0
        if k % 100 > 20:
            left.append(y - set_point)
        heater.measured(y)
        a1, b1 = heater.parameters
        u = float(np.clip((set_point + a1 * y) / b1, 0.0, 100.0)) if b1 else 50.0
        heater.applied(u)
    assert np.sqrt(np.mean(np.square(left))) < 0.12
    errors = heater.standard_errors
    assert errors is not None
    assert np.all(np.abs(heater.parameters - [-0.9, 0.08]) < 3.0 * errors)


@pytest.mark.parametrize("kind", [RecursiveArx, RecursiveArmax])
def test_parameters_stay_within_their_limits(kind: Any) -> None:
    u, y = plant()
    orders = (1, 1) if kind is RecursiveArx else (1, 1, 1)
    limits = [(-0.7, 0.0), None]
    estimator = kind(*orders, nk=2, limits=limits)
    assert estimator.limits == [(-0.7, 0.0), (-np.inf, np.inf)]
    loop = pickle.loads(state(estimator))
    run = estimator.run(y, u=u)
    assert "projected" in run.actions
    assert np.all((run.parameters[:, 0] >= -0.7) & (run.parameters[:, 0] <= 0.0))
    for v, z in zip(u.tolist(), y.tolist()):
        loop.measured(z)
        loop.applied(v)
    assert state(loop) == state(estimator)
    assert kind(*orders).limits is None
    # It starts within.
    assert kind(*orders, limits=[(-0.7, 0.0), (0.1, np.inf)]).parameters[1] == 0.1
    shapes: list[Any] = [[(0.0, 1.0)], [(0.0, 1.0), 3.0], 5.0, [None, None, None, None]]
    for wrong in shapes:
        with pytest.raises(ValueError, match="limits: expected a pair .* 2 parameters"):
            kind(*orders, limits=wrong)
    ranges: list[Any] = [[(1.0, 0.0), None], [(np.nan, 0.0), None]]
    for wrong in ranges:
        with pytest.raises(ValueError, match="limits is out of range"):
            kind(*orders, limits=wrong)


def test_a_constant_is_estimated_too() -> None:
    u, y = plant()
    raised = y + 20.0
    arx = RecursiveArx(1, 1, 2, forgetting=None, constant=True, output_scale=20.0)
    arx.run(raised, u=u)
    assert arx.constant == arx.parameters[2]
    # The level is constant / A(1).
    assert arx.constant / arx.a.sum() == pytest.approx(20.0, abs=0.2)
    armax = RecursiveArmax(1, 1, 1, 2, forgetting=None, constant=True, output_scale=20.0, noise_scale=0.1)
    armax.run(raised, u=u)
    assert armax.constant == armax.parameters[2] and armax.c[1] == armax.parameters[3]
    assert RecursiveArx(1, 1).constant is None


def test_two_inputs_and_none() -> None:
    random = np.random.default_rng(5)
    u = random.standard_normal((300, 2))
    y = np.r_[0.0, u[:-1, 0] + 2.0 * u[:-1, 1]]
    two = RecursiveArx(0, [1, 1])
    two.run(y, u=u)
    np.testing.assert_allclose([b[1] for b in two.b], [1.0, 2.0], atol=1e-3)
    assert two.update(0.0, u=[1.0, 2.0]).action == "updated"
    with pytest.raises(ValueError, match="u: expected 2 entries, found a number"):
        two.update(0.0, u=1.0)
    with pytest.raises(ValueError, match="u"):
        two.run(y, u=u[:, :1])
    series = RecursiveArx(1, 0)
    series.run(0.5 ** np.arange(20.0))
    np.testing.assert_allclose(series.predict(steps=3)[1:] / series.predict(steps=3)[:-1], -series.a[1])
    with pytest.raises(ValueError, match="steps"):
        series.predict()
    with pytest.raises(ValueError, match="u: expected None"):
        series.update(1.0, u=[1.0])


def test_armax_finds_the_noise() -> None:
    random = np.random.default_rng(3)
    e = 0.5 * random.standard_normal(6000)
    y = e + 0.6 * np.r_[0.0, e[:-1]]
    series = RecursiveArmax(0, 0, 1, forgetting=None, noise_scale=0.5, method="prediction-error")
    series.run(y)
    assert series.c[1] == pytest.approx(0.6, abs=0.03)
    assert series.noise_variance == pytest.approx(0.25, rel=0.05)


def test_start_and_dead_zone_and_adaptation_show_in_the_action() -> None:
    estimator = RecursiveLeastSquares(2, None, start="exact")
    assert estimator.update([0.0, 1.0], 2.0).action == "collecting"
    assert estimator.noise_variance is None and estimator.standard_errors is None
    assert estimator.update([1.0, 1.0], 5.0).action == "updated"
    estimator.adapting = False
    assert estimator.update([1.0, 1.0], 9.0).action == "frozen"
    assert RecursiveLeastSquares(1, dead_zone=1.0).update([1.0], 0.5).action == "skipped"
    warm = RecursiveLeastSquares(2, parameters=[1.0, 2.0], covariance=np.eye(2))
    np.testing.assert_array_equal(warm.covariance, np.eye(2))
    assert warm.predict([1.0, 1.0]) == 3.0
    assert 0.0 <= warm.excitation <= 1.0
    warm.advance()
    for thing in (estimator, warm, estimator.forgetting, warm.update([1.0, 1.0], 1.0)):
        assert "\n" not in repr(thing)


@pytest.mark.parametrize("rule", [{}, {"huber": 3.0}, {"gate": 25.0, "release": 20}])
@pytest.mark.parametrize(
    ("make", "b0"),
    [
        (lambda **rule: RecursiveArx(1, 1, output_scale=5.0, **rule), 1),
        (lambda **rule: RecursiveArmax(1, 1, 1, output_scale=5.0, noise_scale=0.1, **rule), 1),
        (lambda **rule: th.RecursiveOutputError(1, 1, output_scale=5.0, **rule), 1),
        (lambda **rule: th.RecursiveNarx(1, 1, degree=1, **rule), -1),
        (lambda **rule: th.RecursiveVectorArx(1, 1, 1, output_scales=5.0, **rule), 1),
    ],
)
def test_a_rule_for_outliers_keeps_spikes_out(make: Callable[..., Any], b0: int, rule: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    u, y = np.sign(rng.normal(size=1500)), np.zeros(1500)
    for k in range(1, 1500):
        y[k] = 0.8 * y[k - 1] + u[k - 1] + 0.1 * rng.normal()
    y[200::100] += 50.0
    model = make(**rule)
    vector = isinstance(model, th.RecursiveVectorArx)
    trajectory = model.run(y[:, None] if vector else y, u=u)
    gain = trajectory.parameters.reshape(1500, -1)[:, b0]
    spikes = trajectory.actions[500::100]
    if not rule:
        assert set(spikes) <= {"updated", "projected"}
    else:
        assert set(spikes) == {"bounded" if "huber" in rule else "gated"}
        assert np.abs(gain[500:] - 1.0).max() < 0.15
    assert pickle.loads(pickle.dumps(model)).outliers_in_a_row == model.outliers_in_a_row


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"huber": 0.5}, "huber: expected a number of 1 or more"),
        ({"gate": float("nan")}, "gate: expected a number of 1 or more"),
        ({"huber": 3.0, "gate": 25.0}, "huber: expected inf, as a gate is given"),
        ({"release": 3}, "release: expected 0, as there is no gate"),
        ({"gate": 25.0, "release": 65536}, "release"),
    ],
)
def test_rules_for_outliers_that_are_none(rule: dict[str, Any], message: str) -> None:
    for make in (RecursiveLeastSquares, lambda n, **rule: RecursiveArx(n, 1, **rule)):
        with pytest.raises(ValueError, match=message):
            make(1, **rule)
    with pytest.raises(ValueError, match="outliers: .*Instruments|outliers"):
        th.RecursiveOutputError(1, 1, method="instruments", huber=3.0)


def test_two_threads_run_two_estimators_at_once() -> None:
    phi, y, _ = regression(5000)
    alone = RecursiveLeastSquares(3)
    alone.run(phi, y)
    many = [RecursiveLeastSquares(3) for _ in range(4)]
    threads = [threading.Thread(target=estimator.run, args=(phi, y)) for estimator in many]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {state(estimator) for estimator in many} == {state(alone)}


def test_one_estimator_in_two_threads_is_an_error_or_in_turn() -> None:
    phi, y, _ = regression(20000)
    estimator = RecursiveLeastSquares(3)
    raised: list[BaseException] = []

    def work() -> None:
        try:
            estimator.run(phi, y)
        except RuntimeError as error:
            raised.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(raised) < 4


def test_a_bad_snapshot_is_an_error() -> None:
    reduced: Any = RecursiveLeastSquares(2).__reduce__()
    restore, (name, kept) = reduced
    for broken in (b"", b"{}", kept[:-5]):
        with pytest.raises(ValueError, match="not a snapshot"):
            restore(name, broken)
    with pytest.raises(ValueError, match="no class"):
        restore("Other", kept)
    assert issubclass(EstimationError, Exception)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert pickle.loads(pickle.dumps(Forgetting.random_walk(0.1))) == Forgetting.random_walk(0.1)


def test_messages_name_nothing_of_another_language() -> None:
    refused: list[Callable[[], object]] = [
        lambda: th.RecursiveLeastSquares(1, scales=[1e-200]),
        lambda: th.RecursiveLeastSquares(1, scales=[1e200]),
        lambda: th.RecursiveLeastSquares(1).update([1e300], 1.0),
        lambda: th.RecursiveArx(1, 1, output_scale=1e200),
        lambda: th.KalmanFilter([0.0], [[1e308]]).predict(th.LinearTransition([[1e200]], [[1.0]])),
        lambda: th.KalmanFilter([1e308], [[1.0]]).predict(th.LinearTransition([[1e308]], [[1.0]])),
    ]
    for call in refused:
        with pytest.raises((ValueError, th.EstimationError)) as found:
            call()
        assert not re.search(r"[A-Z]+_[A-Z]+|::|\b(Dyn|Const|usize|f32|f64|scalar type|Some|None)\b", str(found.value)), found.value

"""Noises of models in matrices from logs: against published numbers, a dense filter, and differences."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

import thetahat as th

Array = NDArray[np.float64]
NILE = Path(__file__).parents[2] / "tests/data/public/nile.csv"
EXACT: dict[str, Any] = {"tolerance": 1e-14, "max_iterations": 500}

# Two states that turn into one another, two gauges that see both.
F = np.array([[0.9, 0.4], [-0.3, 0.8]])
H = np.array([[1.0, 0.0], [0.5, 1.0]])
G = np.array([[0.0], [1.0]])
Q = np.array([[0.5, 0.2], [0.2, 0.3]])
R = np.array([[0.4, -0.1], [-0.1, 0.2]])


def turning(q: Any = None, r: Any = None, **options: Any) -> th.StateModel:
    q, r = (np.eye(2) + 0.1 if q is None else q), (np.eye(2) + 0.1 if r is None else r)
    return th.StateModel(F, H, q, r, np.eye(2), G=G, sample_time=1, states=["a", "b"], outputs=["y", "z"], **options)


def simulated(rows: int, seed: int = 3, q: Array = Q, r: Array = R, s: Array | None = None) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    joint = np.block([[q, np.zeros((2, 2)) if s is None else s], [np.zeros((2, 2)) if s is None else s.T, r]])
    noises = random.multivariate_normal(np.zeros(4), joint, rows)
    x, u, y = random.standard_normal(2), random.standard_normal((rows, 1)), np.empty((rows, 2))
    for k in range(rows):
        y[k] = H @ x + noises[k, 2:]
        x = F @ x + G @ u[k] + noises[k, :2]
    return y, u


def dense(q: Array, r: Array, y: Array, u: Array) -> float:
    """The log-likelihood by a Kalman filter in plain matrices."""
    x, p, total = np.zeros(2), np.eye(2), 0.0
    for k in range(len(y)):
        there = ~np.isnan(y[k])
        if there.any():
            h = H[there]
            error, variance = y[k, there] - h @ x, h @ p @ h.T + r[np.ix_(there, there)]
            gain = p @ h.T @ np.linalg.inv(variance)
            total -= 0.5 * (error @ np.linalg.solve(variance, error) + np.linalg.slogdet(2 * np.pi * variance)[1])
            x, p = x + gain @ error, p - gain @ h @ p
        x, p = F @ x + G @ u[k], F @ p @ F.T + q
    return total


def symmetric(values: Array) -> tuple[Array, Array]:
    """Q and R of their six numbers."""
    q11, q21, q22, r11, r21, r22 = values
    return np.array([[q11, q21], [q21, q22]]), np.array([[r11, r21], [r21, r22]])


def entries(q: Array, r: Array) -> Array:
    return np.array([q[0, 0], q[1, 0], q[1, 1], r[0, 0], r[1, 0], r[1, 1]])


def test_the_nile() -> None:
    if not NILE.exists():
        pytest.skip("the logs of the repository are not here")
    flow = pd.read_csv(NILE).iloc[:, -1].to_numpy(dtype=float)
    # The prior of the level is as good as none; the likelihood is that of all years but the first.
    model = th.StateModel([[1]], [[1]], [[1000]], [[10000]], [[1e7]], sample_time=1, states=["level"])
    found = th.fit_noise(model, flow, **EXACT)
    # Durbin and Koopman, Time Series Analysis by State Space Methods, 2nd ed. 2012, section 2.10: 1469.1 and 15098.5.
    assert found.Q[0, 0] == pytest.approx(1469.1, rel=2e-3) and found.R[0, 0] == pytest.approx(15098.5, rel=5e-4)
    first = -0.5 * (np.log(2 * np.pi * (1e7 + found.R[0, 0])) + flow[0] ** 2 / (1e7 + found.R[0, 0]))
    assert found.log_likelihood - first == pytest.approx(-632.54, abs=0.01)
    assert th.StateFilter(found.model).run(flow).log_likelihood == pytest.approx(found.log_likelihood, rel=1e-12)
    assert found.log_likelihoods[-1] == found.log_likelihood and np.all(np.diff(found.log_likelihoods) >= 0)
    assert (found.measured, found.stopped, found.warnings) == (100, "converged", [])
    assert repr(found).startswith("NoiseEstimate(Q [[14")


def test_a_full_q_is_the_maximum_of_a_dense_filter() -> None:
    y, u = simulated(600)
    y[50:60] = np.nan
    y[100:120, 0] = np.nan
    found = th.fit_noise(turning(), y, u, structure="full", **EXACT)
    assert found.log_likelihood == pytest.approx(dense(found.Q, found.R, y, u), rel=1e-11)
    at = entries(found.Q, found.R)
    step = 1e-5
    slopes = np.array([
        (dense(*symmetric(at + step * one), y, u) - dense(*symmetric(at - step * one), y, u)) / (2 * step) for one in np.eye(6)
    ])
    # Of a sum of some hundreds of terms, differences resolve 1e-11/1e-5.
    assert np.abs(slopes).max() < 2e-3, slopes
    errors = entries(found.Q_errors, found.R_errors)
    assert np.all(np.abs(at - entries(Q, R)) < 3.5 * errors), (at, errors)
    # The standard errors are those of the Hessian, within what the expected and the observed one differ by.
    wide = 1e-3
    hessian = np.array([
        [
            (
                dense(*symmetric(at + wide * (i + j)), y, u)
                - dense(*symmetric(at + wide * (i - j)), y, u)
                - dense(*symmetric(at - wide * (i - j)), y, u)
                + dense(*symmetric(at - wide * (i + j)), y, u)
            )
            / (4 * wide**2)
            for j in np.eye(6)
        ]
        for i in np.eye(6)
    ])
    np.testing.assert_allclose(errors, np.sqrt(np.diag(np.linalg.inv(-hessian))), rtol=0.1)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_entries_are_recovered_within_their_errors() -> None:
    scores = []
    for seed in range(40):
        y, u = simulated(400, seed)
        found = th.fit_noise(turning(), y, u, structure="full")
        scores.append((entries(found.Q, found.R) - entries(Q, R)) / entries(found.Q_errors, found.R_errors))
    spread = np.std(np.array(scores), axis=0)
    # The deviation of 40 numbers is known within 11 %: three of them, and as much for what is not normal.
    assert np.all(np.abs(spread - 1) < 0.45) and np.all(np.abs(np.mean(scores, axis=0)) < 0.6), spread


def test_diagonal_noises_from_starts_that_are_far_away() -> None:
    y, u = simulated(800, q=np.diag([0.5, 0.02]), r=np.diag([0.4, 0.1]))
    fits = [th.fit_noise(turning(a * np.eye(2), b * np.eye(2)), y, u, **EXACT) for a, b in ((1, 1), (1e-4, 10), (100, 1e-3))]
    for other in fits[1:]:
        np.testing.assert_allclose(other.Q, fits[0].Q, rtol=1e-4)
        assert other.log_likelihood == pytest.approx(fits[0].log_likelihood, abs=1e-6)
    assert fits[0].Q[0, 1] == 0.0 and fits[0].Q_errors[0, 1] == 0.0 and np.all(fits[0].S == 0)
    assert fits[0].Q[0, 0] == pytest.approx(0.5, abs=4 * fits[0].Q_errors[0, 0])
    # No more can be had with the other entries at 0.
    assert fits[0].log_likelihood <= th.fit_noise(turning(), y, u, structure="full").log_likelihood + 1e-6


def test_scales_are_the_best_of_a_line() -> None:
    y, u = simulated(500, q=3 * Q, r=0.5 * R)
    found = th.fit_noise(turning(Q, R), y, u, structure="scaled", **EXACT)
    a, b = found.Q[0, 0] / Q[0, 0], found.R[0, 0] / R[0, 0]
    np.testing.assert_allclose(found.Q, a * Q, rtol=1e-10)
    np.testing.assert_allclose(found.R, b * R, rtol=1e-10)
    assert a == pytest.approx(3, abs=4 * found.Q_errors[0, 0] / Q[0, 0])
    for other in ((1.001 * a, b), (0.999 * a, b), (a, 1.001 * b), (a, 0.999 * b)):
        assert dense(other[0] * Q, other[1] * R, y, u) < found.log_likelihood


def test_noises_in_innovations_form() -> None:
    cross = np.array([[0.2, -0.05], [0.1, 0.0]])
    y, u = simulated(3000, s=cross)
    found = th.fit_noise(turning(), y, u, structure="innovations", **EXACT)
    np.testing.assert_allclose(found.Q, found.S @ np.linalg.solve(found.R, found.S.T), rtol=1e-7, atol=1e-10)
    # The steady state of the noises that made the log.
    p = np.eye(2)
    for _ in range(2000):
        variance = H @ p @ H.T + R
        k = (F @ p @ H.T + cross) @ np.linalg.inv(variance)
        p = F @ p @ F.T + Q - k @ variance @ k.T
    assert np.all(np.abs(found.R - variance) < 4 * found.R_errors)
    assert np.all(np.abs(found.S - k @ variance) < 4 * found.S_errors)
    # Nothing with S = 0 is more likely than the best of all S by more than the start.
    plain = th.fit_noise(turning(), y, u, structure="full")
    assert plain.log_likelihood < found.log_likelihood + 5
    assert th.StateFilter(found.model).run(y, u=u).log_likelihood == pytest.approx(found.log_likelihood, rel=1e-9)
    again = th.fit_noise(found.model, y, u, structure="innovations", **EXACT)
    np.testing.assert_allclose(again.R, found.R, rtol=1e-5)
    with pytest.raises(ValueError, match="structure: S of the model is not 0"):
        th.fit_noise(found.model, y, u)


def test_rows_that_are_missing_and_logs_that_are_joined() -> None:
    y, u = simulated(300)
    gaps = y.copy()
    gaps[[40, 41, 200]] = np.nan
    kept = ~np.isnan(gaps[:, 0])
    # A step over several samples holds the input.
    held = u.copy()
    held[[40, 41]], held[200] = held[39], held[199]
    whole = th.fit_noise(turning(), gaps, held, structure="full", **EXACT)
    irregular = th.fit_noise(turning(), gaps[kept], held[kept], time=np.flatnonzero(kept).astype(float), structure="full", **EXACT)
    np.testing.assert_allclose(irregular.Q, whole.Q, rtol=1e-6)
    assert irregular.log_likelihood == pytest.approx(whole.log_likelihood, rel=1e-12)
    first, second = simulated(150, 1), simulated(250, 2)
    parts = [th.Log({"y": y[:, 0], "z": y[:, 1]}, {"u": u[:, 0]}, sample_time=1.0) for y, u in (first, second)]
    joined = th.fit_noise(turning(), th.Log.join(parts), structure="full", **EXACT)
    total = dense(joined.Q, joined.R, *first) + dense(joined.Q, joined.R, *second)
    assert joined.log_likelihood == pytest.approx(total, rel=1e-11) and joined.measured == 800
    frame = pd.DataFrame({"y": y[:, 0], "z": y[:, 1], "u": u[:, 0]})
    np.testing.assert_array_equal(th.fit_noise(turning(), frame, structure="full").Q, th.fit_noise(turning(), y, u, structure="full").Q)


def test_a_noise_that_is_not_there_comes_out_0_and_is_named() -> None:
    random = np.random.default_rng(0)
    still = th.StateModel([[1]], [[1]], [[1]], [[1]], [[1]], sample_time=1, states=["level"])
    with pytest.warns(th.EstimationWarning, match=r"^the log shows no sign of Q\[level\]: "):
        found = th.fit_noise(still, 3 + random.standard_normal(200))
    assert found.Q[0, 0] == 0.0 and np.isnan(found.Q_errors[0, 0])
    assert found.R[0, 0] == pytest.approx(1.0, abs=4 * found.R_errors[0, 0])
    assert found.warnings[0].startswith("the log shows no sign of Q[level]")
    # What is 0 in the model is known to be.
    known = th.StateModel([[1]], [[1]], [[0]], [[1]], [[1]], sample_time=1)
    assert th.fit_noise(known, 3 + random.standard_normal(200)).Q_errors[0, 0] == 0.0


def test_noises_that_outputs_cannot_tell_apart_are_named() -> None:
    y = np.cumsum(np.random.default_rng(1).standard_normal(300))
    motion = th.StateModel([[1, 1], [0, 1]], [[1, 0]], np.eye(2), [[1]], np.eye(2), sample_time=1, states=["place", "speed"])
    with pytest.raises(th.EstimationError, match=r"3 numbers are unknown, but 1 outputs of 2 states tell no more than 2") as raised:
        th.fit_noise(motion, y, structure="full")
    assert raised.value.parameters == ["Q[place]", "Q[speed]"]
    # Two levels of which the sum alone is seen.
    both = th.StateModel(np.eye(2), [[1, 1]], np.eye(2), [[1]], np.zeros((2, 2)), sample_time=1, states=["one", "other"])
    with pytest.raises(th.EstimationError, match="cannot tell 'Q.one.' and 'Q.other.' apart") as raised:
        th.fit_noise(both, y)
    assert raised.value.parameters == ["Q[one]", "Q[other]"]
    # One that nothing sees.
    unseen = th.StateModel(np.eye(2), [[1, 0]], np.eye(2), [[1]], np.zeros((2, 2)), sample_time=1, states=["one", "other"])
    with pytest.raises(th.EstimationError, match="nothing that was measured depends on 'Q.other.'"):
        th.fit_noise(unseen, y)


@pytest.mark.parametrize(
    ("model", "data", "options", "error", "message"),
    [
        (None, [1.0, 2.0, 3.0], {}, TypeError, "model: expected a StateModel, found NoneType"),
        ("walk", [1.0, np.inf, 3.0], {}, ValueError, "'y' is infinite in row 2"),
        ("walk", [1.0, 2.0], {}, th.EstimationError, "2 unknown parameters need more than 2 measured values"),
        ("walk", [np.nan] * 9, {}, th.EstimationError, "need more than 0 measured values"),
        ("walk", np.ones((9, 2)), {}, ValueError, "data: expected shape"),
        ("walk", np.ones(9), {"u": np.ones(9)}, ValueError, "u: the model has no inputs"),
        ("walk", np.ones(9), {"time": 1.3 * np.arange(9.0)}, ValueError, "1.3"),
        ("walk", np.ones(9), {"structure": "diag"}, ValueError, "structure: 'diag' is none of 'diagonal', 'full', 'scaled', 'innovations'"),
        ("walk", np.ones(9), {"structure": 3}, TypeError, "structure: expected a str"),
        ("walk", np.ones(9), {"max_iterations": 0}, ValueError, "max_iterations: 0 is outside"),
        ("walk", np.ones(9), {"tolerance": 0.0}, ValueError, "tolerance: 0 is not a positive number"),
        ("walk", np.ones(9), {"tolerance": np.nan}, ValueError, "tolerance: nan is not a finite number"),
        ("turning", np.ones((9, 2)), {"u": np.ones(9)}, ValueError, "structure: R of the model is not diagonal: take 'full'"),
        ("still", np.ones(9), {}, ValueError, "structure: all variances of the model are 0"),
        ("equations", np.ones(9), {}, ValueError, "model: it is in equations"),
    ],
)
def test_what_is_wrong_is_said(model: Any, data: Any, options: dict[str, Any], error: type[Exception], message: str) -> None:
    equations = "sample_time = 1\n[states]\nx = { sd = 1 }\n[next]\nx = 'x'\n[outputs]\ny = 'x'\n[noise]\nmeasurement = { y = 1 }\n"
    models = {
        None: None,
        "walk": th.StateModel([[1]], [[1]], [[1]], [[1]], [[1]], sample_time=1),
        "turning": turning(),
        "still": th.StateModel([[1]], [[1]], [[0]], [[0]], [[1]], sample_time=1),
        "equations": th.StateModel.from_toml(equations),
    }
    with pytest.raises(error, match=message) as raised:
        th.fit_noise(models[model], data, **options)  # type: ignore[arg-type]
    assert "--" not in str(raised.value)


def test_results_pickle_and_copy() -> None:
    y, u = simulated(100)
    found = th.fit_noise(turning(), y, u, structure="full")
    for again in (pickle.loads(pickle.dumps(found)), copy.deepcopy(found)):
        assert again.model == found.model and repr(again) == repr(found)
        np.testing.assert_array_equal(again.Q_errors, found.Q_errors)
    assert found.model.states == ["a", "b"] and found.model.outputs == ["y", "z"]
    with pytest.warns(th.EstimationWarning, match="the search ended before it converged"):
        th.fit_noise(turning(), y, u, structure="full", max_iterations=1)

"""Nonlinear ARX models, estimated row by row."""

import pickle
from collections.abc import Callable

import numpy as np
import pytest
import thetahat as th


def record(rows: int = 400, seed: int = 1, noise: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """y(k) = 20 + 5 (0.5 z + v - 0.2 z v), z = (y(k-1) - 20)/5, v = (u(k-1) - 1)/2."""
    rng = np.random.default_rng(seed)
    u, z = 1 + 2 * rng.uniform(-1, 1, rows), np.zeros(rows)
    for k in range(1, rows):
        v = (u[k - 1] - 1) / 2
        z[k] = 0.5 * z[k - 1] + v - 0.2 * z[k - 1] * v + noise * rng.standard_normal()
    return u, 20 + 5 * z


def plant(**options: object) -> th.RecursiveNarx:
    scales = {"output_offset": 20.0, "output_scale": 5.0, "input_offsets": 1.0, "input_scales": 2.0}
    return th.RecursiveNarx(1, 1, forgetting=None, **{"terms": [[0], [1], [0, 1]], **scales, **options})  # type: ignore[arg-type]


def test_a_plant_is_found_by_rows_by_run_and_by_calls() -> None:
    u, y = record()
    rows, calls, run = plant(), plant(), plant()
    for one, other in zip(u, y):
        rows.update(other, u=one)
        calls.measured(other)
        calls.applied(one)
    trajectory = run.run(y, u=u)
    np.testing.assert_array_equal(rows.parameters, calls.parameters)
    np.testing.assert_array_equal(rows.parameters, trajectory.parameters[-1])
    np.testing.assert_allclose(rows.parameters, [0.5, 1.0, -0.2], atol=0.02)
    assert rows.noise_variance == pytest.approx((5 * 0.02) ** 2, rel=0.2)
    assert rows.standard_errors is not None and (rows.standard_errors < 0.01).all()
    assert rows.terms == [[0], [1], [0, 1]]
    np.testing.assert_allclose(np.nanstd(trajectory.errors[50:]), 5 * 0.02, rtol=0.2)


def test_predictions_and_slopes_are_those_of_the_equation() -> None:
    model = plant(parameters=[0.5, 1.0, -0.2])
    assert model.output_at([25.0, 3.0]) == pytest.approx(20 + 5 * (0.5 + 1.0 - 0.2))
    np.testing.assert_allclose(model.slopes_at([25.0, 3.0]), [0.5 - 0.2, 5 * (1.0 - 0.2) / 2])
    model.update(25.0, u=3.0)
    ahead = model.predict([3.0, 1.0])
    z = 0.5 + 1.0 - 0.2
    np.testing.assert_allclose(ahead, [20 + 5 * z, 20 + 5 * (0.5 * z + 1.0 - 0.2 * z)])


def test_it_pickles_and_copies_to_the_bit() -> None:
    u, y = record(60)
    y[20] = np.nan
    model = plant()
    model.run(y[:30], u=u[:30])
    copy = pickle.loads(pickle.dumps(model))
    assert isinstance(copy, th.RecursiveNarx)
    model.run(y[30:], u=u[30:])
    copy.run(y[30:], u=u[30:])
    assert pickle.dumps(copy) == pickle.dumps(model)
    assert repr(copy).startswith("RecursiveNarx(n=3, inputs=1")


def test_a_fitted_model_goes_on() -> None:
    u, y = record(800)
    log = th.Log(y[:400], u[:400], sample_time=1.0)
    fitted = th.narx(log, ny=1, nu=1, terms=4)
    model = th.RecursiveNarx.from_model(fitted, forgetting=None)
    np.testing.assert_array_equal(model.parameters, fitted.parameters)
    np.testing.assert_allclose(model.standard_errors, fitted.standard_errors, rtol=1e-9)  # type: ignore[arg-type]
    trajectory = model.run(y[400:], u=u[400:])
    assert np.nanstd(trajectory.errors) == pytest.approx(0.1, rel=0.15)
    radial = th.narx(log, map="rbf", ny=1, nu=1, centres="grid:3", width=2.0)
    assert th.RecursiveNarx.from_model(radial).terms == []
    linear = th.arx(log, na=1, nb=1)
    with pytest.raises(ValueError, match="expected a nonlinear ARX model"):
        th.RecursiveNarx.from_model(linear)
    with pytest.raises(TypeError, match="expected a Model"):
        th.RecursiveNarx.from_model(3)  # type: ignore[arg-type]


def test_what_is_wrong_is_told() -> None:
    cases: list[tuple[Callable[[], object], str]] = [
        (lambda: th.RecursiveNarx(0, 0), "expected 1 to"),
        (lambda: th.RecursiveNarx(1, 1, degree=0), "degree"),
        (lambda: th.RecursiveNarx(5, 5, degree=12), "degree|terms"),
        (lambda: th.RecursiveNarx(1, 1, degree=2, terms=[[0]]), "degree: the terms say it"),
        (lambda: th.RecursiveNarx(1, 1, terms=[[2]]), "terms: expected"),
        (lambda: th.RecursiveNarx(1, 1, terms=[]), "terms"),
        (lambda: th.RecursiveNarx(1, 1, output_scale=0.0), "scale"),
        (lambda: th.RecursiveNarx(1, 1, output_offset=np.nan), "offset"),
        (lambda: th.RecursiveNarx(1, 1, parameters=[1.0]), "parameters"),
        (lambda: th.RecursiveNarx(1, 1, limits=[None]), "limits"),
    ]
    for make, message in cases:
        with pytest.raises(ValueError, match=message):
            make()
    model = plant()
    before = pickle.dumps(model)
    with pytest.raises(ValueError, match="infinite"):
        model.update(np.inf, u=1.0)
    with pytest.raises(ValueError, match="regressors"):
        model.slopes_at([1.0])
    assert pickle.dumps(model) == before


def test_limits_hold() -> None:
    u, y = record()
    model = plant(limits=[(0.6, 0.9), None, None])
    model.run(y, u=u)
    assert model.parameters[0] == pytest.approx(0.6)
    assert model.limits is not None and model.limits[0] == (0.6, 0.9)


def test_a_tracker_takes_products_and_fitted_functions() -> None:
    u, y = record(600)
    log = th.Log(y, u, sample_time=1.0)
    tracker = th.Tracker(narx="poly", ny=1, nu=1, degree=2, offset={"u": 1.0, "y": 20.0}, forgetting=[None, 0.99])
    trajectory = tracker.run(log)
    assert list(tracker.parameter_names) == ["1", "y(k-1)", "u(k-1)", "y(k-1)^2", "y(k-1)*u(k-1)", "u(k-1)^2"]
    assert trajectory.parameters.shape == (600, 6, 2)
    assert "NARX polynomial" in repr(tracker)
    again = th.Tracker.from_state(tracker.state())
    assert again.state() == tracker.state()
    fitted = th.narx(log[:300], ny=1, nu=1, terms=4)
    warm = th.Tracker(warm=fitted, forgetting=None, horizon=3)
    warm.run(log[300:])
    assert len(warm.parameter_names) == 4
    for options, message in [
        ({"narx": "rbf"}, "narx: 'rbf' is none of poly"),
        ({"narx": "poly", "na": 2}, "na|narx"),
        ({"degree": 2}, "degree"),
        ({"narx": "poly", "constant": True}, "constant"),
        ({"narx": "poly", "warm": fitted}, "narx"),
    ]:
        with pytest.raises((ValueError, TypeError), match=message):
            th.Tracker(**options)  # type: ignore[arg-type]

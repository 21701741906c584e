"""A recursive ARX model of several outputs: that of the core, and what Python adds to it."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

import thetahat as th

Array = NDArray[np.float64]


def plant(rows: int = 300, noise: float = 0.0) -> tuple[Array, Array]:
    """Two outputs that feed each other, and two inputs, the second of which acts two rows later."""
    random = np.random.default_rng(4)
    u = random.normal(size=(rows, 2))
    y = np.zeros((rows, 2))
    for k in range(1, rows):
        late = u[k - 2, 1] if k > 1 else 0.0
        y[k] = [[0.8, -0.1], [0.3, 0.6]] @ y[k - 1] + np.array([1.0, -0.5]) * u[k - 1, 0] + np.array([0.0, 2.0]) * late + 1.0
        y[k] += noise * random.normal(size=2)
    return y, u


def exact() -> th.RecursiveVectorArx:
    return th.RecursiveVectorArx(2, 1, [1, 1], [1, 2], None, constant=True, start="exact", output_scales=[3.0, 3.0])


def test_exact_rows_give_the_plant_and_its_future() -> None:
    y, u = plant()
    model = exact()
    trajectory = model.run(y[:100], u=u[:100])
    assert trajectory.parameters.shape == (100, 5, 2) and trajectory.errors.shape == (100, 2)
    np.testing.assert_allclose(model.a, np.array([[[1.0, 0.0], [0.0, 1.0]], [[-0.8, 0.1], [-0.3, -0.6]]]), atol=1e-9)
    np.testing.assert_allclose(model.b[0], [[0.0, 0.0], [1.0, -0.5]], atol=1e-9)
    np.testing.assert_allclose(model.b[1], [[0.0, 0.0], [0.0, 0.0], [0.0, 2.0]], atol=1e-9)
    assert model.constant is not None
    np.testing.assert_allclose(model.constant, [1.0, 1.0], atol=1e-8)
    np.testing.assert_allclose(model.predict(u[100:110]), y[100:110], atol=1e-7)
    assert th.RecursiveVectorArx(2, 1, 0).constant is None
    assert th.RecursiveVectorArx(2, 1, 0).predict(steps=3).shape == (3, 2)


def test_rows_one_by_one_are_the_run_to_the_bit() -> None:
    y, u = plant(noise=0.1)
    y[50, 1] = np.nan
    whole, single, control = exact(), exact(), exact()
    trajectory = whole.run(y, u=u)
    for k in range(len(y)):
        seen = single.update(y[k], u=u[k])
        np.testing.assert_array_equal(seen.error, trajectory.errors[k])
        if k == 50:
            assert seen.action == "missing"
        np.testing.assert_array_equal(control.measured(y[k]).error, trajectory.errors[k])
        control.applied(u[k])
    for other in (single, control, pickle.loads(pickle.dumps(whole)), copy.deepcopy(whole)):
        np.testing.assert_array_equal(other.parameters, whole.parameters)
        np.testing.assert_array_equal(other.covariance, whole.covariance)
        assert repr(other) == repr(whole)
    assert whole.standard_errors is not None and whole.standard_errors.shape == (5, 2)
    assert whole.parameter_covariance is not None and whole.parameter_covariance.shape == (2, 5, 5)
    assert whole.noise_variance is not None
    np.testing.assert_allclose(whole.noise_variance, [0.01, 0.01], rtol=0.3)


def test_without_forgetting_it_is_the_fit() -> None:
    y, u = plant(noise=0.1)
    fitted = th.arx(th.Log(y, u, sample_time=1.0), 1, 1, couple="full", detrend="none", constant="no").document["estimation"]
    model = th.RecursiveVectorArx(2, 1, [1, 1], forgetting=None, start="exact")
    model.run(y, u=u)
    values = [[entry["value"] for entry in row] for row in fitted["a"][0]]
    np.testing.assert_allclose(model.a[1], values, atol=1e-9)
    warm = th.RecursiveVectorArx(2, 1, [1, 1], parameters=model.parameters, covariance=model.covariance)
    np.testing.assert_array_equal(warm.parameters, model.parameters)


def test_one_output_is_that_of_recursive_arx() -> None:
    y, u = plant(noise=0.1)
    several, one = th.RecursiveVectorArx(1, 2, 2), th.RecursiveArx(2, 2)
    found, expected = several.run(y[:, :1], u=u[:, 0]), one.run(y[:, 0], u=u[:, 0])
    np.testing.assert_array_equal(found.parameters, expected.parameters)
    np.testing.assert_array_equal(several.predict(u[:5, 0])[:, 0], one.predict(u[:5, 0]))


def test_what_is_wrong_is_refused_and_changes_nothing() -> None:
    y, u = plant(noise=0.1)
    model = exact()
    model.run(y[:50], u=u[:50])
    before = pickle.dumps(model)
    for wrong in (1.0, [1.0], [1.0, 2.0, 3.0], [1.0, np.inf], [1e300, 0.0], "ab", None):
        with pytest.raises((TypeError, ValueError), match="y"):
            model.update(wrong, u=u[0])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="u: "):
        model.update(y[0], u=[1.0])
    bad = y.copy()
    bad[7, 0] = np.inf
    with pytest.raises(ValueError, match="row 8"):
        model.run(bad, u=u)
    with pytest.raises(ValueError, match="u: expected an array with 2 columns"):
        model.predict()
    assert pickle.dumps(model) == before
    with pytest.raises(ValueError, match="nk = 0|its own sample|update"):
        th.RecursiveVectorArx(2, 1, 1, 0).measured([0.0, 0.0])
    for arguments in ((0, 1, 1), (2, 0, 0), (5000, 1, 1), (2, -1, 1)):
        with pytest.raises(ValueError):
            th.RecursiveVectorArx(*arguments)
    with pytest.raises(ValueError, match="parameters"):
        th.RecursiveVectorArx(2, 1, 1, parameters=np.zeros((3, 3)))
    model.adapting = False
    assert model.update(y[60], u=u[60]).action == "frozen" and not model.adapting
    model.gap()
    assert np.isnan(model.predict(u[:2])).all()

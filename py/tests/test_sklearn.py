"""ARXRegressor in the hands of scikit-learn."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import pandas as pd
from numpy.typing import NDArray

pytest.importorskip("sklearn", minversion="1.6")

from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit, cross_val_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

import thetahat
import thetahat as th
from thetahat.sklearn import EXPECTED_FAILED_CHECKS, ARXRegressor, NARXRegressor, StateSpaceRegressor, scorer

# a1, a2, then b1 and b2 of the first input, b2 and b3 of the second.
PARAMETERS = np.array([-1.2, 0.5, 1.0, 0.4, 0.3, -0.2])
ORDERS: dict[str, Any] = {"na": 2, "nb": [2, 2], "nk": [1, 2]}


def data(
    count: int = 800, noise: float = 0.01, level: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inputs of mean zero and what y(t) - 1.2 y(t-1) + 0.5 y(t-2) = ... + e(t) makes of them from rest."""
    random = np.random.default_rng(7)
    u = random.standard_normal((count, 2))
    e = noise * random.standard_normal(count)
    y = np.zeros(count)
    a1, a2, b11, b12, b22, b23 = PARAMETERS
    for t in range(3, count):
        driven = b11 * u[t - 1, 0] + b12 * u[t - 2, 0] + b22 * u[t - 2, 1] + b23 * u[t - 3, 1]
        y[t] = -a1 * y[t - 1] - a2 * y[t - 2] + driven + e[t]
    return u, y + level


def test_it_finds_the_parameters() -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS, sample_time=0.1)
    assert regressor.fit(u, y) is regressor
    np.testing.assert_allclose(regressor.coef_, PARAMETERS, atol=0.01)
    np.testing.assert_array_equal(regressor.coef_, regressor.model_.parameters)
    assert regressor.n_features_in_ == 2
    assert not hasattr(regressor, "feature_names_in_")


def test_one_order_serves_all_inputs() -> None:
    u, y = data()
    one = ARXRegressor(na=2, nb=3, nk=1).fit(u, y)
    orders: dict[str, Any] = {"na": np.int64(2), "nb": np.array([3, 3]), "nk": (1, 1)}
    each = ARXRegressor(**orders).fit(u, y)
    np.testing.assert_array_equal(one.coef_, each.coef_)
    assert len(one.coef_) == 8


def test_without_a_horizon_it_runs_freely_from_rest() -> None:
    u, y = data(level=5.0)
    regressor = ARXRegressor(**ORDERS).fit(u, y)
    free = regressor.predict(u)
    np.testing.assert_array_equal(free, regressor.model_.simulate(u, initial="zero"))
    # The outputs are not read.
    np.testing.assert_array_equal(regressor.predict(u, np.zeros(len(y))), free)
    assert free.shape == y.shape
    assert np.isfinite(free).all()
    np.testing.assert_allclose(free[50:], y[50:], atol=0.4)
    assert regressor.score(u, y) == pytest.approx(r2_score(y, free))
    assert regressor.score(u, y) > 0.95


@pytest.mark.parametrize("horizon", [1, 4, np.int64(2)])
def test_with_a_horizon_it_predicts_that_far(horizon: int) -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS, horizon=horizon).fit(u, y)
    predicted = regressor.predict(u, y)
    log = thetahat.Log(y, u)
    np.testing.assert_array_equal(predicted, regressor.model_.predict(log, horizon=int(horizon)))
    known = ~np.isnan(predicted)
    assert 700 < np.count_nonzero(known) < len(y)
    assert regressor.score(u, y) == pytest.approx(r2_score(y[known], predicted[known]))
    assert regressor.score(u, y) > 0.99


def test_weights_count() -> None:
    u, y = data(noise=0.5)
    regressor = ARXRegressor(**ORDERS, horizon=1).fit(u, y)
    predicted = regressor.predict(u, y)
    weights = np.where(np.arange(len(y)) < 400, 0.0, 1.0)
    expected = r2_score(y[400:], predicted[400:])
    assert regressor.score(u, y, sample_weight=weights) == pytest.approx(expected)


def test_a_horizon_needs_outputs() -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS, horizon=3).fit(u, y)
    with pytest.raises(ValueError, match=r"3 samples ahead .* give predict\(X, y\)"):
        regressor.predict(u)


@pytest.mark.parametrize("horizon", [0, -1, 1.5, float("inf"), "1"])
def test_a_horizon_is_a_number_of_samples(horizon: Any) -> None:
    with pytest.raises(ValueError, match="horizon: expected a whole number"):
        ARXRegressor(horizon=horizon).fit(*data())


def test_shapes_are_checked() -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS)
    with pytest.raises(NotFittedError):
        regressor.predict(u)
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        regressor.fit(u, y[1:])
    with pytest.raises(ValueError, match="Expected 2D array"):
        regressor.fit(u[:, 0], y)
    with pytest.raises(ValueError, match="y: .*None"):
        regressor.fit(u, None)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="infinity"):
        regressor.fit(u, np.where(y > 1, np.inf, y))
    regressor.fit(u, y)
    with pytest.raises(ValueError, match="expecting 2 features"):
        regressor.predict(u[:, :1])
    with pytest.raises(ValueError, match="one for each"):
        ARXRegressor(nb=[1, 2, 3]).fit(u, y)


def test_too_few_samples_for_a_score_are_refused() -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS, horizon=1).fit(u, y)
    with pytest.raises(ValueError, match="R.2 needs two"):
        regressor.score(u[:4], np.append(y[:3], np.nan))


def test_clone_and_set_params_keep_what_was_given() -> None:
    regressor = ARXRegressor(na=3, nb=[1, 2], nk=[0, 1], horizon=5, sample_time=0.2)
    assert clone(regressor).get_params() == regressor.get_params()
    given = {"na": 3, "nb": [1, 2], "nk": [0, 1], "horizon": 5, "sample_time": 0.2}
    assert {name: value for name, value in regressor.get_params().items() if value is not None} == given
    assert regressor.set_params(na=1, horizon=None).na == 1
    u, y = data()
    fitted = ARXRegressor(**ORDERS).fit(u, y)
    assert not hasattr(clone(fitted), "model_")


def test_a_pickle_predicts_the_same() -> None:
    u, y = data()
    regressor = ARXRegressor(**ORDERS).fit(u, y)
    again = pickle.loads(pickle.dumps(regressor))
    np.testing.assert_array_equal(again.predict(u), regressor.predict(u))
    np.testing.assert_array_equal(again.coef_, regressor.coef_)


@pytest.mark.parametrize("horizon", [None, 1, 5])
def test_scores_of_splits_in_time(horizon: int | None) -> None:
    u, y = data()
    scores = cross_val_score(
        ARXRegressor(**ORDERS, horizon=horizon), u, y, cv=TimeSeriesSplit(4), error_score="raise"
    )
    assert scores.shape == (4,)
    assert scores.min() > 0.9


def test_a_search_finds_orders_that_serve() -> None:
    u, y = data()
    grid = {"na": [1, 2], "nb": [[1, 1], [2, 2]], "nk": [[1, 2], [3, 3]]}
    search = GridSearchCV(ARXRegressor(horizon=1), grid, cv=TimeSeriesSplit(3), error_score="raise")
    search.fit(u, y)
    assert search.best_params_ == ORDERS
    assert search.best_score_ > 0.99
    assert search.score(u, y) > 0.99


def test_a_search_of_free_runs_may_use_other_scores() -> None:
    u, y = data()
    search = GridSearchCV(
        ARXRegressor(nb=[2, 2], nk=[1, 2]),
        {"na": [0, 2]},
        cv=TimeSeriesSplit(3),
        scoring="neg_mean_squared_error",
        error_score="raise",
    )
    assert search.fit(u, y).best_params_ == {"na": 2}


def test_it_ends_a_pipeline() -> None:
    u, y = data()
    scale = np.array([100.0, 0.01])
    plain = ARXRegressor(**ORDERS).fit(u, y)
    pipeline = make_pipeline(StandardScaler(), ARXRegressor(**ORDERS))
    assert isinstance(pipeline, Pipeline)
    pipeline.fit(scale * u + 7.0, y)
    np.testing.assert_allclose(pipeline.predict(scale * u + 7.0), plain.predict(u), atol=1e-6)
    assert pipeline.score(scale * u + 7.0, y) == pytest.approx(plain.score(u, y), abs=1e-6)
    grid = GridSearchCV(pipeline, {"arxregressor__na": [1, 2]}, cv=TimeSeriesSplit(3), error_score="raise")
    assert grid.fit(u, y).best_params_ == {"arxregressor__na": 2}


def test_a_pipeline_hands_outputs_on() -> None:
    u, y = data()
    pipeline = make_pipeline(StandardScaler(), ARXRegressor(**ORDERS, horizon=2)).fit(u, y)
    predicted = pipeline.predict(u, y=y)
    known = ~np.isnan(predicted)
    assert pipeline.score(u, y) == pytest.approx(r2_score(y[known], predicted[known]))


def test_it_keeps_the_conventions_of_scikit_learn_that_time_allows() -> None:
    def failed(regressor: ARXRegressor) -> set[str]:
        checks: Any = check_estimator(regressor, on_skip=None, on_fail=None)
        return {check["check_name"] for check in checks if check["status"] == "failed"}

    assert len(EXPECTED_FAILED_CHECKS) == 2
    assert failed(ARXRegressor()) == failed(ARXRegressor(na=1, nb=1)) == set(EXPECTED_FAILED_CHECKS)


def test_it_takes_every_option_of_the_fit() -> None:
    u, y = data(level=5.0)
    options = set(inspect.signature(thetahat.arx).parameters) - {"log", "na", "nb", "nk", "couple"}
    assert options <= set(ARXRegressor().get_params())
    log = thetahat.Log(y, u)
    given: Any = {"estimate": slice(100, 700), "detrend": "none", "initial": "zero", "norm": 1, "ridge": 0.5}
    regressor = ARXRegressor(**ORDERS, **given).fit(u, y)
    assert regressor.model_ == thetahat.arx(log, **ORDERS, **given)
    bounded = ARXRegressor(**ORDERS, bound={"a2": 0.5}, dc_gain={"u1": (None, 10.0)}, offset={"y": 5.0}).fit(u, y)
    assert bounded.coef_[1] == pytest.approx(0.5)
    assert clone(bounded).get_params() == bounded.get_params()
    with pytest.raises(ValueError, match="detrend"):
        ARXRegressor(detrend="cubic").fit(u, y)


@pytest.mark.parametrize("horizon", [None, 1, 3])
def test_a_time_series_needs_no_inputs(horizon: int | None) -> None:
    u, y = data(level=5.0)
    regressor = ARXRegressor(na=2, horizon=horizon).fit(None, y)
    assert regressor.n_features_in_ == 0
    assert regressor.model_ == thetahat.ar(thetahat.Log(y), 2)
    predicted = regressor.predict(None, y)
    known = ~np.isnan(predicted)
    assert regressor.score(None, y) == pytest.approx(r2_score(y[known], predicted[known]))
    if horizon is None:
        # The free run of what nothing drives.
        np.testing.assert_allclose(predicted, y.mean())
    else:
        assert regressor.score(None, y) > 0.1
    with pytest.raises(ValueError, match="y: "):
        regressor.predict(None)
    with pytest.raises(ValueError, match="expecting 0 features"):
        regressor.score(u, y)
    with pytest.raises(ValueError, match="X: expected 2 inputs"):
        regressor.fit(u, y).score(None, y)


def test_without_coefficients_of_b_inputs_do_not_matter() -> None:
    u, y = data(level=5.0)
    for horizon in (None, 1):
        regressor = ARXRegressor(na=2, nb=0, horizon=horizon).fit(u, y)
        assert regressor.score(u, y) == pytest.approx(ARXRegressor(na=2, horizon=horizon).fit(None, y).score(None, y))


def test_a_frame_names_the_inputs() -> None:
    pandas = pytest.importorskip("pandas")
    u, y = data()
    # An input may be called as the output would be.
    frame = pandas.DataFrame(u, columns=["voltage", "y"])
    regressor = ARXRegressor(**ORDERS).fit(frame, pandas.Series(y, name="speed"))
    assert list(regressor.feature_names_in_) == ["voltage", "y"]
    expected = ARXRegressor(**ORDERS).fit(u, y).predict(u)
    np.testing.assert_allclose(regressor.predict(frame), expected, atol=1e-12)
    with pytest.raises(ValueError, match="feature names"):
        regressor.predict(frame.rename(columns={"voltage": "current"}))


def test_polars_will_do() -> None:
    polars = pytest.importorskip("polars")
    u, y = data()
    frame = polars.DataFrame(u, schema=["voltage", "load"])
    regressor = ARXRegressor(**ORDERS).fit(frame, polars.Series(y))
    assert list(regressor.feature_names_in_) == ["voltage", "load"]
    expected = ARXRegressor(**ORDERS).fit(u, y).predict(u)
    np.testing.assert_allclose(regressor.predict(frame), expected, atol=1e-12)


def test_missing_samples_are_left_out() -> None:
    u, y = data()
    y[100:110] = np.nan
    regressor = ARXRegressor(**ORDERS, horizon=1).fit(u, y)
    np.testing.assert_allclose(regressor.coef_, PARAMETERS, atol=0.01)
    assert regressor.score(u, y) > 0.99


def test_without_scikit_learn_the_module_says_what_to_install() -> None:
    code = "import sys; sys.modules['sklearn'] = None; import thetahat; import thetahat.sklearn"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "pip install thetahat[sklearn]" in done.stderr.splitlines()[-1]


def squares(count: int = 600) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """y(k) = 0.5 y(k-1) + u(k-1) + 0.4 u(k-1)^2 + e(k)."""
    random = np.random.default_rng(3)
    u = random.uniform(-1, 1, (count, 1))
    y = np.zeros(count)
    for k in range(1, count):
        y[k] = 0.5 * y[k - 1] + u[k - 1, 0] + 0.4 * u[k - 1, 0] ** 2 + 0.02 * random.standard_normal()
    return u, y


def test_nonlinear_models_are_regressors_too() -> None:
    u, y = squares()
    regressor = NARXRegressor(ny=1, nu=1, raw_terms=True, detrend="none", terms=3).fit(u, y)
    found = dict(zip(regressor.model_.parameter_names, regressor.coef_))
    assert found == pytest.approx({"y(k-1)": 0.5, "u(k-1)": 1.0, "u(k-1)^2": 0.4}, abs=0.01)
    assert regressor.score(u, y) > 0.98
    ahead = NARXRegressor(ny=1, nu=1, horizon=2).fit(u, y)
    assert ahead.score(u, y) > 0.98
    assert clone(ahead).get_params() == ahead.get_params()
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(ahead)).predict(u, y), ahead.predict(u, y))
    radial = NARXRegressor(map="rbf", ny=1, nu=1, centres="grid:3", width=2.0).fit(u, y)
    assert radial.score(u, y) > 0.95
    series = NARXRegressor(ny=2, horizon=1).fit(None, y)
    assert series.n_features_in_ == 0
    with pytest.raises(ValueError, match="map|narx"):
        NARXRegressor(map="cubic").fit(u, y)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="horizon"):
        NARXRegressor(horizon=0).fit(u, y)


def test_a_search_finds_the_degree() -> None:
    u, y = squares()
    search = GridSearchCV(NARXRegressor(ny=1, nu=1, horizon=1), {"degree": [1, 2]}, cv=TimeSeriesSplit(3)).fit(u, y)
    assert search.best_params_ == {"degree": 2}


def test_a_nonlinear_regressor_keeps_the_conventions_that_time_allows() -> None:
    check_estimator(NARXRegressor(ny=1, nu=1, degree=1), expected_failed_checks=EXPECTED_FAILED_CHECKS)


def several(count: int = 600) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two inputs and two coupled outputs."""
    random = np.random.default_rng(3)
    u = random.standard_normal((count, 2))
    x = np.zeros((count + 1, 2))
    for t in range(count):
        x[t + 1] = np.array([[0.8, 0.2], [-0.2, 0.7]]) @ x[t] + np.array([[1.0, 0.3], [0.0, 0.5]]) @ u[t]
    return u, x[:count] + 5 + 0.02 * random.standard_normal((count, 2))


@pytest.mark.parametrize(
    "regressor",
    [StateSpaceRegressor(2), ARXRegressor(na=2, nb=2, nk=1), NARXRegressor(ny=1, nu=1, terms=4)],
    ids=["ss", "arx", "narx"],
)
def test_several_outputs_are_fitted_together(regressor: Any) -> None:
    u, y = several()
    regressor = clone(regressor).fit(u[:400], y[:400])
    free = regressor.predict(u[400:])
    assert free.shape == (200, 2)
    np.testing.assert_array_equal(free, regressor.model_.simulate(u[400:], initial="zero"))
    each = [r2_score(y[400:, output], free[:, output]) for output in range(2)]
    assert regressor.score(u[400:], y[400:]) == pytest.approx(np.mean(each))
    ahead = clone(regressor).set_params(horizon=1).fit(u[:400], y[:400])
    assert ahead.predict(u[400:], y[400:]).shape == (200, 2)
    assert ahead.score(u[400:], y[400:]) > 0.9
    assert not hasattr(ahead, "coef_") or len(ahead.coef_) > 0
    with pytest.raises(ValueError, match="expected 2 outputs"):
        ahead.predict(u[400:], y[400:, 0])
    with pytest.raises(ValueError, match="expected an array of shape"):
        regressor.score(u[400:], y[400:, 0])
    # One column is one output.
    with pytest.warns(Warning, match="column-vector"):
        single = clone(regressor).fit(u[:400], y[:400, :1])
    assert single.predict(u[400:]).shape == (200,)
    scores = cross_val_score(clone(regressor), u, y, cv=TimeSeriesSplit(3))
    assert scores.shape == (3,)


def test_states_are_chosen_and_their_names_avoid_those_of_inputs() -> None:
    pandas = pytest.importorskip("pandas")
    u, y = several()
    frame = pandas.DataFrame(u, columns=["y1", "heat"])
    regressor = StateSpaceRegressor(range(1, 5), detrend="mean").fit(frame, y)
    assert regressor.model_.outputs == ["y1_", "y2_"]
    assert regressor.model_.document["estimation"]["orders"]
    again = pickle.loads(pickle.dumps(regressor))
    np.testing.assert_array_equal(again.predict(frame), regressor.predict(frame))
    search = GridSearchCV(StateSpaceRegressor(), {"order": [1, 2]}, cv=TimeSeriesSplit(3)).fit(u, y)
    assert search.best_params_ == {"order": 2}
    series = StateSpaceRegressor(2, horizon=1).fit(None, y)
    assert series.predict(None, y).shape == y.shape
    with pytest.raises(NotFittedError):
        StateSpaceRegressor().predict(u)


def frame_with_gap() -> tuple[pd.DataFrame, pd.Series[float]]:
    log = th.dc_motor()
    index = pd.date_range("2026", periods=1500, freq="10s").delete(range(500, 1000))
    return pd.DataFrame({"u": log["u"]}, index), pd.Series(log["y"], index, name="y")


def test_an_index_of_times_is_the_clock() -> None:
    X, y = frame_with_gap()
    fitted = ARXRegressor(na=2, nb=2).fit(X, y)
    expected = th.arx(th.Log.from_dataframe(X.assign(y=y), inputs="u", output="y"), na=2, nb=2)
    assert (fitted.model_.sample_time, fitted.model_.samples) == (10.0, expected.samples)
    assert (fitted.coef_ == expected.parameters).all()
    # Each side of the gap begins at rest.
    free = fitted.predict(X)
    assert (free[500:] == expected.simulate(X["u"][500:], initial="zero")).all()
    ahead = fitted.set_params(horizon=3).predict(X, y)
    assert np.isnan(ahead[500]) and not np.isnan(ahead[510])
    with pytest.raises(ValueError, match="its rows are 20 s apart, those of the fit 10 s"):
        fitted.set_params(horizon=None).predict(X[:500:2])
    with pytest.raises(ValueError, match="sample_time: the index is a clock"):
        ARXRegressor(na=2, nb=2, sample_time=10.0).fit(X, y)


def test_rows_out_of_order_are_refused_and_holes_are_gaps() -> None:
    X, y = frame_with_gap()
    shuffled = np.random.default_rng(0).permutation(len(X))
    with pytest.raises(ValueError, match="time goes back"):
        ARXRegressor(na=2, nb=2).fit(X.iloc[shuffled], y.iloc[shuffled])
    counted = X.reset_index(drop=True), y.reset_index(drop=True)
    with pytest.raises(ValueError, match="X: its index goes back from .*shuffled folds do not"):
        ARXRegressor(na=2, nb=2).fit(counted[0].iloc[shuffled], counted[1].iloc[shuffled])
    holes = np.r_[0:300, 600:1000]
    fitted = ARXRegressor(na=2, nb=2, sample_time=0.1).fit(counted[0].iloc[holes], counted[1].iloc[holes])
    assert fitted.model_.sample_time == pytest.approx(0.1)
    assert fitted.model_.samples == len(holes) - 2 * 2


@pytest.mark.parametrize("gap", [0, 20])
def test_scorers_see_the_outputs_that_a_prediction_begins_with(gap: int) -> None:
    u, y = data(noise=0.2)
    cv = TimeSeriesSplit(3, gap=gap)
    regressor = ARXRegressor(**ORDERS, horizon=1)
    own = cross_val_score(regressor, u, y, cv=cv)
    np.testing.assert_allclose(cross_val_score(regressor, u, y, cv=cv, scoring=scorer("r2")), own)
    errors = cross_val_score(regressor, u, y, cv=cv, scoring=scorer("neg_root_mean_squared_error"))
    assert errors == pytest.approx([-0.2] * 3, rel=0.2)
    pipeline = make_pipeline(StandardScaler(), regressor)
    np.testing.assert_allclose(cross_val_score(pipeline, u, y, cv=cv, scoring=scorer()), own, rtol=1e-9)
    search = GridSearchCV(regressor, {"na": [1, 2]}, cv=cv, scoring=scorer("neg_mean_absolute_error")).fit(u, y)
    assert search.best_params_ == {"na": 2}
    with pytest.raises(ValueError, match=r"scoring=thetahat.sklearn.scorer\('r2'\)"):
        regressor.fit(u, y).predict(u)
    with pytest.raises(ValueError, match="metric"):
        scorer("perplexity")


def test_what_predict_returns_can_be_a_series_or_a_frame() -> None:
    u, y = data()
    index = pd.date_range("2026-03-01", periods=len(u), freq="10s", name="when")
    X, target = pd.DataFrame(u, index, ["heater", "fan"]), pd.Series(y, index, name="room")
    plain = ARXRegressor(**ORDERS).fit(X, target)
    named = ARXRegressor(**ORDERS).set_output(transform="pandas").fit(X, target)
    found = named.predict(X)
    assert isinstance(found, pd.Series) and found.name == "room" and found.index.equals(index)
    np.testing.assert_array_equal(found, plain.predict(X))
    assert named.score(X, target) == plain.score(X, target)
    assert clone(named).fit(u, y).predict(u).shape == (800,)
    polars = pytest.importorskip("polars")
    assert isinstance(plain.set_output(transform="polars").predict(X), polars.Series)
    u, y = several()
    both: Any = StateSpaceRegressor(2).set_output(transform="pandas").fit(u, pd.DataFrame(y, columns=["a", "b"]))
    assert list(both.predict(u).columns) == ["a", "b"]
    with pytest.raises(ValueError, match="transform: 'arrow' is none of"):
        plain.set_output(transform="arrow")  # type: ignore[arg-type]


def test_orders_are_given_by_the_names_of_columns() -> None:
    u, y = data()
    frame = pd.DataFrame(u, columns=["heater", "fan"])
    named = ARXRegressor(na=2, nb={"fan": 2, "heater": 2}, nk={"fan": 2, "heater": 1}).fit(frame, y)
    np.testing.assert_array_equal(named.coef_, ARXRegressor(**ORDERS).fit(frame, y).coef_)
    pipeline = make_pipeline(StandardScaler().set_output(transform="pandas"), clone(named))
    assert pipeline.fit(frame, y).score(frame, y) > 0.99
    for orders, words in (({"fan": 2}, "nb: there is none for 'heater'"), ({"fan": 2, "heater": 2, "pump": 1}, "nb: 'pump' is no input")):
        with pytest.raises(ValueError, match=words):
            ARXRegressor(nb=orders).fit(frame, y)


def test_rows_that_are_too_few_get_the_orders_that_they_determine() -> None:
    u, y = data(noise=0.3)
    few = ARXRegressor(na=3, nb=3)
    with pytest.warns(th.EstimationWarning, match="too few rows.*; fitted with na=2, nb=2 instead"):
        few.fit(u[:9], y[:9])
    assert few.model_.orders["nb"] == [2, 2]
    with pytest.warns(th.EstimationWarning, match="the level of y stands for a model"):
        few.fit(u[:3], y[:3])
    np.testing.assert_allclose(few.predict(u), np.mean(y[:3]))
    with pytest.raises(th.EstimationError):
        NARXRegressor(degree=3, terms=20).fit(u[:3], y[:3])

"""Seasonal ARIMA models beside those of statsmodels."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.stats import norm
from statsmodels.tsa.arima.model import ARIMA
from statsmodels.tsa.statespace.sarimax import SARIMAX

import thetahat as th

from conftest import public_log

Array = npt.NDArray[np.float64]


def passengers() -> Array:
    """The logarithm of the monthly passengers of airlines, 1949 to 1960."""
    return th.read_csv(public_log("air_passengers.csv"), inputs=[], sample_time=1)["y"]


def of_statsmodels(model: th.Model, trends: int = 0) -> Array:
    """The parameters in the order of statsmodels' SARIMAX, of which the trends are further inputs: the noise variance is the last."""
    letters = ("ar", "ma", "sar", "sma")
    named = dict(zip(model.parameter_names, model.parameters))
    regression = [value for name, value in named.items() if name.rstrip("0123456789") not in letters]
    assert len(regression) >= trends
    own = [value for letter in letters for name, value in named.items() if name.rstrip("0123456789") == letter]
    return np.array([*regression, *own, model.noise_variance])


def process(rows: int, ar: float, ma: float, seed: int) -> Array:
    e = np.random.default_rng(seed).normal(size=rows + 50)
    y = np.zeros(rows + 50)
    for t in range(1, rows + 50):
        y[t] = ar * y[t - 1] + e[t] + ma * e[t - 1]
    return y[50:]


def slope(model: Any, at: Array, length: float = 1e-5) -> Array:
    """The gradient of statsmodels' log-likelihood by differences."""
    steps = np.diag(length * np.maximum(np.abs(at), 1e-2))
    return np.array([(model.loglike(at + step) - model.loglike(at - step)) / 2 / step.max() for step in steps])


def test_the_airline_model_is_that_of_statsmodels() -> None:
    y = passengers()
    log = th.Log(y, sample_time=1)
    model = th.arima(log, order=(0, 1, 1), seasonal=(0, 1, 1, 12), tolerance=1e-14)
    assert model.parameter_names == ["ma1", "sma12"] and model.kind == "polynomial" and model.samples == 131
    # Box, Jenkins and Reinsel, 1994, table 9.2, have 0.40 and 0.56 in signs of their own.
    assert np.allclose(model.parameters, [-0.40182, -0.55694], atol=5e-6)
    at = of_statsmodels(model)

    # The likelihood of the differences is that of simple differencing, and so is AIC.
    differenced = SARIMAX(y, order=(0, 1, 1), seasonal_order=(0, 1, 1, 12), simple_differencing=True)
    own = differenced.smooth(at)
    assert np.isclose(model.log_likelihood, own.llf, rtol=1e-10)
    assert np.isclose(model.aic, own.aic, rtol=1e-10) and np.isclose(model.bic, own.bic, rtol=1e-10)
    assert np.abs(slope(differenced, at)[:2]).max() < 1e-4
    assert np.allclose(model.standard_errors, np.sqrt(np.diag(own.cov_params_approx))[:2], rtol=0.01)

    # The default begins with a diffuse state whose variance is large, and leaves the first 13 samples out.
    diffuse = SARIMAX(y, order=(0, 1, 1), seasonal_order=(0, 1, 1, 12)).smooth(at)
    assert diffuse.loglikelihood_burn == 13
    assert np.isclose(model.log_likelihood, diffuse.llf, rtol=1e-6)
    assert np.isclose(model.aic, diffuse.aic, rtol=1e-6) and np.isclose(model.bic, diffuse.bic, rtol=1e-6)

    # What it expects, on the scale of y.
    expected = diffuse.get_forecast(36)
    ahead = model.forecast(log, steps=36)
    assert np.allclose(ahead.values, expected.predicted_mean, rtol=1e-6)
    assert np.allclose(ahead.standard_deviations, expected.se_mean, rtol=1e-6)
    low, high = ahead.interval(0.95).T
    assert np.allclose(np.column_stack([low, high]), expected.conf_int(0.05), rtol=1e-6)
    assert np.isclose((high - low)[0] / 2, norm.ppf(0.975) * ahead.standard_deviations[0])
    assert np.all(np.diff(ahead.standard_deviations) > 0)
    assert np.allclose(model.residuals(log)[13:], diffuse.resid[13:], atol=1e-6)
    for steps in (1, 3, 20):
        found = model.predict(log, horizon=steps)
        rows = np.array([40, 90, 143])
        reference = [
            SARIMAX(y[: row + 1 - steps], order=(0, 1, 1), seasonal_order=(0, 1, 1, 12)).smooth(at).forecast(steps)[-1] for row in rows
        ]
        assert np.isnan(found[: 12 + steps]).all() and np.allclose(found[rows], reference, rtol=1e-6)


def test_all_factors_agree_with_statsmodels() -> None:
    rng = np.random.default_rng(5)
    e, w = rng.normal(size=700), np.zeros(700)
    for t in range(13, 700):
        w[t] = 0.5 * w[t - 1] + e[t] + 0.3 * e[t - 1] - 0.5 * e[t - 12] - 0.15 * e[t - 13]
    y = np.cumsum(w)[200:]
    for t in range(12, 500):
        y[t] += y[t - 12]
    model = th.arima(th.Log(y, sample_time=1), order=(1, 1, 1), seasonal=(0, 1, 1, 12), tolerance=1e-14)
    assert model.parameter_names == ["ar1", "ma1", "sma12"]
    reference = SARIMAX(y, order=(1, 1, 1), seasonal_order=(0, 1, 1, 12), simple_differencing=True)
    at = of_statsmodels(model)
    assert np.isclose(model.log_likelihood, reference.loglike(at), rtol=1e-10)
    assert np.abs(slope(reference, at)[:3]).max() < 1e-3
    # C and D are the products.
    ar1, ma1, sma12 = model.parameters
    season, own = np.zeros(13), np.zeros(13)
    season[[0, 12]], own[[0, 12]] = [1, sma12], [1, -1]
    assert np.allclose(model.c, np.convolve([1, ma1], season))
    assert np.allclose(model.d, np.convolve(np.convolve([1, -ar1], [1, -1]), own))


@pytest.mark.parametrize("trend", [False, True])
def test_a_constant_and_missing_values_agree_with_statsmodels(trend: bool) -> None:
    y = 20 + process(300, 0.7, 0.4, 1) + (0.02 * np.arange(300) if trend else 0)
    t = np.arange(300)
    y[7 * t**3 % 23 < 5] = np.nan
    log = th.Log(y, sample_time=1)
    model = th.arima(log, order=(1, 0, 1), trend=trend or None, tolerance=1e-14)
    assert model.parameter_names == ["constant", *(["drift"] if trend else []), "ar1", "ma1"]
    line = np.column_stack([t**power for power in range(2 if trend else 1)]).astype(float)
    reference = SARIMAX(y, exog=line, order=(1, 0, 1))
    at = of_statsmodels(model)
    own = reference.smooth(at)
    assert np.isclose(model.log_likelihood, own.llf, rtol=1e-10) and np.isclose(model.aic, own.aic, rtol=1e-10)
    # BIC counts what was measured, and there also the rows that miss it.
    assert model.samples == np.isfinite(y).sum()
    assert np.abs(slope(reference, at)).max() < 2e-3
    if not trend:
        fitted = ARIMA(y, order=(1, 0, 1)).fit()
        assert np.allclose(model.parameters, fitted.params[:-1], rtol=2e-3, atol=2e-3)
    future = np.column_stack([np.arange(300, 310.0) ** power for power in range(line.shape[1])])
    expected = own.get_forecast(10, exog=future)
    ahead = model.forecast(log, steps=10)
    assert np.allclose(ahead.values, expected.predicted_mean, rtol=1e-8)
    assert np.allclose(ahead.standard_deviations, expected.se_mean, rtol=1e-8)
    assert np.allclose(model.residuals(log), own.resid, atol=1e-8, equal_nan=True)


def test_differences_go_on_through_missing_values() -> None:
    y = passengers()
    y[[30, 31, 60, 100, 130]] = np.nan
    log = th.Log(y, sample_time=1)
    model = th.arima(log, order=(0, 1, 1), seasonal=(0, 1, 1, 12), tolerance=1e-14)
    reference = SARIMAX(y, order=(0, 1, 1), seasonal_order=(0, 1, 1, 12))
    own = reference.smooth(of_statsmodels(model))
    # Nothing is lost but the missing values: not the differences that they are in.
    assert model.samples == 126 and np.isclose(model.log_likelihood, own.llf, rtol=1e-6)
    # The diffuse start leaves noise of 1e-7 in its likelihood.
    assert np.abs(slope(reference, of_statsmodels(model), 1e-3)[:2]).max() < 1e-2
    expected, ahead = own.get_forecast(24), model.forecast(log, steps=24)
    assert np.allclose(ahead.values, expected.predicted_mean, rtol=1e-6)
    assert np.allclose(ahead.standard_deviations, expected.se_mean, rtol=1e-6)


def test_an_input_acts_beside_the_noise() -> None:
    rng = np.random.default_rng(3)
    u = rng.normal(size=(260, 2))
    y = 3 * u[:, 0] - 1.5 * u[:, 1] + process(260, 0.6, 0.0, 2).cumsum()
    log = th.Log(y[:250], u[:250], sample_time=1)
    model = th.arima(log, order=(1, 1, 0), tolerance=1e-14)
    assert model.parameter_names == ["b1_0", "b2_0", "ar1"]
    reference = SARIMAX(y[:250], exog=u[:250], order=(1, 1, 0))
    at = of_statsmodels(model)
    own = reference.smooth(at)
    assert np.isclose(model.log_likelihood, own.llf, rtol=1e-6)
    simple = SARIMAX(y[:250], exog=u[:250], order=(1, 1, 0), simple_differencing=True)
    assert np.isclose(model.log_likelihood, simple.loglike(at), rtol=1e-10)
    assert np.abs(slope(simple, at)[:3]).max() < 1e-3
    expected, ahead = own.get_forecast(10, exog=u[250:]), model.forecast(log, 10, u[250:])
    assert np.allclose(ahead.values, expected.predicted_mean, rtol=1e-6)
    assert np.allclose(ahead.standard_deviations, expected.se_mean, rtol=1e-6)
    # With a delay u(t - 2) is the input.
    delayed = th.arima(log, order=(1, 1, 0), nk=2)
    assert delayed.parameter_names == ["b1_2", "b2_2", "ar1"]


def test_the_drift_is_that_of_statsmodels() -> None:
    y = process(200, 0.0, 0.5, 4).cumsum() + 0.3 * np.arange(200)
    model = th.arima(th.Log(y, sample_time=1), order=(0, 1, 1), trend=True, tolerance=1e-14)
    fitted = ARIMA(y, order=(0, 1, 1), trend="t").fit()
    assert model.parameter_names == ["drift", "ma1"]
    assert np.allclose(model.parameters, fitted.params[:2], rtol=1e-3)
    assert np.allclose(model.forecast(th.Log(y, sample_time=1), 5).values, fitted.forecast(5), rtol=1e-4)


def test_the_rest_works_as_with_other_models(tmp_path: Any) -> None:
    y = passengers()
    log = th.Log(y, sample_time=1)
    model = th.arima(log, order=(0, 1, 1), seasonal=(0, 1, 1, 12), estimate="1..108", validate="109..144")
    assert [fit["part"] for fit in model.fits] == ["estimation", "validation"]
    # Rows before those held out are known.
    assert model.fits[1]["samples"] == 36
    validation = model.validate(log[108:])
    assert validation.fit(1) > 60
    assert 0.01 < model.validate(log).whiteness <= 1
    model.write(tmp_path / "model.json")
    again = th.Model.read(tmp_path / "model.json")
    assert again == model and np.array_equal(again.parameters, model.parameters)
    assert again.covariance is not None and again.covariance.shape == (2, 2)
    assert th.fit(log, plan=model) == model
    assert abs(np.abs(model.noise_poles()) - 1).max() < 1e-6


def test_what_makes_no_sense_is_refused() -> None:
    y = passengers()
    log = th.Log(y, sample_time=1)
    with pytest.raises(ValueError, match="order: give 3 numbers"):
        th.arima(log, order=(1, 1))
    with pytest.raises(ValueError, match="seasonal: give 4 numbers"):
        th.arima(log, order=(1, 1, 1), seasonal=(0, 1, 1))
    with pytest.raises(ValueError, match="order"):
        th.arima(log, order=(-1, 1, 1))
    with pytest.raises(ValueError, match="two rows at least"):
        th.arima(log, order=(0, 1, 1), seasonal=(0, 1, 1, 1))
    with pytest.raises(ValueError, match="white noise about a constant"):
        th.arima(log, order=(0, 0, 0))
    with pytest.raises(ValueError, match="constant: differencing takes it"):
        th.arima(log, order=(0, 1, 1), constant="yes")
    with pytest.raises(ValueError, match="trend: differencing more than once"):
        th.arima(log, order=(0, 2, 1), trend=True)
    with pytest.raises(th.EstimationError, match="too few rows"):
        th.arima(log[:14], order=(0, 1, 1), seasonal=(0, 1, 1, 12))
    with pytest.raises(th.EstimationError, match="no noise to describe"):
        th.arima(th.Log(np.full(50, 3.0), sample_time=1), order=(0, 1, 1))
    with pytest.raises(th.EstimationError, match="differencing takes it"):
        th.arima(th.Log(y, np.full(144, 2.0), sample_time=1), order=(0, 1, 1))


def test_one_output_is_fitted() -> None:
    y = np.cumsum(np.random.default_rng(1).standard_normal((200, 2)), axis=0)
    with pytest.raises(ValueError, match=r"log: it has 2 outputs \(y1, y2\), and the model one"):
        th.arima(th.Log(y, sample_time=1), (1, 1, 1))
    assert th.arima(th.Log(y, sample_time=1).select(output="y2"), (1, 1, 0), (0, 0, 0, 0)).name == "ARIMA(1, 1, 0)"

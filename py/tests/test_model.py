"""What models answer: identities between responses, and agreement with other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import scipy.signal
import statsmodels.api as sm
from statsmodels.stats.diagnostic import acorr_ljungbox

import thetahat as th


def test_residuals_are_those_of_the_fit(motor: th.Log) -> None:
    armax = th.armax(motor, 2, 2, 1)
    # The fit begins with zero innovations, the prediction with those that fit best.
    assert abs(np.nanmean(armax.residuals(motor) ** 2) / armax.mse - 1) < 0.02
    model = th.arx(motor, 2, 2)
    residuals = model.residuals(motor)
    assert np.isnan(residuals[:2]).all() and np.isclose(np.mean(residuals[2:] ** 2), model.mse, rtol=1e-10)


def test_predictions_meet_the_free_run(motor: th.Log) -> None:
    model = th.arx(motor, 2, 2)
    assert np.array_equal(model.predict(motor, None, initial="zero"), model.simulate(motor.u))
    assert np.array_equal(model.simulate(motor.u), model.simulate(motor, initial="zero"))
    assert np.allclose(model.simulate(motor.u[:, 0])[:700], model.simulate(motor[:700].u), atol=1e-12)
    lower, upper = model.predict_interval(motor, 5).T
    values = model.predict(motor, 5)
    assert np.allclose((lower + upper) / 2, values, equal_nan=True)
    inside = (lower < motor.y) & (motor.y < upper)
    assert inside[10:].mean() > 0.9


def test_what_stands_before_a_log_has_one_set_of_words(motor: th.Log) -> None:
    words: list[Any] = ["auto", "drop", "zero", "estimate"]
    # Without F there are no initial conditions to estimate.
    for word in words[:3]:
        th.armax(motor, 2, 2, 1, initial=word)
    model = th.oe(motor, 2, 2)
    predicted = {word: model.predict(motor, initial=word) for word in words}
    assert np.array_equal(model.predict(motor), predicted["auto"]) and np.array_equal(predicted["auto"], predicted["estimate"])
    assert not np.array_equal(predicted["zero"], predicted["estimate"])
    assert np.array_equal(model.simulate(motor), model.simulate(motor, initial="estimate"))
    assert np.array_equal(model.simulate(motor.u), model.simulate(motor, initial="zero"))
    arx = th.arx(motor, 2, 2)
    assert np.array_equal(arx.predict(motor), arx.predict(motor, initial="drop"), equal_nan=True)
    dropped, started = arx.predict(motor, initial="drop"), arx.predict(motor, initial="zero")
    assert np.isnan(dropped[:2]).all() and np.isfinite(started).all()
    assert [fit["initial"] for fit in arx.fits] == ["drop", "estimate"]
    with pytest.raises(ValueError, match="initial: 'measured' is none of 'auto', 'drop', 'zero', 'estimate'"):
        model.predict(motor, initial="measured")  # type: ignore[arg-type]


def test_information_criteria_are_those_of_statsmodels() -> None:
    random = np.random.default_rng(5)
    y, u = np.zeros(400), random.standard_normal(400)
    for t in range(2, 400):
        y[t] = 1.2 * y[t - 1] - 0.5 * y[t - 2] + u[t - 1] + random.standard_normal()
    ours, theirs = th.ar(th.Log(y), 2, detrend="none"), sm.tsa.AutoReg(y, 2, trend="n").fit()
    assert np.allclose([ours.log_likelihood, ours.aic, ours.bic], [theirs.llf, theirs.aic, theirs.bic], rtol=1e-12)
    # A regression does not count the variance as a parameter.
    arx = th.arx(th.Log(y, u), 2, 1, detrend="none")
    ols = sm.OLS(y[2:], np.column_stack([-y[1:-1], -y[:-2], u[1:-1]])).fit()
    assert np.allclose([arx.log_likelihood, arx.aic, arx.bic], [ols.llf, ols.aic + 2, ols.bic + np.log(398)], rtol=1e-12)
    # They order models as those beside them do.
    scale = np.log(2 * np.pi) + 1
    assert np.isclose(arx.aic, arx.samples * (arx.criteria["aic"] + scale) + 2, rtol=1e-12)
    assert np.isclose(arx.bic, arx.samples * (arx.criteria["mdl"] + scale) + np.log(arx.samples), rtol=1e-12)
    exact = th.ar(th.Log(np.zeros(20) + 0.5 ** np.arange(20)), 1, detrend="none")
    assert np.isnan(exact.aic) == (exact.mse == 0)


@pytest.mark.filterwarnings("ignore:channel 'y' misses")
@pytest.mark.parametrize("holes", [False, True])
def test_the_exact_likelihood_is_that_of_statsmodels(holes: bool) -> None:
    random = np.random.default_rng(8)
    y, e = np.zeros(300), random.standard_normal(300)
    for t in range(2, 300):
        y[t] = 1.2 * y[t - 1] - 0.5 * y[t - 2] + e[t] + 0.4 * e[t - 1]
    if holes:
        y[random.choice(300, 90, replace=False)] = np.nan
    ours = th.arma(th.Log(y), 2, 1, detrend="none", likelihood="exact", search="newton", tolerance=1e-15)
    assert (ours.method, ours.samples) == ("exact-likelihood", 210 if holes else 300)
    theirs = sm.tsa.SARIMAX(y, order=(2, 0, 1))
    a1, a2, c1 = ours.parameters
    # The same function, and no place near ours where it is larger.
    at = np.array([-a1, -a2, c1, ours.mse])
    assert np.isclose(theirs.loglike(at), ours.log_likelihood, rtol=1e-12)
    assert np.abs(theirs.score(at, approx_complex_step=False, approx_centered=True)).max() < 1e-3
    found = theirs.fit(disp=0)
    assert found.llf <= ours.log_likelihood + 1e-9
    assert np.allclose(found.params, at, atol=1e-3)
    found = theirs.smooth(at)
    # Theirs counts rows without an output in ln N.
    assert np.allclose([ours.aic, ours.bic], [found.aic, found.bic - 4 * np.log(300 / ours.samples)], rtol=1e-10)
    # Of p = 3 parameters, var e is estimated with N - 3.
    known = ours.standard_errors * np.sqrt((ours.samples - 3) / ours.samples)
    assert np.allclose(known, found.bse[:3], rtol=0.15)


def test_a_forecast_goes_on_where_the_log_ends(motor: th.Log) -> None:
    model = th.armax(motor, 2, 2, 1)
    ahead = model.forecast(motor[:900], 4, motor.u[900:904])
    # The k-th value is the prediction k steps ahead of a log that goes on.
    for k in range(1, 5):
        assert np.isclose(ahead.values[k - 1], model.predict(motor[:904], k)[900 + k - 1], rtol=1e-9)
    assert np.allclose(ahead.time, motor.time[900:904]) and (np.diff(ahead.standard_deviations) > 0).all()
    lower, upper = ahead.interval().T
    assert (lower < ahead.values).all() and (ahead.values < upper).all()
    series = th.ar(motor, 2)
    assert series.forecast(motor, 3).values.shape == (3,)
    assert repr(ahead) == "Forecast(4 steps from 9 s)"


def test_a_forecast_goes_on_from_the_last_measured_sample(motor: th.Log) -> None:
    speed = motor.y.copy()
    speed[895:900] = np.nan
    cut = th.Log(speed, motor.u, sample_time=0.01)
    future = motor.u[900:904]
    for model in (th.arx(motor, 2, 2), th.armax(motor, 2, 2, 1), th.bj(motor, 2, 1, 1, 2)):
        ahead = model.forecast(cut[:900], 4, future)
        # Five rows are missing: the same as a longer forecast from where they begin.
        longer = model.forecast(cut[:895], 9, motor.u[895:904])
        assert np.allclose(ahead.values, longer.values[5:], rtol=1e-9)
        assert np.allclose(ahead.standard_deviations, longer.standard_deviations[5:], rtol=1e-9)
    series = th.ar(motor, 2)
    assert np.allclose(series.forecast(cut[:900], 3).values, series.forecast(cut[:895], 8).values[5:])
    # Output errors need no past output, and are as sure of all steps.
    model = th.oe(motor, 2, 2)
    ahead = model.forecast(cut[:900], 4, future)
    assert np.allclose(ahead.values, model.predict(cut[:904], None)[900:904], rtol=1e-6)
    assert np.allclose(ahead.standard_deviations, np.sqrt(model.noise_variance), rtol=0.05)


def test_missing_outputs_do_not_cut_an_output_error_model(motor: th.Log) -> None:
    speed = motor.y.copy()
    speed[np.random.default_rng(1).random(speed.size) < 0.3] = np.nan
    log = th.Log(speed, motor.u, sample_time=0.01)
    whole, cut = th.oe(motor, 2, 2), th.oe(log, 2, 2)
    assert cut.samples == np.isfinite(speed).sum()
    assert np.isclose(cut.dc_gain()[0], whole.dc_gain()[0], rtol=0.1)
    assert np.isclose(cut.noise_variance, whole.noise_variance, rtol=0.2)
    # Predictions go on where the output is missing.
    assert np.isfinite(cut.predict(log)).all() and np.isfinite(cut.predict(log, None)).all()


def test_initial_conditions_are_for_models_that_have_some(motor: th.Log) -> None:
    with pytest.raises(ValueError, match="estimate is for models with F"):
        th.armax(motor, 2, 2, 1, initial="estimate")
    with pytest.raises(ValueError, match="estimate is for models with F"):
        th.arx(motor, 2, 2, initial="estimate")


def test_responses_are_those_of_the_polynomials(motor: th.Log) -> None:
    model = th.bj(motor, 2, 1, 1, 2)
    w = np.array([0.5, 5.0, 50.0])
    response = model.frequency_response(w)
    z = np.exp(-1j * w * model.sample_time)
    plant = np.polyval(model.b[0][::-1], z) / np.polyval(model.f[0][::-1], z)
    noise = np.polyval(model.c[::-1], z) / np.polyval(model.d[::-1], z)
    assert response.sources == ["u", "noise"]
    assert np.allclose(response.values, [plant, noise]) and np.allclose(np.abs(response.values), response.magnitude)
    assert np.allclose(np.exp(1j * response.phase), response.values / response.magnitude)
    assert (response.magnitude_errors > 0).all() and model.frequency_response().frequencies.shape == (100,)
    step = model.step_response()
    assert np.isclose(step.values[-1], model.dc_gain()[0], rtol=0.02)
    assert np.allclose(step.values, scipy.signal.dlsim(model.to_scipy(), np.ones(len(step.values)))[1][:, 0])
    impulse = model.impulse_response("u")
    assert np.allclose(impulse.values, scipy.signal.dimpulse(model.to_scipy(), n=len(impulse.time))[1][0][:, 0])
    assert np.array_equal(impulse.time, step.time) and (impulse.standard_errors[3:] > 0).all()


def test_other_packages_simulate_the_same(motor: th.Log) -> None:
    model = th.armax(motor, 2, 2, 1)
    u = motor.u[:, 0] - model.offsets["u"][0]
    free = model.simulate(motor.u) - model.offsets["y"][0]
    for system in (model.to_control(), model.to_state_space().to_control()):
        assert system.dt == 0.01 and system.input_labels == ["u"] and system.output_labels == ["y"]
        assert np.allclose(control.forced_response(system, inputs=u).outputs, free, atol=1e-9)
    for system in (model.to_scipy(), model.to_state_space().to_scipy()):
        assert np.allclose(scipy.signal.dlsim(system, u)[1][:, 0], free, atol=1e-9)
    poles = np.sort_complex(control.poles(model.to_control()))
    assert np.allclose(poles, np.sort_complex(model.poles()))
    assert np.allclose(control.zeros(model.to_control()), model.zeros())
    magnitude = control.frequency_response(model.to_control(), omega=np.array([1.0, 5.0, 10.0])).magnitude
    assert np.allclose(np.ravel(magnitude), model.frequency_response([1.0, 5.0, 10.0]).magnitude[0])


def test_the_innovations_form_predicts_the_same(motor: th.Log) -> None:
    model = th.armax(motor, 2, 2, 1)
    form = model.to_state_space()
    u, y = motor.u[:, 0] - model.offsets["u"][0], motor.y - model.offsets["y"][0]
    x, predicted = np.zeros(len(form.F)), np.zeros(len(motor))
    for t in range(len(motor)):
        predicted[t] = (form.H @ x + form.D[:, 0] * u[t])[0]
        x = form.F @ x + form.G[:, 0] * u[t] + form.K[:, 0] * (y[t] - predicted[t])
    assert np.allclose(predicted + model.offsets["y"][0], model.predict(motor, 1, initial="zero"), atol=1e-9)
    assert form.noise_covariance.tolist() == [[model.noise_variance]]


def test_statsmodels_agrees(motor: th.Log) -> None:
    y = motor.y - motor.y.mean()
    theirs = sm.tsa.AutoReg(y, lags=3, trend="n").fit()
    ours = th.ar(motor, 3)
    assert np.allclose(-ours.parameters, theirs.params, rtol=1e-9)
    assert np.allclose(ours.residuals(motor)[3:], theirs.resid, atol=1e-9)
    # Of y = phi x + e by ordinary least squares: standard errors with N - p.
    regressors = np.column_stack([y[2:-1], y[1:-2], y[:-3]])
    assert np.allclose(ours.standard_errors, sm.OLS(y[3:], regressors).fit().bse, rtol=1e-9)
    table = acorr_ljungbox(theirs.resid, lags=[25], model_df=3)
    statistic = ours.validate(motor).document["residuals"][0]["ljung_box"]["statistic"]
    assert statistic is not None and np.isclose(statistic, table["lb_stat"].iloc[0], rtol=0.05)


def test_validations_say_what_was_required(motor: th.Log) -> None:
    model = th.arx(motor[:700], 2, 2)
    validation = model.validate(motor[700:], require=["white", "stable", "fit>=99", "fit@3>=1"], horizon=[2, 7])
    assert [text.split(":")[0] for text in validation.unmet] == ["white", "fit>=99"]
    assert {fit["horizon"].get("steps") for fit in validation.document["fit"]} == {1, 2, 3, 7, None}
    assert validation.fit(7) < validation.fit(1) and validation.independence["u"] > 0.05
    assert list(validation.anderson) == [0.01, 0.02, 0.05, 0.1, 0.2]
    assert all(0 < p < 1 for p in validation.anderson.values())
    with pytest.raises(ValueError, match="horizon: 4 was not evaluated"):
        validation.fit(4)
    errors = np.abs(motor.y[700:] - model.predict(motor[700:], None, initial="estimate"))
    assert np.isclose(validation.mean_absolute_error(None), errors.mean())
    assert np.isclose(validation.largest_error(None), errors.max())
    with pytest.raises(ValueError, match="horizon: 4 was not evaluated"):
        validation.largest_error(4)
    assert model.validate(motor, rows=slice(700, 1000)).document["rows"] == [[701, 1000]]
    for wrong in ({"require": "fast"}, {"lags": 0}, {"alpha": 2.0}, {"horizon": 0}, {"rows": "0..5"}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            model.validate(motor, **wrong)
    with pytest.raises(ValueError, match="white"):
        th.oe(motor, 2, 2).validate(motor, require="white")


def test_samples_are_runs_with_noise_and_other_parameters(motor: th.Log) -> None:
    model = th.bj(motor[:700], 2, 0, 1, 2)
    runs = model.sample(motor[700:], 200, seed=3)
    assert runs.shape == (200, 300) and np.array_equal(runs, model.sample(motor[700:], 200, seed=3))
    assert np.array_equal(runs[:5], model.sample(motor[700:], 5, seed=3))
    assert not np.array_equal(runs, model.sample(motor[700:], 200, seed=4))
    error = np.abs(runs.mean(axis=0) - model.simulate(motor[700:]))
    assert (error < 5 * runs.std(axis=0) / np.sqrt(200) + 0.1).all()
    low, high = np.quantile(runs, [0.025, 0.975], axis=0)
    assert np.mean((low <= motor.y[700:]) & (motor.y[700:] <= high)) > 0.8
    assert model.sample(motor.u[700:], 3).shape == model.sample({"u": motor.u[700:, 0]}, 3).shape == (3, 300)
    series = th.ar(motor, 2)
    assert series.sample(motor, 2).shape == (2, 1000)
    with pytest.warns(th.EstimationWarning, match="differ in their noise alone"):
        th.arx(motor, 2, 2, norm="inf").sample(motor, 2)
    cases: list[tuple[Callable[[], object], str]] = [
        (lambda: model.sample(motor, 0), "draws: 0 is outside"),
        (lambda: model.sample(motor, 2, seed=-1), "seed: -1 is outside"),
        (lambda: model.sample(motor.u, 2, initial="estimate"), "initial"),
        (lambda: series.sample([1.0], 2), "no inputs"),
    ]
    for call, words in cases:
        with pytest.raises(ValueError, match=words):
            call()


def test_models_stand_side_by_side(motor: th.Log) -> None:
    models = {"a": th.arx(motor[:700], 2, 2), "b": th.oe(motor[:700], 2, 2)}
    comparison = th.compare(models, motor[700:])
    assert [model["report"] for model in comparison.document["models"]] == ["a", "b"]
    assert "fit [%], free run" in comparison.summary()
    assert repr(th.compare(list(models.values()), motor)) == "Comparison(model 1, model 2)"
    with pytest.raises(ValueError, match="models: there is none"):
        th.compare([], motor)


def test_a_log_is_inspected(motor: th.Log) -> None:
    inspection = th.inspect(motor)
    assert inspection.delays == {"u": 1} and inspection.document["rows"] == 1000
    assert inspection.excitation["u"] > 10 and inspection.feedback == {"u": False}
    assert 0.9 < (inspection.confidence["u"] or 0) <= 1
    with pytest.raises(TypeError, match="for files"):
        th.inspect(motor, time="t")


def test_pages_are_written_whole(motor: th.Log, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    model = th.arx(motor, 2, 2)
    model.write_html(path, motor)
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    with pytest.raises(FileNotFoundError):
        model.write_html(tmp_path / "none" / "page.html")
    assert [each.name for each in tmp_path.iterdir()] == ["page.html"]
    path.write_text(model.to_json(), encoding="utf-8")
    assert th.Model.read(path) == model


def test_what_a_model_cannot_answer_is_refused(motor: th.Log) -> None:
    model, series = th.arx(motor, 2, 2), th.ar(motor, 2)
    other = th.Log(motor.y, {"v": motor.u[:, 0]}, sample_time=0.01)
    cases = [
        (lambda: model.predict(other), "no channel 'u'"),
        (lambda: model.predict(th.Log(motor.y, motor.u, sample_time=0.02)), "sample time"),
        (lambda: model.predict(motor, 0), "horizon: 0 is outside"),
        (lambda: model.predict(motor, 10**30), "horizon"),
        (lambda: model.predict(motor, 1, initial="cold"), "initial: 'cold'"),  # type: ignore[arg-type]
        (lambda: model.simulate([]), "u: "),
        (lambda: model.simulate(np.ones((5, 3))), r"u: expected shape \(any, 1\)"),
        (lambda: model.simulate([1.0, np.nan]), "u: input 'u' holds NaN"),
        (lambda: model.simulate(motor.u, initial="estimate"), "initial"),
        (lambda: series.simulate([1.0]), "no inputs"),
        (lambda: model.forecast(motor, 3), "u: the model has inputs"),
        (lambda: model.forecast(motor, 3, [1.0]), "u: expected 3 entries"),
        (lambda: model.forecast(motor, 0, [1.0]), "steps"),
        (lambda: series.forecast(motor, 3, [1.0]), "u: the model has no inputs"),
        (lambda: series.forecast(motor, 10**7), "steps"),
        (lambda: model.frequency_response([-1.0]), "frequenc"),
        (lambda: model.frequency_response([1e6]), "frequenc"),
        (lambda: model.frequency_response([]), "w: expected at least one"),
        (lambda: model.frequency_response(points=0), "points"),
        (lambda: model.frequency_response(points=2**40), "points"),
        (lambda: model.step_response(1), "input"),
        (lambda: model.step_response(samples=0), "samples"),
        (lambda: model.impulse_response("w"), "input"),
        (lambda: model.impulse_response(samples=0), "samples"),
        (lambda: model.zeros(5), "input: there is no input 5"),
        (lambda: model.confidence_interval(1.0), "level"),
        (lambda: series.to_control(), "no inputs"),
    ]
    for call, words in cases:
        with pytest.raises(ValueError, match=words):
            call()  # type: ignore[no-untyped-call]

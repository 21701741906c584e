"""Nonlinear ARX models, and what every method makes of them."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thetahat as th
from thetahat import plot


def log(rows: int = 600, seed: int = 0) -> th.Log:
    """A plant whose gain grows with its input."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, rows)
    y = np.zeros(rows)
    for k in range(1, rows):
        y[k] = 0.5 * y[k - 1] + u[k - 1] + 0.4 * u[k - 1] ** 2 + 0.05 * rng.standard_normal()
    return th.Log(y, u, sample_time=0.5)


def document(model: th.Model) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(model.to_json())
    return found


def test_terms_are_those_of_the_plant() -> None:
    model = th.narx(log(), terms=3, detrend="none", raw_terms=True)
    found = dict(zip(model.parameter_names, model.parameters))
    assert found == pytest.approx({"y(k-1)": 0.5, "u(k-1)": 1.0, "u(k-1)^2": 0.4}, abs=0.03)
    assert model.kind == "nonlinear-arx"
    assert document(model)["model"]["maps"][0]["functions"]["type"] == "polynomial"


def test_every_method_takes_it(tmp_path: Path) -> None:
    data = log()
    model = th.narx(data[:400], validate=None, select="mdl")
    line = th.arx(data[:400], na=2, nb=2)
    fresh = model.validate(data, rows=slice(400, 600), require=["fit>=90"])
    assert not fresh.unmet
    assert {fit["horizon"]["kind"] for fit in fresh.document["fit"]} == {"steps", "free-run"}
    predicted, simulated = model.predict(data, horizon=3), model.simulate(data)
    measured = np.asarray(data["y"])
    assert np.nanstd(measured - predicted) < 0.2
    assert np.nanstd(measured - simulated) < 0.2
    table = th.compare({"nonlinear": model, "linear": line}, data).summary()
    assert "nonlinear" in table and "Ljung-Box" in table
    again = pickle.loads(pickle.dumps(model))
    assert again.to_json() == model.to_json()
    assert th.Model.from_json(model.to_json()).parameters == pytest.approx(model.parameters)
    page = tmp_path / "page.html"
    model.write_html(page, data)
    assert "Complexity" in page.read_text(encoding="utf-8")
    assert plot.fit(model, data, 3).get_lines()
    assert "NARX" in model._repr_html_()
    for method in ("step_response", "frequency_response"):
        with pytest.raises(ValueError, match="is of linear models"):
            getattr(model, method)()


def test_the_document_is_that_of_the_command_line(tmp_path: Path) -> None:
    data = log()
    path = tmp_path / "log.csv"
    rows = np.column_stack([np.asarray(data["u"]), np.asarray(data["y"])])
    np.savetxt(path, rows, delimiter=",", header="u,y", comments="", fmt="%.17g")
    options = ["--narx", "poly", "--sample-time", "0.5", "--nu", "3", "--degree", "3", "--split", "60/20/20"]
    report = tmp_path / "report.json"
    program = Path(sys.executable).with_name("thetahat")
    subprocess.run([program, "fit", path, *options, "--report", report], check=True, capture_output=True)
    read = th.read_csv(path, sample_time=0.5)
    model = th.narx(read, nu=3, degree=3, split=(60, 20, 20))
    assert model.to_json() == report.read_text(encoding="utf-8")


def test_radial_functions() -> None:
    model = th.narx(log(), "rbf", ny=1, nu=1, centres="kmeans:8", seed=1, estimate=slice(0, 400), validate=slice(400, 600))
    assert document(model)["model"]["maps"][0]["functions"]["type"] == "radial"
    assert len(document(model)["model"]["maps"][0]["functions"]["centres"]) == 8
    bare = th.narx(log(), "rbf", ny=1, nu=1, centres="grid:4", linear=False)
    assert len(bare.parameters) <= 16


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"map": "cubic"}, "map|narx"),
        ({"degree": 0}, "degree"),
        ({"terms": 0}, "terms"),
        ({"centres": "kmeans:3"}, "centres"),
        ({"map": "rbf", "centres": "here"}, "centres"),
        ({"nu": [1, 2]}, "nu"),
        ({"ny": -1}, "ny|-1"),
        ({"select": "luck"}, "select"),
    ],
)
def test_bad_arguments_are_told(options: dict[str, object], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        th.narx(log(50), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("map", ["poly", "rbf", "spline", "local", "knn"])
@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda y: y * np.nan, ValueError, "no estimation row has a value"),
        (lambda y: 0 * y, th.EstimationError, "output 'y' is constant"),
        (lambda y: 1e300 * y, ValueError, "squares of 'y' leave the range of numbers"),
        (lambda y: 1e-300 * y, ValueError, "squares of 'y' leave the range of numbers"),
        (lambda y: y[:3], th.EstimationError, "too few rows for the lags"),
    ],
)
def test_bad_logs_are_told(map: Any, change: Callable[[Any], Any], error: type[Exception], message: str) -> None:
    good = log(50)
    y = change(np.asarray(good["y"]))
    with pytest.raises(error, match=message):
        th.narx(th.Log(y, np.asarray(good["u"])[: len(y)], sample_time=1.0), map)


def test_splines_are_a_map_too() -> None:
    rng = np.random.default_rng(4)
    u, y = rng.uniform(-1, 1, 800), np.zeros(800)
    for k in range(1, 800):
        y[k] = 0.4 * y[k - 1] + np.tanh(3 * u[k - 1]) + 0.02 * rng.standard_normal()
    model = th.narx(th.Log(y, u, sample_time=1.0), "spline", ny=1, nu=1, units=7)
    assert any(name.startswith("bend(u(k-1)") for name in model.parameter_names)
    assert document(model)["model"]["maps"][0]["functions"]["type"] == "spline"
    assert np.nanstd(y - model.simulate(th.Log(y, u, sample_time=1.0))) < 0.05
    online = th.RecursiveNarx.from_model(model)
    assert len(online.parameters) == len(model.parameters)
    with pytest.raises(ValueError, match="units"):
        th.narx(log(), units=3)
    with pytest.raises(ValueError, match="units"):
        th.narx(log(), "spline", units=0)


@pytest.mark.parametrize(
    ("map", "options", "kind"),
    [
        ("local", {"membership": "trapezoid", "units": 3}, "local"),
        ("local", {}, "local"),
        ("knn", {"linear": False}, "neighbours"),
        ("knn", {"units": 8}, "neighbours"),
    ],
)
def test_local_models_and_neighbours_are_maps_too(map: Any, options: dict[str, object], kind: str) -> None:
    data = log(600)
    model = th.narx(data, map, ny=1, nu=1, **options)  # type: ignore[arg-type]
    assert document(model)["model"]["maps"][0]["functions"]["type"] == kind
    assert np.nanstd(data["y"] - model.simulate(data)) < 0.5 * np.std(data["y"])
    if kind == "local":
        online = th.RecursiveNarx.from_model(model)
        assert len(online.parameters) == len(model.parameters)
    else:
        with pytest.raises(ValueError, match="no parameters to track"):
            th.RecursiveNarx.from_model(model)
    with pytest.raises(ValueError, match="membership"):
        th.narx(data, membership="gaussian")
    with pytest.raises(ValueError, match="terms"):
        th.narx(data, map, terms=3)


def test_products_are_taken_by_name() -> None:
    data = log(400)
    model = th.narx(data, terms=["u(k-1)^2", "y(k-1)", "u(k-1)"])
    assert list(model.parameter_names) == ["u(k-1)^2", "y(k-1)", "u(k-1)"]
    with pytest.raises(ValueError, match="term.*none of the regressors"):
        th.narx(data, terms=["y(k-9)"])
    with pytest.raises(ValueError, match="terms: there is none"):
        th.narx(data, terms=[])
    with pytest.raises(TypeError, match="terms"):
        th.narx(data, terms=[3])  # type: ignore[list-item]


def test_several_outputs_are_a_map_each() -> None:
    rng = np.random.default_rng(3)
    u = rng.uniform(-1, 1, 800)
    y = np.zeros((800, 2))
    for k in range(1, 800):
        noise = 0.02 * rng.standard_normal(2)
        y[k, 0] = 0.5 * y[k - 1, 0] + 0.3 * y[k - 1, 1] + u[k - 1] + noise[0]
        y[k, 1] = 0.4 * y[k - 1, 1] + u[k - 1] ** 2 + noise[1]
    data = th.Log(y, u, sample_time=1)
    model = th.narx(data, ny=[1, 1], nu=1, detrend="none", raw_terms=True, estimate=slice(0, 600))
    assert model.outputs == ["y1", "y2"]
    found = dict(zip(model.parameter_names, model.parameters))
    assert found["y1: y2(k-1)"] == pytest.approx(0.3, abs=0.02)
    assert found["y2: u(k-1)^2"] == pytest.approx(1.0, abs=0.02)
    run = model.simulate(data)
    assert run.shape == (800, 2)
    assert np.nanstd(y - run, axis=0) == pytest.approx([0.025, 0.022], rel=0.4)
    lower, upper = np.moveaxis(model.predict_interval(data, 3), -1, 0)
    inside = (y > lower) & (y < upper)
    assert inside[3:].mean() == pytest.approx(0.95, abs=0.03)
    checked = model.validate(data, rows=slice(600, 800), require=["fit>=90"])
    assert not checked.unmet
    assert th.Model.from_json(model.to_json()).to_json() == model.to_json()
    with pytest.raises(ValueError, match="one output"):
        th.RecursiveNarx.from_model(model)


def test_expressions_are_regressors() -> None:
    u = np.random.default_rng(5).uniform(2, 6, 500)
    y = np.full(500, 3.0)
    for k in range(1, 500):
        y[k] = y[k - 1] - 0.2 * np.sqrt(y[k - 1]) + 0.1 * u[k - 1]
    data = th.Log(y, u, sample_time=1)
    terms = ["y(k-1)", "u(k-1)", "sqrt(y)(k-1)"]
    model = th.narx(data, ny=1, nu=1, regressors=["sqrt(y)"], terms=terms, detrend="none", raw_terms=True)
    assert model.parameters == pytest.approx([1.0, 0.1, -0.2], abs=1e-9)
    assert np.nanmax(np.abs(model.simulate(data) - y)) < 1e-8
    with pytest.raises(ValueError, match="unknown name 'v'"):
        th.narx(data, regressors=["sqrt(v)"])
    with pytest.raises(TypeError, match="regressors"):
        th.narx(data, regressors="sqrt(u)")


def test_runs_are_kept_within_the_range_on_request() -> None:
    rng = np.random.default_rng(1)
    u = 0.05 * rng.uniform(-1, 1, 300)
    y = np.zeros(300)
    for k in range(1, 300):
        y[k] = 0.5 * y[k - 1] + y[k - 1] ** 2 + u[k - 1]
    data = th.Log(y, u, sample_time=1)
    model = th.narx(data, ny=1, nu=1, terms=["y(k-1)", "y(k-1)^2", "u(k-1)"], detrend="none", raw_terms=True)
    far = 20 * u
    assert np.isnan(model.simulate(far)).any()
    with pytest.warns(th.EstimationWarning, match="were kept within"):
        kept = model.simulate(far, clamp=True)
    assert np.isfinite(kept).all() and np.ptp(kept) <= 1.1 * np.ptp(y) * (1 + 1e-9)
    with pytest.warns(th.EstimationWarning, match="were kept within"):
        model.simulate(th.Log(np.zeros(300), far, sample_time=1), clamp=True)
    with pytest.raises(ValueError, match="nonlinear ARX"):
        th.arx(data, na=1, nb=1).simulate(u, clamp=True)


def saturating(rows: int = 700) -> th.Log:
    """A plant whose drive saturates."""
    random = np.random.default_rng(5)
    u = np.repeat(random.normal(size=rows // 7 + 1), 7)[:rows]
    y = np.zeros(rows)
    for k in range(1, rows):
        y[k] = 0.8 * y[k - 1] + 0.4 * np.tanh(1.5 * u[k - 1] - 0.5 * y[k - 1]) + 0.01 * random.normal()
    return th.Log(y, u, sample_time=0.1)


def free_run(model: th.Model, data: th.Log) -> float:
    """The fit of the free run, in percent."""
    fits = model.validate(data).document["fit"]
    percent = next(fit["percent"] for fit in fits if fit["horizon"]["kind"] == "free-run")
    assert isinstance(percent, float)
    return percent


@pytest.mark.parametrize("map", ["tanh", "logistic", "relu", "rbf-free"])
def test_trained_maps_run_better_than_a_line(map: Any) -> None:
    data = saturating()
    line = free_run(th.narx(data[:500], degree=1, terms=4), data[500:])
    model = th.narx(data[:500], map, units=3, ridge=0.01, starts=2)
    assert free_run(model, data[500:]) > line + 3
    again = pickle.loads(pickle.dumps(model))
    assert np.array_equal(again.simulate(data), model.simulate(data), equal_nan=True)


def test_free_runs_have_intervals_where_rows_were_held_out() -> None:
    log = saturating()
    held_out = th.narx(log, "tanh", ny=1, nu=1, units=2, ridge=0.1, estimate="1..400", validate="401..600")
    low, high = held_out.predict_interval(log, None).T
    run = held_out.predict(log, None)
    assert np.all(low[5:] < run[5:]) and np.all(run[5:] < high[5:])
    for other in (th.narx(log, "tanh", ny=1, nu=1, units=2, ridge=0.1), th.arx(log, 1, 1)):
        assert np.isnan(other.predict_interval(log, None)).all()


def test_a_filter_bridges_missing_outputs_and_noise() -> None:
    log = saturating()
    model = th.narx(log, "tanh", ny=1, nu=1, units=2, ridge=0.1)
    y = log.y.copy()
    y[50:60] = np.nan
    gap = th.StateFilter(model).run(y, u=log.u)
    assert gap.state_names == ["y(k)"]
    assert np.all(gap.output_deviations[51:60] > gap.output_deviations[50])
    filter = th.StateFilter(model, initial="zero", measurement_noise=0.5)
    noisy = filter.run(y, u=log.u, smooth=True)
    assert np.all(np.isfinite(noisy.filtered)) and noisy.smoothed is not None
    again = pickle.loads(pickle.dumps(filter))
    assert again.update(1.0, 0.5).outputs == filter.update(1.0, 0.5).outputs
    for wrong in (-1.0, [0.1, 0.2], float("nan")):
        with pytest.raises(ValueError, match="measurement_noise"):
            th.StateFilter(model, measurement_noise=wrong)


def test_auto_says_what_came_second() -> None:
    model = th.narx(saturating(), "auto", ny=1, nu=1, split=(50, 30, 20))
    path = document(model)["estimation"]["maps"][0]["path"]
    assert len(path) == 7 and all("held_out" in step for step in path)
    assert "tanh" in model.name


def test_training_options_are_checked() -> None:
    data = saturating(200)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"map": "tanh", "terms": 3}, "units"),
        ({"map": "poly", "starts": 3}, "starts"),
        ({"map": "tanh", "focus": 0}, "focus"),
        ({"map": "poly", "drawn": True}, "drawn"),
        ({"map": "tanh", "search": "fast"}, "search"),
        ({"map": "tanh", "time_limit": -1.0}, "time_limit"),
    ]
    for options, words in cases:
        with pytest.raises(ValueError, match=words):
            th.narx(data, **options)

"""What is drawn: the numbers of the models, and ink on the paper."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Iterator
from statistics import NormalDist
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Circle, Ellipse

import thetahat as th
from thetahat import plot

HALF = NormalDist().inv_cdf(0.975)


@pytest.fixture(autouse=True)
def close() -> Iterator[None]:
    before = dict(matplotlib.rcParams)
    yield
    plt.close("all")
    assert dict(matplotlib.rcParams) == before


@pytest.fixture(scope="module")
def log() -> th.Log:
    return th.dc_motor()


@pytest.fixture(scope="module")
def model(log: th.Log) -> th.Model:
    return th.armax(log[:700], na=2, nb=2, nc=1)


@pytest.fixture(scope="module")
def uncertain(log: th.Log) -> th.Model:
    """A model of few samples, with complex roots."""
    return quietly(th.arx, log[:200], na=4, nb=4)


@pytest.fixture(scope="module")
def plain(log: th.Log) -> th.Model:
    """A model without a covariance."""
    made = th.arx(log[:700], na=2, nb=2, norm="inf")
    assert made.covariance is None
    return made


@pytest.fixture(scope="module")
def two_inputs() -> th.Log:
    rng = np.random.default_rng(3)
    u = rng.normal(size=(400, 2))
    y = np.zeros(400)
    for t in range(2, 400):
        y[t] = 0.7 * y[t - 1] + 0.5 * u[t - 1, 0] + 0.3 * u[t - 2, 1] + 0.1 * rng.normal()
    return th.Log(y, {"heater": u[:, 0], "fan": u[:, 1]}, sample_time=0.5, output_name="room")


def quietly(fit: Any, *arguments: Any, **options: Any) -> th.Model:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", th.EstimationWarning)
        made = fit(*arguments, **options)
    assert isinstance(made, th.Model)
    return made


def lines(ax: Axes) -> dict[str, Any]:
    """The lines of axes that have a label."""
    return {str(line.get_label()).strip(): line for line in ax.get_lines() if not str(line.get_label()).startswith("_")}


def bands(ax: Axes) -> list[PolyCollection]:
    return [collection for collection in ax.collections if isinstance(collection, PolyCollection)]


def edges(band: PolyCollection) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, and the lower and the upper end of a band there."""
    points = np.vstack([path.vertices for path in band.get_paths()])
    x = np.unique(points[:, 0])
    return (
        x,
        np.array([points[points[:, 0] == at, 1].min() for at in x]),
        np.array([points[points[:, 0] == at, 1].max() for at in x]),
    )


def legend(ax: Axes) -> list[str]:
    found = ax.get_legend()
    assert found is not None
    return [text.get_text() for text in found.get_texts()]


def is_inked(ax: Axes) -> bool:
    """Whether the inside of axes, as it is rendered, has more than its background and frame."""
    figure: Any = ax.figure
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    box = ax.get_window_extent()
    top, bottom = image.shape[0] - int(box.y1), image.shape[0] - int(box.y0)
    inside = image[top + 4 : bottom - 4, int(box.x0) + 4 : int(box.x1) - 4]
    assert inside.size > 10_000
    # A single dot has about thirty pixels.
    return int((inside != 255).any(axis=2).sum()) > 10


def test_empty_axes_have_no_ink() -> None:
    assert not is_inked(plt.subplots()[1])


def test_fit_draws_what_was_measured_and_what_is_predicted(log: th.Log, model: th.Model) -> None:
    test = log[700:]
    ax = plot.fit(model, test, horizon=5)
    measured, predicted = ax.get_lines()
    np.testing.assert_array_equal(measured.get_xdata(), test.time)
    np.testing.assert_array_equal(measured.get_ydata(), test.y)
    np.testing.assert_array_equal(predicted.get_ydata(), model.predict(test, 5))
    percent = model.validate(test, horizon=5).fit(5)
    assert legend(ax) == ["measured", f"ARMAX(2, 2, 1, 1), 5 steps ahead: {percent:.2f} %", "95 % band"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "y")
    (band,) = bands(ax)
    x, low, high = edges(band)
    there = np.isfinite(model.predict(test, 5))
    np.testing.assert_array_equal(x, test.time[there])
    lower, upper = model.predict_interval(test, 5).T
    np.testing.assert_allclose(low, lower[there], rtol=1e-12)
    np.testing.assert_allclose(high, upper[there], rtol=1e-12)
    assert is_inked(ax)


def test_fit_of_a_free_run_has_no_band(log: th.Log, model: th.Model) -> None:
    ax = plot.fit(model, log[700:])
    assert bands(ax) == []
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), model.predict(log[700:], None))
    assert f"free run: {model.validate(log[700:]).fit(None):.2f} %" in legend(ax)[1]


def test_fit_is_scaled_to_what_was_measured() -> None:
    random = np.random.default_rng(3)
    u = random.standard_normal(1500)
    grown = np.zeros(60)
    for k in range(1, 60):
        grown[k] = 1.2 * grown[k - 1] + u[k - 1] + 0.01 * random.standard_normal()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        growing = th.arx(th.Log(grown, u[:60]), na=1, nb=1, detrend="none")
        ax = plot.fit(growing, th.Log(random.standard_normal(1500), u))
    low, high = ax.get_ylim()
    assert -20 < low < 0 < high < 20
    label = legend(ax)[1]
    assert "e+" in label and all(len(word) <= 12 for word in label.split())


def test_fit_of_several_models_and_a_level(log: th.Log, model: th.Model, plain: th.Model) -> None:
    figure, given = plt.subplots()
    ax = plot.fit({"good": model, "plain": plain}, log[700:], 1, given, level=0.5)
    assert ax is given and ax.figure is figure
    assert len(ax.get_lines()) == 3
    # A model without a covariance knows the noise, so it has a band too.
    assert len(bands(ax)) == 2
    assert legend(ax).count("50 % band") == 1
    _, low, high = edges(bands(ax)[0])
    expected = 2 * NormalDist().inv_cdf(0.75) * np.sqrt(model.noise_variance)
    # The noise, and what is not known of the parameters and of the first state.
    assert np.all(high - low > expected) and np.all((high - low)[20:] < 1.02 * expected)


def test_fit_breaks_at_gaps_and_keeps_lone_samples(log: th.Log, model: th.Model) -> None:
    y = log.y
    y[100:110] = np.nan
    y[111] = np.nan
    gappy = th.Log(y, log.u, sample_time=log.sample_time)
    ax = plot.fit(model, gappy, 1)
    measured, predicted = ax.get_lines()
    drawn = np.asarray(measured.get_ydata(), dtype=float)
    np.testing.assert_array_equal(np.isnan(drawn), np.isnan(y))
    assert np.isnan(np.asarray(predicted.get_ydata(), dtype=float)).sum() > 11
    # Row 110 stands alone: a line has nothing to go to, a dot shows it.
    assert measured.get_marker() == "."
    assert np.flatnonzero(np.asarray(measured.get_markevery())).tolist() == [110]
    assert is_inked(ax)


def test_lines_break_where_the_clock_jumps() -> None:
    log = th.Log([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], time=[0, 1, 2, 3, 6, 7, 8, 9.0])
    (line,) = plot.log(log)[0].get_lines()
    np.testing.assert_array_equal(line.get_xdata(), [0, 1, 2, 3, np.nan, 6, 7, 8, 9])
    np.testing.assert_array_equal(line.get_ydata(), [1, 2, 3, 4, np.nan, 5, 6, 7, 8])


def test_one_sample(model: th.Model, log: th.Log) -> None:
    one = log[500:501]
    axes = plot.log(one)
    assert all(is_inked(ax) for ax in axes)
    ax = plot.fit(model, one)
    assert legend(ax) == ["measured", "ARMAX(2, 2, 1, 1), free run"]
    assert is_inked(ax)
    with pytest.raises(ValueError, match="too few samples"):
        plot.residuals(model, one)


def test_a_time_series_has_no_inputs_to_draw(two_inputs: th.Log) -> None:
    series = th.Log(two_inputs.y, sample_time=0.5)
    model = th.ar(series[:300], na=2)
    assert len(plot.log(series)) == 1
    assert len(plot.residuals(model, series[300:])) == 1
    ax = plot.fit(model, series[300:], 3)
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), model.predict(series[300:], 3))
    assert len(bands(ax)) == 1
    assert legend(plot.poles_zeros(model)) == ["poles"]
    response = model.frequency_response([0.1, 1.0])
    np.testing.assert_array_equal(
        lines(plot.bode(model, [0.1, 1.0])[0, 0])["AR(2)"].get_ydata(), response.magnitude[0]
    )


def test_instrumental_variables_have_their_bands(log: th.Log) -> None:
    model = th.iv(log, na=2, nb=2)
    ax = plot.step(model, samples=30)
    _, low, high = edges(bands(ax)[0])
    np.testing.assert_allclose((high - low) / 2, HALF * model.step_response(samples=30).standard_errors, atol=1e-12)


def test_experiments_that_were_joined_are_not_connected(log: th.Log) -> None:
    joined = th.Log.join([log[500:503], log[:3]])
    assert joined.time[3] < joined.time[2]
    line, boundary = plot.log(joined)[0].get_lines()
    np.testing.assert_array_equal(np.isnan(np.asarray(line.get_ydata(), dtype=float)), [0, 0, 0, 1, 0, 0, 0])
    # One after the other, whatever their clocks say.
    time = np.asarray(line.get_xdata(), dtype=float)
    assert np.all(np.diff(time[np.isfinite(time)]) > 0)
    assert time[2] < np.ravel(boundary.get_xdata())[0] < time[4]


def test_experiments_with_clocks_that_go_on_are_not_connected_either() -> None:
    joined = th.Log.join([th.Log([1.0, 2.0], time=[0.0, 1.0]), th.Log([3.0, 4.0, 5.0, 6.0], time=[2.0, 3.0, 9.0, 10.0])])
    line, _ = plot.log(joined)[0].get_lines()
    np.testing.assert_array_equal(line.get_xdata(), [0, 1, np.nan, 2, 3, np.nan, 9, 10])
    assert len(plot.fit(th.ar(joined, 1, detrend="none"), joined, 1).get_lines()) == 3


def test_residuals_are_titled_by_the_verdict(log: th.Log) -> None:
    model = th.arx(log[:700], na=1, nb=1)
    validation = model.validate(log[700:])
    assert validation.whiteness < validation.alpha == 0.05
    white, _ = plot.residuals(validation)
    assert white.get_title() == f"residuals: not white, p = {validation.whiteness:.2g}"
    good = th.bj(log[:700], nb=2, nc=0, nd=1, nf=2).validate(log[700:])
    assert [ax.get_title().partition(", p =")[0] for ax in plot.residuals(good)] == [
        "residuals: white",
        "residuals and u: independent",
    ]
    strict = th.bj(log[:700], nb=2, nc=0, nd=1, nf=2).validate(log[700:], alpha=0.999)
    assert plot.residuals(strict)[0].get_title().startswith("residuals: not white, p =")


def test_log_draws_every_channel(two_inputs: th.Log) -> None:
    axes = plot.log(two_inputs)
    assert [ax.get_ylabel() for ax in axes] == ["room", "heater", "fan"]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "time [s]"]
    for ax, values in zip(axes, [two_inputs.y, *two_inputs.u.T]):
        (line,) = ax.get_lines()
        np.testing.assert_array_equal(line.get_ydata(), values)
        assert is_inked(ax)
    assert axes[0].get_lines()[0].get_drawstyle() == "default"
    assert axes[1].get_lines()[0].get_drawstyle() == "steps-post"


def test_residuals_are_those_of_the_validation(two_inputs: th.Log) -> None:
    model = th.arx(two_inputs[:300], na=1, nb=[1, 2])
    validation = model.validate(two_inputs[300:])
    axes = plot.residuals(validation)
    [tests] = validation.document["residuals"]
    assert len(axes) == 3
    (line,) = [line for line in axes[0].get_lines() if line.get_marker() == "o"]
    np.testing.assert_array_equal(line.get_xdata(), np.arange(1, len(tests["autocorrelation"])))
    np.testing.assert_array_equal(line.get_ydata(), tests["autocorrelation"][1:])
    _, low, high = edges(bands(axes[0])[0])
    np.testing.assert_allclose(high, tests["band"])
    np.testing.assert_allclose(low, -tests["band"])
    for ax, test in zip(axes[1:], tests["independence"]):
        (line,) = [line for line in ax.get_lines() if line.get_marker() == "o"]
        lags = np.asarray(line.get_xdata())
        assert (lags[0], lags[-1]) == (-(len(lags) // 2), len(lags) // 2)
        np.testing.assert_array_equal(line.get_ydata(), test["correlation"])
        assert max(edges(bands(ax)[0])[2]) == pytest.approx(max(test["band"]), rel=1e-12)
        assert f"residuals and {test['input']}" in ax.get_title()
    assert legend(axes[0]) == ["95 % band"] and all(ax.get_legend() is None for ax in axes[1:])
    assert f"p = {validation.whiteness:.2g}" in axes[0].get_title()
    assert all(is_inked(ax) for ax in axes)
    # The same of a model and a log.
    again = plot.residuals(model, two_inputs[300:])
    assert [ax.get_title() for ax in again] == [ax.get_title() for ax in axes]


def test_residuals_at_positive_lags_show_past_inputs(log: th.Log) -> None:
    late = th.arx(log[:700], na=2, nb=1, nk=3)
    ax = plot.residuals(late, log[700:])[1]
    (line,) = [line for line in ax.get_lines() if line.get_marker() == "o"]
    largest = np.asarray(line.get_xdata())[np.argmax(np.abs(np.asarray(line.get_ydata(), dtype=float)))]
    assert largest in (1, 2)


def test_bode_is_the_frequency_response(log: th.Log, model: th.Model) -> None:
    w = np.geomspace(1, 300, 40)
    axes = plot.bode(model, w)
    response = model.frequency_response(w)
    magnitude, phase = (lines(ax)["ARMAX(2, 2, 1, 1)"] for ax in axes[:, 0])
    np.testing.assert_array_equal(magnitude.get_xdata(), w)
    np.testing.assert_array_equal(magnitude.get_ydata(), response.magnitude[0])
    np.testing.assert_array_equal(phase.get_ydata(), np.degrees(response.phase[0]))
    assert [ax.get_xscale() for ax in axes[:, 0]] == ["log", "log"]
    assert [ax.get_yscale() for ax in axes[:, 0]] == ["log", "linear"]
    assert axes[1, 0].get_xlabel() == "frequency [rad/s]"
    _, low, high = edges(bands(axes[0, 0])[0])
    np.testing.assert_allclose((high - low) / 2, HALF * response.magnitude_errors[0], rtol=1e-9)
    assert (low <= response.magnitude[0]).all() and (high >= response.magnitude[0]).all()
    _, low, high = edges(bands(axes[1, 0])[0])
    np.testing.assert_allclose((high - low) / 2, np.degrees(HALF * response.phase_errors[0]), rtol=1e-9)
    assert legend(axes[0, 0]) == ["ARMAX(2, 2, 1, 1)", "95 % band"]
    assert all(is_inked(ax) for ax in axes.flat)


def test_bode_of_several_models(log: th.Log, model: th.Model, uncertain: th.Model, plain: th.Model) -> None:
    axes = plot.bode({"armax": model, "rough": uncertain, "plain": plain})
    assert set(lines(axes[0, 0])) == {"armax", "rough", "plain"}
    assert len(bands(axes[0, 0])) == 2, "one has no covariance"
    # A band that reaches below zero has an end on a logarithmic axis all the same.
    assert min(edges(bands(axes[0, 0])[1])[1]) > 0
    assert len(set(line.get_color() for line in axes[0, 0].get_lines())) == 3
    above, below = (lines(ax)["rough"].get_color() for ax in axes[:, 0])
    assert above == below


def test_bode_of_sources(log: th.Log, two_inputs: th.Log, model: th.Model) -> None:
    both = th.arx(two_inputs, na=1, nb=[1, 2])
    axes = plot.bode(both)
    assert axes.shape == (2, 2)
    assert [ax.get_title() for ax in axes[0]] == ["from heater", "from fan"]
    axes = plot.bode(both, sources="noise")
    assert axes.shape == (2, 1)
    series = th.ar(two_inputs, na=2)
    assert plot.bode(series)[0, 0].get_title() == "from noise"
    _, given = plt.subplots(2)
    np.testing.assert_array_equal(plot.bode(series, axes=given)[:, 0], given)
    with pytest.raises(ValueError, match="sources: there is no pump; there are: heater, fan, noise"):
        plot.bode(both, sources="pump")
    with pytest.raises(TypeError, match="has its own frequencies"):
        plot.bode(model.frequency_response(), [1.0])


def test_bode_of_a_response(model: th.Model) -> None:
    response = model.frequency_response([1.0, 10.0, 100.0])
    axes = plot.bode(response)
    np.testing.assert_array_equal(lines(axes[0, 0])["response"].get_ydata(), response.magnitude[0])


def test_step_is_the_step_response(model: th.Model, uncertain: th.Model, plain: th.Model) -> None:
    ax = plot.step([model, uncertain, plain], samples=40)
    response = model.step_response(samples=40)
    line = lines(ax)["ARMAX(2, 2, 1, 1)"]
    np.testing.assert_array_equal(line.get_xdata(), response.time)
    np.testing.assert_array_equal(line.get_ydata(), response.values)
    assert len(bands(ax)) == 2, "one has no covariance"
    x, low, high = edges(bands(ax)[0])
    np.testing.assert_allclose((high - low) / 2, HALF * response.standard_errors, rtol=1e-9, atol=1e-12)
    assert legend(ax) == ["ARMAX(2, 2, 1, 1)", "95 % band", "ARX(4, 4, 1)", "ARX(2, 2, 1)"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time since the step [s]", "y per unit of u")
    assert is_inked(ax)


def test_impulse_is_the_impulse_response(model: th.Model, uncertain: th.Model) -> None:
    ax = plot.impulse([model, uncertain], samples=40)
    response = model.impulse_response(samples=40)
    line = lines(ax)["ARMAX(2, 2, 1, 1)"]
    np.testing.assert_array_equal(line.get_ydata(), response.values)
    _, low, high = edges(bands(ax)[0])
    np.testing.assert_allclose((high - low) / 2, HALF * response.standard_errors, rtol=1e-9, atol=1e-12)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time since the impulse [s]", "y per unit of u")
    assert is_inked(ax)


def test_step_of_an_input_by_name(two_inputs: th.Log) -> None:
    model = th.arx(two_inputs, na=1, nb=[1, 2])
    ax = plot.step({"room": model}, "fan")
    np.testing.assert_array_equal(lines(ax)["room"].get_ydata(), model.step_response(1).values)
    assert ax.get_ylabel() == "room per unit of fan"
    with pytest.raises(ValueError, match="room has no input pump; there are: heater, fan"):
        plot.step({"room": model}, "pump")
    with pytest.raises(ValueError, match="there is no input 5"):
        plot.step(model, 5)
    with pytest.raises(ValueError, match=r"AR\(1\) has no inputs to make a step of"):
        plot.step(th.ar(two_inputs, na=1))
    assert is_inked(plot.step(model, 1, samples=1))


def test_poles_and_zeros_with_their_regions(uncertain: th.Model) -> None:
    ax = plot.poles_zeros(uncertain)
    drawn = lines(ax)
    assert list(drawn) == ["poles", "zeros from u"]
    for name, places in (("poles", uncertain.poles()), ("zeros from u", uncertain.zeros())):
        np.testing.assert_array_equal(drawn[name].get_xdata(), places.real)
        np.testing.assert_array_equal(drawn[name].get_ydata(), places.imag)
    (circle,) = [patch for patch in ax.patches if isinstance(patch, Circle)]
    assert (circle.center, circle.radius) == ((0, 0), 1)
    assert ax.get_aspect() == 1.0

    own = uncertain.document["model"]
    roots = [*own["poles"], *own["zeros"][0]]
    complex_roots = [root for root in roots if root["covariance"] is not None and root["im"] != 0]
    ellipses = [patch for patch in ax.patches if isinstance(patch, Ellipse) and not isinstance(patch, Circle)]
    assert len(ellipses) == len(complex_roots) > 0
    chi_square = 5.991464547107979
    for root, ellipse in zip(complex_roots, ellipses):
        assert ellipse.center == (root["re"], root["im"])
        # Every point of the boundary is as far out as the quantile: d' S^-1 d = chi-square of two degrees, 95 %.
        boundary = ellipse.get_patch_transform().transform(ellipse.get_path().vertices)
        away = boundary - np.array(ellipse.center)
        distance = np.einsum("ki,ij,kj->k", away, np.linalg.inv(root["covariance"]), away)
        # The boundary is made of curves whose control points, every third aside, lie outside.
        np.testing.assert_allclose(distance[::3][:8], chi_square, rtol=0.15)
        np.testing.assert_allclose(distance.min(), chi_square, rtol=1e-3)
        area = np.pi * ellipse.width * ellipse.height / 4
        expected = np.pi * chi_square * np.sqrt(np.linalg.det(root["covariance"]))
        assert area == pytest.approx(expected, rel=1e-9)
    real = next(root for root in own["poles"] if root["im"] == 0)
    spread = HALF * np.sqrt(real["covariance"][0][0])
    intervals = [line for line in ax.get_lines() if len(np.asarray(line.get_xdata())) == 2 and line.get_linewidth() == 1.2]
    assert any(np.allclose(line.get_xdata(), [real["re"] - spread, real["re"] + spread]) for line in intervals)
    assert is_inked(ax)


def test_poles_without_covariance_and_of_an_integrator(plain: th.Model, two_inputs: th.Log) -> None:
    ax = plot.poles_zeros(plain)
    assert not [patch for patch in ax.patches if type(patch) is Ellipse]
    integrator = quietly(th.arx, two_inputs, na=1, nb=[1, 2], bound={"a1": -1.0})
    assert is_inked(plot.poles_zeros(integrator))
    ax = plot.step(integrator, 0)
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), integrator.step_response().values)
    assert is_inked(plot.bode(integrator)[0, 0])


def test_far_roots_are_named_and_do_not_hide_the_others(two_inputs: th.Log) -> None:
    model = th.arx(two_inputs, na=1, nb=[2, 2])
    far = [root for index in (0, 1) for root in model.zeros(index) if abs(root) > 3]
    ax = plot.poles_zeros(model)
    assert far and ax.get_xlim()[1] < 4
    assert any("outside of the picture" in text and f"{far[0].real:.4g}" in text for text in legend(ax))


def test_selection_by_mdl(log: th.Log) -> None:
    model = quietly(th.search, log[:700], na=range(1, 6), nb=range(1, 6), constant="no")
    ax = plot.selection(model)
    found = model.selection
    assert found is not None
    drawn = lines(ax)
    sizes = [one["parameters"] for one in found["of_size"]]
    np.testing.assert_array_equal(drawn["MDL"].get_xdata(), sizes)
    np.testing.assert_array_equal(drawn["MDL"].get_ydata(), [one["score"] for one in found["of_size"]])
    costs = np.asarray(drawn["ln of the mean of e² in the fit"].get_ydata(), dtype=float)
    # What lies between the curves is MDL's penalty, p ln N/N.
    penalty = np.asarray(drawn["MDL"].get_ydata(), dtype=float) - costs
    np.testing.assert_allclose(penalty, np.array(sizes) * np.log(found["samples"]) / found["samples"], rtol=1e-9)
    (star,) = [line for label, line in drawn.items() if label.startswith("chosen: ARX(")]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (len(model.parameters), found["chosen"]["score"])
    assert found["chosen"]["score"] == min(np.asarray(drawn["MDL"].get_ydata(), dtype=float))
    assert is_inked(ax)


def test_selection_by_validation(log: th.Log) -> None:
    model = quietly(th.search, log, na=range(1, 9), nb=range(1, 9), split=(60, 20, 20), select="validation")
    ax = plot.selection(model)
    assert ax.get_yscale() == "log"
    drawn = lines(ax)
    found = model.selection
    assert found is not None
    assert found["least"] != found["chosen"]
    assert drawn["least"].get_xdata()[0] == found["least"]["parameters"]
    scores = np.asarray(drawn["mean of e² on the validation rows"].get_ydata(), dtype=float)
    assert min(scores) == drawn["least"].get_ydata()[0]


def test_a_model_that_was_not_chosen_has_no_selection(model: th.Model) -> None:
    with pytest.raises(ValueError, match="not chosen among others"):
        plot.selection(model)


def test_inspection(two_inputs: th.Log) -> None:
    inspection = th.inspect(two_inputs)
    axes = plot.inspection(inspection)
    assert axes.shape == (2, 2)
    for row, name in zip(range(2), ("heater", "fan")):
        spectrum = inspection.document["excitation"][row]["spectrum"]
        (line,) = axes[row, 0].get_lines()
        np.testing.assert_array_equal(line.get_ydata(), [point["density"] for point in spectrum if point["frequency"]])
        assert axes[row, 0].get_title() == f"spectrum of {name}"
        nk = inspection.delays[name]
        assert axes[row, 1].get_title() == f"from {name} to room: a delay of {nk} sample{'' if nk == 1 else 's'}"
    assert all(is_inked(ax) for ax in axes.flat)
    with pytest.raises(ValueError, match="has no inputs"):
        plot.inspection(th.inspect(th.Log(two_inputs.y)))


@pytest.mark.parametrize("name", ["$x_1$", "a$b", "_hidden", "speed_rpm", "cost $ & $ more", r"back\slash", "ü😀", "100 %"])
def test_names_are_shown_as_they_are(two_inputs: th.Log, name: str) -> None:
    log = th.Log(two_inputs.y, {name: two_inputs.u[:, 0]}, output_name=f"{name} out")
    model = th.arx(log, na=1, nb=2)
    with warnings.catch_warnings():
        # matplotlib says so where its font has no such sign.
        warnings.filterwarnings("ignore", message="Glyph")
        warnings.filterwarnings("error", category=matplotlib.MatplotlibDeprecationWarning)
        warnings.filterwarnings("error", message=".*starts with '_'")
        drawn = [
            plot.log(log)[1],
            plot.fit({name: model}, log),
            plot.residuals(model, log)[1],
            plot.bode({name: model})[0, 0],
            plot.step({name: model}),
            plot.poles_zeros(model),
            plot.inspection(th.inspect(log))[0, 0],
        ]
        for ax in drawn:
            ax.figure.canvas.draw()
    for ax in drawn:
        found = ax.get_legend()
        texts = [ax.yaxis.label, ax.title, *(found.get_texts() if found else ())]
        # What matplotlib makes of a text: what it shows, and whether it is a formula.
        shown = [text._preprocess_math(text.get_text()) for text in texts]
        assert not any(is_formula for _, is_formula in shown)
        assert any(name in text for text, _ in shown), shown


def test_mistakes_are_told(log: th.Log, model: th.Model) -> None:
    with pytest.raises(TypeError, match="log: expected a Log, found ndarray"):
        plot.log(log.y)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="models: expected a Model"):
        plot.fit(log, log)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="models: there is none"):
        plot.fit([], log)
    with pytest.raises(ValueError, match=r"axes: expected shape \(2,\), found \(3,\)"):
        plot.log(log, plt.subplots(3)[1])
    with pytest.raises(ValueError, match=r"axes: expected shape \(2, 2\), found \(4,\)"):
        plot.bode(model, axes=plt.subplots(4)[1], sources=["u", "noise"])
    with pytest.raises(TypeError, match="ax: expected a Axes, found Figure"):
        plot.step(model, ax=plt.figure())
    with pytest.raises(ValueError, match="level: 95 is not between 0 and 1"):
        plot.bode(model, level=95)
    with pytest.raises(TypeError, match="give a Log too"):
        plot.residuals(model)
    with pytest.raises(TypeError, match="leave it out"):
        plot.residuals(model.validate(log), log)


def test_without_matplotlib_the_import_says_what_to_install() -> None:
    program = (
        "import sys\n"
        "sys.modules['matplotlib'] = None\n"
        "import thetahat\n"
        "try:\n"
        "    import thetahat.plot\n"
        "except ImportError as error:\n"
        "    assert 'pip install thetahat[plot]' in str(error), error\n"
        "else:\n"
        "    raise AssertionError\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def walk() -> th.StateModel:
    return th.StateModel([[1.0]], [[1.0]], [[1.0]], [[4.0]], [[100.0]], sample_time=1, states=["level"])


def test_states_of_a_filter_with_their_bands() -> None:
    y = np.random.default_rng(2).standard_normal(50).cumsum()
    y[20:24] = np.nan
    trajectory = th.StateFilter(walk()).run(y)
    above, below = plot.states(trajectory)
    line = above.lines[0]
    np.testing.assert_array_equal(line.get_ydata(), trajectory.filtered[:, 0])
    (band,) = [one for one in above.collections if isinstance(one, PolyCollection)]
    high = np.asarray(band.get_paths()[0].vertices)[:, 1].max()
    assert high == pytest.approx((trajectory.filtered + HALF * trajectory.filtered_deviations).max())
    assert [text.get_text() for text in above.get_legend().get_texts()] == ["given the rows so far", "95 % band"]
    np.testing.assert_array_equal(below.lines[0].get_ydata(), trajectory.nis)
    assert (above.get_ylabel(), below.get_ylabel(), below.get_xlabel()) == ("level", "NIS", "time [s]")
    smoothed = th.StateFilter(walk()).run(y, smooth=True)
    ax = plot.states(smoothed, level=0.5)[0]
    assert smoothed.smoothed is not None
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), smoothed.smoothed[:, 0])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["given all rows", "50 % band"]


def test_states_of_an_observer_have_no_bands_and_lines_break_at_gaps() -> None:
    observer = th.StateFilter(walk(), "luenberger", poles=[0.5])
    trajectory = observer.run([1.0, 2.0, 3.0, 4.0], time=[0.0, 1.0, 5.0, 6.0])
    (ax,) = plot.states(trajectory)
    assert not ax.collections and np.isnan(ax.lines[0].get_xdata()).tolist() == [False, False, True, False, False]
    one = th.StateFilter(walk()).run([1.0])
    assert len(plot.states(one)) == 2
    with pytest.raises(TypeError, match="trajectory: expected a StateTrajectory, found list"):
        plot.states([1.0])  # type: ignore[arg-type]


def test_parameters_of_trackers_with_their_alarms(log: th.Log) -> None:
    tracker = th.Tracker(2, 2, forgetting=[0.98, None], alarm=50)
    trajectory = tracker.run(log)
    axes = plot.parameters(trajectory)
    assert [ax.get_ylabel() for ax in axes] == ["a1", "a2", "b1", "b2"] and axes[-1].get_xlabel() == "time [s]"
    for column, ax in enumerate(axes):
        for place in range(2):
            np.testing.assert_array_equal(ax.lines[place].get_ydata(), trajectory.parameters[:, column, place])
        rows = {alarm.row for alarm in trajectory.alarms}
        assert rows and len(ax.lines) == 2 + len(rows)
    assert "alarm" in [text.get_text() for text in axes[0].get_legend().get_texts()]
    alone = th.Tracker(2, 2).run(log[:5])
    # Nothing is known yet.
    assert all(np.isnan(ax.lines[0].get_ydata()).all() for ax in plot.parameters(alone))
    with pytest.raises(TypeError, match="trajectory: expected a TrackTrajectory, found StateTrajectory"):
        plot.parameters(th.StateFilter(walk()).run([1.0]))  # type: ignore[arg-type]


def test_changes_with_their_thresholds() -> None:
    errors = np.random.default_rng(2).standard_normal(200)
    errors[100:] += 2.0
    trajectory = th.ChangeDetector.with_thresholds(5.0, np.inf).run(errors, np.ones(200))
    axes = plot.changes(trajectory)
    assert [ax.get_ylabel() for ax in axes] == ["mean up", "mean down"] and axes[-1].get_xlabel() == "row"
    for place, ax in enumerate(axes):
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), trajectory.statistics[:, place])
        assert ax.lines[1].get_ydata()[0] == 5.0
    assert axes[0].lines[2].get_xdata().tolist() == [alarm.row for alarm in trajectory.alarms]
    off = th.ChangeDetector.with_thresholds(np.inf, np.inf).run(errors, np.ones(200))
    with pytest.raises(ValueError, match="trajectory: all charts are turned off"):
        plot.changes(off)
    with pytest.raises(TypeError, match="trajectory: expected a ChangeTrajectory"):
        plot.changes(3)  # type: ignore[arg-type]


def test_given_axes_make_no_figure(log: th.Log, model: th.Model) -> None:
    _, axes = plt.subplots(3, 2)
    before = plt.get_fignums()
    plot.log(log, axes[0])
    plot.bode(model, axes=axes[1])
    plot.fit(model, log, ax=axes[2, 0])
    plot.poles_zeros(model, axes[2, 1])
    assert plt.get_fignums() == before

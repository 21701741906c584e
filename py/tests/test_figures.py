"""Figures of logs with dates, of several outputs, and of what is long, large or missing."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pandas as pd
import pytest
from matplotlib import dates as mdates, pyplot as plt
from matplotlib.collections import PolyCollection
from matplotlib.patches import Circle, Polygon, Rectangle

import thetahat as th
from thetahat import plot
from thetahat.plot.roots import _transmission_zeros

dates: Any = mdates


@pytest.fixture(autouse=True)
def close() -> Iterator[None]:
    yield
    plt.close("all")


def dated(rows: int = 300, zone: str | None = "Europe/Berlin", start: str = "2026-03-28") -> th.Log:
    motor = th.dc_motor()[:rows]
    index = pd.date_range(start, periods=rows, freq="5min", tz=zone)
    return th.Log.from_dataframe(pd.DataFrame({"u": motor["u"], "y": motor["y"]}, index), inputs="u", output="y")


@pytest.fixture(scope="module")
def several() -> th.Log:
    """Two outputs and two inputs."""
    rng = np.random.default_rng(5)
    u, x, y = rng.standard_normal((800, 2)), np.zeros(2), np.zeros((800, 2))
    for t in range(800):
        y[t] = x + 0.2 * rng.standard_normal(2)
        x = np.array([[0.8, 0.3], [-0.3, 0.8]]) @ x + np.array([[1, 0.2], [0.1, 0.5]]) @ u[t]
    return th.Log(y, {"heat": u[:, 0], "cold": u[:, 1]}, sample_time=0.5, output_name=["room", "hall"])


@pytest.fixture(scope="module")
def model(several: th.Log) -> th.Model:
    return th.ss(several[:600], 2)


def is_dated(ax: Any) -> bool:
    return isinstance(ax.xaxis.get_major_formatter(), mdates.ConciseDateFormatter)


def numbers(values: Any) -> Any:
    return np.asarray(values, dtype=float)


def legend(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def ticks(ax: Any, axis: str = "x") -> list[str]:
    ax.figure.canvas.draw()
    return [label.get_text() for label in getattr(ax, f"{axis}axis").get_ticklabels() if label.get_text()]


def test_dates_of_the_log_stand_on_the_axis_in_its_time_zone() -> None:
    log = dated()
    axes = plot.log(log)
    assert all(is_dated(ax) for ax in axes)
    assert [ax.get_xlabel() for ax in axes] == ["", "time (Europe/Berlin)"]
    line = axes[0].get_lines()[0]
    assert dates.num2date(line.get_xdata()[0]).isoformat() == "2026-03-27T23:00:00+00:00"
    low, high = (dates.num2date(end) for end in axes[0].get_xlim())
    assert low < dates.num2date(line.get_xdata()[0]) < dates.num2date(line.get_xdata()[-1]) < high
    assert (high - low).total_seconds() < 1.2 * 300 * 300
    # Midnight in Berlin, not in Greenwich.
    assert ticks(axes[1])[0] == "Mar-28"
    plain = plot.log(dated(zone=None))
    assert plain[1].get_xlabel() == "time" and is_dated(plain[1])
    assert not is_dated(plot.log(th.dc_motor())[0])
    alone = plot.log(dated()[7:8])[0].get_xlim()
    assert alone[1] - alone[0] == 1


def test_dates_of_polars_and_of_texts_are_dates() -> None:
    instants = pd.date_range("2026-03-01", periods=50, freq="min").to_pydatetime()
    texts = [f"{instant.isoformat()}+02:00" for instant in instants]
    for times, label in ((instants, "time"), (texts, "time (UTC+02:00)"), (1_770_000_000 + 60 * np.arange(50), "time (UTC)")):
        (ax,) = plot.log(th.Log(np.arange(50.0), time=times))
        assert is_dated(ax) and ax.get_xlabel() == label
    polars = pytest.importorskip("polars")
    column = polars.Series("time", list(instants)).dt.replace_time_zone("America/New_York")
    (ax,) = plot.log(th.Log.from_dataframe(polars.DataFrame({"time": column, "y": np.arange(50.0)}), output="y"))
    assert is_dated(ax) and ax.get_xlabel() == "time (America/New_York)"
    # Durations are seconds.
    assert not is_dated(plot.log(th.Log(np.arange(50.0), time=pd.timedelta_range(0, periods=50, freq="s")))[0])


def test_every_axis_of_time_has_the_dates() -> None:
    log = dated()
    model = th.arx(log, na=2, nb=2)
    states = plot.states(th.StateFilter(model).run(log))
    parameters = plot.parameters(th.Tracker(2, 2).run(log))
    for ax in (plot.fit(model, log, 5), *states, *parameters):
        assert is_dated(ax)
        np.testing.assert_allclose(numbers(ax.get_lines()[0].get_xdata()), plot.log(log)[0].get_lines()[0].get_xdata())
    assert states[-1].get_xlabel() == parameters[-1].get_xlabel() == "time (Europe/Berlin)"


def test_experiments_lie_at_their_dates_unless_most_of_the_axis_were_empty() -> None:
    whole = dated()
    near, far = th.Log.join([whole[:100], whole[150:]]), th.Log.join([dated(50), dated(50, start="2026-09-01")])
    line, boundary = plot.log(near)[0].get_lines()
    assert is_dated(line.axes) and np.isnan(numbers(line.get_xdata())[100])
    assert numbers(line.get_xdata())[99] < numbers(boundary.get_xdata())[0] < numbers(line.get_xdata())[101]
    for log in (far, th.Log.join([whole[150:], whole[:100]])):
        ax = plot.log(log)[0]
        x = numbers(ax.get_lines()[0].get_xdata())
        assert not is_dated(ax) and np.nanmax(x) - np.nanmin(x) == (len(log) - 1) * 300


def test_microseconds_are_drawn_as_seconds() -> None:
    index = pd.date_range("2026-03-28", periods=50, freq="1us")
    ax = plot.log(th.Log(pd.Series(np.arange(50.0), index)))[0]
    assert not is_dated(ax) and ax.get_xlabel() == "time [s]"


def test_a_forecast_goes_on_from_the_log_with_its_fan() -> None:
    log = dated()
    model = th.arx(log[:200], na=2, nb=2)
    forecast = model.forecast(log[:200], 20, log.u[200:220])
    ax = plot.forecast(log[:200], forecast)
    past, expected = ax.get_lines()
    assert is_dated(ax) and ax.get_xlabel() == "time (Europe/Berlin)" and ax.get_ylabel() == "y"
    assert len(past.get_xdata()) == 60
    # From the last measured value on.
    assert expected.get_xdata()[0] == past.get_xdata()[-1] and expected.get_ydata()[0] == past.get_ydata()[-1]
    np.testing.assert_array_equal(expected.get_ydata()[1:], forecast.values)
    whole = numbers(plot.log(log)[0].get_lines()[0].get_xdata())
    np.testing.assert_allclose(numbers(expected.get_xdata())[1:], whole[200:220])
    assert legend(ax) == ["measured", "forecast", "95 %", "80 %", "50 %"]
    fan = [one for one in ax.collections if isinstance(one, PolyCollection)]
    for band, level in zip(fan, (0.95, 0.8, 0.5)):
        low, high = forecast.interval(level).T
        points = np.vstack([path.vertices for path in band.get_paths()])
        assert (points[:, 1].min(), points[:, 1].max()) == pytest.approx(
            (min(low.min(), log.y[199]), max(high.max(), log.y[199]))
        )
    # Where the log goes on, what came.
    ax = plot.forecast(log, forecast, last=10, levels=[0.9])
    assert len(ax.get_lines()[0].get_xdata()) == 30
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), expected.get_ydata())
    assert len(ax.collections) == 1
    with pytest.raises(ValueError, match="log: it begins after the forecast"):
        plot.forecast(dated(start="2027-01-01")[250:], forecast)
    with pytest.raises(TypeError, match="forecast: expected a Forecast, found ndarray"):
        plot.forecast(log, forecast.values)  # type: ignore[arg-type]


def test_a_forecast_of_months_has_months() -> None:
    months = pd.date_range("2018-01-01", periods=96, freq="MS")
    values = 50 + 8 * np.sin(np.arange(96) * np.pi / 6) + np.random.default_rng(1).standard_normal(96)
    log = th.Log(pd.Series(values, months))
    ax = plot.forecast(log, th.ar(log, na=13).forecast(log, 12))
    ahead = [dates.num2date(x).strftime("%Y-%m-%d") for x in ax.get_lines()[1].get_xdata()]
    assert ahead[:3] == ["2025-12-01", "2026-01-01", "2026-02-01"] and len(ahead) == 13
    assert "2024" in ticks(ax)


def test_several_outputs_are_all_drawn_or_the_one_that_is_named(several: th.Log, model: th.Model) -> None:
    test = several[600:]
    assert [ax.get_ylabel() for ax in plot.log(several)] == ["room", "hall", "heat", "cold"]
    assert [ax.get_ylabel() for ax in plot.log(several, output="hall")] == ["hall", "heat", "cold"]
    with pytest.raises(ValueError, match="output: there is no output 'attic'; there are: room, hall"):
        plot.log(several, output="attic")

    both = plot.fit(model, test, 5)
    assert [ax.get_ylabel() for ax in both] == ["room", "hall"] and both[1].get_xlabel() == "time [s]"
    for place, ax in enumerate(both):
        measured, predicted = ax.get_lines()
        np.testing.assert_array_equal(measured.get_ydata(), test.y[:, place])
        np.testing.assert_array_equal(predicted.get_ydata(), model.predict(test, 5)[:, place])
    assert plot.fit(model, test, 5, output=1).get_ylabel() == "hall"
    with pytest.raises(ValueError, match=r"ax: expected shape \(2,\), found \(\)"):
        plot.fit(model, test, ax=plt.subplots()[1])

    validation = model.validate(test)
    axes = plot.residuals(validation)
    assert axes.shape == (2, 3)
    for row, tests in zip(axes, validation.document["residuals"]):
        assert row[0].get_title().startswith(f"residuals of {tests['output']}: ")
        assert row[2].get_title().replace("\n", " ").startswith(f"residuals of {tests['output']} and cold: ")
    assert plot.residuals(validation, output="hall").shape == (3,)

    forecast = model.forecast(several[:600], 10, several.u[600:610])
    assert [ax.get_ylabel() for ax in plot.forecast(several[:600], forecast)] == ["room", "hall"]
    assert plot.forecast(several[:600], forecast, output="hall").get_ylabel() == "hall"


def test_responses_are_a_grid_of_outputs_and_inputs(several: th.Log, model: th.Model) -> None:
    for draw, respond in ((plot.step, model.step_response), (plot.impulse, model.impulse_response)):
        axes = draw(model)
        assert axes.shape == (2, 2)
        assert [[ax.get_ylabel() for ax in row] for row in axes] == [
            ["room per unit of heat", "room per unit of cold"],
            ["hall per unit of heat", "hall per unit of cold"],
        ]
        np.testing.assert_array_equal(axes[1, 0].get_lines()[0].get_ydata(), respond("heat", output="hall").values)
        assert draw(model, "cold").shape == (2, 1) and draw(model, output="room").shape == (1, 2)
        assert draw(model, "cold", output="room").get_ylabel() == "room per unit of cold"
    axes = plot.bode([model, th.arx(several, na=2, nb=2)])
    assert axes.shape == (4, 2)
    assert [ax.get_title() for ax in axes[::2].flat] == [
        f"from {source} to {output}" for output in ("room", "hall") for source in ("heat", "cold")
    ]
    response = model.frequency_response(points=300, output="hall")
    assert response.output == "hall"
    np.testing.assert_array_equal(axes[2, 1].get_lines()[0].get_ydata(), response.magnitude[1])
    assert plot.bode(model, output="hall").shape == plot.bode(response).shape == (2, 2)
    with pytest.raises(ValueError, match="output: there is no output 'attic'"):
        plot.bode(model, output="attic")
    with pytest.raises(ValueError, match="it has no inputs, and with several outputs no response to the noise"):
        plot.bode(th.ss(th.Log(several.y), 2))


def test_decibels_and_hertz() -> None:
    model = th.arx(th.dc_motor(), na=2, nb=2)
    w = np.geomspace(1, 300, 40)
    response = model.frequency_response(w)
    axes = plot.bode(model, w, decibels=True, hertz=True)[:, 0]
    line = axes[0].get_lines()[0]
    np.testing.assert_allclose(line.get_xdata(), w / (2 * np.pi))
    np.testing.assert_allclose(line.get_ydata(), 20 * np.log10(response.magnitude[0]))
    assert (axes[0].get_ylabel(), axes[0].get_yscale()) == ("magnitude [dB]", "linear")
    assert axes[1].get_xlabel() == "frequency [Hz]"
    assert {tick % 45 for tick in axes[1].get_yticks()} == {0}


def test_phases_share_a_branch_with_one_another_and_with_their_bands() -> None:
    w = np.geomspace(0.1, 3, 50)
    phase = np.linspace(0, -4, 50)
    errors = np.full(50, 0.1)
    errors[-5:] = 10.0

    def response(turns: int) -> Any:
        from thetahat.models.responses import FrequencyResponse

        ones = np.ones(50)
        columns = [w, np.cos(phase), np.sin(phase), ones, 0.1 * ones, phase + 2 * np.pi * turns, errors]
        return FrequencyResponse([("u", columns)])

    below = plot.bode({"one": response(0), "other": response(-2)})[1, 0]
    for line in below.get_lines():
        np.testing.assert_allclose(line.get_ydata(), np.degrees(phase))
    for band in below.collections:
        points = np.vstack([path.vertices for path in band.get_paths()])
        # Not known to half a turn: the whole of it, and no more.
        assert points[:, 1].max() - np.degrees(phase[0]) < 181 and points[:, 1].min() > np.degrees(phase[-1]) - 181
    assert {tick % 90 for tick in below.get_yticks()} == {0}


def test_poles_and_zeros_of_every_linear_kind(several: th.Log, model: th.Model) -> None:
    log = th.dc_motor()
    continuous = th.ss(log, 2).converted("continuous")
    for one in (th.process(log, "p2"), th.tf(log, 2), continuous):
        ax = plot.poles_zeros(one)
        poles = ax.get_lines()[2]
        np.testing.assert_allclose(numbers(poles.get_xdata()), one.poles().real)
        assert ax.get_xlabel() == "real part [1/s]" and not [patch for patch in ax.patches if isinstance(patch, Circle)]
        # Left of the imaginary axis is shaded.
        assert [patch for patch in ax.patches if isinstance(patch, (Polygon, Rectangle))]
        low, high = ax.get_xlim()
        assert low < one.poles().real.min() < 0 < high
    far = f"{continuous.zeros()[0].real:.4g}"
    assert any(far in text for text in legend(plot.poles_zeros(continuous)))
    ax = plot.poles_zeros(th.ss(log, 2))
    assert legend(ax) == ["poles", "zeros from u"]
    assert [patch for patch in ax.patches if isinstance(patch, Circle)]
    ax = plot.poles_zeros(model, output="hall")
    assert [text.partition(",")[0] for text in legend(ax)] == ["poles", "zeros from heat", "zeros from cold"]
    np.testing.assert_allclose(numbers(ax.get_lines()[3].get_xdata()), model.zeros("heat", output="hall").real)
    plot.poles_zeros(model)
    plot.poles_zeros(th.arx(several, na=2, nb=2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        narx = th.narx(log)
    with pytest.raises(ValueError, match="poles and zeros are of linear models, and this one is NARX .*plot.fit draws"):
        plot.poles_zeros(narx)


def test_transmission_zeros_are_where_rank_is_lost() -> None:
    rng = np.random.default_rng(1)
    F, G, H, D = (rng.normal(size=shape) for shape in ((4, 4), (4, 2), (2, 4), (2, 2)))
    zeros = _transmission_zeros(F, G, H, D)
    known = np.linalg.eigvals(F - G @ np.linalg.solve(D, H))
    np.testing.assert_allclose(np.sort_complex(zeros), np.sort_complex(known), rtol=1e-9)
    # Units change nothing.
    scaled = _transmission_zeros(F, 1e-6 * G, 1e4 * H, 1e-2 * D)
    np.testing.assert_allclose(np.sort_complex(scaled), np.sort_complex(known), rtol=1e-9)
    for z in _transmission_zeros(F, G, H, 0 * D):
        system = np.block([[F - z * np.eye(4), G], [H, 0 * D]])
        assert np.linalg.svd(system, compute_uv=False)[-1] < 1e-9
    # More outputs than inputs have a zero where all of them do.
    F, G, H = np.array([[0.2, 1], [0, 0.3]]), np.array([[0], [1.0]]), np.array([[-0.3, 1.0]])
    twice = np.vstack([H, 2 * H])
    np.testing.assert_allclose(_transmission_zeros(F, G, twice, np.zeros((2, 1))), [0.5])
    np.testing.assert_allclose(_transmission_zeros(F.T, twice.T, G.T, np.zeros((1, 2))), [0.5])
    assert len(_transmission_zeros(F, G, np.array([[-0.3, 1.0], [0.3, 1.0]]), np.zeros((2, 1)))) == 0
    # A delay of four samples has its zeros at infinity.
    F, G, H = np.diag(np.ones(4), 1), np.eye(5)[:, -1:], np.eye(5)[:1]
    assert len(_transmission_zeros(F, G, H, np.zeros((1, 1)))) == 0


def test_large_logs_are_drawn_by_their_outline() -> None:
    rows = 1_000_000
    y = np.random.default_rng(0).standard_normal(rows)
    y[300_000:400_000] = np.nan
    y[777_777] = 50.0
    clock = np.arange(rows, dtype=float)
    clock[600_000:] += 200_000
    log = th.Log(y, time=clock)
    start = time.perf_counter()
    ax = plot.log(log)[0]
    ax.figure.canvas.draw()
    # A few tenths of a second on an idle machine.
    assert time.perf_counter() - start < 10
    (line,) = ax.get_lines()
    x, drawn = numbers(line.get_xdata()), numbers(line.get_ydata())
    assert len(x) < 10_000
    assert (np.nanmin(drawn), np.nanmax(drawn)) == (np.nanmin(y), 50.0)
    # Gaps stay: of values, and of the clock.
    assert np.isnan(drawn[(x > 301_000) & (x < 399_000)]).all()
    after, before = np.flatnonzero(x >= 800_000)[0], np.flatnonzero(x < 600_000)[-1]
    assert np.isnan(drawn[before + 1 : after]).any()


def test_bands_of_large_logs_keep_their_ends() -> None:
    from thetahat.plot import drawing

    x = np.arange(50_000.0)
    low, high = -1 - np.sin(x / 9000) ** 2, 1 + np.cos(x / 7000) ** 2
    low[30_000:40_000] = np.nan
    band = drawing.band(plt.subplots()[1], x, low, high, "C0")
    points = np.vstack([path.vertices for path in band.get_paths()])
    assert len(points) < 20_000
    assert (points[:, 1].min(), points[:, 1].max()) == (np.nanmin(low), np.max(np.delete(high, np.s_[30_000:40_000])))
    assert not ((points[:, 0] > 30_100) & (points[:, 0] < 39_900)).any()


def boxes(axes: Any) -> list[Any]:
    """What is written outside of axes, as it is drawn."""
    axes[0].figure.canvas.draw()
    found = []
    for ax in axes:
        found += [ax.yaxis.label.get_window_extent(), ax.title.get_window_extent()]
        found += [ax.yaxis.get_offset_text().get_window_extent()]
        found += [] if ax.get_legend() is None else [ax.get_legend().get_window_extent()]
    return [box for box in found if box.width > 0 and box.height > 0]


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_legends_and_labels_cover_nothing(unit: float) -> None:
    rng = np.random.default_rng(2)
    u, y = rng.standard_normal((300, 3)), np.zeros(300)
    for t in range(1, 300):
        y[t] = 0.8 * y[t - 1] + u[t - 1].sum() + 0.1 * rng.standard_normal()
    names = [f"supply air temperature of zone {place} behind the heat exchanger" for place in range(3)]
    log = th.Log(unit * y, dict(zip(names, u.T)), output_name="mass_flow_of_the_recirculated_refrigerant_in_kilograms")
    model = th.arx(log, na=1, nb=1)
    called = {"the model of the first week, with all supply temperatures and without a filter": model, "other": model}
    for axes in (
        plot.log(log),
        [plot.fit(called, log, 3)],
        plot.step(called).ravel(),
        plot.bode(called).ravel(),
        plot.residuals(model, log),
        plot.inspection(th.inspect(log)).ravel(),
    ):
        written = boxes(axes)
        insides = [ax.get_window_extent() for ax in axes]
        width, height = axes[0].figure.canvas.get_width_height()
        for place, box in enumerate(written):
            # To a pixel.
            assert box.x0 > -1 and box.x1 < width + 1 and box.y1 < height + 1
            for other in [*written[:place], *insides]:
                across = min(box.x1, other.x1) - max(box.x0, other.x0)
                along = min(box.y1, other.y1) - max(box.y0, other.y0)
                assert min(across, along) < 1.5, (box, other)
        assert all(inside.height > 40 and inside.width > 100 for inside in insides)

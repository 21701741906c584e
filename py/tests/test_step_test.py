"""Step tests."""

import numpy as np
import pytest

import thetahat as th


def stepped(noise: float = 0.0, tau: float = 20.0) -> th.Log:
    """A gain of 2, and steps from 1 to 3 and back."""
    random = np.random.default_rng(1)
    t = np.arange(500)
    y = 5 + 4 * (1 - np.exp(-np.maximum(t - 50, 0) / tau)) - 4 * (1 - np.exp(-np.maximum(t - 280, 0) / tau))
    u = np.where((t >= 50) & (t < 280), 3.0, 1.0)
    return th.Log(y + noise * random.standard_normal(500), u, sample_time=0.5)


def test_figures_are_those_of_the_plant() -> None:
    found = th.step_test(stepped(0.04))
    assert (found.input, found.output, found.shapes) == ("u", "y", ["first-order"] * 2)
    for figure, right in [("gain", 2.0), ("time-constant", 10.0), ("rise-time", 10 * np.log(9))]:
        assert abs(found.value(figure) - right) < 5 * found.error(figure) + 0.01 * right
    assert found.value("time-constant") == found.value("time-constant", "weighted-average")
    assert found.values("gain", "regime").shape == (2,)
    assert "weighted t-bar" in found.advice[0]
    assert "weighted t-bar" in found.summary() and "<pre>" in found._repr_html_()


def test_rows_and_an_uneven_clock() -> None:
    log = stepped()
    time = np.cumsum(np.where(np.arange(500) % 3, 0.4, 0.7))
    uneven = th.Log(log.y, log.u, time=time, uniform=False)
    assert len(th.step_test(uneven).steps) == 2
    assert len(th.step_test(log, rows=slice(0, 270)).steps) == 1


def test_what_cannot_be_read_off_is_an_error() -> None:
    with pytest.raises(ValueError, match="there is no step"):
        th.step_test(th.Log(np.arange(100.0), np.ones(100), sample_time=1.0))
    with pytest.raises(th.EstimationError, match="does not reach a final steady state"):
        th.step_test(stepped(tau=300.0))
    with pytest.raises(ValueError, match="one input and one output"):
        th.step_test(th.Log(np.arange(100.0), np.ones((100, 2)), sample_time=1.0))
    with pytest.raises(TypeError, match="expected a Log"):
        th.step_test([1.0, 2.0])  # type: ignore[arg-type]
    found = th.step_test(stepped())
    with pytest.raises(ValueError, match="'damping' was not found"):
        found.value("damping")
    with pytest.raises(ValueError, match="gain has no 'peak'"):
        found.value("gain", "peak")


def test_sines_tell_the_time_constant() -> None:
    u = np.concatenate([np.sin(2 * np.pi * np.arange(8 * period) / period) for period in (400, 200, 140, 120, 80)])
    y, stays = np.zeros(len(u)), np.exp(-1 / 20)
    for t in range(1, len(u)):
        y[t] = stays * y[t - 1] + (1 - stays) * u[t - 1]
    response = th.spectrum(th.Log(y, u, sample_time=1.0), method="sines")
    found = th.step_test(response)
    # The held input is half a row late, which counts about twice.
    assert abs(found.value("time-constant", "phase") - 21) < 0.2
    assert repr(found) == "StepTest(sines of u)"
    with pytest.raises(ValueError, match="rows"):
        th.step_test(response, rows=slice(0, 5))


def test_it_is_drawn() -> None:
    plot = pytest.importorskip("thetahat.plot")
    log = stepped(0.04)
    ax = plot.step_test(th.step_test(log), log)
    assert len(ax.lines) == 3

"""Frequency responses from data."""

from typing import Any

import numpy as np
import pytest

import thetahat as th


def simulated(rows: int = 4000, noise: float = 0.05) -> th.Log:
    """y(t) = 0.8 y(t-1) + 0.5 u(t-1) and noise, a row every half second."""
    random = np.random.default_rng(1)
    u = random.standard_normal(rows)
    y = np.zeros(rows)
    for t in range(1, rows):
        y[t] = 0.8 * y[t - 1] + 0.5 * u[t - 1]
    return th.Log(y + noise * random.standard_normal(rows), u, sample_time=0.5)


def plant(frequencies: np.ndarray) -> np.ndarray:
    back = np.exp(-0.5j * frequencies)
    return 0.5 * back / (1 - 0.8 * back)


@pytest.mark.parametrize("method", ["lpm", "spa", "welch"])
def test_the_response_is_that_of_the_plant(method: Any) -> None:
    # Away from the lowest lines, which many frequencies of a whole decade share.
    found = th.spectrum(simulated(), method=method, frequencies=(0.3, 6))
    assert found.method["name"] == method
    assert found.values.shape == found.magnitude.shape == (1, len(found.frequencies))
    error = np.abs(found.values[0] - plant(found.frequencies))
    # Windows hide a little.
    assert np.median(error) < 0.05
    inside = (found.magnitude_intervals[0, :, 0] <= np.abs(plant(found.frequencies))) & (
        np.abs(plant(found.frequencies)) <= found.magnitude_intervals[0, :, 1]
    )
    assert inside.mean() > 0.8
    assert ((found.coherence >= 0) & (found.coherence <= 1)).all()


def test_bands_of_short_windows_are_not_honest() -> None:
    random = np.random.default_rng(2)
    u = random.standard_normal(4000)
    y = np.zeros(4000)
    for t in range(2, 4000):
        y[t] = 1.9 * y[t - 1] - 0.95 * y[t - 2] + u[t - 1]
    found = th.spectrum(th.Log(y + 0.1 * random.standard_normal(4000), u, sample_time=1.0), method="spa", lags=20)
    assert found.honest is False
    assert any("not honest" in warning and "lags" in warning for warning in found.warnings)


def test_frequencies_are_a_band_or_a_list() -> None:
    log = simulated()
    assert np.allclose(th.spectrum(log, frequencies=[0.5, 1.0]).frequencies, [0.5, 1.0])
    assert np.allclose(th.spectrum(log, frequencies=np.array([0.5, 1.0])).frequencies, [0.5, 1.0])
    band = th.spectrum(log, frequencies=(0.1, 6), points=20).frequencies
    assert (len(band), round(band[0], 9), round(band[-1], 9)) == (20, 0.1, 6)
    with pytest.raises(ValueError, match="frequencies.*half the sampling frequency"):
        th.spectrum(log, frequencies=(1, 100))
    with pytest.raises(TypeError, match="frequencies"):
        th.spectrum(log, frequencies="all")  # type: ignore[arg-type]


def test_what_tells_nothing_is_an_error() -> None:
    with pytest.raises(th.EstimationError, match="the input 'u' is constant"):
        th.spectrum(th.Log(np.arange(100.0), np.ones(100), sample_time=1.0))


def test_sines_by_period() -> None:
    t = np.arange(1000)
    u = np.sin(2 * np.pi * t / 50)
    found = th.spectrum(th.Log(2 * u, u, sample_time=1.0), method="sines")
    assert found.method["period"] == 50
    assert np.allclose(found.values, [[2.0]])


def test_python_control_takes_it() -> None:
    control = pytest.importorskip("control")
    found = th.spectrum(simulated(), frequencies=(0.1, 6), points=20)
    data = found.to_control()
    assert isinstance(data, control.FrequencyResponseData)
    assert np.allclose(data.frdata[0, 0], found.values[0])
    assert data.dt == 0.5
    assert list(data.input_labels) == ["u"]


def test_models_lie_over_it() -> None:
    plot = pytest.importorskip("thetahat.plot")
    log = simulated()
    axes = plot.bode({"measured": th.spectrum(log), "arx": th.arx(log, na=1, nb=1)})
    assert axes.shape == (2, 1)
    assert len(axes[0, 0].lines) == 2

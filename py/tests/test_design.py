"""Test signals, and what experiments with them are worth."""

from __future__ import annotations

import numpy as np
import pytest

import thetahat as th


@pytest.fixture(scope="module")
def model() -> th.Model:
    return th.arx(th.dc_motor(), na=2, nb=2)


def test_a_prbs_has_its_period_and_autocorrelation() -> None:
    signal = th.design("prbs", length=127, sample_time=0.5)
    u = signal.inputs[:, 0]
    assert (signal.inputs.shape, signal.period, u.sum()) == ((127, 1), 127, -1)
    assert {float(u @ np.roll(u, k)) for k in range(1, 127)} == {-1.0}
    assert signal.time[1] == 0.5
    assert signal.order == [31]
    assert repr(signal) == "TestSignal(prbs, 127 samples, 1 channel)"


def test_a_multisine_has_a_low_crest_factor_on_its_lines() -> None:
    signal = th.design("multisine", length=512, band=(0.0, 1.0), range=(20, 60), seed=3)
    u = signal.inputs[:, 0]
    assert u.min() >= 20 and u.max() <= 60
    assert signal.crest_factor[0] <= 1.43
    lines = np.abs(np.fft.rfft(u - u.mean()))
    at = np.round(signal.frequencies * 512 / (2 * np.pi)).astype(int)
    np.testing.assert_allclose(lines[at], lines[at[0]], rtol=1e-9)
    assert np.delete(lines, at).max() < 1e-9 * lines[at[0]]


def test_channels_and_the_spectrum() -> None:
    signal = th.design("rbs:4", length=800, channels=3, rms=2.0)
    assert signal.inputs.shape == (800, 3)
    np.testing.assert_allclose(signal.rms, 2.0, rtol=0.05)
    frequencies, densities = signal.spectrum
    assert densities.shape == (3, len(frequencies))
    # By the trapezoidal rule its integral is about the variance.
    widths = np.diff(frequencies)
    powers = ((densities[:, 1:] + densities[:, :-1]) / 2 * widths).sum(axis=1)
    np.testing.assert_allclose(powers, signal.rms**2, rtol=0.2)
    np.testing.assert_array_equal(signal.inputs, th.design("rbs:4", length=800, channels=3, rms=2.0).inputs)


def test_signals_side_by_side(model: th.Model) -> None:
    found = th.design(["prbs", "prbs:4", "steps"], model=model, want={"dc-gain": "2%", "b1": 0.02})
    errors = found.standard_errors
    assert found.figures == ["dc-gain", "b1"]
    assert errors["prbs"]["b1"] < errors["prbs:4"]["b1"] < errors["steps"]["b1"]
    assert errors["prbs"]["dc-gain"] > errors["prbs:4"]["dc-gain"] > errors["steps"]["dc-gain"]
    assert set(found.needed) == {"prbs", "prbs:4", "steps"}
    assert "samples needed" in found.summary()
    assert found.document["schema"] == "thetahat.design/1"
    assert repr(found) == "ExperimentDesign(ARX(2, 2, 1), prbs, prbs:4, steps)"
    assert list(th.design(model=model, length=200).needed.values()) == [None] * 7


def test_what_makes_no_sense_is_named(model: th.Model) -> None:
    with pytest.raises(ValueError, match="^band: a prbs signal has no band"):
        th.design("prbs", band=(0.1, 1.0))
    with pytest.raises(ValueError, match="^length: 0"):
        th.design(length=0)
    with pytest.raises(ValueError, match="^want: the model has no 'a9'"):
        th.design(model=model, want={"a9": 1.0})
    with pytest.raises(ValueError, match="^want: it needs a model"):
        th.design("prbs", want={"a1": 1.0})  # type: ignore[call-overload]
    with pytest.raises(ValueError, match="^signal: one signal is written at a time"):
        th.design(["prbs", "rbs"])  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="^range: expected a lower and an upper end"):
        th.design("prbs", range=3)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="^model: expected a Model"):
        th.design("prbs", model="model.json")  # type: ignore[call-overload]

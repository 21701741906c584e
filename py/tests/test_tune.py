"""Controllers for processes."""

from __future__ import annotations

import numpy as np
import pytest

import thetahat as th


def heater(structure: str = "p1d") -> th.Model:
    t = np.arange(300.0)
    u = np.where((t > 10) & (t < 160), 1.0, 0.0)
    y = 2 * np.clip(1 - np.exp(-(t - 13) / 20), 0, None) - 2 * np.clip(1 - np.exp(-(t - 162) / 20), 0, None)
    return th.process(th.Log(y + 0.01 * np.random.default_rng(0).standard_normal(300), u, sample_time=1), structure)


def test_settings_and_loops() -> None:
    found = th.tune(heater(), closed_loop_time=4)
    gain, integral, derivative = found.settings()
    assert gain == pytest.approx(20 / (2 * 6), rel=0.02)
    assert integral == pytest.approx(20, rel=0.02) and derivative == 0
    loop = found.closed_loop("lambda", "pi")
    assert loop["setpoint_response"][-1] == pytest.approx(1, abs=0.02)
    assert loop["time"].shape == loop["load_response"].shape
    assert "SIMC" in found.summary() and found.document["schema"] == "thetahat.tuning/1"


def test_what_cannot_be_tuned_is_told() -> None:
    with pytest.raises(ValueError, match="settings are of a process"):
        th.tune(th.arx(th.dc_motor(), 2, 2))
    with pytest.raises(ValueError, match="positive"):
        th.tune(heater(), closed_loop_time=-1)
    with pytest.raises(ValueError, match="none called"):
        th.tune(heater(), input="v")
    with pytest.raises(KeyError, match="there are: simc pi"):
        th.tune(heater()).settings("simc", "pid")
    with pytest.raises(TypeError):
        th.tune("model")  # type: ignore[arg-type]

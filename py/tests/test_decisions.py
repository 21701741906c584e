"""What a fit does by itself because of what it finds, and the findings of an inspection."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import thetahat as th


def _loop() -> th.Log:
    """A controller that sees the output of the same row."""
    random = np.random.default_rng(3)
    y: npt.NDArray[np.float64] = np.zeros(2000)
    u: npt.NDArray[np.float64] = np.zeros(2000)
    for t in range(2000):
        past = 1.5 * y[t - 1] - 0.56 * y[t - 2] + 0.06 * u[t - 2] if t > 1 else 0.0
        y[t] = past + 0.1 * random.standard_normal()
        u[t] = 2.0 * ((1.0 if t // 150 % 2 else 3.0) - y[t])
    return th.Log(y=y, u=u, sample_time=1.0)


def test_a_fit_without_orders_says_what_it_did_and_who_names_orders_has_them() -> None:
    log = _loop()
    model = th.fit(log)
    (decision,) = model.decisions
    assert (decision.kind, decision.channels) == ("feedback", ["u"])
    assert decision.because in " ".join(model.summary().split())
    assert "--" not in decision.instead and "focus" in decision.instead
    assert model.structure != "oe"
    assert th.search(log).to_json() == model.to_json()
    assert th.oe(log, nb=1, nf=2).decisions == []


def test_findings_name_channels_and_rows() -> None:
    y = np.sin(0.1 * np.arange(300.0) ** 2)
    y[[120, 121]] = np.nan
    y[200] = 90.0
    inspection = th.inspect(th.Log(y=y, sample_time=1.0))
    found = {finding.kind: finding for finding in inspection.findings}
    assert found["missing"].rows == [(121, 122)] and found["missing"].channels == ["y"]
    assert found["outliers"].rows == [(201, 201)]
    assert "--" not in str(found["outliers"])
    assert inspection.warnings == [str(finding) for finding in inspection.findings]


def test_a_map_that_is_none_is_refused_where_one_is_asked_for() -> None:
    with pytest.raises(ValueError, match="narx"):
        th.narx(_loop(), "none")  # type: ignore[arg-type]

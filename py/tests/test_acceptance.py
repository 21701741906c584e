"""Reference values of public logs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thetahat as th

from conftest import public_log

CASES = json.loads((Path(__file__).parents[2] / "tests/data/public/reference_cases.json").read_text())


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_the_hair_dryer() -> None:
    log = th.read_csv(public_log("hair_dryer.csv"), sample_time=0.08)
    model = th.arx(log, 2, 2, 3, estimate="1..300")
    assert np.allclose(model.parameters, [-1.2737387, 0.3935461, 0.0666179, 0.0444819], rtol=1e-5)
    assert np.allclose(model.standard_errors, [0.020906, 0.019096, 0.002138, 0.003317], rtol=1e-3)
    assert np.isclose(model.mse, 0.0016853093, rtol=1e-7) and abs(model.fits[0]["percent"] - 95.119) < 5e-4
    rows = slice(0, 500)
    armax = th.armax(log, 2, 2, 2, 3, estimate=rows, initial="drop", tolerance=1e-12)
    expected = [-1.3090716, 0.4263831, 0.0659772, 0.0411418, -0.3686687, 0.0937665]
    assert np.allclose(armax.parameters, expected, rtol=1e-5) and np.isclose(armax.mse, 0.0015127097, rtol=1e-7)
    oe = th.oe(log, 2, 2, 3, estimate=rows, initial="zero", tolerance=1e-12)
    assert np.allclose(oe.parameters, [0.0665648, 0.0480111, -1.2638546, 0.3876707], rtol=1e-5)
    assert np.isclose(oe.mse, 0.0084633813, rtol=1e-7)
    bj = th.bj(log, 2, 2, 2, 2, 3, estimate=rows, initial="zero", tolerance=1e-12)
    expected = [0.0664333, 0.0409323, 0.5919993, -0.0348845, -0.3478476, -0.5181562, -1.3100212, 0.4296684]
    assert np.allclose(bj.parameters, expected, rtol=1e-5) and np.isclose(bj.mse, 0.0014707382, rtol=1e-7)
    part = th.arx(log[:500], 2, 2, 3)
    assert np.isclose(part.criteria["fpe"], 0.00171399, rtol=1e-5)
    assert abs(part.validate(log[500:]).fit(None) - 85.585) < 5e-3
    assert abs(part.validate(log[500:], detrend="mean").fit(None) - 91.221) < 5e-3
    delays = th.search(log, na=2, nb=2, nk=range(1, 11), estimate=rows)
    assert delays.orders["nk"] == [3] and delays.selection is not None
    of_delay = {best["orders"]["nk"][0]: best["mse"] for best in delays.selection["best"]}
    assert np.allclose([of_delay[nk] for nk in range(1, 6)], [0.00879, 0.002801, 0.00167, 0.007196, 0.009917], atol=5e-7)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case['file']}-{case['model']}")
def test_every_reference_case(case: dict[str, Any]) -> None:
    na, nb, nc, nd, nf, nk = case["orders"]
    path = public_log(f"{case['file']}.csv")
    log = th.read_csv(path, inputs=case["inputs"], output=case["output"], sample_time=1.0)
    rows = slice(case["rows"][0] - 1, case["rows"][1])
    options: th.FitOptions = {"estimate": rows, "initial": "zero" if np.any(nf) else "drop"}
    if nc or nd or np.any(nf):
        options["tolerance"] = 1e-14
    model = th.general(log, na, nb, nc, nd, nf, nk, **options)
    if case["file"] == "evaporator" and case["model"] == "oe":
        # The reference stopped at a minimum that is not the lowest.
        assert model.mse < 0.99 * case["mse"]
        return
    assert np.allclose(model.parameters, case["theta"], rtol=1e-5, atol=1e-9)
    assert np.isclose(model.mse, case["mse"], rtol=1e-7)


OTHERS = {
    "heating_system": (2.0, (2, 2, 0, 0), [-1.5993449, 0.6135762, 0.0321431, 0.2334923], 0.086460568),
    "exchanger": (1.0, (2, 2, 0, 0), [-1.1297315, 0.1978665, -0.1320934, -0.3534605], 0.18273098),
    "ball_beam": (0.1, (2, 2, 0, 0), [-1.7156714, 0.7161686, -0.6405759, 0.6680734], 4.4838769e-06),
    "gas_furnace": (9.0, (0, 3, 2, 1), [-0.5315176, -0.3798226, -0.5173056, -1.5286273, 0.6295391, -0.5491927], 0.056876983),
}


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("name", OTHERS)
def test_other_logs(name: str) -> None:
    step, (na, nb, nd, nf), expected, mse = OTHERS[name]
    log = th.read_csv(public_log(f"{name}.csv"), sample_time=step)
    if nf == 0:
        model = th.arx(log, na, nb)
    else:
        # Box and Jenkins' series J, with C = 1.
        model = th.bj(log, nb, 0, nd, nf, 3, initial="zero", tolerance=1e-12)
    assert np.allclose(model.parameters, expected, rtol=1e-5) and np.isclose(model.mse, mse, rtol=1e-7)

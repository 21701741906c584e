"""Plants that are ready: the same as on the command line, and what Python adds."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thetahat as th

DATA = Path(__file__).parents[2] / "tests/data/templates"
INPUTS = {"spring": (["force"], ["position"]), "battery": (["Current [A]"], ["Voltage [V]"]), "tank": (["inflow"], ["level"])}


def log(name: str) -> th.Log:
    inputs, outputs = INPUTS[name]
    return th.read_log(DATA / f"{name}.csv", inputs=inputs, output=outputs)


def test_a_template_by_its_name_is_that_of_its_function() -> None:
    by_name = th.grey(log("spring"), "template:spring", estimate=slice(0, 500))
    by_function = th.grey(log("spring"), th.templates.spring(log("spring"), estimate=slice(0, 500)), estimate=slice(0, 500))
    assert by_name.to_json() == by_function.to_json()
    mass = dict(zip(by_name.parameter_names, by_name.parameters))["mass"]
    assert abs(mass - 2) < 0.02
    frequency, error = by_name.figures["natural_frequency"]
    assert 0 < error < 0.01 and abs(frequency - np.sqrt(40)) < 5 * error


def test_columns_and_what_is_known_are_named() -> None:
    cell = th.templates.battery(log("battery"), current="Current [A]", known={"capacity": 2.5, "r0": 0.02})
    assert cell.inputs == ["Current [A]"] and "r0" not in cell.unknown and "capacity = 2.5" in cell.to_toml()
    assert th.GreyBox(cell.to_toml()).unknown == cell.unknown


def test_there_is_a_function_for_each() -> None:
    assert th.templates.names() == [name for name in th.templates.names() if callable(getattr(th.templates, name))]
    assert sorted(th.templates.__all__) == sorted([*th.templates.names(), "names", "summary"])
    for name in th.templates.names():
        summary = th.templates.summary(name)
        columns = summary.split("columns\n")[1].split("numbers that are known")[0].split("parameters that are found")[0]
        own = [line.split()[0] for line in columns.splitlines()]
        assert list(inspect.signature(getattr(th.templates, name)).parameters)[1:-2] == own


@pytest.mark.parametrize(
    ("call", "kind", "said"),
    [
        (lambda: th.grey(log("tank"), "template:tnak"), ValueError, "there is no template 'tnak'; did you mean 'tank'"),
        (lambda: th.templates.battery(log("tank")), ValueError, r"wants current \[A\], voltage \[V\]; the log has inflow, level"),
        (lambda: th.templates.tank(log("tank"), level="x"), ValueError, "the log has no column 'x'"),
        (lambda: th.templates.tank(log("tank"), known={"depth": 1}), ValueError, "tank has no 'depth'"),
        (lambda: th.templates.tank(log("tank"), known={"area": "wide"}), TypeError, "area: expected a number"),  # type: ignore[dict-item]
        (lambda: th.templates.tank(log("tank"), level=3), TypeError, "level: expected the name of a column"),  # type: ignore[arg-type]
        (lambda: th.templates.summary("x"), ValueError, "there is no template 'x'"),
        (lambda: th.templates.tank(log("tank")[:5]), th.EstimationError, "unless inflow moves"),
    ],
)
def test_what_is_wrong_is_said(call: Any, kind: type[Exception], said: str) -> None:
    with pytest.raises(kind, match=said):
        call()

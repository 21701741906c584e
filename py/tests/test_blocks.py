"""Models in blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thetahat as th


def valve(rows: int = 900) -> th.Log:
    """A valve that opens from 3 on, and a lag after it."""
    rng = np.random.default_rng(0)
    opening = np.repeat(rng.integers(0, 11, rows // 5), 5).astype(float)
    level = np.zeros(rows)
    for k in range(1, rows):
        level[k] = 0.8 * level[k - 1] + 0.2 * max(opening[k - 1] - 3, 0)
    return th.Log(level + 0.01 * rng.standard_normal(rows), opening, sample_time=1)


def test_a_valve_comes_back_and_follows_rows_held_out() -> None:
    data = valve()
    model = th.blocks(data[:600], order=1, nk=1)
    found = dict(zip(model.parameter_names, model.parameters))
    assert found["f1"] == pytest.approx(-0.8, abs=0.002)
    # Below 3 nothing flows; at 10 it is 7.
    assert found["w_1"] == pytest.approx(0, abs=0.02)
    assert max(found.values()) == pytest.approx(7, abs=0.05)
    assert model.kind == "equations"
    assert not model.validate(data, rows=slice(600, 900), require=["fit>=98"]).unmet
    again = th.Model.from_json(model.to_json())
    assert np.allclose(again.simulate(data), model.simulate(data), equal_nan=True)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"structure": "hammerstien"}, "hammerstein"),
        ({"knots": 2}, "3 to 100"),
        ({"degree": 3, "knots": 5}, "knots"),
        ({"order": 0}, "order"),
        ({"na": 2}, "na"),
    ],
)
def test_what_makes_no_sense_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises((ValueError, TypeError), match=said):
        th.blocks(valve(), **options)

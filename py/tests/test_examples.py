"""The worked examples run, and what they say they learnt holds."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import pytest
from matplotlib import pyplot as plt

EXAMPLES = sorted(Path(__file__).parents[1].joinpath("examples").glob("*.py"))


def test_there_are_examples() -> None:
    assert [path.stem for path in EXAMPLES] == ["at_home", "bases", "battery_ekf", "first_model", "order_study", "oscillator", "two_outputs", "two_tanks"]


# What a fit warns of is part of the story.
@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_and_leaves_nothing(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        # The examples assert what was learnt.
        runpy.run_path(str(path))
        assert plt.get_fignums(), "it draws"
    finally:
        plt.close("all")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_a_notebook_of_cells(path: Path) -> None:
    cells = path.read_text(encoding="utf-8").split("# %%")
    assert cells[0] == ""
    for cell in cells[1:]:
        head, _, body = cell.partition("\n")
        lines = body.splitlines()
        if head == " [markdown]":
            assert all(line.startswith("#") or not line for line in lines), head
        else:
            assert head == "" and any(line and not line.startswith("#") for line in lines)
    assert "plt.show" not in path.read_text(encoding="utf-8")

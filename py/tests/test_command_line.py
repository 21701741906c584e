"""Python and the command line are one engine: the same documents to the byte."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import thetahat as th

PROGRAM = Path(sys.executable).with_name("thetahat")


def program(folder: Path, *words: str) -> str:
    found = subprocess.run([str(PROGRAM), *words], cwd=folder, capture_output=True, text=True, check=True)
    return found.stdout


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    program(tmp_path, "demo")
    monkeypatch.chdir(tmp_path)
    return tmp_path


LOG = "thetahat-demo/dc_motor.csv"


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_reports_are_the_same_to_the_byte(folder: Path) -> None:
    log = th.read_csv(LOG, time="t")
    rows = {"estimate": "1..700", "validate": slice(700, 1000)}
    words = ["--estimate=1..700", "--validate=701..1000"]
    cases = {
        "--model=arx --na=2 --nb=2 --nk=1": th.arx(log, 2, 2, **rows),  # type: ignore[arg-type]
        "--model=armax --na=2 --nb=2 --nc=1 --nk=0": th.armax(log, 2, 2, 1, nk=0, **rows),  # type: ignore[arg-type]
        "--model=oe --nb=2 --nf=2 --starts=2 --seed=3 --nk=1": th.oe(log, 2, 2, starts=2, seed=3, **rows),  # type: ignore[arg-type]
        "--model=bj --nb=2 --nc=0 --nd=1 --nf=2 --nk=1": th.bj(log, 2, 0, 1, 2, **rows),  # type: ignore[arg-type]
        "--na=1..4 --nb=1..3 --nk=0..2": th.search(log, na=range(1, 5), nb=range(1, 4), nk=range(3), **rows),  # type: ignore[arg-type]
        "": th.search(log, **rows),  # type: ignore[arg-type]
        "--narx=none": th.fit(log, narx="none", **rows),  # type: ignore[arg-type]
        "--model=arx --na=2 --nb=2 --method=iv --nk=1": th.iv(log, 2, 2, **rows),  # type: ignore[arg-type]
        "--model=arx --na=2 --nb=2 --norm=1 --bound=a1=-1.5..0 --nk=1": th.arx(log, 2, 2, norm=1, bound={"a1": (-1.5, 0)}, **rows),  # type: ignore[arg-type]
        "--model=arx --na=2 --nb=0 --nk=1": th.arx(log, 2, 0, **rows),  # type: ignore[arg-type]
    }
    for options, model in cases.items():
        text = program(folder, "fit", LOG, "--time=t", *words, *options.split(), "--format=json")
        assert model.to_json() == text, options
    series = th.read_csv(LOG, time="t", inputs=[])
    assert th.ar(series, 2).to_json() == program(folder, "fit", LOG, "--time=t", "--model=ar", "--na=2", "--format=json")


def test_tables_and_other_documents_are_the_same(folder: Path) -> None:
    log = th.read_csv(LOG, time="t")
    model = th.arx(log, 2, 2, estimate="1..700")
    Path("model.json").write_text(model.to_json())
    assert model.summary() == program(folder, "fit", LOG, "--time=t", "--na=2", "--nb=2", "--estimate=1..700")
    validation = model.validate(log, rows="701..1000")
    same = program(folder, "validate", "model.json", LOG, "--time=t", "--rows=701..1000", "--format=json")
    # Only the file's name is not known in memory.
    assert json.loads(same) == {**validation.document, "report": "model.json"}
    assert th.inspect(LOG, time="t").to_json() == program(folder, "inspect", LOG, "--time=t", "--format=json")
    predicted = np.genfromtxt(program(folder, "predict", "model.json", LOG, "--time=t").splitlines(), delimiter=",", names=True)
    assert np.array_equal(predicted["predicted"], model.predict(log), equal_nan=True)
    simulated = np.genfromtxt(program(folder, "simulate", "model.json", LOG, "--time=t").splitlines(), delimiter=",", names=True)
    assert np.array_equal(simulated["predicted"], model.simulate(log), equal_nan=True)


def test_several_logs_and_resampling(folder: Path) -> None:
    rows = Path(LOG).read_text().splitlines()
    Path("a.csv").write_text("\n".join(rows[:400] + rows[401:500]) + "\n")
    Path("b.csv").write_text("\n".join([rows[0], *rows[600:]]) + "\n")
    words = ["fit", "a.csv", "b.csv", "--time=t", "--model=arx", "--na=2", "--nb=2", "--nk=1", "--format=json"]
    with pytest.warns(th.EstimationWarning, match="gaps in the clock"):
        model = th.arx(th.read_csv(["a.csv", "b.csv"], time="t"), 2, 2)
    assert model.to_json() == program(folder, *words)
    words = ["fit", "a.csv", "--time=t", "--resample=0.01:linear", "--model=arx", "--na=2", "--nb=2", "--nk=1", "--format=json"]
    assert th.arx(th.read_csv("a.csv", time="t", resample=(0.01, "linear")), 2, 2).to_json() == program(folder, *words)
    joined = th.Log.join([th.read_csv("a.csv", time="t"), th.read_csv("b.csv", time="t")])
    assert joined == th.read_csv(["a.csv", "b.csv"], time="t")


def test_the_program_says_what_is_wrong(folder: Path) -> None:
    found = subprocess.run([str(PROGRAM), "fit", "none.csv", "--na=1", "--nb=1"], capture_output=True, text=True, check=False)
    assert found.returncode == 5 and "none.csv" in found.stderr

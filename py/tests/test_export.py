"""Models as source code."""

from __future__ import annotations

import subprocess
from pathlib import Path
from shutil import which
from typing import Any

import pytest

import thetahat as th


def test_files_are_those_of_the_command_line(tmp_path: Path) -> None:
    model = th.arx(th.dc_motor(), na=2, nb=2, nk=3)
    files = model.export("rust", "simulator", name="motor", folder=tmp_path / "firmware")
    assert list(files) == ["motor.rs"]
    assert (tmp_path / "firmware" / "motor.rs").read_text(encoding="utf-8") == files["motor.rs"]
    assert "pub fn step(&mut self, u: &[f32; 1]) -> ([f32; 1], usize)" in files["motor.rs"]
    assert list(model.export("c", "predictor")) == ["model_predictor.h", "model_predictor.c"]


@pytest.mark.skipif(which("gcc") is None, reason="gcc is missing")
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_what_is_compiled_says_what_the_model_does(tmp_path: Path, precision: Any) -> None:
    log = th.dc_motor()
    files = th.bj(log, nb=2, nc=1, nd=1, nf=2).export("c", "predictor", log, precision=precision, name="motor", folder=tmp_path)
    assert list(files) == ["motor.h", "motor.c", "motor.csv", "motor_test.c"]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    subprocess.run(["gcc", *flags, "motor.c", "motor_test.c", "-o", "motor", "-lm"], cwd=tmp_path, check=True)
    subprocess.run([str(tmp_path / "motor")], check=True)


def test_what_cannot_be_exported_is_refused() -> None:
    model = th.arx(th.dc_motor(), na=2, nb=2, nk=3)
    for words, said in [
        (("c", "observer"), "take predictor, simulator"),
        (("ada", "predictor"), "to: 'ada' is none"),
        (("c", "oracle"), "what: 'oracle' is none"),
    ]:
        with pytest.raises(ValueError, match=said):
            model.export(*words)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="name"):
        model.export("c", "predictor", name="Motor 1")
    with pytest.raises(TypeError, match="what"):
        model.export("c", 1)  # type: ignore[arg-type]

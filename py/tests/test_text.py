"""What comes from files is shown without harm to a terminal, and what goes to files is written whole."""

from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thetahat as th

LONG = "x" * 3_000_000
# It moves the cursor, turns the direction of writing, and hides.
NAME = "u\x1b[2J\x9b\u202e\u2066\u200b\ufeffx"


def is_harmless(text: str) -> bool:
    return all(character.isprintable() or character == "\n" for character in text)


def test_what_is_said_of_a_damaged_document_is_bounded(motor: th.Log) -> None:
    report = json.loads(th.arx(motor, 2, 2).to_json())
    edited = [LONG, f'{{"{LONG}": 1', json.dumps({**report, "schema": LONG})]
    for field in ("structure", "sample_time", "orders", "a"):
        edited.append(json.dumps({**report, "model": {**report["model"], field: LONG}}))
    for text in edited:
        with pytest.raises(ValueError) as caught:
            th.Model.from_json(text)
        assert len(str(caught.value)) <= 1100 and is_harmless(str(caught.value))


def test_names_are_harmless_in_tables_and_messages() -> None:
    random = np.random.default_rng(0)
    u, y = random.standard_normal((2, 200))
    model = th.arx(th.Log(y, {NAME: u}), 1, 1)
    assert is_harmless(model.summary())
    assert model.inputs == [NAME] and th.Model.from_json(model.to_json()).inputs == [NAME]
    with pytest.raises(ValueError) as caught:
        model.predict(th.Log(y, {"other": u}))
    assert is_harmless(str(caught.value))


@pytest.mark.skipif(os.name != "posix", reason="modes are of POSIX")
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, motor: th.Log) -> None:
    model = th.arx(motor, 2, 2)
    path = tmp_path / "model.json"
    (tmp_path / "any").write_text("")
    model.write(path)
    assert path.stat().st_mode == (tmp_path / "any").stat().st_mode
    path.chmod(0o640)
    model.write(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert th.Model.read(path).to_json() == model.to_json()
    assert sorted(os.listdir(tmp_path)) == ["any", "model.json"]


def test_what_a_test_starts_has_the_default_signals() -> None:
    program = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "True"
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


def test_messages_say_what_a_long_value_is_and_not_all_of_it() -> None:
    # Calls that no type checker lets pass.
    wrong: Any = th
    log: Any = th.dc_motor()
    model, values = wrong.arx(log, 2, 2), np.arange(2000.0)
    calls: list[tuple[Any, str]] = [
        (lambda: wrong.arx(log, 2, 2, estimate=(0, 700)), r"slice\(0, 700\) are these rows"),
        (lambda: wrong.arx(log, 2, 2, estimate=values), r"estimate: .*found ndarray of shape \(2000,\)"),
        (lambda: wrong.arx(log, values.tolist(), 2), "na: .*…"),
        (lambda: wrong.arx(log, 2, 2, ridge=values), "ridge: .*of shape"),
        (lambda: wrong.narx(log, values), "map: expected a str, found ndarray"),
        (lambda: model.predict(log, values), "horizon: .*of shape"),
        (lambda: model.validate(log, rows=(0, 700)), r"rows: .*slice\(0, 700\)"),
        (lambda: log[values], "cut by a slice such as .*of shape"),
        (lambda: wrong.Log(log, log), "y: expected numbers, found a Log"),
        (lambda: wrong.Log("motor.csv"), r"found a text; a file is read by thetahat.read_log\('motor.csv'\)"),
        (lambda: wrong.fit_many(log), "logs: expected several, found a Log"),
        (lambda: wrong.fit_many([log], "arx"), "fit: expected a function such as thetahat.arx"),
        (lambda: wrong.Tracker(values.tolist(), 2), "na: .*…"),
        (lambda: wrong.Model.from_json(values), "text: expected a str, found ndarray"),
    ]
    for call, words in calls:
        with pytest.raises(TypeError, match=words) as raised:
            call()
        assert len(str(raised.value)) < 250

"""Many logs, each by itself."""

from __future__ import annotations

import csv
import gzip
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import thetahat as th
from thetahat import _thetahat

MOTOR = th.dc_motor()

BROKEN: dict[str, bytes] = {
    "empty.csv": b"",
    "header.csv": b"u,y\n",
    "row.csv": b"u,y\n1,2\n",
    "constant.csv": b"u,y\n" + b"1,2\n" * 9,
    "word.csv": b"u,y\n1,2\n3,four\n5,6\n",
    "ragged.csv": b"u,y\n1,2\n3\n5,6\n",
    "names.csv": b"a,b\n1,2\n3,4\n",
    "infinite.csv": b"u,y\n1,2\n3,inf\n5,6\n",
    "packed.csv": gzip.compress(b"u,y\n1,2\n")[:12],
}


def folder_of_logs(folder: Path, good: int = 4) -> Path:
    """As many good logs, of different lengths, among the broken ones."""
    logs = folder / "logs"
    logs.mkdir()
    for number in range(good):
        part = MOTOR[: 300 + 50 * number]
        text = "u,y\n" + "".join(f"{u},{y}\n" for u, y in zip(part["u"], part["y"]))
        (logs / f"plant{number}.csv").write_text(text)
    for name, content in BROKEN.items():
        (logs / name).write_bytes(content)
    return logs


def by_command_line(folder: Path, *words: str) -> list[dict[str, str]]:
    """The table of `thetahat fit --each`, its empty cells left out."""
    table = folder / "fleet.csv"
    assert _thetahat.run(["thetahat", "fit", "--each", "logs/*.csv", *words, "--table", str(table)]) == 0
    with open(table, newline="") as file:
        return [{name: cell for name, cell in row.items() if cell} for row in csv.DictReader(file)]


def same(cell: str, value: Any) -> bool:
    if isinstance(value, bool):
        return cell == str(value).lower()
    return float(cell) == value if isinstance(value, (int, float)) else cell == value


def test_the_table_is_that_of_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = folder_of_logs(tmp_path)
    monkeypatch.chdir(tmp_path)
    table = by_command_line(tmp_path, "--na", "1..3", "--nb", "1..3", "--nk", "1", "--reports", "out")
    fits = th.fit_many(f"{logs.name}/*.csv", na=range(1, 4), nb=range(1, 4), nk=1, model="arx", reports="out_of_python")
    assert len(fits) == len(table) == 13
    assert len(fits.failures) == len(BROKEN)
    for line, row in zip(table, fits.rows):
        assert line["log"] == row["log"]
        assert line["exit_code"] == str(row["exit_code"])
        if row["exit_code"]:
            assert ("message" in row) and set(row) == {"log", "exit_code", "message"}
            continue
        assert list(line) == list(row)
        assert all(same(line[name], value) for name, value in row.items() if name != "report"), row["log"]
        own, other = (json.loads(Path(one["report"]).read_text()) for one in (row, line))
        # Only the notebook names the structure.
        assert own.pop("plan") == {**other.pop("plan"), "model": "arx"}
        assert own == other
    assert list(fits.to_pandas().columns) == list(pd.read_csv("fleet.csv").columns)
    assert fits.to_polars().columns == list(fits.to_pandas().columns)


def test_rows_do_not_depend_on_the_threads(tmp_path: Path) -> None:
    logs = sorted(folder_of_logs(tmp_path).iterdir())
    one, three = (th.fit_many(logs, th.arx, na=2, nb=2, threads=threads) for threads in (1, 3))
    assert one.rows == three.rows


def test_logs_and_frames_have_names() -> None:
    fits = th.fit_many({"a": MOTOR[:400], "b": MOTOR[400:], "short": MOTOR[:2]}, th.arx, na=2, nb=2)
    assert repr(fits) == "Fits(3 logs, 2 of them without a failure)"
    assert fits["a"] == fits[0] == th.arx(MOTOR[:400], na=2, nb=2)
    assert [model is None for model in fits] == [False, False, True]
    assert list(fits.failures) == ["short"]
    with pytest.raises(th.EstimationError, match="too few rows"):
        fits["short"]
    with pytest.raises(KeyError):
        fits["c"]
    assert len(fits[1:]) == 2
    frames = [MOTOR[:500].to_pandas(), MOTOR[500:].to_pandas().drop(columns="u")]
    fits = th.fit_many(frames, th.arx, read={"inputs": "u", "output": "y"}, na=2, nb=2)
    assert [row["log"] for row in fits.rows] == ["0", "1"]
    assert fits.rows[0]["exit_code"] == 0 and fits.rows[1]["exit_code"] == 3
    assert "u" in fits.rows[1]["message"]


def test_any_function_of_a_log_will_do() -> None:
    model = th.arx(MOTOR[:500], na=2, nb=2)
    parts = {"in": MOTOR[:500], "out": MOTOR[500:]}
    validated = th.fit_many(parts, model.validate)
    assert validated.rows[1]["fit_1"] == validated["out"].fit(1)
    inspected = th.fit_many(parts, th.inspect)
    assert inspected.rows[0]["rows"] == 500
    assert math.isclose(inspected.rows[0]["mean_y"], float(np.mean(MOTOR[:500].y)), rel_tol=1e-12)


def test_warnings_stand_in_the_rows_and_nowhere_else(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    path = tmp_path / "log.csv"
    path.write_text("u,y\nV,rad/s\n" + "".join(f"{u},{y}\n" for u, y in zip(MOTOR["u"], MOTOR["y"])))
    fits = th.fit_many([path], th.arx, na=1, nb=1)
    assert "line 2 is read as units" in fits.rows[0]["warnings"]
    assert not recwarn.list
    with pytest.warns(UserWarning, match="line 2 is read as units"):
        th.read_csv(path)


def test_urls_are_read_and_written(tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    text = "u,y\n" + "".join(f"{u},{y}\n" for u, y in zip(MOTOR["u"], MOTOR["y"]))
    memory.pipe("/plants/a.csv", text.encode())
    memory.pipe("/plants/b.csv", b"u,y\n1,2\n3,four\n")
    urls = [f"memory://plants/{name}.csv" for name in "abc"]
    fits = th.fit_many(urls, th.arx, na=2, nb=2, reports="memory://out")
    assert [row["exit_code"] for row in fits.rows] == [0, 3, 5]
    assert fits.rows[1]["message"].startswith("memory://plants/b.csv:3:3: ")
    assert "memory://plants/c.csv: cannot be read" in fits.rows[2]["message"]
    report = json.loads(memory.cat(fits.rows[0]["report"].removeprefix("memory:/")))
    assert report["data"]["logs"][0]["file"] == "memory://plants/a.csv"
    assert th.Model.from_json(json.dumps(report)).parameters.tolist() == fits[0].parameters.tolist()


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="there is none"):
        th.fit_many([])
    with pytest.raises(ValueError, match="there is none"):
        th.fit_many("no/such/*.csv")
    with pytest.raises(TypeError, match="orders"):
        th.fit_many([MOTOR], th.arx, na=2, nb=2, orders=3)
    with pytest.raises(ValueError, match="na"):
        th.fit_many([MOTOR], th.arx, na=-1, nb=2)
    with pytest.raises(ValueError, match="threads"):
        th.fit_many([MOTOR], threads=0)
    with pytest.raises(ValueError, match="would both be"):
        th.fit_many(["a.csv", "a.csv.gz"], reports="out")


def counting(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The logs that are read from now on."""
    taken: list[str] = []

    def noted(path: str, **options: Any) -> th.Log:
        taken.append(Path(path).name)
        return th.read_csv(path, **options)

    monkeypatch.setattr("thetahat.fits.many.read_csv", noted)
    return taken


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = sorted(folder_of_logs(tmp_path).iterdir(), key=lambda log: (not log.name.startswith("plant"), log.name))
    out = tmp_path / "out"
    taken = counting(monkeypatch)
    # As if it had been interrupted after six logs, two of them broken.
    th.fit_many(logs[:6], th.arx, na=2, nb=2, reports=out)
    assert len(taken) == 6
    fits = th.fit_many(logs, th.arx, na=2, nb=2, reports=out)
    assert len(taken) == len(logs) and len(set(taken)) == len(logs)
    whole = th.fit_many(logs, th.arx, na=2, nb=2, reports=tmp_path / "other")
    assert [row["log"] for row in fits.rows] == [str(log) for log in logs]
    for row, other in zip(fits.rows, whole.rows):
        assert {**row, "report": ""} == {**other, "report": ""}
    assert list(fits) == list(whole) and fits.failures == whole.failures
    for name in fits.failures:
        with pytest.raises((ValueError, OSError, th.EstimationError)) as reused:
            fits[name]
        with pytest.raises((ValueError, OSError, th.EstimationError)) as new:
            whole[name]
        assert reused.type is new.type and str(reused.value) == str(new.value)
    # What has changed is fitted again, and what has a document that is gone or damaged; nothing else.
    taken.clear()
    good = logs[:4]
    good[0].write_text("\n".join(good[0].read_text().splitlines()[:-1]) + "\n")
    (out / "plant1.json").unlink()
    (out / "plant2.json").write_text("{")
    again = th.fit_many(good, th.arx, na=2, nb=2, reports=out)
    assert sorted(taken) == ["plant0.csv", "plant1.csv", "plant2.csv"]
    assert again[1:].rows == fits[1:4].rows
    # Other arguments are another fit, other threads are not.
    taken.clear()
    th.fit_many(good, th.arx, na=2, nb=1, reports=out)
    th.fit_many(good, th.arx, na=2, nb=1, reports=out, threads=1)
    assert len(taken) == len(good)


def test_what_cannot_be_told_in_words_is_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = sorted(folder_of_logs(tmp_path).glob("plant*.csv"))[:2]
    taken = counting(monkeypatch)
    for _ in range(2):
        th.fit_many(logs, lambda log: th.arx(log, na=1, nb=1), reports=tmp_path / "own")
    assert len(taken) == 4 and not (tmp_path / "own" / "journal.jsonl").exists()
    # Logs in memory have no digest.
    for _ in range(2):
        fits = th.fit_many({"motor": MOTOR}, th.arx, na=2, nb=2, reports=tmp_path / "memory")
    assert (tmp_path / "memory" / "journal.jsonl").read_text() == "" and fits["motor"].name == "ARX(2, 2, 1)"
    # An inspection is a document, too.
    taken.clear()
    one, other = (th.fit_many(logs, th.inspect, reports=tmp_path / "inspected") for _ in range(2))
    assert len(taken) == 2 and one.rows == other.rows
    assert other[0].to_json() == one[0].to_json() and other[0].summary() == one[0].summary()


def test_urls_are_known_by_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    text = "u,y\n" + "".join(f"{u},{y}\n" for u, y in zip(MOTOR["u"], MOTOR["y"]))
    memory.pipe("/journal/log.csv", text.encode())
    taken = counting(monkeypatch)
    url = "memory://journal/log.csv"
    one, other = (th.fit_many([url], th.arx, na=2, nb=2, reports=tmp_path / "out") for _ in range(2))
    assert len(taken) == 1 and one.rows == other.rows and one[url] == other[url]
    memory.pipe("/journal/log.csv", text.replace("2.0", "2.5").encode())
    th.fit_many([url], th.arx, na=2, nb=2, reports=tmp_path / "out")
    assert len(taken) == 2


def test_a_folder_is_written_by_one_run_at_a_time(tmp_path: Path) -> None:
    held = _thetahat.Journal(tmp_path / "out", "another")
    logs = sorted(folder_of_logs(tmp_path).iterdir())[:1]
    with pytest.raises(OSError, match="another run"):
        th.fit_many(logs, th.arx, na=2, nb=2, reports=tmp_path / "out")
    held.close()
    with pytest.raises(ValueError, match="closed"):
        held.row("log", "0")
    th.fit_many(logs, th.arx, na=2, nb=2, reports=tmp_path / "out")


def test_the_journal_is_that_of_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs = folder_of_logs(tmp_path)
    monkeypatch.chdir(tmp_path)
    by_command_line(tmp_path, "--na", "2", "--nb", "2", "--reports", "out")
    lines = (tmp_path / "out" / "journal.jsonl").read_text().splitlines()
    fits = th.fit_many(f"{logs.name}/*.csv", th.arx, na=2, nb=2, reports="out")
    after = (tmp_path / "out" / "journal.jsonl").read_text().splitlines()
    assert after[: len(lines)] == lines
    # Only the digests differ, by the words for what is done.
    rows = {json.loads(line)["row"][0][1]: json.loads(line)["row"] for line in after[len(lines) :]}
    assert rows.keys() <= {row["log"] for row in fits.rows}
    known = {json.loads(line)["row"][0][1]: json.loads(line)["row"] for line in lines}
    for log, row in rows.items():
        assert [name for name, _ in row] == [name for name, _ in known[log]]

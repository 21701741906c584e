"""Logs as loggers, spreadsheets and people write them."""

from __future__ import annotations

import datetime
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thetahat as th


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "log.csv"
    path.write_text(text)
    return path


def test_a_clock_is_found(tmp_path: Path) -> None:
    rows = "".join(f"{20 * k + 1597341112345},{k % 3},{k % 5}\n" for k in range(20))
    log = th.read_csv(written(tmp_path, "timestamp,u,y\n" + rows))
    assert log.sample_time == 0.02
    assert repr(log) == (
        "Log(20 rows, inputs u, output y, sample time 0.02 s by column 'timestamp' from 2020-08-13T17:51:52.345000+00:00)"
    )
    assert th.read_csv(tmp_path / "log.csv", sample_time=1).sample_time == 1
    with pytest.raises(ValueError, match="^.*log.csv: several columns may be the clock"):
        th.read_csv(written(tmp_path, "t,time,u,y\n0,5,1,1\n1,6,2,3\n"))


def test_a_unit_and_a_zone_are_said(tmp_path: Path) -> None:
    path = written(tmp_path, "elapsed,u,y\n0,1,2\n0.5,2,3\n1,3,4\n")
    assert th.read_csv(path, time_unit="min").sample_time == 30
    path = written(tmp_path, "time,u,y\n2024-10-27 02:30:00,1,2\n2024-10-27 02:00:00,2,3\n2024-10-27 02:30:00,3,4\n")
    log = th.read_csv(path, time_zone="Europe/Berlin")
    assert log.sample_time == 1800
    path = written(tmp_path, "Date,Time,u,y\n10.01.2024,10:00:00,1,2\n10.01.2024,10:00:05,2,3\n")
    assert th.read_csv(path).sample_time == 5
    assert th.read_csv(path, time="Date,Time").sample_time == 5


def test_heads_words_and_notations(tmp_path: Path) -> None:
    path = written(tmp_path, "Logger 7\n\nt;u;y\ns;-;degC\n0;ON;1,5\n1;OFF;2,5\n2;ON;Bad\n")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        log = th.read_csv(path)
    words = [str(one.message).split("log.csv: ")[-1] for one in said]
    assert words == [
        "line 4 is read as units; skip_rows says how many lines below the names are left out",
        "the names are on line 3, and what is above is left out; header names another line",
        "column 'u': 'off' is read as 0 and 'on' as 1",
        "column 'y': read as missing values: 'bad' (1 row)",
    ]
    np.testing.assert_array_equal(log["u"], [1, 0, 1])
    np.testing.assert_array_equal(log["y"], [1.5, 2.5, np.nan])
    modes = written(tmp_path, "a,b\nu,y\nx,z\nauto,1\nmanual,2\n")
    log = th.read_csv(modes, header=2, values={"auto": 1, "manual": 0})
    np.testing.assert_array_equal(log["u"], [1, 0])
    with pytest.raises(ValueError, match=r"\(values manual=0\)|\(values auto=0\)"):
        th.read_csv(modes, header=2)
    numbers = written(tmp_path, "u;y\n1,234;2\n2,345;3\n")
    with pytest.warns(UserWarning, match="decimal_comma=False reads them as whole numbers"):
        np.testing.assert_array_equal(th.read_csv(numbers)["u"], [1.234, 2.345])
    np.testing.assert_array_equal(th.read_csv(numbers, decimal_comma=False)["u"], [1234, 2345])


def test_dates_come_back(tmp_path: Path) -> None:
    start = datetime.datetime(2024, 1, 10, 12)
    rng = np.random.default_rng(1)
    u = rng.choice([-1.0, 1.0], 60)
    y = np.convolve(u, [0, 1, 0.5, 0.25])[:60]
    rows = "".join(f"{start + datetime.timedelta(seconds=10 * k)},{u[k]},{y[k]}\n" for k in range(60))
    log = th.read_csv(written(tmp_path, "when,u,y\n" + rows))
    expected = pd.date_range(start, periods=60, freq="10s", name="when")
    assert (log.to_pandas().index == expected).all()
    assert repr(log).endswith("sample time 10.0 s by column 'when' from 2024-01-10T12:00:00)")
    assert (log[20:].to_pandas().index == expected[20:]).all()
    sheets = Path(__file__).parents[2] / "tests" / "data" / "spreadsheets" / "log.xlsx"
    with pytest.warns(UserWarning, match="sheet 'Data' is read; sheet names another one: Other"):
        log = th.read_log(sheets)
    assert (len(log), log.sample_time) == (120, 10)


def test_variables_of_matlab_are_columns(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    time = 0.5 * np.arange(20)
    path = tmp_path / "log.mat"
    variables = {"t": time, "u": np.sin(time), "y": np.arange(20, dtype=np.int16)[:, None], "Ts": 0.5, "name": "tank"}
    for compressed in (True, False):
        scipy_io.savemat(path, variables, do_compression=compressed)
        with pytest.warns(UserWarning, match=r"left out: (Ts \(1\)|.*: name)"):
            log = th.read_log(path)
        assert log.sample_time == 0.5
        np.testing.assert_array_equal(log["u"], np.sin(time))
        np.testing.assert_array_equal(log["y"], np.arange(20))

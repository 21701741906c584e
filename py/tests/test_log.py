"""Logs: what goes in comes out, and what cannot be is refused."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

import thetahat as th

Y = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
U = np.array([1.0, 0.0, 1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    "u",
    [
        U,
        list(U),
        U.reshape(-1, 1),
        np.column_stack([U, U])[:, 0],
        U.astype(np.float32),
        U.astype(int),
        U.astype(bool),
        U.astype(">f8"),
        {"u": U},
    ],
    ids=["array", "list", "column", "strided", "float32", "int", "bool", "big-endian", "dict"],
)
def test_inputs_come_in_many_forms(u: Any) -> None:
    log = th.Log(Y, u, sample_time=0.5)
    assert log == th.Log(Y, U, sample_time=0.5)
    assert log.inputs == ["u"] and log.u.shape == (5, 1)


def test_a_log_owns_its_data() -> None:
    y = Y.copy()
    y.setflags(write=False)
    log = th.Log(y, U)
    y = Y.copy()
    log = th.Log(y, U)
    y[0] = 99.0
    assert log.y[0] == 0.0
    log.y[0] = 99.0
    assert log.y[0] == 0.0


def test_several_inputs_have_names() -> None:
    both = np.column_stack([U, 2 * U])
    assert th.Log(Y, both).inputs == ["u1", "u2"]
    assert th.Log(Y, both, input_names=["heater", "fan"], output_name="room").inputs == ["heater", "fan"]
    assert np.array_equal(th.Log(Y, {"a": U, "b": 2 * U}).u, both)
    assert th.Log(Y).inputs == [] and th.Log(Y).u.shape == (5, 0)


def test_several_outputs_have_names_and_roles() -> None:
    pair = np.column_stack([Y, U])
    by_number, by_name = th.Log(pair), th.Log({"a": Y, "b": U})
    assert (by_number.outputs, by_name.outputs) == (["y1", "y2"], ["a", "b"])
    assert th.Log(pd.DataFrame({"a": Y, "b": U})) == by_name == th.Log(pair, output_name=["a", "b"])
    assert np.array_equal(by_name.y, pair) and "b" in by_name and by_name.select(output="b").output == "b"
    assert by_name.select(inputs="a", output="b") == th.Log(U, {"a": Y}, output_name="b")
    assert pickle.loads(pickle.dumps(by_name)) == by_name and by_name[1:3].outputs == ["a", "b"]
    with pytest.raises(ValueError, match="output_name: expected 2, found 1"):
        th.Log(pair, output_name="y")
    with pytest.raises(ValueError, match=r"take one with select\(output"):
        by_name.output  # noqa: B018
    with pytest.raises(ValueError, match="it has 2 outputs"):
        th.arma(by_name, na=1, nc=1)
    with pytest.raises(ValueError, match="no channel 'c'"):
        by_name.select(output="c")


def test_a_clock_may_be_uneven_where_it_may() -> None:
    time = [0.0, 1.0, 2.0, 2.7, 4.0]
    log = th.Log(Y, U, time=time, uniform=False)
    assert log.time.tolist() == time and log[:3].time.tolist() == time[:3]
    assert pickle.loads(pickle.dumps(log)) == log
    with pytest.raises(ValueError, match="the log is not uniform"):
        th.arx(log, na=1, nb=1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"y": []}, "y: expected at least one entry"),
        ({"y": [[1.0, 2.0]]}, r"y: expected one dimension, or a column for each output, found shape \(1, 2\)"),
        ({"y": 3.0}, "y: expected one dimension"),
        ({"y": Y, "u": U[:3]}, "channel 'y' has 5 rows, the others have 3"),
        ({"y": Y, "u": np.ones((5, 2, 2))}, r"u: expected shape \(rows,\) or \(rows, inputs\)"),
        ({"y": Y, "u": np.ones((5, 0))}, "u: expected at least one column"),
        ({"y": [1.0, np.inf]}, "channel 'y' is infinite in row 2"),
        ({"y": Y, "u": {"y": U}}, "two channels are called 'y'"),
        ({"y": Y, "u": U, "input_names": ["a", "b"]}, "input_names: expected 1, found 2"),
        ({"y": Y, "u": {"u": U}, "input_names": ["a"]}, "input_names"),
        ({"y": Y, "input_names": ["a"]}, "input_names: there are no inputs"),
        ({"y": Y, "sample_time": 0.0}, "sample time: 0 is not a positive"),
        ({"y": Y, "sample_time": np.nan}, "sample_time: nan is not a finite number"),
        ({"y": Y, "sample_time": 1.0, "time": Y}, "give one of time and sample_time"),
        ({"y": Y, "resample": (1.0, "linear")}, "resample: it is for logs with a clock"),
        ({"y": Y, "time": Y[:4]}, "there are 4 time stamps for 5 rows"),
        ({"y": Y, "time": Y[::-1]}, "time goes back"),
        ({"y": Y, "time": [0, 1, 2, 2.7, 4]}, "the log is not uniform; resample it every 1 s"),
        ({"y": Y, "time": Y, "resample": (1.0, "cubic")}, "resample: 'cubic' is none of"),
        ({"y": Y, "time": Y, "resample": (-1.0, "hold")}, "resample: -1 is not a positive"),
        ({"y": Y, "time": Y, "resample": (1.0, "hold", "raw")}, "resample: 'raw' is not 'unfiltered'"),
        ({"y": [1.0], "time": [0.0]}, "one row has no time step"),
        ({"y": [[1.0], [2.0, 3.0]]}, "y: "),
    ],
)
def test_what_cannot_be_a_log_is_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        th.Log(**arguments)


@pytest.mark.parametrize("y", [["a", "b"], [1 + 2j, 3], [["1.5"]], [1.0, "2"], {1.0, 2.0}, np.array(["2020-01-01"], dtype="M8[D]")])
def test_what_is_no_number_is_refused(y: Any) -> None:
    with pytest.raises(TypeError, match="y: expected numbers, found .*; convert"):
        th.Log(y)


def test_slices_are_logs() -> None:
    log = th.Log(Y, U, time=np.array([0.0, 0.1, 0.2, 0.5, 0.6]))
    assert log[1:3] == th.Log(Y[1:3], U[1:3], time=[0.1, 0.2])
    assert len(log[-2:]) == 2 and log[-2:].time[0] == 0.5 and log[3:].sample_time == log.sample_time
    assert log[:] == log
    for rows in (slice(3, 3), slice(9, 12), slice(None, None, 2)):
        with pytest.raises(ValueError, match="rows"):
            log[rows]
    assert "u" in log and "v" not in log and np.array_equal(log["y"], Y)
    with pytest.raises(KeyError, match="there is no channel 'v'"):
        log["v"]
    with pytest.raises(TypeError, match="slice"):
        log[0]  # type: ignore[call-overload]


def test_logs_join() -> None:
    log = th.Log.join([th.Log(Y, U), th.Log(2 * Y, U)])
    assert len(log) == 10 and np.array_equal(log[5:].y, 2 * Y)
    assert log != th.Log(log.y, log.u)
    with pytest.raises(ValueError, match="sample time"):
        th.Log.join([th.Log(Y, U), th.Log(Y, U, sample_time=2.0)])
    with pytest.raises(ValueError, match="no channel 'u'"):
        th.Log.join([th.Log(Y, U), th.Log(Y)])
    with pytest.raises(ValueError, match="at least one"):
        th.Log.join([])


def test_a_log_says_what_there_is() -> None:
    plain = th.Log(Y, U)
    assert (plain.experiments, plain.segments, plain.missing) == ([range(5)], [range(5)], {"u": 0, "y": 0})
    assert repr(plain) == "Log(5 rows, inputs u, output y, sample time 1.0 s assumed)"
    holed = th.Log([np.nan, 1.0, 2.0, 3.0, np.nan], [1.0, 0.0, np.nan, 0.0, 1.0])
    assert (holed.segments, holed.missing) == ([range(1, 2), range(3, 4)], {"u": 1, "y": 2})
    assert repr(holed) == "Log(5 rows in 2 segments, 3 values missing, inputs u, output y, sample time 1.0 s assumed)"
    gap = th.Log(Y, time=[0.0, 1.0, 2.0, 5.0, 6.0])
    assert gap.segments == [range(3), range(3, 5)] and gap.experiments == [range(5)]
    joined = th.Log.join([gap, th.Log([1.0, np.nan, 3.0]), th.Log([1.0])])
    assert joined.experiments == [range(5), range(5, 8), range(8, 9)]
    assert joined.segments == [range(3), range(3, 5), range(5, 6), range(7, 8), range(8, 9)]
    assert repr(joined) == (
        "Log(9 rows in 3 experiments and 5 segments, 1 value missing, no inputs, output y, sample time 1.0 s)"
    )
    assert [len(joined[rows]) for rows in joined.experiments] == [5, 3, 1]
    assert joined[joined.experiments[1]] == th.Log([1.0, np.nan, 3.0])
    # A part keeps the boundaries inside of it, and those are no gaps of one experiment.
    assert joined[4:6].experiments == [range(1), range(1, 2)]
    assert th.Log.join([th.Log(Y), th.Log(Y)]) != th.Log(np.tile(Y, 2), time=[*range(5), *range(9, 14)])
    assert th.Log([np.nan, np.nan]).segments == []
    with pytest.raises(ValueError, match=r"rows: range\(3, 9\) is not inside of the log, which has 5"):
        plain[range(3, 9)]


def test_an_inspection_keeps_experiments_apart() -> None:
    random = np.random.default_rng(3)
    y, u = random.standard_normal((2, 600))
    y[2:] += 3 * u[:-2]
    clock = np.arange(600.0)
    clock[100:] += 7
    clock[500:] += 7
    one = th.Log(y, u, time=clock)
    assert th.inspect(one).document["clock"]["gaps"] == 2
    joined = th.Log.join([one, one[:300], one[300:301]])
    document = th.inspect(joined).document
    assert (document["experiments"], document["clock"]["gaps"]) == (3, 3)
    assert "experiments" not in th.inspect(one).document
    assert "901 rows in 3 experiments" in th.inspect(joined).summary()
    # Across a boundary u and y have nothing to do with one another.
    short = th.Log.join([th.Log(y[k : k + 4], u[k : k + 4]) for k in range(0, 600, 4)])
    assert th.inspect(one).delays == {"u": 2} and th.inspect(short).excitation["u"] < th.inspect(one).excitation["u"]


@pytest.mark.parametrize(
    "log",
    [
        th.Log(Y, U, sample_time=0.1),
        th.Log([1.0, np.nan, 3.0]),
        th.Log(Y, U, time=[0.0, 0.1, 0.2, 0.5, 0.6]),
        th.Log(Y, U, time=[0.0, 0.1, 0.2, 0.5, 0.6], resample=(0.1, "linear")),
        th.Log.join([th.Log(Y, U), th.Log(Y[:2], U[:2])]),
    ],
    ids=["plain", "missing", "gap", "resampled", "joined"],
)
def test_logs_pickle_and_copy(log: th.Log) -> None:
    again = pickle.loads(pickle.dumps(log))
    assert again == log and again.sample_time == log.sample_time
    assert copy.copy(log) == log and copy.deepcopy(log) == log
    # What segments and provenance it has shows in a report.
    if len(log) > 4:
        assert th.arx(again, 1, 1).to_json() == th.arx(log, 1, 1).to_json()


def test_dates_are_a_clock() -> None:
    time = np.array("2026-01-01T00:00:00", dtype="M8[s]") + np.arange(5) * np.timedelta64(2, "s")
    log = th.Log(Y, U, time=time)
    assert log.sample_time == 2.0 and log.time[0] == 0.0
    assert th.arx(log, 1, 1).document["data"]["logs"][0]["start"] == "2026-01-01T00:00:00"
    assert th.Log(Y, U, time=time - time[0]).sample_time == 2.0


@pytest.mark.parametrize("library", [pd, pl], ids=["pandas", "polars"])
def test_data_frames_are_logs(library: Any) -> None:
    frame = library.DataFrame({"t": Y / 10, "heater": [1, 0, 1, 0, 1], "room": [0.0, 1.0, None, 3.0, 4.0], "note": list("abcde")})
    log = th.Log.from_dataframe(frame, inputs=["heater"], output="room", time="t")
    assert log == th.Log([0, 1, np.nan, 3, 4], {"heater": U}, time=Y / 10, output_name="room")
    assert th.Log.from_dataframe(frame, output="room").inputs == []
    with pytest.raises(ValueError, match="cooler"):
        th.Log.from_dataframe(frame, inputs=["cooler"], output="room")
    with pytest.raises(TypeError, match="note"):
        th.Log.from_dataframe(frame, inputs=["note"], output="room")


def test_files_are_read_as_on_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "log; a.csv"
    path.write_text("# made by hand\nzeit;ventil;druck\n0;1,5;2\n1;0;-x-\n2;1;4\n", encoding="utf-8")
    log = th.read_csv(
        path, inputs="ventil", output="druck", time="zeit", delimiter=";", decimal_comma=True, comment="#", missing="-x-"
    )
    assert log == th.Log([2, np.nan, 4], {"ventil": [1.5, 0, 1]}, time=[0, 1, 2], output_name="druck")
    assert th.read_csv(str(path), inputs=[], output="druck", delimiter=";", comment="#", missing=["-x-"]).inputs == []
    with pytest.raises(FileNotFoundError):
        th.read_csv(tmp_path / "none.csv")
    with pytest.raises(ValueError, match=r"log; a\.csv:4:5: column 'druck'.*missing='-x-'"):
        th.read_csv(path, inputs="ventil", output="druck", delimiter=";", decimal_comma=True, comment="#")
    with pytest.raises(ValueError, match="name the output with output"):
        th.read_csv(path, delimiter=";", comment="#")
    with pytest.raises(TypeError, match="did you mean 'delimiter'"):
        th.read_csv(path, delimeter=";")  # type: ignore[call-arg]


def test_what_is_found_in_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,u,y\n0,1,0\n1,0,1\n")
    assert repr(th.read_csv(path)) == "Log(2 rows, inputs u, output y, sample time 1.0 s by column 't')"
    path.write_text("0,1,2\n1,0,1\n2,0,3\n")
    with pytest.warns(UserWarning, match="header=False reads it as a row"):
        th.read_csv(path, inputs="1", output="2")
    with pytest.raises(ValueError, match="name the inputs with inputs"):
        th.read_csv(path, output="0")
    path.write_text('"flow, in","5"" pipe",y\n1,2,3\n4,5,6\n')
    log = th.read_csv(path, inputs=["flow, in", '5" pipe'])
    assert log.inputs == ["flow, in", '5" pipe'] and log["flow, in"].tolist() == [1.0, 4.0]


def test_a_log_shows_itself() -> None:
    log = th.Log([1.0, np.nan, 3.0], {"<b>": [0, 1, 0]})
    assert repr(log) == "Log(3 rows in 2 segments, 1 value missing, inputs <b>, output y, sample time 1.0 s assumed)"
    page = log._repr_html_()
    assert "<svg" in page and "&lt;b&gt;" in page and "nan" not in page
    assert "<svg" in th.Log(np.full(2000, 5.0))._repr_html_()


def test_what_is_masked_is_missing() -> None:
    masked = np.ma.masked_array([1.0, 999.0, 3.0], [False, True, False])
    log = th.Log(masked, np.ma.masked_array(np.column_stack([masked.data, U[:3]]), [[False, False], [True, False], [False, False]]))
    assert np.array_equal(log.y, [1.0, np.nan, 3.0], equal_nan=True)
    assert np.array_equal(log["u1"], log.y, equal_nan=True) and np.array_equal(log["u2"], U[:3])


def test_a_line_goes_on_in_a_part_of_the_log() -> None:
    random = np.random.default_rng(2)
    u, e = random.standard_normal((2, 300))
    y = np.zeros(300)
    for t in range(1, 300):
        y[t] = 0.7 * y[t - 1] + u[t - 1] + 0.01 * e[t]
    for clock in ({"sample_time": 0.5}, {"time": 100 + 0.5 * np.arange(300)}):
        log = th.Log(y + 0.3 * np.arange(300), u, **clock)
        model = th.arx(log[:200], 1, 1, detrend="linear")
        assert np.allclose(model.predict(log[200:])[1:], model.predict(log)[201:], atol=1e-9)
        assert model.validate(log[200:]).fit(1) > 95
        again = pickle.loads(pickle.dumps(log[200:]))
        assert np.array_equal(model.predict(again), model.predict(log[200:]), equal_nan=True)


def _length(path: str) -> int:
    return len(th.read_csv(path))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_reads_too(tmp_path: Path) -> None:
    path = str(tmp_path / "log.csv")
    Path(path).write_text("u,y\n" + "1,2\n" * 1000)
    assert _length(path) == 1000
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_length, [path, path]).get(timeout=60) == [1000, 1000]


def test_arrays_may_begin_anywhere() -> None:
    """As they do in a pickle whose buffers were sent on their own, and in files that are mapped."""
    values = np.arange(12.0)
    memory = bytearray(1 + values.nbytes)
    memory[1:] = values.tobytes()
    there = np.frombuffer(memory, np.float64, offset=1)
    assert not there.flags.aligned
    log = th.Log(there, there**2)
    assert log.y.tolist() == values.tolist()
    buffers: list[pickle.PickleBuffer] = []
    text = pickle.dumps(log, protocol=5, buffer_callback=buffers.append)
    assert buffers
    moved = []
    for buffer in buffers:
        own = bytearray(b"x" + buffer.raw())
        moved.append(memoryview(own)[1:])
    assert pickle.loads(text, buffers=moved) == log


def test_files_in_columns(tmp_path: Path) -> None:
    folder = Path(__file__).parents[2] / "tests" / "data" / "columnar"
    expected = th.read_log(folder / "log.csv", time="when")
    for path in [*folder.glob("*.parquet"), *folder.glob("*.arrow*")]:
        log = th.read_log(path, time="when")
        assert np.array_equal(log.y, expected.y, equal_nan=True) and np.array_equal(log.u, expected.u), path
        assert log.sample_time == expected.sample_time
        assert "column 4 ('note') is left out: it holds no numbers" in th.inspect(path, time="when").warnings
        with pytest.raises(ValueError, match="column 'note' holds texts"):
            th.read_log(path, inputs="note", time="when")
        assert th.read_log(path).sample_time == expected.sample_time
        with pytest.raises(ValueError, match="--delimiter|delimiter"):
            th.read_csv(path, delimiter=";")
    short = tmp_path / "short.parquet"
    short.write_bytes((folder / "polars.parquet").read_bytes()[:-9])
    with pytest.raises(ValueError, match="no whole Parquet file"):
        th.read_log(short)

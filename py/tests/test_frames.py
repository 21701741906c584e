"""Columns of pandas, polars and pyarrow tables, each where it is installed."""

from __future__ import annotations

import datetime
import decimal
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

import thetahat as th
from thetahat.base import frames as _frames

NAN = float("nan")
BEGIN = datetime.datetime(2024, 3, 1, 12, 0, 0, 250_000)
LATER = datetime.datetime(2024, 3, 1, 12, 0, 1)


def of_pandas(values: dict[str, list[Any]]) -> Any:
    return pytest.importorskip("pandas").DataFrame(values)


def of_polars(values: dict[str, list[Any]]) -> Any:
    return pytest.importorskip("polars").DataFrame(values)


def of_pyarrow(values: dict[str, list[Any]]) -> Any:
    return pytest.importorskip("pyarrow").table(values)


every = pytest.mark.parametrize("make", [of_pandas, of_polars, of_pyarrow])
Make = Callable[[dict[str, list[Any]]], Any]


def times(frame: Any, name: str) -> tuple[Any, str | None]:
    clock = _frames.clock(frame, name)
    assert clock.times is not None and clock.times.name == name and clock.column
    return clock.times.seconds(name), clock.times.start()


def read(frame: Any, name: str = "x") -> Any:
    values = _frames.columns(frame, [name])[name]
    assert values.dtype == np.float64
    assert values.flags.c_contiguous
    assert values.ndim == 1
    return values


@every
def test_numbers_become_float64_in_the_order_asked_for(make: Make) -> None:
    frame = make({"a": [1, -2, 3], "b": [0.5, NAN, 2.5], "c": [True, False, True], "d": ["x", "y", "z"]})
    values = _frames.columns(frame, ["c", "a", "b"])
    assert list(values) == ["c", "a", "b"]
    np.testing.assert_array_equal(values["a"], [1.0, -2.0, 3.0])
    np.testing.assert_array_equal(values["b"], [0.5, NAN, 2.5])
    np.testing.assert_array_equal(values["c"], [1.0, 0.0, 1.0])
    assert all(array.dtype == np.float64 for array in values.values())
    assert _frames.columns(frame, []) == {}


@every
def test_instants_become_seconds_since_the_first(make: Make) -> None:
    frame = make({"t": [BEGIN, LATER], "x": [1.0, 2.0]})
    seconds, first = times(frame, "t")
    np.testing.assert_array_equal(seconds, [0.0, 0.75])
    assert first == "2024-03-01T12:00:00.25"
    assert seconds.dtype == np.float64


@every
def test_numbers_are_seconds_already(make: Make) -> None:
    seconds, first = times(make({"t": [10, 11, 12]}), "t")
    np.testing.assert_array_equal(seconds, [10.0, 11.0, 12.0])
    assert first is None


@every
def test_durations_are_seconds_already(make: Make) -> None:
    seconds, first = times(make({"t": [BEGIN - BEGIN, LATER - BEGIN]}), "t")
    np.testing.assert_array_equal(seconds, [0.0, 0.75])
    assert first is None


@every
def test_a_missing_time_is_refused(make: Make) -> None:
    for entries, words in ([None, LATER], "row 1 has"), ([BEGIN, None, LATER, None], "2 rows have no time, the first of them row 2"):
        with pytest.raises(ValueError, match=f"t: {words}"):
            times(make({"t": entries}), "t")


@every
def test_what_is_no_number_is_refused_with_its_type(make: Make) -> None:
    frame = make({"label": ["a", "b"], "t": [BEGIN, LATER]})
    with pytest.raises(TypeError, match=r"'label': expected numbers, found \w+"):
        _frames.columns(frame, ["label"])
    with pytest.raises(TypeError, match="'t': expected numbers, found .*(date|time)"):
        _frames.columns(frame, ["t"])
    with pytest.raises(ValueError, match="column 'label': row 1 is 'a', no time in ISO 8601"):
        times(frame, "label")


@every
def test_names_are_checked(make: Make) -> None:
    frame = make({"a": [1.0], "b": [2.0]})
    with pytest.raises(ValueError, match="no column 'c'; there are 'a', 'b'"):
        _frames.columns(frame, ["a", "c"])
    with pytest.raises(ValueError, match="no column 'c'"):
        times(frame, "c")
    with pytest.raises(ValueError, match="'a' is asked for twice"):
        _frames.columns(frame, ["a", "b", "a"])


@every
def test_a_frame_has_rows(make: Make) -> None:
    with pytest.raises(ValueError, match="no rows"):
        _frames.columns(make({"a": []}), ["a"])


@pytest.mark.parametrize("thing", [{"a": [1.0]}, [[1.0]], np.ones((2, 2)), None, "log.csv"])
def test_what_is_no_frame_is_refused(thing: Any) -> None:
    with pytest.raises(TypeError, match="expected a dataframe .* found "):
        _frames.columns(thing, ["a"])


def test_a_lazy_frame_is_to_be_collected() -> None:
    polars = pytest.importorskip("polars")
    with pytest.raises(TypeError, match="LazyFrame; collect"):
        _frames.columns(polars.LazyFrame({"a": [1.0]}), ["a"])


def test_types_of_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    for dtype in "int8", "uint16", "int64", "float32", "Int64", "Float64", "UInt8":
        np.testing.assert_array_equal(
            read(pandas.DataFrame({"x": pandas.array([1, 2], dtype=dtype)})), [1.0, 2.0]
        )
    for dtype in "Int64", "Float64":
        frame = pandas.DataFrame({"x": pandas.array([1, pandas.NA, 3], dtype=dtype)})
        np.testing.assert_array_equal(read(frame), [1.0, NAN, 3.0])
    frame = pandas.DataFrame({"x": pandas.array([True, pandas.NA, False], dtype="boolean")})
    np.testing.assert_array_equal(read(frame), [1.0, NAN, 0.0])
    frame = pandas.DataFrame({"c": pandas.Categorical(["a", "b"]), "o": [1, "a"], "z": [1j, 2j]})
    found = {"c": "category", "o": r"'a' \(str\) in entry 1", "z": "dtype complex128"}
    for name, words in found.items():
        with pytest.raises(TypeError, match=f"'{name}': expected numbers, found {words}"):
            read(frame, name)


def test_columns_of_a_block_of_pandas_are_contiguous() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(np.arange(6.0).reshape(3, 2), columns=["a", "x"])
    np.testing.assert_array_equal(read(frame), [1.0, 3.0, 5.0])
    # The index is no matter, nor its order.
    np.testing.assert_array_equal(read(frame.iloc[::-1]), [5.0, 3.0, 1.0])


def test_two_columns_of_pandas_with_one_name_are_refused() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame([[1.0, 2.0]], columns=["a", "a"])
    with pytest.raises(ValueError, match="two columns have"):
        _frames.columns(frame, ["a"])


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_instants_of_pandas_in_any_unit_and_zone(unit: str) -> None:
    pandas = pytest.importorskip("pandas")
    instants = pandas.Series(pandas.to_datetime(["2024-03-31 00:30:00", "2024-03-31 03:30:00"]))
    instants = instants.astype(f"datetime64[{unit}]")
    seconds, first = times(pandas.DataFrame({"t": instants}), "t")
    np.testing.assert_array_equal(seconds, [0.0, 3 * 3600.0])
    assert first == "2024-03-31T00:30:00"
    # Summer time begins between the two: one hour less goes by.
    frame = pandas.DataFrame({"t": instants.dt.tz_localize("Europe/Berlin")})
    seconds, first = times(frame, "t")
    np.testing.assert_array_equal(seconds, [0.0, 2 * 3600.0])
    assert first == "2024-03-30T23:30:00Z"


def test_nanoseconds_are_kept() -> None:
    pandas = pytest.importorskip("pandas")
    instants = np.datetime64("2024-03-01T00:00:00", "ns") + np.array([0, 1, 1_000_000_001])
    seconds, first = times(pandas.DataFrame({"t": instants}), "t")
    np.testing.assert_array_equal(seconds, [0.0, 1e-9, 1.000000001])
    assert first == "2024-03-01T00:00:00"


def test_nulls_and_types_of_polars() -> None:
    polars = pytest.importorskip("polars")
    for dtype in "Int8", "UInt64", "Float32", "Float64", "Int64":
        frame = polars.DataFrame({"x": [1, None, 3]}, schema={"x": getattr(polars, dtype)})
        np.testing.assert_array_equal(read(frame), [1.0, NAN, 3.0])
    frame = polars.DataFrame({"x": [True, None, False]})
    np.testing.assert_array_equal(read(frame), [1.0, NAN, 0.0])
    frame = polars.DataFrame({"x": [[1.0], [2.0]]})
    with pytest.raises(TypeError, match="'x': expected numbers, found List"):
        read(frame)


def test_chunks_of_polars_are_one_column() -> None:
    polars = pytest.importorskip("polars")
    one, two = polars.DataFrame({"x": [1.0, None]}), polars.DataFrame({"x": [3.0]})
    frame = polars.concat([one, two], rechunk=False)
    assert frame.n_chunks() == 2
    np.testing.assert_array_equal(read(frame), [1.0, NAN, 3.0])
    np.testing.assert_array_equal(read(frame.slice(1)), [NAN, 3.0])


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_instants_of_polars_in_any_unit_and_zone(unit: Any) -> None:
    polars = pytest.importorskip("polars")
    instants = polars.Series("t", [BEGIN, LATER]).cast(polars.Datetime(unit))
    seconds, first = times(instants.to_frame(), "t")
    np.testing.assert_array_equal(seconds, [0.0, 0.75])
    assert first == "2024-03-01T12:00:00.25"
    frame = instants.dt.replace_time_zone("Asia/Tokyo").to_frame()
    seconds, first = times(frame, "t")
    np.testing.assert_array_equal(seconds, [0.0, 0.75])
    assert first == "2024-03-01T03:00:00.25Z"


def test_dates_are_instants() -> None:
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame({"t": [datetime.date(2024, 3, 1), datetime.date(2024, 3, 3)]})
    seconds, first = times(frame, "t")
    np.testing.assert_array_equal(seconds, [0.0, 2 * 86400.0])
    assert first == "2024-03-01T00:00:00"


def test_nulls_chunks_and_zones_of_pyarrow() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    chunks = [pyarrow.array([1, None]), pyarrow.array([3])]
    table = pyarrow.table({"x": pyarrow.chunked_array(chunks)})
    np.testing.assert_array_equal(read(table), [1.0, NAN, 3.0])
    table = pyarrow.table({"x": pyarrow.array([True, None, False])})
    np.testing.assert_array_equal(read(table), [1.0, NAN, 0.0])
    zoned = pyarrow.array([BEGIN, LATER], pyarrow.timestamp("us", tz="Asia/Tokyo"))
    seconds, first = times(pyarrow.table({"t": zoned}), "t")
    np.testing.assert_array_equal(seconds, [0.0, 0.75])
    assert first == "2024-03-01T12:00:00.25Z"


def test_types_of_pyarrow_in_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    pyarrow = pytest.importorskip("pyarrow")
    for dtype in "int64[pyarrow]", "double[pyarrow]", "bool[pyarrow]":
        frame = pandas.DataFrame({"x": pandas.array([1, None, 0], dtype=dtype)})
        np.testing.assert_array_equal(read(frame), [1.0, NAN, 0.0])
    dates = pandas.array([datetime.date(2024, 3, 1)], dtype=pandas.ArrowDtype(pyarrow.date32()))
    seconds, first = times(pandas.DataFrame({"t": dates}), "t")
    np.testing.assert_array_equal(seconds, [0.0])
    assert first == "2024-03-01T00:00:00"
    for zone, text in (None, "2024-03-01T12:00:00.25"), ("Asia/Tokyo", "2024-03-01T12:00:00.25Z"):
        instants = pyarrow.array([BEGIN, LATER], pyarrow.timestamp("us", tz=zone))
        instants = pandas.arrays.ArrowExtensionArray(instants)
        seconds, first = times(pandas.DataFrame({"t": instants}), "t")
        np.testing.assert_array_equal(seconds, [0.0, 0.75])
        assert first == text


@every
def test_whole_numbers_above_two_to_the_53_are_rounded(make: Make) -> None:
    np.testing.assert_array_equal(read(make({"x": [2**53 + 1, 1]})), [2.0**53, 1.0])


def test_decimals_of_polars() -> None:
    polars = pytest.importorskip("polars")
    values = [decimal.Decimal("1.5"), None]
    np.testing.assert_array_equal(read(polars.DataFrame({"x": values})), [1.5, NAN])


def address(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def test_what_lies_well_is_not_copied() -> None:
    pa, pl = pytest.importorskip("pyarrow"), pytest.importorskip("polars")
    values = np.arange(1000.0)
    polars = pl.DataFrame({"y": values})
    table = pa.table({"y": values})
    batch = table.to_batches()[0]
    for frame, there in [
        (polars, address(polars["y"].to_numpy())),
        (table, table["y"].chunk(0).buffers()[1].address),
        (batch, batch["y"].buffers()[1].address),
        (OnlyCapsule(table), table["y"].chunk(0).buffers()[1].address),
    ]:
        assert address(_frames.columns(frame, ["y"])["y"]) == there, type(frame)
        log = th.Log.from_dataframe(frame, output="y", sample_time=1.0)
        assert np.array_equal(log.y, values)
    # In pieces, or with nulls, a column is put together once.
    pieces = pa.table({"y": pa.chunked_array([values[:300], values[300:]])})
    assert np.array_equal(_frames.columns(pieces, ["y"])["y"], values)
    nulls = pa.table({"y": pa.array([1.0, None, 3.0])})
    assert np.array_equal(_frames.columns(nulls, ["y"])["y"], [1.0, np.nan, 3.0], equal_nan=True)


class OnlyCapsule:
    """A table of a library that nobody knows, with the PyCapsule interface of Arrow."""

    def __init__(self, table: Any) -> None:
        self.table = table

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


def test_record_batches_and_capsules_are_frames() -> None:
    pa = pytest.importorskip("pyarrow")
    when = pa.array([0, 500, 1000], pa.timestamp("ms", "Europe/Berlin"))
    table = pa.table({"u": pa.array([1, 0, 1]).dictionary_encode(), "y": [0.0, 0.5, 0.25], "when": when})
    for frame in (table, table.to_batches()[0], OnlyCapsule(table)):
        log = th.Log.from_dataframe(frame, inputs="u", output="y", time="when")
        assert repr(log) == (
            "Log(3 rows, inputs u, output y, sample time 0.5 s by column 'when' from 1970-01-01T01:00:00+01:00)"
        )
        assert log.u[:, 0].tolist() == [1.0, 0.0, 1.0]
    with pytest.raises(TypeError, match="expected a dataframe"):
        th.Log.from_dataframe(OnlyCapsule(table["y"]), output="y")
    with pytest.raises(ValueError, match="two columns"):
        th.Log.from_dataframe(pa.RecordBatch.from_arrays([pa.array([1.0]), pa.array([2.0])], ["y", "y"]), output="y")


def runs_of_pandas() -> pd.DataFrame:
    index = pd.date_range("2026-01-01", periods=50, freq="min", name="time")
    signals = pd.DataFrame({"u": np.arange(50.0), "y": np.arange(50.0) ** 2}, index)
    return pd.concat({"b": signals, "a": 2 * signals}, names=["run"])


@pytest.mark.parametrize("time", [None, "time"])
def test_levels_of_an_index_are_experiments_and_a_clock(time: str | None) -> None:
    frame = runs_of_pandas()
    log = th.Log.from_dataframe(frame, inputs="u", output="y", time=time)
    assert (log.experiments, log.sample_time) == ([range(50), range(50, 100)], 60.0)
    assert (log.y == frame["y"]).all()
    pd.testing.assert_frame_equal(log.to_pandas(), frame[["u", "y"]], check_freq=False)
    # Rows of the runs by turns, and the levels the other way round.
    mixed = frame.swaplevel().sort_index()
    again = th.Log.from_dataframe(mixed, inputs="u", output="y", time=time)
    assert again.experiments == log.experiments
    assert (again.y == np.concatenate([log.y[50:], log.y[:50]])).all()
    assert again.to_pandas().index.names == ["time", "run"]
    part = again[40:60].to_pandas(twice=2 * again.y[40:60])
    assert (part["twice"] == 2 * mixed.loc[part.index, "y"]).all()


def test_a_clock_in_a_column_and_runs_in_the_index() -> None:
    frame = runs_of_pandas().reset_index("time")
    frame.index = pd.MultiIndex.from_product([["b", "a"], range(50)], names=["run", "row"])
    log = th.Log.from_dataframe(frame, inputs="u", output="y", time="time")
    assert (log.experiments, log.sample_time) == ([range(50), range(50, 100)], 60.0)
    counted = th.Log.from_dataframe(frame, inputs="u", output="y", sample_time=2.0)
    assert (counted.experiments, counted.sample_time) == ([range(50), range(50, 100)], 2.0)


def test_levels_that_do_not_tell_runs_apart_are_refused() -> None:
    frame = runs_of_pandas()
    with pytest.raises(ValueError, match="the index has several levels; give the name of the level"):
        th.Log.from_dataframe(frame, inputs="u", output="y", time=np.arange(100.0))
    with pytest.raises(ValueError, match="y: its index has several levels; Log.from_dataframe makes an experiment"):
        th.Log(frame["y"], frame["u"])
    codes = frame.index.set_codes([-1, *frame.index.codes[0][1:]], level="run", verify_integrity=False)
    with pytest.raises(ValueError, match="the level 'run' of its index is missing in row 1; it tells which run"):
        th.Log.from_dataframe(frame.set_axis(codes), inputs="u", output="y")


def test_labels_may_be_numbers_and_tuples() -> None:
    values = np.random.default_rng(1).random((30, 2))
    numbered = pd.DataFrame(values)
    for inputs, output in ((0, 1), ([0], [1]), (["0"], "1")):
        log = th.Log.from_dataframe(numbered, inputs=inputs, output=output, sample_time=1)
        assert (log.inputs, log.output) == (["0"], "1")
        assert np.array_equal(log.y, values[:, 1])
    tuples = pd.DataFrame(values, columns=pd.MultiIndex.from_tuples([("pump", "u"), ("tank", "y")]))
    log = th.Log.from_dataframe(tuples, inputs=[("pump", "u")], output=[("tank", "y")], sample_time=1)  # type: ignore[list-item]
    assert (log.inputs, log.output) == (["pump.u"], "tank.y")
    for wrong in (None, True, 1.5):
        with pytest.raises(TypeError, match="output: expected a name or several"):
            th.Log.from_dataframe(numbered, output=wrong, sample_time=1)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="there is no column '7'"):
        th.Log.from_dataframe(numbered, output=7, sample_time=1)


def test_lazy_frames_are_collected() -> None:
    pl = pytest.importorskip("polars")
    frame = pl.DataFrame({"u": [1.0, 0.0, 1.0], "y": [0.0, 1.0, 0.5]})
    assert th.Log.from_dataframe(frame.lazy(), inputs="u", output="y", sample_time=1) == th.Log.from_dataframe(
        frame, inputs="u", output="y", sample_time=1
    )


def test_arrays_of_xarray() -> None:
    pytest.importorskip("xarray")
    index = pd.date_range("2026-01-01", periods=50, freq="min", name="time")
    frame = pd.DataFrame({"u": np.arange(50.0), "y": np.arange(50.0) ** 2}, index)
    data = frame.to_xarray()
    expected = th.Log.from_dataframe(frame, inputs="u", output="y")
    assert th.Log.from_dataframe(data, inputs="u", output="y") == expected
    assert th.Log(data["y"], data["u"]) == expected
    assert th.Log(data["y"]).sample_time == 60
    plain = data["y"].drop_vars("time")
    assert np.array_equal(th.Log(plain, sample_time=60).y, expected.y)
    several = data[["u", "y"]].to_array().T
    assert th.Log(data["y"].values, several, sample_time=60).inputs == ["u1", "u2"]

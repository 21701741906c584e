"""Clocks of logs from data frames: what is understood, what is refused, what the repr says, and the way back to frames."""

from __future__ import annotations

import copy
import datetime
import io
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

import thetahat as th

ROWS = 48
U = np.random.default_rng(7).standard_normal(ROWS)
Y = np.convolve(U, [0.0, 1.0, 0.5])[:ROWS]
UTC = datetime.timezone.utc
# Summer time begins in Berlin on 29 March 2026 at 2, and ends on 25 October 2026 at 3.
SPRING = pd.date_range("2026-03-29", periods=ROWS, freq="10min", tz="Europe/Berlin")
AUTUMN = pd.date_range("2026-10-25", periods=ROWS, freq="10min", tz="Europe/Berlin", name="when")
PLAIN = pd.date_range("2026-03-01", periods=ROWS, freq="10min")


def frame(index: Any = None, **columns: Any) -> Any:
    return pd.DataFrame({"fan": U, "room": Y, **columns}, index)


def log_of(data: Any, **options: Any) -> th.Log:
    return th.Log.from_dataframe(data, inputs="fan", output="room", **options)


# Ten minutes from row to row, whoever says it.
TEN_MINUTES: dict[str, tuple[Callable[[], th.Log], str]] = {
    "dates": (lambda: log_of(frame(PLAIN)), " by the index from 2026-03-01T00:00:00"),
    "dates in s": (lambda: log_of(frame(PLAIN.as_unit("s"))), " by the index from 2026-03-01T00:00:00"),
    "dates in ns": (lambda: log_of(frame(PLAIN.as_unit("ns"))), " by the index from 2026-03-01T00:00:00"),
    "UTC": (lambda: log_of(frame(PLAIN.tz_localize("UTC"))), " by the index from 2026-03-01T00:00:00+00:00"),
    "spring": (lambda: log_of(frame(SPRING)), " by the index from 2026-03-29T00:00:00+01:00"),
    "autumn": (lambda: log_of(frame(AUTUMN)), " by the index 'when' from 2026-10-25T00:00:00+02:00"),
    "offset": (lambda: log_of(frame(PLAIN.tz_localize("+02:00"))), " by the index from 2026-03-01T00:00:00+02:00"),
    "durations": (lambda: log_of(frame(PLAIN - PLAIN[0])), " by the index from 0 s"),
    "periods": (lambda: log_of(frame(PLAIN.to_period("10min"))), " by the index from 2026-03-01T00:00:00"),
    "texts": (lambda: log_of(frame(AUTUMN.astype(str))), " by the index 'when' from 2026-10-24T22:00:00+00:00"),
    "objects": (lambda: log_of(frame(pd.Index(list(SPRING.to_pydatetime()), dtype=object))), " by the index from 2026-03-29T00:00:00+01:00"),
    "named index": (lambda: log_of(frame(AUTUMN), time="when"), " by the index 'when' from 2026-10-25T00:00:00+02:00"),
    "named seconds": (lambda: log_of(frame(pd.Index(600 * np.arange(ROWS), name="t")), time="t"), " by the index 't'"),
    "column": (lambda: log_of(frame(at=SPRING), time="at"), " by column 'at' from 2026-03-29T00:00:00+01:00"),
    "column of texts": (lambda: log_of(frame(at=PLAIN.astype(str)), time="at"), " by column 'at' from 2026-03-01T00:00:00"),
    "column of periods": (lambda: log_of(frame(at=PLAIN.to_period("10min")), time="at"), " by column 'at' from 2026-03-01T00:00:00"),
    "column, not index": (lambda: log_of(frame(PLAIN, at=600.0 * np.arange(ROWS)), time="at"), " by column 'at'"),
    "times": (lambda: log_of(frame(), time=SPRING), " by time from 2026-03-29T00:00:00+01:00"),
    "Polars": (lambda: log_of(pl.from_pandas(frame(at=SPRING)), time="at"), " by column 'at' from 2026-03-29T00:00:00+01:00"),
    "Polars texts": (lambda: log_of(pl.from_pandas(frame(at=PLAIN.astype(str))), time="at"), " by column 'at' from 2026-03-01T00:00:00"),
    "series": (lambda: th.Log(frame(SPRING)["room"], frame(SPRING)["fan"]), " by the index from 2026-03-29T00:00:00+01:00"),
    "frames": (lambda: th.Log(frame(AUTUMN)[["room"]], frame(AUTUMN)[["fan"]]), " by the index 'when' from 2026-10-25T00:00:00+02:00"),
    "series by name": (lambda: th.Log(frame(PLAIN)["room"], {"fan": frame(PLAIN)["fan"]}), " by the index from 2026-03-01T00:00:00"),
    "array and series": (lambda: th.Log(frame(PLAIN)["room"], {"fan": U}), " by the index from 2026-03-01T00:00:00"),
    "datetimes": (lambda: timed(PLAIN.to_pydatetime().tolist()), " by time from 2026-03-01T00:00:00"),
    "datetimes in a zone": (lambda: timed(SPRING.to_pydatetime().tolist()), " by time from 2026-03-29T00:00:00+01:00"),
    "stamps": (lambda: timed(list(SPRING)), " by time from 2026-03-29T00:00:00+01:00"),
    "timedeltas": (lambda: timed([datetime.timedelta(minutes=10 * k) for k in range(ROWS)]), " by time from 0 s"),
    "ISO 8601": (lambda: timed(PLAIN.strftime("%Y-%m-%dT%H:%M:%S,250").tolist()), " by time from 2026-03-01T00:00:00.25"),
    "ISO 8601 with Z": (lambda: timed(PLAIN.strftime("%Y-%m-%d %H:%MZ").tolist()), " by time from 2026-03-01T00:00:00+00:00"),
    "index as time": (lambda: timed(SPRING), " by time from 2026-03-29T00:00:00+01:00"),
    "Series as time": (lambda: timed(pd.Series(SPRING)), " by time from 2026-03-29T00:00:00+01:00"),
    "Polars as time": (lambda: timed(pl.Series(PLAIN.to_numpy())), " by time from 2026-03-01T00:00:00"),
    "datetime64": (lambda: timed(PLAIN.to_numpy()), " by time from 2026-03-01T00:00:00"),
    "seconds": (lambda: timed(600.0 * np.arange(ROWS)), ""),
    "Timedelta": (lambda: log_of(frame(), sample_time=pd.Timedelta("10min")), ""),
    "timedelta": (lambda: log_of(frame(), sample_time=datetime.timedelta(minutes=10)), ""),
    "timedelta64": (lambda: log_of(frame(), sample_time=np.timedelta64(10, "m")), ""),
    "resampled": (lambda: log_of(frame(SPRING), resample=(pd.Timedelta("10min"), "linear")), " by the index, resampled from 2026-03-29T00:00:00+01:00"),
}


def timed(time: Any) -> th.Log:
    return th.Log(Y, {"fan": U}, time=time, output_name="room")


@pytest.mark.parametrize("case", TEN_MINUTES)
def test_ten_minutes_are_understood_and_said(case: str) -> None:
    make, words = TEN_MINUTES[case]
    log = make()
    assert log.sample_time == 600.0 and len(log) == ROWS
    assert repr(log) == f"Log(48 rows, inputs fan, output room, sample time 600.0 s{words})"
    # Time constants are in seconds.
    expected = th.arx(th.Log(Y, {"fan": U}, sample_time=600, output_name="room"), 1, 2)
    assert np.allclose(th.arx(log, 1, 2).time_constants(), expected.time_constants(), rtol=1e-9)
    for again in (pickle.loads(pickle.dumps(log)), copy.copy(log), copy.deepcopy(log)):
        assert again == log and repr(again) == repr(log)


def test_what_is_assumed_is_said() -> None:
    rows = "Log(48 rows, inputs fan, output room, sample time 1.0 s"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert repr(log_of(frame())) == f"{rows} assumed, as the index is a counter)"
        assert repr(log_of(frame(range(100, 148)))) == f"{rows} assumed, as the index is a counter)"
        assert repr(log_of(frame(), sample_time=1)) == f"{rows})"
        assert repr(log_of(pl.from_pandas(frame()))) == f"{rows} assumed)"
        assert repr(th.Log(Y, {"fan": U}, output_name="room")) == f"{rows} assumed)"
        assert repr(th.Log([1.0, 2.0])) == "Log(2 rows, no inputs, output y, sample time 1.0 s assumed)"
    for index, words in (
        (pd.Index(0.1 * np.arange(ROWS), name="t"), "time='t' takes it as seconds"),
        (pd.Index(10 * np.arange(ROWS)), "name it, and give its name as time"),
    ):
        with pytest.warns(UserWarning, match=words) as told:
            assert repr(log_of(frame(index))) == f"{rows} assumed, as the index holds numbers)"
        assert told[0].filename == __file__
    for data in (frame(at=PLAIN), frame(at=PLAIN.astype(str)), pl.from_pandas(frame(at=PLAIN))):
        assert repr(log_of(data)) == repr(log_of(data, time="at"))
        assert log_of(data, sample_time=1).sample_time == 1
    with pytest.raises(ValueError, match="several columns may be the clock: 'at', 'made'; name one with time, or give sample_time"):
        log_of(frame(at=PLAIN, made=PLAIN))


def test_the_sample_time_is_a_duration() -> None:
    for value, words in (
        (np.timedelta64(1, "M"), "no fixed length"),
        (pd.NaT, "expected a number, found NaT"),
        (PLAIN[0], "expected a number"),
    ):
        with pytest.raises(TypeError, match=f"sample_time: .*{words}"):
            log_of(frame(), sample_time=value)
    for value, words in (("soon", "no duration"), ("10 y", "no duration"), (pd.Timedelta(0), "positive"), (-pd.Timedelta("1s"), "positive"), (np.timedelta64("NaT"), "finite")):
        with pytest.raises(ValueError, match=f"sample.time: .*{words}"):
            log_of(frame(), sample_time=value)
    with pytest.raises(ValueError, match="sample_time: the index is a clock; leave sample_time out"):
        log_of(frame(PLAIN), sample_time=600)
    assert th.Log(Y, sample_time=pd.Timedelta(250, "ns")).sample_time == 2.5e-7
    assert [th.Log(Y, sample_time=text).sample_time for text in ("10min", "250 ns", "0.5 h")] == [600.0, 2.5e-7, 1800.0]


def changed(index: Any, row: int, entry: Any) -> Any:
    entries = list(index)
    entries[row] = entry
    return pd.DatetimeIndex(entries)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: log_of(frame(SPRING)[::-1]), "index: time goes back from 2026-03-29T08:50:00.02:00 in row 1 to .* in row 2; sort the rows by time first$"),
        (lambda: log_of(frame(changed(PLAIN, 5, PLAIN[4]))), "index: 2026-03-01T00:40:00 is there twice, in rows 5 and 6; keep one row for each time"),
        (lambda: log_of(frame(PLAIN[np.arange(ROWS) // 2])), r"index: .* is there twice, in rows 1 and 2 \(and 23 more\); keep"),
        (lambda: log_of(frame(changed(PLAIN, 7, pd.NaT))), "index: row 8 has no time; drop rows without one"),
        (lambda: log_of(frame(changed(PLAIN, 0, pd.NaT))), "index: row 1 has no time"),
        (lambda: log_of(frame(pd.DatetimeIndex([pd.NaT] * ROWS))), "index: 48 rows have no time, the first of them row 1"),
        # Local times without their zone: the hour before three is there twice.
        (lambda: log_of(frame(AUTUMN.tz_localize(None))), "from 2026-10-25T02:50:00 in row 18 to 2026-10-25T02:00:00 in row 19; .*summer time ends, give the times their time zone"),
        (lambda: log_of(frame(changed(PLAIN, 7, PLAIN[7] + pd.Timedelta("4min")))), r"row 8: the time step is 840.* resample the log \(resample=\(600.000000, 'linear'\)\)|time step is 840.*resample=\(600"),
        (lambda: log_of(frame(), time="at"), "frame: there is no column 'at'; there are 'fan', 'room'"),
        (lambda: log_of(frame(AUTUMN), time="at"), "there is no column 'at', and the index is called 'when'"),
        (lambda: log_of(frame(at=PLAIN.strftime("%d.%m.%Y %H:%M")), time="at"), "column 'at': row 1 is '01.03.2026 00:00', no time in ISO 8601 such as .* parse it first"),
        (lambda: timed([*PLAIN[:-1].astype(str), "2026-02-30"]), "time: row 48 is '2026-02-30', no time in ISO 8601"),
        (lambda: timed([*PLAIN[:-1].astype(str), "now"]), "time: row 48 is 'now'"),
        (lambda: timed(PLAIN[:5]), "there are 5 time stamps for 48 rows"),
        (lambda: timed(np.stack([PLAIN, PLAIN], 1)), r"time: expected one dimension, found shape \(48, 2\)"),
        (lambda: th.Log(frame(PLAIN)["room"], frame(SPRING)["fan"]), r"u: its index is not that of y, .*align them first"),
        (lambda: th.Log(frame()["room"], {"fan": frame(range(1, 49))["fan"]}), r"fan: its index is not that of y"),
        (lambda: log_of(frame(PLAIN)[:1]), "one row has no time step"),
    ],
)
def test_times_that_do_not_rise_are_refused(make: Callable[[], th.Log], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(
    ("time", "words"),
    [
        ([*PLAIN[:-1], 3.0], r"row 48 has a number, 3.0, where row 1 has an instant, Timestamp"),
        ([PLAIN[0], *SPRING[1:]], "row 2 has an instant with a time zone"),
        ([*PLAIN[:-1], "2026-03-01T12:00Z"], "row 48 has an instant with a time zone, '2026"),
        ([*PLAIN[:-1], object()], "row 48 is no time but <object"),
        ("at", "expected times, found the text 'at'"),
        ([1j] * ROWS, "expected numbers, found dtype complex128"),
    ],
)
def test_what_is_no_time_is_refused(time: Any, words: str) -> None:
    with pytest.raises(TypeError, match=f"time: {words}"):
        timed(time)


def test_times_of_several_zones_are_instants() -> None:
    berlin, tokyo = PLAIN.tz_localize("UTC").tz_convert("Europe/Berlin"), PLAIN.tz_localize("UTC").tz_convert("Asia/Tokyo")
    log = timed([*berlin[:20], *tokyo[20:]])
    assert log == timed(PLAIN) and log.to_pandas().index.equals(PLAIN.tz_localize("UTC"))
    texts = [moment.isoformat() for moment in [*berlin[:20], *tokyo[20:]]]
    assert timed(texts).to_pandas().index.equals(PLAIN.tz_localize("UTC"))
    assert str(timed(texts[:20] + [moment.isoformat() for moment in berlin[20:]]).to_pandas().index.tz) == "UTC+01:00"


# The index goes back as it came, and goes on as it went.
INDICES: dict[str, tuple[Any, Any]] = {
    "dates": (PLAIN, pd.date_range(PLAIN[-1], periods=4, freq="10min")[1:]),
    "spring": (SPRING, pd.date_range(SPRING[-1], periods=4, freq="10min")[1:]),
    "autumn": (AUTUMN, pd.date_range(AUTUMN[-1], periods=4, freq="10min", name="when")[1:]),
    "nanoseconds": (PLAIN[0] + pd.to_timedelta(np.arange(ROWS) * 7, "ns"), PLAIN[0] + pd.to_timedelta(np.arange(ROWS, ROWS + 3) * 7, "ns")),
    "days of a zone": (
        pd.date_range("2026-02-11", periods=ROWS, freq="D", tz="Europe/Berlin"),
        pd.date_range("2026-03-31", periods=3, freq="D", tz="Europe/Berlin"),
    ),
    "months": (pd.date_range("2022-01-31", periods=ROWS, freq="ME"), pd.date_range("2026-01-31", periods=3, freq="ME")),
    "months without a rule": (
        pd.DatetimeIndex(list(pd.date_range("2022-01-01", periods=ROWS, freq="MS"))),
        pd.DatetimeIndex(["2026-01-01", "2026-02-01", "2026-03-01"]),
    ),
    "days of work": (pd.bdate_range("2026-01-05", periods=ROWS), pd.DatetimeIndex(["2026-03-12", "2026-03-13", "2026-03-14"])),
    "durations": (PLAIN - PLAIN[0], pd.to_timedelta(600 * np.arange(ROWS, ROWS + 3), "s")),
    "counter": (pd.RangeIndex(100, 148, name="row"), pd.RangeIndex(148, 151, name="row")),
    "tens": (pd.Index(10 * np.arange(ROWS)), pd.Index(10 * np.arange(ROWS, ROWS + 3))),
    "jitter": (
        PLAIN + pd.to_timedelta(np.arange(ROWS) % 2, "s"),
        PLAIN[-1] + pd.Timedelta("1s") + pd.to_timedelta([599, 1198, 1797], "s"),
    ),
    "words": (pd.Index([f"row {k}" for k in range(ROWS)]), pd.Index([48.0, 49.0, 50.0], name="time")),
    "periods": (PLAIN.to_period("10min"), pd.date_range(PLAIN[-1], periods=4, freq="10min", unit="us")[1:]),
    "texts": (PLAIN.astype(str), pd.date_range(PLAIN[-1], periods=4, freq="10min", unit="s")[1:]),
}


@pytest.mark.filterwarnings("ignore:the index holds numbers", "ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("kind", INDICES)
def test_results_go_back_to_frames(kind: str) -> None:
    index, ahead = INDICES[kind]
    data = frame(index)
    log = log_of(data)
    model = th.arx(log, 1, 2)
    predicted, simulated = model.predict(log), model.simulate(log)
    back = log.to_pandas(predicted=predicted, simulated=simulated)
    pd.testing.assert_frame_equal(back[["fan", "room"]], data)
    assert np.array_equal(back["predicted"], predicted, equal_nan=True) and np.array_equal(back["simulated"], simulated)
    pd.testing.assert_frame_equal(log[7:31].to_pandas(), data[7:31])
    pd.testing.assert_frame_equal(pickle.loads(pickle.dumps(log)).to_pandas(), data)
    pd.testing.assert_frame_equal(th.Log.join([log[:20], log[20:]]).to_pandas(), data, check_freq=False)
    forecast = model.forecast(log, 3, U[:3]).to_pandas(level=0.5)
    assert list(forecast) == ["value", "standard_deviation", "lower", "upper"]
    assert ((forecast["lower"] < forecast["value"]) & (forecast["value"] < forecast["upper"])).all()
    if kind == "jitter":
        ahead = PLAIN[-1] + pd.Timedelta("1s") + pd.to_timedelta(log.sample_time * np.arange(1, 4), "s")
    assert forecast.index.equals(ahead) and (forecast.index.dtype, forecast.index.name) == (ahead.dtype, ahead.name)


def test_a_column_of_times_goes_back_beside_the_index() -> None:
    data = pd.DataFrame({"at": SPRING, "fan": U, "room": Y}, pd.RangeIndex(5, 5 + ROWS, name="row"))
    log = log_of(data, time="at")
    pd.testing.assert_frame_equal(log.to_pandas(), data, check_freq=False)
    forecast = th.arx(log, 1, 2).forecast(log, 2, U[:2]).to_pandas()
    assert list(forecast.index) == [53, 54] and list(forecast["at"]) == list(SPRING[-1] + pd.to_timedelta([10, 20], "min"))
    assert log.to_polars().equals(pl.from_pandas(data))


def test_seconds_go_on_by_the_sample_time() -> None:
    index = pd.Index(600 * np.arange(ROWS), name="t")
    for log in (log_of(frame(index), time="t"), log_of(frame(t=600.0 * np.arange(ROWS)), time="t")):
        forecast = th.arx(log, 1, 2).forecast(log, 2, U[:2])
        times = forecast.to_pandas()["t"] if "t" in forecast.to_pandas() else forecast.to_pandas().index
        assert list(times) == [28800.0, 29400.0] and forecast.to_polars()["t"].to_list() == [28800.0, 29400.0]


def test_results_go_to_polars() -> None:
    data = pl.DataFrame({"at": pl.Series(SPRING.as_unit("ms")), "fan": U, "room": Y})
    log = log_of(data, time="at")
    assert log.to_polars().equals(data) and log.to_polars().schema == data.schema
    model = th.arx(log, 1, 2)
    assert log[3:].to_polars(predicted=model.predict(log)[3:]).columns == ["at", "fan", "room", "predicted"]
    forecast = model.forecast(log, 2, U[:2])
    assert forecast.to_polars()["at"].to_list() == [moment.to_pydatetime() for moment in SPRING[-1] + pd.to_timedelta([10, 20], "min")]
    assert forecast.to_pandas().index.equals(pd.DatetimeIndex(forecast.to_polars()["at"].to_list()).as_unit("ms"))
    assert log_of(data.drop("at"), sample_time=2).to_polars()["time"].to_list() == [2.0 * k for k in range(ROWS)]
    assert log_of(frame(PLAIN.as_unit("s"))).to_polars()["time"].dtype == pl.Datetime("us")


def test_a_log_without_a_frame_has_seconds() -> None:
    log = th.Log(Y, U, sample_time=0.5)
    assert list(log[4:6].to_pandas().index) == [0.0, 0.5] and log.to_pandas().index.name == "time"
    assert list(th.arx(log, 1, 2).forecast(log, 2, U[:2]).to_pandas().index) == [24.0, 24.5]
    log = timed(PLAIN.to_numpy())
    assert log.to_pandas().index.equals(PLAIN)
    for columns, words in (({"room": Y}, "room: the log has a channel of this name"), ({"p": Y[:3]}, "p: expected 48 values, one for each row of the log, found 3")):
        with pytest.raises(ValueError, match=words):
            log.to_pandas(**columns)
        with pytest.raises(ValueError, match=words):
            log.to_polars(**columns)
    assert list(timed(600.0 * np.arange(ROWS)).to_pandas(p=pd.Series(Y))["p"]) == list(Y)


@pytest.mark.parametrize("time", [PLAIN.to_numpy().copy(), 600.0 * np.arange(ROWS), PLAIN.to_numpy() - PLAIN.to_numpy()[0]])
def test_a_log_owns_its_times(time: Any) -> None:
    log = timed(time)
    before = log.to_pandas()
    time[:] = time[0]
    pd.testing.assert_frame_equal(log.to_pandas(), before)


def test_a_resampled_log_has_new_times() -> None:
    kept = [0, *range(3, 30), *range(35, ROWS)]
    log = log_of(frame(SPRING).iloc[kept], resample=(300, "hold"))
    expected = pd.date_range(SPRING[0], SPRING[-1], freq="5min")
    assert log.sample_time == 300.0 and log.to_pandas().index.equals(expected)
    assert log.to_pandas().loc[SPRING[kept], "room"].tolist() == Y[kept].tolist()
    finer = log_of(frame(PLAIN.as_unit("s")), resample=(0.25 * 600.5, "linear")).to_pandas().index
    assert finer[1] == PLAIN[0] + pd.Timedelta(150.125, "s")


def test_a_file_as_pandas_reads_it(tmp_path: Any) -> None:
    """A CSV with times of a zone, gaps, missing values, read in each way that pandas has."""
    data = frame(AUTUMN)
    data.iloc[11, 1] = np.nan
    text = data.drop(data.index[30:33]).to_csv()
    ways = [
        (pd.read_csv(io.StringIO(text)), {"time": "when"}),
        (pd.read_csv(io.StringIO(text), index_col="when"), {}),
        (pd.read_csv(io.StringIO(text), index_col="when", parse_dates=True), {}),
        (pd.read_csv(io.StringIO(text), dtype_backend="pyarrow"), {"time": "when"}),
        (pl.read_csv(io.StringIO(text)), {"time": "when"}),
        (pl.read_csv(io.StringIO(text), try_parse_dates=True), {"time": "when"}),
    ]
    for read, options in ways:
        log = log_of(read, **options)
        assert log.sample_time == 600.0 and len(log) == ROWS - 3 and np.isnan(log.y[11])
        with pytest.warns(th.EstimationWarning, match="gaps in the clock: 1"):
            model = th.arx(log, 1, 1)
        forecast = model.forecast(log, 2, U[:2]).to_polars()
        assert list(pd.to_datetime(forecast["when"].to_list(), utc=True)) == list(AUTUMN[-1] + pd.to_timedelta([10, 20], "min"))


def test_the_report_names_the_clock() -> None:
    source = th.arx(log_of(frame(AUTUMN)), 1, 2).document["data"]["logs"][0]
    assert (source["time"], source["start"]) == ("when", "2026-10-24T22:00:00Z")


@pytest.mark.parametrize(("unit", "second"), [("s", 1), ("ms", 1000), ("us", 10**6), ("ns", 10**9)])
def test_numbers_since_1970_are_told_by_their_size(unit: str, second: int) -> None:
    first = 1_700_000_000 * second
    counted = first + np.arange(200) * (second // 100 or 1)
    frame = pd.DataFrame({"when": counted, "u": np.arange(200.0), "y": np.arange(200.0)})
    log = th.Log.from_dataframe(frame, inputs="u", output="y", time="when")
    assert log.sample_time == (1.0 if unit == "s" else 0.01)
    said = f"by column 'when', {unit} since 1970, from 2023-11-14T22:13:20+00:00"
    assert said in repr(log)
    # They go back as they came, and parts of them too.
    assert (log[50:].to_pandas()["when"] == counted[50:]).all()
    assert log.to_polars()["when"].to_list() == counted.tolist()
    # An index of them is a clock as well, also as floats.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        indexed = th.Log.from_dataframe(frame.set_index("when"), inputs="u", output="y")
        assert indexed.sample_time == log.sample_time
        # Of nanoseconds float64 has the last 256 only together.
        floats = th.Log(frame["y"].to_numpy(), time=counted.astype(float))
        assert floats.sample_time == pytest.approx(log.sample_time, rel=1e-4)
    if unit in ("ms", "us"):
        assert th.Log(np.arange(200.0), time=counted + 0.25).sample_time == pytest.approx(0.01)
    assert th.Log.from_dataframe(frame, inputs="u", output="y") == log


def test_numbers_that_may_be_since_1970_warn() -> None:
    # Microseconds since the start, half an hour later, at 1 kHz: as seconds since 1970 the rows were 1000 s apart.
    counted = 1_500_000_000 + 1000 * np.arange(100)
    with pytest.warns(UserWarning, match="time: numbers near 1.5e.09 with steps of 1000 may be s since 1970, with 1000 s"):
        log = th.Log(np.arange(100.0), time=counted)
    assert log.sample_time == 1000.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Days of a calendar; seconds with fractions; seconds since the start.
        assert "s since 1970" in repr(th.Log(np.arange(100.0), time=1_500_000_000 + 86_400 * np.arange(100)))
        assert th.Log(np.arange(100.0), time=1.5e9 + 0.25 * np.arange(100)).sample_time == 0.25
        assert th.Log(np.arange(100.0), time=100 * np.arange(100)).sample_time == 100.0

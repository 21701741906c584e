"""Results as frames of pandas and Polars, logs cut by dates, and models that read frames."""

from __future__ import annotations

import pickle
import warnings
from typing import Any

import numpy as np
import pandas as pd
import pytest

import thetahat as th

LOG = th.dc_motor()
MODEL = th.arx(LOG[:700], na=2, nb=2)


def steps() -> th.StepTest:
    t = np.arange(300)
    y = 5 + 4 * (1 - np.exp(-np.maximum(t - 50, 0) / 20))
    return th.step_test(th.Log(y, np.where(t < 50, 1.0, 3.0), sample_time=1.0))


def results() -> dict[str, tuple[Any, int, list[str]]]:
    """Each with how many rows it has, and some of its columns."""
    return {
        "model": (MODEL, 4, ["value", "standard_error", "t", "p", "lower", "upper"]),
        "validation": (MODEL.validate(LOG), 3, ["output", "horizon", "fit", "rmse"]),
        "comparison": (th.compare({"a": MODEL, "b": th.oe(LOG, 2, 2)}, LOG), 6, ["parameters", "fit", "whiteness"]),
        "inspection": (th.inspect(LOG), 2, ["role", "missing", "mean", "delay", "excitation"]),
        "step": (MODEL.step_response(samples=20), 20, ["value", "standard_error"]),
        "frequencies": (MODEL.frequency_response(points=30), 60, ["source", "frequency", "magnitude", "phase_error"]),
        "spectrum": (th.spectrum(LOG), 200, ["magnitude", "magnitude_lower", "coherence", "noise"]),
        "forecast": (MODEL.forecast(LOG[:900], 5, LOG.u[900:905]), 5, ["value", "lower", "upper"]),
        "step test": (steps(), len(steps().document["summary"]), ["figure", "method", "value", "standard_error"]),
        "selection": (th.arx(LOG, range(1, 4), range(1, 4)).selection, 9, ["na", "nb", "parameters", "score"]),
    }


def test_every_result_goes_to_a_frame_of_both_libraries() -> None:
    for name, (result, rows, columns) in results().items():
        frame, other = result.to_pandas(), result.to_polars()
        assert len(frame) == other.height == rows, name
        assert set(columns) <= set(frame.columns) & set(other.columns), name
        for column in columns:
            np.testing.assert_array_equal(frame[column].to_numpy(), other[column].to_pandas().to_numpy(), err_msg=name)
        again = pickle.loads(pickle.dumps(result))
        assert again.to_pandas().equals(frame), name


def test_figures_of_frames_are_those_of_the_results() -> None:
    validation = MODEL.validate(LOG[700:])
    fits = validation.to_pandas().set_index("horizon")["fit"]
    assert [fits[1], fits[np.inf]] == [validation.fit(1), validation.fit(None)]
    responses = MODEL.frequency_response([1.0, 10.0]).to_pandas()
    np.testing.assert_array_equal(responses.query("source == 'u'")["magnitude"], MODEL.frequency_response([1.0, 10.0]).magnitude[0])
    assert th.inspect(LOG).to_pandas().loc["u", "delay"] == 1
    assert steps().to_pandas().query("figure == 'gain'")["value"].iloc[0] == pytest.approx(2, abs=0.01)


def test_parameters_as_users_of_statsmodels_read_them() -> None:
    np.testing.assert_array_equal(MODEL.params.to_numpy(), MODEL.parameters)
    np.testing.assert_array_equal(MODEL.bse.to_numpy(), MODEL.standard_errors)
    assert list(MODEL.params.index) == MODEL.parameter_names == ["a1", "a2", "b1", "b2"]
    np.testing.assert_array_equal(MODEL.tvalues, MODEL.parameters / MODEL.standard_errors)
    ends = MODEL.conf_int(0.9)
    np.testing.assert_array_equal(ends.to_numpy(), MODEL.confidence_interval(0.9))
    assert list(ends.columns) == ["lower", "upper"]
    # Twice the tail of the standard normal distribution beyond 1.959964 is 5 %.
    t = MODEL.tvalues["a1"]
    from statistics import NormalDist

    assert MODEL.pvalues["a1"] == pytest.approx(2 * NormalDist().cdf(-abs(t)), rel=1e-9)


def test_intervals_have_a_row_for_each_sample() -> None:
    two = th.ss(th.Log(np.c_[LOG.y, LOG.y[::-1]], LOG.u, sample_time=0.01)[:400], 2)
    log = th.Log(np.c_[LOG.y, LOG.y[::-1]], LOG.u, sample_time=0.01)
    assert MODEL.predict_interval(LOG).shape == (1000, 2)
    assert MODEL.forecast(LOG[:900], 5, LOG.u[900:905]).interval().shape == (5, 2)
    assert two.predict_interval(log).shape == (1000, 2, 2)
    ahead = two.forecast(log[:900], 5, LOG.u[900:905])
    assert ahead.interval(0.8).shape == (5, 2, 2)
    frame = ahead.to_pandas(0.8)
    np.testing.assert_array_equal(frame[["y2_lower", "y2_upper"]], ahead.interval(0.8)[:, 1])


def test_models_read_frames_by_the_names_of_their_channels() -> None:
    frame = LOG.to_pandas()[["y", "u"]].assign(other="text")
    np.testing.assert_array_equal(MODEL.predict(frame), MODEL.predict(LOG))
    np.testing.assert_array_equal(MODEL.residuals(frame, 3), MODEL.residuals(LOG, 3))
    np.testing.assert_array_equal(MODEL.predict(LOG.to_polars().drop("time")), MODEL.predict(LOG))
    assert MODEL.validate(frame).fit(1) == MODEL.validate(LOG).fit(1)
    np.testing.assert_array_equal(MODEL.forecast(frame[:900], 2, LOG.u[900:902]).values, MODEL.forecast(LOG[:900], 2, LOG.u[900:902]).values)
    np.testing.assert_array_equal(MODEL.predict(frame[["u"]], None), MODEL.simulate(LOG.u))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        counted = frame.reset_index(drop=True)
        np.testing.assert_array_equal(MODEL.predict(counted), MODEL.predict(LOG))
    with pytest.raises(ValueError, match="log: there is no column 'y', which is a channel of the model; there are 'u'"):
        MODEL.predict(frame[["u"]])
    with pytest.raises(TypeError, match="log: expected a Log, found list"):
        MODEL.predict([1.0, 2.0])
    slow = frame.set_index(pd.date_range("2026", periods=1000, freq="s"))
    with pytest.raises(ValueError, match="sample time"):
        MODEL.predict(slow)


def test_logs_are_cut_by_dates() -> None:
    index = pd.date_range("2026-03-01", periods=1000, freq="h", tz="Europe/Berlin")
    frame = pd.DataFrame({"u": LOG["u"], "y": LOG["y"]}, index)
    log = th.Log.from_dataframe(frame, inputs="u", output="y")
    # Summer time begins on this day, which has 23 hours.
    for start, stop in (
        ("2026-03-29", "2026-03-29"),
        ("2026-03-01 05:00", "2026-03-02"),
        (None, "2026-03"),
        ("2026-04", None),
        ("2026-03-02T00:00+01:00", "2026-03-02T03:00+01:00"),
        (pd.Timestamp("2026-03-05 06:00", tz="Europe/Berlin"), None),
    ):
        found, expected = log[start:stop], frame[start:stop]
        assert len(found) == len(expected) > 0
        assert found.to_pandas().index.equals(expected.index)
    for rows, error, words in (
        (slice("2027", None), ValueError, "rows: 2027 is empty"),
        (slice("yesterday", None), ValueError, "no date such as"),
        (slice(1.5, None), TypeError, "1.5 is no date"),
    ):
        with pytest.raises(error, match=words):
            log[rows]
    with pytest.raises(TypeError, match="no dates; cut it by rows"):
        LOG["2026":]
    with pytest.raises(ValueError, match="do not rise"):
        th.Log.join([log, log])["2026-03-02":]


def test_logs_are_resampled() -> None:
    index = pd.date_range("2026-03-01", periods=100, freq="10s")
    frame = pd.DataFrame({"u": LOG["u"][:100], "y": LOG["y"][:100]}, index)
    log = th.Log.from_dataframe(frame, inputs="u", output="y")
    slow = log.resample("30s")
    assert (slow.sample_time, len(slow)) == (30.0, 34)
    assert slow == th.Log.from_dataframe(frame, inputs="u", output="y", resample=(30.0, "auto"))
    assert slow.to_pandas().index.equals(pd.date_range("2026-03-01", periods=34, freq="30s"))
    fast = th.Log([0.0, 1.0, 2.0], sample_time=1.0).resample(0.5, "linear")
    np.testing.assert_array_equal(fast.y, [0.0, 0.5, 1.0, 1.5, 2.0])
    two = th.Log.join([LOG[:500], LOG[500:]]).resample("20 ms")
    assert [len(rows) for rows in two.experiments] == [250, 250]
    for wrong, words in (("soon", "no duration"), (0, "positive"), (float("nan"), "finite")):
        with pytest.raises(ValueError, match=words):
            log.resample(wrong)
    with pytest.raises(ValueError, match="none of 'hold', 'linear' and 'auto'"):
        log.resample(30, "cubic")  # type: ignore[arg-type]


def test_a_log_draws_itself() -> None:
    assert [ax.get_ylabel() for ax in LOG.plot()] == ["y", "u"]

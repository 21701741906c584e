"""Logs of flights and robots."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import thetahat as th

PERIOD = 0.02


def ulog(path: Path, cut: int = 0) -> Path:
    """An input every 20 ms and an output every 10 ms, a millisecond later: y' = (2 u - y)/0.1."""

    def message(kind: bytes, data: bytes) -> bytes:
        return struct.pack("<Hc", len(data), kind) + data

    log = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    log += message(b"F", b"motor:uint64_t timestamp;float[2] output;")
    log += message(b"F", b"rates:uint64_t timestamp;float roll;bool armed;")
    log += message(b"A", struct.pack("<BH", 0, 0) + b"motor") + message(b"A", struct.pack("<BH", 0, 1) + b"rates")
    levels = [float(level) for level in np.repeat(np.random.default_rng(1).integers(-2, 3, 50), 6)]
    state = 0.0
    for row, level in enumerate(levels):
        begin = 1_000_000 + 20_000 * row
        log += message(b"D", struct.pack("<HQff", 0, begin, level, -level))

        def after(seconds: float, state: float = state, level: float = level) -> float:
            return float(2 * level + (state - 2 * level) * np.exp(-seconds / 0.1))

        for step in (0.001, 0.011):
            log += message(b"D", struct.pack("<HQf?", 1, begin + round(1e6 * step), after(step), True))
        state = after(PERIOD)
    path.write_bytes(log[: len(log) - cut])
    return path


def test_topics_are_listed(tmp_path: Path) -> None:
    motor, rates = th.topics(ulog(tmp_path / "flight.ulg"))
    assert (motor.name, motor.rows, motor.columns) == ("motor", 300, ("motor.output[0]", "motor.output[1]"))
    assert motor.rate == pytest.approx(50) and motor.duration == pytest.approx(5.98)
    assert (rates.name, rates.rows, rates.columns) == ("rates", 600, ("rates.roll", "rates.armed"))
    path = tmp_path / "log.csv"
    path.write_text("u,y\n1,2\n")
    with pytest.raises(ValueError, match="it has no topics with clocks of their own"):
        th.topics(path)


def test_columns_of_several_topics_are_put_on_one_clock(tmp_path: Path) -> None:
    path = ulog(tmp_path / "flight.ulg")
    log = th.read_log(path, inputs="motor.output[0]", output="rates.roll")
    assert log.sample_time == 0.01
    assert set(np.unique(log["motor.output[0]"])) == {-2, -1, 0, 1, 2}
    model = th.process(log, "p1", initial="estimate")
    gain, time_constant = model.parameters[:2]
    assert gain == pytest.approx(2, rel=0.01)
    # The input changes a millisecond before the instant from which on it counts.
    assert time_constant == pytest.approx(0.1, rel=0.02)
    slow = th.read_log(path, inputs="motor.output[0]", output="rates.roll", resample=(0.02, "hold"))
    assert slow.sample_time == 0.02
    inspection = th.inspect(path, inputs="motor.output[1]", output="rates.roll")
    assert inspection.document["log"]["resampled"]["step"] == 0.01


def test_columns_of_one_topic_keep_its_rows(tmp_path: Path) -> None:
    log = th.read_log(ulog(tmp_path / "flight.ulg"), inputs="rates.armed", output="rates.roll")
    assert len(log) == 600 and log.sample_time == 0.01


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    path = ulog(tmp_path / "flight.ulg", cut=3)
    with pytest.warns(UserWarning, match="ends in the middle of a message"):
        th.read_log(path, inputs="motor.output[0]", output="rates.roll")
    with pytest.raises(ValueError, match="lists the columns of its 2 topics"):
        th.read_log(path, inputs="motor.output[2]", output="rates.roll")

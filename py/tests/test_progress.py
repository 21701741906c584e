"""Progress of long work, and what becomes of warnings."""

from __future__ import annotations

import logging
import sys
import types
import warnings
from typing import Any

import numpy as np
import pytest

import thetahat as th


def long_log(rows: int = 20_000) -> th.Log:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(rows)
    y = np.convolve(u, 0.9 ** np.arange(60))[:rows] + np.cumsum(0.01 * rng.standard_normal(rows))
    return th.Log(y, u, sample_time=1)


def test_a_search_tells_how_many_models_are_done() -> None:
    told: list[tuple[int, Any, Any]] = []
    log = long_log()
    with th.warnings_as("ignore"):
        model = th.search(log, progress=lambda done, total, best: told.append((done, total, best)))
        assert th.search(log) == model
    counted = [(done, total) for done, total, _ in told if total is not None]
    assert counted and all(done <= total for done, total in counted)
    assert any(best is not None and best > 0 for _, _, best in told)


def test_many_logs_tell_how_many_are_done() -> None:
    told: list[tuple[int, Any, Any]] = []
    motor = th.dc_motor()
    logs = {"a": motor[:300], "b": motor[300:600], "short": motor[:3]}
    th.fit_many(logs, th.arx, na=1, nb=1, progress=lambda *place: told.append(place))
    assert sorted(told) == [(1, 3, None), (2, 3, None), (3, 3, None)]


def test_what_a_function_raises_ends_the_work() -> None:
    def full(done: int, total: int | None, best: float | None) -> None:
        raise RuntimeError("enough")

    with th.warnings_as("ignore"):
        with pytest.raises(RuntimeError, match="enough"):
            th.search(long_log(), progress=full)
        # Nobody is told of later work.
        th.search(long_log(2_000), "arx", na=range(1, 3), nb=range(1, 3))
    with pytest.raises(TypeError, match="progress: expected True, False or a function"):
        th.search(th.dc_motor(), progress="yes")  # type: ignore[arg-type]


def test_true_is_a_bar_of_tqdm_or_a_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    motor = th.dc_motor()
    logs = {"a": motor[:300], "b": motor[300:600]}
    # Where there is no tqdm.
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    th.fit_many(logs, th.arx, na=1, nb=1, progress=True)
    assert capsys.readouterr().err == "\rlogs: 1 of 2\rlogs: 2 of 2\n"

    class Bar:
        def __init__(self, **options: Any) -> None:
            self.n, self.total = 0, None
            bars.append(self)

        def set_postfix(self, **options: Any) -> None:
            pass

        def refresh(self) -> None:
            pass

        def close(self) -> None:
            self.closed = True

    bars: list[Any] = []
    module = types.ModuleType("tqdm.auto")
    module.tqdm = Bar  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tqdm.auto", module)
    th.fit_many(logs, th.arx, na=1, nb=1, progress=True)
    assert [(bar.n, bar.total, bar.closed) for bar in bars] == [(2, 2, True)]


def test_warnings_are_raised_logged_or_silenced(caplog: pytest.LogCaptureFixture) -> None:
    short = th.dc_motor()[:40]

    def fit() -> th.Model:
        return th.bj(short, nb=2, nc=2, nd=2, nf=2)

    with pytest.warns(th.EstimationWarning):
        model = fit()
    with th.warnings_as("raise"), pytest.raises(th.EstimationWarning):
        fit()
    with warnings.catch_warnings(), caplog.at_level(logging.INFO, "thetahat"):
        warnings.simplefilter("error")
        with th.warnings_as("log"):
            assert fit() == model
        with th.warnings_as("ignore"):
            fit()
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert said == model.warnings
    assert "fitted BJ(2, 2, 2, 2, 1)" in [record.getMessage() for record in caplog.records]
    with pytest.warns(th.EstimationWarning):
        fit()
    with pytest.raises(ValueError, match="action: 'shout' is none of"):
        th.warnings_as("shout")  # type: ignore[arg-type]
    th.warnings_as("ignore")
    try:
        fit()
    finally:
        th.warnings_as("warn")

"""Fits: every structure, every option, and what they refuse."""

from __future__ import annotations

import copy
import inspect
import json
import multiprocessing
import os
import pickle
import re
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, Optional, get_type_hints

import numpy as np
import pytest

import thetahat as th


@pytest.fixture
def log() -> th.Log:
    """y = 1.5 y(t-1) - 0.7 y(t-2) + u1(t-1) + 0.5 u1(t-2) - u2(t-3) + e."""
    random = np.random.default_rng(1)
    u = random.choice([-1.0, 1.0], size=(2000, 2))
    e = 0.1 * random.standard_normal(2000)
    y = np.zeros(2000)
    for t in range(3, 2000):
        y[t] = 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1, 0] + 0.5 * u[t - 2, 0] - u[t - 3, 1] + e[t]
    return th.Log(y, u)


FITS: dict[str, Callable[[th.Log], th.Model]] = {
    "arx": lambda log: th.arx(log, 2, [2, 1], [1, 3]),
    "armax": lambda log: th.armax(log, na=2, nb=[2, 1], nc=1, nk=[1, 3]),
    "oe": lambda log: th.oe(log, nb=[2, 1], nf=2, nk=[1, 3]),
    "bj": lambda log: th.bj(log, nb=[2, 1], nc=1, nd=1, nf=[2, 2], nk=(1, 3)),
    "ar": lambda log: th.ar(log, na=4),
    "arma": lambda log: th.arma(log, na=2, nc=1),
    "general": lambda log: th.general(log, na=1, nb=[2, 1], nf=[1, 1], nd=1, nk=[1, 3]),
    "fir": lambda log: th.fir(log, taps=[40, 40], kernel="tc"),
    "iv": lambda log: th.iv(log, 2, [2, 1], [1, 3]),
    "sriv": lambda log: th.sriv(log, [2, 1], 2, [1, 3]),
}


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
def test_a_model_is_for_what_focus_says() -> None:
    motor = th.dc_motor()
    oe = th.oe(motor, nb=2, nf=2, estimate="1..700", constant="no")
    bj = th.bj(motor, nb=2, nc=0, nd=1, nf=2, estimate="1..700", constant="no", focus="simulation")
    assert bj.parameters[[0, 1, 3, 4]].tolist() == oe.parameters.tolist()
    assert th.bj(motor, nb=2, nc=0, nd=1, nf=2, estimate="1..700", constant="no", focus="prediction") == th.bj(
        motor, nb=2, nc=0, nd=1, nf=2, estimate="1..700", constant="no"
    )
    evaluated = th.arx(motor, 2, 2, estimate="1..700", validate="701..1000", focus=5)
    horizons = [fit["horizon"].get("steps") for fit in evaluated.document["fit"] if fit["part"] == "validation"]
    assert horizons == [1, 5, None]
    chosen = th.search(motor, model="oe", focus="simulation").selection
    assert chosen is not None and chosen["focus"] == "simulation"
    assert chosen["chosen"] == chosen["winners"]["simulation"]
    assert chosen["chosen"]["held_out"]["refits"] == 3
    focuses: list[Any] = ["free", 0, -1]
    for wrong in focuses:
        with pytest.raises(ValueError, match="focus"):
            th.arx(motor, 2, 2, focus=wrong)


@pytest.mark.filterwarnings("ignore::thetahat.EstimationWarning")
@pytest.mark.parametrize("name", FITS)
def test_every_structure_fits(log: th.Log, name: str) -> None:
    model = FITS[name](log)
    assert model.structure == {"fir": "arx", "iv": "arx", "sriv": "oe"}.get(name, name)
    assert len(model.parameters) == len(model.parameter_names) == len(model.standard_errors)
    if name not in ("ar", "arma", "fir"):
        poles = [0.75 + np.sqrt(0.7 - 0.75**2) * 1j, 0.75 - np.sqrt(0.7 - 0.75**2) * 1j]
        near = np.abs(model.poles()[:, None] - np.array(poles)).min(axis=0)
        assert name == "general" or (near < 0.02).all()
        assert model.inputs == ["u1", "u2"] and model.b[1][:3].tolist() == [0, 0, 0]
    # The document is the model: it comes back whole, and so do copies.
    again = th.Model.from_json(model.to_json())
    assert again == model and hash(again) == hash(model)
    assert pickle.loads(pickle.dumps(model)) == model == copy.deepcopy(model) == copy.copy(model)
    assert np.array_equal(again.predict(log), model.predict(log), equal_nan=True)
    assert repr(model).startswith("Model(") and "\n" not in repr(model)
    assert "<pre>" in model._repr_html_()


def test_one_order_serves_for_all_inputs(log: th.Log) -> None:
    assert th.arx(log, 2, 3, 1) == th.arx(log, 2, [3, 3], [1, 1])


def test_numpy_integers_are_orders(log: th.Log) -> None:
    assert th.arx(log, np.int64(2), [np.int32(2), 2]) == th.arx(log, 2, 2)  # type: ignore[arg-type,list-item]


def test_rows_are_named_as_python_counts_or_as_the_command_line(log: th.Log) -> None:
    model = th.arx(log, 2, 2, estimate=slice(0, 700), validate=range(700, 2000))
    assert model == th.arx(log, 2, 2, estimate="1..700", validate=["701..2000"])
    assert model == th.arx(log, 2, 2, estimate=slice(700), validate=slice(700, None))
    assert [fit["part"] for fit in model.fits] == ["estimation"] * 2 + ["validation"] * 2
    assert np.array_equal(model.parameters, th.arx(log[:700], 2, 2).parameters)
    model = th.arx(log, 2, 2, split=(60, 20, 20))
    assert model.document["data"]["split"]["test"] == [[1601, 2000]]


def test_options_reach_the_engine(log: th.Log) -> None:
    assert th.arx(log, 2, 2, detrend="none").offsets["y"] == (0.0, 0.0)
    assert th.arx(log, 2, 2, offset={"u1": 0.25}).offsets["u1"] == (0.25, 0.0)
    bounded = th.arx(log, 2, 2, bound={"a1": (-1.2, None), "b1_1": 0.9})
    values = dict(zip(bounded.parameter_names, bounded.parameters))
    assert abs(values["a1"] + 1.2) < 1e-6 and abs(values["b1_1"] - 0.9) < 1e-6
    assert abs(th.arx(log, 2, 2, dc_gain={"u1": 5}).dc_gain(0)[0] - 5) < 1e-6
    for norm, said in ((1, "1"), ("1", "1"), ("inf", "inf"), (2, None), (2.0, None)):
        assert th.arx(log, 2, 2, norm=norm).document["estimation"].get("norm") == said
    for norm, k in (("huber", 1.345), ("huber:2", 2.0), (1, None)):
        robust = th.oe(log, 2, 2, norm=norm).document["estimation"]
        assert (robust["method"], robust.get("k")) == ("robust", k)
    largest = th.oe(log, 2, 2, norm="inf").document["estimation"]
    assert largest["norm"] == "inf" and largest["objective"] == largest["search"]["costs"][-1]
    for band, ends in (((0.01, 0.4), (0.01, 0.4)), ("..0.4", (None, 0.4)), ((0.01, None), (0.01, None))):
        assert th.oe(log, 2, 2, prefilter=band).document["data"]["prefilter"] == dict(zip(("low", "high"), ends))
    search = th.oe(log, 2, 2, search="gauss-newton", max_iterations=50, starts=2, seed=7, tolerance=1e-10)
    assert search.document["estimation"]["algorithm"] == "gauss-newton"
    assert th.oe(log, 2, 2, initial="zero").document["estimation"]["initial"] == "zero"
    assert th.arx(log, 2, 2, ridge=10.0) != th.arx(log, 2, 2)


def test_level_and_slope_of_the_output_are_estimated(log: th.Log) -> None:
    rows = np.arange(len(log))
    drifting = th.Log(log["y"] + 20.0 + 0.01 * rows, np.column_stack([log["u1"], log["u2"]]))
    model = th.oe(drifting, 2, 2, constant="yes")
    found = model.document["estimation"]["level"]
    assert found["standard_error"] > 0 and model.offsets["y"] == (found["value"], 0.0)
    model = th.arx(drifting, 2, 2, trend=True)
    level, slope = model.offsets["y"]
    found = model.document["estimation"]["slope"]
    assert found["value"] == slope and abs(slope - 0.01) < 5 * found["standard_error"]
    assert abs(level - 20.0) < 1.0
    assert "level" not in th.arx(drifting, 2, 2, constant="no").document["estimation"]
    assert th.arx(drifting, 2, 2, trend=False) == th.arx(drifting, 2, 2)


def test_a_search_chooses(log: th.Log) -> None:
    model = th.search(log, na=range(1, 4), nb=range(1, 4), nk=[range(1, 4), range(2, 5)], select="mdl")
    assert model.orders == {"na": 2, "nb": [2, 2], "nc": 0, "nd": 0, "nf": [0, 0], "nk": model.orders["nk"]}
    # With nb 2 a delay of 3 samples is one of 2 and a zero.
    assert model.orders["nk"] in ([1, 2], [1, 3]) and model.selection is not None and model.selection["models"] == 81
    assert th.arx(log, 2, 2).selection is None
    alternate = th.search(log, na=range(1, 6), nb=range(1, 6), nk=[1, 3], path="alternate")
    assert alternate.selection is not None and alternate.selection["models"] < 25
    chosen = th.search(log[:700], split=(60, 20, 20), select="validation")
    assert chosen.selection is not None and chosen.selection["second"] is not None


BAD: list[tuple[Callable[[th.Log], Any], type[Exception], str]] = [
    (lambda log: th.arx(log, -1, 2), ValueError, "na: -1 is below 0"),
    (lambda log: th.arx(log, 2.0, 2), TypeError, "na: expected an int"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, True, 2), TypeError, "na: expected an int"),
    (lambda log: th.arx(log, [2], 2), TypeError, "na: expected an int or a range"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, []), ValueError, "nb: there is none"),
    (lambda log: th.arx(log, 2, [1, 2, 3]), ValueError, "nb: 3 values for 2 inputs"),
    (lambda log: th.arx(log, 10**9, 2), ValueError, "na: 1000000000 is above 1000"),
    (lambda log: th.arx(log, 10**30, 2), ValueError, "na"),
    (lambda log: th.arx(log[:50], 30, 2), th.EstimationError, "too few rows"),
    (lambda log: th.arx(log, 0, 0), ValueError, "orders"),
    (lambda log: th.arx(log, 2, 2, estimate="5..2"), ValueError, "estimate"),
    (lambda log: th.arx(log, 2, 2, estimate=slice(0, 9999)), ValueError, "estimate"),
    (lambda log: th.arx(log, 2, 2, estimate=slice(-5, None)), ValueError, "estimate"),
    (lambda log: th.arx(log, 2, 2, estimate=slice(5000, None)), ValueError, "estimate"),
    (lambda log: th.arx(log, 2, 2, estimate=slice(0, 10, 2)), ValueError, "estimate: a step of 2"),
    (lambda log: th.arx(log, 2, 2, estimate=5), TypeError, "estimate: expected a slice"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, 2, detrend="cubic"), ValueError, "detrend"),
    (lambda log: th.arx(log, 2, 2, initial="cold"), ValueError, "initial"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, 2, constant="perhaps"), ValueError, "constant"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, 2, constant="no", trend=True), ValueError, "trend"),
    (lambda log: th.arx(log, 2, 2, constant="yes", initial="zero"), ValueError, "constant"),
    (lambda log: th.arx(log, 2, 2, trend=1), TypeError, "trend: expected True or False"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, 2, norm=3), ValueError, "norm"),
    (lambda log: th.oe(log, 2, 2, norm="infinity"), ValueError, "norm: 'infinity': give 2, 1, huber"),
    (lambda log: th.oe(log, 2, 2, prefilter="0.4"), ValueError, "prefilter: '0.4' is no band"),
    (lambda log: th.oe(log, 2, 2, prefilter=(0.1, 0.6)), ValueError, "prefilter: 0.6 Hz is not below 0.5 Hz"),
    (lambda log: th.arx(log, 2, 2, ridge=-1.0), ValueError, "ridge"),
    (lambda log: th.arx(log, 2, 2, ridge=np.nan), ValueError, "ridge: nan is not a finite"),
    (lambda log: th.arx(log, 2, 2, bound={"z9": 1.0}), ValueError, "z9"),
    (lambda log: th.arx(log, 2, 2, bound=[1]), TypeError, "bound: expected a dict"),  # type: ignore[arg-type]
    (lambda log: th.arx(log, 2, 2, offset={"w": 1.0}), ValueError, "offset: 'w' is neither"),
    (lambda log: th.arx(log, 2, 2, oofset={}), TypeError, "no argument 'oofset'; did you mean 'offset'"),  # type: ignore[call-arg]
    (lambda log: th.oe(log, 2, 2, search="magic"), ValueError, "search"),  # type: ignore[arg-type]
    (lambda log: th.oe(log, 2, 2, max_iterations=0), ValueError, "max_iterations"),
    (lambda log: th.oe(log, 2, 2, tolerance=-1.0), ValueError, "tolerance"),
    (lambda log: th.oe(log, 2, 2, initial="drop"), ValueError, "initial: drop"),
    (lambda log: th.search(log, na=range(5, 2)), ValueError, "na: range.* is empty"),
    (lambda log: th.search(log, na=range(1, 9, 3)), ValueError, "na: a step of 3"),
    (lambda log: th.search(log, model="magic"), ValueError, "model"),  # type: ignore[arg-type]
    (lambda log: th.search(log, na=2, nb=2, select="mdl"), ValueError, "select"),
    (lambda log: th.search(log, select="luck"), ValueError, "select"),
    (lambda log: th.arx("log.csv", 2, 2), TypeError, "log: expected a Log, found str"),  # type: ignore[arg-type]
    (lambda log: th.arx(th.Log(log.y), 2, 2), ValueError, "nb: the log has no inputs"),
    (lambda log: th.arx(log, 2, 2, split=5), TypeError, "split: expected three numbers"),  # type: ignore[arg-type]
    (lambda log: th.search(log, select=""), ValueError, "select"),
    (lambda log: th.compare(["a"], log), TypeError, "models: expected a Model"),  # type: ignore[list-item]
    (lambda log: th.Log.join(["a"]), TypeError, "logs: expected a Log"),  # type: ignore[list-item]
    (lambda log: th.inspect(5), TypeError, "path: expected a str or a path"),  # type: ignore[arg-type]
    (lambda log: th.inspect("none.csv"), FileNotFoundError, "none.csv"),
    (lambda log: th.search(th.Log(log.y, np.random.default_rng(0).random((2000, 101)))), ValueError, "inputs: 101 are too many"),
    (lambda log: th.oe(log, 2, 2, seed=-1, starts=1), ValueError, "seed: '-1'"),
    (lambda log: th.oe(log, 2, 2, seed=1), ValueError, "seed: .* give starts too"),
    (lambda log: th.read_csv([]), ValueError, "path: there is none"),
    (lambda log: th.read_csv(open(os.devnull)), TypeError, "path: expected a str or a path, found TextIOWrapper"),  # type: ignore[arg-type]
    (lambda log: th.Model(), TypeError, "models are made by fits"),
    (lambda log: th.Model.from_json("{}"), ValueError, "not a thetahat report"),
    (lambda log: th.Model.from_json(th.ar(log, 1).to_json()[:-40]), ValueError, "line"),
    (lambda log: th.Model.from_json(3), TypeError, "text"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize("case", range(len(BAD)))
def test_what_makes_no_sense_is_refused_by_name(log: th.Log, case: int) -> None:
    call, error, words = BAD[case]
    with pytest.raises(error, match=words) as raised:
        call(log)
    assert "--" not in str(raised.value)
    assert type(raised.value) is error


def test_what_the_data_cannot_determine_is_named() -> None:
    u = np.random.default_rng(0).standard_normal(100)
    with pytest.raises(th.EstimationError) as raised:
        th.arx(th.Log(np.roll(u, 1), np.column_stack([u, u])), 1, 1)
    assert raised.value.parameters == ["b2_1"] and "b2_1" in str(raised.value)
    with pytest.raises(th.EstimationError, match="constant"):
        th.arx(th.Log(u, np.ones(100)), 1, 1)
    with pytest.raises(th.EstimationError, match="too few rows"):
        th.arx(th.Log([1.0], [1.0]), 1, 1)
    with pytest.raises(ValueError, match="no estimation row"):
        th.arx(th.Log(np.full(100, np.nan), u), 1, 1)


def test_a_careful_reader_is_warned(log: th.Log) -> None:
    y = log.y
    y[100] = np.nan
    with pytest.warns(th.EstimationWarning, match="channel 'y' misses 1 of 2000"):
        model = th.arx(th.Log(y, log.u), 2, 2)
    assert any("misses" in warning for warning in model.warnings)
    assert model.document["data"]["segments"] == [[1, 100], [102, 2000]]


def test_an_unstable_plant_is_warned_of() -> None:
    random = np.random.default_rng(3)
    u = random.standard_normal(300)
    y = np.zeros(300)
    for t in range(1, 300):
        y[t] = 1.02 * y[t - 1] + u[t - 1] + random.standard_normal()
    with pytest.warns(th.EstimationWarning, match="unstable"):
        th.oe(th.Log(y, u), 1, 1, detrend="none")


def test_fits_at_once_give_the_same_bytes(log: th.Log) -> None:
    fits: list[Callable[[], th.Model]] = [
        lambda: th.oe(log, 2, 2),
        lambda: th.bj(log, 2, 1, 1, 2),
        lambda: th.search(log[:500], na=range(1, 5), nb=range(1, 4)),
    ]
    alone = [fit().to_json() for fit in fits]
    with ThreadPoolExecutor(6) as threads:
        together = list(threads.map(lambda index: fits[index % 3]().to_json(), range(18)))
    assert together == alone * 6


def test_others_run_while_a_fit_does(log: th.Log) -> None:
    fits, ended = 0, threading.Event()

    def fit() -> None:
        nonlocal fits
        while not ended.is_set():
            th.oe(log, 6, 6)
            fits += 1

    thread = threading.Thread(target=fit)
    thread.start()
    for _ in range(100):
        time.sleep(0)
    ended.set()
    thread.join()
    # With the interpreter lock held there would be a fit or more between two turns.
    assert fits < 25


def test_threads_may_ask_one_model_at_once(log: th.Log) -> None:
    model = th.arx(log, 2, 2)
    with ThreadPoolExecutor(6) as threads:
        documents = list(threads.map(lambda _: model.to_json(), range(12)))
    assert len(set(documents)) == 1


def _forked(log: th.Log) -> str:
    return th.oe(log, 2, 2).to_json()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_can_fit_too(log: th.Log) -> None:
    here = _forked(log)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_forked, [log, log]).get(timeout=60) == [here, here]


def test_control_c_ends_a_search(tmp_path: Path) -> None:
    script = tmp_path / "long.py"
    script.write_text(
        "import _thread, threading, numpy as np, thetahat as th\n"
        "random = np.random.default_rng(0)\n"
        "log = th.Log(random.standard_normal(4_000), random.standard_normal(4_000))\n"
        "try:\n"
        "    threading.Timer(1.0, _thread.interrupt_main).start()\n"
        "    th.bj(log, 4, 4, 4, 4, starts=10_000)\n"
        "except KeyboardInterrupt:\n"
        "    print('ended')\n"
    )
    found = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False)
    # By itself the search would take hours.
    assert found.stdout.strip() == "ended", found.stderr


def test_the_document_is_json_with_a_line_break(log: th.Log) -> None:
    text = th.arx(log, 2, 2).to_json()
    assert text.endswith("}\n") and json.loads(text)["schema"] == "thetahat.report/1"
    assert json.loads(text)["data"]["logs"][0]["file"] == "memory"


EVERY_FIT = (th.ar, th.arma, th.armax, th.arx, th.bj, th.fir, th.iv, th.oe, th.general, th.process, th.search, th.sriv)


@pytest.mark.parametrize(
    ("function", "options"),
    [
        *((fit, th.FitOptions) for fit in EVERY_FIT),
        *((look, th.ValidationOptions) for look in (th.compare, th.Model.validate)),
        *((read, th.ReadOptions) for read in (th.read_csv, th.inspect)),
    ],
    ids=lambda value: value.__name__,
)
def test_options_are_keyword_parameters(function: Any, options: Any) -> None:
    parameters = inspect.signature(function).parameters
    assert not [one for one in parameters.values() if one.kind is inspect.Parameter.VAR_KEYWORD]
    shown = {name for name, one in parameters.items() if one.kind is inspect.Parameter.KEYWORD_ONLY}
    known = set(options.__annotations__)
    assert shown >= known or (options is th.FitOptions and shown & known and function not in (th.general, th.search))
    # Their types are told once, and each is described where the options are.
    own, told = get_type_hints(function, localns={"Model": th.Model, "MeasuredResponse": th.MeasuredResponse, "np": np}), get_type_hints(options)
    for name in shown & known:
        assert own[name] in (told[name], Optional[told[name]]), name
        assert parameters[name].default is None or options is th.ReadOptions
        assert options is th.FitOptions or re.search(rf"\b{name}\b", function.__doc__), name
        assert re.search(rf"^    (\w+, )*{name}(, \w+)*( : |$)", options.__doc__, flags=re.M), name


def test_a_fit_without_time_looks_for_one_start(log: th.Log) -> None:
    plenty = th.bj(log, 2, 1, 1, 2, starts=20)
    with pytest.warns(th.EstimationWarning):
        none = th.bj(log, 2, 1, 1, 2, starts=20, time_limit=1e-9)
    starts = [model.document["estimation"]["starts"] for model in (plenty, none)]
    assert len(starts[0]) > 20 and len(starts[1]) == 1
    assert none.document["estimation"]["stopped"] == "time-limit"


def test_warnings_point_at_the_line_that_called(tmp_path: Path) -> None:
    log = th.dc_motor()
    holes = log.y[:, 0].copy() if log.y.ndim == 2 else log.y.copy()
    holes[::3] = np.nan
    gaps = th.Log(holes, log.u, sample_time=0.01)
    path = tmp_path / "log.csv"
    path.write_text("made by a logger\n\nt,u,y\ns,V,C\n" + "".join(f"{k},{k % 3},{k % 5}\n" for k in range(20)))
    for call in (lambda: th.oe(gaps, 2, 2), lambda: th.fit(gaps, plan=th.oe(log, 2, 2)), lambda: th.read_csv(path)):
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            call()
        assert found and {one.filename for one in found} == {__file__}

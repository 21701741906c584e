"""Many logs on a real cluster of two processes."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dask
import dask.bag
import dask.dataframe
import distributed
import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter, lfiltic

import thetahat as th
import thetahat.dask
from test_many import BROKEN, MOTOR, folder_of_logs



@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a table, its missing cells left out."""
    return [{name: cell for name, cell in row.items() if not pd.isna(cell)} for row in table.to_dict("records")]


def test_the_rows_are_those_of_one_process(client: Any, tmp_path: Path) -> None:
    logs = sorted(folder_of_logs(tmp_path).iterdir())
    orders: dict[str, Any] = {"na": range(1, 4), "nb": range(1, 4), "nk": 1, "model": "arx"}
    expected = th.fit_many(logs, **orders, reports=tmp_path / "out")
    for per_task in (None, 4):
        table = thetahat.dask.fit_many(logs, **orders, reports=tmp_path / "out", per_task=per_task).compute()
        assert rows(table) == expected.rows
        assert list(table.index) == list(range(len(logs)))
        assert list(table.columns) == list(expected.to_pandas().columns)
    assert (table["exit_code"] != 0).sum() == len(BROKEN)
    assert Path(table["report"].dropna().iloc[0]).is_file()


def test_delayed_objects_and_bags_are_logs(client: Any) -> None:
    whole = th.fit_many({"a": MOTOR[:500], "b": MOTOR[500:]}, th.arx, na=2, nb=2).rows
    delayed = {"a": dask.delayed(lambda: th.dc_motor()[:500])(), "b": MOTOR[500:]}
    assert rows(thetahat.dask.fit_many(delayed, th.arx, na=2, nb=2).compute()) == whole
    bag = dask.bag.from_sequence([("a", MOTOR[:500]), ("b", MOTOR[500:])], npartitions=2)
    assert rows(thetahat.dask.fit_many(bag, th.arx, na=2, nb=2).compute()) == whole
    assert thetahat.dask.rows(bag, th.arx, na=2, nb=2).compute() == whole


def test_a_frame_is_grouped_by_a_key(client: Any) -> None:
    frame = MOTOR.to_pandas().reset_index(names="t").assign(unit=np.arange(1000) % 3)
    last = frame.iloc[[-1]].assign(unit=7)
    frame = pd.concat([frame, last]).sample(frac=1, random_state=0)
    together = dask.dataframe.from_pandas(frame, npartitions=5, sort=False)
    read: dict[str, Any] = {"inputs": "u", "output": "y", "time": "t"}
    table = thetahat.dask.fit_many(together, th.arx, by="unit", read=read, na=2, nb=2).compute()
    own = {row["log"]: row for row in rows(table)}
    assert sorted(own) == ["0", "1", "2", "7"]
    for unit in range(3):
        group = frame[frame["unit"] == unit].sort_values("t")
        assert own[str(unit)]["a1"] == th.arx(th.Log.from_dataframe(group, **read), na=2, nb=2).parameters[0]
    # A key with one row.
    assert own["7"]["exit_code"] in (3, 4) and own["7"]["message"]
    with pytest.raises(ValueError, match="by: name the column"):
        thetahat.dask.fit_many(together, th.arx, read=read, na=2, nb=2)
    with pytest.raises(ValueError, match="the order of rows"):
        thetahat.dask.fit_many(together, th.arx, by="unit", read={"inputs": "u", "output": "y"}, na=2, nb=2)
    with pytest.raises(ValueError, match="no column 'no'"):
        thetahat.dask.fit_many(together, th.arx, by="no", read=read, na=2, nb=2)


def slow(log: th.Log, folder: str) -> th.Model:
    """A fit that says where it is, and waits for a worker to be killed: the first time."""
    seen = Path(folder, f"{os.getpid()}")
    if not seen.exists():
        seen.touch()
        while not Path(folder, "killed").exists():
            time.sleep(0.01)
    return th.arx(log, na=2, nb=2)


def test_a_lost_worker_costs_time_and_no_row(client: Any, tmp_path: Path) -> None:
    logs = {str(first): MOTOR[first : first + 300] for first in range(0, 700, 50)}
    expected = th.fit_many(logs, th.arx, na=2, nb=2).rows
    workers = list(client.run(os.getpid).values())
    found = client.submit(lambda: None)  # the cluster is there
    found.result()
    lazy = thetahat.dask.rows(logs, slow, folder=str(tmp_path), per_task=2).persist()
    while len(list(tmp_path.iterdir())) < 2:
        time.sleep(0.01)
    os.kill(workers[0], 9)
    (tmp_path / "killed").touch()
    assert lazy.compute() == expected


def test_wrong_arguments_are_refused(client: Any) -> None:
    with pytest.raises(ValueError, match="na"):
        thetahat.dask.fit_many({"a": MOTOR}, th.arx, na=-1, nb=2)
    with pytest.raises(TypeError, match="orders"):
        thetahat.dask.fit_many({"a": MOTOR}, th.arx, na=1, nb=2, orders=3)
    with pytest.raises(ValueError, match="there is none"):
        thetahat.dask.fit_many([], th.arx, na=1, nb=2)
    with pytest.raises(ValueError, match="per_task"):
        thetahat.dask.fit_many({"a": MOTOR}, th.arx, na=1, nb=2, per_task=0)
    with pytest.raises(ValueError, match="by"):
        thetahat.dask.fit_many({"a": MOTOR}, th.arx, by="unit", na=1, nb=2)


ORDERS: dict[str, Any] = {"na": 2, "nb": 2, "nk": 1}


def close(one: th.Model, other: th.Model) -> bool:
    pairs: list[tuple[Any, Any]] = [(one.parameters, other.parameters), (one.standard_errors, other.standard_errors), (one.mse, other.mse)]
    return all(np.allclose(a, b, rtol=1e-12, atol=0) for a, b in pairs)


def test_one_model_from_many_pieces(client: Any, tmp_path: Path) -> None:
    whole = th.arx(MOTOR, **ORDERS)
    cuts = [0, 100, 350, 351, 600, 1000]
    pieces = [MOTOR[first:last] for first, last in zip(cuts, cuts[1:])]
    sums = thetahat.dask.normal_equations(pieces, **ORDERS).compute()
    assert (sums.rows, sums.pieces) == (1000, 5)
    assert close(sums.solve(), whole)
    # Files of Parquet with a clock, and the partitions of a frame.
    frame = MOTOR.to_pandas().reset_index(names="t")
    frame["t"] = pd.Timestamp("2026-03-01T12:00", tz="Europe/Berlin") + pd.to_timedelta(frame["t"], unit="s")
    paths = [tmp_path / f"{number}.parquet" for number in range(4)]
    for number, path in enumerate(paths):
        frame[250 * number : 250 * (number + 1)].to_parquet(path)
    sums = thetahat.dask.normal_equations(paths, read={"time": "t"}, **ORDERS).compute()
    assert sums.samples == 998
    assert close(sums.solve(), whole)
    assert abs(sums.solve().sample_time / 0.01 - 1) < 1e-4
    together = dask.dataframe.from_pandas(MOTOR.to_pandas().reset_index(names="t"), npartitions=3)
    read = {"inputs": "u", "output": "y", "time": "t"}
    assert close(thetahat.dask.normal_equations(together, read=read, **ORDERS).compute().solve(), whole)
    # Experiments.
    logs = [MOTOR[:400], MOTOR[600:]]
    both = thetahat.dask.normal_equations(logs, experiments=True, **ORDERS).compute()
    assert close(both.solve(), th.arx(th.Log.join(logs), **ORDERS))


def test_one_model_of_several_outputs(client: Any) -> None:
    random = np.random.default_rng(6)
    u, y = random.standard_normal(1200), np.zeros((1200, 2))
    for t in range(2, 1200):
        y[t] = [[0.7, 0.1], [-0.3, 0.5]] @ y[t - 1] + [u[t - 1], 0.5 * u[t - 2]] + 0.1 * random.standard_normal(2)
    log = th.Log(y + 5, u, sample_time=0.1)
    orders: dict[str, Any] = {"na": range(1, 3), "nb": range(1, 4), "couple": "full"}
    pieces = [log[first : first + 100] for first in range(0, 1200, 100)]
    found, whole = thetahat.dask.normal_equations(pieces, **orders).compute().solve(), th.arx(log, **orders)
    assert found.samples == whole.samples == 1197
    for name in ("f", "g", "h", "k", "noise_covariance"):
        np.testing.assert_allclose(found.document["model"][name], whole.document["model"][name], rtol=1e-11, atol=1e-13)
    with pytest.raises(ValueError, match="^b: "):
        thetahat.dask.normal_equations({"a": log[:500], "b": log[500:].select(output="y1")}, **orders).compute()
    # States, of one log and of experiments.
    states: dict[str, Any] = {"order": 3, "horizons": (10, None), "nk": 1}
    found = thetahat.dask.normal_equations(pieces, **states).compute().solve()
    close_states(found, th.ss(log, 3, past=10, nk=1))
    found = thetahat.dask.fit_experiments(pieces, th.ss, order=range(1, 4), nk=1)
    close_states(found, th.ss(th.Log.join(pieces), order=range(1, 4), nk=1))
    with pytest.raises(ValueError, match="refine: the model is made in one pass"):
        thetahat.dask.fit_experiments(pieces, th.ss, refine="prediction")


def close_states(found: th.Model, whole: th.Model) -> None:
    assert found.name == whole.name
    steps = [one.simulate(np.ones(50)) for one in (found, whole)]
    np.testing.assert_allclose(steps[0], steps[1], rtol=1e-11, atol=1e-12)


def test_one_nonlinear_model(client: Any) -> None:
    orders: dict[str, Any] = {"terms": ["1", "y(k-1)", "y(k-2)", "u(k-1)", "y(k-1)*u(k-1)"], "ny": 2, "nu": 1}
    pieces = [MOTOR[first : first + 100] for first in range(0, 1000, 100)]
    found, whole = thetahat.dask.normal_equations(pieces, **orders).compute().solve(), th.narx(MOTOR, **orders)
    np.testing.assert_allclose(found.parameters, whole.parameters, rtol=1e-11, atol=1e-12)
    assert found.samples == whole.samples == 998


def test_pieces_that_cannot_be_meant_are_refused(client: Any) -> None:
    one, two = MOTOR[:500].to_pandas().reset_index(names="t"), MOTOR[500:].to_pandas().reset_index(names="t")
    read = {"inputs": "u", "output": "y", "time": "t"}

    def refusal(pieces: dict[str, Any]) -> str:
        with pytest.raises(ValueError) as caught:
            thetahat.dask.normal_equations(pieces, read=read, **ORDERS).compute()
        return str(caught.value)

    assert refusal({"first": one, "none": two[:0]}).startswith("none: ")
    assert "goes back" in refusal({"first": two, "second": one})
    assert "goes back" in refusal({"first": one, "second": two, "again": two.copy()})
    with pytest.raises(ValueError, match="given twice"):
        thetahat.dask.normal_equations([MOTOR, MOTOR], experiments=True, **ORDERS)
    with pytest.raises(ValueError, match="given twice"):
        thetahat.dask.normal_equations(["a.csv", "b.csv", "a.csv"], **ORDERS)
    # A plant that rests gives the same values again.
    rest = th.Log(np.full(300, 7.0), np.full(300, 2.0), sample_time=0.01)
    pieces = [MOTOR, rest, rest[:], rest[0:]]
    sums = thetahat.dask.normal_equations(pieces, experiments=True, **ORDERS).compute()
    assert sums.pieces == 4
    assert refusal({"first": one, "other": two.rename(columns={"u": "v"})}).startswith("other: ")
    with pytest.raises(ValueError, match="na"):
        thetahat.dask.normal_equations([MOTOR]).compute()


def experiment(seed: int, rows: int = 50_000) -> th.Log:
    """OE(2, 2, 1) from a state of its own, with white noise."""
    random = np.random.default_rng(seed)
    u, e = random.standard_normal(rows) + 2.0, random.standard_normal(rows)
    b, f = [0.0, 1.0, 0.5], [1.0, -1.5, 0.7]
    y, _ = lfilter(b, f, u, zi=lfiltic(b, f, 5.0 * random.standard_normal(2)))
    return th.Log(y + 3.0 + e, u, sample_time=0.1)


def test_a_search_over_experiments(client: Any) -> None:
    logs = {f"log {seed}": experiment(seed) for seed in range(6)}
    whole = th.oe(th.Log.join(list(logs.values())), nb=2, nf=2)
    model = thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2)
    assert np.allclose(model.parameters, whole.parameters, rtol=1e-8, atol=0)
    assert np.allclose(model.standard_errors, whole.standard_errors, rtol=1e-4, atol=0)
    assert model.document["data"]["rows"] == 300_000
    assert model.to_json() == thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2).to_json()
    # Whoever has them, one or several in a task.
    assert thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2, per_task=1).to_json() == model.to_json()
    with dask.config.set(scheduler="synchronous"):
        assert thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2).to_json() == model.to_json()
    short = {name: log[:300] for name, log in logs.items()}
    cases: list[tuple[Any, dict[str, Any]]] = [(th.armax, {"na": 2, "nb": 2, "nc": 2}), (th.arx, {"na": 2, "nb": 2})]
    for fit, orders in cases:
        expected = fit(th.Log.join(list(short.values())), **orders)
        found = thetahat.dask.fit_experiments(short, fit, **orders)
        assert np.allclose(found.parameters, expected.parameters, rtol=1e-8, atol=0)


TANK: dict[str, Any] = {
    "sample_time": 1,
    "states": {"level": {"start": 0, "sd": 1}},
    "inputs": {"flow": "u"},
    "parameters": {"area": {"start": 1, "sd": 1, "unknown": True, "min": 0}, "leak": {"start": 0.3, "sd": 0.2, "unknown": True}},
    "next": {"level": "level + dt * (flow - leak * level) / area"},
    "outputs": {"y": "level"},
    "noise": {"measurement": {"y": 0.01}},
}


def test_a_search_for_a_model_in_equations(client: Any) -> None:
    random = np.random.default_rng(1)
    logs = []
    for number in range(5):
        u, level, y = np.repeat(random.uniform(0, 2, 10), 10), 0.0, []
        for flow in u:
            y.append(level + 0.1 * random.standard_normal())
            level += (flow - 0.1 * level) / 2
        logs.append(th.Log(y, u, sample_time=1))
    model = thetahat.dask.fit_experiments(logs, th.grey, model=TANK)
    whole = th.grey(th.Log.join(logs), TANK)
    assert np.allclose(model.parameters, whole.parameters, rtol=1e-8, atol=0)
    assert model.document["fit"] and model.document["data"]["digests"] == whole.document["data"]["digests"]
    with pytest.raises(ValueError, match="rows"):
        thetahat.dask.fit_experiments(logs, th.grey, model=TANK, estimate="1..50")


def test_a_lost_worker_costs_time_and_no_digit(client: Any) -> None:
    logs = [experiment(seed) for seed in range(6)]
    expected = thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2).to_json()
    workers = list(client.run(os.getpid).values())
    killer = threading.Timer(0.3, os.kill, (workers[0], 9))
    killer.start()
    assert thetahat.dask.fit_experiments(logs, th.oe, nb=2, nf=2).to_json() == expected
    killer.join()


def test_experiments_that_cannot_be_meant_are_refused(client: Any) -> None:
    def refusal(logs: Any, fit: Any = th.oe, **options: Any) -> str:
        with pytest.raises(ValueError) as caught:
            thetahat.dask.fit_experiments(logs, fit, **{"nb": 2, "nf": 2, **options})
        return str(caught.value)

    good = MOTOR[:400]
    gone = th.Log(np.full(100, np.nan), np.arange(100.0), sample_time=0.01)
    assert refusal({"good": good, "gone": gone}).startswith("gone: no row has a value")
    slow = th.Log(good["y"], good["u"], sample_time=0.02)
    assert refusal({"good": good, "slow": slow}).startswith("slow: the second experiments have a sample time of 0.02 s")
    assert "given twice" in refusal([good, good])
    assert "all rows serve" in refusal([good], estimate="1..100")
    assert "fits no one model" in refusal([good], th.search)
    with pytest.raises(FileNotFoundError, match="nowhere.csv"):
        thetahat.dask.fit_experiments(["nowhere.csv"], th.oe, nb=2, nf=2)
    with pytest.raises(th.EstimationError, match="input 'u' is constant"):
        thetahat.dask.fit_experiments([th.Log(good["y"], np.full(400, 2.0), sample_time=0.01)], th.oe, nb=2, nf=2)
    with pytest.raises(TypeError, match="nc"):
        thetahat.dask.fit_experiments([good], th.oe, nb=2, nf=2, nc=1)

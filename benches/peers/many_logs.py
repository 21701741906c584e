"""Many logs, and one log on many workers: what they take with one worker of Dask and with two, in one run.

    python benches/peers/many_logs.py [LOGS] [PIECES] [ROWS]

10,000 logs of 1000 rows, among which 1 % are broken, get an ARX model each, chosen among 100; an ARX(8, 8) model is made of as many
pieces of 10^6 rows in files of Parquet; 50 experiments of 1000 rows, and of ROWS (100,000), are fitted one OE(2, 2) model. Prints times, ratios and memory. Needs the wheel of `make wheel` and its extra [dask].
"""

from __future__ import annotations

import glob
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from distributed import Client, LocalCluster

import thetahat as th
import thetahat.dask

CHOICE: dict[str, Any] = {"model": "arx", "na": range(1, 11), "nb": range(1, 11), "nk": 1}
BROKEN = [b"", b"u,y\n", b"u,y\n1,2\n", b"u,y\n1,2\n3,four\n", b"u,y\n1,2\n3\n", b"a,b\n1,2\n", b"u,y\n1,2\n3,inf\n", b"\x1f\x8bcut"]
ROWS = 1_000_000


def make_logs(folder: Path, count: int) -> None:
    random = np.random.default_rng(1)
    for number in range(count):
        path = folder / f"{number:05d}.csv"
        if number % 100 == 99:
            path.write_bytes(BROKEN[number // 100 % len(BROKEN)])
            continue
        u, e = np.sign(random.standard_normal(1000)), 0.1 * random.standard_normal(1000)
        y, pole, gain = np.zeros(1000), random.uniform(0.5, 0.95), random.uniform(0.5, 2)
        for t in range(2, 1000):
            y[t] = pole * y[t - 1] - 0.1 * y[t - 2] + gain * u[t - 1] + e[t]
        path.write_text("u,y\n" + "".join(f"{a:g},{b:.5f}\n" for a, b in zip(u, y)))


def make_piece(path: str, number: int) -> None:
    from scipy.signal import lfilter

    random = np.random.default_rng(number)
    u, e = random.standard_normal(ROWS), 0.1 * random.standard_normal(ROWS)
    y = lfilter([0, 1, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01], [1, -1.2, 0.5, -0.1, 0.05, 0, 0, 0, 0.01], u)
    y = y + lfilter([1], [1, -1.2, 0.5, -0.1, 0.05, 0, 0, 0, 0.01], e)
    pd.DataFrame({"u": u, "y": y}).to_parquet(path)


def memory() -> float:
    """The most that this process has had, in MB: what its parent had is none of it."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def on_workers(count: int, work: Any) -> tuple[float, Any, float]:
    """The time of some work on so many workers, what it gives, and the most memory of a worker."""
    cluster = LocalCluster(n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, Client(cluster) as client:
        client.run(lambda: __import__("thetahat.dask"))
        begun = time.perf_counter()
        found = work()
        taken = time.perf_counter() - begun
        return taken, found, max(client.run(memory).values())


def many(folder: Path, count: int) -> None:
    make_logs(folder, count)
    logs = sorted(glob.glob(str(folder / "*.csv")))
    begun = time.perf_counter()
    alone = th.fit_many(logs, **CHOICE, threads=1)
    single = time.perf_counter() - begun
    one, table, _ = on_workers(1, lambda: thetahat.dask.fit_many(logs, **CHOICE).compute())
    two, again, most = on_workers(2, lambda: thetahat.dask.fit_many(logs, **CHOICE).compute())
    assert table.equals(again)
    assert table["a1"].to_numpy(float, na_value=np.nan).tolist()[:50] == [row.get("a1", np.nan) for row in alone.rows][:50]
    failed = int((table["exit_code"] != 0).sum())
    print(f"{count} logs, 100 models each, {failed} rows that say why there is none")
    print(f"  one process and thread {single:.1f} s, one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times faster")
    print(f"  overhead of Dask {1e3 * (one - single) / count:.2f} ms a log, a worker {most:.0f} MB at most")


def one_model(folder: Path, count: int) -> None:
    paths = [str(folder / f"{number:03d}.parquet") for number in range(count)]
    for number, path in enumerate(paths):
        make_piece(path, number)
    orders = {"na": 8, "nb": 8}
    one, sums, _ = on_workers(1, lambda: thetahat.dask.normal_equations(paths, **orders).compute())
    two, again, most = on_workers(2, lambda: thetahat.dask.normal_equations(paths, **orders).compute())
    assert again.to_json() == sums.to_json()
    print(f"ARX(8, 8) of {sums.rows:.0e} rows in {count} pieces: one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times faster")
    print(f"  a worker {most:.0f} MB at most")
    if sums.rows > 2e7:
        return
    frames = pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)
    whole = th.arx(th.Log.from_dataframe(frames, inputs="u", output="y", sample_time=1.0), **orders)
    error = float(np.max(np.abs(sums.solve().parameters - whole.parameters)))
    print(f"  largest difference of a parameter to the fit in one pass {error:.1e}")


def make_experiment(path: str, number: int, rows: int) -> None:
    from scipy.signal import lfilter, lfiltic

    random = np.random.default_rng(number)
    u, e = random.standard_normal(rows), random.standard_normal(rows)
    b, f = [0, 1, 0.5], [1, -1.5, 0.7]
    y, _ = lfilter(b, f, u, zi=lfiltic(b, f, 5 * random.standard_normal(2)))
    pd.DataFrame({"u": u, "y": y + e}).to_parquet(path)


def one_search(folder: Path, rows: int) -> None:
    """One model of 50 experiments: read and fitted in one process on one thread, and on workers."""
    paths = [str(folder / f"{number:03d}-{rows}.parquet") for number in range(50)]
    for number, path in enumerate(paths):
        make_experiment(path, number, rows)
    orders = {"nb": 2, "nf": 2}

    def alone() -> Any:
        before = th._thetahat.threads(1)
        try:
            return th.oe(th.Log.join([th.read_csv(path) for path in paths]), **orders)
        finally:
            th._thetahat.threads(before)

    if rows < 10_000:
        alone()
    begun = time.perf_counter()
    whole = alone()
    single = time.perf_counter() - begun
    per_task = 25 if rows < 10_000 else None

    def search() -> tuple[float, Any]:
        """The time of the second one, as the first has to load what it needs, and its model."""
        thetahat.dask.fit_experiments(paths, th.oe, per_task=per_task, **orders)
        begun = time.perf_counter()
        found = thetahat.dask.fit_experiments(paths, th.oe, per_task=per_task, **orders)
        return time.perf_counter() - begun, found

    _, (one, _), _ = on_workers(1, search)
    _, (two, model), most = on_workers(2, search)
    error = float(np.max(np.abs(model.parameters / whole.parameters - 1)))
    print(f"OE(2, 2) of 50 experiments of {rows} rows: one process and thread {single:.2f} s, one worker {one:.2f} s, two {two:.2f} s")
    print(f"  two workers take {two / single:.2f} of the time of one process; a parameter differs by {error:.1e}, a worker {most:.0f} MB at most")


if __name__ == "__main__":
    logs, pieces, rows = (int(word) for word in [*sys.argv[1:], *["10000", "100", "100000"][len(sys.argv) - 1 :]])
    os.environ["OMP_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as name:
        if logs:
            many(Path(name), logs)
        if pieces:
            one_model(Path(name), pieces)
        for count in (1000, rows):
            one_search(Path(name), count)

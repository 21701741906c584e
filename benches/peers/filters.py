"""Steps recursive filters of ours and of others on the same data, by turns, and prints the ratios of their times; then
what becomes of the Kalman filters in single precision.

Usage: filters.py THETAHAT_FILTERS FOLDER STEPS (the program, a folder for the data, and how long the endurance test
may last); `run` calls it. It fails on errors and on estimates that disagree, not on a ratio that is missed.
"""

import json
import os
import platform
import re
import subprocess
import sys
import time
from importlib.metadata import version

from compare import ask, check, print_table, processor, start, verdict

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy
import padasip
import pykalman
from filterpy.kalman import KalmanFilter

# At most this many times the step of the peer.
REQUIRED = {
    ("4x2", "adskalman, Joseph"): 1.05,
    ("6x3", "adskalman, Joseph"): 0.8,
    ("8", "plain nalgebra"): 0.6,
    ("16", "plain nalgebra"): 0.45,
}

CRATES = ["adskalman", "kfilter", "minikalman", "multicalc", "nalgebra"]
PACKAGES = ["NumPy", "filterpy", "pykalman", "padasip"]

ROUNDS = 150

# Python, which is slower by far, takes part in one round of this many.
SELDOM = 15


def main():
    program, folder, steps = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    subprocess.run([program, "write", folder], check=True)
    print_versions()
    rows = [["work", "peer", "thetahat", "peer's", "ours / peer's", "required", "verdict"]]
    with start(program, "serve") as server:
        for size in ("4x2", "6x3"):
            theirs = {"filterpy": step_filterpy, "pykalman": step_pykalman}
            data = read(folder, f"kalman-{size}.json")
            rows += compare(server, size, f"Kalman filter, {size}", theirs, data)
        for size in ("4x2", "6x3"):
            rows += compare(server, f"ekf-{size}", f"extended Kalman filter, {size}", {}, None)
        for size in ("4x2", "6x3"):
            rows += compare(server, f"ukf-{size}", f"unscented Kalman filter, {size}", {}, None)
        for size in ("4", "8", "16"):
            data = read(folder, f"rls-{size}.json")
            work = f"recursive least squares, {size}"
            rows += compare(server, size, work, {"padasip": step_padasip}, data)
    print_table(rows)
    print()
    print_table([["Potter's case", "P", "positive definite", "worst relative error"], *ask_rows(program, "potter")])
    print()
    settings = ["prior 1, 1 m", "prior 1e6, 1 cm", "prior 1e8, 1 cm"]
    print_table([[f"of {int(steps):,} steps", *settings], *ask_rows(program, "endure", steps)])


def print_versions():
    """The libraries and the processor."""
    with open("Cargo.lock") as lock:
        locked = dict(re.findall(r'name = "(.*)"\nversion = "(.*)"', lock.read()))
    names = [f"{name} {locked[name]}" for name in CRATES] + [f"{name} {version(name)}" for name in PACKAGES]
    rustc = subprocess.check_output(["rustc", "--version"], text=True).strip()
    print(*names, rustc, f"Python {platform.python_version()}", sep=", ")
    print(f"{processor()}, {os.cpu_count()} processors", end="\n\n", flush=True)


def read(folder, name):
    """The data of a work, in arrays."""
    with open(os.path.join(folder, name)) as text:
        return {key: numpy.array(value) for key, value in json.load(text).items()}


def compare(server, size, work, packages, data):
    """The rows of one work: the program's filters and those of Python packages, by turns."""
    names = ask(server, size).rstrip("\n").split("\t")
    ours, *_ = names
    best, estimates = {}, {}

    def keep(name, seconds, *estimate):
        best[name] = min(seconds, best.get(name, seconds))
        estimates[name] = estimate

    for turn in range(ROUNDS):
        for name in names:
            keep(name, *map(float, ask(server, size, name).split()))
        for name, step in packages.items() if turn % SELDOM == 0 else ():
            begin = time.perf_counter()
            count, estimate = step(data)
            keep(name, (time.perf_counter() - begin) / count, *numpy.ravel(estimate).tolist())
    for name, estimate in estimates.items():
        check(name, estimate, estimates[ours])
    return [row(size, work, name, best[ours], seconds) for name, seconds in best.items() if name != ours]


def row(size, work, peer, ours, theirs):
    """A row of the table."""
    ratio, limit = ours / theirs, REQUIRED.get((size, peer))
    shown = f"{ratio:.3f}" if ratio > 0.05 else f"1/{1 / ratio:,.0f}"
    cells = [f"at most {limit}", verdict(ratio <= limit)] if limit else ["", ""]
    return [work, peer, f"{ours * 1e9:.1f} ns", f"{theirs * 1e9:,.1f} ns", shown, *cells]


def step_filterpy(data):
    """The number of steps and the last estimate."""
    states, outputs = len(data["F"]), len(data["H"])
    kalman = KalmanFilter(dim_x=states, dim_z=outputs)
    kalman.F, kalman.Q, kalman.H, kalman.R, kalman.P = (data[name] for name in "FQHRP")
    for measurement in data["record"]:
        kalman.predict()
        kalman.update(measurement)
    return len(data["record"]), kalman.x


def step_pykalman(data):
    """The number of steps and the last estimate."""
    kalman = pykalman.KalmanFilter(
        transition_matrices=data["F"],
        transition_covariance=data["Q"],
        observation_matrices=data["H"],
        observation_covariance=data["R"],
    )
    state, covariance = numpy.zeros(len(data["F"])), data["P"]
    for measurement in data["record"]:
        state, covariance = kalman.filter_update(state, covariance, measurement)
    return len(data["record"]), state


def step_padasip(data):
    """The number of steps and the last estimate."""
    regressors, targets = data["regressors"], data["targets"]
    prior, forgetting = float(data["prior"]), float(data["forgetting"])
    adaptive = padasip.filters.FilterRLS(n=regressors.shape[1], mu=forgetting, eps=1 / prior, w="zeros")
    for regressor, target in zip(regressors, targets):
        adaptive.adapt(target, regressor)
    return len(targets), adaptive.w


def ask_rows(program, *arguments):
    """The rows that the program prints."""
    lines = subprocess.check_output([program, *arguments], text=True).splitlines()
    return [line.split("\t") for line in lines]


if __name__ == "__main__":
    main()

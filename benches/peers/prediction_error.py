"""Fits ARMAX, OE and BJ models with thetahat and with sippy-unipi to the same signals, by turns, and prints the ratios
of their times and of their costs.

Usage: prediction_error.py THETAHAT_PREDICTION_ERROR FOLDER (the program, and a folder for the signals); `run` calls it.
It fails on errors, and on costs of which one is not what its parameters give or which are far apart, not on a ratio
that is missed.
"""

import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version

from compare import ask, print_table, processor, start, verdict

os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

import numpy
from scipy.signal import lfilter

# sippy-unipi imports these two at the first fit; here they are not part of its time.
from sippy_unipi import armaxMIMO, io_optMIMO, system_identification  # noqa: F401

SAMPLES = 10_000
MANY = 1_000_000

# A fit to MANY samples takes at most this many times as long as one to SAMPLES.
GROWTH = 120

ROUNDS = 20

# A cost is not above another if it is above by no more than this fraction: a search of ours ends when the next step
# would lower the cost by less.
TOLERANCE = 1e-8

# Costs that lie further apart than this fraction are not costs of the same fit.
AGREEMENT = 0.05

# The peers of each structure: what sippy-unipi is called with, in how many rounds it takes part (an optimiser needs
# seconds), and how many times as fast we must be. Its delay counts from 1: its 0 is our nk = 1.
PEERS = {
    "armax": {
        "iterative least squares": ({"ARMAX_orders": [2, 2, 2, 0], "ARMAX_mod": "ILLS"}, ROUNDS, 50),
        "optimiser": ({"ARMAX_orders": [2, 2, 2, 0], "ARMAX_mod": "OPT"}, 2, 300),
    },
    "oe": {"optimiser": ({"OE_orders": [2, 2, 0], "OE_mod": "OPT"}, 2, 300)},
    "bj": {"optimiser": ({"BJ_orders": [2, 2, 2, 2, 0]}, 2, 1000)},
}

NAMES = {"armax": "ARMAX(2, 2, 2, 1)", "oe": "OE(2, 2, 1)", "bj": "BJ(2, 2, 2, 2, 1)"}

PACKAGES = ["sippy-unipi", "casadi", "NumPy", "SciPy"]


def main():
    program, folder = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    subprocess.run([program, "write", folder], check=True)
    print_versions()
    rows = [["work", "peer", "thetahat", "peer's", "ratio", "required", "verdict"]]
    with start(program, "serve", folder) as server:
        for method in PEERS:
            rows += compare(server, folder, method)
        for method in PEERS:
            rows.append(compare_lengths(server, method))
    print_table(rows)


def print_versions():
    """The libraries and the processor."""
    names = [f"{name} {version(name)}" for name in PACKAGES]
    rustc = subprocess.check_output(["rustc", "--version"], text=True).strip()
    print(*names, rustc, f"Python {platform.python_version()}", sep=", ")
    print(f"{processor()}, {os.cpu_count()} processors", end="\n\n", flush=True)


def compare(server, folder, method):
    """The rows of one structure: times, then costs."""
    u, y = (numpy.fromfile(os.path.join(folder, f"{name}.f64"), count=SAMPLES) for name in ("input", method))
    best, costs = {}, {}
    for turn in range(ROUNDS):
        # Twice: the turn before has filled the caches with other data.
        for _ in range(2):
            seconds, mse, *parameters = request(server, method, SAMPLES)
            keep_least(best, "thetahat", seconds)
        for name, (arguments, rounds, _) in PEERS[method].items():
            if turn < rounds:
                begin = time.perf_counter()
                model = system_identification(y, u, method.upper(), **arguments)
                keep_least(best, name, time.perf_counter() - begin)
                costs[name] = cost(method, sippy_polynomials(method, model), y, u)
    ours = cost(method, our_polynomials(method, parameters), y, u)
    if not abs(mse - ours) <= TOLERANCE * ours:
        sys.exit(f"{method}: thetahat says that its cost is {mse}, its parameters give {ours}")
    rows = [
        timing(f"{NAMES[method]}, N = {SAMPLES:,}", name, best["thetahat"], best[name], required)
        for name, (_, _, required) in PEERS[method].items()
    ]
    return rows + [cost_row(method, name, ours, theirs) for name, theirs in costs.items()]


def request(server, method, samples):
    """The numbers of the program's answer."""
    return [float(word) for word in ask(server, method, samples).split()]


def keep_least(best, name, seconds):
    best[name] = min(seconds, best.get(name, seconds))


def our_polynomials(method, parameters):
    """A, B, C, D and F of our estimate. The parameters come in this order."""
    ends = {"armax": [2, 4, 6, 6], "oe": [0, 2, 2, 2], "bj": [0, 2, 4, 6]}
    a, b, c, d, f = numpy.split(numpy.array(parameters), ends[method])
    return {
        "A": numpy.concatenate([[1], a]),
        "B": numpy.concatenate([[0], b]),
        "C": numpy.concatenate([[1], c]),
        "D": numpy.concatenate([[1], d]),
        "F": numpy.concatenate([[1], f]),
    }


def sippy_polynomials(method, model):
    """A, B, C, D and F of a model of sippy-unipi, which gives the two transfer functions B/(A F) and C/(A D)."""
    names = ["NUMERATOR", "DENOMINATOR", "NUMERATOR_H", "DENOMINATOR_H"]
    b, plant, c, noise = (numpy.ravel(getattr(model, name)) for name in names)
    # The numerator begins with the weight of u(t-1).
    b, one = numpy.concatenate([[0], b]), numpy.ones(1)
    if method == "armax":
        return {"A": plant, "B": b, "C": c, "D": one, "F": one}
    return {"A": one, "B": b, "C": c, "D": noise, "F": plant}


def cost(method, polynomials, y, u):
    """The mean of e^2, e = D/C (A y - B/F u): the same computation for both sides.

    All samples before the first are zero, as they were where the data come from. Without F the errors begin, from
    zero, at the first sample with a full regressor: neither side counts the samples before it.
    """
    a, b, c, d, f = (polynomials[name] for name in "ABCDF")
    disturbance = lfilter(a, [1], y) - lfilter(b, f, u)
    if method == "armax":
        disturbance = disturbance[2:]
    return numpy.mean(lfilter(d, c, disturbance) ** 2)


def cost_row(method, name, ours, theirs):
    """The row that compares two costs."""
    if not abs(theirs - ours) <= AGREEMENT * ours:
        sys.exit(f"{method}: the cost of the {name} of sippy-unipi is {theirs}, that of thetahat {ours}")
    cells = [f"{ours:.8f}", f"{theirs:.8f}", f"{theirs / ours:.8f}"]
    met = ours <= theirs * (1 + TOLERANCE)
    return ["its mean square error", f"sippy-unipi, {name}", *cells, "not above", verdict(met)]


def compare_lengths(server, method):
    """The row that compares the times for many samples and for fewer."""
    best = {}
    for _ in range(5):
        for samples in (SAMPLES, SAMPLES, MANY):
            keep_least(best, samples, request(server, method, samples)[0])
    few, many = best[SAMPLES], best[MANY]
    times = [f"{many * 1e3:.2f} ms", f"{few * 1e3:.2f} ms", f"1/{many / few:.0f}"]
    met = many <= GROWTH * few
    return [f"{NAMES[method]}, N = {MANY:,}", f"itself, N = {SAMPLES:,}", *times, f"at least 1/{GROWTH}", verdict(met)]


def timing(work, name, ours, theirs, required):
    """A row of the table."""
    ratio = theirs / ours
    times = [f"{ours * 1e3:.2f} ms", f"{theirs * 1e3:,.0f} ms", f"{ratio:,.0f}"]
    return [work, f"sippy-unipi, {name}", *times, f"at least {required:,}", verdict(ratio >= required)]


if __name__ == "__main__":
    main()

"""Fits the models of reference_cases.json with SciPy, written apart from thetahat, and compares: python reference_cases.py

A y = B/F u + C/D e. Signals are without their means over the rows. ARX and ARMAX leave out the samples before the first
full regressor and have e = 0 there; the others start from zero. Standard errors count on white residuals.
"""

import json
import os
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

HERE = Path(__file__).parent
FOLDERS = [HERE, *map(Path, filter(None, [os.environ.get("THETAHAT_LOGS")]))]


def signals(case, path):
    """The output and the inputs."""
    table = np.genfromtxt(path, delimiter=",", names=True)[case["rows"][0] - 1 : case["rows"][1]]
    columns = [table[name] - table[name].mean() for name in [case["output"], *case["inputs"]]]
    return columns[0], columns[1:]


def polynomials(case, theta):
    """A, B of each input (behind its delay), C, D, F of each input, by their coefficients."""
    na, nb, nc, nd, nf, nk = case["orders"]
    inputs = range(len(case["inputs"]))
    rest = list(theta)

    def take(count):
        taken, rest[:] = rest[:count], rest[count:]
        return taken

    a = [1, *take(na)]
    b = [[0] * nk + take(nb) for _ in inputs]
    c, d = [1, *take(nc)], [1, *take(nd)]
    return a, b, c, d, [[1, *take(nf)] for _ in inputs]


def errors(case, theta, y, inputs):
    """The prediction errors that count."""
    na, nb, _, _, _, nk = case["orders"]
    a, b, c, d, f = polynomials(case, theta)
    left = lfilter(a, 1, y) - sum(lfilter(b, f, u) for b, f, u in zip(b, f, inputs))
    if case["model"] in ("arx", "armax"):
        left = left[max(na, nb + nk - 1) :]
    with np.errstate(all="ignore"):
        return np.nan_to_num(lfilter(d, c, left), nan=1e9, posinf=1e9, neginf=-1e9)


def search(case, start, y, inputs):
    def cost(theta):
        return np.clip(errors(case, theta, y, inputs), -1e9, 1e9)

    return least_squares(cost, start, method="lm", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=2000)


def starts(case, y, inputs):
    """An ARX model of the same size; where there is F, also those of prefiltered signals (Steiglitz and McBride)."""
    na, nb, nc, nd, nf, nk = case["orders"]
    order = na or nf
    a = np.array([1.0])
    for _ in range(1 if na else 12):
        filtered = lfilter([1], a, y), [lfilter([1], a, u) for u in inputs]
        arx = {**case, "model": "arx", "orders": [order, nb, 0, 0, 0, nk]}
        at = np.zeros(order + nb * len(inputs))
        at = search(arx, at, *filtered).x
        a = np.concatenate([[1.0], at[:order]])
        b = at[order:]
        f = np.tile(at[:order], len(inputs)) if nf else []
        yield np.concatenate([at[:na], b, np.zeros(nc), np.zeros(nd), f])
        if nd:
            left = errors({**case, "orders": [0, nb, 0, 0, nf, nk]}, np.concatenate([b, f]), y, inputs)
            past = np.column_stack([np.concatenate([np.zeros(k + 1), left[: -k - 1]]) for k in range(nd)])
            d = -np.linalg.lstsq(past, left, rcond=None)[0]
            yield np.concatenate([b, np.zeros(nc), d, f])


def fitted(case, path):
    """The parameters of the lowest minimum from all starts, their standard errors, and the mean square of the errors."""
    y, inputs = signals(case, path)
    found = min((search(case, start, y, inputs) for start in starts(case, y, inputs)), key=lambda found: found.cost)
    count, size = len(found.fun), len(found.x)
    covariance = np.linalg.inv(found.jac.T @ found.jac) * 2 * found.cost / (count - size)
    return found.x, np.sqrt(np.diag(covariance)), 2 * found.cost / count


def main():
    for case in json.loads((HERE / "reference_cases.json").read_text()):
        name = f"{case['file']} {case['model']} {case['orders']}"
        path = next((folder / f"{case['file']}.csv" for folder in FOLDERS if (folder / f"{case['file']}.csv").exists()), None)
        if path is None:
            print(f"{name}: the log is absent")
            continue
        theta, se, mse = fitted(case, path)
        away = np.max(np.abs(theta / case["theta"] - 1))
        print(f"{name}: parameters {away:.1e}, standard errors {np.max(np.abs(se / case['se'] - 1)):.1e}, mse {mse / case['mse'] - 1:+.1e}")


if __name__ == "__main__":
    main()

"""The exact likelihood of ARMA models of public logs, by statsmodels' SARIMAX: python sarimax_cases.py

Prints what the tests of `estimate::exact` compare with: parameters in the order a, c (statsmodels' ar has the other sign), the
variance of e, its maximum-likelihood estimate, and the log-likelihood. Signals are without the mean of what is measured. The
search of statsmodels is followed by Newton steps with differences of fourth order, until the gradient is rounding.
"""

from pathlib import Path

import numpy as np
import statsmodels
from statsmodels.tsa.statespace.sarimax import SARIMAX

HERE = Path(__file__).parent


def measured(name, holes, mean):
    """The output of a log, with every sample t missing for which 7 t^3 mod 23 < 7 where there are to be holes."""
    y = np.genfromtxt(HERE / f"{name}.csv", delimiter=",", names=True)["y"]
    t = np.arange(len(y))
    if holes:
        y[7 * t**3 % 23 < 7] = np.nan
    return y - np.nanmean(y) if mean else y


def slope(model, at):
    """The gradient of the log-likelihood."""
    found = []
    for i in range(len(at)):
        step = np.zeros(len(at))
        step[i] = 1e-3 * max(abs(at[i]), 1e-3)
        near, far = (model.loglike(at + k * step) - model.loglike(at - k * step) for k in (1, 2))
        found.append((8 * near - far) / 12 / step[i])
    return np.array(found)


def fitted(y, order, trend):
    # A line with ARMA errors about it, through the middle of the log.
    t = np.arange(len(y)) - (len(y) - 1) / 2
    line = np.column_stack([t**power for power in range(trend)]) if trend else None
    model = SARIMAX(y, exog=line, order=(order[0], 0, order[1]), concentrate_scale=True)
    found = model.fit(disp=0, method="lbfgs", maxiter=500, pgtol=1e-12, factr=10).params
    for _ in range(5):
        apart = np.diag(1e-4 * np.maximum(np.abs(found), 1e-3))
        curvature = np.array([(slope(model, found + h) - slope(model, found - h)) / 2 / h.max() for h in apart])
        found = found - np.linalg.solve(curvature, slope(model, found))
    result = model.smooth(found)
    return found, result.scale, result.llf, np.abs(slope(model, found)).max()


if __name__ == "__main__":
    print(f"statsmodels {statsmodels.__version__}")
    for name, order, trend in [
        ("nile", (1, 1), 0),
        ("sunspots", (1, 1), 0),
        ("sunspots", (2, 0), 0),
        ("sunspots", (2, 1), 0),
        ("sunspots", (2, 1), 2),
    ]:
        for holes in (False, True):
            found, scale, llf, left = fitted(measured(name, holes, trend == 0), order, trend)
            a, c = -found[trend : trend + order[0]], found[trend + order[0] :]
            print(f"{name} {order} holes {holes}, line {[*map(float, found[:trend])]}, gradient {left:.0e}")
            print(f"  {[*map(float, a), *map(float, c)]}, {float(scale)!r}, {float(llf)!r}")

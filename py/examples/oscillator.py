# %% [markdown]
# # An oscillator with a hard spring: from a line to a free run that holds
#
# A mass on a spring that gets stiffer the further it is drawn, m y'' + d y' + k y + k3 y^3 = u: the plant of the Silverbox benchmark
# (Wigren and Schoukens 2013), an electronic circuit. A linear model misses how the resonance moves with the amplitude. This notebook goes
# from there to models trained for their free run.
#
# With the measured log of the benchmark (columns u and y in volts, from nonlinearbenchmark.org) as a CSV file in the environment variable
# `SILVERBOX` it takes that, in some minutes, and ends below 0.25 mV. Without it the plant is simulated with the values that are known of it.

# %%
import os
import warnings
from typing import Any

import numpy as np

import thetahat as th
from thetahat import plot

# %% [markdown]
# ## The log
#
# Simulated, the input is low-pass noise at 610 Hz; between two samples the plant is integrated in 20 steps (leapfrog). The sensor has
# noise of 0.2 mV. The first 4000 rows are for the fit, the last 2000 for the evaluation. Of the measured log the first nine realisations of
# the multisine are for the fit, and the last one is for the evaluation.


# %%
def oscillator(rows: int, seed: int = 0) -> th.Log:
    rng = np.random.default_rng(seed)
    m, d, k, k3 = 1.09e-5, 2.13e-4, 1.0, 3.99
    period, steps = 1 / 610.35, 20
    u = np.convolve(rng.normal(size=rows + 8), np.ones(9) / 9, mode="valid") * 0.12
    position, speed, step, y = 0.0, 0.0, period / steps, np.empty(rows)
    for row in range(rows):
        y[row] = position
        for _ in range(steps):
            speed += step * (u[row] - d * speed - k * position - k3 * position**3) / m
            position += step * speed
    return th.Log(y + 2e-4 * rng.normal(size=rows), u, sample_time=period)


measured = os.environ.get("SILVERBOX")
lags: dict[str, Any]
if measured:
    log = th.read_csv(measured, inputs="u", output="y", sample_time=1 / 610.35)
    known, fresh, lags, terms = log[40650:105712], log[105712:127400], {"ny": 3, "nu": 3, "nk": 0}, 20
else:
    log = oscillator(6000)
    known, fresh, lags, terms = log[:4000], log[4000:], {"ny": 2, "nu": 2, "nk": 1}, 12


def free_run(model: th.Model) -> float:
    """The root mean square error of the free run on the fresh rows, in millivolts."""
    fits = model.validate(fresh).document["fit"]
    return 1e3 * float(next(fit["rmse"] for fit in fits if fit["horizon"]["kind"] == "free-run"))


# %% [markdown]
# ## A line
#
# ARX is the least squares of the next output. Output error is the linear model that simulates best.

# %%
warnings.simplefilter("ignore", th.EstimationWarning)
arx, line = th.arx(known, na=2, nb=2), th.oe(known, nb=2, nf=2)
print(f"{arx.name}: {free_run(arx):.3f} mV, {line.name}: {free_run(line):.3f} mV")

# %% [markdown]
# ## Products, one step ahead and trained
#
# Products of degree 3 or less, chosen by forward regression. Their parameters have the least errors one step ahead; trained, the
# least errors of the free run.

# %%
ahead = th.narx(known, degree=3, terms=terms, **lags)
products = th.narx(known, degree=3, terms=terms, focus="simulation", **lags)
print(f"one step ahead: {free_run(ahead):.3f} mV, trained for the free run: {free_run(products):.3f} mV")

# %% [markdown]
# ## A network
#
# Eight units, with next to no ridge as rows are many. The same network trained one step ahead drifts off when it runs alone.

# %%
drifting = th.narx(known, "tanh", units=8, ridge=1e-3, starts=1, focus="prediction", **lags)
network = th.narx(known, "tanh", units=8, ridge=1e-3, starts=1, **lags)
print(f"one step ahead: {free_run(drifting):.3f} mV, trained for the free run: {free_run(network):.3f} mV")

# %%
plot.fit(network, fresh[:400], horizon=None)

# %% [markdown]
# ## What was learnt
#
# The noise is 0.2 mV: a free run cannot be nearer to the measured output than that. ARX takes the noise of the sensor for that of the plant.

# %%
assert free_run(products) < 0.3 and free_run(network) < 0.3
assert free_run(products) < free_run(ahead) and free_run(network) < free_run(drifting)
assert free_run(arx) > free_run(line) > 5 * free_run(network)
assert not measured or max(free_run(products), free_run(network)) < 0.25

# %% [markdown]
# # Fixed and free bases: the error against the number of parameters
#
# How many parameters does it take to come near a function? With functions that are fixed beforehand the error falls like n^(-s/d) for
# functions with s derivatives of d variables: each variable more asks for many more of them. Where the functions themselves are fitted,
# as in a network whose hidden layer is trained, the squared error falls like 1/n whatever d is, for functions that are not too rough
# (Barron 1993, Universal approximation bounds for superpositions of a sigmoidal function).
#
# Here the same function g of d = 1, 2 and 4 variables is fitted by products and by radial basis functions with random centres (fixed),
# and by tanh units and radial basis functions that are trained (free).

# %%
import math
import warnings
from collections.abc import Iterable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import thetahat as th

warnings.simplefilter("ignore", th.EstimationWarning)

# %% [markdown]
# ## The function
#
# g(x) = tanh(4 s) + exp(-4 s^2)/2 with s = (x_1 + ... + x_d)/sqrt(d) - 0.2, over the cube from -1 to 1, without noise. It bends along
# one direction alone, whatever d is: a network can know that, and fixed functions cannot.


# %%
def samples(dimensions: int, rows: int, seed: int) -> th.Log:
    x = np.random.default_rng(seed).uniform(-1, 1, (rows, dimensions))
    s = x.sum(axis=1) / np.sqrt(dimensions) - 0.2
    return th.Log(np.tanh(4 * s) + 0.5 * np.exp(-4 * s**2), x, sample_time=1)


def error(known: th.Log, fresh: th.Log, basis: Any, **options: Any) -> tuple[int, float]:
    """The number of parameters of a fit, and its root mean square error on fresh samples, relative to the deviation of g."""
    dimensions = len(known.inputs)
    model = th.narx(known, basis, ny=0, nu=[1] * dimensions, nk=[0] * dimensions, detrend="none", **options)
    count = int(model.document["estimation"]["maps"][0]["path"][-1]["parameters"])
    fit = next(fit for fit in model.validate(fresh).document["fit"] if fit["horizon"]["kind"] == "steps")
    return count, float(fit["rmse"]) / float(np.std(fresh.y))


# %%
def fits(known: th.Log, fresh: th.Log) -> dict[str, list[tuple[int, float]]]:
    d = len(known.inputs)
    # Of few variables more of them are sums of each other, but for rounding.
    drawn = {1: (2, 4, 8), 2: (4, 16, 48), 4: (4, 16, 64, 256)}[d]

    def each(basis: str, choices: Iterable[dict[str, Any]]) -> list[tuple[int, float]]:
        return [error(known, fresh, basis, **options) for options in choices]

    def trained(*counts: int) -> list[dict[str, Any]]:
        return [{"units": units, "ridge": 1e-6, "starts": 2} for units in counts]

    return {
        "products (fixed)": each("poly", ({"degree": p, "terms": math.comb(d + p, p)} for p in (1, 2, 3, 5))),
        "radial, drawn (fixed)": each("rbf", ({"centres": f"random:{n}", "terms": n + d + 1, "seed": 1} for n in drawn)),
        "tanh, trained (free)": each("tanh", trained(1, 2, 3, 4)),
        "radial, trained (free)": each("rbf-free", trained(1, 2, 4)),
    }


found: dict[int, dict[str, list[tuple[int, float]]]] = {}
for dimensions in (1, 2, 4):
    found[dimensions] = fits(samples(dimensions, 1000, 0), samples(dimensions, 1000, 1))
    print(f"{dimensions} variables")
    for name, points in found[dimensions].items():
        print(f"  {name:24}", "  ".join(f"{count:4}: {100 * relative:7.3f} %" for count, relative in points))

# %%
figure, axes = plt.subplots(1, 3, figsize=(12, 4), sharey=True)
for axis, (dimensions, curves) in zip(axes, found.items()):
    for name, points in curves.items():
        axis.loglog(*zip(*points), "o-" if "free" in name else "s--", label=name)
    axis.set(title=f"{dimensions} variables", xlabel="parameters")
axes[0].set_ylabel("error / deviation of g")
axes[0].legend()

# %% [markdown]
# ## What was learnt
#
# Of one variable any basis will do. Of four, products and drawn functions need hundreds of parameters to come where a few trained units are.


# %%
def least(dimensions: int, name: str, most: int) -> float:
    """The least error with so many parameters."""
    return min(relative for count, relative in found[dimensions][name] if count <= most)


assert least(4, "tanh, trained (free)", 50) < 0.1 * min(least(4, "products (fixed)", 500), least(4, "radial, drawn (fixed)", 500))

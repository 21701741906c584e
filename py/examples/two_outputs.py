# %% [markdown]
# # Several outputs: from a log to a controller
#
# The arm of a CD player is moved by two forces and measured in two directions; an evaporator has three inputs and three outputs. Each is one
# plant with shared states, not several. This notebook goes from a log to a state-space model, evaluates it on held-out rows, and
# hands it to python-control for a linear-quadratic Gaussian design.
#
# The logs are those of [DaISy](https://homes.esat.kuleuven.be/~smc/daisy/) (B. De Moor and others, K. U. Leuven). Where the environment
# variables `CD_PLAYER_ARM` and `EVAPORATOR` name them as CSV files with columns u1, u2, … and y1, y2, …, they are read; else a plant of
# the same size is simulated.

# %%
import os

import control
import numpy as np

import thetahat as th
from thetahat import plot

# %% [markdown]
# ## The logs


# %%
def simulated(seed: int, states: int, inputs: int, outputs: int, rows: int = 2048) -> th.Log:
    """Lightly damped modes, driven by white inputs and process noise, seen by noisy sensors."""
    rng = np.random.default_rng(seed)
    F = np.zeros((states, states))
    for mode in range(0, states, 2):
        radius, angle = rng.uniform(0.85, 0.97), rng.uniform(0.1, 2.5)
        turn = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        F[mode : mode + 2, mode : mode + 2] = turn
    G, H = rng.normal(size=(states, inputs)), rng.normal(size=(outputs, states))
    u = rng.normal(size=(rows, inputs))
    x, y = np.zeros(states), np.zeros((rows, outputs))
    for k in range(rows):
        y[k] = H @ x + 0.3 * rng.normal(size=outputs)
        x = F @ x + G @ u[k] + 0.1 * rng.normal(size=states)
    return th.Log(y, u, sample_time=1.0)


def opened(variable: str, channels: int, seed: int, states: int) -> th.Log:
    path = os.environ.get(variable)
    if path is None:
        return simulated(seed, states, channels, channels)
    names = range(1, channels + 1)
    return th.read_csv(path, inputs=[f"u{k}" for k in names], output=[f"y{k}" for k in names], sample_time=1.0)


arm, evaporator = opened("CD_PLAYER_ARM", 2, 1, 6), opened("EVAPORATOR", 3, 2, 4)

# %% [markdown]
# ## The models
#
# The first half is for the fit, the second for the evaluation. The order is that of the least description length. The CD player was measured in
# closed loop and its arm acts within a sample: with a controller that does so too the data alone cannot tell, so it is asked for.


# %%
def identified(log: th.Log, feedthrough: bool | None) -> th.Model:
    half = len(log) // 2
    model = th.ss(log, feedthrough=feedthrough, estimate=slice(0, half))
    found = model.validate(log, rows=slice(half, len(log)), horizon=5)
    for output in model.outputs:
        ahead = [f"{found.fit(steps, output=output):.1f} %" for steps in (1, 5, None)]
        print(f"{output}: {', '.join(ahead)} (one step, five steps, free run)")
    print(model.name, "stable" if model.stable else "unstable")
    return model


real = "CD_PLAYER_ARM" in os.environ
arm_model = identified(arm, True if real else None)
evaporator_model = identified(evaporator, None)
assert arm_model.stable and evaporator_model.stable

# %% [markdown]
# Where inputs and outputs go, pair by pair:

# %%
for output in arm_model.outputs:
    for name in arm_model.inputs:
        plot.step(arm_model, name, 60, output=output)

# %% [markdown]
# ## The controller
#
# `to_control()` gives python-control its `StateSpace` with the names of the channels. The gain of the linear-quadratic regulator comes from
# there; the gain of the estimator is in the model already, as K: it is that of the Kalman filter for the noise of the log.



# %%
def lqg(model: th.Model, effort: float) -> float:
    """The largest modulus of a pole of the closed loop with an observer, and of the plant."""
    plant, form = model.to_control(), model.to_state_space()
    # Outputs in units of their noise.
    seen = form.H / np.sqrt(np.diag(form.noise_covariance))[:, np.newaxis]
    weights = seen.T @ seen
    gain, _, _ = control.dlqr(plant.A, plant.B, weights, effort * np.eye(plant.ninputs))
    F, G, H, D, K = form.F, form.G, form.H, form.D, form.K
    # u = -L x^, x^(t+1) = F x^ + G u + K (y - H x^ - D u).
    direct = np.zeros((gain.shape[0], K.shape[1]))
    observer = control.ss(F - K @ H - (G - K @ D) @ gain, K, -gain, direct, model.sample_time)
    loop = control.feedback(plant, observer, sign=1)
    poles = np.abs(loop.poles())
    expected = np.concatenate([np.abs(np.linalg.eigvals(F - G @ gain)), np.abs(np.linalg.eigvals(F - K @ H))])
    # The separation theorem: those of the regulator and those of the estimator.
    assert np.allclose(np.sort(poles), np.sort(expected), atol=1e-4)
    return float(poles.max())


for name, model in (("arm", arm_model), ("evaporator", evaporator_model)):
    slowest = lqg(model, 1e-2 * np.trace(model.to_state_space().G.T @ model.to_state_space().G))
    print(f"{name}: the largest pole is {np.abs(model.poles()).max():.3f} without and {slowest:.3f} with the controller")
    assert slowest < 1

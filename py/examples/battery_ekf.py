# %% [markdown]
# # A battery cell: state and parameters at once
#
# How full is a cell, and how worn? Neither can be measured while it works. What is measured is the current and the
# voltage. The state of charge is a state; the resistances are parameters, which drift with temperature and age. An
# extended Kalman filter can estimate both together: the parameters become states that hardly move.
#
# The cell is simulated here, so that the estimates can be compared with the truth.

# %%
from statistics import NormalDist

import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt

import thetahat as th

Array = npt.NDArray[np.float64]

# %% [markdown]
# ## The cell
#
# With the current i (positive: discharge), the charge s between 0 and 1 and the voltage v over one RC pair:
#
#     s(k+1) = s(k) - i(k) T/Q
#     v(k+1) = c v(k) + R1 (1 - c) i(k),   c = exp(-T/tau)
#     y(k)   = ocv(s(k)) - R0 i(k) - v(k)
#
# R0 is the series resistance, R1 and tau are those of the pair, and ocv is the voltage at rest, known from the data
# sheet. The unknowns R0, R1 and tau enter by their logarithms: they stay positive, and the standard deviation of a
# logarithm is a relative error. The state is x = (s, v, ln R0, ln R1, ln tau).
#
# A model is two functions, of the state and the input. Their Jacobians are found by differences; they can be given too.

# %%
sample_time, charge = 1.0, 7200.0  # seconds, and ampere seconds: 2 Ah


def ocv(s: float) -> float:
    """The voltage at rest."""
    return float(3.25 + 0.75 * s - 0.25 * np.exp(-15 * s) + 0.15 * s**4)


def move(x: Array, u: Array) -> Array:
    """The state one second later."""
    decay = np.exp(-sample_time / np.exp(x[4]))
    return np.array(
        [
            x[0] - u[0] * sample_time / charge,
            decay * x[1] + np.exp(x[3]) * (1 - decay) * u[0],
            x[2],
            x[3],
            x[4],
        ]
    )


def measure(x: Array, u: Array) -> Array:
    """The voltage at the poles."""
    return np.array([ocv(x[0]) - np.exp(x[2]) * u[0] - x[1]])


# %% [markdown]
# ## An hour of pulses
#
# The current has to move, or there is nothing to learn: at rest R0 does not show, and without rests R1 and tau do not.
# The cell warms up as it works, and R0 falls from 50 to 43 milliohms. The voltmeter has a noise of 2 mV.

# %%
rng = np.random.default_rng(7)
count = 3600
levels = rng.choice([0.0, 0.0, 0.5, 1.0, 2.0, 4.0, -1.0], 200)
current = np.repeat(levels, rng.integers(5, 60, 200))[:count]
time = sample_time * np.arange(count)
series_resistance = 0.043 + 0.007 * np.exp(-time / 1500)
truth = np.empty((count, 5))
voltage = np.empty(count)
x = np.array([0.9, 0.0, 0.0, np.log(0.030), np.log(40.0)])
state_noise = np.array([1e-6, 1e-4])
for k in range(count):
    x[2] = np.log(series_resistance[k])
    truth[k] = x
    voltage[k] = measure(x, current[k : k + 1])[0] + 2e-3 * rng.normal()
    x = move(x, current[k : k + 1])
    x[:2] += state_noise * rng.normal(size=2)

# %% [markdown]
# ## The filter
#
# The noise of the model says how fast each state may leave the path of the equations. For the parameters this is what
# makes them a random walk: with no noise the filter would at some time believe that it knows them, and never learn again.
# R0 is given 0.1 % each second, the others a tenth of that.
#
# The start is wrong on purpose: 10 % of charge too few, R0 and tau too large, R1 too small. The covariance says honestly
# that this is how wrong it may be.

# %%
walk = np.array([1e-3, 1e-4, 1e-4])
transition = th.NonlinearTransition(move, np.diag(np.concatenate([state_noise, walk]) ** 2))
observation = th.NonlinearObservation(measure, [[2e-3**2]])
start = np.array([0.8, 0.0, np.log(0.080), np.log(0.020), np.log(60.0)])
start_deviations = np.array([0.1, 0.01, 0.5, 0.5, 0.5])
estimator = th.ExtendedKalmanFilter(start, np.diag(start_deviations**2))
run = estimator.run(transition, observation, voltage, inputs=current)
deviations = np.sqrt(np.diagonal(run.filtered_covariances, axis1=1, axis2=2))

# %%
names = ["state of charge", "voltage of the pair [V]", "R0 [ohm]", "R1 [ohm]", "tau [s]"]
figure, axes = plt.subplots(5, 1, sharex=True, figsize=(8, 11), layout="constrained")
for index, (ax, name) in enumerate(zip(axes, names)):
    middle = run.filtered_states[:, index]
    half = NormalDist().inv_cdf(0.975) * deviations[:, index]
    curves = [truth[:, index], middle, middle - half, middle + half]
    if index >= 2:
        curves = [np.exp(curve) for curve in curves]
    ax.plot(time, curves[0], color="0.4", label="truth")
    ax.plot(time, curves[1], label="estimate")
    ax.fill_between(time, curves[2], curves[3], alpha=0.2, label="95 % band")
    ax.set_ylabel(name)
    # The first seconds would fill the picture.
    low, high = np.min(curves[0]), np.max(curves[0])
    margin = 0.5 * (high - low) + 0.2 * abs(high)
    ax.set_ylim(low - margin, high + margin)
axes[0].legend()
axes[-1].set_xlabel("time [s]")

# %%
for index, name in enumerate(["R0", "R1", "tau"], 2):
    estimate, true = np.exp(run.filtered_states[-1, index]), np.exp(truth[-1, index])
    print(f"{name}: {estimate:.4g} ± {100 * deviations[-1, index]:.1f} %, truth {true:.4g}")
print(f"state of charge: {run.filtered_states[-1, 0]:.4f} ± {deviations[-1, 0]:.4f}, truth {truth[-1, 0]:.4f}")

# %% [markdown]
# The standard deviations are small because the simulated cell follows the equations. Of a real one, ocv and the charge Q
# are not known so well, and then the state of charge is not either.
#
# ## Does the filter know what it does not know?
#
# In the field there is no truth to compare with. But each measurement is an exam: the filter says what it expects and
# with what variance. The normalised innovation squared (NIS) is the error squared over that variance. It should be 1 on
# average. Its mean over N samples lies within 1 ± 1.96 sqrt(2/N) in 95 of 100 runs, if the model is right and the filter
# honest.

# %%
settled = slice(600, count)
number = count - 600
bound = NormalDist().inv_cdf(0.975) * np.sqrt(2 / number)
nis = float(np.mean(run.nis[settled]))
print(f"mean NIS {nis:.3f}, expected 1 ± {bound:.3f}")

# %% [markdown]
# ## A filter that is too sure
#
# The same filter with the same wrong start, but with small covariances and parameters that may not move. It believes its
# start. It puts the error of the resistance into the state of charge, and its own standard deviation says that all is
# well. The NIS says that it is not.

# %%
fixed = th.NonlinearTransition(move, np.diag(np.concatenate([state_noise, np.zeros(3)]) ** 2))
sure = th.ExtendedKalmanFilter(start, np.diag(np.array([0.01, 0.01, 0.005, 0.005, 0.005]) ** 2))
wrong = sure.run(fixed, observation, voltage, inputs=current)
wrong_nis = float(np.mean(wrong.nis[settled]))
wrong_resistance = float(np.exp(wrong.filtered_states[-1, 2]))
wrong_deviation = float(np.sqrt(wrong.filtered_covariances[-1, 2, 2]))
print(f"R0 {wrong_resistance:.4f} ± {100 * wrong_deviation:.2f} %, truth {np.exp(truth[-1, 2]):.4f}, mean NIS {wrong_nis:.1f}")

# %%
figure, ax = plt.subplots()
window = np.full(200, 1 / 200)
ax.plot(time[199:], np.convolve(run.nis, window, mode="valid"), label="honest")
ax.plot(time[199:], np.convolve(wrong.nis, window, mode="valid"), label="too sure")
half_width = NormalDist().inv_cdf(0.975) * np.sqrt(2 / 200)
ax.axhspan(1 - half_width, 1 + half_width, alpha=0.2, label="95 % band")
ax.set_yscale("log")
ax.set_xlabel("time [s]")
ax.set_ylabel("mean NIS of 200 s")
ax.legend()

# %% [markdown]
# ## What to be careful of
#
# Joint estimation makes even a linear model nonlinear, since a parameter multiplies a state. The filter linearises about
# its own estimate. Ljung (Asymptotic behavior of the extended Kalman filter as a parameter estimator for linear systems,
# 1979) showed that its parameters can then be biased, where the noises are not as assumed, and that it can diverge. The
# reason is that the gain depends on the parameters too, and the filter does not know of that. The standard deviations are
# what the linearised model believes, so they may promise too much. What helps: start near, say honestly how uncertain the
# start and the noises are, make the input move, and watch the NIS. A prediction error method has no such bias: on a log,
# fit a model instead.

# %% [markdown]
# ## What was learnt

# %%
# R0 comes out within 3 %, and its standard deviation says how well, although it drifts.
resistance_errors = run.filtered_states[settled, 2] - truth[settled, 2]
assert abs(resistance_errors[-1]) < 0.03
assert deviations[-1, 2] < 0.03
assert 0.9 < np.mean(np.abs(resistance_errors) < NormalDist().inv_cdf(0.975) * deviations[settled, 2]) <= 1.0
# So do the slower parameters and the charge, within three standard deviations.
assert np.all(np.abs(run.filtered_states[-1] - truth[-1]) < 3 * deviations[-1])
assert abs(run.filtered_states[-1, 0] - truth[-1, 0]) < 0.01
# The filter is honest.
assert abs(nis - 1) < bound
# The one that is too sure is not, and NIS tells.
assert abs(wrong_resistance / np.exp(truth[-1, 2]) - 1) > 5 * wrong_deviation
assert wrong_nis > 1 + 10 * bound

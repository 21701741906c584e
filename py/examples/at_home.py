# %% [markdown]
# # At home among other packages
#
# A model that is known, one that is fitted, frames in and out, and the way to python-control: with types that editors complete.

# %%
from __future__ import annotations

import numpy as np
import pandas as pd

import thetahat as th
from thetahat import plot

# %% [markdown]
# A log of a frame with dates: cut by these, resampled, and back to a frame.

# %%
motor = th.dc_motor()
index = pd.date_range("2026-03-01 08:00", periods=len(motor), freq="10ms", tz="Europe/Berlin")
frame = pd.DataFrame({"voltage": motor["u"], "speed": motor["y"]}, index)
log = th.Log.from_dataframe(frame, inputs="voltage", output="speed")
early = log[:"2026-03-01 08:00:06"]  # the whole second
slow = log.resample("50 ms")
print(early, slow, sep="\n")
axes = log.plot()

# %% [markdown]
# Fits whose options are words that a type checker knows: `initial="zeroo"` would be an error there.

# %%
model = th.arx(early, na=2, nb=2, detrend="mean", initial="drop")
motor_model = th.tf(early, np=2, nz=0)
print(model.params, model.pvalues.max(), model.conf_int(), sep="\n")

# %% [markdown]
# A model of known numbers stands beside them, and python-control's systems are models where models are asked for.

# %%
known = th.Model.from_transfer_function([8100], [1, 50, 430], inputs="voltage", outputs="speed")
comparison = th.compare({"fitted": model, "process": motor_model, "known": known}, log["2026-03-01 08:00:07":])
runs = comparison.to_pandas().query("horizon == inf")
assert runs.loc["fitted", "fit"] > 90
print(runs[["fit", "rmse"]].round(2))
print(motor_model.poles(), motor_model.time_constants(), motor_model.to_control(), sep="\n")

# %% [markdown]
# Predictions of a frame by the names of its channels, and a forecast with its interval.

# %%
predicted = frame.assign(predicted=model.predict(frame))
forecast = model.forecast(early, 50, frame["voltage"].iloc[len(early) : len(early) + 50])
print(forecast.to_pandas().tail(2).round(1))
assert forecast.interval(0.95).shape == (50, 2)
ax = plot.forecast(early, forecast)

# %% [markdown]
# The same model goes on sample by sample: the output first, then the input.

# %%
tracker = th.Tracker(warm=model, forgetting=0.999)
filter = th.StateFilter(model)
for y, u in zip(motor.y[700:900], motor.u[700:900]):
    tracked = tracker.update(y, u)
    estimate = filter.update(y, u)
ahead = np.column_stack([tracker.predict(motor.u[900:910]), filter.predict(motor.u[900:910])])
assert np.abs(ahead - motor.y[900:910, None]).max() < 15

# %% [markdown]
# A search that tells how far it is, and warnings that go to a logger.

# %%
places: list[tuple[int, int | None, float | None]] = []
with th.warnings_as("log"):
    chosen = th.search(early, progress=lambda done, total, best: places.append((done, total, best)))
assert chosen.selection is not None
print(chosen, chosen.selection.to_pandas().head(3), sep="\n")

# %% [markdown]
# Monthly sales with a season: differences of a month and of a year, by exact likelihood, and what comes with its interval.

# %%
rng = np.random.default_rng(0)
months = pd.date_range("2016-01-01", periods=120, freq="MS")
seasons = 8 * np.sin(2 * np.pi * np.arange(12) / 12) + np.cumsum(rng.standard_normal((10, 12)), axis=0)
sales = np.cumsum(0.2 + rng.standard_normal(120)) + seasons.ravel()
series = th.Log(pd.Series(sales, months, name="sales"))
seasonal = th.arima(series, order=(0, 1, 1), seasonal=(0, 1, 1, 12))
year = seasonal.forecast(series, 12)
print(seasonal.params, year.to_pandas().head(3), sep="\n")
ax = plot.forecast(series, year)

# %% [markdown]
# A plant in equations, with a table that a curve is read off: the charge of a battery from its voltage.

# %%
knots, volts = [0.0, 0.5, 1.0], [3.2, 3.65, 4.1]
current = np.where(np.arange(600) % 60 < 30, 2.0, 0.0)
charge = 0.9 - np.concatenate([[0.0], np.cumsum(current[:-1])]) / 3000
voltage = np.interp(charge, knots, volts) - 0.05 * current + 0.002 * rng.standard_normal(600)
cell = th.GreyBox.from_functions(
    sample_time=1,
    states={"charge": (0.9, 0.05)},
    inputs={"current": "i"},
    parameters={"resistance": {"start": 0.02, "sd": 0.02, "unknown": True, "min": 0}},
    next=lambda x, u, p, dt: {"charge": x.charge - dt * u.current / 3000},
    outputs=lambda x, u, p: {"v": th.table(x.charge, knots, volts, method="linear") - p.resistance * u.current},
    measurement={"v": 0.002},
)
battery = th.grey(th.Log(voltage, current, sample_time=1, input_names=["i"], output_name="v"), cell)
assert abs(battery.parameters[0] - 0.05) < 4 * battery.standard_errors[0]

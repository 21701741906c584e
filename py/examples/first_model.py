# %% [markdown]
# # A first model
#
# A DC motor was logged for ten seconds: the voltage on it and the speed of its shaft, a hundred times a second. We want a
# model that predicts the speed from the voltage, and we want to know how far to trust it.
#
# The steps are the ones of every identification: inspect the data, fit, validate on held-out data, use.

# %%
import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import thetahat as th
from thetahat import plot

folder = tempfile.TemporaryDirectory()
path = Path(folder.name, "motor.csv")

# %% [markdown]
# ## A log with something wrong in it
#
# Real logs have holes. We write the log to a file as a logger would have, with two faults. The logger was off from row
# 400 to row 449: these rows are not there. In rows 600 to 604 the tachometer said nothing: the fields are empty.

# %%
clean = th.dc_motor()
rows = ["time,voltage,speed"]
for row, (time, voltage, speed) in enumerate(zip(clean.time, clean.u[:, 0], clean.y)):
    if not 400 <= row < 450:
        rows.append(f"{time:.2f},{voltage},{'' if 600 <= row < 605 else speed}")
path.write_text("\n".join(rows) + "\n")

# %% [markdown]
# ## Inspect before you fit
#
# `inspect` reads the file and says what it found. It sees the hole in the clock and the missing fields. It also finds the
# delay from the correlation of input and output: one sample, as for anything that is sampled and held.

# %%
inspection = th.inspect(path, time="time", inputs="voltage", output="speed")
print(inspection.summary())

# %%
log = th.read_csv(path, time="time", inputs="voltage", output="speed")
print(log)
plot.log(log)

# %% [markdown]
# The lines break at the hole. So do the fits: no equation reaches across it. Nothing was filled in.
#
# ## Fit
#
# The first 700 rows are for the fit. The others stay untouched until the end. We start with the simplest structure, ARX,
# of second order: one pole for the mechanics, one for the winding.

# %%
training, test = log[:700], log[700:]
arx = th.arx(training, na=2, nb=2)
print(arx.summary())

# %% [markdown]
# ## Validate
#
# The fit one step ahead is high, but that says little: the last speed alone is a good guess of the next. Two things say
# more. The free run sees the voltage alone. And what is left, the residuals, should be white: if the errors can be
# predicted, the model has missed something.

# %%
validation = arx.validate(test)
print(f"one step ahead {validation.fit(1):.1f} %, free run {validation.fit(None):.1f} %")
print(f"the residuals are white: p = {validation.whiteness:.1e}")
plot.residuals(validation)

# %% [markdown]
# They are not white. The ARX model lets the noise pass through the motor's own dynamics. The noise of a tachometer does
# no such thing. ARMAX has a polynomial more, C, to describe it. We could search for the orders by hand. `search` tries
# many structures and takes the one with the least MDL, a criterion that makes every parameter pay for itself.

# %%
model = th.search(training)
print(model)
plot.selection(model)

# %% [markdown]
# The fit warns that a pole of A and the zero of C nearly cancel. They cancel in the path from the noise only: the noise
# does not pass through the fast part of the motor. From the voltage the pole is needed, so both stay.

# %%
better = model.validate(test, require=["white", "independent", "stable"])
print(f"one step ahead {better.fit(1):.1f} %, free run {better.fit(None):.1f} %")
print(f"the residuals are white: p = {better.whiteness:.2f}")
print("what is not as required:", better.unmet or "nothing")
plot.fit({"ARX": arx, "chosen": model}, test)

# %% [markdown]
# ## What the model knows of the motor
#
# Two real poles are two time constants. The slow one is the inertia against the friction, the fast one the winding. Each
# comes with a standard error, and so does the gain: how many units of speed a volt makes in the end. Their 95 % intervals
# (`time_constant_intervals`, `dc_gain_interval`) hold near an integrator too, where standard errors say little.

# %%
for constant in model.document["model"]["time_constants"]:
    print(f"time constant {1e3 * constant['value']:.1f} ms, standard error {1e3 * constant['standard_error']:.1f} ms")
gain, gain_error = model.dc_gain()
print(f"gain {gain:.2f}, standard error {gain_error:.2f}")
plot.poles_zeros(model)
plot.step({"ARX": arx, "chosen": model})
plot.bode({"ARX": arx, "chosen": model})

# %% [markdown]
# ## Predict and forecast
#
# A prediction ten steps ahead uses the speed up to then and the voltage after. Its band should hold the measured speed in
# 95 of 100 samples. We count.

# %%
low, high = model.predict_interval(test, horizon=10).T
there = np.isfinite(low) & np.isfinite(test.y)
coverage = float(np.mean((low <= test.y)[there] & (test.y <= high)[there]))
print(f"{100 * coverage:.0f} % of the samples lie in the band")
plot.fit(model, test, horizon=10)

# %% [markdown]
# A forecast goes on after the end of a log. It needs the voltages to come. Here they are known, since we stop before the
# end.

# %%
known, later = test[:200], test[200:230]
forecast = model.forecast(known, len(later), later.u)
lower, upper = forecast.interval().T
figure, ax = plt.subplots()
ax.plot(later.time, later.y, ".", label="measured")
ax.plot(forecast.time, forecast.values, label="forecast")
ax.fill_between(forecast.time, lower, upper, alpha=0.2, label="95 % band")
ax.set_xlabel("time [s]")
ax.set_ylabel("speed")
ax.legend()

# %% [markdown]
# ## Keep
#
# The document holds the model and how it came about. The command line reads it too: `thetahat predict`, `thetahat
# validate`.

# %%
saved = Path(folder.name, "motor.json")
saved.write_text(model.to_json(), encoding="utf-8")
again = th.Model.read(saved)
folder.cleanup()

# %% [markdown]
# ## What was learnt

# %%
# The hole and the missing fields were found.
assert inspection.document["clock"]["gaps"] == 1
assert [channel["missing"] for channel in inspection.document["channels"] if channel["name"] == "speed"] == [5]
assert inspection.delays == {"voltage": 1}
# The ARX model leaves something in the errors, the chosen one does not.
assert validation.whiteness < 0.01 < better.whiteness
assert better.unmet == []
assert better.fit(None) > validation.fit(None) > 90
# Two time constants, each known to a few per cent.
constants = model.document["model"]["time_constants"]
assert len(constants) == 2
assert all(constant["standard_error"] < 0.1 * constant["value"] for constant in constants)
# The bands mean what they say.
assert 0.9 < coverage < 0.99
assert np.mean((lower <= later.y) & (later.y <= upper)) > 0.8
# What was saved is the same model.
assert again == model

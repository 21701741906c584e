"""Pictures of logs, models and validations, drawn with matplotlib (``pip install thetahat[plot]``).

Each function draws into the axes that it is given, or makes a figure, and returns the axes. None of them shows or
saves a figure: ``ax.figure.savefig("fit.png")`` does, or ``matplotlib.pyplot.show()``. Bands are uncertainty: pointwise
intervals that hold the truth with the probability ``level``; there is no band where no theory gives one.

Logs and models of several outputs are drawn with axes for each, unless ``output`` names one. Where the clock of a log
has dates, the axes of time have them too, in its time zone. Legends stand above the axes, where they cover nothing;
a figure of your own makes place for them with ``matplotlib.pyplot.subplots(layout="constrained")``.

>>> import thetahat as th
>>> from thetahat import plot
>>> log = th.dc_motor()
>>> model = th.armax(log[:700], na=2, nb=2, nc=1)
>>> plot.fit(model, log[700:]).get_xlabel()
'time [s]'
"""

try:
    import matplotlib.axes
except ImportError as error:
    raise ImportError("thetahat.plot draws with matplotlib: pip install thetahat[plot]") from error

from thetahat.plot.logs import inspection, log
from thetahat.plot.models import fit, forecast, residuals, selection
from thetahat.plot.responses import bode, impulse, step, step_test
from thetahat.plot.roots import poles_zeros
from thetahat.plot.trajectories import changes, parameters, states

__all__ = [
    "bode",
    "changes",
    "fit",
    "forecast",
    "impulse",
    "inspection",
    "log",
    "parameters",
    "poles_zeros",
    "residuals",
    "selection",
    "states",
    "step",
    "step_test",
]

"""Pictures of logs, models and validations, drawn with matplotlib (``pip install thetahat[plot]``).

Each function draws into the axes that it is given, or makes a figure, and returns the axes. None of them shows or saves a
figure: ``ax.figure.savefig("fit.png")`` does, or ``matplotlib.pyplot.show()``. Bands are uncertainty: pointwise intervals
that hold the truth with the probability ``level``; there is no band where no theory gives one.

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
from thetahat.plot.models import fit, poles_zeros, residuals, selection
from thetahat.plot.responses import bode, impulse, step, step_test
from thetahat.plot.trajectories import changes, parameters, states

__all__ = [
    "bode",
    "changes",
    "fit",
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

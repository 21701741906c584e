"""PI and PID settings for a process."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from thetahat import _thetahat
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.values import Duration
from thetahat.models.model import Model

Array = npt.NDArray[np.float64]


class Tuning(Document):
    """Settings of controllers for a process, and what the loops with them do: the document of ``thetahat tune``.

    C(s) = Kc (1 + 1/(Ti s) + Td s/(1 + Td s/10)), the derivative acting on the output.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> t = np.arange(200.0)
    >>> y = np.clip(1 - np.exp(-(t - 11) / 10), 0, None)
    >>> model = th.process(th.Log(y, np.where(t < 10, 0.0, 1.0), sample_time=1), "p1d")
    >>> found = th.tune(model)
    >>> found
    Tuning(SIMC PI, lambda PI)
    >>> [round(value, 3) for value in found.settings("simc", "pi")]
    [5.0, 8.0, 0.0]
    """

    def settings(self, rule: Literal["simc", "lambda"] = "simc", controller: Literal["pi", "pid"] = "pi") -> tuple[float, float, float]:
        """Kc, Ti [s] and Td [s] by "simc" or "lambda", of a "pi" or a "pid"."""
        own = self._own(rule, controller)
        return float(own["gain"]), float(own["integral_time"]), float(own["derivative_time"])

    def closed_loop(self, rule: Literal["simc", "lambda"] = "simc", controller: Literal["pi", "pid"] = "pi") -> dict[str, Any]:
        """What the loop does: figures, and the responses as arrays of ``time``."""
        found = dict(self._own(rule, controller)["closed_loop"])
        for name in ("time", "setpoint_response", "controller_output", "load_response"):
            found[name] = np.asarray(found[name], dtype=np.float64)
        return found

    def _own(self, rule: str, controller: str) -> dict[str, Any]:
        for own in self.document["settings"]:
            if (own["rule"], own["controller"]) == (rule, controller):
                found: dict[str, Any] = own
                return found
        there = ", ".join(f"{own['rule']} {own['controller']}" for own in self.document["settings"])
        raise KeyError(f"there are no settings by {rule!r} of {controller!r}; there are: {there}")

    def __repr__(self) -> str:
        names = {"simc": "SIMC", "lambda": "lambda"}
        each = (f"{names[own['rule']]} {own['controller'].upper()}" for own in self.document["settings"])
        return f"Tuning({', '.join(each)})"


def tune(
    model: Model,
    *,
    input: str | None = None,
    closed_loop_time: Duration | None = None,
    controller: Literal["pi", "pid"] | None = None,
) -> Tuning:
    """PI and PID settings for a process by SIMC and lambda tuning, and the closed loop that they give.

    Parameters
    ----------
    model : Model
        A process, as `process` fits it.
    input : str, optional
        The input that the controller moves, if there are several.
    closed_loop_time : float or timedelta, optional
        The time constant that the loop shall have, in seconds: tau_c or lambda. Unless said otherwise the dead time by SIMC, and the
        longer of lag and dead time by lambda tuning.
    controller : {"pi", "pid"}, optional
        Which controller: both, unless said otherwise; a PID is for processes of two lags.

    Returns
    -------
    Tuning

    Raises
    ------
    ValueError
        For models that are no process, processes that the rules are not for, and a time that is not positive.

    Notes
    -----
    Skogestad, J. Process Control 13, 2003; Åström and Hägglund, Advanced PID Control, 2006, section 6.5.
    """
    model = Model._read("model", model)
    named = None if input is None else _options.text("input", input)
    lasts = None if closed_loop_time is None else _options.seconds("closed_loop_time", closed_loop_time)
    which = None if controller is None else _options.text("controller", controller)
    return Tuning(*_thetahat.tune(model._model, named, lasts, which))

"""Step tests: what a course reads off the response to a step."""

from __future__ import annotations

from typing import Any

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.base.tables import Table, columns
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.values import Rows
from thetahat.experiments.spectrum import Array, MeasuredResponse
from thetahat.logs.log import Log, handle


class StepTest(Document, Table):
    """What the steps of a log show: the document of ``thetahat step``. As a frame it has a row for each figure and method.

    Figures are ``"gain"``, ``"dead-time"``, ``"time-constant"``, ``"rise-time"``, ``"settling-time"``, ``"overshoot"``, ``"peak-time"``,
    ``"period"``, ``"damping"`` and ``"natural-frequency"``. Methods are ``"regime"``, ``"noise-band"``, ``"tangent"``, ``"level"``,
    ``"two-points"``, ``"plain-average"``, ``"weighted-average"``, ``"crossings"``, ``"peak"``, ``"two-peaks"`` and ``"phase"``.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> t = np.arange(300)
    >>> u = np.where(t < 50, 1.0, 3.0)
    >>> y = 5 + 4 * (1 - np.exp(-np.maximum(t - 50, 0) / 20))
    >>> found = th.step_test(th.Log(y, u, sample_time=1.0))
    >>> found
    StepTest(1 step of u, first-order)
    >>> round(found.value("gain"), 2), round(found.value("time-constant"), 1)
    (2.0, 20.0)
    """

    @property
    def input(self) -> str:
        """The input that steps."""
        return str(self.document["input"])

    @property
    def output(self) -> str:
        """The output that responds."""
        return str(self.document["output"])

    @property
    def steps(self) -> list[dict[str, Any]]:
        """Each step, with its response or the reason why it has none."""
        return list(self.document["steps"])

    @property
    def shapes(self) -> list[str | None]:
        """What each response looks like: "first-order", "overdamped" or "underdamped"; None where it is not evaluated."""
        return [step["response"] and step["response"]["shape"] for step in self.document["steps"]]

    @property
    def advice(self) -> list[str]:
        """Which of the figures to trust, and why."""
        return [_thetahat.in_python(advice) for advice in self.document["advice"]]

    def methods(self, figure: str) -> list[str]:
        """The methods by which a figure was found."""
        return [of["method"] for of in self.document["summary"] if of["figure"] == figure]

    def value(self, figure: str, method: str | None = None) -> float:
        """A figure, the mean over the steps: by a method, or by the one to trust in the most of them.

        Raises
        ------
        ValueError
            If it was not found so.
        """
        return float(self._summary(figure, method)["value"]["value"])

    def error(self, figure: str, method: str | None = None) -> float:
        """The standard error of `value`; NaN where there is none."""
        return float(_numbers.of_document([self._summary(figure, method)["value"]["standard_error"]])[0])

    def values(self, figure: str, method: str) -> Array:
        """A figure by a method for each step, shape (steps,); NaN where it has none."""
        found = []
        for step in self.document["steps"]:
            estimates = (step["response"] or {"estimates": []})["estimates"]
            own = [of["value"]["value"] for of in estimates if (of["figure"], of["method"]) == (figure, method)]
            found.append(own[0] if own else None)
        return _numbers.of_document(found)

    def _summary(self, figure: str, method: str | None) -> dict[str, Any]:
        own = [of for of in self.document["summary"] if of["figure"] == figure]
        if not own:
            known = ", ".join(dict.fromkeys(of["figure"] for of in self.document["summary"]))
            raise ValueError(f"figure: '{figure}' was not found; there are: {known}")
        if method is None:
            most: dict[str, Any] = max(own, key=lambda of: of["trusted"])
            return most
        named = [of for of in own if of["method"] == method]
        if not named:
            raise ValueError(f"method: {figure} has no '{method}'; there are: {', '.join(of['method'] for of in own)}")
        return dict(named[0])

    def _columns(self) -> dict[str, list[Any]]:
        def row(of: dict[str, Any]) -> dict[str, Any]:
            value = of["value"]
            own = {"figure": of["figure"], "method": of["method"], "value": value["value"]}
            return {**own, "standard_error": value["standard_error"], "trusted": of["trusted"]}

        return columns([row(of) for of in self.document["summary"]])

    def __repr__(self) -> str:
        count = len(self.document["steps"])
        if count == 0:
            return f"StepTest(sines of {self.input})"
        shapes = ", ".join(dict.fromkeys(shape for shape in self.shapes if shape is not None))
        return f"StepTest({count} step{'s' if count > 1 else ''} of {self.input}, {shapes})"


@_options.takes()
def step_test(log: Log | MeasuredResponse, *, rows: Rows | None = None, input: str | None = None) -> StepTest:
    """Read the figures of a step test off the responses to the steps of a log, each with its standard error.

    Parameters
    ----------
    log : Log or MeasuredResponse
        The data, of one input and one output, on any clock (``uniform=False``); or the response that `spectrum` found from sines, of
        which the time constant is taken where the phase is -45 degrees.
    rows : rows, optional
        Of a log: the rows to use; all, unless said otherwise. Each range is for itself.
    input : str, optional
        Of a response from several inputs: which one.

    Returns
    -------
    StepTest

    Raises
    ------
    ValueError
        If there is no step.
    EstimationError
        If no response can be evaluated: the final steady state is not reached, the output is not at rest before, the step is lost in the noise; or the
        phase does not pass -45 degrees.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> t = np.arange(300)
    >>> log = th.Log(1 - np.exp(-np.maximum(t - 50, 0) / 20), np.where(t < 50, 0.0, 1.0), sample_time=1.0)
    >>> th.step_test(log).methods("time-constant")
    ['tangent', 'level', 'two-points', 'plain-average', 'weighted-average', 'least-squares']
    """
    if isinstance(log, MeasuredResponse):
        if rows is not None:
            raise ValueError("rows: they are for a log; leave them out")
        if input is None:
            if len(log.inputs) > 1:
                raise ValueError(f"input: the response is from several; name one of {', '.join(log.inputs)}")
            input = log.inputs[0]
        return StepTest(*_thetahat.sine_test(log.to_json(), _options.text("input", input)))
    if input is not None:
        raise ValueError("input: it is for a response; take the input of a log with log.select(inputs=...)")
    chosen = [] if rows is None else _options.rows_of("rows", rows, len(log) if isinstance(log, Log) else None)
    return StepTest(*_thetahat.step_test(handle("log", log), chosen))

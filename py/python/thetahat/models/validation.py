"""How models do on logs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from thetahat import _thetahat
from thetahat.base.tables import Table, columns
from thetahat.engine.document import Document


class Validation(Document, Table):
    """How a model does on a log: the document of ``thetahat validate``.

    As a frame it has a row for each output and horizon, of which inf is a free run.

    Attributes
    ----------
    unmet : list of str
        What was required and is not met, with the figures.
    alpha : float
        The level at which tests reject.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> validation = th.arx(log[:700], na=2, nb=2).validate(log[700:])
    >>> validation
    Validation(1-step fit 98.12 %, free run 94.88 %, 300 rows)
    >>> round(validation.fit(None), 2)
    94.88
    >>> validation.whiteness < 0.05
    True
    >>> validation.to_pandas()[["horizon", "fit"]].round(2)
       horizon    fit
    0      1.0  98.12
    1      5.0  95.86
    2      inf  94.88
    """

    @classmethod
    def _of(cls, validation: _thetahat.Validation) -> Validation:
        made = cls(validation.to_json(), validation.table())
        made.unmet, made.alpha = validation.unmet(), validation.alpha
        return made

    unmet: list[str]
    alpha: float

    def fit(self, horizon: int | None = 1, *, output: str | None = None) -> float:
        """The fit in percent ``horizon`` steps ahead, or in a free run (None); NaN where there is none.

        Raises
        ------
        ValueError
            If the validation did not evaluate that horizon, or there are several outputs and none is named.
        """
        return self._figure("percent", horizon, output)

    def mean_absolute_error(self, horizon: int | None = 1, *, output: str | None = None) -> float:
        """The mean of ``|e|`` ``horizon`` steps ahead, or in a free run (None), in units of the output; NaN where there is none.

        It raises as `fit` does.

        Examples
        --------
        >>> import thetahat as th
        >>> log = th.dc_motor()
        >>> validation = th.arx(log[:700], na=2, nb=2).validate(log[700:])
        >>> validation.mean_absolute_error() < validation.largest_error()
        True
        """
        return self._figure("mean_absolute_error", horizon, output)

    def largest_error(self, horizon: int | None = 1, *, output: str | None = None) -> float:
        """The largest ``|e|`` ``horizon`` steps ahead, or in a free run (None), in units of the output; NaN where there is none.

        It raises as `fit` does.
        """
        return self._figure("largest_error", horizon, output)

    def _figure(self, name: str, horizon: int | None, output: str | None) -> float:
        outputs = [noise["output"] for noise in self.document["noise"]]
        if output is None and len(outputs) > 1:
            raise ValueError(f"output: there are several; name one of: {', '.join(outputs)}")
        if output is not None and output not in outputs:
            raise ValueError(f"output: there is no output '{output}'; there are: {', '.join(outputs)}")
        for fit in self.document["fit"]:
            if fit["horizon"].get("steps") == horizon and output in (None, fit["output"]):
                return float("nan" if fit[name] is None else fit[name])
        if horizon is None:
            raise ValueError("horizon: a model without inputs has no free run; give a number of steps")
        raise ValueError(f"horizon: {horizon} was not evaluated; validate with horizon={horizon}")

    @property
    def whiteness(self) -> float:
        """The p-value of Ljung and Box's test that the residuals are white; NaN where they could not be tested. Of several outputs the
        least."""
        values = [residuals["ljung_box"]["p_value"] for residuals in self.document["residuals"]]
        return min((float(value) for value in values if value is not None), default=float("nan"))

    @property
    def anderson(self) -> dict[float, float]:
        """How likely as many autocorrelations of white residuals lie outside their band, by the level of the band.

        The mid-p-value of the count, which is about binomial (Anderson's test); below `alpha` the residuals are not white.
        Empty where they could not be tested. Of several outputs the least.
        """
        found: dict[float, float] = {}
        for residuals in self.document["residuals"]:
            for level in residuals["anderson"]["levels"]:
                found[level["alpha"]] = min(level["p_value"], found.get(level["alpha"], 1.0))
        return found

    @property
    def independence(self) -> dict[str, float]:
        """The p-values that the residuals do not depend on past inputs, by input; NaN where they could not be tested. Of several outputs
        the least."""
        found: dict[str, float] = {}
        for residuals in self.document["residuals"]:
            for one in residuals["independence"]:
                value = p_value(one)
                known = found.get(one["input"], float("nan"))
                found[one["input"]] = known if value is None or value > known else value
        return found

    def _columns(self) -> dict[str, list[Any]]:
        return columns(list(fit_rows(self.document)))

    def __repr__(self) -> str:
        rows = sum(last - first + 1 for first, last in self.document["rows"])
        fits = {fit["horizon"].get("steps"): fit["percent"] for fit in self.document["fit"]}
        shown = {1: "1-step fit", None: "free run"}
        texts = [f"{name} {fits[steps]:.2f} %" for steps, name in shown.items() if fits.get(steps) is not None]
        return f"Validation({', '.join([*texts, f'{rows} rows'])})"


def fit_rows(document: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The figures of each output and horizon of a validation."""
    for fit in document["fit"]:
        steps = fit["horizon"].get("steps")
        yield {
            "output": fit["output"],
            "horizon": np.inf if steps is None else float(steps),
            "samples": fit["samples"],
            "fit": fit["percent"],
            "rmse": fit["rmse"],
            "mean_absolute_error": fit["mean_absolute_error"],
            "largest_error": fit["largest_error"],
        }


def p_value(independence: Mapping[str, Any]) -> float | None:
    """That of the test of past inputs."""
    value = independence.get("past", independence).get("p_value")
    return None if value is None else float(value)

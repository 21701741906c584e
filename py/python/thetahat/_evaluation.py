"""What is said of logs and models: inspections, validations, comparisons."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

from thetahat import _options, _thetahat
from thetahat._log import Log, handle
from thetahat._options import Duration, ReadOptions, Resample, Rows, ValidationOptions

if TYPE_CHECKING:
    from thetahat._model import Model
    from thetahat._spectrum import MeasuredResponse


class _Document:
    """A document with the table that the command line prints of it."""

    def __init__(self, text: str, table: str) -> None:
        self._text = text
        self._table = table

    def to_json(self) -> str:
        """The document, as the command line writes it."""
        return self._text

    def summary(self) -> str:
        """The table that the command line prints."""
        return self._table

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document as a dict: all that there is to know."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words."""
        return [_thetahat.in_python(warning) for warning in self.document["warnings"]]

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


class Validation(_Document):
    """How a model does on a log: the document of ``thetahat validate``.

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
                value = _p_value(one)
                known = found.get(one["input"], float("nan"))
                found[one["input"]] = known if value is None or value > known else value
        return found

    def __repr__(self) -> str:
        rows = sum(last - first + 1 for first, last in self.document["rows"])
        fits = {fit["horizon"].get("steps"): fit["percent"] for fit in self.document["fit"]}
        shown = {1: "1-step fit", None: "free run"}
        texts = [f"{name} {fits[steps]:.2f} %" for steps, name in shown.items() if fits.get(steps) is not None]
        return f"Validation({', '.join([*texts, f'{rows} rows'])})"


def _p_value(independence: Mapping[str, Any]) -> float | None:
    value = independence.get("past", independence).get("p_value")
    return None if value is None else float(value)


class Comparison(_Document):
    """Several models side by side on a log: the document of ``thetahat compare``."""

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words, with the model that it is about."""
        models = self.document["models"]
        return [f"{model['report']}: {_thetahat.in_python(text)}" for model in models for text in model["warnings"]]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(str(model['report']) for model in self.document['models'])})"


@dataclass(frozen=True)
class Finding:
    """What was found in a log that a careful reader should know. Its ``str`` is the sentence that the command line prints.

    Attributes
    ----------
    kind : str
        What kind of thing it is, such as ``"gaps"``, ``"outliers"``, ``"stuck"``, ``"feedback"`` or ``"trend"``.
    channels : list of str
        The channels that it is about; none where it is the whole log.
    rows : list of (int, int)
        The rows where it is seen, as (first, last) counted from 1, the first 20 ranges; none where it is all rows.
    seen : str
        The evidence, with its figures.
    advice : str or None
        What it means, or what to do about it.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> y = np.sin(0.1 * np.arange(200.0) ** 2)
    >>> y[120] = 50.0
    >>> found = th.inspect(th.Log(y=y, sample_time=1.0)).findings[0]
    >>> found.kind, found.channels, found.rows
    ('outliers', ['y'], [(121, 121)])
    >>> print(found)
    channel 'y' has values far from their neighbours at row 121: a fit without orders takes them for missing; where they are wrong, empty their fields, or fit with norm 1
    """

    kind: str
    channels: list[str]
    rows: list[tuple[int, int]]
    seen: str
    advice: str | None

    def __str__(self) -> str:
        return self.seen if self.advice is None else f"{self.seen}: {self.advice}"


class Inspection(_Document):
    """What a log is worth before any fit: the document of ``thetahat inspect``.

    Examples
    --------
    >>> import thetahat as th
    >>> inspection = th.inspect(th.dc_motor())
    >>> inspection.delays, inspection.feedback
    ({'u': 1}, {'u': False})
    """

    @property
    def findings(self) -> list[Finding]:
        """What a careful reader should know: what was seen, in which channels and rows, and what to do."""

        def of(found: dict[str, Any]) -> Finding:
            advice = found.get("advice")
            return Finding(
                found["kind"],
                found.get("channels", []),
                [(first, last) for first, last in found.get("rows", [])],
                _thetahat.in_python(found["seen"]),
                None if advice is None else _thetahat.in_python(advice),
            )

        return [of(found) for found in self.document["findings"]]

    @property
    def warnings(self) -> list[str]:
        """The findings in plain words, each in a sentence."""
        return [str(finding) for finding in self.findings]

    @property
    def delays(self) -> dict[str, int | None]:
        """The delay of each input in samples, as a fit without orders takes it; None where no effect is seen."""
        return {delay["input"]: delay["nk"] for delay in self.document["delays"]}

    @property
    def confidence(self) -> dict[str, float | None]:
        """How sure each delay is: its posterior probability among all that were compared."""
        return {delay["input"]: delay["confidence"] for delay in self.document["delays"]}

    @property
    def feedback(self) -> dict[str, bool]:
        """Whether feedback from the output to each input is suspected."""
        return {one["input"]: one["found"] for one in self.document["feedback"]}

    @property
    def excitation(self) -> dict[str, int]:
        """How many parameters each input can determine at most: its order of persistence."""
        return {one["input"]: one["order"] for one in self.document["excitation"]}

    @property
    def command(self) -> str | None:
        """The line of ``thetahat fit`` that goes with the file, if it was one."""
        return self.document.get("command")

    def __repr__(self) -> str:
        count = len(self.warnings)
        return f"Inspection({self.document['rows']} rows, {count} warning{'' if count == 1 else 's'})"


def compare(
    models: Mapping[str, Model] | Sequence[Model],
    log: Log,
    *,
    rows: Rows | None = None,
    detrend: str | None = None,
    horizon: int | Sequence[int] | None = None,
    lags: int | None = None,
    alpha: float | None = None,
    alphas: Sequence[float] | None = None,
    over: MeasuredResponse | None = None,
) -> Comparison:
    """Put several fitted models side by side on a log.

    Parameters
    ----------
    models : dict of str to Model, or sequence of Model
        The models, with the names that they have in the table.
    log : Log
        The data.
    rows, detrend, horizon, lags, alpha, alphas
        What to validate on and how, see `thetahat.ValidationOptions`.
    over : MeasuredResponse, optional
        A frequency response, as `spectrum` finds it, to lay the models over: how many of its points each misses.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> models = {"arx": th.arx(log[:700], na=2, nb=2), "oe": th.oe(log[:700], nb=2, nf=2)}
    >>> th.compare(models, log[700:])
    Comparison(arx, oe)
    """
    words = _options.words(ValidationOptions, locals(), len(log) if isinstance(log, Log) else None)
    named = dict(models) if isinstance(models, Mapping) else {f"model {k}": m for k, m in enumerate(models, 1)}
    if not named:
        raise ValueError("models: there is none; give at least one")
    from thetahat._model import Model

    for model in named.values():
        if not isinstance(model, Model):
            raise TypeError(f"models: expected a Model, found {type(model).__name__}")
    handles = [(_options.text("models", name), model._model) for name, model in named.items()]
    from thetahat._spectrum import MeasuredResponse

    if over is not None and not isinstance(over, MeasuredResponse):
        raise TypeError(f"over: expected a MeasuredResponse, found {type(over).__name__}")
    response = None if over is None else over.to_json()
    return Comparison(*_thetahat.compare(handles, handle("log", log), words, response))


def inspect(
    log: Log | str | os.PathLike[str],
    *,
    inputs: Sequence[str] | str | None = None,
    output: str | None = None,
    time: str | None = None,
    sample_time: Duration | None = None,
    resample: Resample | None = None,
    time_format: str | None = None,
    time_unit: str | None = None,
    time_zone: str | None = None,
    delimiter: str | None = None,
    comment: str | None = None,
    encoding: str | None = None,
    sheet: str | None = None,
    decimal_comma: bool | None = None,
    header: bool | int = True,
    skip_rows: int | None = None,
    missing: str | Sequence[str] | None = None,
    values: Mapping[str, float] | None = None,
) -> Inspection:
    """Inspect a log before any fit: its clock, the quality of its channels, excitation, delays and feedback.

    Parameters
    ----------
    log : Log, or path
        The data, or a CSV file, whose clock may be irregular.
    inputs, output
        The columns of a file that are inputs and output; without names all columns of numbers are inspected.
    time, sample_time, resample, time_format, time_unit, time_zone
        The clock of a file, see `thetahat.ReadOptions`.
    delimiter, comment, encoding, sheet, decimal_comma, header, skip_rows, missing, values
        How it is written, see `thetahat.ReadOptions`.

    Returns
    -------
    Inspection

    Examples
    --------
    >>> import thetahat as th
    >>> th.inspect(th.dc_motor())
    Inspection(1000 rows, 0 warnings)
    """
    words = _options.words(ReadOptions, locals())
    if isinstance(log, Log):
        if words or inputs is not None or output is not None:
            raise TypeError("inputs, output and how to read are for files; a Log has its own")
        return Inspection(*_thetahat.inspect(log._log))
    words += _options.channels(inputs, output)
    return Inspection(*_thetahat.inspect_file([*words, "--", _options.path_text(log)]))

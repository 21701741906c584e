"""Several models side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from thetahat import _thetahat
from thetahat.base.tables import Table, columns
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.engine.option_types import ValidationOptions
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.logs.log import Log, handle
from thetahat.models.model import Model
from thetahat.models.validation import fit_rows

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Comparison(Document, Table):
    """Several models side by side on a log: the document of ``thetahat compare``.

    As a frame it has a row for each model, output and horizon, of which inf is a free run; its index are the models.

    Examples
    --------
    >>> import thetahat as th
    >>> log = th.dc_motor()
    >>> models = {"arx": th.arx(log[:700], na=2, nb=2), "oe": th.oe(log[:700], nb=2, nf=2)}
    >>> frame = th.compare(models, log[700:], horizon=1).to_pandas()
    >>> frame.loc["arx", ["horizon", "fit"]].round(1).values.tolist()
    [[1.0, 98.1], [inf, 94.9]]
    """

    _index = "model"

    def _columns(self) -> dict[str, list[Any]]:
        def rows() -> Iterator[dict[str, Any]]:
            for model in self.document["models"]:
                tests = {residuals["output"]: residuals["ljung_box"]["p_value"] for residuals in model["residuals"]}
                for row in fit_rows(model):
                    own = {"model": model["report"], "name": model["model"], "parameters": model["parameters"]}
                    yield {**own, **row, "whiteness": tests.get(row["output"])}

        return columns(list(rows()))

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words, with the model that it is about."""
        models = self.document["models"]
        return [f"{model['report']}: {_thetahat.in_python(text)}" for model in models for text in model["warnings"]]

    def __repr__(self) -> str:
        return f"Comparison({', '.join(str(model['report']) for model in self.document['models'])})"


@_options.takes(ValidationOptions)
def compare(
    models: Mapping[str, Model] | Sequence[Model],
    log: Log,
    *,
    over: MeasuredResponse | None = None,
    **options: Unpack[ValidationOptions],
) -> Comparison:
    """Compare several fitted models on a log.

    Parameters
    ----------
    models : dict of str to Model, or sequence of Model
        The models, with the names that they have in the table. Linear systems of python-control and SciPy are models, too.
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
    plan = _options.plan(options, len(log) if isinstance(log, Log) else None)
    if isinstance(models, (Model, Log)):
        raise TypeError(f"models: expected several, found a {type(models).__name__}; compare([model, another], log), or model.validate(log)")
    named = dict(models) if isinstance(models, Mapping) else {f"model {k}": m for k, m in enumerate(models, 1)}
    if not named:
        raise ValueError("models: there is none; give at least one")
    handles = [(_options.text("models", name), Model._read("models", model)._model) for name, model in named.items()]
    if over is not None and not isinstance(over, MeasuredResponse):
        raise TypeError(f"over: expected a MeasuredResponse, found {type(over).__name__}")
    response = None if over is None else over.to_json()
    return Comparison(*_thetahat.compare(handles, handle("log", log), plan, response))

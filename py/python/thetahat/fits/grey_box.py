"""Models in equations, of which some parameters may be unknown, and their fits."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat.engine import files as _files, options as _options
from thetahat.engine.option_types import EquationsOptions
from thetahat.engine.runs import Simulates
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.fits.expressions import Expression, Names, Written
from thetahat.fits.fit import told
from thetahat.logs.log import Log, handle
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack

def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name}: expected a number, found {_numbers.shown(value)}")
    return float(value)


class GreyBox(Simulates):
    """A model of a plant in equations, of which some parameters may be unknown, as ``thetahat fit --grey`` reads it.

    Parameters
    ----------
    model : str, path or dict
        A text in TOML, a file with one, or a dict with the same entries: ``sample_time``, ``states``, ``inputs``, ``parameters``,
        ``next`` or ``derivative``, ``outputs``, ``noise``. The manual of ``thetahat filter`` says what each is.

    Raises
    ------
    ValueError
        If it is no such model: with line and column, and what to do.

    Examples
    --------
    >>> import thetahat as th
    >>> tank = th.GreyBox({
    ...     "sample_time": 1,
    ...     "states": {"level": {"start": 0, "sd": 0.1}},
    ...     "inputs": {"flow": "u"},
    ...     "parameters": {"area": {"start": 1, "sd": 1, "unknown": True, "min": 0}},
    ...     "derivative": {"level": "(flow - 0.1 * level) / area"},
    ...     "outputs": {"y": "level"},
    ...     "noise": {"measurement": {"y": 0.01}},
    ... })
    >>> tank
    GreyBox(states level, inputs u, outputs y, unknown area)
    """

    __slots__ = ("_model",)
    _model: _thetahat.GreyBox

    def __init__(self, model: str | os.PathLike[str] | Mapping[str, Any]) -> None:
        if isinstance(model, Mapping):
            text = _toml(_plain("model", model))
        elif isinstance(model, str) and ("\n" in model or "=" in model):
            text = model
        else:
            with open(_files.name(model), encoding="utf-8") as file:
                text = file.read()
        self._model = _thetahat.GreyBox(text)

    @classmethod
    def from_functions(
        cls,
        *,
        sample_time: float,
        states: Mapping[str, Mapping[str, float | str] | tuple[float | str, float | str]],
        outputs: Callable[..., Mapping[str, Any]],
        measurement: Mapping[str, Any] | Callable[..., Mapping[str, Any]],
        derivative: Callable[..., Mapping[str, Any]] | None = None,
        next: Callable[..., Mapping[str, Any]] | None = None,
        inputs: Sequence[str] | Mapping[str, str | Mapping[str, str]] = (),
        parameters: Mapping[str, Any] | None = None,
        process: Mapping[str, Any] | Callable[..., Mapping[str, Any]] | None = None,
        substeps: int | None = None,
    ) -> GreyBox:
        """A model whose equations are functions of Python.

        They are called once, with expressions in the place of numbers, and what they compute is the model: nothing of Python runs in
        a fit, and derivatives are exact.

        Parameters
        ----------
        sample_time : float
            Seconds from one sample to the next.
        states : dict of str to (float, float) or dict
            Of each state what is known at the first row: its value and its standard deviation, as numbers or as texts with parameters.
        outputs : callable
            ``outputs(x, u, p)`` gives a dict of the channels that are measured: what each is.
        measurement : dict, or callable
            The standard deviation of each output's noise: a number, or ``{"start": 0.1, "unknown": True}`` for one that a fit finds; or a
            function ``measurement(x, u, p)`` that gives a dict of expressions.
        derivative, next : callable
            One of the two. ``derivative(x, u, p)`` gives a dict of dx/dt; ``next(x, u, p, dt)`` one of the states after ``dt`` seconds.
            ``x``, ``u`` and ``p`` have the states, inputs and parameters as attributes, in their order as ``x[0]``, and by name as
            ``x["level"]``. They take part in NumPy's functions; `thetahat.where` is their ``if``, `thetahat.table` a look-up table.
        inputs : sequence of str, or dict of str to str
            The channels that are inputs, or by the names that the functions use. ``{"channel": "to", "hold": "linear"}`` in place of a
            channel goes from row to row in straight lines; `thetahat.delayed` is an input some seconds ago.
        parameters : dict of str to float or dict
            A number, or what is known of an unknown one: ``{"start": 1, "sd": 1, "unknown": True, "min": 0}``.
        process : dict, or callable, optional
            The standard deviation of what a sample adds to each state, as for ``measurement``.
        substeps : int, optional
            Steps of the integration from row to row, of ``derivative``.

        Raises
        ------
        ValueError, TypeError, AttributeError, IndexError, KeyError
            If they are no equations: with the name of the function, its file and line, and what to do.

        Examples
        --------
        >>> import numpy as np
        >>> import thetahat as th
        >>> pendulum = th.GreyBox.from_functions(
        ...     sample_time=0.05,
        ...     states={"angle": (0, 0.1), "rate": (0, 0.1)},
        ...     inputs={"torque": "u"},
        ...     parameters={"stiffness": {"start": 6, "sd": 3, "unknown": True, "min": 0}},
        ...     derivative=lambda x, u, p: {"angle": x.rate, "rate": u.torque - p.stiffness * np.sin(x.angle)},
        ...     outputs=lambda x, u, p: {"y": x.angle},
        ...     measurement={"y": 0.01},
        ... )
        >>> pendulum.to_dict()["derivative"]["rate"]
        '(torque - (stiffness * sin(angle)))'
        """
        if (derivative is None) == (next is None):
            raise ValueError("derivative: give one of derivative and next")
        channels: dict[str, Any] = dict(inputs) if isinstance(inputs, Mapping) else {name: name for name in inputs}
        known = dict(parameters or {})

        spaces = (Names("state", states), Names("input", channels), Names("parameter", known))
        model: dict[str, Any] = {"sample_time": sample_time}
        if substeps is not None:
            model["substeps"] = substeps
        model["states"] = {
            name: dict(value) if isinstance(value, Mapping) else dict(zip(("start", "sd"), value))
            for name, value in states.items()
        }
        model["inputs"] = channels
        model["parameters"] = known
        written = {"outputs": Written("outputs", outputs)}
        if derivative is not None:
            written["derivative"] = Written("derivative", derivative)
            model["derivative"] = written["derivative"].equations(*spaces, of=list(states))
        if next is not None:
            written["next"] = Written("next", next)
            model["next"] = written["next"].equations(*spaces, Expression("dt"), of=list(states))
        model["outputs"] = written["outputs"].equations(*spaces)
        noises = {"process": process or {}, "measurement": measurement}
        model["noise"] = {
            name: Written(name, noise).equations(*spaces) if callable(noise) else dict(noise) for name, noise in noises.items()
        }
        text = _toml(_plain("model", model))
        try:
            return cls(text)
        except ValueError as error:
            raise ValueError(_without_text(str(error), text, written)) from error

    @property
    def sample_time(self) -> float:
        """Seconds from one sample to the next."""
        return self._model.sample_time

    @property
    def states(self) -> list[str]:
        """The names of the states."""
        return self._model.states

    @property
    def inputs(self) -> list[str]:
        """The channels of the inputs."""
        return self._model.inputs

    @property
    def outputs(self) -> list[str]:
        """The channels of the outputs."""
        return self._model.outputs

    @property
    def unknown(self) -> list[str]:
        """The names of the parameters that are unknown."""
        return self._model.unknown

    def with_parameters(self, **values: float) -> GreyBox:
        """The same model with values of unknown parameters, which are known then.

        Raises
        ------
        ValueError
            If there is no such unknown parameter, or a value is outside its bounds.
        """
        made = object.__new__(type(self))
        made._model = self._model.with_parameters([(name, _number(name, value)) for name, value in values.items()])
        return made

    def _filtered(self) -> _thetahat.StateModel:
        return _thetahat.StateModel.from_grey_box(self._model)

    def to_toml(self) -> str:
        """The text as it was written."""
        return self._model.to_toml()

    def to_dict(self) -> dict[str, Any]:
        """The entries of the text."""
        try:
            import tomllib
        except ImportError:  # Python before 3.11
            import tomli as tomllib  # type: ignore[import-not-found, no-redef]
        return tomllib.loads(self.to_toml())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GreyBox):
            return NotImplemented
        return (self.to_toml(), self._model.known) == (other.to_toml(), other._model.known)

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self.to_toml(), self._model.known))

    def __repr__(self) -> str:
        parts = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs, "unknown": self.unknown}
        return f"GreyBox({', '.join(f'{name} {chr(32).join(names)}' for name, names in parts.items() if names)})"


def _restored(text: str, known: Sequence[tuple[str, float]]) -> GreyBox:
    made = object.__new__(GreyBox)
    made._model = _thetahat.GreyBox(text).with_parameters(known)
    return made


def from_template(
    log: Log, name: str, columns: Mapping[str, str | None], known: Mapping[str, float], estimate: Any = None, split: Any = None
) -> GreyBox:
    """The model of a template for a log, with start values from the rows that are fitted to."""
    given = [(role, column) for role, column in columns.items() if column is not None]
    for role, column in given:
        if not isinstance(column, str):
            raise TypeError(f"{role}: expected the name of a column, found {_numbers.shown(column)}")
    numbers = [(word, _number(word, value)) for word, value in known.items()]
    plan = _options.plan({"estimate": estimate, "split": split}, len(log))
    made = object.__new__(GreyBox)
    made._model = _thetahat.template(handle("log", log), name, given, numbers, plan)
    return made


def _plain(name: str, value: Any) -> Any:
    """Numbers of NumPy as those of Python, mappings as dicts."""
    if isinstance(value, Mapping):
        return {str(key): _plain(str(key), entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(name, entry) for entry in value]
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, float) and not np.isfinite(plain):
        raise ValueError(f"{name}: {plain} is not a finite number")
    if not isinstance(plain, (bool, int, float, str)):
        raise TypeError(f"{name}: expected a number, a text or a dict, found {_numbers.shown(plain)}")
    return plain


def _toml(model: Mapping[str, Any]) -> str:
    """The text of a model, in which names stand in the order in which they were given."""
    tables = {name: value for name, value in model.items() if isinstance(value, dict)}
    lines = [f"{_key(name)} = {_inline(value)}" for name, value in model.items() if name not in tables]
    for name, table in tables.items():
        lines += ["", f"[{_key(name)}]", *(f"{_key(key)} = {_inline(value)}" for key, value in table.items())]
    return "\n".join([*lines, ""])


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_inline(entry)}" for key, entry in value.items()) + " }" if value else "{}"
    if isinstance(value, list):
        return f"[{', '.join(_inline(entry) for entry in value)}]"
    if isinstance(value, str):
        # TOML has JSON's escapes, and wants DEL as one too.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _inline(name)


def _without_text(message: str, text: str, written: Mapping[str, Written]) -> str:
    """An error in a text that was made of functions, by these and by arguments."""
    place = re.match(r"line (\d+), column (\d+): ", message)
    if not place:
        return message
    table, lines = "", text.split("\n")[: int(place[1])]
    for line in lines:
        table = line[1:-1] if line.startswith("[") else table
    key, _, expression = lines[-1].partition(" = ")
    message = message[place.end() :]
    if table not in written:
        return f"{table}[{key!r}]: {message}" if table and expression else message
    # What is long is cut to what stands around the error; the column counts from 1, and the expression has quotes.
    at = int(place[2]) - 1 - (len(lines[-1]) - len(expression))
    begin, end = max(at - 60, 1), min(at + 60, len(expression) - 1)
    near = f"{'…' if begin > 1 else ''}{expression[begin:end]}{'…' if end < len(expression) - 1 else ''}"
    return f"{written[table].place()}: in {table}[{key!r}], {near}: {message}"


Equations = Union[GreyBox, str, "os.PathLike[str]", Mapping[str, Any]]
"""A model in equations, or what `GreyBox` makes one of."""


@_options.takes(EquationsOptions)
def grey(
    log: Log | MeasuredResponse,
    model: Equations,
    **options: Unpack[EquationsOptions],
) -> Model:
    """Find the unknown parameters of a model in equations: those of the largest likelihood, as ``thetahat fit --grey`` does.

    Parameters
    ----------
    log : Log or MeasuredResponse
        The data, with the channels of the model by name. The clock may be uneven (``uniform=False``); joined logs are experiments that
        each begin as the model says. Or a frequency response, such as an impedance (`MeasuredResponse.given`): the equations near
        the state in which they start come closest to its points, in units of their errors.
    model : GreyBox, str, path or dict
        The equations; or ``"template:battery"`` and its like, a plant that is ready, whose columns go by their names in the log, see
        `thetahat.templates`.
    estimate, validate, split, search, max_iterations, tolerance, step, starts, seed, time_limit
        What to fit to and how, see `thetahat.EquationsOptions`.

    Returns
    -------
    Model
        Its `Model.kind` is ``"equations"``.

    Raises
    ------
    EstimationError
        If the data cannot determine the parameters, which are named.
    ValueError
        If an argument does not make sense, a channel is not in the log, or the filter leaves the range of numbers.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> u = np.repeat([0.0, 1.0, 2.0, 1.0, 0.0], 20)
    >>> y = np.zeros(100)
    >>> for t in range(1, 100):
    ...     y[t] = y[t - 1] + (u[t - 1] - 0.1 * y[t - 1]) / 2
    >>> log = th.Log(y + 0.01 * np.random.default_rng(0).standard_normal(100), u, sample_time=1)
    >>> tank = {
    ...     "sample_time": 1,
    ...     "states": {"level": {"start": 0, "sd": 0.1}},
    ...     "inputs": {"flow": "u"},
    ...     "parameters": {"area": {"start": 1, "sd": 1, "unknown": True, "min": 0}},
    ...     "next": {"level": "level + dt * (flow - 0.1 * level) / area"},
    ...     "outputs": {"y": "level"},
    ...     "noise": {"measurement": {"y": 0.01}},
    ... }
    >>> model = th.grey(log, tank)
    >>> model.parameters.round(2)
    array([2.])
    """
    if isinstance(log, MeasuredResponse):
        if isinstance(model, str) and model.startswith("template:") and "\n" not in model:
            raise ValueError("model: a template finds its start values in a log; give equations with start values of their own")
        box = model if isinstance(model, GreyBox) else GreyBox(model)
        return told(Model._of(_thetahat.fit_equations_to_response(log.to_json(), box._model, _options.plan(options))))
    data = handle("log", log)
    if isinstance(model, str) and model.startswith("template:") and "\n" not in model:
        model = from_template(log, model[len("template:") :], {}, {}, options.get("estimate"), options.get("split"))
    box = model if isinstance(model, GreyBox) else GreyBox(model)
    if not box.unknown:
        raise ValueError(
            "model: none of its parameters is unknown, so that there is nothing to fit; give one as { start = …, sd = …, unknown = true }, "
            "or use it as it is: model.simulate(u), thetahat.StateFilter(model)"
        )
    return told(Model._of(_thetahat.fit_equations(data, box._model, _options.plan(options, len(log)))))

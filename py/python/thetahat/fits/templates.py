"""Plants that are ready: models in equations with start values that are found from a log.

Each function makes a `thetahat.GreyBox` for a log, which `thetahat.grey` fits; its text, `GreyBox.to_toml`, can be changed. Columns go by
their names in the log, or are named: ``thetahat.templates.battery(log, current="I_batt")``. What is ``known`` of parameters and of the
numbers that a template takes as known is not estimated.

>>> import numpy as np
>>> import thetahat as th
>>> t = 0.02 * np.arange(500)
>>> angle = 0.3 * np.exp(-0.05 * t) * np.cos(4.43 * t) + 0.002 * np.random.default_rng(0).standard_normal(500)
>>> log = th.Log(angle, sample_time=0.02, output_name="angle")
>>> model = th.grey(log, th.templates.pendulum(log, known={"zero": 0.0}))
>>> length = model.parameters[model.parameter_names.index("length")]
>>> bool(abs(length - 9.80665 / 4.43**2) < 0.02)
True
>>> sorted(model.figures)
['damping_ratio', 'decay_time', 'natural_frequency', 'period']
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from thetahat import _thetahat
from thetahat.fits.grey_box import GreyBox, from_template
from thetahat.logs.log import Log

__all__ = [
    "arm",
    "battery",
    "battery2",
    "elevator",
    "exchanger",
    "mechanism",
    "motor",
    "multirotor",
    "names",
    "pendulum",
    "room",
    "room2",
    "spring",
    "summary",
    "tank",
]


def names() -> list[str]:
    """The names of the templates."""
    return [name for name, _ in _thetahat.templates()]


def summary(name: str) -> str:
    """The columns that a template wants, with their units, the numbers that it takes as known, and what it finds.

    Raises
    ------
    ValueError
        If there is no such template.
    """
    every = dict(_thetahat.templates())
    if name not in every:
        raise ValueError(f"name: there is no template {name!r}; there are {', '.join(every)}")
    return every[name]


_F = TypeVar("_F", bound=Callable[..., GreyBox])

_TOLD = """

    Parameters
    ----------
    log : Log
        The data.
    {columns} : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known{numbers}.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """


def _template(*numbers: str) -> Callable[[_F], _F]:
    """A template with these numbers that are taken as known: its docstring says what those of all say, its columns are its own."""

    def told(function: _F) -> _F:
        columns = [name for name in inspect.signature(function).parameters if name not in ("log", "known", "estimate")]
        known = f", and {', '.join(numbers)}" if numbers else ""
        # Python leaves docstrings out where it is asked to (-OO).
        if function.__doc__ is not None:
            function.__doc__ += _TOLD.format(columns=", ".join(columns), numbers=known)
        return function

    return told


def _made(name: str, given: dict[str, Any]) -> GreyBox:
    """The model of a template with the arguments of its function: what is no other argument is a column."""
    columns = dict(given)
    log, known, estimate = (columns.pop(argument) for argument in ("log", "known", "estimate"))
    return from_template(log, name, columns, known or {}, estimate)


@_template("rated_voltage")
def motor(
    log: Log,
    *,
    voltage: str | None = None,
    current: str | None = None,
    speed: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A motor for direct current: its resistance, inductance, torque constant, inertia and friction."""
    return _made("motor", locals())


@_template("max_voltage", "position_error", "velocity_error", "effort", "period")
def mechanism(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of a mechanism that gravity does not move: kS, kV and kA, with gains of feedback."""
    return _made("mechanism", locals())


@_template("max_voltage", "position_error", "velocity_error", "effort", "period")
def elevator(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of an elevator: kS, kV, kA and kG, with gains of feedback."""
    return _made("elevator", locals())


@_template("max_voltage", "position_error", "velocity_error", "effort", "period")
def arm(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    angle: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of an arm: kS, kV, kA, kG and the offset of its angle, with gains of feedback."""
    return _made("arm", locals())


@_template("capacity", "first_soc", "knots")
def battery(
    log: Log,
    *,
    current: str | None = None,
    voltage: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A battery with one RC pair: its resistances, time constant, and table of open-circuit voltages."""
    return _made("battery", locals())


@_template("capacity", "first_soc", "knots")
def battery2(
    log: Log,
    *,
    current: str | None = None,
    voltage: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A battery with two RC pairs: its resistances, time constants, and table of open-circuit voltages."""
    return _made("battery2", locals())


@_template()
def room(
    log: Log,
    *,
    temperature: str | None = None,
    heater: str | None = None,
    outdoor: str | None = None,
    sun: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A room with one heat capacity, a heater, and the sun if it is there."""
    return _made("room", locals())


@_template()
def room2(
    log: Log,
    *,
    temperature: str | None = None,
    heater: str | None = None,
    outdoor: str | None = None,
    sun: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A room with two heat capacities, of air and walls."""
    return _made("room2", locals())


@_template()
def tank(
    log: Log,
    *,
    inflow: str | None = None,
    level: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A tank with an inflow, and an outlet in its floor."""
    return _made("tank", locals())


@_template("gravity")
def pendulum(
    log: Log,
    *,
    angle: str | None = None,
    torque: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A pendulum, driven by a torque or not."""
    return _made("pendulum", locals())


@_template()
def spring(
    log: Log,
    *,
    force: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A mass on a spring with a damper, driven by a force."""
    return _made("spring", locals())


@_template("heat_capacity", "exponent")
def exchanger(
    log: Log,
    *,
    flow: str | None = None,
    outlet: str | None = None,
    inlet: str | None = None,
    medium: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A heat exchanger whose flow changes."""
    return _made("exchanger", locals())


@_template("loop_time")
def multirotor(
    log: Log,
    *,
    command: str | None = None,
    rate: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """An axis of a multirotor: its gain, the lag of its motors and the delay, with gains of a rate loop."""
    return _made("multirotor", locals())

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

from collections.abc import Mapping
from typing import Any

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


def motor(
    log: Log,
    *,
    voltage: str | None = None,
    current: str | None = None,
    speed: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A motor for direct current: its resistance, inductance, torque constant, inertia and friction.

    Parameters
    ----------
    log : Log
        The data.
    voltage, current, speed : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and rated_voltage.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"voltage": voltage, "current": current, "speed": speed}
    return from_template(log, "motor", columns, known or {}, estimate)


def mechanism(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of a mechanism that gravity does not move: kS, kV and kA, with gains of feedback.

    Parameters
    ----------
    log : Log
        The data.
    voltage, velocity, position : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and max_voltage, position_error, velocity_error, effort, period.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"voltage": voltage, "velocity": velocity, "position": position}
    return from_template(log, "mechanism", columns, known or {}, estimate)


def elevator(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of an elevator: kS, kV, kA and kG, with gains of feedback.

    Parameters
    ----------
    log : Log
        The data.
    voltage, velocity, position : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and max_voltage, position_error, velocity_error, effort, period.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"voltage": voltage, "velocity": velocity, "position": position}
    return from_template(log, "elevator", columns, known or {}, estimate)


def arm(
    log: Log,
    *,
    voltage: str | None = None,
    velocity: str | None = None,
    angle: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """The feedforward of an arm: kS, kV, kA, kG and the offset of its angle, with gains of feedback.

    Parameters
    ----------
    log : Log
        The data.
    voltage, velocity, angle : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and max_voltage, position_error, velocity_error, effort, period.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"voltage": voltage, "velocity": velocity, "angle": angle}
    return from_template(log, "arm", columns, known or {}, estimate)


def battery(
    log: Log,
    *,
    current: str | None = None,
    voltage: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A battery with one RC pair: its resistances, time constant, and table of open-circuit voltages.

    Parameters
    ----------
    log : Log
        The data.
    current, voltage : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and capacity, first_soc, knots.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"current": current, "voltage": voltage}
    return from_template(log, "battery", columns, known or {}, estimate)


def battery2(
    log: Log,
    *,
    current: str | None = None,
    voltage: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A battery with two RC pairs: its resistances, time constants, and table of open-circuit voltages.

    Parameters
    ----------
    log : Log
        The data.
    current, voltage : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and capacity, first_soc, knots.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"current": current, "voltage": voltage}
    return from_template(log, "battery2", columns, known or {}, estimate)


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
    """A room with one heat capacity, a heater, and the sun if it is there.

    Parameters
    ----------
    log : Log
        The data.
    temperature, heater, outdoor, sun : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"temperature": temperature, "heater": heater, "outdoor": outdoor, "sun": sun}
    return from_template(log, "room", columns, known or {}, estimate)


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
    """A room with two heat capacities, of air and walls.

    Parameters
    ----------
    log : Log
        The data.
    temperature, heater, outdoor, sun : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"temperature": temperature, "heater": heater, "outdoor": outdoor, "sun": sun}
    return from_template(log, "room2", columns, known or {}, estimate)


def tank(
    log: Log,
    *,
    inflow: str | None = None,
    level: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A tank with an inflow, and an outlet in its floor.

    Parameters
    ----------
    log : Log
        The data.
    inflow, level : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"inflow": inflow, "level": level}
    return from_template(log, "tank", columns, known or {}, estimate)


def pendulum(
    log: Log,
    *,
    angle: str | None = None,
    torque: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A pendulum, driven by a torque or not.

    Parameters
    ----------
    log : Log
        The data.
    angle, torque : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and gravity.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"angle": angle, "torque": torque}
    return from_template(log, "pendulum", columns, known or {}, estimate)


def spring(
    log: Log,
    *,
    force: str | None = None,
    position: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """A mass on a spring with a damper, driven by a force.

    Parameters
    ----------
    log : Log
        The data.
    force, position : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"force": force, "position": position}
    return from_template(log, "spring", columns, known or {}, estimate)


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
    """A heat exchanger whose flow changes.

    Parameters
    ----------
    log : Log
        The data.
    flow, outlet, inlet, medium : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and heat_capacity, exponent.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"flow": flow, "outlet": outlet, "inlet": inlet, "medium": medium}
    return from_template(log, "exchanger", columns, known or {}, estimate)


def multirotor(
    log: Log,
    *,
    command: str | None = None,
    rate: str | None = None,
    known: Mapping[str, float] | None = None,
    estimate: Any = None,
) -> GreyBox:
    """An axis of a multirotor: its gain, the lag of its motors and the delay, with gains of a rate loop.

    Parameters
    ----------
    log : Log
        The data.
    command, rate : str, optional
        Which column is which, where its name does not say.
    known : dict of str to float, optional
        Parameters that are known, and loop_time.
    estimate : slice, str or list of them, optional
        The rows that start values are found from, as for `thetahat.grey`.

    Raises
    ------
    EstimationError
        If the log does not say start values, with the reason.
    ValueError
        If a column is not there, or the template has no such number.
    """
    columns = {"command": command, "rate": rate}
    return from_template(log, "multirotor", columns, known or {}, estimate)

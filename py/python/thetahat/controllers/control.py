"""Controllers for models: designs, what their loops do, and loops that run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Union

import numpy as np
import numpy.typing as npt
from numpy.random import default_rng
from numpy.typing import ArrayLike

from thetahat import _thetahat
from thetahat.base import numbers as _numbers
from thetahat._thetahat import RstController
from thetahat.engine import options as _options
from thetahat.engine.document import Document
from thetahat.models.convert import to_control
from thetahat.models.model import Model

Array = npt.NDArray[np.float64]


class Control(Document):
    """A controller for a model, and the loop that it gives: the document of ``thetahat control``.

    R(q) u(t) = T(q) u_c(t) - S(q) y(t), in deviations from the working point.

    Attributes
    ----------
    r, s, t : ndarray
        The polynomials, in rising powers of q^-1.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.arx(th.dc_motor(), na=2, nb=2)
    >>> found = th.pole_placement(model, [0.8, 0.7])
    >>> found.closed_loop["stable"], round(found.closed_loop["static_gain"], 6)
    (True, 1.0)
    >>> controller = found.controller()
    >>> u = controller.control(1.0, 0.0)
    """

    @property
    def r(self) -> Array:
        """R, from its 1 on."""
        return self._polynomial("r")

    @property
    def s(self) -> Array:
        """S."""
        return self._polynomial("s")

    @property
    def t(self) -> Array:
        """T."""
        return self._polynomial("t")

    @property
    def sample_time(self) -> float:
        """Seconds from one sample to the next."""
        return float(self.document["sample_time"])

    @property
    def closed_loop(self) -> dict[str, Any]:
        """What the loop with the model does: figures, the poles, and the responses as arrays of ``time``."""
        found = dict(self.document["closed_loop"])
        found["poles"] = np.array([complex(pole["re"], pole["im"]) for pole in found["poles"]])
        for name in ("time", "setpoint_response", "controller_output", "load_response"):
            found[name] = np.asarray(found[name], dtype=np.float64)
        return found

    @property
    def stable_share(self) -> float | None:
        """The share of models within the covariance of the parameters that make a stable loop; None where it is not known."""
        robustness = self.document.get("robustness")
        return None if robustness is None else float(robustness["stable_share"])

    def controller(self) -> RstController:
        """The controller, at rest, to be run: it takes and gives deviations from the working point."""
        own = self.document["controller"]
        limits = (own["lowest"], own["highest"])
        return RstController(own["r"], own["s"], own["gain"], own["observer"], limits=limits)

    def to_control(self) -> tuple[Any, Any]:
        """T/R and S/R as transfer functions of python-control: u = T/R u_c - S/R y.

        Raises
        ------
        ImportError
            If python-control is not installed.
        """
        moved = self.document["input"]["name"]
        names = ("set_point", self.document["output"]["name"])
        forward, back = (
            to_control([numerator], [self.r], self.sample_time, [name], moved)
            for numerator, name in zip((self.t, self.s), names)
        )
        return forward, back

    def _polynomial(self, name: str) -> Array:
        return np.asarray(self.document["controller"][name], dtype=np.float64)

    def __repr__(self) -> str:
        return f"Control({self.document['design']})"


def _poles(name: str, given: complex | Sequence[complex]) -> list[tuple[float, float]]:
    """A pole, or several, each as its real and its imaginary part."""
    try:
        each = np.atleast_1d(np.asarray(given, dtype=np.complex128))
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected numbers, found {_numbers.shown(given)}") from error
    if each.ndim != 1 or each.size == 0:
        raise ValueError(f"{name}: expected one or more poles")
    if not np.isfinite(each).all():
        raise ValueError(f"{name}: expected finite numbers, found {_numbers.shown(given)}")
    return [(float(pole.real), float(pole.imag)) for pole in each]


def _designed(
    model: Model,
    design: str,
    aim: list[tuple[float, float]] | float,
    input: str | None,
    output: str | None,
    integrator: bool,
    limits: tuple[float | None, float | None] | None,
    draws: int,
    observer: complex | Sequence[complex] | None = None,
    cancel_zeros: bool = False,
) -> Control:
    model = Model._read("model", model)
    low, high = (None, None) if limits is None else limits
    return Control(
        *_thetahat.control(
            model._model,
            design,
            aim if isinstance(aim, list) else [(aim, 0.0)],
            None if observer is None else _poles("observer", observer),
            (None if input is None else _options.text("input", input), None if output is None else _options.text("output", output)),
            (bool(integrator), bool(cancel_zeros)),
            (-math.inf if low is None else float(low), math.inf if high is None else float(high)),
            _options.count("draws", draws, 100_000),
        )
    )


def pole_placement(
    model: Model,
    poles: complex | Sequence[complex],
    *,
    observer: complex | Sequence[complex] | None = None,
    input: str | None = None,
    output: str | None = None,
    integrator: bool = True,
    cancel_zeros: bool = False,
    limits: tuple[float | None, float | None] | None = None,
    draws: int = 500,
) -> Control:
    """A controller that places the poles of the loop with a linear model.

    Parameters
    ----------
    model : Model
        Any linear model.
    poles : complex or sequence of complex
        Of the response to the set point, in the z plane, with their conjugates.
    observer : complex or sequence of complex, optional
        By which noise and errors are forgotten: the zeros of the noise model if not given.
    input, output : str, optional
        What it moves and what it holds, if there are several.
    integrator : bool, default True
        Whether it integrates, so that loads leave no error.
    cancel_zeros : bool, default False
        Whether the zeros of the model are cancelled.
    limits : (lower, upper), optional
        The range of the actuator, in the unit of the input.
    draws : int, default 500
        How many models are drawn from the covariance of the parameters.

    Returns
    -------
    Control

    Raises
    ------
    ValueError
        For models that are not linear, poles outside of the unit circle, and designs that the model does not allow.

    Notes
    -----
    Åström and Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, chapter 5.
    """
    return _designed(model, "poles", _poles("poles", poles), input, output, integrator, limits, draws, observer, cancel_zeros)


def lqr(
    model: Model,
    weight: float,
    *,
    observer: complex | Sequence[complex] | None = None,
    input: str | None = None,
    output: str | None = None,
    integrator: bool = True,
    limits: tuple[float | None, float | None] | None = None,
    draws: int = 500,
) -> Control:
    """The controller of the least sum of y² + weight u² for a linear model; with an integrator, of the changes of u.

    Parameters
    ----------
    model : Model
        Any linear model.
    weight : float
        Above 0.
    observer, input, output, integrator, limits, draws
        As for `pole_placement`.

    Returns
    -------
    Control
        With ``document["state_feedback"]``, the gains of the controllable form.

    Raises
    ------
    ValueError
        As for `pole_placement`.

    Notes
    -----
    Åström and Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, chapters 11 and 12.
    """
    weight = float(_options.number("weight", weight))
    return _designed(model, "lqr", weight, input, output, integrator, limits, draws, observer)


def minimum_variance(
    model: Model,
    weight: float = 0.0,
    *,
    input: str | None = None,
    output: str | None = None,
    integrator: bool = True,
    limits: tuple[float | None, float | None] | None = None,
    draws: int = 500,
) -> Control:
    """The controller of the least variance of y, and of weight u² beside it, for a model with noise.

    Parameters
    ----------
    model : Model
        Any linear model.
    weight : float, default 0
        0 needs a model whose zeros are inside the unit circle; with an integrator it weighs the changes of u.
    input, output, integrator, limits, draws
        As for `pole_placement`.

    Returns
    -------
    Control

    Raises
    ------
    ValueError
        As for `pole_placement`.

    Notes
    -----
    Åström, Introduction to Stochastic Control Theory, 1970, chapter 6; Clarke and Gawthrop, Proc. IEE 122, 1975.
    """
    weight = float(_options.number("weight", weight))
    return _designed(model, "minimum-variance", weight, input, output, integrator, limits, draws)


class Controller(Protocol):
    """What a loop needs of a controller: `RstController`, `SelfTuner`, or one of your own."""

    def control(self, set_point: float, y: float, /) -> float:
        """The input from now on."""


Plant = Union[Model, Callable[[float], float]]


@dataclass(frozen=True)
class LoopRun:
    """What happened in a loop, sample by sample.

    Attributes
    ----------
    set_point : ndarray, shape (samples,)
        What the output should be, in the unit of the output.
    y : ndarray, shape (samples,)
        What was measured.
    u : ndarray, shape (samples,)
        What the controller asked for, in the unit of the input; the load is not in it.
    """

    set_point: Array
    y: Array
    u: Array


def closed_loop(
    controller: Controller,
    plant: Plant,
    set_point: ArrayLike,
    *,
    load: ArrayLike = 0.0,
    noise: bool = True,
    seed: int = 1,
) -> LoopRun:
    """Run a controller with a simulated plant.

    Parameters
    ----------
    controller : Controller
        An `RstController`, a `SelfTuner`, or any object with ``control(set_point, y)``. It learns and remembers.
    plant : Model or callable
        A linear model with one input and one output, in deviations from its working point; or a function that is called once a sample with
        the input of the sample before, and returns what is measured.
    set_point : array_like
        One for each sample.
    load : float or array_like, default 0
        What is added to the input of the plant.
    noise : bool, default True
        Whether the noise of the model acts.
    seed : int, default 1
        Which noise.

    Returns
    -------
    LoopRun

    Raises
    ------
    ValueError
        For models with several inputs or outputs, and set points that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> model = th.arx(th.dc_motor(), na=2, nb=2)
    >>> controller = th.pole_placement(model, [0.8, 0.7]).controller()
    >>> run = th.closed_loop(controller, model, np.ones(200), load=0.1, noise=False)
    >>> bool(abs(run.y[-1] - 1) < 1e-3)
    True
    """
    wanted = np.atleast_1d(np.asarray(set_point, dtype=np.float64))
    if wanted.ndim != 1 or not np.isfinite(wanted).all():
        raise ValueError("set_point: expected finite numbers, one for each sample")
    loads = np.broadcast_to(np.asarray(load, dtype=np.float64), wanted.shape)
    # A system of python-control can be called, too, with a frequency.
    if isinstance(plant, Model) or hasattr(plant, "dt") or not callable(plant):
        step = _stepped(Model._read("plant", plant), len(wanted), noise, seed)
    else:
        step = plant
    measured, applied = np.empty(len(wanted)), np.empty(len(wanted))
    u = 0.0
    for sample, target in enumerate(wanted):
        measured[sample] = step(u)
        applied[sample] = controller.control(float(target), float(measured[sample]))
        u = applied[sample] + loads[sample]
    return LoopRun(wanted, measured, applied)


def _stepped(model: Model, samples: int, noise: bool, seed: int) -> Callable[[float], float]:
    """A model as a function from the input of the sample before to the output, from rest."""
    space = model.to_state_space()
    if space.G.shape[1] != 1 or space.H.shape[0] != 1:
        raise ValueError("plant: expected a model with one input and one output")
    if np.any(space.D != 0):
        raise ValueError("plant: its input acts at once, so that there is no loop without a delay")
    deviation = np.sqrt(np.asarray(model.noise_covariance)[0, 0]) if noise else 0.0
    disturbances = iter(deviation * default_rng(seed).standard_normal(samples + 1))
    x, e = np.zeros(space.F.shape[0]), 0.0
    first = True

    def step(u: float) -> float:
        nonlocal x, e, first
        if not first:
            x = space.F @ x + space.G[:, 0] * u + space.K[:, 0] * e
        first = False
        e = float(next(disturbances))
        return float(space.H[0] @ x + e)

    return step

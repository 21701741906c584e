"""Fits: from a log to a model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from thetahat import _thetahat
from thetahat.base import said as _said
from thetahat.base.said import EstimationWarning
from thetahat.engine import options as _options, progress as _progress
from thetahat.engine.option_types import FitOptions, ImpulseResponseOptions
from thetahat.engine.progress import Progress
from thetahat.engine.values import Order, Orders
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.logs.log import Log, handle
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack


@_options.takes(FitOptions)
def arx(
    log: Log,
    na: Order,
    nb: Orders,
    nk: Orders = 1,
    *,
    couple: Literal["full", "none", "auto"] | None = None,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit an ARX model, A(q) y(t) = B(q) u(t) + e(t), by least squares.

    With several outputs A and B are polynomials with matrices for coefficients; the model is one in state space that has them, and
    its report names them.

    Parameters
    ----------
    log : Log
        The data.
    na : int
        Coefficients of A: past outputs; with several outputs a range too, among which the least MDL chooses.
    nb : int, or one for each input
        Coefficients of B.
    nk : int, or one for each input
        Samples from input to first effect.
    couple : {"full", "none", "auto"}, optional
        With several outputs: whether an output depends on the past of all or of its own. "auto", which is taken unless it is said: what
        has the least MDL.
    **options
        What to fit to and how, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError
        If the data cannot determine the parameters, which are named, or the log has too few rows for them.
    ValueError
        If an argument does not make sense, or no row to fit to has a value in every channel.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Notes
    -----
    The normal equations are made of lagged products and corrected with true residuals; where they are not exact enough, QR
    takes over. O(N (na + nb)) operations. Ljung, System Identification, 2nd ed. 1999, section 7.3.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.arx(th.dc_motor(), na=2, nb=2, estimate="1..700")
    >>> model.parameters.round(4)
    array([-1.5407,  0.5765,  0.3601,  0.3174])
    >>> model.parameter_names
    ['a1', 'a2', 'b1', 'b2']

    With two outputs, of which the second follows the first:

    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> u, y = rng.normal(size=500), np.zeros((500, 2))
    >>> for k in range(1, 500):
    ...     y[k] = [0.8 * y[k - 1, 0] + u[k - 1], 0.5 * y[k - 1, 1] + 0.3 * y[k - 1, 0]]
    ...     y[k] += 0.1 * rng.normal(size=2)
    >>> found = th.arx(th.Log(y, u, sample_time=1), na=1, nb=1)
    >>> [round(entry["value"], 1) for entry in found.document["estimation"]["a"][0][1]]
    [-0.3, -0.5]
    >>> [round(found.dc_gain(output=name)[0]) for name in found.outputs]
    [5, 3]
    """
    return fitted(log, {"model": "arx", "na": na, "nb": nb, "nk": nk, "couple": couple}, options)


@_options.takes(FitOptions)
def armax(
    log: Log,
    na: int,
    nb: Orders,
    nc: int,
    nk: Orders = 1,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit an ARMAX model, A(q) y(t) = B(q) u(t) + C(q) e(t), by prediction errors.

    Parameters
    ----------
    log : Log
        The data.
    na, nb, nc : int
        Coefficients of A, B and C; nb may be one for each input.
    nk : int, or one for each input
        Samples from input to first effect.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.armax(th.dc_motor(), na=2, nb=2, nc=1)
    >>> model.c.round(3)
    array([ 1.   , -0.628])
    """
    return fitted(log, {"model": "armax", "na": na, "nb": nb, "nc": nc, "nk": nk}, options)


@_options.takes(FitOptions)
def oe(
    log: Log,
    nb: Orders,
    nf: Orders,
    nk: Orders = 1,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit an output error model, y(t) = B(q)/F(q) u(t) + e(t), by prediction errors.

    Standard errors hold for coloured noise too.

    Parameters
    ----------
    log : Log
        The data.
    nb, nf : int, or one for each input
        Coefficients of B and F.
    nk : int, or one for each input
        Samples from input to first effect.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> th.oe(th.dc_motor(), nb=2, nf=2).structure
    'oe'
    """
    return fitted(log, {"model": "oe", "nb": nb, "nf": nf, "nk": nk}, options)


@_options.takes(FitOptions)
def bj(
    log: Log,
    nb: Orders,
    nc: int,
    nd: int,
    nf: Orders,
    nk: Orders = 1,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit a Box-Jenkins model, y(t) = B(q)/F(q) u(t) + C(q)/D(q) e(t), by prediction errors.

    Parameters
    ----------
    log : Log
        The data.
    nb, nc, nd, nf : int
        Coefficients of B, C, D and F; nb and nf may be one for each input.
    nk : int, or one for each input
        Samples from input to first effect.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.bj(th.dc_motor(), nb=2, nc=0, nd=1, nf=2)
    >>> abs(model.poles()).round(2)
    array([0.89, 0.69])
    """
    return fitted(log, {"model": "bj", "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk}, options)


@_options.takes(FitOptions)
def ar(
    log: Log,
    na: int,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit an autoregressive model of a time series, A(q) y(t) = e(t); inputs of the log are left out.

    Parameters
    ----------
    log : Log
        The data.
    na : int
        Coefficients of A.
    **options
        What to fit to and how, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> y = 0.9 ** np.arange(50) * np.cos(0.3 * np.arange(50))
    >>> bool(np.isclose(th.ar(th.Log(y), na=2, detrend="none").a[1], -1.8 * np.cos(0.3)))
    True
    """
    return fitted(log, {"model": "ar", "na": na}, options)


@_options.takes(FitOptions)
def arma(
    log: Log,
    na: int,
    nc: int,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit an ARMA model of a time series, A(q) y(t) = C(q) e(t); inputs of the log are left out.

    Parameters
    ----------
    log : Log
        The data.
    na, nc : int
        Coefficients of A and C.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> th.arma(th.dc_motor(), na=2, nc=1).orders["nc"]
    1

    Missing outputs are no gaps to the exact likelihood, and no sample is left out:

    >>> import numpy as np
    >>> y = th.dc_motor()["y"].copy()
    >>> y[::4] = np.nan
    >>> model = th.arma(th.Log(y), na=2, nc=1, likelihood="exact")
    >>> model.method, model.samples
    ('exact-likelihood', 750)
    """
    return fitted(log, {"model": "arma", "na": na, "nc": nc}, options)


@_options.takes(FitOptions)
def general(
    log: Log,
    na: int = 0,
    nb: Orders | None = None,
    nc: int = 0,
    nd: int = 0,
    nf: Orders | None = None,
    nk: Orders | None = None,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit the general model, A(q) y(t) = B(q)/F(q) u(t) + C(q)/D(q) e(t), by prediction errors.

    Parameters
    ----------
    log : Log
        The data.
    na, nb, nc, nd, nf : int
        Coefficients of the polynomials; nb and nf may be one for each input.
    nk : int, or one for each input
        Samples from input to first effect: 1, unless said otherwise.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> th.general(th.dc_motor(), na=1, nb=2, nf=1, nd=1).structure
    'general'
    """
    return fitted(log, {"model": "general", "na": na, "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk}, options)


@_options.takes(ImpulseResponseOptions)
def fir(
    log: Log,
    taps: int | Sequence[int],
    kernel: Literal["dc", "tc"] | None = "dc",
    nk: Orders = 0,
    **options: Unpack[ImpulseResponseOptions],
) -> Model:
    """Fit an impulse response, y(t) = g(0) u(t - nk) + g(1) u(t - nk - 1) + ... + e(t), by regularised least squares.

    Parameters
    ----------
    log : Log
        The data.
    taps : int, or one for each input
        How many values the response has.
    kernel : {"dc", "tc"} or None, default "dc"
        What is known of it before the data: that it decays and is smooth. Decay and smoothness each have a number of their own
        ("dc"), or one for both ("tc"), which the likelihood says. None is least squares.
    nk : int, or one for each input, default 0
        Samples from input to first effect.
    **options
        What to fit to, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        A polynomial model, B alone: its impulse, step and frequency responses have bands.

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Notes
    -----
    Chen, Ohlsson and Ljung, Automatica 48, 2012.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.fir(th.dc_motor(), taps=30)
    >>> model.method
    'regularised'
    >>> len(model.parameters)
    30
    """
    own = {"model": "fir", "taps": taps, "kernel": "none" if kernel is None else kernel, "nk": nk}
    return fitted(log, own, options)


@_options.takes(FitOptions)
def fit(
    log: Log,
    *,
    narx: Literal["none"] | None = None,
    plan: Model | Mapping[str, Any] | None = None,
    progress: Progress = None,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit the model that the data ask for, or the one that a plan says.

    Delay, structure and orders are chosen. A step test may come to a process in continuous time (see `process`), so may a level that follows
    the sum of its input; a plant of many modes to a model in state space (see `ss`), one that is far from linear to a nonlinear ARX model
    (see `narx`). What was found in the log and what was done because of it is in `Model.decisions`, what was compared in `Model.selection`.

    Parameters
    ----------
    log : Log
        The data.
    narx : {"none"}, optional
        No nonlinear model.
    plan : Model or dict, optional
        Repeat the fit of this model, of any kind but one in equations: its `Model.plan`, or such a dict. Options that are given beside it
        come in the place of its own.
    progress : bool or callable, optional
        True shows how far it is, by tqdm if that is installed; a function is called with how many models or iterations are done, of how
        many, where that is known, and the least cost so far.
    **options
        What to fit to and what the model is for, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        The one that was chosen, fitted to all rows but those of a test part.

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> th.fit(th.dc_motor()).kind
    'polynomial'
    >>> model = th.oe(th.dc_motor(), nb=2, nf=2)
    >>> model.plan
    {'input': ['u'], 'output': ['y'], 'model': 'oe', 'nb': [2], 'nf': [2], 'nk': [1]}
    >>> th.fit(th.dc_motor(), plan=model) == model
    True
    """
    if plan is not None:
        known = plan.plan if isinstance(plan, Model) else dict(plan)
        if known is None:
            raise ValueError("plan: the document of this model has none; fit it again")
        chosen = log.select(inputs=known.pop("input", None), output=known.pop("output", None))
        given = json.loads(_options.plan({"narx": narx, **options}, len(log)))
        with _progress.told(progress, "fit"):
            return told(Model._of(_thetahat.fit(handle("log", chosen), json.dumps({**known, **given}))))
    if isinstance(log, Log) and len(log.outputs) > 1 and not log.inputs:
        *others, last = log.outputs
        raise ValueError(
            f"log: {', '.join(others)} and {last} are all outputs, and there is no input; give the inputs apart, as "
            f"Log(frame[{last!r}], frame[{others!r}])"
        )
    with _progress.told(progress, "fit"):
        return fitted(log, {"narx": narx}, options)



@_options.takes(FitOptions)
def search(
    log: Log,
    model: Literal["arx", "armax", "oe", "bj", "ar", "arma", "general"] | None = None,
    *,
    na: Orders | None = None,
    nb: Orders | None = None,
    nc: Orders | None = None,
    nd: Orders | None = None,
    nf: Orders | None = None,
    nk: Orders | None = None,
    select: str | None = None,
    path: Literal["all", "alternate"] | None = None,
    progress: Progress = None,
    **options: Unpack[FitOptions],
) -> Model:
    """Choose a model among many, all compared on the same samples.

    Without orders the data choose delay, structure and orders, as `fit` has it. `Model.selection` holds what was compared.

    Parameters
    ----------
    log : Log
        The data.
    model : {"arx", "armax", "oe", "bj", "ar", "arma", "general"}, optional
        The structure: ARX where orders are given, unless said otherwise.
    na, nb, nc, nd, nf, nk : int or range
        Orders, or those among which to choose: ``range(1, 9)`` is 1 to 8. nb, nf and nk may be one for each input.
    select : {"mdl", "aic", "aicc", "fpe", "hqc", "validation", "cv"}
        What makes one model better than another: MDL, unless said otherwise.
    path : {"all", "alternate"}
        Which are tried: all of them, or one order up at a time.
    progress : bool or callable, optional
        True shows how far it is, by tqdm if that is installed; a function is called with how many models or iterations are done, of how
        many, where that is known, and the least cost so far.
    **options
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        The one that was chosen, fitted to all rows but those of a test part.

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Examples
    --------
    >>> import thetahat as th
    >>> model = th.search(th.dc_motor(), model="oe", nb=range(1, 4), nf=range(1, 4), nk=range(1, 3))
    >>> model.selection["models"]
    17
    """
    own = {"model": model, "na": na, "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk, "select": select, "path": path}
    with _progress.told(progress, "search"):
        return fitted(log, own, options)


def fitted(log: Log | MeasuredResponse, own: Mapping[str, Any], options: Mapping[str, Any]) -> Model:
    """A fit by one of the functions that users call: with its own arguments and its options."""
    if isinstance(log, MeasuredResponse):
        return told(Model._of(_thetahat.fit_response(log.to_json(), _options.plan({**own, **options}))))
    data = handle("log", log)
    return told(Model._of(_thetahat.fit(data, _options.plan({**own, **options}, len(log)))))


def told(model: Model) -> Model:
    """A model of whose warnings the caller is told."""
    _said.LOGGER.info("fitted %s", model.name)
    for warning in model._model.warnings():
        _said.warn(warning, EstimationWarning)
    return model

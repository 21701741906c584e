"""Models in state space, with any number of outputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from thetahat.base import numbers as _numbers
from thetahat.engine import options as _options
from thetahat.engine.option_types import StateSpaceOptions
from thetahat.engine.values import Orders
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack


@_options.takes(StateSpaceOptions)
def ss(
    log: Log | MeasuredResponse,
    order: int | range | None = None,
    *,
    nk: int | Sequence[int] | None = None,
    **options: Unpack[StateSpaceOptions],
) -> Model:
    """Fit a state-space model, x(t+1) = F x(t) + G u(t) + K e(t), y(t) = H x(t) + D u(t) + e(t), by a subspace method.

    The states are found first, from a long vector ARX model (SSARX), then the matrices by least squares. It is consistent where a
    controller feeds outputs back to the inputs.

    Parameters
    ----------
    log : Log or MeasuredResponse
        The data, with any number of inputs and outputs. Without inputs it is a time series. Or a frequency response: the model is
        that of the least weighted squared errors, all inputs having the same poles, in continuous time where the response is. It takes
        ``order``, ``nk``, ``feedthrough`` and the search.
    order : int or range, optional
        How many states; or among how many to choose by MDL: ``range(1, 11)`` are 1 to 10. From 1 to 20 unless it is said, of a
        frequency response 1 to 10.
    nk : int, or one for each input, optional
        Samples from input to first effect. Without it an input acts one sample later, or at once if ``feedthrough`` says so.
    weighting : {"ssarx", "moesp", "n4sid", "cva"}, optional
        Which subspace method. All but the first project on future inputs, and are biased where inputs are fed back.
    past, future : int, optional
        The number of past samples from which the states are computed, by default that of the least AIC, and the number of future samples
        that they predict, by default as many.
    feedthrough : bool, optional
        Whether inputs act on the outputs in the same sample. By default if that lowers MDL and there is no feedback to the inputs.
    refine : {"prediction", "simulation"}, optional
        Refine the model by a search for the least errors one step ahead, or of the free run. Poles, gains and responses then have
        standard errors.
    search, max_iterations, tolerance, time_limit
        How to search, see `thetahat.FitOptions`.
    estimate, validate, split, detrend, offset, constant
        What to fit to, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        Its `Model.kind` is ``"state-space"``.

    Raises
    ------
    EstimationError
        If the data cannot determine the states: too few rows, a constant channel, outputs that depend on one another.
    ValueError
        If an argument does not make sense, or no row to fit to has a value in every channel.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    References
    ----------
    Jansson, Subspace identification and ARX modeling, IFAC SYSID 2003. Chiuso, Automatica 43, 2007.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> rng = np.random.default_rng(0)
    >>> u, x = rng.normal(size=(1000, 2)), np.zeros(1001)
    >>> for k in range(1000):
    ...     x[k + 1] = 0.8 * x[k] + u[k, 0] - 0.5 * u[k, 1]
    >>> y = np.column_stack([x[:-1], 2 * x[:-1]]) + 0.1 * rng.normal(size=(1000, 2))
    >>> model = th.ss(th.Log(y, u, sample_time=1))
    >>> model.name, model.poles().real.round(2).tolist()
    ('state space of order 1', [0.8])
    >>> [round(model.dc_gain("u2", output="y2")[0], 1), model.to_state_space().H.shape]
    [-5.0, (2, 1)]
    >>> refined = th.ss(th.Log(y, u, sample_time=1), 1, refine="prediction")
    >>> value, error = refined.dc_gain("u2", output="y2")
    >>> abs(value + 5) < 3 * error
    True
    """
    return fitted(log, states(order, nk), options)


def states(order: int | range | str | None, nk: Orders | None) -> dict[str, Any]:
    """What asks for a model in state space; the order "auto" is left to the data, as none is."""
    if isinstance(order, str) and order != "auto":
        raise TypeError(f'order: expected an int, a range or "auto", found {_numbers.shown(order)}')
    return {"model": "ss", "order": None if isinstance(order, str) else order, "nk": nk}

"""Seasonal ARIMA models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from thetahat.engine import options as _options
from thetahat.engine.option_types import ArimaOptions
from thetahat.engine.values import Orders
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack


@_options.takes(ArimaOptions)
def arima(
    log: Log,
    order: Sequence[int],
    seasonal: Sequence[int] | None = None,
    *,
    nk: Orders | None = None,
    **options: Unpack[ArimaOptions],
) -> Model:
    """Fit a seasonal ARIMA model of a time series by its exact likelihood.

    y(t) = constant + drift t + b0 u(t) + z(t), where the differences of z are an ARMA process of few factors,
    phi(q) Phi(q^s) (1 - q^-1)^d (1 - q^-s)^D z(t) = theta(q) Theta(q^s) e(t).

    Parameters
    ----------
    log : Log
        The data: one output, and inputs if there are any, which act on it beside z. Outputs may be missing.
    order : (int, int, int)
        p, d and q: autoregressive parameters, differences, and parameters of the moving average.
    seasonal : (int, int, int, int), optional
        P, D, Q and s: the same over seasons, and the rows that a season has.
    nk : int, or one for each input, optional
        Samples from input to effect: 0, in the same row, unless said otherwise.
    constant : bool or "auto", optional
        Whether the output has a level that is estimated, as its first parameter. By default it has one if it is not differenced.
    trend : bool, optional
        Whether it has a drift for each row that is estimated. Not where it is differenced more than once, which takes the drift too.
    **options
        What to fit to and how to search.

    Returns
    -------
    Model
        A polynomial model, y = B u + C/D e, whose C and D are the products of the factors. `Model.parameters` are those of the factors,
        such as ``ar1``, ``ma1``, ``sar12`` and ``sma12``, with the signs phi = 1 - ar1 q^-1 - ... and theta = 1 + ma1 q^-1 + ...

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Notes
    -----
    The likelihood is that of the differences, which begin with their stationary covariance: that of statsmodels'
    ``SARIMAX(..., simple_differencing=True)``. Its default begins with a diffuse state and leaves the first d + s D samples out, which
    is the same but for what the diffuse state is approximated by. Constant and trend are those of statsmodels' ``ARIMA``, t
    counted from 0. `Model.aic` and `Model.bic` count as statsmodels does; the noise variance is that of largest likelihood, and
    forecasts have no part for parameters that are estimates.

    Box and Jenkins, Time Series Analysis: Forecasting and Control, 1970, chapter 9; Pearlman, Biometrika 67, 1980.

    Examples
    --------
    Monthly passengers of airlines, whose logarithm has seasons of a constant size (Box and Jenkins, series G):

    >>> import numpy as np
    >>> import thetahat as th
    >>> month = np.arange(120)
    >>> rng = np.random.default_rng(0)
    >>> passengers = np.exp(5 + 0.01 * month + 0.2 * np.sin(2 * np.pi * month / 12) + 0.02 * rng.normal(size=120).cumsum())
    >>> model = th.arima(th.Log(np.log(passengers), sample_time=1), order=(0, 1, 1), seasonal=(0, 1, 1, 12))
    >>> model.parameter_names
    ['ma1', 'sma12']

    Forecasts are of the logarithm; the ends of its intervals, as exponentials, are those of the passengers.

    >>> ahead = model.forecast(th.Log(np.log(passengers), sample_time=1), steps=12)
    >>> np.exp(ahead.values).shape
    (12,)
    """
    for name, values, count in (("order", order, 3), ("seasonal", seasonal, 4)):
        if values is not None and (isinstance(values, str) or len(values) != count):
            raise ValueError(f"{name}: give {count} numbers, such as {'(0, 1, 1)' if count == 3 else '(0, 1, 1, 12)'}, found {values!r}")
    own = {"model": "arima", "order": order, "seasonal": seasonal, "nk": nk, "input": list(log.inputs) or None}
    return fitted(log, own, options)

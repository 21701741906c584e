"""Seasonal ARIMA models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from thetahat.engine import options as _options
from thetahat.engine.option_types import ArimaOptions
from thetahat.engine.values import Orders
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log, handle
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
    constant : {"auto", "yes", "no"}, optional
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
    Monthly passengers of airlines (Box and Jenkins, series G), whose seasons grow with their level: the logarithm is fitted.

    >>> import numpy as np
    >>> import thetahat as th
    >>> passengers = np.array(
    ...     "112 118 132 129 121 135 148 148 136 119 104 118 115 126 141 135 125 149 170 170 158 133 114 140 "
    ...     "145 150 178 163 172 178 199 199 184 162 146 166 171 180 193 181 183 218 230 242 209 191 172 194 "
    ...     "196 196 236 235 229 243 264 272 237 211 180 201 204 188 235 227 234 264 302 293 259 229 203 229 "
    ...     "242 233 267 269 270 315 364 347 312 274 237 278 284 277 317 313 318 374 413 405 355 306 271 306 "
    ...     "315 301 356 348 355 422 465 467 404 347 305 336 340 318 362 348 363 435 491 505 404 359 310 337 "
    ...     "360 342 406 396 420 472 548 559 463 407 362 405 417 391 419 461 472 535 622 606 508 461 390 432".split(),
    ...     dtype=float,
    ... )
    >>> log = th.Log(np.log(passengers), sample_time=1)
    >>> model = th.arima(log, order=(0, 1, 1), seasonal=(0, 1, 1, 12))
    >>> {name: round(float(value), 3) for name, value in zip(model.parameter_names, model.parameters)}
    {'ma1': -0.402, 'sma12': -0.557}
    >>> round(model.log_likelihood, 2), round(model.aic, 2)
    (244.7, -483.39)

    Forecasts and their intervals are of the logarithm too; the exponentials of their ends are those of the passengers.

    >>> ahead = model.forecast(log, steps=3)
    >>> np.exp(ahead.values).round()
    array([450., 426., 479.])
    >>> np.exp(ahead.interval(0.95)).round()
    array([[419., 484.],
           [391., 463.],
           [436., 526.]])
    """
    for name, values, count in (("order", order, 3), ("seasonal", seasonal, 4)):
        if values is not None and (isinstance(values, str) or len(values) != count):
            raise ValueError(f"{name}: give {count} numbers, such as {'(0, 1, 1)' if count == 3 else '(0, 1, 1, 12)'}, found {values!r}")
    data = handle("log", log)
    if len(data.outputs) > 1:
        raise ValueError(f"log: it has {len(data.outputs)} outputs ({', '.join(data.outputs)}), and the model one; take it with log.select(output=...)")
    own = {"model": "arima", "order": order, "seasonal": seasonal, "nk": nk, "input": list(log.inputs) or None}
    return fitted(log, own, options)

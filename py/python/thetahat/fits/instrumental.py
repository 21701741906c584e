"""Fits by instrumental variables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thetahat.engine import options as _options
from thetahat.engine.option_types import FitOptions
from thetahat.engine.values import Orders
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack


@_options.takes(FitOptions)
def iv(
    log: Log,
    na: int,
    nb: Orders,
    nk: Orders = 1,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit A and B of an ARX model by instrumental variables in four stages: right about the plant whatever the noise.

    Parameters
    ----------
    log : Log
        The data.
    na, nb, nk
        As for `arx`.
    **options
        What to fit to, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Notes
    -----
    Ljung, System Identification, 2nd ed. 1999, section 15.3.

    Examples
    --------
    >>> import thetahat as th
    >>> th.iv(th.dc_motor(), na=2, nb=2).method
    'instrumental-variables'
    """
    return fitted(log, {"model": "arx", "method": "iv", "na": na, "nb": nb, "nk": nk}, options)


@_options.takes(FitOptions)
def sriv(
    log: Log,
    nb: Orders,
    nf: Orders,
    nk: Orders = 1,
    **options: Unpack[FitOptions],
) -> Model:
    """Fit B and F of an output error model by refined instrumental variables: right about the plant whatever the noise.

    Parameters
    ----------
    log : Log
        The data.
    nb, nf, nk
        As for `oe`.
    **options
        What to fit to, see `thetahat.FitOptions`.

    Returns
    -------
    Model

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Notes
    -----
    Young, Recursive Estimation and Time-Series Analysis, 2nd ed. 2011, chapter 7.

    Examples
    --------
    >>> import thetahat as th
    >>> th.sriv(th.dc_motor(), nb=2, nf=2).method
    'refined-instrumental-variables'
    """
    return fitted(log, {"model": "oe", "method": "sriv", "nb": nb, "nf": nf, "nk": nk}, options)

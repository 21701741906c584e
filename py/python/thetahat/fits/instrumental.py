"""Fits by instrumental variables."""

from __future__ import annotations

from collections.abc import Mapping

from thetahat.engine.options import Band, Orders, Rows
from thetahat.fits.fit import _fit
from thetahat.logs.log import Log
from thetahat.models.model import Model


def iv(
    log: Log,
    na: int,
    nb: Orders,
    nk: Orders = 1,
    *,
    estimate: Rows | None = None,
    validate: Rows | None = None,
    split: tuple[float, float, float] | None = None,
    detrend: str | None = None,
    offset: Mapping[str, float] | None = None,
    prefilter: Band | None = None,
    initial: str | None = None,
    constant: str | None = None,
    trend: bool | None = None,
) -> Model:
    """Fit A and B of an ARX model by instrumental variables in four stages: right about the plant whatever the noise.

    Parameters
    ----------
    log : Log
        The data.
    na, nb, nk
        As for `arx`.
    estimate, validate, split, detrend, offset, prefilter, initial, constant, trend
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
    return _fit("arx", locals(), "--method=iv")


def sriv(
    log: Log,
    nb: Orders,
    nf: Orders,
    nk: Orders = 1,
    *,
    estimate: Rows | None = None,
    validate: Rows | None = None,
    split: tuple[float, float, float] | None = None,
    detrend: str | None = None,
    offset: Mapping[str, float] | None = None,
    prefilter: Band | None = None,
    initial: str | None = None,
    constant: str | None = None,
    trend: bool | None = None,
) -> Model:
    """Fit B and F of an output error model by refined instrumental variables: right about the plant whatever the noise.

    Parameters
    ----------
    log : Log
        The data.
    nb, nf, nk
        As for `oe`.
    estimate, validate, split, detrend, offset, prefilter, initial, constant, trend
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
    return _fit("oe", locals(), "--method=sriv")

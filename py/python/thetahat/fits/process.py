"""Processes and transfer functions in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from thetahat.engine import options as _options
from thetahat.engine.option_types import ProcessOptions
from thetahat.experiments.spectrum import MeasuredResponse
from thetahat.fits.fit import fitted
from thetahat.logs.log import Log
from thetahat.models.model import Model

if TYPE_CHECKING:
    from typing_extensions import Unpack


@_options.takes(ProcessOptions)
def process(
    log: Log | MeasuredResponse,
    structure: str | Sequence[str] = "p1d",
    **options: Unpack[ProcessOptions],
) -> Model:
    """Fit a process in continuous time, such as y = K e^(-theta s)/(1 + tau s) u, by the least errors of its free run.

    Inputs are held from row to row and the response is exact at the times of the rows: the clock may be irregular, and the dead
    time need not be a number of samples.

    Parameters
    ----------
    log : Log or MeasuredResponse
        The data, read with ``uniform=False`` if its clock is irregular. It begins at rest, unless ``initial`` says otherwise. Or the
        frequency response that `spectrum` found, of which the process comes closest to the points, in units of their errors.
    structure : str, or one for each input, default "p1d"
        ``p``, how many lags (0 to 3), and letters: ``d`` with a dead time, ``z`` with a zero, ``i`` with an integrator, ``u`` with two
        lags that may be underdamped. Or ``rc1``, ``rc2``, ``rc3``: lags side by side with a direct term, as batteries have them. Or
        ``tf``, the numbers of poles and zeros, and ``d`` or ``i``: what `tf` fits.
    initial : {"zero", "estimate"}
        Whether each log begins at rest with the inputs of its first row, which is the default, or in a state that is estimated.
    trend : bool
        Whether the output has a slope of its own.
    offset : dict of str to float
        Offsets that are known. That of an input is else its first value; that of the output is estimated.
    estimate, validate, split, search, max_iterations, tolerance, step, starts, time_limit
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        Of kind "process". Standard errors are for errors of any colour.

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> t = np.arange(100.0)
    >>> u = np.where(t < 10, 0.0, 1.0)
    >>> u[60:] = -0.5
    >>> y = 2 * (t > 11.5) * (1 - np.exp(-(t - 11.5) / 8))
    >>> y -= 3 * (t > 61.5) * (1 - np.exp(-(t - 61.5) / 8))
    >>> model = th.process(th.Log(y, u, sample_time=1), "p1d")
    >>> dict(zip(model.parameter_names, np.round(model.parameters, 3).tolist()))
    {'K': 2.0, 'tau': 8.0, 'theta': 1.5}
    """
    names = [structure] if isinstance(structure, str) else list(structure)
    named = ",".join(_options.text("structure", name) for name in names)
    return fitted(log, {"model": "process", "structure": named}, options)


@_options.takes(ProcessOptions)
def tf(
    log: Log | MeasuredResponse,
    np: int | Sequence[int],
    nz: int | Sequence[int] | None = None,
    *,
    delay: bool = False,
    **options: Unpack[ProcessOptions],
) -> Model:
    """Fit transfer functions in continuous time, y = B(s)/A(s) e^(-theta s) u, by the least errors of their free run.

    The search starts from refined instrumental variables (SRIVC). Inputs are held from row to row and the response is exact at the
    times of the rows: the clock may be irregular, and the dead time need not be a number of samples.

    Parameters
    ----------
    log : Log or MeasuredResponse
        As for `process`.
    np : int, or one for each input
        The number of poles, 1 to 6, all left of the imaginary axis. For an integrator among them see `process` with ``tf31i``.
    nz : int, or one for each input, optional
        The number of zeros, no more than poles; else one less.
    delay : bool
        Whether to search for a dead time of each input.
    initial : {"estimate", "zero"}
        Whether each log begins in a state that is estimated, which is the default, or at rest with the inputs of its first row.
    trend, offset
        As for `process`.
    estimate, validate, split, search, max_iterations, tolerance, step, starts, time_limit
        What to fit to and how to search, see `thetahat.FitOptions`.

    Returns
    -------
    Model
        Of kind "process", with the parameters b and a from the highest power of s on: A(s) = s^np + …

    Raises
    ------
    EstimationError, ValueError
        As for `arx`.

    Warns
    -----
    EstimationWarning
        For what a careful reader of the model should know.

    Examples
    --------
    >>> import numpy as np
    >>> import thetahat as th
    >>> t = 0.1 * np.arange(400)
    >>> u = np.where(t % 8 < 4, 1.0, 0.0)
    >>> y = np.zeros(400)
    >>> for k in range(400):  # 2 (1 - e^(-t) (1 + t)) after each step: 2/(s^2 + 2 s + 1)
    ...     for start in range(0, 40, 4):
    ...         since = max(t[k] - start, 0.0)
    ...         y[k] += (-1) ** (start // 4) * 2 * (1 - np.exp(-since) * (1 + since))
    >>> model = th.tf(th.Log(y, u, sample_time=0.1), np=2, nz=0)
    >>> dict(zip(model.parameter_names, np.round(model.parameters, 3).tolist()))
    {'b0': 2.0, 'a1': 2.0, 'a0': 1.0}
    """
    return fitted(log, {"model": "tf", "np": np, "nz": nz, "delay": delay or None}, options)
